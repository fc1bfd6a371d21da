// SPDX-License-Identifier: BSD-3-Clause
// What the picture is to show. One flat object; subscribers get it, and it is written into the URL's fragment.

import { isMap } from './colors.js';
import { clamp } from './numbers.js';

export const mostVectors = 3000;

export const defaults = Object.freeze({
  // the target: the coarsest level with at most this error (a fraction of the field's range; 0: the finest level),
  // within budgets
  error: 0.01,
  measure: 'max',
  errorField: '', // whose error; empty: the drawn field's if the stream controls it, else of the first that it controls
  maxTets: 0,     // 0: as many as the device's memory is for
  maxBytes: 0,
  pixels: 0,    // of error on the screen, in pages; 0: none are chosen by what is seen
  refine: null, // { boxes: of six fractions of the bounds, error } in them
  step: null,   // in time, of a series; null: the levels, which are the first step's
  // the colours
  field: '',
  component: 'magnitude', // or a number, or mises, principal1 … principal3 of tensors
  formula: '',            // a function of components that colours instead of the field
  units: '',              // of fields, as somebody typed them: 'Pressure=Pa;Velocity=m/s'
  cells: '',              // values of cells that colour instead of the field
  range: 'auto',          // auto, data, visible, manual
  low: 0,
  high: 1,
  log: false,
  map: 'auto', // by the data, or a name that colors.js knows
  reversed: false,
  shading:
    'isosurfaces', // what light falls on: isosurfaces, all, off; what it does not fall on has exactly the map's colours
  // the layers
  surface: 'solid', // solid, inside (its far walls only), glass, off
  edges: false,
  slices: [], // { normal: [x, y, z], at: 0..1 across the bounds }
  sliceEdges: false,
  isosurfaces: [],     // fractions of the data range
  isosurfaceField: '', // whose isosurfaces, as the picture is coloured if empty
  isosurfaceOpacity: 1,
  zone: false,     // the isosurfaces' certified zones
  threshold: null, // cells with values between two fractions of the data range
  regions: '',     // values of cells that say which region each is in
  hidden: [],      // the numbers of those that are not shown
  clip: null,      // { normal, at }
  box: null,       // that what is drawn lies in: six fractions of the bounds
  vectors: 'off',  // off, arrows, streamlines
  vectorField: '', // of which field; empty: the drawn one if it has three components, else the first that has
  vectorCount: 200,
  vectorSize: 1,   // times as long as arrows, as thick as streamlines usually are
  seeds: 'volume', // where they are: volume, line (that values are plotted along), slice (the first)
  warp: '',        // the field of vectors that moves the points
  warpScale: 1,
  outline: false, // what is not moved, too
  line: null,     // that values are plotted along: begin and end as fractions of the bounds, six numbers
  notes: [],      // what somebody wrote at them
  pins: [],       // places of probes that stay: fractions of the bounds
  volume: false,
  volumeSize: 0,                                           // of a grid, or 0: the tetrahedra themselves
  opacity: [[0, 0], [0.08, 0.005], [0.3, 0.08], [1, 0.9]], // the volume's: fractions of the colours' range
  // the view
  background: 'auto', // auto, white, black, grey
  axes: true,         // with numbers
  parallel: false,
  smooth: true,      // levels pass into one another
  second: null,      // what a second view beside this one shows: its part of a link
  other: '',         // another stream: the name of a mesh of the server, or an address
  compare: 'beside', // with that: beside, curtain, difference
  curtain: 0.5,      // where that is, across the picture
  camera: null, // position, focal point and view up as nine numbers; a tenth is the height of a parallel projection
});

const numbers = (text) => text.split(',').map(Number);
const round = (x) => Number(x.toPrecision(5));
const isFinite3 = (v) => v.length === 3 && v.every(Number.isFinite);
const apart = (a, b) => Math.hypot(...a.map((x, i) => x - b[i])) > 0;
const isCamera = (c) => [9, 10].includes(c.length) && c.every(Number.isFinite) && apart(c.slice(0, 3), c.slice(3, 6)) &&
  Math.hypot(...c.slice(6, 9)) > 0 && (c.length === 9 || c[9] > 0);
const oneOf = (...allowed) => ({ read: (t) => (allowed.includes(t) ? t : undefined), write: String });
const positive = {
  read: (t) => (t.trim() && Number.isFinite(Number(t)) && Number(t) >= 0 ? Number(t) : undefined),
  write: (x) => String(round(x))
};
const real = { read: (t) => (t.trim() && Number.isFinite(Number(t)) ? Number(t) : undefined), write: (x) => String(x) };
const flag = { read: (t) => t === '1', write: (x) => (x ? '1' : '0') };
const text = { read: (t) => t, write: (t) => t };

const axes = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };
export const axisOf = (normal) => Object.keys(axes).find((a) => axes[a].every((c, i) => c === normal[i]));

function readPlane(t) {
  const [where, at] = t.split('@');
  const normal = axes[where] ?? numbers(where);
  return isFinite3(normal) && Math.hypot(...normal) > 0 && at >= 0 && at <= 1 ? { normal: [...normal], at: Number(at) }
                                                                              : null;
}
const writePlane = (p) => `${axisOf(p.normal) ?? p.normal.map(round).join(',')}@${round(p.at)}`;
const list = (read, write, separator) => ({
  read: (t) => t.split(separator).filter(Boolean).map(read).filter((x) => x !== null),
  write: (l) => l.map(write).join(separator),
});

const isBox = (b) => b.length === 6 && b.every((x) => x >= 0 && x <= 1) && [0, 1, 2].every((i) => b[i] <= b[3 + i]);

function readBoxes(t) {
  const [boxes, error] = t.split('@');
  const found = boxes.split(';').map(numbers).filter(isBox).slice(0, 16);
  return found.length && Number(error) >= 0 ? { boxes: found, error: Number(error) } : undefined;
}

