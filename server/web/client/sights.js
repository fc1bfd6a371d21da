// SPDX-License-Identifier: BSD-3-Clause
// How near the pages of a stream are to the eye on what its pictures show: the boundary, slices and isosurfaces, not
// all that lies in the pyramid that the camera sees. Known from the last level without pages, which is always there:
// finer levels' boundaries are within its domain error, their isosurfaces within its error of the value.
import { distanceTo, isInside, meets, scaleOf } from './pages.js';

const halvings = 9; // of a box of which a part is seen
const slanted = 0.5; // sine: a curved wall that turns away by less may have parts that do not
const side = 24; // of the grid of values' ranges

const moved = (point, axis, at) => point.map((c, i) => (i === axis ? at : c));

// Of these bounds, what is in the box too.
const within = (from, to, low, high) => [
  from.map((c, i) => Math.max(c, low[i])),
  to.map((c, i) => Math.min(c, high[i])),
];

// Pixels of a length at the nearest place of a box that is seen and where there is something, or `least` if that is
// more. `isThere(low, high)`: may there be something in a box?
function nearest(look, low, high, least, isThere = null, left = halvings) {
  const scale = scaleOf(look, low, high);
  if (!(scale > least) || (isThere && !isThere(low, high))) return least;
  if (!left || (!isThere && isInside(look, low, high))) return scale;
  const axis = [0, 1, 2].reduce((a, i) => (high[i] - low[i] > high[a] - low[a] ? i : a), 0);
  const at = (low[axis] + high[axis]) / 2;
  const halves = [
    [low, moved(high, axis, at)],
    [moved(low, axis, at), high],
  ];
  if (look.eye[axis] > at) halves.reverse();
  return halves.reduce((most, [from, to]) => nearest(look, from, to, most, isThere, left - 1), least);
}

const crosses =
  ({ origin, normal }) =>
  (low, high) => {
    const at = normal.reduce((sum, n, i) => sum + n * (low[i] + high[i] - 2 * origin[i]), 0);
    return Math.abs(at) <= normal.reduce((sum, n, i) => sum + Math.abs(n) * (high[i] - low[i]), 0);
  };

// The boundary's triangles: their boxes, planes, and which lie in a page's box.
class Walls {
  #low = [];
  #high = [];
  #planes = []; // outwards
  #of;
  #slant;

