// SPDX-License-Identifier: BSD-3-Clause
// The package in a browser: its worker, its module under a strict policy, its example.
import assert from 'node:assert/strict';
import { cpSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join, resolve } from 'node:path';
import { launch, openPage } from './browser.mjs';
import { ROOT, SCRATCH, folderHost, program, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

const { path } = sampleStream();
const folder = join(SCRATCH, 'package');
cpSync(join(ROOT, 'build/client'), folder, { recursive: true });
const { build } = createRequire(resolve(ROOT, 'server/web/package.json'))('esbuild');
const browser = await launch();

async function bundlesAndShowsTheExample() {
  await build({
    entryPoints: [join(folder, 'example.js')], bundle: true, format: 'esm', outfile: join(folder, 'example.bundle.js'),
    nodePaths: [resolve(ROOT, 'server/web/node_modules')], logLevel: 'error',
  });
  const host = await folderHost(folder);
  const server = await program([path]);
  const page = await openPage(browser, host.origin);
  await page.goto(`${host.origin}/example.html?url=${server.url}v1/meshes/fin`);
  await page.waitForFunction(() => /level \d+:/.test(document.querySelector('output').value), null);
  const first = await page.evaluate(() => document.querySelector('output').value);
  await page.waitForFunction((text) => document.querySelector('output').value !== text, first);
  const shot = await page.screenshot();
  writeFileSync(join(SCRATCH, 'example.png'), shot);
  assert.ok(shot.length > 10000, `an empty picture of ${shot.length} bytes`);
  assert.deepEqual(page.complaints, []);
  await page.context().close();
  await server.stop();
  host.close();
}

async function worksUnderAStrictPolicy() {
  const server = await program([path]);
  const host = await folderHost(folder);
  host.headers = { 'Content-Security-Policy': `default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'; connect-src 'self' ${new URL(server.url).origin}` };
  writeFileSync(join(folder, 'strict.html'), '<!doctype html><script type="module" src="./strict.js"></script>');
  writeFileSync(join(folder, 'strict.js'), `import { TetlodStream } from './stream.js';
    const stream = await TetlodStream.open('${server.url}v1/meshes/fin');
    const done = await stream.refineTo({ error: 0.01 });
    const { tets, positions } = await stream.mesh();
    window.result = { ...done, tets: tets.length / 4, vertices: positions.length / 3, expected: stream.info.levels[done.level] };`);
  const page = await openPage(browser, host.origin);
  await page.goto(`${host.origin}/strict.html`);
  const result = await (await page.waitForFunction(() => window.result, null)).jsonValue();
  assert.ok(result.reached);
  assert.equal(result.tets, result.expected.tets);
  assert.equal(result.vertices, result.expected.vertices);
  assert.deepEqual(page.complaints, []);
  await page.context().close();
  host.close();
  await server.stop();
}

await run([bundlesAndShowsTheExample, worksUnderAStrictPolicy]);
