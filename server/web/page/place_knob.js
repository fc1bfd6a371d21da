// SPDX-License-Identifier: BSD-3-Clause
// A knob over the picture that moves a place: along the picture's plane, as far away as it was.

import { element } from './dom.js';
import { add } from './geometry.js';

/** `place()`: where it is, in the stream's coordinates; `move(to)`. It begins hidden. */
export function makeKnob(layer, scene, label, { place, move }) {
  const knob = element('button', { type: 'button', className: 'knob along', ariaLabel: label });
  const screen = () => scene.toScreen(add(place(), scene.centre, -1));
  const moveTo = (x, y) => move(add(scene.toWorld(x, y, screen().depth), scene.centre));
  let held = false;
  knob.addEventListener('pointerdown', (event) => {
    held = true;
    event.preventDefault();
    event.stopPropagation();
    knob.focus();
    knob.setPointerCapture(event.pointerId);
  });
  knob.addEventListener('pointermove', (event) => {
    const { left, top } = layer.getBoundingClientRect();
    if (held) moveTo(event.clientX - left, event.clientY - top);
  });
  for (const name of ['pointerup', 'pointercancel'])
    knob.addEventListener(name, () => {
      held = false;
    });
  knob.addEventListener('keydown', (event) => {
    const step = { ArrowLeft: [-8, 0], ArrowRight: [8, 0], ArrowUp: [0, -8], ArrowDown: [0, 8] }[event.key];
    if (!step) return;
    event.preventDefault();
    const { x, y } = screen();
    moveTo(x + step[0], y + step[1]);
  });
  knob.hidden = true;
  layer.append(knob);
  return knob;
}
