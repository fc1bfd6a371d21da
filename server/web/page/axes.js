// SPDX-License-Identifier: BSD-3-Clause
// Numbers along three edges of the bounds, which lie at the rim of the picture.

import { svg } from './dom.js';
import { significant, ticks } from './numbers.js';

const between = 64; // pixels from one number to the next, at least
const away = 16;    // pixels from the edge to the middle of a number
const names = ['x', 'y', 'z'];
const looks = 32; // along an edge that is not whole in the picture
const rim = 100; // pixels beyond the picture, that numbers may come from

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
    const { clientWidth, clientHeight } = this.scene.container;
    const labels = this.labels((point) => this.scene.toScreen(point), [clientWidth, clientHeight]);
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

  /**
   * Numbers and names { x, y, text, name } where a projection of the scene's points has their places, as far as these
   * are in a picture of this size.
   */
  labels(project, size) {
    return this.shown ? names.flatMap((name, axis) => this.along(axis, name, project, size)) : [];
  }

  /** The same in a saved picture; `factor`: its pixels of one on the screen. */
  drawOn(context, { width, height }, factor) {
    const { color, fontFamily, stroke } = getComputedStyle(this.drawing);
    context.save();
    Object.assign(context, { fillStyle: color, globalAlpha: 0.75, textAlign: 'center', textBaseline: 'middle' });
    Object.assign(context, { strokeStyle: stroke, lineWidth: 2 * factor, lineJoin: 'round' });
    const project = (point) => {
      const { x, y, depth } = this.scene.toPicture(point, [width, height]);
      return { x: x / factor, y: y / factor, depth };
    };
    for (const { x, y, text, name } of this.labels(project, [width / factor, height / factor])) {
      context.font = `${name ? 'italic 600 ' : ''}${12 * factor}px ${fontFamily}`;
      context.strokeText(text, x * factor, y * factor); // for what is over the picture
      context.fillText(text, x * factor, y * factor);
    }
    context.restore();
  }

  // The four edges along an axis as they are seen; the one farthest from the middle, the lower one of two.
  edge(axis, project) {
    const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    const { bounds } = this.scene;
    const corners = [0, 1, 2, 3].map((k) => [0, 1].map((end) => {
      const corner = [0, 0, 0];
      corner[axis] = bounds[end][axis];
      corner[u] = bounds[k & 1][u];
      corner[v] = bounds[k >> 1][v];
      return corner;
    }));
    const ends = corners.map((pair) => pair.map(project));
    const middles = ends.map(([a, b]) => [(a.x + b.x) / 2, (a.y + b.y) / 2]);
    const centre = [0, 1].map((i) => middles.reduce((sum, m) => sum + m[i], 0) / 4);
    const far = middles.map((m) => Math.hypot(m[0] - centre[0], m[1] - centre[1]) + 0.3 * (m[1] - centre[1]));
    const best = far.indexOf(Math.max(...far));
    const out = [middles[best][0] - centre[0], middles[best][1] - centre[1]];
    return { corners: corners[best], ends: ends[best], out, length: Math.hypot(...out) };
  }

  // Which part of an edge is in the picture, from 0 to 1; null: none.
  visible({ ends }, placeOf, [width, height]) {
    const isIn = ({ x, y, depth }) =>
      depth <= 1 && x > -rim && y > -rim && x < width + rim && y < height + rim;
    if (ends.every(isIn)) return [0, 1];
    const seen = Array.from({ length: looks + 1 }, (_, i) => i / looks).filter((f) => isIn(placeOf(f)));
    return seen.length ? [Math.max(0, seen[0] - 1 / looks), Math.min(1, seen.at(-1) + 1 / looks)] : null;
  }

  along(axis, name, project, size) {
    const edge = this.edge(axis, project);
    const { corners: [begin, end], ends, out, length } = edge;
    const placeOf = (f) => project(begin.map((c, i) => c + f * (end[i] - c)));
    if (ends.some(({ depth }) => depth > 1) || length < 1) return []; // behind the camera, or seen end on
    const part = this.visible(edge, placeOf, size);
    const [from, to] = part?.map(placeOf) ?? [];
    const long = part ? Math.hypot(to.x - from.x, to.y - from.y) : 0;
    if (long < between / 2) return [];
    const at = (f, distance) => {
      const { x, y } = placeOf(f);
      return { x: x + (distance * out[0]) / length, y: y + (distance * out[1]) / length };
    };
    const [low, high] = this.bounds.map((corner) => corner[axis]);
    const [first, last] = part.map((f) => low + f * (high - low));
    const values = ticks(first, last, Math.max(1, Math.min(long, Math.hypot(...size)) / between));
    const fraction = (value) => (value - low) / (high - low || 1);
    const numbers = values.map((value) => ({ ...at(fraction(value), away), text: significant(value, 4) }));
    return [...numbers, { ...at((part[0] + part[1]) / 2, 2.4 * away), text: name, name }];
  }
}
