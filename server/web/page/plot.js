// SPDX-License-Identifier: BSD-3-Clause
// Error against bytes, both logarithmic: every level is a step, the wanted one a point that can be dragged.

import { svg } from './dom.js';
import { bytes, clamp, percent } from './numbers.js';

const box = { left: 46, right: 12, top: 10, bottom: 24 };

export class Plot {
  // `choose(level)` is called when the point is dragged
  constructor(drawing, choose) {
    Object.assign(this, { drawing, choose, levels: [], wanted: 0, shown: -1 });
    this.parts = svg('g');
    this.received = svg('rect', { class: 'received' });
    this.line = svg('path', { class: 'line' });
    this.present = svg('circle', { class: 'present', r: 3.5 });
    this.point = svg('circle', {
      id: 'plot-point',
      class: 'wanted',
      r: 6,
      tabindex: 0,
      role: 'slider',
      'aria-label': 'Level wanted',
      'aria-valuemin': 0,
    });
    drawing.append(this.received, this.parts, this.line, this.present, this.point);
    drawing.addEventListener('pointerdown', (event) => {
      event.preventDefault();
      drawing.setPointerCapture(event.pointerId);
      this.point.focus({ preventScroll: true });
      this.held = true;
      this.drag(event);
    });
    drawing.addEventListener('pointermove', (event) => this.held && this.drag(event));
    for (const end of ['pointerup', 'pointercancel']) drawing.addEventListener(end, () => (this.held = false));
    this.point.addEventListener('keydown', (event) => this.key(event));
    new ResizeObserver(() => this.draw()).observe(drawing);
  }

  // `levels`: [{ bytes, error }] from coarse to fine; levels of no error share a line below the least
  setLevels(levels, total) {
    this.levels = levels;
    this.total = total;
    const errors = levels.map((l) => l.error).filter((e) => e > 0);
    this.most = errors.length ? Math.max(...errors) : 1;
    this.least = errors.length ? Math.min(...errors) : 1;
    this.floor = this.least / Math.max(3, (this.most / this.least) ** 0.12);
    this.point.setAttribute('aria-valuemax', levels.length - 1);
    this.draw();
  }

  setLevel(wanted, shown, received) {
    Object.assign(this, { wanted, shown, got: received });
    this.place();
  }

  x(n) {
    const [first, last] = [Math.log(this.levels[0].bytes), Math.log(this.total)];
    return box.left + (clamp((Math.log(n) - first) / (last - first || 1), 0, 1)) * (this.width - box.left - box.right);
  }

  y(error) {
    const f = Math.log(this.most / Math.max(error, this.floor)) / (Math.log(this.most / this.floor) || 1);
    return box.top + clamp(f, 0, 1) * (this.height - box.top - box.bottom);
  }

  draw() {
    const { width, height } = this.drawing.getBoundingClientRect();
    if (!width || !this.levels.length) return;
    Object.assign(this, { width, height });
    this.drawing.setAttribute('viewBox', `0 0 ${width} ${height}`);
    this.line.setAttribute('d',
      this.levels
        .map((l, i) => `${i ? 'H' : 'M'}${this.x(l.bytes).toFixed(1)}${i ? 'V' : ','}${this.y(l.error).toFixed(1)}`)
        .join(''));
    this.parts.replaceChildren(...this.errorTicks(), ...this.byteTicks());
    this.place();
  }

  errorTicks() {
    const powers = [];
    for (let e = Math.floor(Math.log10(this.most)); 10 ** e >= this.least * 0.999; e--) powers.push(10 ** e);
    const every = Math.ceil(powers.length / 5);
    const few = powers.length < 3; // then halves and fifths between them, too
    const values = few ? [...powers, 10 ** Math.floor(Math.log10(this.least))].flatMap((p) => [5 * p, 2 * p, p])
                       : powers.filter((_, i) => i % every === 0);
    const rows = values.filter((v) => v <= this.most && v >= this.least)
                   .map((v) => [this.y(v), percent(v, 1).replace('\u202f', '')]);
    if (this.levels.at(-1).error === 0) rows.push([this.y(0), '0']);
    const apart = rows.filter(([y], i) => rows.slice(i + 1).every(([other]) => Math.abs(other - y) > 12));
    return apart.flatMap(([y, text]) => [
      svg('line', { class: 'grid', x1: box.left, x2: this.width - box.right, y1: y, y2: y }),
      svg('text', { x: box.left - 6, y: y + 3.5, 'text-anchor': 'end' }, text),
    ]);
  }

  byteTicks() {
    const [first, last] = [this.levels[0].bytes, this.total];
    const candidates = [];
    for (let p = 10 ** Math.floor(Math.log10(first)); p <= last; p *= 10) candidates.push(p, 2 * p, 5 * p);
    const ends = [];
    return candidates.filter((n) => n >= first && n <= last)
      .filter((n) => ends.every((e) => Math.abs(this.x(n) - this.x(e)) > 48) && ends.push(n))
      .flatMap((n) => [svg('line', {
        class: 'grid',
        x1: this.x(n),
        x2: this.x(n),
        y1: this.height - box.bottom,
        y2: this.height - box.bottom + 4
      }),
                 svg('text',
                   { x: clamp(this.x(n), box.left + 10, this.width - 18), y: this.height - 6, 'text-anchor': 'middle' },
                   bytes(n).replace('.00', '').replace('.0', '')),
    ]);
  }

  place() {
    if (!this.width || !this.levels.length) return;
    const at = (circle, level) => {
      circle.setAttribute('cx', this.x(level.bytes));
      circle.setAttribute('cy', this.y(level.error));
    };
    at(this.point, this.levels[this.wanted]);
    this.present.style.display = this.shown < 0 || this.shown === this.wanted ? 'none' : '';
    if (this.shown >= 0) at(this.present, this.levels[this.shown]);
    const right = this.got ? this.x(this.got) : box.left;
    for (const [name, value] of Object.entries({
           x: box.left,
           y: box.top,
           width: Math.max(0, right - box.left),
           height: this.height - box.top - box.bottom
         }))
      this.received.setAttribute(name, value);
    this.point.setAttribute('aria-valuenow', this.wanted);
    const { error, bytes: size } = this.levels[this.wanted];
    this.point.setAttribute('aria-valuetext', `level ${this.wanted}: error ${percent(error)}, ${bytes(size)}`);
  }

  drag(event) {
    const { left, top } = this.drawing.getBoundingClientRect();
    const [x, y] = [event.clientX - left, event.clientY - top];
    const far = (l) => Math.hypot(this.x(l.bytes) - x, 0.5 * (this.y(l.error) - y));
    let best = 0;
    this.levels.forEach((l, i) => far(l) < far(this.levels[best]) && (best = i));
    this.choose(best);
  }

  key(event) {
    const steps = {
      ArrowRight: 1,
      ArrowUp: 1,
      ArrowLeft: -1,
      ArrowDown: -1,
      PageUp: 10,
      PageDown: -10,
      Home: -Infinity,
      End: Infinity
    };
    if (!(event.key in steps)) return;
    event.preventDefault();
    this.choose(clamp(this.wanted + steps[event.key], 0, this.levels.length - 1));
  }
}