// How each key is read from the fragment and written into it; a value that cannot be read leaves the default.
const codecs = {
  error: positive,
  measure: oneOf('max', 'sampled', 'rms'),
  errorField: text,
  maxTets: positive,
  maxBytes: positive,
  pixels: positive,
  refine: {
    read: readBoxes,
    write: ({ boxes, error }) => `${boxes.map((b) => b.map(round).join(',')).join(';')}@${round(error)}`
  },
  step: { read: (t) => (/^\d+$/.test(t) ? Number(t) : undefined), write: String },
  field: text,
  formula: text,
  units: text,
  component: {
    read: (t) => (/^(magnitude|mises|principal[123])$/.test(t) ? t
        : /^\d+$/.test(t)                                      ? Number(t)
                                                               : undefined),
    write: String
  },
  cells: text,
  range: oneOf('auto', 'data', 'visible', 'manual'),
  low: real,
  high: real,
  log: flag,
  map: { read: (t) => (t === 'auto' || isMap(t) ? t : undefined), write: String },
  reversed: flag,
  shading: oneOf('isosurfaces', 'all', 'off'),
  surface: oneOf('solid', 'inside', 'glass', 'off'),
  edges: flag,
  slices: list(readPlane, writePlane, ';'),
  sliceEdges: flag,
  isosurfaces: list((t) => (t >= 0 && t <= 1 ? Number(t) : null), (x) => String(round(x)), ','),
  isosurfaceField: text,
  isosurfaceOpacity: { read: (t) => clamp(Number(t) || 1, 0.05, 1), write: (x) => String(round(x)) },
  zone: flag,
  threshold: {
    read: (t) =>
      (numbers(t).length === 2 && numbers(t).every((x) => x >= 0 && x <= 1) ? numbers(t).sort((a, b) => a - b)
                                                                            : undefined),
    write: (l) => l.map(round).join(','),
  },
  regions: text,
  hidden: list((t) => (Number.isFinite(Number(t)) ? Number(t) : null), String, ','),
  clip: { read: (t) => readPlane(t) ?? undefined, write: writePlane },
  box: { read: (t) => (isBox(numbers(t)) ? numbers(t) : undefined), write: (b) => b.map(round).join(',') },
  vectors: oneOf('off', 'arrows', 'streamlines'),
  vectorField: text,
  vectorCount:
    { read: (t) => (Number(t) >= 1 ? clamp(Math.round(Number(t)), 1, mostVectors) : undefined), write: String },
  vectorSize: { read: (t) => clamp(Number(t) || 1, 0.1, 10), write: (x) => String(round(x)) },
  seeds: oneOf('volume', 'line', 'slice'),
  warp: text,
  warpScale: real,
  outline: flag,
  line: {
    read: (t) => (numbers(t).length === 6 && numbers(t).every((x) => x >= 0 && x <= 1) ? numbers(t) : undefined),
    write: (l) => l.map(round).join(','),
  },
  pins: list((t) => (numbers(t).length === 3 && numbers(t).every((x) => x >= 0 && x <= 1) ? numbers(t) : null),
    (p) => p.map(round).join(','), ';'),
  notes: { read: (t) => t.split('\u001f'), write: (l) => l.join('\u001f') },
  volume: flag,
  volumeSize: { read: (t) => (Number(t) > 0 ? clamp(Math.round(Number(t)), 16, 256) : 0), write: String },
  opacity:
    list(
      (t) => {
        const point = t.split(':').map(Number);
        return point.length === 2 && point.every((x) => x >= 0 && x <= 1) ? point : null;
      },
      (p) => p.map(round).join(':'), ','),
  background: oneOf('auto', 'white', 'black', 'grey'),
  axes: flag,
  parallel: flag,
  smooth: flag,
  second: text,
  other: text,
  compare: oneOf('beside', 'curtain', 'difference'),
  curtain: { read: (t) => (Number(t) >= 0 && Number(t) <= 1 ? Number(t) : undefined), write: (x) => String(round(x)) },
  camera: {
    read: (t) => (isCamera(numbers(t)) ? numbers(t) : undefined),
    write: (c) => c.map(round).join(','),
  },
};

const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

// '#error=0.01&slices=x@0.5' and back; what is as in `base` is left out.
export function fromFragment(fragment, base = defaults) {
  const state = { ...base };
  for (const [key, written] of new URLSearchParams(fragment.replace(/^#/, ''))) {
    const value = codecs[key]?.read(written);
    if (value !== undefined) state[key] = value;
  }
  if (state.opacity.length < 2) state.opacity = base.opacity;
  return state;
}

export function toFragment(state, base = defaults) {
  const parts =
    Object.keys(base)
      .filter((key) => !same(state[key], base[key]) && state[key] !== null)
      .map(
        (key) =>
          `${key}=${encodeURIComponent(codecs[key].write(state[key])).replace(/%(2C|3A|3B|40)/g, decodeURIComponent)}`);
  return parts.length ? `#${parts.join('&')}` : '';
}

export class Store extends EventTarget {
  constructor(state) {
    super();
    this.state = state;
  }

  // Changes some keys and tells which really changed.
  set(patch) {
    const changed = Object.keys(patch).filter((key) => !same(patch[key], this.state[key]));
    if (!changed.length) return;
    this.state = { ...this.state, ...patch };
    this.dispatchEvent(Object.assign(new Event('change'), { changed: new Set(changed) }));
  }

  // Calls `react(state)` now and whenever one of the keys changes.
  watch(keys, react) {
    this.addEventListener('change', (event) => {
      if (keys.some((key) => event.changed.has(key))) react(this.state);
    });
    react(this.state);
  }
}
