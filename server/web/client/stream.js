// SPDX-License-Identifier: BSD-3-Clause
// TetlodStream: a stream that refines and coarsens, in a worker of its own. README.md describes it.

// node 18 has no CustomEvent
const CustomEvent = globalThis.CustomEvent ?? class extends Event {
  constructor(name, { detail }) {
    super(name);
    this.detail = detail;
  }
};

// Bundlers know the worker by this very expression.
async function startWorker() {
  if (typeof Worker !== 'undefined')
    return { worker: new Worker(new URL('./worker.js', import.meta.url), { type: 'module', name: 'tetlod' }) };
  const threads = 'node:worker_threads'; // not a literal: bundlers for browsers need not know it
  return { worker: new (await import(threads)).Worker(new URL('./worker.js', import.meta.url)) };
}

// A page without an origin (one from the disk, or in a sandbox) may not run a Blob as a module, but the text itself.
const addressOf = (text) => (globalThis.origin === 'null' ? `data:text/javascript,${encodeURIComponent(text)}`
  : URL.createObjectURL(new Blob([text], { type: 'text/javascript' })));
const ofText = (text) => new Worker(addressOf(text), { type: 'module', name: 'tetlod' });

// Of another origin a script is no worker, but one of the page's may import it.
async function startForeign(cause) {
  if (cause.name !== 'SecurityError') throw cause;
  const { url } = import.meta; // bundlers need not know the worker once more
  return { worker: ofText(`import ${JSON.stringify(new URL('./worker.js', url).href)};`) };
}

// Where the worker's file is not to be had (a bundler that does not know it, a server for development), the copy in a
// module of ours is run.
async function startCopy(cause) {
  const { source, wasm } = await import('./inline.js').catch(() => { throw cause; });
  return { worker: ofText(source), module: await WebAssembly.compile(wasm()) };
}

class NotStarted extends Error {}

const isReader = (source) => typeof source?.read === 'function';

// What the worker gets of a source.
function described(source) {
  if (typeof Blob !== 'undefined' && source instanceof Blob) return { blob: source };
  if (isReader(source)) return { page: true };
  const { url, headers, credentials } = typeof source === 'string' || source instanceof URL ? { url: source } : source;
  return {
    url: new URL(url, globalThis.document?.baseURI ?? globalThis.location?.href).href,
    headers: headers && Object.fromEntries(new Headers(headers)),
    credentials
  };
}

function listen(worker, onMessage, onError) {
  if (worker.on) return worker.on('message', onMessage).on('error', onError);
  worker.onmessage = ({ data }) => onMessage(data);
  worker.onerror = (event) => onError(new NotStarted(event.message || 'the worker could not be started'));
  return worker;
}

function errorOf({ name, message, status }) {
  if (name === 'AbortError') return new DOMException(message, name);
  const made = Object.assign(name === 'RangeError' ? new RangeError(message) : new Error(message), { name });
  if (status !== undefined) made.status = status;
  return made;
}

// A frame is seen when the next one begins; pages that are hidden have no frames, nor has node.
const nextFrame = (call) => (
  typeof requestAnimationFrame === 'function' && !document.hidden ? requestAnimationFrame(call) : setTimeout(call, 16));

// What a message leaves out because it is the same as in the last one, from `kept`.
function completed(pictures, kept) {
  const restore = (key, owner, name) => {
    if (owner[name] === undefined) return { ...owner, [name]: kept.get(key) };
    kept.set(key, owner[name]);
    return owner;
  };
  const whole = restore('vectors', restore('volume', pictures, 'volume'), 'vectors');
  if (whole.shade) whole.shade = restore('sample', whole.shade, 'sample');
  if (whole.surface) whole.surface = restore('lines', restore('triangles', whole.surface, 'triangles'), 'lines');
  if (whole.rays) for (const name of ['corners', 'neighbours', 'faces']) whole.rays = restore(name, whole.rays, name);
  return whole;
}

const closedReason = () => new DOMException('the stream was closed', 'AbortError');

