// SPDX-License-Identifier: BSD-3-Clause
// The field along a line through the volume, exactly as the level has it, within the band that its error allows.

import { byId, coalesced, svg } from './dom.js';
import { add, length, mix } from './geometry.js';
import { makeKnob } from './place_knob.js';
import { titleOf } from './levels.js';
import { boundShown } from './promises.js';
import { clamp, significant, ticks } from './numbers.js';

const margin = { left: 52, right: 10, top: 8, bottom: 20 };

/**
 * For each end of a piece: its distance, place, value, and the bounds of the original's: `bounds` has how far that may
 * be off.
 */
export function rowsOf(from, to, ends, bounds) {
  const whole = length(add(to, from, -1));
  return Array.from({ length: ends.length / 2 }, (_, i) => {
    const [at, value] = ends.subarray(2 * i, 2 * i + 2);
    return [at * whole, ...mix(from, to, at), value, value - bounds[i], value + bounds[i]];
  });
}

// Over the picture.
const plotHtml = `
  <section id="line-plot" class="chart" aria-labelledby="line-words" hidden>
    <p id="line-words"></p>
    <button type="button" class="small" id="line-csv" title="Save the values as CSV">CSV</button>
    <button type="button" class="small" id="line-vtp"
      title="Save the line with its values, for ParaView and VTK">VTP</button>
    <button type="button" class="small" id="line-close" aria-label="No plot over a line">×</button>
    <svg id="line-drawing" role="img" aria-label="The values along the line"></svg>
  </section>`;

export class LinePlot {
  // `save(name, blob)`
  constructor(viewer, layer, save) {
    Object.assign(this, { viewer, save, shown: null });
    byId('probe').insertAdjacentHTML('afterend', plotHtml);
    this.box = byId('line-plot');
    this.drawing = byId('line-drawing');
    this.overlay = svg('svg', { class: 'outlines', 'aria-hidden': 'true' });
    this.lines = ['along rim', 'along'].map((name) => svg('line', { class: name })); // the rim, then the line on it
    this.overlay.append(...this.lines);
    layer.append(this.overlay);
    this.knobs = [0, 1].map((end) => this.makeKnob(layer, end));
    this.sample = coalesced(() => this.ask());
    for (const kind of ['csv', 'vtp']) byId(`line-${kind}`).addEventListener('click', () => this.saveAs(kind));
    byId('line-close').addEventListener('click', () => viewer.store.set({ line: null }));
    this.drawing.addEventListener('pointermove', (event) => this.tellValue(event.offsetX));
    this.drawing.addEventListener('pointerleave', () => this.tellBound());
    viewer.store.watch(['line', 'field', 'cells', 'component', 'formula'], () => this.sample());
    viewer.addEventListener('pictures', ({ detail: { t } }) => t === 1 && this.sample());
    new ResizeObserver(() => this.draw()).observe(this.drawing);
  }

  // ---- in the picture

  world(end) {
    const {
      info,
      store: { state },
    } = this.viewer;
    const [low, high] = info.bounds;
    return low.map((l, i) => l + state.line[3 * end + i] * (high[i] - l));
  }

  update() {
    const {
      scene,
      store: { state },
    } = this.viewer;
    const places = state.line ? [0, 1].map((end) => scene.toScreen(add(this.world(end), scene.centre, -1))) : [];
    const hidden = !places.length || places.some(({ depth }) => depth > 1); // behind the camera
    this.overlay.classList.toggle('hidden', hidden);
    this.knobs.forEach((knob, end) => {
      knob.hidden = hidden;
      if (!hidden) knob.style.transform = `translate(${places[end].x}px, ${places[end].y}px)`;
    });
    if (hidden) return;
    const ends = { x1: places[0].x, y1: places[0].y, x2: places[1].x, y2: places[1].y };
    for (const line of this.lines)
      for (const [name, value] of Object.entries(ends)) line.setAttribute(name, value.toFixed(1));
  }

  /** The line in a saved picture; `factor`: its pixels of one on the screen. */
  drawOn(context, { width, height }, factor) {
    const {
      scene,
      store: { state },
    } = this.viewer;
    const places = state.line
      ? [0, 1].map((end) => scene.toPicture(add(this.world(end), scene.centre, -1), [width, height]))
      : [];
    if (!places.length || places.some(({ depth }) => depth > 1)) return;
    context.save();
    this.lines.forEach((line, inner) => {
      const { stroke, strokeWidth } = getComputedStyle(line);
      Object.assign(context, { strokeStyle: stroke, fillStyle: stroke, lineWidth: parseFloat(strokeWidth) * factor });
      context.beginPath();
      for (const { x, y } of places) context.lineTo(x, y);
      context.stroke();
      for (const { x, y } of places) {
        context.beginPath();
        context.arc(x, y, (inner ? 6 : 9) * factor, 0, 2 * Math.PI); // a knob within its border
        context.fill();
      }
    });
    context.restore();
  }

  makeKnob(layer, end) {
    const at = { place: () => this.world(end), move: (to) => this.move(end, to) };
    return makeKnob(layer, this.viewer.scene, `Line: ${end ? 'end' : 'begin'}; drag, or arrow keys`, at);
  }

  move(end, to) {
    const {
      info: {
        bounds: [low, high],
      },
      store,
    } = this.viewer;
    const line = [...store.state.line];
    to.forEach((c, i) => {
      line[3 * end + i] = Number(clamp((c - low[i]) / (high[i] - low[i] || 1), 0, 1).toPrecision(4));
    });
    store.set({ line });
  }

