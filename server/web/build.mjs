// SPDX-License-Identifier: BSD-3-Clause
// node build.mjs OUT WASM: bundles the page into the folder OUT: the entries below with what they share in chunks, and the
// files that are taken as they are, the codec's WebAssembly among them.
import { cpSync, mkdirSync, readdirSync, renameSync, rmSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { build } from 'esbuild';

const here = dirname(fileURLToPath(import.meta.url));
const entries = ['page/catalogue.js', 'page/view.js', 'client/worker.js'];
const [, , out, wasm] = process.argv;
const made = `${out}.new`;

rmSync(made, { recursive: true, force: true });
mkdirSync(made, { recursive: true });
await build({
  absWorkingDir: here,
  entryPoints: entries,
  entryNames: '[name]',
  chunkNames: 'chunk-[hash]',
  bundle: true,
  splitting: true,
  minify: true,
  format: 'esm',
  target: 'es2022',
  legalComments: 'none',
  outdir: fileURLToPath(new URL(made, `file://${process.cwd()}/`)),
  logLevel: 'warning',
});
for (const name of readdirSync(join(here, 'page')))
  if (/\.(html|css|svg)$/.test(name)) cpSync(join(here, 'page', name), join(made, name));
cpSync(wasm, join(made, 'tetlod.wasm'));
rmSync(out, { recursive: true, force: true });
renameSync(made, out);