  constructor(pages, positions, corners, margin) {
    this.#slant = margin ? slanted : 0;
    const pointOf = (v) => [...positions.subarray(3 * v, 3 * v + 3)];
    for (let i = 0; i < corners.length; i += 4) this.#add(Array.from(corners.subarray(i, i + 4), pointOf), margin);
    this.#of = pages.map(({ low, high }) => {
      const found = [];
      for (let w = 0; w < this.#low.length; w++) if (meets(this.#low[w], this.#high[w], low, high)) found.push(w);
      return found;
    });
  }

  #add([a, b, c, opposite], margin) {
    this.#low.push(a.map((x, i) => Math.min(x, b[i], c[i]) - margin));
    this.#high.push(a.map((x, i) => Math.max(x, b[i], c[i]) + margin));
    const [u, v] = [b, c].map((p) => p.map((x, i) => x - a[i]));
    const normal = u.map((_, i) => u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]);
    const inwards = normal.reduce((sum, n, i) => sum + n * (opposite[i] - a[i]), 0);
    const length = (inwards > 0 ? -1 : 1) * (Math.hypot(...normal) || 1);
    const outwards = normal.map((n) => n / length);
    this.#planes.push([...outwards, -outwards.reduce((sum, n, i) => sum + n * a[i], 0)]);
  }

  // `faces`: 1, those whose outer side is seen; -1, their inner side; 0, both.
  nearest(look, page, low, high, least, faces) {
    const { eye } = look;
    for (const w of this.#of[page]) {
      const [x, y, z, d] = this.#planes[w];
      const before = faces * (x * eye[0] + y * eye[1] + z * eye[2] + d);
      const far = distanceTo(eye, this.#low[w], this.#high[w]);
      if (before < -this.#slant * far || (!look.parallel && look.scale <= least * far)) continue;
      least = nearest(look, ...within(this.#low[w], this.#high[w], low, high), least);
    }
    return least;
  }
}

// The least and greatest value of each component in the cells of a grid.
class Ranges {
  #low;
  #step;
  #fields;

  constructor({ positions, corners, fields }, components, [low, high]) {
    this.#low = low;
    this.#step = high.map((h, i) => (h - low[i]) / side || 1);
    this.#fields = fields.map((values, f) =>
      Array.from({ length: values ? components[f] : 0 }, () => new Float64Array(2 * side ** 3).fill(-Infinity)),
    );
    for (let t = 0; t < corners.length; t += 4) {
      const of = corners.subarray(t, t + 4);
      const cells = [...this.#cells(...[Math.min, Math.max].map((end) => this.#corner(positions, of, end)))];
      this.#fields.forEach((list, f) =>
        list.forEach((ranges, c) => this.#add(ranges, cells, fields[f], list.length, c, of)),
      );
    }
  }

  #corner(positions, of, end) {
    return [0, 1, 2].map((i) => end(...Array.from(of, (v) => positions[3 * v + i])));
  }

  // The least one is there with its sign turned.
  #add(ranges, cells, field, components, c, of) {
    for (const v of of) {
      const value = field[components * v + c];
      for (const { number } of cells) {
        ranges[2 * number] = Math.max(ranges[2 * number], -value);
        ranges[2 * number + 1] = Math.max(ranges[2 * number + 1], value);
      }
    }
  }

  *#cells(low, high) {
    const cellOf = (c, i) => Math.floor((c - this.#low[i]) / this.#step[i]);
    const to = (point) => point.map((c, i) => Math.min(Math.max(cellOf(c, i), 0), side - 1));
    const [from, last] = [to(low), to(high)];
    for (let z = from[2]; z <= last[2]; z++)
      for (let y = from[1]; y <= last[1]; y++)
        for (let x = from[0]; x <= last[0]; x++) yield { number: x + side * (y + side * z), at: [x, y, z] };
  }

  nearest(look, low, high, least, { field, component, value, margin }) {
    const ranges = this.#fields[field]?.[component];
    if (!ranges) return nearest(look, low, high, least);
    for (const { number, at } of this.#cells(low, high)) {
      if (-ranges[2 * number] > value + margin || ranges[2 * number + 1] < value - margin) continue;
      const [from, to] = [0, 1].map((k) => at.map((c, i) => this.#low[i] + (c + k) * this.#step[i]));
      least = nearest(look, ...within(from, to, low, high), least);
    }
    return least;
  }
}

export class Sights {
  #pages;
  #info;
  #walls;
  #mesh;
  #ranges = null; // from when they are first wanted on

  /** `mesh`: of the last level without pages, as View.adopt takes it; `walls`: its boundary, four corners each. */
  constructor(pages, info, mesh, walls) {
    const [low, high] = info.bounds;
    const { domainError = 1 } = info.levels[info.paged - 1];
    this.#pages = pages;
    this.#info = info;
    this.#walls = new Walls(pages, mesh.positions, walls, domainError * Math.hypot(...high.map((h, i) => h - low[i])));
    this.#mesh = {
      positions: mesh.positions.slice(),
      corners: mesh.corners.slice(),
      fields: mesh.fields.map((values) => values?.slice()),
    };
  }

  #rangesOf() {
    const { fields, bounds } = this.#info;
    return (this.#ranges ??= new Ranges(this.#mesh, fields.map(({ components }) => components), bounds));
  }

  /**
   * Of each page: pixels of a length at the nearest place that is seen of what the pictures show; 0: nothing of it is.
   * `look` as of scaleOf(), and `walls`: 'near' (they hide what is behind), 'far' or 'all'. `shown`: as Engine checks
   * what to show.
   */
  scales(look, shown) {
    const parts = this.#partsOf(look, shown);
    return this.#pages.map(({ low, high }, page) => {
      if (!parts || !scaleOf(look, low, high)) return scaleOf(look, low, high);
      const { faces, slices, isosurfaces } = parts;
      let most = faces === null ? 0 : this.#walls.nearest(look, page, low, high, 0, faces);
      for (const isCut of slices) most = nearest(look, low, high, most, isCut);
      for (const iso of isosurfaces) most = this.#rangesOf().nearest(look, low, high, most, iso);
      return most;
    });
  }

  // null: all that the view takes in.
  #partsOf(look, shown) {
    if (!shown) return null;
    const { surface, slices, clip, isosurfaces, formula, threshold, regions, box, volume, rays, vectors, warp } = shown;
    if (threshold || regions?.hidden.length || box || volume || rays || vectors || warp) return null;
    if (isosurfaces.some(({ component }) => component < 0) || (formula && isosurfaces.length)) return null;
    return {
      faces: surface ? this.#facesOf(look) : null,
      slices: [...slices, ...(clip ? [clip] : [])].map(crosses),
      isosurfaces: isosurfaces.map((iso) => ({ ...iso, margin: this.#near(iso.field) })),
    };
  }

  // From inside, and without a place of the eye, walls are seen from both sides.
  #facesOf({ walls = 'all', eye, parallel }) {
    const isBeside = !meets(eye, eye, ...this.#info.bounds);
    return parallel || !isBeside ? 0 : { near: 1, far: -1, all: 0 }[walls];
  }

  // The level's error and that of a finer one.
  #near(field) {
    const { range: [low, high], name } = this.#info.fields[field];
    return 2 * (high - low) * (this.#info.levels[this.#info.paged - 1].errors[name]?.max ?? Infinity);
  }
}
