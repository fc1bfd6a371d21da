// SPDX-License-Identifier: BSD-3-Clause
// Probes that stay: values at places of the volume with what the level's error allows, and how far apart the places
// are.

import { byId, coalesced, element } from './dom.js';
import { add, length } from './geometry.js';
import { colouredOf, localBoundOf, titleOf } from './levels.js';
import { boundShown, formulaBound } from './promises.js';
import { notice } from './notices.js';
import { significant } from './numbers.js';

// A line of text on its background, where the screen has it: `left` and the half of its height from the point that it
// marks.
// Words in as many lines as they need to be no wider than that.
function linesOf(context, text, width) {
  const lines = [];
  for (const word of text.split(' ')) {
    const longer = lines.length ? `${lines.at(-1)} ${word}` : word;
    if (lines.length && context.measureText(longer).width <= width) lines[lines.length - 1] = longer;
    else lines.push(word);
  }
  return lines;
}

function drawLabel(context, part, left, origin) {
  const box = part.getBoundingClientRect();
  const { backgroundColor, borderRadius, color, font } = getComputedStyle(part);
  const [x, y] = [box.left - origin.left + left, box.top - origin.top - 10];
  Object.assign(context, { fillStyle: backgroundColor, font, textAlign: 'center', textBaseline: 'middle' });
  context.beginPath();
  context.roundRect(
    x,
    y,
    box.width,
    box.height,
    borderRadius.endsWith('%') ? box.height / 2 : parseFloat(borderRadius),
  );
  context.fill();
  context.fillStyle = color;
  const lines = linesOf(context, part.textContent, box.width - 8);
  lines.forEach((line, i) => context.fillText(line, x + box.width / 2, y + (box.height * (i + 0.5)) / lines.length));
}

export class Pins {
  // `pointer()`: where the pointer is in the picture, or null
  constructor(viewer, layer, pointer) {
    Object.assign(this, { viewer, layer, pointer, list: byId('pins'), marks: [] });
    this.ask = coalesced(() => this.#ask());
    byId('add-pin').addEventListener('click', () => this.#add(null));
    viewer.addEventListener('series', () => this.#list());
    viewer.store.watch(['pins', 'notes', 'field', 'cells', 'component', 'formula'], () => {
      this.#list();
      this.ask();
    });
    viewer.addEventListener('pictures', ({ detail: { t } }) => t === 1 && this.ask());
  }

  /** What is seen under the pointer, or in the middle of the picture. */
  add() {
    this.#add(this.pointer());
  }

  #add(at) {
    const {
      scene,
      store,
      info: {
        bounds: [low, high],
      },
    } = this.viewer;
    const { width, height } = scene.container.getBoundingClientRect();
    const hit = scene.pick(at?.x ?? width / 2, at?.y ?? height / 2);
    if (!hit) return notice('pin', `Nothing is seen ${at ? 'under the pointer' : 'in the middle of the picture'}.`);
    const pin = add(hit.point, scene.centre).map((c, i) =>
      Number(((c - low[i]) / (high[i] - low[i] || 1)).toPrecision(5)),
    );
    store.set({ pins: [...store.state.pins, pin.map((x) => Math.min(1, Math.max(0, x)))] });
  }

  #world(pin) {
    const [low, high] = this.viewer.info.bounds;
    return pin.map((x, i) => low[i] + x * (high[i] - low[i]));
  }

  #list() {
    const { store, scene } = this.viewer;
    const { pins, notes } = store.state;
    for (const { mark } of this.marks) mark.remove();
    this.marks = pins.map((pin, i) => {
      const place = this.#world(pin);
      const mark = element('div', { className: 'pin' }, element('b', {}, String(i + 1)), element('span'));
      const value = element('span', {}, '…');
      const remove = element(
        'button',
        { type: 'button', className: 'remove', ariaLabel: `Remove probe ${i + 1}` },
        '×',
      );
      const without = (list) => list.filter((_, k) => k !== i);
      remove.addEventListener('click', () => store.set({ pins: without(pins), notes: without(notes) }));
      const apart = i
        ? element('small', {}, `${significant(length(add(place, this.#world(pins[i - 1]), -1)), 4)} from ${i}`)
        : '';
      const row = element(
        'div',
        { className: 'item pinned' },
        element('b', {}, String(i + 1)),
        element('div', {}, value, element('small', {}, `at ${place.map((c) => significant(c, 4)).join(', ')}`), apart),
        remove,
        this.#below(i, place),
      );
      this.layer.append(mark);
      return { place, mark, value, row, note: notes[i] ?? '' };
    });
    this.list.replaceChildren(...this.marks.map(({ row }) => row));
    scene.render();
  }

