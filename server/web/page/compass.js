// SPDX-License-Identifier: BSD-3-Clause
// The orientation marker: the axes as the camera has them. A click on an end looks from there.

import { sized } from './canvas.js';

const colors = { x: '#d1495b', y: '#4a9b5f', z: '#3f7fd1' };
const reach = 0.36; // of the canvas's width

function ends(axes, width, height) {
  const found = [];
  for (const [i, name] of ['x', 'y', 'z'].entries())
    for (const sign of [1, -1])
      found.push({
        name,
        view: `${sign > 0 ? '+' : '-'}${name}`,
        sign,
        x: width / 2 + sign * axes.right[i] * reach * width,
        y: height / 2 - sign * axes.up[i] * reach * width,
        near: sign * axes.towards[i],
      });
  return found.sort((a, b) => a.near - b.near);
}

export class Compass {
  constructor(canvas, look) {
    this.canvas = canvas;
    canvas.addEventListener('click', (event) => {
      const nearest = (this.ends ?? [])
        .map((end) => ({ ...end, far: Math.hypot(event.offsetX - end.x, event.offsetY - end.y) }))
        .sort((a, b) => a.far - b.far || b.near - a.near)[0];
      if (nearest?.far < 14) look(nearest.view);
    });
  }

  draw(axes) {
    const { context, width, height, fontFamily } = sized(this.canvas);
    this.ends = ends(axes, width, height);
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    context.font = `700 12px ${fontFamily}`;
    for (const { name, sign, x, y, near } of this.ends) {
      context.globalAlpha = 0.65 + 0.35 * near;
      context.strokeStyle = context.fillStyle = colors[name];
      context.lineWidth = 2;
      context.beginPath();
      if (sign > 0) {
        context.moveTo(width / 2, height / 2);
        context.lineTo(x, y);
        context.stroke();
        context.beginPath();
        context.arc(x, y, 8, 0, 7);
        context.fill();
        context.fillStyle = '#fff';
        context.fillText(name.toUpperCase(), x, y + 0.5);
      } else {
        context.arc(x, y, 4.5, 0, 7);
        context.globalAlpha *= 0.6;
        context.fill();
      }
    }
    context.globalAlpha = 1;
  }
}
