// SPDX-License-Identifier: BSD-3-Clause
// What the picture's level proves of the original: extremes, means, volumes, answers to questions; and marks of maxima
// and minima, solid where the original certainly has one, hollow where it may have one.

import { byId, coalesced, element } from './dom.js';
import { add } from './geometry.js';
import { colouredOf, isosurfacesOf, unitOf } from './levels.js';
import { clamp, count, parseNumber, percent, significant } from './numbers.js';
import { row } from './rows.js';

const most = 200; // marks in the picture
const within = 0.005; // of what an answer can be at most: how narrow it should be
const glyphs = { maximum: ['△', '▲'], minimum: ['▽', '▼'] }; // possible, proven

/** The field that colours as questions name it, or null: values of cells and functions have no certain answers. */
export function quantityOf(info, state) {
  const { field, cells, component, formula } = colouredOf(info, state);
  if (cells || formula || field.bounds || field.name.includes('"')) return null;
  const name = `"${field.name}"`;
  if (field.components === 1) return name;
  return component === 'magnitude' ? `|${name}|` : `${name}:${component}`;
}

/** 'from … to …', with digits that the width is worth, rounded outwards. */
export function intervalWords({ lower, upper }, unit = '') {
  const size = Math.max(Math.abs(lower), Math.abs(upper));
  const behind = unit && ` ${unit}`;
  if (!(upper - lower > 1e-9 * size)) return `${significant((lower + upper) / 2, 7)}${behind}`;
  const power = Math.floor(Math.log10((upper - lower) / 20));
  const digits = Math.ceil(Math.log10(size)) - power + 1;
  const [low, high] = [Math.floor, Math.ceil].map((round, i) => round([lower, upper][i] / 10 ** power) * 10 ** power);
  return `${significant(low, digits)} to ${significant(high, digits)}${behind}`;
}

/** 'at least 2 and at most 9 maxima' of what stream.features gives. */
export function countWords({ features, bounded }, kind) {
  const of = features.filter((feature) => feature.kind === kind);
  const proven = of.filter((feature) => feature.proven).length;
  const least = count(proven);
  const open = bounded[kind] && of.length > proven ? ` and at most ${count(of.length)}` : '';
  const name = proven === 1 && !open ? kind : kind.replace(/um$/, 'a');
  return `${bounded[kind] && !open ? '' : 'at least '}${least}${open} ${name}`;
}

export class Certain {
  #viewer;
  #layer;
  #parts;
  #marks = [];
  #asked = 0;

  constructor(viewer, layer) {
    this.#viewer = viewer;
    this.#layer = layer;
    this.#parts = this.#build();
    const soon = coalesced(() => this.#refresh());
    viewer.store.watch(['field', 'cells', 'component', 'formula', 'isosurfaces'], soon);
    viewer.addEventListener('pictures', ({ detail: { t } }) => t === 1 && soon());
    this.#parts.details.addEventListener('toggle', soon);
    for (const name of ['marks', 'persistence']) this.#parts[name].addEventListener('change', soon);
  }

  #build() {
    const list = element('dl', { id: 'certain-list' });
    const question = element('input', { id: 'certain-question', className: 'number' });
    question.ariaLabel = 'A question about the original';
    question.placeholder = 'volume(p > 3) in box(0,0,0, 1,1,1)';
    const ask = element('button', { type: 'button', id: 'certain-ask', className: 'small' }, 'ask');
    const answer = element('p', { id: 'certain-answer', className: 'hint' });
    const marks = element('input', { id: 'certain-marks', className: 'switch', type: 'checkbox' });
    const persistence = element('input', { id: 'certain-persistence', className: 'number', inputMode: 'decimal' });
    persistence.value = '2';
    const words = element('p', { id: 'certain-words', className: 'hint' });
    answer.role = words.role = 'status';
    const details = element(
      'details',
      { id: 'certain' },
      element('summary', {}, 'What is certain of this picture'),
      list,
      element('div', { className: 'row' }, question, ask),
      answer,
      row('Marks of maxima and minima', marks),
      row('Persistence, %', persistence),
      words,
    );
    byId('refine').after(details);
    const put = () => this.#ask(question.value);
    ask.addEventListener('click', put);
    question.addEventListener('keydown', ({ key }) => key === 'Enter' && put());
    return { details, list, question, answer, marks, persistence, words };
  }