  // What somebody writes there, and the values of all steps.
  #below(i, place) {
    const { store, series } = this.viewer;
    const note = element('input', {
      className: 'number',
      ariaLabel: `Note at probe ${i + 1}`,
      placeholder: 'note',
      value: store.state.notes[i] ?? '',
    });
    note.addEventListener('change', () => {
      const notes = store.state.pins.map((_, k) => (k === i ? note.value.trim() : (store.state.notes[k] ?? '')));
      store.set({ notes: notes.some(Boolean) ? notes : [] });
    });
    if (!series) return note;
    const label = `Values at probe ${i + 1} over time`;
    const over = element('button', { type: 'button', className: 'small', ariaLabel: label }, 'over time');
    over.addEventListener('click', async () => (await import('./time_plot.js')).plotOverTime(this.viewer, i, place));
    return element('span', { className: 'row' }, note, over);
  }

  // Where the marks are in the picture now.
  update() {
    const { scene } = this.viewer;
    for (const { place, mark } of this.marks) {
      const { x, y, depth } = scene.toScreen(add(place, scene.centre, -1));
      mark.hidden = depth > 1;
      mark.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
    }
  }

  /** The same in a saved picture; `factor`: its pixels of one on the screen. */
  drawOn(context, { width, height }, factor) {
    const { scene } = this.viewer;
    for (const { place, mark } of this.marks) {
      const { x, y, depth } = scene.toPicture(add(place, scene.centre, -1), [width, height]);
      if (depth > 1) continue;
      const origin = mark.getBoundingClientRect();
      context.save();
      context.translate(x, y);
      context.scale(factor, factor);
      for (const part of mark.children) drawLabel(context, part, -10, origin);
      context.restore();
    }
  }

  async #ask() {
    const { viewer, marks } = this;
    const {
      told: info,
      level,
      store: { state },
      stream,
    } = viewer;
    if (level < 0 || !stream.fields.includes(state.field)) return;
    const {
      field: { name },
      cells,
      component,
      formula,
    } = colouredOf(info, viewer.coloredState);
    for (const { place, mark, value, note } of marks) {
      const answer = await stream.probe(place).catch(() => null);
      if (marks !== this.marks) return;
      const found = answer?.[cells ? 'cells' : 'values'][name];
      const local =
        answer?.values[localBoundOf(info, name)]?.[0] * (component === 'magnitude' ? Math.sqrt(found.length) : 1);
      const { words } =
        formula && answer
          ? formulaBound(formula, info, level, answer.values)
          : boundShown(info, answer?.level ?? level, viewer.coloredState, local >= 0 ? local : undefined, answer?.part);
      const number =
        found &&
        significant(
          formula
            ? formula.valueAt(answer.values)
            : component === 'magnitude'
              ? Math.hypot(...found)
              : found[component],
          5,
        );
      value.textContent = found
        ? `${titleOf(info, viewer.coloredState)} ${number} ${words}${local > 0 ? ' here' : ''}`
        : 'nothing is drawn here';
      mark.lastChild.textContent = `${note}${note && ': '}${found ? number : 'nothing'}`;
    }
  }
}
