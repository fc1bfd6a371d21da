// SPDX-License-Identifier: BSD-3-Clause
// The colours and their values, under the picture.

import { sized } from './canvas.js';
import { colorTable } from './colors.js';
import { significant, ticks } from './numbers.js';

const margin = 26;
const top = 24;
const thick = 10;

// `title`: the field; [low, high]: values (not logarithms); `marks`: values that are drawn as isosurfaces
export function drawScalarBar(canvas, { title, low, high, log, map, reversed, marks }) {
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
  context.fillStyle = context.strokeStyle = color;
  context.font = `11.5px ${fontFamily}`;
  for (const value of log ? decades(low, high) : ticks(low, high, Math.max(3, Math.floor(long / 70)))) {
    const x = place(value);
    context.globalAlpha = 0.7;
    context.fillRect(Math.round(x), top + thick, 1, 4);
    context.globalAlpha = 1;
    context.fillText(significant(value, 4), x, top + thick + 15);
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

function decades(low, high) {
  const powers = [];
  for (let e = Math.ceil(Math.log10(low) - 1e-9); e <= Math.log10(high) + 1e-9; e++) powers.push(10 ** e);
  if (powers.length >= 2) return powers;
  return [...new Set([low, Math.sqrt(low * high), high])];
}
