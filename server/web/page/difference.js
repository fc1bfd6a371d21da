// SPDX-License-Identifier: BSD-3-Clause
// The difference of two streams: what the picture shows, less what another stream has there. Its bound is the sum of
// both.

import { chooseBand, infoOfSteps } from '../client/steps.js';
import { TetlodStream } from '../client/stream.js';
import { colouredOf, fieldOf } from './levels.js';
import { boundShown } from './promises.js';
import { Sampler } from './sampler.js';
import { targetOf } from './spec.js';

const partsOf = ({ surface, slices, isosurfaces, vectors }) =>
  [surface, ...slices, ...isosurfaces, vectors].filter(Boolean);

export class Difference {
  range = [-1, 1];
  bound = null; // { bound, certified }, of what is shown
  state = null; // that it is shown for
  #viewer;
  #source;
  #stream = null;
  #here = null;
  #triangles = null;
  #newest = 0; // pictures that were asked for
  #turn = Promise.resolve(); // the last of them
  #closing = new AbortController();

  /** `source`: the other stream's. Its fields of the same names and components are taken. */
  constructor(viewer, source) {
    this.#viewer = viewer;
    this.#source = source;
  }

  close() {
    this.#closing.abort();
    this.#stream?.close();
  }

  /** The state with what differences are of: fields, and functions of them, where the points are as they were. */
  plain(state) {
    return { ...state, volume: false, smooth: false, cells: '', refine: null, warp: '' };
  }

  // What pictures are coloured by: others may be asked for already.
  #stateOf({ field, component, formula }) {
    const {
      store: { state },
      info,
    } = this.#viewer;
    if (!formula) return { ...state, formula: '', field, component };
    return colouredOf(info, state).formula?.text === field ? state : { ...state, formula: field };
  }

  // Of the other stream's index when it is here; a series is one a little later.
  async #steps(stream, signal) {
    if (!stream.info.time) throw new RangeError('the other stream has no steps in time');
    if (stream.series) return;
    await new Promise((resolve, reject) => {
      stream.addEventListener('series', resolve, { once: true, signal });
      stream.addEventListener('error', ({ detail }) => reject(new Error(detail.message)), { once: true, signal });
      signal.addEventListener('abort', () => reject(signal.reason), { once: true });
    });
  }

  // The other stream with its fields, as fine as this one is asked to be, at the same step; sorted once.
  async #arrive(names, at) {
    const { signal } = this.#closing;
    const {
      store: { state },
      info,
    } = this.#viewer;
    if (!this.#stream) {
      const stream = await TetlodStream.open(this.#source, { signal, fields: names });
      if (signal.aborted) stream.close();
      signal.throwIfAborted();
      this.#stream = stream;
    }
    const stream = this.#stream;
    const lost = names.find((name) => fieldOf(stream.info, name)?.components !== fieldOf(info, name).components);
    if (lost) throw new RangeError(`the other stream has no field ${lost} as this one has`);
    await stream.addFields(names);
    if (at) await this.#steps(stream, signal);
    if (at) await stream.seekStep(at.step, { error: at.error }, { signal });
    else await stream.refineTo(targetOf(state, stream.info), { signal });
    const key = JSON.stringify([stream.level, at?.step, at?.error]);
    if (this.#here?.key === key && names.every((name) => this.#here.fields[name])) return;
    const mesh = await stream.mesh();
    this.#here = { key, fields: mesh.fields, sampler: await Sampler.of(mesh) };
  }

  // What colours, of the other stream: its columns [values, components, component], and what makes a value of a row.
  #quantity({ field, component, formula }) {
    const column = (name, c) => [this.#here.fields[name], fieldOf(this.#viewer.info, name).components, c];
    if (formula)
      return { columns: formula.inputs.map((input) => column(...input)), valueOf: (row) => formula.value(row) };
    const columns = Array.from({ length: field.components }, (_, c) => column(field.name, c));
    const length = component === 'magnitude' && field.components > 1;
    return { columns, valueOf: length ? (row) => Math.hypot(...row) : (row) => row[component] };
  }

  // Triangles with a corner where the other stream is not are left out.
  async #change(part, origin, triangles, quantity) {
    const there = await this.#here.sampler.at(part.points, origin, quantity);
    const missing = there.map(Number.isNaN);
    const values = Float32Array.from(part.values, (value, i) => (missing[i] ? 0 : value - there[i]));
    const isThere = (_, i) => [0, 1, 2].every((k) => !missing[triangles[i - (i % 3) + k]]);
    return { ...part, vectors: null, values, triangles: triangles.filter(isThere) };
  }

  /** The pictures with differences for values; null: others have come meanwhile. One after the other. */
  async of(pictures) {
    if (pictures.surface?.triangles) this.#triangles = pictures.surface.triangles; // else they are the same as before
    else if (pictures.surface && !this.#triangles) return null; // made before this was: whole ones come
    const [mine, triangles, before] = [++this.#newest, this.#triangles, this.#turn];
    const { at } = this.#viewer; // the pictures' step: the viewer may be at another one before they are made
    const making = before.then(() => (mine === this.#newest ? this.#make(pictures, triangles, at) : null));
    this.#turn = making.catch(() => {});
    return making;
  }

  async #make(pictures, ofSurface, at) {
    const { info } = this.#viewer;
    const state = this.plain(this.#stateOf(pictures.shade));
    const coloured = colouredOf(info, state);
    await this.#arrive(coloured.formula?.fields ?? [coloured.field.name], at);
    const quantity = this.#quantity(coloured);
    const change = (part, triangles = part?.triangles) =>
      part && this.#change(part, pictures.origin, triangles, quantity);
    const made = {
      ...pictures,
      surface: await change(pictures.surface, ofSurface),
      slices: await Promise.all(pictures.slices.map((part) => change(part))),
      isosurfaces: await Promise.all(pictures.isosurfaces.map((part) => change(part))),
      vectors: await change(pictures.vectors),
      zones: pictures.zones.map(() => null),
    };
    this.#measure(made, state, at);
    return made;
  }

  #measure(made, state, at) {
    const {
      told,
      level,
      info: { typedUnits },
    } = this.#viewer;
    const { info, series } = this.#stream;
    const most = partsOf(made).reduce(
      (largest, { values }) => values.reduce((m, x) => Math.max(m, Math.abs(x)), largest),
      0,
    );
    this.range = [-most, most].map((x) => x || 0);
    const here = boundShown(told, level, state);
    const there = boundShown(
      { ...(at ? infoOfSteps(info, series, chooseBand(series, at.error)) : info), typedUnits },
      this.#stream.level,
      state,
    );
    const known = here.bound !== null && there.bound !== null; // functions may have none
    this.state = state;
    this.bound = { bound: known ? here.bound + there.bound : null, certified: here.certified && there.certified };
    made.shade = { ...made.shade, range: this.range, sample: undefined };
  }
}
