// SPDX-License-Identifier: BSD-3-Clause
// The catalogue of many streams, and how streams of each kind are shown before anybody chose anything.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { linkSync, mkdirSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { launch, openPage, settled } from './browser.mjs';
import { SCRATCH, TETLOD, beam, program, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

const folder = join(SCRATCH, 'streams');
const many = 1000;
mkdirSync(folder);
const make = (...words) => execFileSync(TETLOD, words, { cwd: SCRATCH, stdio: 'ignore' });
make('sample', 'wake', '--size', '8', '--steps', '3', '-o', 'wake.pvd');
make('build', 'wake.pvd', '--field', 'Pressure', '--quiet', '-o', 'streams/wake.tetlod');
linkSync(sampleStream().path, join(folder, 'fin.tetlod'));
const few = await program([folder]);
for (const [name, text] of Object.entries(beam())) {
  writeFileSync(join(SCRATCH, name), text);
  make('build', name, '--quiet', '-o', `${name.replace('.', '_')}.tetlod`);
}
make('extract', 'beam_vtk.tetlod', '-o', 'again.vtu');
make('build', 'again.vtu', '--quiet', '-o', 'beam_vtu.tetlod');
const solids = await program(['vtk', 'msh', 'vtu'].map((kind) => join(SCRATCH, `beam_${kind}.tetlod`)));
const browser = await launch();

// What a card says that a link loads is what comes: of the field that is shown first, not of all.
async function a_link_loads_what_its_card_says() {
  const page = await openPage(browser, few.url);
  await page.goto(few.url);
  const card = page.locator('section', { hasText: 'fin' }).locator('.accuracy').nth(1);
  const { bytes: all } = (await (await fetch(`${few.url}v1/meshes/fin`)).json()).levels.at(-1);
  const query = new URL(`${few.url}v1/meshes/fin/prefix?error=0.01&fields=Pressure`);
  const own = Number((await fetch(query)).headers.get('Content-Length'));
  assert.ok(own < all);
  await card.getByText(`${(own / 1000).toPrecision(3)}\u202fkB`).waitFor();
  assert.equal(await page.locator('section', { hasText: 'wake' }).locator('.mark').innerText(), 'series');
  assert.equal(await page.locator('section', { hasText: 'fin' }).locator('.mark').count(), 0);
  assert.deepEqual([page.complaints, page.strangers], [[], []]);
  await page.context().close();
}

// One answer, whatever is found in it; nothing is asked about streams that nobody looks at.
async function a_thousand_streams_are_one_answer() {
  for (let i = 0; i < many; i++)
    linkSync(join(folder, i % 2 ? 'fin.tetlod' : 'wake.tetlod'), join(folder, `run-${i}.tetlod`));
  const server = await program([folder]);
  const page = await openPage(browser, server.url);
  const asked = [];
  page.on('request', (request) => /\/v1\//.test(request.url()) && asked.push(request.url()));
  await page.goto(server.url);
  await page.waitForFunction((count) => document.querySelectorAll('tbody tr').length === count, many + 2);
  const took = await page.evaluate(() => performance.now());
  console.log(`# ${many + 2} streams after ${Math.round(took)} ms`);
  assert.deepEqual(
    asked.map((url) => new URL(url).search),
    ['?limit=1000', '?limit=1000&after=run-998'],
  );
  const names = () => page.locator('tbody tr td:first-child a').allInnerTexts();
  assert.deepEqual((await names()).slice(0, 4), ['fin', 'run-0', 'run-1', 'run-2']);
  await page.locator('#find').fill('run-99 velo');
  await page.getByText(`11 of 1\u202f002 streams`).waitFor();
  assert.deepEqual((await names())[1], 'run-990');
  await page.locator('#order').selectOption('series');
  await page.waitForFunction(() => document.querySelector('tbody tr:first-child .mark'));
  await page.reload();
  await page.getByText(`11 of 1\u202f002 streams`).waitFor();
  await page.locator('#find').fill('nothing of the kind');
  await page.getByText(`0 of 1\u202f002 streams`).waitFor();
  await page.locator('#find').fill('run-99');
  await page.locator('#as').selectOption('cards');
  await page.locator('.accuracies').first().waitFor();
  await page.context().close();
  await server.stop();
}

// Solids are closed and lit, in the colours of their displacement; ids and constants are not shown first.
async function solids_open_lit() {
  for (const kind of ['vtk', 'msh', 'vtu']) {
    const page = await openPage(browser, solids.url);
    await page.goto(`${solids.url}view/beam_${kind}`);
    await settled(page);
    const { surface, shading, slices, field } = await page.evaluate(() => window.tetlod.state);
    assert.deepEqual(
      { surface, shading, slices, field },
      { surface: 'solid', shading: 'all', slices: [], field: 'Displacement' },
      kind,
    );
    assert.deepEqual(page.complaints, []);
    await page.context().close();
  }
}

async function flows_open_as_slices() {
  const page = await openPage(browser, few.url);
  await page.goto(`${few.url}view/fin`);
  await settled(page);
  const { surface, slices } = await page.evaluate(() => window.tetlod.state);
  assert.deepEqual([surface, slices.length], ['inside', 1]);
  await page.context().close();
}

await run([a_link_loads_what_its_card_says, a_thousand_streams_are_one_answer, solids_open_lit, flows_open_as_slices]);
