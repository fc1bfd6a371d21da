// SPDX-License-Identifier: BSD-3-Clause
// Boxes in which the mesh is finer than elsewhere: a click refines there, knobs move them.

import { byId, element } from './dom.js';
import { add, corners, length } from './geometry.js';
import { notice } from './notices.js';
import { clamp, count, parseNumber, percent, significant } from './numbers.js';
import { makeKnob } from './place_knob.js';
import { row } from './rows.js';

const share = 0.125; // of the picture's height, that a box reaches to each side
const gain = 10; // times smaller than elsewhere is the error in boxes at first
const mostBoxes = 16;
const transition = [0.93, 0.42, 0.1]; // the colour of edges where levels meet
const overBudget = 'have no more than the budget of tetrahedra and bytes allows';
const boxEdges = Uint32Array.from([0, 1, 0, 2, 0, 4, 1, 3, 1, 5, 2, 3, 2, 6, 3, 7, 4, 5, 4, 6, 5, 7, 6, 7]);

const middleOf = (box) => [0, 1, 2].map((i) => (box[i] + box[3 + i]) / 2);
const rounded = (x) => Number(clamp(x, 0, 1).toPrecision(5));

// One surface's points and lines after the other.
function joined(parts) {
  const points = new Float32Array(parts.reduce((sum, part) => sum + part.points.length, 0));
  const lines = new Uint32Array(parts.reduce((sum, part) => sum + part.lines.length, 0));
  let [at, line] = [0, 0];
  for (const part of parts) {
    points.set(part.points, at);
    part.lines.forEach((v, i) => {
      lines[line + i] = v + at / 3;
    });
    at += part.points.length;
    line += part.lines.length;
  }
  return { points, lines };
}

export class RefineHere {
  #viewer;
  #layer;
  #pointer;
  #parts;
  #knobs = [];
  #drawn = null;

  constructor(viewer, layer, pointer) {
    this.#viewer = viewer;
    this.#layer = layer;
    this.#pointer = pointer;
    this.#parts = this.#build();
    viewer.store.watch(['refine'], () => this.#list());
    viewer.addEventListener('pictures', () => this.#draw());
    viewer.addEventListener('info', () => this.#tell());
    this.#draw();
  }

  #build() {
    const error = element('input', { id: 'refine-error', className: 'number', inputMode: 'decimal' });
    const title = 'What is in the middle of the picture; the key R takes what is under the pointer';
    const named = { id: 'refine-here', title, ariaLabel: 'Add a box' };
    const here = element('button', { type: 'button', className: 'small', ...named }, 'add');
    const list = element('div', { id: 'refine-list' });
    const words = element('p', { id: 'refine-words', className: 'hint' });
    const details = element(
      'details',
      { id: 'refine' },
      element('summary', {}, 'Finer in boxes'),
      row('A box with more detail', here),
      list,
      row('Error in boxes, %', error),
      words,
    );
    byId('max-tets').closest('details').after(details);
    here.addEventListener('click', () => this.add());
    error.addEventListener('change', () => {
      const value = parseNumber(error.value) / 100;
      const { refine } = this.#viewer.store.state;
      if (value >= 0 && refine) this.#viewer.store.set({ refine: { ...refine, error: Math.min(value, 1) } });
      this.#list();
    });
    return { details, error, list, words };
  }

  /** About what is seen at a place of the picture; without one: under the pointer, or in the middle. */
  add(at = this.#pointer()) {
    const {
      scene,
      store,
      info: {
        bounds: [low, high],
      },
    } = this.#viewer;
    const { width, height } = scene.container.getBoundingClientRect();
    const [x, y] = at ? [at.x, at.y] : [width / 2, height / 2];
    const hit = scene.pick(x, y);
    if (!hit) return notice('refine', `Nothing is seen ${at ? 'under the pointer' : 'in the middle of the picture'}.`);
    const { depth } = scene.toScreen(hit.point);
    const [from, to] = [0, share * height].map((way) => scene.toWorld(x, y + way, depth));
    const reach = length(add(to, from, -1));
    const centre = add(hit.point, scene.centre);
    const fraction = (c, i) => rounded((c - low[i]) / (high[i] - low[i] || 1));
    const box = [-1, 1].flatMap((side) => centre.map((c, i) => fraction(c + side * reach, i)));
    const { refine, error } = store.state;
    const boxes = [...(refine?.boxes ?? []), box].slice(-mostBoxes);
    this.#parts.details.open = true;
    store.set({ refine: { boxes, error: refine?.error ?? Number((error / gain).toPrecision(3)) } });
  }

  #put(i, box) {
    const { store } = this.#viewer;
    const { refine } = store.state;
    store.set({ refine: { ...refine, boxes: refine.boxes.map((b, k) => (k === i ? box.map(rounded) : b)) } });
  }

  #world(fractions) {
    const [low, high] = this.#viewer.info.bounds;
    return fractions.map((x, i) => low[i] + x * (high[i] - low[i]));
  }

