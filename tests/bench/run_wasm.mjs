// SPDX-License-Identifier: BSD-3-Clause
// Runs a WebAssembly program that computes and prints: node run_wasm.mjs PROGRAM.wasm [ARGUMENT...]
import { readFileSync, writeSync } from 'node:fs';

const bytes = process.argv.slice(2).map((text) => Buffer.from(text + '\0'));
let memory;
const view = () => new DataView(memory.buffer);

// The calls of WASI preview 1 that libc makes for such a program; 52 is "not there".
const calls = {
  args_sizes_get(count, size) {
    view().setUint32(count, bytes.length, true);
    view().setUint32(size, Buffer.concat(bytes).length, true);
    return 0;
  },
  args_get(list, text) {
    new Uint8Array(memory.buffer).set(Buffer.concat(bytes), text);
    bytes.forEach((argument, i) => {
      view().setUint32(list + 4 * i, text, true);
      text += argument.length;
    });
    return 0;
  },
  clock_time_get(_clock, _precision, out) {
    view().setBigUint64(out, BigInt(Math.round(performance.now() * 1e6)), true);
    return 0;
  },
  fd_write(file, parts, count, out) {
    let written = 0;
    for (let i = 0; i < count; i++) {
      const [address, length] = new Uint32Array(memory.buffer, parts + 8 * i, 2);
      written += writeSync(file, new Uint8Array(memory.buffer, address, length));
    }
    view().setUint32(out, written, true);
    return 0;
  },
  fd_fdstat_get: () => 52, fd_close: () => 52, fd_seek: () => 52,
  proc_exit(code) { process.exit(code); },
};

const { instance } = await WebAssembly.instantiate(readFileSync(process.argv[2]), { wasi_snapshot_preview1: calls });
memory = instance.exports.memory;
instance.exports._start();
