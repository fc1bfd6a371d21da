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
  if (typeof Worker !== 'undefined') return new Worker(new URL('./worker.js', import.meta.url), { type: 'module', name: 'tetlod' });
  const threads = 'node:worker_threads'; // not a literal: bundlers for browsers need not know it
  return new (await import(threads)).Worker(new URL('./worker.js', import.meta.url));
}

// Where the worker's file is not beside this one (a bundler that does not know it, a server for development), or is of another
// origin, the copy in a module of ours is run.
async function startCopy(cause) {
  const { source, wasm } = await import('./inline.js').catch(() => { throw cause; });
  const url = URL.createObjectURL(new Blob([source], { type: 'text/javascript' }));
  return { worker: new Worker(url, { type: 'module', name: 'tetlod' }), module: await WebAssembly.compile(wasm()) };
}

class NotStarted extends Error {}

const isReader = (source) => typeof source?.read === 'function';

// What the worker is told of a source.
function described(source) {
  if (typeof Blob !== 'undefined' && source instanceof Blob) return { blob: source };
  if (isReader(source)) return { page: true };
  const { url, headers, credentials } = typeof source === 'string' || source instanceof URL ? { url: source } : source;
  return { url: new URL(url, globalThis.document?.baseURI ?? globalThis.location?.href).href, headers: headers && Object.fromEntries(new Headers(headers)), credentials };
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
const nextFrame = (call) =>
  (typeof requestAnimationFrame === 'function' && !document.hidden ? requestAnimationFrame(call) : setTimeout(call, 16));

export class TetlodStream extends EventTarget {
  #worker; #calls = new Map(); #count = 0; #closed = false; #reader = null; #reading = new AbortController();
  info = null;
  level = 0;
  received = 0;

  /**
   * Opens a stream and decodes its base mesh. `source`: the URL of a server's mesh (…/v1/meshes/{id}) or of a file, or
   * {url, headers, credentials} as of fetch; a Blob or File; or {read(from, to, signal)}, which resolves to a Uint8Array.
   * Options: `target`, as of refineTo, which it goes on to: its bytes come with the first ones; `fields`, the names of
   * those to decode (all); `signal`; `retries` of a request that fails (8); `on`, listeners by the name of their event, which also hear what happens while it opens; `wasm`, URL of the module.
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
      const options = { source: told, target, fields, retries, wasm: wasm && new URL(wasm, globalThis.document?.baseURI ?? globalThis.location?.href).href };
      stream.info = await stream.#begin(options);
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
    signal?.throwIfAborted();
    const id = this.#count;
    const stop = () => this.#send({ action: 'abort', argument: id });
    signal?.addEventListener('abort', stop, { once: true });
    try {
      return await this.#call('refineTo', target);
    } finally {
      signal?.removeEventListener('abort', stop);
    }
  }

  /** Copies of the current level's arrays: {level, positions, tets, fields, parents}. */
  mesh() {
    return this.#call('mesh');
  }

  /** {values: {field: [components]}, tet} at a point of the mesh that is shown, or null outside of it. */
  probe(point) {
    return this.#call('probe', point);
  }

  /** Which pictures to make of this and every following level; null: none. */
  show(spec) {
    return this.#call('show', spec);
  }

  close(reason = new DOMException('the stream was closed', 'AbortError')) {
    this.#end(reason);
  }

  async #begin(options) {
    try {
      this.#use(await startWorker());
      return await this.#call('open', options);
    } catch (cause) {
      const foreign = cause instanceof DOMException && cause.name === 'SecurityError'; // the script is of another origin
      if (this.#closed || !(foreign || cause instanceof NotStarted)) throw cause;
      const { worker, module } = await startCopy(cause);
      this.#use(worker);
      return this.#call('open', { ...options, wasm: options.wasm ?? module });
    }
  }

  #use(worker) {
    this.#worker = listen(worker, (message) => this.#hear(message), (error) => {
      if (this.info) return this.#end(error);
      for (const { reject } of this.#calls.values()) reject(error); // it never ran
      this.#calls.clear();
    });
  }

  #send(message) {
    if (!this.#closed) this.#worker?.postMessage(message);
  }

  #call(action, argument) {
    const id = this.#count++;
    return new Promise((resolve, reject) => {
      if (this.#closed) throw new DOMException('the stream is closed', 'InvalidStateError');
      this.#calls.set(id, { resolve, reject });
      this.#send({ action, id, argument });
    });
  }

  #end(reason) {
    if (this.#closed) return;
    this.#closed = true;
    this.#worker?.terminate();
    this.#reading.abort(reason);
    for (const { reject } of this.#calls.values()) reject(reason);
    this.#calls.clear();
  }

  #hear({ id, value, failure, event, detail }) {
    if (this.#closed) return;
    if (event) this.#tell(event, detail);
    const call = this.#calls.get(id);
    if (!call) return;
    this.#calls.delete(id);
    if (failure) call.reject(errorOf(failure));
    else call.resolve(value);
  }

  async #read({ id, from, to }) {
    try {
      this.#send({ action: 'bytes', argument: { id, bytes: await this.#reader.read(from, to, this.#reading.signal) } });
    } catch (error) {
      this.#send({ action: 'bytes', argument: { id, failure: error.message } });
    }
  }

  #tell(event, detail) {
    if (event === 'read') return void this.#read(detail);
    if (event === 'level') this.level = detail.level;
    if (event === 'progress') this.received = detail.received;
    this.dispatchEvent(new CustomEvent(event, { detail }));
    if (event === 'pictures') nextFrame(() => this.#send({ action: 'seen' }));
  }
}
