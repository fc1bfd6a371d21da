// SPDX-License-Identifier: BSD-3-Clause
// The difference of two streams: what the picture shows, less what another stream has there. Its bound is the sum of
// both.

import { chooseBand, infoOfSteps } from '../client/steps.js';
import { TetlodStream } from '../client/stream.js';
import { componentOf, fieldOf } from './levels.js';
import { boundShown } from './promises.js';
import { Sampler } from './sampler.js';
import { targetOf } from './spec.js';

const partsOf = ({ surface, slices, isosurfaces, vectors }) =>
  [surface, ...slices, ...isosurfaces, vectors].filter(Boolean);

export class Difference {
  range = [-1, 1];
  bound = null; // { bound, certified }, of what is shown
  #viewer;
  #source;
  #stream = null;
  #here = null;
  #triangles = null;
  #closing = new AbortController();

  /** `source`: the other stream's. Its field of the same name and components is taken. */
  constructor(viewer, source) {
    this.#viewer = viewer;
    this.#source = source;
  }

  close() {
    this.#closing.abort();
    this.#stream?.close();
  }

  /** The state with what differences are of: a field, or its length. */
  plain(state) {
    const component = componentOf(this.#viewer.info, state);
    return { ...state, component, volume: false, smooth: false, cells: '', formula: '', refine: null };
  }

  // The other stream with its field, as fine as this one is asked to be, at the same step; sorted once.
  async #arrive(name) {
    const { signal } = this.#closing;
    const {
      store: { state },
      info,
      at,
    } = this.#viewer;
    if (!this.#stream) {
      const stream = await TetlodStream.open(this.#source, { signal, fields: [name] });
      if (signal.aborted) stream.close();
      signal.throwIfAborted();
      this.#stream = stream;
    }
    const stream = this.#stream;
    const { components } = fieldOf(info, name);
    if (fieldOf(stream.info, name)?.components !== components)
      throw new RangeError(`the other stream has no field ${name} as this one has`);
    await stream.addFields([name]);
    if (at) await stream.seekStep(at.step, { error: at.error }, { signal });
    else await stream.refineTo(targetOf(state, stream.info), { signal });
    const key = JSON.stringify([stream.level, at?.step, name]);
    if (this.#here?.key === key) return;
    const mesh = await stream.mesh();
    this.#here = { key, field: { values: mesh.fields[name], components }, sampler: await Sampler.of(mesh) };
  }

  // Triangles with a corner where the other stream is not are left out.
  async #change(part, origin, triangles, valueOf) {
    const { sampler, field } = this.#here;
    const there = await sampler.at(part.points, origin, field, valueOf);
    const missing = there.map(Number.isNaN);
    const values = Float32Array.from(part.values, (value, i) => (missing[i] ? 0 : value - there[i]));
    const isThere = (_, i) => [0, 1, 2].every((k) => !missing[triangles[i - (i % 3) + k]]);
    return { ...part, vectors: null, values, triangles: triangles.filter(isThere) };
  }

  /** The pictures with differences for values. */
  async of(pictures) {
    const { info, store } = this.#viewer;
    const state = this.plain(store.state);
    await this.#arrive(state.field);
    const length = state.component === 'magnitude' && fieldOf(info, state.field).components > 1;
    const valueOf = length ? (row) => Math.hypot(...row) : (row) => row[state.component];
    if (pictures.surface?.triangles) this.#triangles = pictures.surface.triangles; // else they are the same as before
    const change = (part, triangles = part?.triangles) =>
      part && this.#change(part, pictures.origin, triangles, valueOf);
    const made = {
      ...pictures,
      surface: await change(pictures.surface, this.#triangles),
      slices: await Promise.all(pictures.slices.map((part) => change(part))),
      isosurfaces: await Promise.all(pictures.isosurfaces.map((part) => change(part))),
      vectors: await change(pictures.vectors),
      zones: pictures.zones.map(() => null),
    };
    this.#measure(made, state);
    return made;
  }

  #measure(made, state) {
    const {
      told,
      level,
      at,
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
    this.bound = { bound: here.bound + there.bound, certified: here.certified && there.certified };
    made.shade = { ...made.shade, range: this.range, sample: undefined };
  }
}
