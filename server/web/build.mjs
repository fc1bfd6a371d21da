// SPDX-License-Identifier: BSD-3-Clause
// node build.mjs OUT WASM REFINE: bundles the page into the folder OUT: the pages' modules, the worker, and the files
// that are taken as they are, the codec's WebAssembly among them. What a page loads is named by its content, so that
// caches may keep it. Each file has a form that is compressed by Brotli beside it, for embed.py.
import { createHash } from 'node:crypto';
import { cpSync, mkdirSync, readFileSync, readdirSync, renameSync, rmSync, writeFileSync } from 'node:fs';
import { basename, dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { brotliCompressSync, constants } from 'node:zlib';
import { build } from 'esbuild';
import { noticesOf } from './notices.mjs';

const here = dirname(fileURLToPath(import.meta.url));
const [, , out, wasm, refine] = process.argv;
const made = `${out}.new`;

rmSync(made, { recursive: true, force: true });
mkdirSync(made, { recursive: true });

// tetlod-0A1B2C3D.wasm of tetlod.wasm, as esbuild names chunks
function named(name, content) {
  const [stem, extension] = name.split('.');
  const hash = createHash('sha256').update(content).digest('hex').slice(0, 8).toUpperCase();
  return `${stem}-${hash}.${extension}`;
}

// In one module, each './from' becomes its './to'.
const renamed = (module, names) => ({
  name: `rename-in-${module}`,
  setup: ({ onLoad }) => onLoad({ filter: new RegExp(`/client/${module}$`) }, ({ path }) => {
    let contents = readFileSync(path, 'utf8');
    for (const [from, to] of Object.entries(names)) {
      if (!contents.includes(`'./${from}'`)) throw new Error(`${path} does not name ${from}`);
      contents = contents.replaceAll(`'./${from}'`, `'./${to}'`);
    }
    return { contents, loader: 'js' };
  }),
});

const options = {
  absWorkingDir: here,
  bundle: true,
  minify: true,
  format: 'esm',
  target: 'es2022',
  legalComments: 'none',
  outdir: fileURLToPath(new URL(made, `file://${process.cwd()}/`)),
  logLevel: 'warning',
  external: ['./inline.js'], // the page's worker is beside it
};

const wasmName = named('tetlod.wasm', readFileSync(wasm));
cpSync(wasm, join(made, wasmName));
const refineName = named('refine.wasm', readFileSync(refine));
cpSync(refine, join(made, refineName));
const refiner = await build({ ...options, entryPoints: ['client/refine.js'], write: false });
const refinerName = named('refine.js', refiner.outputFiles[0].contents);
writeFileSync(join(made, refinerName), refiner.outputFiles[0].contents);
const vectors = await build({ ...options, entryPoints: ['client/vectors.js'], write: false });
const vectorsName = named('vectors.js', vectors.outputFiles[0].contents);
writeFileSync(join(made, vectorsName), vectors.outputFiles[0].contents);
// the worker is one file: it is asked for late, and would ask for the rest later still, but for what is seldom wanted
const worker = await build({
  ...options, entryPoints: ['client/worker.js'], write: false, metafile: true,
  external: [`./${vectorsName}`],
  plugins: [
    renamed('worker.js', { 'tetlod.wasm': wasmName, 'refine.wasm': refineName, 'refine.js': refinerName }),
    renamed('engine.js', { 'vectors.js': vectorsName }),
  ],
});
const [{ contents }] = worker.outputFiles;
const workerName = named('worker.js', contents);
writeFileSync(join(made, workerName), contents);

// Each page is bundled for itself: a file that both load would be one more request. The catalogue may open the other.
const pages = {
  ...options,
  entryNames: '[name]',
  chunkNames: 'chunk-[hash]',
  splitting: true,
  plugins: [renamed('stream.js', { 'worker.js': workerName })]
};
const catalogue = await build(
  { ...pages, entryPoints: ['page/catalogue.js'], external: ['./view.js'], metafile: true });
const { metafile } = await build({ ...pages, entryPoints: ['page/view.js', 'page/element.js'], metafile: true });
for (const name of readdirSync(join(here, 'page')))
  if (/\.(html|svg)$/.test(name) || name === 'guard.js') cpSync(join(here, 'page', name), join(made, name));
writeFileSync(join(made, 'notices.txt'), noticesOf(here, [worker.metafile, catalogue.metafile, metafile]));
const style = (...names) => names.map((name) => readFileSync(join(here, 'page', name), 'utf8')).join('');
writeFileSync(join(made, 'catalogue.css'), style('page.css', 'catalogue.css'));
writeFileSync(join(made, 'view.css'), style('page.css', 'view.css'));
writeFileSync(join(made, 'tools.css'), style('tools.css', 'player.css'));

// The viewer's page names what view.js will load, so that nothing waits for it: first what asks for the stream, then
// what draws it. The panel comes last, and unnamed.
const outputs = Object.entries(metafile.outputs);
const loads = (entryPoint) => {
  const [path, { imports }] = outputs.find(([, output]) => output.entryPoint === entryPoint);
  return [path, ...imports.filter(({ kind }) => kind === 'import-statement').map((load) => load.path)].map(
    (file) => basename(file));
};
const preloads = [...new Set([...loads('page/view.js'), workerName, wasmName, ...loads('page/scene.js')])].map(
  (name) => `<link rel="${name === wasmName ? 'preload" as="fetch" crossorigin' : 'modulepreload"'} href="./${name}">`);
const view = join(made, 'view.html');
const page = readFileSync(view, 'utf8').replace('<body', `${preloads.join('\n')}\n<body`);
writeFileSync(view, page);
// The same page for /view/{id}: what it loads lies one folder up, wherever the site begins.
mkdirSync(join(made, 'view'));
writeFileSync(join(made, 'view/index.html'), page.replaceAll('="./', '="../'));

for (const name of readdirSync(made, { recursive: true }).filter((path) => /\.\w+$/.test(path))) {
  const content = readFileSync(join(made, name));
  const params = {
    [constants.BROTLI_PARAM_QUALITY]: 11,
    [constants.BROTLI_PARAM_LGWIN]: 24,
    [constants.BROTLI_PARAM_SIZE_HINT]: content.length
  };
  writeFileSync(join(made, `${name}.br`), brotliCompressSync(content, { params }));
}
rmSync(out, { recursive: true, force: true });
renameSync(made, out);
