// SPDX-License-Identifier: BSD-3-Clause
// Handles that drag planes in the picture: an outline in the plane and a knob that moves it along its normal.

import { element, svg } from './dom.js';
import { add, clipToWindow, dot, middle, planeOf, planeOutline, scale } from './geometry.js';
import { clamp, percent } from './numbers.js';

export class Handles {
  // `planes()`: [{ key, label, plane: {normal, at}, move(at) }], as the state has them
  constructor(layer, scene, planes) {
    Object.assign(this, { scene, bounds: scene.bounds, planes });
    this.drawing = svg('svg', { class: 'outlines', 'aria-hidden': 'true' });
    layer.append(this.drawing);
    this.layer = layer;
    this.knobs = new Map();
  }

  update() {
    const planes = this.planes();
    for (const [key, knob] of this.knobs)
      if (!planes.some((p) => p.key === key)) {
        knob.button.remove();
        knob.outline.remove();
        this.knobs.delete(key);
      }
    for (const entry of planes) this.place(entry);
  }

  place(entry) {
    let knob = this.knobs.get(entry.key);
    if (!knob) this.knobs.set(entry.key, (knob = this.makeKnob(entry.key)));
    knob.entry = entry;
    const plane = planeOf(this.bounds, entry.plane);
    const outline = planeOutline(this.bounds, plane);
    const projected = outline.map((p) => this.scene.toScreen(p));
    const screen = projected.some((p) => p.depth > 1) ? [] : projected; // behind the camera
    knob.outline.setAttribute('points', screen.map((p) => `${p.x.toFixed(1)},${p.y.toFixed(1)}`).join(' '));
    knob.outline.classList.toggle('held', Boolean(knob.held));
    // the knob sits where the outline is highest in the picture
    const { clientWidth, clientHeight } = this.layer;
    const top =
      clipToWindow(screen, clientWidth, clientHeight, 14).reduce((best, p) => (!best || p.y < best.y ? p : best), null);
    knob.button.hidden = !top;
    if (!top) return;
    knob.button.style.transform = `translate(${top.x}px, ${top.y}px)`;
    knob.button.ariaLabel = entry.label;
    knob.button.ariaValueNow = String(Math.round(100 * entry.plane.at));
    knob.button.ariaValueText = percent(entry.plane.at, 3);
  }

  makeKnob(key) {
    const button = element(
      'button', { type: 'button', className: 'knob', role: 'slider', 'aria-valuemin': '0', 'aria-valuemax': '100' });
    const outline = svg('polygon', { class: key });
    const knob = { button, outline, held: null };
    button.classList.add(key);
    button.addEventListener('pointerdown', (event) => this.grab(knob, event));
    button.addEventListener('pointermove', (event) => knob.held && this.drag(knob, event));
    for (const end of ['pointerup', 'pointercancel'])
      button.addEventListener(end, () => {
        knob.held = null;
        this.update();
      });
    button.addEventListener('keydown', (event) => {
      const step = { ArrowUp: 0.01,
        ArrowRight: 0.01,
        ArrowDown: -0.01,
        ArrowLeft: -0.01,
        PageUp: 0.1,
        PageDown: -0.1 }[event.key];
      if (!step) return;
      event.preventDefault();
      knob.entry.move(clamp(knob.entry.plane.at + step, 0, 1));
    });
    this.drawing.append(outline);
    this.layer.append(button);
    return knob;
  }

  // While a knob is held, the way across the bounds is a line of the screen; the pointer moves along it.
  grab(knob, event) {
    event.preventDefault();
    event.stopPropagation();
    knob.button.focus();
    knob.button.setPointerCapture(event.pointerId);
    const { plane } = knob.entry;
    const [low, high] = [0, 1].map((at) => planeOf(this.bounds, { normal: plane.normal, at }));
    const centre = middle(this.bounds);
    const on = (p) => this.scene.toScreen(add(centre, p.normal, dot(add(p.origin, centre, -1), p.normal)));
    const [from, to] = [on(low), on(high)];
    const way = [to.x - from.x, to.y - from.y, 0];
    // seen end on, up is towards the viewer
    const square = dot(way, way) < 400 ? [0, -400, 0] : way;
    knob.held = { x: event.clientX, y: event.clientY, at: plane.at, way: scale(square, 1 / dot(square, square)) };
  }

  drag({ held, entry }, event) {
    const moved = dot([event.clientX - held.x, event.clientY - held.y, 0], held.way);
    entry.move(clamp(held.at + moved, 0, 1));
  }
}
