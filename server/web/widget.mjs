// SPDX-License-Identifier: BSD-3-Clause
// node widget.mjs INLINE OUT: the widget of notebooks as one module that loads nothing, with worker and codec in it.
import { readFileSync } from 'node:fs';
import { resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { build } from 'esbuild';

const [, , inline, out] = process.argv;
const starts = '[startWorker, startForeign, startCopy]';

// A module that came as text has no files beside it: of the ways to start a worker only the copy is left.
function onlyTheCopy({ path }) {
  const text = readFileSync(path, 'utf8');
  if (!text.includes(starts)) throw new Error(`${path} does not name ${starts}`);
  return { contents: text.replace(starts, '[startCopy]'), loader: 'js' };
}

await build({
  entryPoints: [fileURLToPath(new URL('page/widget.js', import.meta.url))],
  outfile: out,
  bundle: true,
  minify: true,
  format: 'esm',
  target: 'es2022',
  legalComments: 'none',
  logLevel: 'warning',
  banner: { js: '// With code of other packages: notices.txt of this one has their licences.' },
  plugins: [{
    name: 'one module',
    setup: ({ onLoad, onResolve }) => {
      onResolve({ filter: /\/inline\.js$/ }, () => ({ path: resolve(inline) }));
      onLoad({ filter: /\/client\/stream\.js$/ }, onlyTheCopy);
    },
  }],
});
