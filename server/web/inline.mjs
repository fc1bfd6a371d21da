// SPDX-License-Identifier: BSD-3-Clause
// node inline.mjs WORKER WASM OUT: the worker and its module as a module of their own, for pages that find no other
// files.
import { readFileSync, writeFileSync } from 'node:fs';

const [, , worker, wasm, out] = process.argv;
writeFileSync(
  out, `// The worker and the codec of this package as text: stream.js takes them where their files cannot be had.
export const source = ${JSON.stringify(readFileSync(worker, 'utf8'))};
export const wasm = () => Uint8Array.from(atob('${readFileSync(wasm, 'base64')}'), (c) => c.charCodeAt(0));
`);
