// SPDX-License-Identifier: BSD-3-Clause
// What the worker does: fetches the bytes that the goal needs, moves the cursor towards it, and makes the pictures of
// what it shows. Two loops, one for bytes and one for levels; whoever changes something wakes them.
import { chooseLevel } from './choose.js';
import { Source, sleep } from './network.js';
import { View } from './tetlod.js';

const slice = 100;      // milliseconds of decoding after which something is shown and messages are heard
const moveTime = 250;   // milliseconds that a move between two levels takes
const heavyFrame = 120; // milliseconds: above, a move would be seen as one jump anyway
const patience = 1000;  // milliseconds until a picture counts as seen

const aborted = () => new DOMException('the request was aborted', 'AbortError');

export class Engine {
  #emit; #source; #view; #info;
  #stop = new AbortController();
  #fields = null;     // indices that are decoded, null for all
  #received = 0;
  #goal = -1;         // level
  #limit = Infinity;  // finest level that can be decoded: the stream is damaged after it
  #shown = -1;        // level of the last pictures
  #request = null;    // {id, level, resolve, reject} of refineTo
  #spec = null; #dirty = false;
  #frameTime = 0;     // milliseconds of the last pictures
  #surfaceOf = -1;    // level whose boundary triangles the page has
  #seen = null;       // resolves when the page has seen the last pictures
  #bells = [];        // of loops that wait
  #failure = null;    // of the network or the stream: no bytes come any more, until the next request

  /** `emit(name, detail)` sends an event to the page. */
  constructor(emit) {
    this.#emit = emit;
  }

  // ---- what the page asks

