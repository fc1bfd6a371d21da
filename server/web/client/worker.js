// SPDX-License-Identifier: BSD-3-Clause
// The worker's side of TetlodStream: messages in, replies and events out. Also runs as a worker thread of node.
import { Engine } from './engine.js';
import { compile } from './tetlod.js';

let port; // the page's, or of node's main thread

function buffersOf(value, found = new Set()) {
  if (ArrayBuffer.isView(value)) found.add(value.buffer);
  else if (value && typeof value === 'object') Object.values(value).forEach((member) => buffersOf(member, found));
  return found;
}

const post = (message) => port.postMessage(message, [...buffersOf(message)]);
const engine = new Engine((event, detail) => post({ event, detail }));

async function moduleOf(wasm) {
  if (typeof wasm !== 'string') return wasm;
  if (!wasm.startsWith('file:')) return compile(await fetch(wasm));
  const files = 'node:fs/promises';
  return compile(await (await import(files)).readFile(new URL(wasm)));
}

// Bytes that the page reads: asked for by an event, answered by the action `bytes`.
const reads = new Map();
const readByPage = (from, to) => new Promise((resolve, reject) => {
  const id = reads.size ? Math.max(...reads.keys()) + 1 : 0;
  reads.set(id, { resolve, reject });
  post({ event: 'read', detail: { id, from, to } });
});

function takeBytes({ id, bytes, failure }) {
  const { resolve, reject } = reads.get(id);
  reads.delete(id);
  if (failure) reject(new Error(failure));
  else resolve(bytes);
}

// What makes a mesh finer in boxes lies beside the worker: a copy of the worker in a page has none. Bundlers take both
// files as they are: a worker of theirs is one file.
async function refining() {
  const code = new URL('./refine.js', import.meta.url).href;
  const module = await moduleOf(new URL('./refine.wasm', import.meta.url).href);
  return { ...await import(/* webpackIgnore: true */ /* @vite-ignore */ code), module };
}

const actions = {
  open: ({ wasm = new URL('./tetlod.wasm', import.meta.url).href, source, ...options }) =>
    engine.open({ ...options, refining, source: source.page ? { read: readByPage } : source, module: moduleOf(wasm) }),
  bytes: takeBytes,
  refineTo: (target, id) => engine.refineTo(target, id),
  seekStep: (wanted, id) => engine.seekStep(wanted, id),
  abort: (id) => engine.abort(id),
  mesh: () => engine.mesh(),
  drawn: () => engine.drawn(),
  cells: (name) => engine.cells(name),
  loadCells: (name) => engine.loadCells(name),
  probe: (point) => engine.probe(point),
  line: (segment) => engine.line(segment),
  prove: (what) => engine.prove(what),
  show: (spec) => engine.show(spec),
  forget: () => engine.forget(),
  draft: (tets) => engine.draft(tets),
  look: (look) => engine.look(look),
  seen: () => engine.seen(),
  close: () => engine.close(),
};

async function hear({ action, id, argument }) {
  try {
    if (action === 'open') post({ event: 'started', detail: null });
    const value = await actions[action](argument, id);
    if (id !== undefined) post({ id, value });
  } catch (error) {
    post({ id, failure: { name: error.name, message: error.message, status: error.status } });
  }
}

function serve(page) {
  port = page;
  if (port.on) port.on('message', hear);
  else port.onmessage = ({ data }) => hear(data);
}

// no await here: bundlers make a script of this that is no module. The name is not a literal: they need not know it.
const threads = 'node:worker_threads';
if (typeof self === 'undefined') import(threads).then(({ parentPort }) => serve(parentPort));
else serve(self);
