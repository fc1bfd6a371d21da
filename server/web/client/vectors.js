// SPDX-License-Identifier: BSD-3-Clause
// A field of vectors in a picture: arrows, and lines along the flow. Everything is as the mesh has it: within each
// tetrahedron the field is linear.

const NONE = 0xffffffff;
const stepsAcross = 300; // of a streamline: steps as long as the mesh's diagonal
const mostSteps = 600;   // on each side of where it begins
const slow = 1e-6;       // of the largest length: slower, a line ends
const sides = 5;         // of a tube

const add = (a, b, f = 1) => [a[0] + f * b[0], a[1] + f * b[1], a[2] + f * b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const size = (a) => Math.hypot(a[0], a[1], a[2]);
const unit = (a) => add([0, 0, 0], a, 1 / (size(a) || 1));

// Some direction across `d`, which is of length 1.
const across = (d) => unit(cross(d, Math.abs(d[0]) < 0.7 ? [1, 0, 0] : [0, 1, 0]));

/** A mesh with values, and which tetrahedron is behind which face. */
export class Flow {
  // `vertices`: place and the value that colours, four numbers for each; `vectors`: three for each; `neighbours`: 4
  // times the tetrahedron opposite each corner, plus which of its faces that is, or NONE; `cells`: values of tetrahedra
  // that colour instead, or null; `lengths`: {values, components} of vectors whose length colours instead, or null
  constructor({ vertices, corners, neighbours, vectors, cells = null, lengths = null }) {
    Object.assign(this, { vertices, corners, neighbours, vectors, cells, lengths, tets: corners.length / 4 });
    this.fastest = 0;
    for (let v = 0; v < vectors.length; v += 3)
      this.fastest = Math.max(this.fastest, Math.hypot(vectors[v], vectors[v + 1], vectors[v + 2]));
  }

  #corner(tet, i) {
    const v = 4 * this.corners[4 * tet + i];
    return [this.vertices[v], this.vertices[v + 1], this.vertices[v + 2]];
  }

  // Six times the volume.
  #volume(tet) {
    const a = this.#corner(tet, 0);
    const [b, c, d] = [1, 2, 3].map((i) => add(this.#corner(tet, i), a, -1));
    return dot(b, cross(c, d));
  }

  /** `count` tetrahedra at equal distances in the mesh's order by volume: as many in each part as it has of the volume.
   * */
  seeds(count) {
    let whole = 0;
    for (let t = 0; t < this.tets; t++) whole += Math.abs(this.#volume(t));
    const found = [];
    for (let t = 0, sum = 0; t < this.tets && found.length < count; t++) {
      sum += Math.abs(this.#volume(t));
      if (sum * count >= (found.length + 0.5) * whole) found.push(t);
    }
    return { tets: found, volume: whole / 6 };
  }

  /** The middle of a tetrahedron, as locate() gives places. */
  middle(tet) {
    const sum = [0, 1, 2, 3].reduce((s, i) => add(s, this.#corner(tet, i)), [0, 0, 0]);
    return { tet, weights: [0.25, 0.25, 0.25, 0.25], point: add([0, 0, 0], sum, 0.25) };
  }

  /** The same of places; those that are in no tetrahedron are left out. */
  find(places) {
    const found = places.map(() => null);
    const [low, high] = [Math.min, Math.max].map((most) => [0, 1, 2].map((i) => most(...places.map((p) => p[i]))));
    for (let tet = 0; tet < this.tets; tet++) {
      const corners = [0, 1, 2, 3].map((i) => this.#corner(tet, i));
      const [from, to] = [Math.min, Math.max].map((most) => [0, 1, 2].map((i) => most(...corners.map((c) => c[i]))));
      if ([0, 1, 2].some((i) => to[i] < low[i] || from[i] > high[i])) continue;
      places.forEach((point, k) => {
        if (found[k] || point.some((c, i) => c < from[i] || c > to[i])) return;
        const weights = this.#weights(tet, point);
        if (Math.min(...weights) >= -1e-9) found[k] = { tet, weights, point };
      });
    }
    return found.filter(Boolean);
  }

  #weights(tet, p) {
    const a = this.#corner(tet, 0);
    const [b, c, d] = [1, 2, 3].map((i) => add(this.#corner(tet, i), a, -1));
    const q = add(p, a, -1);
    const whole = dot(b, cross(c, d));
    const [x, y, z] = [dot(q, cross(c, d)) / whole, dot(b, cross(q, d)) / whole, dot(b, cross(c, q)) / whole];
    return [1 - x - y - z, x, y, z];
  }

  /** {tet, weights, point} of a point near a tetrahedron, on a straight way from it; null outside of the mesh. */
  locate(p, tet) {
    for (let walked = 0; walked < 200; walked++) {
      const weights = this.#weights(tet, p);
      const least = weights.indexOf(Math.min(...weights));
      if (!(weights[least] < -1e-9)) return Number.isFinite(weights[least]) ? { tet, weights, point: p } : null;
      const behind = this.neighbours[4 * tet + least];
      if (behind === NONE) return null;
      tet = behind >>> 2;
    }
    return null;
  }

  vectorAt({ tet, weights }) {
    const sum = [0, 0, 0];
    for (let i = 0; i < 4; i++)
      for (let k = 0; k < 3; k++) sum[k] += weights[i] * this.vectors[3 * this.corners[4 * tet + i] + k];
    return sum;
  }

  shadeAt({ tet, weights }) {
    if (this.cells) return this.cells[tet];
    const at = (list, n, c) => weights.reduce((sum, w, i) => sum + w * list[n * this.corners[4 * tet + i] + c], 0);
    if (!this.lengths) return at(this.vertices, 4, 3);
    const { values, components } = this.lengths;
    return Math.hypot(...Array.from({ length: components }, (_, c) => at(values, components, c)));
  }

  // One step of `length` along the flow, or against it where that is negative (Runge and Kutta's of order 4); null: it
  // leads out, or nowhere.
  #step(at, length) {
    const direction = (place) => {
      const vector = place && this.vectorAt(place);
      return vector && size(vector) > slow * this.fastest ? unit(vector) : null;
    };
    const go = (way, part) => way && this.locate(add(at.point, way, part * length), at.tet);
    const k1 = direction(at);
    const k2 = direction(go(k1, 0.5));
    const k3 = direction(go(k2, 0.5));
    const k4 = direction(go(k3, 1));
    return k4 && go([0, 1, 2].map((i) => (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]) / 6), 1);
  }

  /** The places of a streamline through one of them, in steps of a length. */
  streamline(from, length) {
    const half = (by) => {
      const places = [];
      for (let at = this.#step(from, by); at && places.length < mostSteps; at = this.#step(at, by)) places.push(at);
      return places;
    };
    return [...half(-length).reverse(), from, ...half(length)];
  }
}

// Collects triangles with values, as far as they are behind a plane { origin, normal }, if there is one.
class Solid {
  #clip; #points = []; #values = []; #normals = []; #triangles = [];

  constructor(clip) {
    this.#clip = clip;
  }

  point(p, normal, value) {
    this.#points.push(...p);
    this.#normals.push(...normal);
    return this.#values.push(value) - 1;
  }

  triangle(...ids) {
    if (!this.#clip) return void this.#triangles.push(...ids);
    const before = ids.map((id) => dot(add(this.#of(this.#points, id), this.#clip.origin, -1), this.#clip.normal));
    const rim = ids.flatMap((id, i) => {
      const next = (i + 1) % 3;
      const own = before[i] < 0 ? [id] : [];
      return before[i] < 0 === before[next] < 0
        ? own
        : [...own, this.#between(id, ids[next], before[i] / (before[i] - before[next]))];
    });
    for (let i = 2; i < rim.length; i++) this.#triangles.push(rim[0], rim[i - 1], rim[i]);
  }

  #of(list, id) {
    return list.slice(3 * id, 3 * id + 3);
  }

  #between(a, b, f) {
    const at = (list) => [0, 1, 2].map((k) => list[3 * a + k] + f * (list[3 * b + k] - list[3 * a + k]));
    return this.point(at(this.#points), at(this.#normals), this.#values[a] + f * (this.#values[b] - this.#values[a]));
  }

  get part() {
    return {
      points: Float32Array.from(this.#points),
      values: Float32Array.from(this.#values),
      triangles: Uint32Array.from(this.#triangles),
      vectors: null,
      normals: Float32Array.from(this.#normals),
      lines: null
    };
  }
}

// Points around `p`, across `way`.
function ring(solid, p, way, side, radius, value) {
  const up = cross(way, side);
  return Array.from({ length: sides }, (_, i) => {
    const [c, s] = [Math.cos((2 * Math.PI * i) / sides), Math.sin((2 * Math.PI * i) / sides)];
    const out = [0, 1, 2].map((k) => c * side[k] + s * up[k]);
    return solid.point(add(p, out, radius), out, value);
  });
}

function join(solid, low, high) {
  low.forEach((a, i) => {
    const next = (i + 1) % sides;
    solid.triangle(a, low[next], high[next]);
    solid.triangle(a, high[next], high[i]);
  });
}

function drawArrow(solid, flow, at, longest) {
  const vector = flow.vectorAt(at);
  const length = (longest * size(vector)) / (flow.fastest || 1);
  if (!(size(vector) > slow * flow.fastest)) return;
  const way = unit(vector);
  const side = across(way);
  const value = flow.shadeAt(at);
  const along = (part) => add(at.point, way, (part - 0.5) * length);
  const shaft = [0, 0.6].map((part) => ring(solid, along(part), way, side, 0.05 * length, value));
  const head =
    [[0.6, 0.14], [1, 0]].map(([part, radius]) => ring(solid, along(part), way, side, radius * length, value));
  join(solid, ...shaft);
  join(solid, ...head);
}

function drawTube(solid, flow, places, radius) {
  let side = null;
  let last = null;
  places.forEach((at, i) => {
    const way = unit(add(places[Math.min(i + 1, places.length - 1)].point, places[Math.max(i - 1, 0)].point, -1));
    side = side ? unit(add(side, way, -dot(side, way))) : across(way); // it does not turn about the line
    const now = ring(solid, at.point, way, side, radius, flow.shadeAt(at));
    if (last) join(solid, last, now);
    last = now;
  });
}

/**
 * A part of the picture: `count` arrows, or as many streamlines, spread over the volume, or through `places`, behind
 * the plane `clip`, if it is not null. `size`: times as long, or as thick, as usual. `diagonal`: of the bounds.
 */
export function drawVectors(flow, { kind, count, size: times = 1, places = null }, diagonal, clip = null) {
  const solid = new Solid(clip);
  const { tets, volume } = flow.seeds(count);
  if (!(flow.fastest > 0)) return solid.part;
  for (const seed of places ? flow.find(places) : tets.map((tet) => flow.middle(tet))) {
    if (kind === 'arrows') drawArrow(solid, flow, seed, times * 1.3 * Math.cbrt(volume / count));
    else {
      const along = flow.streamline(seed, diagonal / stepsAcross);
      if (along.length > 2) drawTube(solid, flow, along, times * 0.0018 * diagonal);
    }
  }
  return solid.part;
}
