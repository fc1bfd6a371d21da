// SPDX-License-Identifier: BSD-3-Clause
// What the viewer draws of a known stream against pictures that were looked at. After a change that is meant to be
// seen: UPDATE=1 make check ONLY=test_pictures, then look at tests/web/pictures.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdirSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { launch } from './browser.mjs';
import { program, ROOT, SCRATCH, TETLOD } from './hosts.mjs';
import { run } from './tap.mjs';
import { capture, difference, openViewer, showView } from './pictures.mjs';

const folder = join(ROOT, 'tests/web/pictures');
// all of the finest level, which is the mesh itself however it is contracted
const states = {
  boundary: 'error=0',
  wireframe: 'error=0&edges=1&map=cividis',
  velocity: 'error=0&field=Velocity&component=0',
  slice: 'error=0&surface=off&slices=y@0.3;z@0.2',
  isosurfaces: 'error=0&surface=inside&isosurfaces=0.3,0.6',
  clip: 'error=0&clip=x@0.4&edges=1',
  clipped_parts: 'error=0&surface=off&slices=z@0.2&isosurfaces=0.3,0.6&clip=0,1,1@0.3',
  clipped_volume: 'error=0&surface=off&volume=1&volumeSize=48&log=1&clip=1,0,-1@0.55&opacity=0:0,0.3:0.01,1:0.4',
  volume: 'error=0&surface=off&volume=1&volumeSize=48&opacity=0:0,0.3:0.01,1:0.4',
};
const stream = join(SCRATCH, 'fin.tetlod');
execFileSync(TETLOD, ['build', join(ROOT, 'samples/fin.vtu'), '--field', 'Pressure', '-o', stream, '--quiet']);
const server = await program([stream]);
const browser = await launch();
const page = await openViewer(browser, server.url);
const update = Boolean(process.env.UPDATE);
if (update) mkdirSync(folder, { recursive: true });

const looksAsBefore = ([name, state]) => {
  const test = async () => {
    await showView(page, server.url, 'fin', state);
    const picture = await capture(page, 300);
    const path = join(folder, `${name}.png`);
    writeFileSync(update ? path : join(SCRATCH, `${name}.png`), picture);
    const { plain, mean } = await difference(page, path, picture);
    console.log(`# ${name}: ${(100 * plain).toFixed(2)} % of the pixels differ, by ${mean.toFixed(2)} in the mean`);
    assert.ok(plain <= 0.01 && mean <= 1.5,
      `${name} does not look as tests/web/pictures/${name}.png; what was drawn is in ${SCRATCH}`);
    assert.deepEqual([page.complaints, page.strangers], [[], []]);
  };
  return Object.defineProperty(test, 'name', { value: `${name}_looks_as_before` });
};

// The tolerance is worth something: no two of the pictures would pass for each other.
async function pictures_differ() {
  await showView(page, server.url, 'fin', states.boundary);
  const picture = await capture(page, 300);
  for (const name of Object.keys(states).slice(1)) {
    const { plain } = await difference(page, join(folder, `${name}.png`), picture);
    assert.ok(plain > 0.03, `${name} differs from the boundary in ${plain} of the pixels`);
  }
}

// A coarse level is another mesh, but nearly the same picture.
async function a_coarse_level_looks_alike() {
  await showView(page, server.url, 'fin', 'error=0.02');
  const { level, levels } =
    await page.evaluate(() => ({ level: window.tetlod.level, levels: window.tetlod.stream.info.levels.length }));
  assert.ok(level < levels - 1);
  const { plain, mean } = await difference(page, join(folder, 'boundary.png'), await capture(page, 300));
  console.log(`# level ${level} of ${levels - 1}: ${(100 * plain).toFixed(2)} % of the pixels differ, by ${
    mean.toFixed(2)} in the mean`);
  assert.ok(plain <= 0.05 && mean > 0, `${plain}`);
}

await run([...Object.entries(states).map(looksAsBefore), pictures_differ, a_coarse_level_looks_alike]);
await browser.close();
await server.stop();
