// SPDX-License-Identifier: BSD-3-Clause
// The editor of the volume's opacity over the colours' range: drag points, double-click to add or take one away.

import { svg } from './dom.js';
import { clamp, percent } from './numbers.js';

const edge = 8;
const curve = 0.5; // opacity is drawn by its square root: what matters is small

export class TransferEditor {
  constructor(drawing, change) {
    Object.assign(this, { drawing, change, points: [] });
    this.area = svg('path', { class: 'area' });
    this.dots = svg('g');
    drawing.append(this.area, this.dots);
    drawing.addEventListener('dblclick', (event) => this.toggle(event));
    drawing.addEventListener('pointerdown', (event) => this.grab(event));
    drawing.addEventListener(
      'pointermove', (event) => this.held !== undefined && this.move(this.held, ...this.place(event)));
    for (const end of ['pointerup', 'pointercancel']) drawing.addEventListener(end, () => (this.held = undefined));
    new ResizeObserver(() => this.draw()).observe(drawing);
  }

  set(points) {
    this.points = points;
    this.draw();
  }

  x(fraction) {
    return edge + fraction * (this.width - 2 * edge);
  }

  y(opacity) {
    return this.height - edge - opacity ** curve * (this.height - 2 * edge);
  }

  place(event) {
    const { left, top } = this.drawing.getBoundingClientRect();
    return [
      clamp((event.clientX - left - edge) / (this.width - 2 * edge), 0, 1),
      clamp((this.height - edge - (event.clientY - top)) / (this.height - 2 * edge), 0, 1) ** (1 / curve),
    ];
  }

  near(event) {
    const { left, top } = this.drawing.getBoundingClientRect();
    const far = (p) => Math.hypot(this.x(p[0]) - (event.clientX - left), this.y(p[1]) - (event.clientY - top));
    const order = this.points.map((p, i) => [far(p), i]).sort((a, b) => a[0] - b[0]);
    return order[0]?.[0] < 16 ? order[0][1] : -1;
  }

  grab(event) {
    const i = this.near(event);
    if (i < 0) return;
    event.preventDefault();
    this.drawing.setPointerCapture(event.pointerId);
    this.held = i;
    this.dots.children[i].focus({ preventScroll: true });
  }

  // Points keep their order; the first and the last stay at the range's ends.
  move(i, x, y) {
    const last = this.points.length - 1;
    const low = i === 0 ? 0 : i === last ? 1 : this.points[i - 1][0];
    const high = i === last ? 1 : i === 0 ? 0 : this.points[i + 1][0];
    this.change(this.points.map((p, k) => (k === i ? [clamp(x, low, high), clamp(y, 0, 1)] : p)));
  }

  toggle(event) {
    const i = this.near(event);
    if (i < 0) this.add(...this.place(event));
    else this.take(i);
  }

  add(x, y) {
    this.change([...this.points, [x, y]].sort((a, b) => a[0] - b[0]));
  }

  take(i) {
    if (i > 0 && i < this.points.length - 1) this.change(this.points.filter((_, k) => k !== i));
  }

  key(event, i) {
    const [x, y] = this.points[i];
    const steps = { ArrowRight: [0.02, 0], ArrowLeft: [-0.02, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    if (event.key === 'Delete' || event.key === 'Backspace') this.take(i);
    else if (event.key === 'Insert' || event.key === '+') this.add(clamp(x + 0.05, 0, 1), y);
    else if (steps[event.key]) {
      const [dx, dy] = steps[event.key];
      this.move(i, x + dx, clamp(y ** curve + 0.04 * dy, 0, 1) ** (1 / curve));
    } else return;
    event.preventDefault();
    event.stopPropagation();
  }

  draw() {
    const { width, height } = this.drawing.getBoundingClientRect();
    if (!width || !this.points.length) return;
    Object.assign(this, { width, height });
    this.drawing.setAttribute('viewBox', `0 0 ${width} ${height}`);
    // straight in opacity, so curved as drawn
    const line = [];
    for (let k = 1; k < this.points.length; k++)
      for (let s = k === 1 ? 0 : 1; s <= 8; s++) {
        const [[x0, y0], [x1, y1]] = [this.points[k - 1], this.points[k]];
        line.push(`${this.x(x0 + ((x1 - x0) * s) / 8).toFixed(1)},${this.y(y0 + ((y1 - y0) * s) / 8).toFixed(1)}`);
      }
    this.area.setAttribute('d', `M${this.x(0)},${this.y(0)}L${line.join('L')}L${this.x(1)},${this.y(0)}Z`);
    while (this.dots.children.length > this.points.length) this.dots.lastChild.remove();
    while (this.dots.children.length < this.points.length) this.dots.append(this.makeDot(this.dots.children.length));
    this.points.forEach(([x, y], i) => {
      const dot = this.dots.children[i];
      dot.setAttribute('cx', this.x(x));
      dot.setAttribute('cy', this.y(y));
      dot.setAttribute('aria-valuenow', Math.round(100 * y));
      dot.setAttribute('aria-valuetext', `opacity ${percent(y, 2)} at ${percent(x, 2)} of the range`);
    });
  }

  makeDot(i) {
    const dot = svg('circle', {
      r: 5, tabindex: 0, role: 'slider', 'aria-label': `Opacity point ${i + 1}; insert adds one, delete takes it away`,
      'aria-valuemin': 0, 'aria-valuemax': 100,
    });
    dot.addEventListener('keydown', (event) => this.key(event, i));
    return dot;
  }
}