  // Its size stays, but for what would be outside of the bounds.
  #move(i, to) {
    const {
      info: {
        bounds: [low, high],
      },
      store: {
        state: { refine },
      },
    } = this.#viewer;
    const box = refine.boxes[i];
    const centre = middleOf(box);
    const shift = to.map((c, d) => (c - low[d]) / (high[d] - low[d] || 1) - centre[d]);
    this.#put(
      i,
      box.map((x, d) => x + shift[d % 3]),
    );
  }

  #scale(i, factor) {
    const box = this.#viewer.store.state.refine.boxes[i];
    const centre = middleOf(box);
    this.#put(
      i,
      box.map((x, d) => centre[d % 3] + factor * (x - centre[d % 3])),
    );
  }

  #remove(i) {
    const { store } = this.#viewer;
    const { refine } = store.state;
    const boxes = refine.boxes.filter((_, k) => k !== i);
    store.set({ refine: boxes.length ? { ...refine, boxes } : null });
  }

  #rowOf(box, i) {
    const button = (text, label, act) => {
      const made = element('button', { type: 'button', className: 'small', ariaLabel: `Box ${i + 1}: ${label}` }, text);
      made.addEventListener('click', act);
      return made;
    };
    const remove = button('×', 'remove', () => this.#remove(i));
    remove.className = 'remove';
    const place = this.#world(middleOf(box))
      .map((c) => significant(c, 3))
      .join(', ');
    const sizes = element(
      'span',
      { className: 'buttons' },
      button('−', 'smaller', () => this.#scale(i, 0.8)),
      button('+', 'larger', () => this.#scale(i, 1.25)),
    );
    const middle = element('div', {}, sizes, element('small', {}, `at ${place}`));
    return element('div', { className: 'item pinned' }, element('b', {}, String(i + 1)), middle, remove);
  }

  #list() {
    const { refine } = this.#viewer.store.state;
    const { list, error, details } = this.#parts;
    const boxes = refine?.boxes ?? [];
    const focused = [...list.querySelectorAll('button')].indexOf(document.activeElement);
    list.replaceChildren(...boxes.map((box, i) => this.#rowOf(box, i)));
    list.querySelectorAll('button')[focused]?.focus();
    error.disabled = !boxes.length;
    error.value = refine ? significant(100 * refine.error, 4) : '';
    if (boxes.length) details.open = true;
    while (this.#knobs.length > boxes.length) this.#knobs.pop().remove();
    while (this.#knobs.length < boxes.length) this.#knobs.push(this.#makeKnob(this.#knobs.length));
    this.#drawBoxes();
    this.#tell();
    this.update();
  }

  #makeKnob(i) {
    const place = () => this.#world(middleOf(this.#viewer.store.state.refine.boxes[i]));
    const at = { place, move: (to) => this.#move(i, to) };
    return makeKnob(this.#layer, this.#viewer.scene, `Finer in box ${i + 1}; drag, or arrow keys`, at);
  }

  #drawBoxes() {
    const {
      scene,
      store: {
        state: { refine },
      },
    } = this.#viewer;
    if (!refine) return scene.setEdges('boxes', null, null);
    const origin = add(scene.centre, scene.offset);
    const cornersOf = (box) => corners([this.#world(box.slice(0, 3)), this.#world(box.slice(3))]);
    const pointsOf = (box) => cornersOf(box).flatMap((corner) => add(corner, origin, -1));
    const { points, lines } = joined(refine.boxes.map((box) => ({ points: pointsOf(box), lines: boxEdges })));
    scene.setEdges('boxes', points, lines, scene.lineInk);
  }

  // Where levels meet.
  #draw() {
    const { finer, scene } = this.#viewer;
    if (finer?.edges === this.#drawn?.edges) return;
    this.#drawn = finer;
    const made = finer && joined(finer.edges);
    scene.setEdges('transition', made?.points, made?.lines, transition);
  }

  #tell() {
    this.#parts.words.textContent = this.#words;
  }

  get #words() {
    const {
      finer,
      info,
      level,
      at,
      store: { state },
    } = this.#viewer;
    if (!state.refine) return 'Shift with a double click refines there.';
    if (at) return 'Steps in time are shown without boxes.';
    if (finer?.pages >= 0) {
      const what = finer.boxLevel === undefined ? overBudget : `have level ${finer.boxLevel}`;
      return (
        `${count(finer.pages)} pages ${what} in boxes. ` +
        'Levels meet without gaps; what is between them is as certain as the coarser one.'
      );
    }
    if (finer)
      return (
        `${count(finer.inside)} tetrahedra of level ${finer.boxLevel} in boxes; ${count(finer.between)}, ` +
        'with orange edges, where levels meet: nothing is certified of these.'
      );
    if (level === info.levels.length - 1) return 'Everything is as fine as it is stored.';
    return `On the way to ${percent(state.refine.error)} in boxes, unless all is that fine.`;
  }

  /** After every frame. */
  update() {
    const {
      scene,
      store: {
        state: { refine },
      },
    } = this.#viewer;
    this.#knobs.forEach((knob, i) => {
      const place = this.#world(middleOf(refine.boxes[i]));
      const { x, y, depth } = scene.toScreen(add(place, scene.centre, -1));
      knob.hidden = depth > 1;
      if (!knob.hidden) knob.style.transform = `translate(${x}px, ${y}px)`;
    });
  }
}