  // ---- the values

  // One question at a time, the last line next.
  async ask() {
    const { viewer } = this;
    const { line } = viewer.store.state;
    this.box.hidden = !line;
    this.update();
    if (!line || this.asking || !viewer.stream.fields.includes(viewer.store.state.field)) return;
    this.asking = true;
    const [from, to] = [this.world(0), this.world(1)];
    const answer = await viewer.stream.line(from, to).catch(() => null); // a closed stream has no values
    this.asking = false;
    if (!answer) return;
    const { told: info, coloredState: state } = viewer;
    const { bound, words } = boundShown(
      info,
      answer.level,
      state,
      answer.bounds?.reduce((most, b) => Math.max(most, b), 0),
    );
    const bounds = answer.bounds ?? new Float64Array(answer.ends.length / 2).fill(bound);
    this.shown = { ...answer, from, to, title: titleOf(info, state), bound, bounds, words };
    this.draw();
    if (line !== viewer.store.state.line) this.sample();
  }

  extent() {
    const { ends, bound } = this.shown;
    let [low, high] = [Infinity, -Infinity];
    for (let i = 1; i < ends.length; i += 2) {
      low = Math.min(low, ends[i]);
      high = Math.max(high, ends[i]);
    }
    const room = Math.min(bound, high - low) || Math.abs(high) * 1e-3 || 1; // a wide band does not flatten the curve
    return [low - room, high + room];
  }

  draw() {
    const { width, height } = this.drawing.getBoundingClientRect();
    if (!this.shown || this.box.hidden || !width) return;
    const { ends, from, to, bounds } = this.shown;
    if (!ends.length)
      return this.drawing.replaceChildren(
        svg('text', { x: width / 2, y: height / 2 }, 'The line does not meet what is drawn.'),
      );
    const [low, high] = this.extent();
    const whole = length(add(to, from, -1));
    this.x = (at) => margin.left + at * (width - margin.left - margin.right);
    this.y = (value) =>
      height - margin.bottom - ((clamp(value, low, high) - low) / (high - low)) * (height - margin.top - margin.bottom);
    const place = (i, side) => `${this.x(ends[i]).toFixed(1)},${this.y(ends[i + 1] + side * bounds[i / 2]).toFixed(1)}`;
    let [band, curve] = ['', ''];
    for (let i = 0; i < ends.length; i += 4) {
      band += `M${place(i, 1)}L${place(i + 2, 1)}L${place(i + 2, -1)}L${place(i, -1)}Z`;
      curve += `M${place(i, 0)}L${place(i + 2, 0)}`;
    }
    const marks = [
      ...ticks(low, high, 3).map((v) =>
        svg('text', { class: 'value', x: margin.left - 6, y: this.y(v) }, significant(v, 3)),
      ),
      ...ticks(0, whole, 4).map((d) => svg('text', { x: this.x(d / whole), y: height - 8 }, significant(d, 3))),
    ];
    const rules = ticks(low, high, 3).map((v) =>
      svg('path', { class: 'grid', d: `M${margin.left},${this.y(v)}H${width - margin.right}` }),
    );
    this.drawing.replaceChildren(
      ...rules,
      svg('path', { class: 'band', d: band }),
      svg('path', { class: 'line', d: curve }),
      ...marks,
    );
    this.tellBound();
  }

  tellBound() {
    if (!this.shown) return;
    const whole = length(add(this.shown.to, this.shown.from, -1));
    byId('line-words').textContent = `${this.shown.title} ${this.shown.words}, length ${significant(whole, 4)}`;
  }

  tellValue(offset) {
    const { ends, bound, bounds, from, to } = this.shown ?? { ends: [] };
    if (!ends.length || !this.x) return;
    const at = (offset - this.x(0)) / (this.x(1) - this.x(0));
    for (let i = 0; i < ends.length; i += 4) {
      if (at < ends[i] || at > ends[i + 2]) continue;
      const between = (a, b) => a + ((at - ends[i]) / (ends[i + 2] - ends[i])) * (b - a);
      const allowed = bound === null ? '' : ` ± ${significant(between(bounds[i / 2], bounds[i / 2 + 1]), 2)}`;
      byId('line-words').textContent = `${significant(between(ends[i + 1], ends[i + 3]), 5)}${allowed} at ${mix(
        from,
        to,
        at,
      )
        .map((c) => significant(c, 4))
        .join(', ')}`;
      return;
    }
  }

  // Each piece is a line of its own, so that gaps stay gaps.
  async saveAs(kind) {
    const { title, from, to, ends, bound, bounds } = this.shown;
    const { csvOf, vtpOf } = await import('./surface_files.js');
    const rows = rowsOf(from, to, ends, bounds);
    const column = (k) => Float64Array.from(rows, (row) => row[k]);
    const names = [
      [title, 4],
      ['distance', 0],
      ...(bound === null
        ? []
        : [
            ['at least', 5],
            ['at most', 6],
          ]),
    ];
    const columns = ['distance', 'x', 'y', 'z', title, 'at least', 'at most'].slice(0, bound === null ? 5 : 7);
    this.save(
      `line.${kind}`,
      kind === 'csv'
        ? new Blob(
            [
              csvOf(
                columns,
                rows.map((row) => row.slice(0, columns.length)),
              ),
            ],
            { type: 'text/csv' },
          )
        : vtpOf({
            positions: Float64Array.from(rows.flatMap((row) => row.slice(1, 4))),
            arrays: names.map(([name, k]) => [name, column(k)]),
            lines: [...rows.keys()],
          }),
    );
  }
}
