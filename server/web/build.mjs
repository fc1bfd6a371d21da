// SPDX-License-Identifier: BSD-3-Clause
// node build.mjs OUT WASM: bundles the page into the folder OUT: the pages' modules with what they share in chunks, the
// worker, and the files that are taken as they are, the codec's WebAssembly among them.
import { cpSync, mkdirSync, readFileSync, readdirSync, renameSync, rmSync, writeFileSync } from 'node:fs';
import { basename, dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { build } from 'esbuild';

const here = dirname(fileURLToPath(import.meta.url));
const pages = ['page/catalogue.js', 'page/view.js'];
const [, , out, wasm] = process.argv;
const made = `${out}.new`;

rmSync(made, { recursive: true, force: true });
mkdirSync(made, { recursive: true });
const options = {
  absWorkingDir: here,
  entryNames: '[name]',
  chunkNames: 'chunk-[hash]',
  bundle: true,
  minify: true,
  format: 'esm',
  target: 'es2022',
  legalComments: 'none',
  outdir: fileURLToPath(new URL(made, `file://${process.cwd()}/`)),
  logLevel: 'warning',
  external: ['./inline.js'], // the page's worker is beside it
};
const { metafile } = await build({ ...options, entryPoints: pages, splitting: true, metafile: true });
// the worker is one file: it is asked for late, and would ask for the rest later still
await build({ ...options, entryPoints: ['client/worker.js'] });
for (const name of readdirSync(join(here, 'page')))
  if (/\.(html|css|svg)$/.test(name) || name === 'guard.js') cpSync(join(here, 'page', name), join(made, name));

// The viewer's page names what view.js will load, so that nothing waits for it.
const outputs = Object.entries(metafile.outputs);
const [scene, { imports }] = outputs.find(([, output]) => output.entryPoint === 'page/scene.js');
const preloads = [scene, ...imports.filter(({ kind }) => kind === 'import-statement').map(({ path }) => path)]
  .map((path) => `<link rel="modulepreload" href="./${basename(path)}">`);
const view = join(made, 'view.html');
const page = readFileSync(view, 'utf8').replace('</title>\n', `</title>\n${preloads.join('\n')}\n`);
writeFileSync(view, page);
// The same page for /view/{id}: what it loads lies one folder up, wherever the site begins.
mkdirSync(join(made, 'view'));
writeFileSync(join(made, 'view/index.html'), page.replaceAll('="./', '="../'));
cpSync(wasm, join(made, 'tetlod.wasm'));
rmSync(out, { recursive: true, force: true });
renameSync(made, out);
