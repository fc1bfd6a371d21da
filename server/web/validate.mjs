// SPDX-License-Identifier: BSD-3-Clause
// node validate.mjs WASM OUT: the page that validates streams as one file, which needs no other.
import { build } from 'esbuild';
import { readFileSync, writeFileSync } from 'node:fs';

const [, , wasm, out] = process.argv;
const kit = new URL('../../format/conformance/', import.meta.url).pathname;
const { outputFiles: [{ text }] } = await build({
  entryPoints: [`${kit}validate_page.mjs`], bundle: true, write: false, format: 'esm', target: 'es2022', minify: true,
  alias: { 'tetlod.wasm': wasm }, loader: { '.wasm': 'binary' }, legalComments: 'none',
});
const code = text.replaceAll('</script', '<\\/script');
writeFileSync(out, readFileSync(`${kit}validate.html`, 'utf8').replace('/* code */', () => code));
