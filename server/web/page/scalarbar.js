// SPDX-License-Identifier: BSD-3-Clause
// The colours and their values, under the picture.

import { sized } from './canvas.js';
import { colorTable } from './colors.js';
import { clamp, significant, ticks } from './numbers.js';

const margin = 26;
const top = 24;
const thick = 10;

// `title`: the field; [low, high]: values (not logarithms); `below`, `above`: there are others; `marks`: values that
// are drawn as isosurfaces; `numbers`: the only values that there are, null: there are others
export function drawScalarBar(canvas, { title, low, high, log, map, reversed, below, above, marks, numbers }) {
  const { context, width, color, fontFamily } = sized(canvas);
  if (!width) return;
  const long = width - 2 * margin;
  const f = (v) => (log ? Math.log10(v) : v);
  const place = (v) => margin + ((f(v) - f(low)) / (f(high) - f(low) || 1)) * long;
  const table = colorTable(map, reversed, 128);
  const gradient = context.createLinearGradient(margin, 0, margin + long, 0);
  table.forEach((c, i) => gradient.addColorStop(i / 127, `rgb(${c})`));
  context.font = `600 12.5px ${fontFamily}`;
  context.textAlign = 'center';
  context.fillStyle = color;
  context.fillText(title, width / 2, 15);
  context.fillStyle = gradient;
  context.beginPath();
  context.roundRect(margin, top, long, thick, 3);
  context.fill();
  for (const [there, x, reach, color] of [[below, margin, -9, table[0]], [above, margin + long, 9, table.at(-1)]]) {
    if (!there) continue;
    context.fillStyle = `rgb(${color})`;
    context.beginPath();
    context.moveTo(x, top);
    context.lineTo(x + reach, top + thick / 2);
    context.lineTo(x, top + thick);
    context.fill();
  }
  context.fillStyle = context.strokeStyle = color;
  context.font = `12px ${fontFamily}`;
  const widthOf = (text) => context.measureText(text).width;
  for (const { value, text, x } of labels({ low, high, log, numbers }, place, widthOf, width)) {
    context.globalAlpha = 0.7;
    context.fillRect(Math.round(clamp(place(value), margin, margin + long - 1)), top + thick, 1, 4);
    context.globalAlpha = 1;
    context.fillText(text, x, top + thick + 15);
  }
  for (const value of marks) {
    const x = place(value);
    if (!(x >= margin && x <= margin + long)) continue;
    context.beginPath();
    context.moveTo(x - 4, top - 5);
    context.lineTo(x + 4, top - 5);
    context.lineTo(x, top);
    context.fill();
  }
}

// Powers of ten, with twice and five times them where they are few.
function decades(low, high) {
  const powers = [];
  for (let e = Math.floor(Math.log10(low)); e <= Math.log10(high); e++) powers.push(10 ** e);
  const all = powers.length > 3 ? powers : [...powers, ...powers.flatMap((p) => [2 * p, 5 * p])];
  return all.filter((v) => v > low && v < high);
}

// The ends, and the round values between them that have room: { value, text, x }.
function labels({ low, high, log, numbers }, place, widthOf, width) {
  const round = numbers ?? (log ? decades(low, high) : ticks(low, high, Math.max(2, Math.floor(width / 80))));
  const taken = [];
  for (const value of [low, high, ...round]) {
    const text = significant(value, 4);
    const half = widthOf(text) / 2;
    const x = clamp(place(value), half + 2, width - half - 2);
    if (taken.every((other) => Math.abs(other.x - x) > other.half + half + 8)) taken.push({ value, text, x, half });
  }
  return taken;
}
