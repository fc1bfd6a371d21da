// SPDX-License-Identifier: BSD-3-Clause
// The values of a mesh at any points, in short pieces of work that let others in between.

import { pause } from './dom.js';

const piece = 10; // milliseconds of work until others are let in
const around = 0.02; // of the diagonal: so far outside of a mesh its nearest point still counts

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

// Calls `act(i)` for 0 to count - 1.
async function inPieces(count, act) {
  let began = performance.now();
  for (let i = 0; i < count; i++) {
    act(i);
    if (i % 64 || performance.now() - began < piece) continue;
    await pause();
    began = performance.now();
  }
}

export class Sampler {
  #positions;
  #tets;
  #first;
  #list;
  #low;
  #cell;
  #dims;
  #near;

  /** `mesh` as TetlodStream.mesh() gives it; resolves when it is sorted into cells of a grid. */
  static async of({ positions, tets }) {
    const sampler = new Sampler();
    await sampler.#sort(positions, tets);
    return sampler;
  }

  async #sort(positions, tets) {
    this.#positions = positions;
    this.#tets = tets;
    const [low, high] = [
      [Infinity, Infinity, Infinity],
      [-Infinity, -Infinity, -Infinity],
    ];
    for (let i = 0; i < positions.length; i++) {
      low[i % 3] = Math.min(low[i % 3], positions[i]);
      high[i % 3] = Math.max(high[i % 3], positions[i]);
    }
    const sides = high.map((h, i) => h - low[i] || 1);
    const edge = Math.cbrt((sides[0] * sides[1] * sides[2]) / Math.max(1, tets.length / 4));
    this.#low = low;
    this.#near = around * Math.hypot(...sides);
    this.#dims = sides.map((side) => Math.min(128, Math.max(1, Math.ceil(side / edge))));
    this.#cell = sides.map((side, i) => side / this.#dims[i]);
    const counts = new Uint32Array(this.#dims[0] * this.#dims[1] * this.#dims[2] + 1);
    await inPieces(tets.length / 4, (t) => this.#cellsOf(t, (cell) => counts[cell + 1]++));
    for (let i = 1; i < counts.length; i++) counts[i] += counts[i - 1];
    this.#first = counts;
    this.#list = new Uint32Array(counts.at(-1));
    const at = counts.slice();
    await inPieces(tets.length / 4, (t) =>
      this.#cellsOf(t, (cell) => {
        this.#list[at[cell]++] = t;
      }),
    );
  }

  #place(x, i) {
    return Math.min(this.#dims[i] - 1, Math.max(0, Math.floor((x - this.#low[i]) / this.#cell[i])));
  }

  // The cells that the box about a tetrahedron meets.
  #cellsOf(t, act) {
    const span = [0, 1, 2].map((i) => {
      const at = [0, 1, 2, 3].map((k) => this.#positions[3 * this.#tets[4 * t + k] + i]);
      return [this.#place(Math.min(...at) - this.#near, i), this.#place(Math.max(...at) + this.#near, i)];
    });
    const [nx, ny] = this.#dims;
    for (let z = span[2][0]; z <= span[2][1]; z++)
      for (let y = span[1][0]; y <= span[1][1]; y++)
        for (let x = span[0][0]; x <= span[0][1]; x++) act(x + nx * (y + ny * z));
  }

  #corner(t, k) {
    const v = 3 * this.#tets[4 * t + k];
    return [this.#positions[v], this.#positions[v + 1], this.#positions[v + 2]];
  }

  // Weights of a tetrahedron's corners at a point; and how far that is outside of it, at most.
  #weights(t, p) {
    const a = this.#corner(t, 0);
    const [b, c, d, q] = [this.#corner(t, 1), this.#corner(t, 2), this.#corner(t, 3), p].map((x) =>
      x.map((y, i) => y - a[i]),
    );
    const [ofB, ofC, ofD] = [cross(c, d), cross(d, b), cross(b, c)];
    const whole = dot(b, ofB);
    const [x, y, z] = [dot(q, ofB), dot(q, ofC), dot(q, ofD)].map((volume) => volume / whole);
    const weights = [1 - x - y - z, x, y, z];
    const height = (k) =>
      Math.abs(whole) / (Math.hypot(...(k ? [ofB, ofC, ofD][k - 1] : ofB.map((n, i) => n + ofC[i] + ofD[i]))) || 1);
    const outside = Math.max(...weights.map((w, k) => -w * height(k)));
    return { weights, outside };
  }

  // The tetrahedron that a point is in, or the nearest; null: it is farther outside than `around`.
  #locate(p) {
    const [x, y, z] = p.map((c, i) => this.#place(c, i));
    const cell = x + this.#dims[0] * (y + this.#dims[1] * z);
    let best = null;
    for (let i = this.#first[cell]; i < this.#first[cell + 1]; i++) {
      const { weights, outside } = this.#weights(this.#list[i], p);
      if (!(outside < (best?.outside ?? this.#near))) continue;
      best = { t: this.#list[i], weights, outside };
      if (outside <= 0) break;
    }
    return best;
  }

  /**
   * `points` are relative to `origin`; NaN where nothing is. `columns`: [values, stride, offset] each; `valueOf(row)`
   * makes a value of them.
   */
  async at(points, origin, { columns, valueOf }) {
    const found = new Float64Array(points.length / 3);
    const row = new Array(columns.length);
    await inPieces(found.length, (i) => {
      const at = this.#locate([0, 1, 2].map((k) => points[3 * i + k] + origin[k]));
      if (!at) {
        found[i] = NaN;
        return;
      }
      const inside = at.weights.map((w) => Math.max(0, w));
      const sum = inside[0] + inside[1] + inside[2] + inside[3];
      row.fill(0);
      for (let k = 0; k < 4; k++)
        columns.forEach(([values, stride, offset], c) => {
          row[c] += (inside[k] / sum) * values[stride * this.#tets[4 * at.t + k] + offset];
        });
      found[i] = valueOf(row);
    });
    return found;
  }
}