  async open({ module, url, fields, retries, target }) {
    const onRetry = (detail) => this.#emit('retry', detail);
    this.#source = new Source(url, { signal: this.#stop.signal, retries, onRetry });
    const [compiled, described] = await Promise.all([module, this.#source.start()]);
    this.#view = await View.create(compiled);
    // the description says what the index will: then the first request asks for all that the target needs
    const first = described && target ? described.levels[chooseLevel(described, target)].bytes : 1;
    for (let until = first; ; until = Math.max(first, 2 * this.#received))
      if (await this.#receive(until)) break;
    this.#info = this.#view.describe();
    if (fields) this.#fields = fields.map((name) => this.#fieldIndex(name));
    if (target) this.#goal = chooseLevel(this.#info, target);
    const base = this.#info.levels[0].bytes;
    while (this.#received < base) await this.#receive(this.#untilGoal);
    this.#view.open(this.#fields);
    this.#fetchLoop();
    this.#showLoop();
    return this.#info;
  }

  /** Resolves to {level, reached} when the level is there and seen; a later request ends it earlier, unreached. */
  refineTo(target, id) {
    const level = chooseLevel(this.#info, target);
    if (level > this.#limit) this.#failAt(level);
    this.#request?.resolve({ level: this.#view.level, reached: false });
    this.#goal = level;
    if (this.#limit === Infinity) this.#failure = null; // a network may have come back
    return new Promise((resolve, reject) => {
      this.#request = { id, resolve, reject };
      this.#wake();
    });
  }

  abort(id) {
    if (this.#request?.id !== id) return;
    this.#goal = this.#view.level;
    this.#endRequest('reject', aborted());
    this.#wake();
  }

  mesh() {
    return this.#view.mesh(this.#info.fields);
  }

  show(spec) {
    const before = this.#spec;
    this.#spec = spec && this.#checkSpec(spec);
    if (!before?.surface) this.#surfaceOf = -1;
    this.#dirty = true;
    this.#wake();
  }

  seen() {
    this.#seen?.();
  }

  close() {
    this.#stop.abort(aborted());
    this.#source?.close();
    this.#endRequest('reject', aborted());
    this.#wake();
  }

  // ---- waiting

  #wake() {
    for (const ring of this.#bells.splice(0)) ring();
  }

  #change() {
    return new Promise((resolve) => this.#bells.push(resolve));
  }

  get #closed() {
    return this.#stop.signal.aborted;
  }

  #endRequest(how, value) {
    const request = this.#request;
    this.#request = null;
    request?.[how](value);
  }

  #failAt(level) {
    throw new RangeError(`level ${level} cannot be decoded: ${this.#failure.message}`);
  }

  // ---- bytes

  // One more piece of the stream; true once the index is there.
  async #receive(until) {
    const bytes = await this.#source.read(this.#received, until);
    const opened = this.#view.add(bytes);
    this.#received += bytes.length;
    this.#emit('progress', { received: this.#received, total: Math.max(until, this.#received) });
    return opened;
  }

  get #untilGoal() {
    return this.#info.levels[Math.max(this.#goal, 0)].bytes;
  }

  async #fetchLoop() {
    while (!this.#closed) {
      const until = this.#untilGoal;
      if (this.#received >= until || this.#failure) {
        this.#source.pause();
        await this.#change();
        continue;
      }
      try {
        await this.#receive(until);
        this.#wake();
      } catch (error) {
        this.#fail(error);
      }
    }
  }

  // What is decoded stays; the request ends when everything before the failure is shown.
  #fail(error) {
    if (this.#closed) return;
    this.#failure = error;
    this.#emit('error', { message: error.message });
    this.#wake();
  }

  // ---- levels

  // The level that can be shown now on the way to the goal.
  get #within() {
    return Math.min(this.#goal, this.#view.ready, this.#limit);
  }

  async #showLoop() {
    while (!this.#closed) {
      try {
        const next = this.#within;
        if (this.#goal >= 0 && next > this.#view.level) await this.#refine(next);
        else if (this.#goal >= 0 && next < this.#view.level) await this.#coarsen(next);
        else if (this.#dirty) await this.#present(1);
        else await this.#settle();
      } catch (error) {
        this.#halt(error);
      }
    }
  }

  // Damage that is only seen while decoding, or no memory: no finer level than this is tried again.
  #halt(error) {
    this.#limit = this.#view.level;
    this.#dirty = false;
    this.#fail(error);
  }

  // Nothing is left to do at this level: the request may have ended; then wait.
  async #settle() {
    const level = this.#view.level;
    const change = this.#change();
    if (this.#request && level === this.#goal) {
      this.#emit('finished', { level });
      this.#endRequest('resolve', { level, reached: true });
    } else if (this.#request && this.#failure) {
      this.#endRequest('reject', this.#failure);
    }
    await change;
  }

  #announce(level, started) {
    const { vertices, tets } = this.#info.levels[level];
    this.#emit('level', { level, vertices, tets, seconds: (performance.now() - started) / 1000 });
  }

  // Some levels up, for as long as a slice of time lasts.
  async #refine(next) {
    const from = this.#view.level;
    const started = performance.now();
    try {
      do this.#view.seek(this.#view.level + 1);
      while (this.#view.level < next && performance.now() - started < slice);
    } catch (error) {
      this.#halt(error);
    }
    if (this.#view.level === from) return;
    this.#announce(this.#view.level, started);
    if (this.#moves(from)) await this.#animate(0, 1);
    await this.#present(1);
  }

  async #coarsen(next) {
    if (this.#moves(next)) await this.#animate(1, 0);
    const started = performance.now();
    this.#view.seek(next);
    this.#announce(next, started);
    await this.#present(1);
  }

  // ---- pictures

  #fieldIndex(name) {
    const index = this.#info.fields.findIndex((field) => field.name === name);
    if (index < 0) throw new RangeError(`there is no field '${name}'; there are: ${this.#info.fields.map((f) => f.name).join(', ')}`);
    if (this.#fields && !this.#fields.includes(index)) throw new RangeError(`the field '${name}' was not opened`);
    return index;
  }

  #component(field, component = 0) {
    const { name, components } = this.#info.fields[field];
    if (component === 'magnitude') return -1;
    if (Number.isInteger(component) && component >= 0 && component < components) return component;
    throw new RangeError(`the field '${name}' has ${components} components; component is one of their numbers from 0, or 'magnitude'`);
  }

  // The spec with indices for names.
  #checkSpec({ field, component, surface = false, slices = [], isosurfaces = [], morph = true }) {
    const shade = field === undefined ? -1 : this.#fieldIndex(field);
    const of = (name) => (name === undefined ? shade : this.#fieldIndex(name));
    if (shade < 0 && isosurfaces.some((iso) => iso.field === undefined)) throw new RangeError('an isosurface needs a field');
    return {
      surface, slices, morph, shade,
      component: shade < 0 ? 0 : this.#component(shade, component),
      isosurfaces: isosurfaces.map((iso) => ({
        field: of(iso.field), value: iso.value,
        component: this.#component(of(iso.field), iso.component ?? (iso.field === undefined ? component : 0)),
      })),
    };
  }

  // Prepares a move to or from a coarser level, if it would be seen: something is drawn, and quickly.
  #moves(coarser) {
    if (!this.#spec?.morph || this.#shown < 0 || this.#frameTime > heavyFrame) return false;
    try {
      this.#view.move(coarser);
      return true;
    } catch {
      return false; // no memory for it: then a jump
    }
  }

  async #animate(start, end) {
    const began = performance.now() - this.#frameTime; // the first frame is seen when it is made
    for (;;) {
      const passed = (performance.now() - began) / moveTime;
      if (passed >= 1) break;
      await this.#present(start + passed * (end - start));
      if (this.#closed) return;
    }
    if (!end) await this.#present(0);
  }

  #draw() {
    const { shade, component, surface, slices, isosurfaces } = this.#spec;
    if (shade >= 0) this.#view.shade(shade, component);
    const picture = { surface: null, slices: [], isosurfaces: [], volume: null };
    if (surface) {
      picture.surface = this.#view.surface(this.#surfaceOf !== this.#view.level);
      this.#surfaceOf = this.#view.level;
    }
    picture.slices = slices.map(({ origin, normal }) => this.#view.slice(origin, normal));
    picture.isosurfaces = isosurfaces.map((iso) => this.#view.isosurface(iso.field, iso.component, iso.value));
    return picture;
  }

  // Makes the pictures at t of a move (1: at rest) and waits until they are seen.
  async #present(t) {
    this.#dirty = false;
    this.#shown = this.#view.level;
    if (!this.#spec) return;
    const started = performance.now();
    this.#view.place(t);
    const picture = this.#draw();
    this.#frameTime = performance.now() - started;
    const seen = new Promise((resolve) => { this.#seen = resolve; });
    this.#emit('pictures', { level: this.#view.level, t, origin: this.#view.centre, ...picture, seconds: this.#frameTime / 1000 });
    const patient = new AbortController();
    await Promise.race([seen, sleep(patience, patient.signal).catch(() => {})]);
    patient.abort();
  }
}
