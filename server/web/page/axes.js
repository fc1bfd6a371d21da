// SPDX-License-Identifier: BSD-3-Clause
// Numbers along three edges of the bounds, which lie at the rim of the picture.

import { svg } from './dom.js';
import { significant, ticks } from './numbers.js';

const between = 64; // pixels from one number to the next, at least
const away = 16;    // pixels from the edge to the middle of a number
const names = ['x', 'y', 'z'];

export class Axes {
  // `bounds`: of the stream; the scene's are the same, shifted
  constructor(layer, scene, bounds) {
    Object.assign(this, { scene, bounds });
    this.drawing = svg('svg', { class: 'axes', 'aria-hidden': 'true' });
    layer.append(this.drawing);
    this.shown = true;
  }

  show(shown) {
    this.shown = shown;
    this.update();
  }

  update() {
    const labels = this.labels((point) => this.scene.toScreen(point));
    while (this.drawing.children.length > labels.length) this.drawing.lastChild.remove();
    while (this.drawing.children.length < labels.length) this.drawing.append(svg('text'));
    labels.forEach(({ x, y, text, name }, i) => {
      const node = this.drawing.children[i];
      node.setAttribute('x', x.toFixed(1));
      node.setAttribute('y', y.toFixed(1));
      node.classList.toggle('name', Boolean(name));
      if (node.textContent !== text) node.textContent = text;
    });
  }

  /** Numbers and names { x, y, text, name } where a projection of the scene's points has their places. */
  labels(project) {
    return this.shown ? names.flatMap((name, axis) => this.along(axis, name, project)) : [];
  }

  /** The same in a saved picture; `factor`: its pixels of one on the screen. */
  drawOn(context, { width, height }, factor) {
    const { color, fontFamily } = getComputedStyle(this.drawing);
    context.save();
    Object.assign(context, { fillStyle: color, globalAlpha: 0.75, textAlign: 'center', textBaseline: 'middle' });
    const project = (point) => {
      const { x, y, depth } = this.scene.toPicture(point, [width, height]);
      return { x: x / factor, y: y / factor, depth };
    };
    for (const { x, y, text, name } of this.labels(project)) {
      context.font = `${name ? 'italic 600 ' : ''}${12 * factor}px ${fontFamily}`;
      context.fillText(text, x * factor, y * factor);
    }
    context.restore();
  }

  // The four edges along an axis as they are seen; the one farthest from the middle, the lower one of two.
  edge(axis, project) {
    const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    const { bounds } = this.scene;
    const ends = [0, 1, 2, 3].map((k) => [0, 1].map((end) => {
      const corner = [0, 0, 0];
      corner[axis] = bounds[end][axis];
      corner[u] = bounds[k & 1][u];
      corner[v] = bounds[k >> 1][v];
      return project(corner);
    }));
    const middles = ends.map(([a, b]) => [(a.x + b.x) / 2, (a.y + b.y) / 2]);
    const centre = [0, 1].map((i) => middles.reduce((sum, m) => sum + m[i], 0) / 4);
    const far = middles.map((m) => Math.hypot(m[0] - centre[0], m[1] - centre[1]) + 0.3 * (m[1] - centre[1]));
    const best = far.indexOf(Math.max(...far));
    const out = [middles[best][0] - centre[0], middles[best][1] - centre[1]];
    return { ends: ends[best], out, length: Math.hypot(...out) };
  }

  along(axis, name, project) {
    const { ends: [from, to], out, length } = this.edge(axis, project);
    const long = Math.hypot(to.x - from.x, to.y - from.y);
    if (from.depth > 1 || to.depth > 1 || long < between / 2 || length < 1) return []; // behind the camera, or seen end on
    const [low, high] = this.bounds.map((corner) => corner[axis]);
    const at = (f, distance) => ({
      x: from.x + f * (to.x - from.x) + (distance * out[0]) / length,
      y: from.y + f * (to.y - from.y) + (distance * out[1]) / length,
    });
    const fractions = ticks(low, high, Math.max(1, long / between)).map((value) => ({ value, f: (value - low) / (high - low || 1) }));
    const numbers = fractions.map(({ value, f }) => ({ ...at(f, away), text: significant(value, 4) }));
    return [...numbers, { ...at(0.5, 2.4 * away), text: name, name }];
  }
}