  async #ask(question) {
    const { answer } = this.#parts;
    if (!question.trim()) return;
    answer.textContent = '…';
    try {
      const found = await this.#viewer.stream.ask(question, { within });
      answer.textContent = `${intervalWords(found)}, ${this.#source(found)}`;
    } catch (error) {
      answer.textContent = error.message;
    }
  }

  #source({ bound, level }) {
    return level === undefined ? `${bound}, by the stream’s index` : `${bound}, by level ${level}`;
  }

  // What the list asks: [what, question, unit].
  #questions(quantity) {
    const { info, store } = this.#viewer;
    const unit = unitOf(info, store.state.field);
    const [low, high] = this.#viewer.dataRange();
    const colored = isosurfacesOf(info, store.state).colored ? store.state.isosurfaces.slice(0, 3) : [];
    const values = colored.map((t) => low + t * (high - low));
    return [
      ['Least value', `min(${quantity})`, unit],
      ['Greatest value', `max(${quantity})`, unit],
      ['Mean', `mean(${quantity})`, unit],
      ['Volume', 'volume()', ''],
      ...values.map((value) => [`Volume above ${significant(value, 4)}`, `volume(${quantity} > ${value})`, '']),
    ];
  }

  // Whether there are answers; else the reason.
  get #reason() {
    const { info, at, store, level } = this.#viewer;
    if (level < 0) return 'Nothing is shown yet.';
    if (at) return 'Of steps in time, tetlod ask --step answers.';
    return quantityOf(info, store.state) ? '' : 'Values of cells, functions and bounds have no certain answers.';
  }

  async #refresh() {
    const { details, words, marks } = this.#parts;
    const asked = ++this.#asked;
    if (!details.open) return this.#show([]);
    const reason = this.#reason;
    words.textContent = reason;
    if (reason) this.#parts.list.replaceChildren();
    if (reason || !marks.checked) this.#show([]);
    if (reason) return;
    const quantity = quantityOf(this.#viewer.info, this.#viewer.store.state);
    await this.#list(quantity, asked);
    if (marks.checked && asked === this.#asked) await this.#find(quantity, asked);
  }

  async #list(quantity, asked) {
    const rows = [];
    for (const [what, question, unit] of this.#questions(quantity)) {
      const words = await this.#viewer.stream.ask(question, { within }).then(
        (found) => [intervalWords(found, unit), this.#source(found)],
        (error) => [error.message, ''],
      );
      if (asked !== this.#asked) return;
      rows.push(element('div', { title: question }, element('dt', {}, what),
                        element('dd', {}, words[0], element('small', {}, words[1]))));
    }
    this.#parts.list.replaceChildren(...rows);
  }

  async #find(quantity, asked) {
    const { persistence, words } = this.#parts;
    const share = clamp(parseNumber(persistence.value) / 100 || 0.02, 1e-6, 1);
    try {
      const found = await this.#viewer.stream.features(quantity, { persistence: share });
      if (asked !== this.#asked) return;
      const left = Math.max(found.features.length - most, 0);
      words.textContent =
        `The original has ${countWords(found, 'maximum')} and ${countWords(found, 'minimum')} of a persistence above ` +
        `${percent(share)}. Solid marks are proven, hollow ones possible` +
        `${left ? `; ${count(left)} more are not drawn` : ''}.`;
      this.#show(found.features.slice(0, most));
    } catch (error) {
      words.textContent = error.message;
      this.#show([]);
    }
  }

  #show(features) {
    for (const { mark } of this.#marks) mark.remove();
    this.#marks = features.map(({ kind, proven, at, range, persistence }) => {
      const state = proven ? 'proven' : 'possible';
      const text = glyphs[kind][Number(proven)];
      const mark = element('div', { className: `mark ${state} ${kind}` }, text);
      mark.title = `${state} ${kind}, ${intervalWords({ lower: range[0], upper: range[1] })}, ` +
        `persistence ${proven ? 'at least' : 'about'} ${significant(persistence, 3)}`;
      this.#layer.append(mark);
      return { mark, at };
    });
    this.update();
  }

  #place(toPicture, at) {
    return toPicture(add(at, this.#viewer.scene.centre, -1));
  }

  /** Where the marks are in the picture now. */
  update() {
    const { scene } = this.#viewer;
    for (const { mark, at } of this.#marks) {
      const { x, y, depth } = this.#place((point) => scene.toScreen(point), at);
      mark.hidden = depth > 1;
      mark.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
    }
  }

  /** The same in a saved picture; `factor`: its pixels of one on the screen. */
  drawOn(context, { width, height }, factor) {
    const { scene } = this.#viewer;
    for (const { mark, at } of this.#marks) {
      const { x, y, depth } = this.#place((point) => scene.toPicture(point, [width, height]), at);
      if (depth > 1) continue;
      const { color, fontSize, fontFamily } = getComputedStyle(mark);
      context.save();
      context.translate(x, y);
      context.scale(factor, factor);
      context.font = `${fontSize} ${fontFamily}`;
      context.textAlign = 'center';
      context.textBaseline = 'middle';
      context.fillStyle = color;
      context.fillText(mark.textContent, 0, 0);
      context.restore();
    }
  }
}