// One worker and the calls that wait for its answers.
class Link {
  received = { received: 0, receivedSteps: 0 }; // bytes, of levels and of steps
  #worker; #calls = new Map(); #tell; #failed; #reason = null; #running = false;

  /** `tell(event, detail)` hears its events, `failed(error)` that a running worker broke. */
  constructor(tell, failed) {
    this.#tell = tell;
    this.#failed = failed;
  }

  async open(options) {
    let cause;
    for (const start of [startWorker, startForeign, startCopy]) {
      try {
        const { worker, module } = await start(cause);
        this.#use(worker);
        return await this.#opened({ ...options, wasm: options.wasm ?? module });
      } catch (error) {
        if (this.#reason || !(error instanceof NotStarted || error.name === 'SecurityError')) throw error;
        cause = error;
      }
    }
    throw cause;
  }

  async #opened(options) {
    const value = await this.call(nextId++, 'open', options);
    this.#running = true;
    return value;
  }

  #use(worker) {
    this.#worker = listen(worker, (message) => this.#hear(message), (error) => {
      if (this.#running) this.#failed(error);
      else this.#rejectAll(error); // it never ran
    });
    if (this.#reason) this.#worker.terminate(); // closed while it started
  }

  send(message) {
    if (!this.#reason) this.#worker?.postMessage(message);
  }

  call(id, action, argument) {
    return new Promise((resolve, reject) => {
      if (this.#reason) throw this.#reason;
      this.#calls.set(id, { action, argument, resolve, reject });
      this.send({ action, id, argument });
    });
  }

  /** Another link answers what this one was asked and has not answered. */
  handOver(other) {
    for (const [id, call] of this.#calls) {
      other.#calls.set(id, call);
      other.send({ action: call.action, id, argument: call.argument });
    }
    this.#calls.clear();
    this.close(closedReason());
  }

  close(reason) {
    if (this.#reason) return;
    this.#reason = reason;
    this.#worker?.terminate();
    this.#rejectAll(reason);
  }

  #rejectAll(reason) {
    for (const { reject } of this.#calls.values()) reject(reason);
    this.#calls.clear();
  }

  #hear({ id, value, failure, event, detail }) {
    if (this.#reason) return;
    if (event) this.#tell(event, detail, this);
    const call = this.#calls.get(id);
    if (!call) return;
    this.#calls.delete(id);
    if (failure) call.reject(errorOf(failure));
    else call.resolve(value);
  }
}

let nextId = 0; // of calls

export class TetlodStream extends EventTarget {
  #link;
  #next = null;
  #crossing = null;
  #ahead = null;
  #asks = 0;
  #asking = null;
  #topologies = [];
  #options;
  #spec = null;
  #step = null;
  #replacing = Promise.resolve();
  #closed = false;
  #tellEnded;
  #ended = new Promise((resolve) => {
    this.#tellEnded = resolve;
  });
  #reader = null;
  #reading = new AbortController();
  #look = null;
  info = null;
  fields = []; // names of those that are decoded
  level = 0;
  received = 0;
  fetched = 0; // all bytes that came, by all workers: of descriptions, of what is asked for once more, and those below
  receivedCells = 0; // bytes of values of cells, beside those
  receivedSteps = 0; // bytes of steps, beside those
  receivedBefore = 0; // bytes of topology groups that were shown before, beside all those
  bytes = 0; // of the whole stream, all topology groups among them
  // Of a series in time, from the event `series` on: {group, times, bands: [{error, level}], fields: [{name, range}],
  // displacement: name or null}
  series = null;
  // The topology group that is shown, of a series whose mesh changes: `info`, levels and bands are its own, times those
  // of all
  topology = 0;

  /**
   * Opens a stream and decodes its base mesh. `source`: the URL of a server's mesh (…/v1/meshes/{id}) or of a file, or
   * {url, headers, credentials} as of fetch; a Blob or File; or {read(from, to, signal)}, which resolves to a
   * Uint8Array. Options: `target`, as of refineTo, which it goes on to: its bytes come with the first ones; `fields`,
   * the names of those to decode (all), or 'first', the first that drove the contraction where the source can leave out
   * the others, which addFields brings later; `signal`; `retries` of a request that fails (8); `on`, listeners by the
   * name of their event, which also hear what happens while it opens; `wasm`, URL of the module.
   */
  static async open(source, { target, fields, signal, retries, on = {}, wasm } = {}) {
    signal?.throwIfAborted();
    const stream = new TetlodStream();
    for (const [name, listener] of Object.entries(on)) stream.addEventListener(name, listener);
    const stop = () => stream.close(signal.reason);
    signal?.addEventListener('abort', stop, { once: true });
    try {
      const told = described(source);
      if (told.page) stream.#reader = source;
      stream.#options = {
        source: told,
        retries,
        wasm: wasm && new URL(wasm, globalThis.document?.baseURI ?? globalThis.location?.href).href
      };
      stream.#link = stream.#newLink();
      stream.#take(await stream.#link.open({ ...stream.#options, fields, target }));
      stream.#topologies = stream.info.topologies;
      stream.bytes = stream.info.bytes;
    } catch (error) {
      stream.close();
      throw error;
    } finally {
      signal?.removeEventListener('abort', stop);
    }
    return stream;
  }

  /**
   * Refines or coarsens to the coarsest level whose `error` (a fraction of the field's range) or `absError` is at most
   * that, of `field` (every one that drove the contraction) in `measure` ('max'); to `level`; and within the budgets
   * `tets` and `bytes`. Without any of them: to the finest. Resolves to {level, reached}: a later call ends an earlier
   * one, whose `reached` is false.
   */
  async refineTo(target = {}, { signal } = {}) {
    this.#step = null;
    this.#leaveCrossing();
    return this.#ask('refineTo', target, signal);
  }

  /**
   * Shows a step of a series in time: in `band`, or in the coarsest one within `error` (exact); with `blend`, values
   * pass into it from those of the step before, in so many milliseconds. Resolves as refineTo does, which leads back to
   * the first step's levels.
   */
  async seekStep(step, { band, error, blend } = {}, { signal } = {}) {
    const { topology, own } = this.#placeOf(step);
    const wanted = { step: own, band, error, blend };
    if (topology !== this.topology) return this.#cross(topology, wanted, signal);
    this.#step = wanted;
    this.#leaveCrossing();
    return this.#ask('seekStep', wanted, signal);
  }

  async #ask(action, argument, signal) {
    signal?.throwIfAborted();
    const id = this.#asking = nextId++;
    const mine = ++this.#asks;
    const stop = () => this.#link.send({ action: 'abort', argument: id });
    signal?.addEventListener('abort', stop, { once: true });
    try {
      return await this.#call(action, argument, id);
    } catch (error) {
      if (mine !== this.#asks && error.name === 'AbortError' && !this.#closed && !signal?.aborted)
        return { level: this.level, reached: false };
      throw error;
    } finally {
      signal?.removeEventListener('abort', stop);
    }
  }

  // ---- topology groups: each is a stream of its own, with a worker of its own

  // The group of a step, which counts through all of them, and its number there.
  #placeOf(step) {
    let own = step;
    for (const [topology, { times }] of this.#topologies.entries()) {
      if (own < times.length) return { topology, own };
      own -= times.length;
    }
    if (this.#topologies.length)
      throw new RangeError(`step is a whole number from 0 to ${step - own - 1}, not ${step}`);
    return { topology: 0, own: step };
  }

  #stepsBefore(topology) {
    return this.#topologies.slice(0, topology).reduce((sum, { times }) => sum + times.length, 0);
  }

  // Its worker opens the stream; `opened` resolves then.
  #prepare(topology) {
    const link = this.#newLink();
    link.topology = topology;
    const opened = link.open({ ...this.#optionsOf(topology), fields: this.fields });
    opened.catch(() => {}); // whoever crosses hears of it
    return { topology, link, opened };
  }

  #optionsOf(topology) {
    return topology ? { ...this.#options, part: this.#topologies[topology] } : this.#options;
  }

  #leaveCrossing() {
    this.#crossing?.link.close(closedReason());
    this.#crossing = null;
  }

  // What is shown stays until the other group has come to the step.
  async #cross(topology, wanted, signal) {
    signal?.throwIfAborted();
    this.#asks++;
    this.#link.send({ action: 'abort', argument: this.#asking }); // what it was asked for is not wanted any more
    const mine = this.#crossing = { ...this.#takePrepared(topology) };
    const stop = () => { if (this.#crossing === mine) this.#leaveCrossing(); };
    signal?.addEventListener('abort', stop, { once: true });
    try {
      const opened = await mine.opened;
      const answer = await mine.link.call(nextId++, 'seekStep', { ...wanted, blend: 0 });
      if (this.#crossing !== mine || !answer.reached) return { level: this.level, reached: false };
      this.#crossing = null;
      this.#step = wanted;
      this.#takeOver(mine, opened);
      return answer;
    } catch (error) {
      if (this.#crossing !== mine && !this.#closed && !signal?.aborted) return { level: this.level, reached: false };
      if (this.#crossing === mine) this.#leaveCrossing();
      throw signal?.aborted ? signal.reason : error;
    } finally {
      signal?.removeEventListener('abort', stop);
    }
  }

  // The worker that is on its way there already, or is ahead; of another group it ends.
  #takePrepared(topology) {
    const here = [this.#crossing, this.#ahead].find((prepared) => prepared?.topology === topology);
    if (this.#crossing && this.#crossing.link !== here?.link) this.#leaveCrossing();
    if (this.#ahead && this.#ahead.link !== here?.link) this.#ahead.link.close(closedReason());
    this.#ahead = null;
    return here ?? this.#prepare(topology);
  }

  #takeOver({ topology, link }, opened) {
    const before = this.#link;
    this.#link = link;
    this.topology = topology;
    this.receivedBefore += this.received + this.receivedSteps;
    Object.assign(this, link.received);
    this.#take(opened);
    this.series = this.#whole(link.series);
    this.#showBy(link);
    before.handOver(link);
    this.#dispatch('topology', { topology, info: this.info });
    this.#tell('level', link.level, link);
    this.#tell('step', link.at, link);
  }

  // The next group is opened while the last steps of this one are shown.
  #lookAhead(step) {
    const { length } = this.#topologies;
    if (!length || this.#ahead || this.#crossing
      || step + this.series.group < this.#topologies[this.topology].times.length)
      return;
    this.#ahead = this.#prepare((this.topology + 1) % length);
    const { link, opened } = this.#ahead;
    opened.then(() => link.call(nextId++, 'seekStep', { ...this.#step, step: 0, blend: 0 })).catch(() => {});
  }

  // A group's series, with the times of all steps.
  #whole(series) {
    return this.#topologies.length ? { ...series, times: this.#topologies.flatMap(({ times }) => times) } : series;
  }

  // A worker's message about its group's steps, in numbers that count through all groups; `steps`: from and to of those
  // that are there.
  #ofAll(detail, { topology = 0, series: { group, times } }) {
    const before = this.#stepsBefore(topology);
    const steps = detail.groups.map((g) => [before + g * group, before + Math.min((g + 1) * group, times.length)]);
    return { ...detail, steps, ...(detail.step !== undefined && { step: before + detail.step }) };
  }

  /**
   * Decodes these fields, too, from now on. Pictures and meshes go on without them until they are there, at the level
   * that is shown; it costs what opening the stream at this level costs, and its memory meanwhile.
   */
  addFields(names) {
    this.#replacing = this.#replacing.catch(() => {}).then(() => this.#addFields(names));
    return this.#replacing;
  }

  async #addFields(names) {
    const missing = names.filter((name) => !this.fields.includes(name));
    if (missing.length) await this.#replace([...this.fields, ...missing]);
  }

  /**
   * Gives back the memory that finer levels took: the level that is shown is decoded anew, in another worker that takes
   * over. It costs what opening the stream at this level costs.
   */
  compact() {
    this.#replacing = this.#replacing.catch(() => {}).then(() => this.#replace(this.fields));
    return this.#replacing;
  }

  // By a worker that has these fields, at the level that is shown by then.
  async #replace(fields) {
    this.#next = this.#newLink();
    try {
      this.#next.topology = this.topology;
      const opened = await this.#next.open(
        { ...this.#optionsOf(this.topology), fields, target: { level: this.level } });
      let target;
      do {
        target = { level: this.level }; // the other one goes on
        await this.#next.call(nextId++, 'refineTo', target);
      } while (this.level !== target.level);
      if (this.#step) await this.#next.call(nextId++, 'seekStep', { ...this.#step, blend: 0 });
      if (this.#next.topology !== this.topology) throw closedReason(); // it has gone on to another mesh
      this.#take(opened);
      this.#showBy(this.#next);
      this.#link.handOver(this.#next);
      this.#link = this.#next;
    } catch (error) {
      this.#next.close(error);
      throw error;
    } finally {
      this.#next = null;
    }
  }

  /** Copies of the current level's arrays: {level, positions, tets, fields, parents}. */
  mesh() {
    return this.#call('mesh');
  }

  /** The same of what is drawn, cut by plane and box, with `numbers` and `cells` of the original's tetrahedra. */
  drawn() {
    return this.#call('drawn');
  }

  /**
   * Fetches the values of a field of cells, which are there from the event `cells` on. show() does so, too, for those
   * that it needs.
   */
  loadCells(name) {
    return this.#call('loadCells', name);
  }

  /**
   * The values of a field of cells, of all the original's tetrahedra: a level's are the first. They come when they are
   * first asked for.
   */
  cells(name) {
    return this.#call('cells', name);
  }

  /**
   * {values: {field: [components]}, cells: {field: [components]}, tet} at a point of the mesh that is shown, or null
   * outside of it.
   */
  probe(point) {
    return this.#call('probe', point);
  }

  /** {level, ends, bounds}: the value that colours the pictures, along a segment: [at, value] of begin and end of each
   * piece, exactly as the mesh has it;
   *  `bounds`: how far off it is at most at each of these ends, where the field's local bound is loaded. */
  line(from, to) {
    return this.#call('line', [from, to]);
  }

  /**
   * What is certain of the original, by the levels up to the one that is shown: {lower, upper, bound: 'exact' or
   * 'certified', level, tets, bytes} of a question ('mean(p)', 'volume(T > 400)'; `tetlod help ask`), as narrow as
   * `within` of what the answer can be at most. Not of steps in time.
   */
  ask(question, { within = 0.01 } = {}) {
    return this.#call('prove', { question, within });
  }

  /**
   * {level, error, bounded: {maximum, minimum}, features: [{kind, proven, at, box, range, persistence}]}: maxima and
   * minima of a field, of a component ('v:1') or the length ('|v|'), of a persistence above a fraction of its range.
   * The original has those that are proven, each in its box, and no others than these where it is `bounded`.
   */
  features(quantity, { persistence = 0.02 } = {}) {
    return this.#call('prove', { quantity, persistence });
  }

  /** Pictures at rest of the finest level of at most so many tetrahedra, which is coarser than what is shown, or null.
   * */
  draft(tets) {
    return this.#call('draft', tets);
  }

  /**
   * Of a stream with levels in pages, where the level that is shown has none (`info.paged` is the first that has):
   * pages are those that a view needs, from now on; null: no others than the level's. `look`: {planes: [[x, y, z, d]],
   * eye, near, scale, parallel, pixels, tets, bytes, field, measure, id}. The event `refined` says what is shown.
   */
  look(look) {
    this.#look = look;
    this.#link.send({ action: 'look', argument: look });
  }

  #showBy(link) {
    link.send({ action: 'show', argument: this.#spec });
    if (this.#look) link.send({ action: 'look', argument: this.#look });
  }

  /** Which pictures to make of this and every following level; null: none. `whole`: the first ones leave nothing out
   * that is the same. */
  async show(spec, { whole = false } = {}) {
    if (whole) this.#link.send({ action: 'forget' });
    await this.#call('show', spec);
    this.#spec = spec;
  }

  /**
   * The pictures of a spec one after the other, whenever the next ones are asked for the newest; each is complete: it
   * has the triangles, too, that are the same as in the one before. Ends with the stream, or when the loop is left:
   * what was shown before is shown again.
   */
  async *frames(spec) {
    const before = this.#spec;
    const kept = new Map();
    let newest = null;
    let ring = () => {};
    const take = ({ detail }) => {
      newest = completed(detail, kept);
      ring();
    };
    this.addEventListener('pictures', take);
    try {
      await this.show(spec, { whole: true });
      newest = null; // of what was shown before
      while (!this.#closed) {
        if (!newest) await Promise.race([new Promise((resolve) => { ring = resolve; }), this.#ended]);
        const frame = newest;
        newest = null;
        if (frame) yield frame;
      }
    } finally {
      this.removeEventListener('pictures', take);
      if (!this.#closed && this.#spec === spec) await this.show(before, { whole: true });
    }
  }

  close(reason = closedReason()) {
    this.#end(reason);
  }

  #newLink() {
    return new Link((event, detail, link) => this.#tell(event, detail, link), (error) => this.#end(error));
  }

  #take({ info, fields }) {
    this.info = info;
    this.fields = fields;
  }

  #call(action, argument, id = nextId++) {
    if (this.#closed) return Promise.reject(new DOMException('the stream is closed', 'InvalidStateError'));
    return this.#link.call(id, action, argument);
  }

  #end(reason) {
    if (this.#closed) return;
    this.#closed = true;
    this.#tellEnded();
    this.#reading.abort(reason);
    this.#link?.close(reason);
    this.#next?.close(reason);
    this.#crossing?.link.close(reason);
    this.#ahead?.link.close(reason);
  }

  #break(detail) {
    this.#end(new Error(detail.message));
    this.dispatchEvent(new CustomEvent('error', { detail }));
  }

  async #read(link, { id, from, to }) {
    try {
      link.send({ action: 'bytes', argument: { id, bytes: await this.#reader.read(from, to, this.#reading.signal) } });
    } catch (error) {
      link.send({ action: 'bytes', argument: { id, failure: error.message } });
    }
  }

  // Of a worker that only prepares something, nothing is heard but that its network fails; what it shows is for later.
  #tell(event, detail, link) {
    if (this.#closed) return;
    if (event === 'fetched') return this.#dispatch(event, { fetched: this.fetched += detail });
    if (event === 'read') return void this.#read(link, detail);
    if (event === 'broken') return link === this.#link ? this.#break(detail) : link.close(new Error(detail.message));
    if (event === 'series') link.series = detail;
    if (event === 'level') link.level = detail;
    if (event === 'step') link.at = detail;
    if (event === 'progress') link.received.received = detail.received;
    if (event === 'buffered') link.received.receivedSteps = detail.received;
    if (link !== this.#link && event !== 'retry') return;
    if (event === 'level') this.level = detail.level;
    if (event === 'cells') this.receivedCells += detail.bytes;
    Object.assign(this, link.received);
    if (event === 'series') this.series = this.#whole(detail);
    this.#dispatch(event,
      event === 'series'                           ? this.series
        : event === 'step' || event === 'buffered' ? this.#ofAll(detail, link)
                                                   : detail);
    if (event === 'step') this.#lookAhead(detail.step);
    if (event === 'pictures') nextFrame(() => link.send({ action: 'seen' }));
  }

  #dispatch(event, detail) {
    this.dispatchEvent(new CustomEvent(event, { detail }));
  }
}
