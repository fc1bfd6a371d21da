// SPDX-License-Identifier: BSD-3-Clause
// The worker's side of TetlodStream: messages in, replies and events out. Also runs as a worker thread of node.
import { Engine } from './engine.js';
import { compile } from './tetlod.js';

// the name is not a literal: bundlers for browsers need not know it
const threads = 'node:worker_threads';
const port = typeof self === 'undefined' ? (await import(threads)).parentPort : self;

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

const actions = {
  open: ({ wasm = new URL('./tetlod.wasm', import.meta.url).href, ...options }) => engine.open({ ...options, module: moduleOf(wasm) }),
  refineTo: (target, id) => engine.refineTo(target, id),
  abort: (id) => engine.abort(id),
  mesh: () => engine.mesh(),
  probe: (point) => engine.probe(point),
  show: (spec) => engine.show(spec),
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

if (port.on) port.on('message', hear);
else port.onmessage = ({ data }) => hear(data);
