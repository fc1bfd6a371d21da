// SPDX-License-Identifier: BSD-3-Clause
// The values of a series at one place over all its steps, within the band in which the original's are. A stream of its
// own goes through the steps: the picture stays where it is.

import { TetlodStream } from '../client/stream.js';
import { byId, element, svg } from './dom.js';
import { colouredOf, fieldOf, spanOf, titleOf } from './levels.js';
import { significant, ticks } from './numbers.js';
import { source } from './opened.js';
import { csvOf } from './surface_files.js';

const margin = { left: 52, right: 10, top: 8, bottom: 20 };

let shown = null; // of the last place: { close }

// What colours, of a probe; and how far it may be off.
function readerOf(viewer) {
  const state = viewer.coloredState;
  const { field, component, formula } = colouredOf(viewer.info, state);
  const valueOf = ({ values }) => {
    if (formula) return formula.valueAt(values);
    return component === 'magnitude' ? Math.hypot(...values[field.name]) : values[field.name][component];
  };
  const lengths = component === 'magnitude' ? Math.sqrt(field.components) : 1;
  const boundOf = (errors) =>
    formula || errors[field.name] === undefined
      ? null
      : lengths * errors[field.name] * spanOf(fieldOf(viewer.info, field.name));
  return { title: titleOf(viewer.info, state), fields: formula?.fields ?? [field.name], valueOf, boundOf };
}

// The rows [step, time, value, bound], one after the other as they come; of steps at which nothing is there: none.
async function* rowsOver(viewer, place, { fields, valueOf, boundOf }, signal) {
  const stream = await TetlodStream.open(source, { fields, signal });
  signal.addEventListener('abort', () => stream.close());
  try {
    let errors = {};
    stream.addEventListener('step', ({ detail }) => ({ errors } = detail));
    const { times } = viewer.series;
    if (!stream.series) await new Promise((resolve) => stream.addEventListener('series', resolve, { once: true }));
    for (let step = 0; step < times.length; step++) {
      await stream.seekStep(step, { band: viewer.wantedBand });
      const found = await stream.probe(place);
      if (found) yield [step, times[step], valueOf(found), boundOf(errors)];
    }
  } finally {
    stream.close();
  }
}

class Chart {
  rows = [];
  #viewer;
  #title;
  #drawing = svg('svg', { role: 'img', 'aria-label': 'The values over time' });
  #words = element('p', { id: 'time-words', role: 'status' });
  #at = null;

  constructor(viewer, title, close) {
    this.#viewer = viewer;
    this.#title = title;
    const button = (id, label, text, act) => {
      const made = element('button', { type: 'button', id, className: 'small', ariaLabel: label }, text);
      made.addEventListener('click', act);
      return made;
    };
    this.box = element(
      'section',
      { id: 'time-plot', className: 'chart', ariaLabel: 'Values over time' },
      this.#words,
      button('time-csv', 'Save the values over time as CSV', 'CSV', () => this.#save()),
      button('time-close', 'No plot over time', '×', close),
      this.#drawing,
    );
    byId('probe').after(this.box);
    this.#drawing.addEventListener('pointerdown', (event) => this.#go(event.offsetX));
  }

  tell(text) {
    this.#words.textContent = text;
  }

  draw() {
    const { rows } = this;
    const { width, height } = this.#drawing.getBoundingClientRect();
    if (!rows.length || !width) return;
    const { times } = this.#viewer.series;
    const [first, last] = [times[0], times.at(-1)];
    const reach = rows.flatMap(([, , value, bound]) => [value - (bound ?? 0), value + (bound ?? 0)]);
    let [low, high] = [Math.min(...reach), Math.max(...reach)];
    if (!(high > low)) [low, high] = [low - 1, high + 1];
    const x = (time) => margin.left + ((time - first) / (last - first || 1)) * (width - margin.left - margin.right);
    const y = (v) => height - margin.bottom - ((v - low) / (high - low)) * (height - margin.top - margin.bottom);
    const path = (list) =>
      list.map(([time, v], i) => `${i ? 'L' : 'M'}${x(time).toFixed(1)},${y(v).toFixed(1)}`).join('');
    const side = (sign) => rows.map(([, time, value, bound]) => [time, value + sign * (bound ?? 0)]);
    const rules = ticks(low, high, 3);
    const { at } = this.#viewer;
    this.#drawing.replaceChildren(
      ...rules.map((v) => svg('path', { class: 'grid', d: `M${margin.left},${y(v)}H${width - margin.right}` })),
      svg('path', { class: 'band', d: `${path([...side(1), ...side(-1).reverse()])}Z` }),
      svg('path', { class: 'line', d: path(side(0)) }),
      ...(at
        ? [svg('path', { class: 'now', d: `M${x(times[at.step])},${margin.top}V${height - margin.bottom}` })]
        : []),
      ...rules.map((v) => svg('text', { class: 'value', x: margin.left - 6, y: y(v) }, significant(v, 3))),
      ...ticks(first, last, 4).map((t) => svg('text', { x: x(t), y: height - 8 }, significant(t, 3))),
    );
    this.#at = (offset) => first + ((offset - margin.left) / (width - margin.left - margin.right)) * (last - first);
  }

  // The step whose time is nearest.
  #go(offset) {
    if (!this.#at) return;
    const time = this.#at(offset);
    const { times } = this.#viewer.series;
    const step = times.reduce((best, t, i) => (Math.abs(t - time) < Math.abs(times[best] - time) ? i : best), 0);
    this.#viewer.store.set({ step });
  }

  #save() {
    const isBound = this.rows.some(([, , , bound]) => bound !== null);
    const columns = ['step', 'time', this.#title, ...(isBound ? ['at least', 'at most'] : [])];
    const rows = this.rows.map(([step, time, value, bound]) => [
      ...[step, time, value],
      ...(isBound ? [value - bound, value + bound] : []),
    ]);
    this.#viewer.saveAs('time.csv', new Blob([csvOf(columns, rows)], { type: 'text/csv' }));
  }
}

/** A plot over the picture, which grows while the steps come. `i`: the probe's number. */
export async function plotOverTime(viewer, i, place) {
  shown?.close();
  const stop = new AbortController();
  const reader = readerOf(viewer);
  const redraw = () => chart.draw();
  const chart = new Chart(viewer, reader.title, () => shown.close());
  const mine = {
    close: () => {
      stop.abort();
      viewer.removeEventListener('step', redraw);
      chart.box.remove();
      if (shown === mine) shown = null;
    },
  };
  shown = mine;
  viewer.addEventListener('step', redraw);
  const { length } = viewer.series.times;
  chart.tell('On the way.');
  try {
    for await (const row of rowsOver(viewer, place, reader, stop.signal)) {
      chart.rows.push(row);
      chart.tell(`${reader.title} at probe ${i + 1}: step ${row[0] + 1} of ${length}`);
      chart.draw();
    }
    const bounds = chart.rows.map(([, , , bound]) => bound).filter((bound) => bound !== null);
    const within = bounds.length ? `, ± ${significant(Math.max(...bounds), 2)} at most` : '';
    chart.tell(chart.rows.length ? `${reader.title} at probe ${i + 1}${within}` : 'Nothing is drawn there.');
  } catch (error) {
    if (!stop.signal.aborted) chart.tell(error.message);
  }
}
