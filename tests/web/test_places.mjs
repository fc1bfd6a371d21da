// SPDX-License-Identifier: BSD-3-Clause
// A box that clips, notes at probes, values over time at one of them, colours of categories, where streamlines begin.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { firstPicture, launch, openPage, settled } from './browser.mjs';
import { cellStream, program, ROOT, sampleStream, SCRATCH, TETLOD } from './hosts.mjs';
import { run } from './tap.mjs';

const { TetlodStream } = await import(pathToFileURL(join(ROOT, 'build/client/stream.js')));
const { path, bytes } = sampleStream();
const wake = join(SCRATCH, 'wake.tetlod');
mkdirSync(join(SCRATCH, 'steps'));
execFileSync(TETLOD, ['sample', 'wake', '--steps', '6', '--size', '8', '-o', join(SCRATCH, 'steps/wake.pvd')], {
  stdio: 'ignore',
});
execFileSync(TETLOD, ['build', join(SCRATCH, 'steps/wake.pvd'), '-o', wake, '--quiet'], { stdio: 'ignore' });
const server = await program([path, wake, cellStream().path]);
const browser = await launch();
const page = await openPage(browser, server.url, { viewport: { width: 1000, height: 700 } });
const open = async (name, hash, id = 'box') => {
  await page.goto('about:blank');
  await page.goto(`${server.url}view/${name}#smooth=0&${hash}`);
  await firstPicture(page);
  await settled(page);
  await page.waitForFunction((wanted) => document.getElementById(wanted), id);
};

// Cells are drawn whole if their middle is in the box, and only those, at every level and by every layer.
async function a_box_clips_cells() {
  const stream = await TetlodStream.open(new Blob([bytes]), { target: { error: 0.05 } });
  await stream.refineTo({ error: 0.05 });
  const box = [-3, 1, 0, 2, 4, 2];
  const pictures = () =>
    new Promise((resolve) => {
      stream.addEventListener('pictures', ({ detail }) => detail.tag === 'boxed' && resolve(detail));
    });
  const drawn = pictures();
  const slices = [{ origin: [0, 2, 1], normal: [0, 0, 1] }];
  await stream.show({ field: 'Pressure', surface: true, box, slices, tag: 'boxed' });
  const {
    surface,
    slices: [slice],
  } = await drawn;
  const { positions, tets } = await stream.mesh();
  const middle = (t) =>
    [0, 1, 2].map((k) => [0, 1, 2, 3].reduce((sum, i) => sum + positions[3 * tets[t + i] + k] / 4, 0));
  const isIn = (p) => p.every((c, i) => c >= box[i] && c <= box[3 + i]);
  // faces that only one of the kept tetrahedra has
  const faces = new Set();
  for (let t = 0; t < tets.length; t += 4) {
    const place = middle(t);
    const found = await (t % 40 ? null : stream.probe(place));
    if (t % 40 === 0) assert.equal(Boolean(found), isIn(place), `${place}`);
    if (!isIn(place)) continue;
    for (let i = 0; i < 4; i++) {
      const face = [0, 1, 2, 3]
        .filter((c) => c !== i)
        .map((c) => tets[t + c])
        .sort((a, b) => a - b)
        .join();
      if (!faces.delete(face)) faces.add(face);
    }
  }
  assert.ok(faces.size > 50);
  assert.equal(surface.triangles.length / 3, faces.size);
  assert.ok(slice.triangles.length > 30);
  await assert.rejects(stream.show({ box: [1, 0, 0, 0, 1, 1] }), /a box is six numbers/);
  stream.close();
}

async function a_box_is_moved_by_the_keyboard() {
  await open('fin', 'error=0.05&slices=');
  const triangles = () => page.evaluate(() => window.tetlod.scene.surface.part.triangles.length);
  const all = await triangles();
  await page.locator('#box').focus();
  await page.keyboard.press('Space');
  await page.waitForFunction(() => window.tetlod.state.box && window.tetlod.settled);
  const half = await triangles();
  await page.getByLabel('Clip box: greatest x').focus();
  for (let i = 0; i < 3; i++) await page.keyboard.press('PageDown');
  await page.waitForFunction(() => window.tetlod.state.box[3] < 0.3 && window.tetlod.settled);
  const less = await triangles();
  assert.ok(less < half && half < 2 * all, `${all}, ${half}, ${less}`);
  await page.waitForFunction(() => /box=0,0,0,0\.2/.test(location.hash));
}

async function notes_stay_with_their_probes() {
  await open('fin', 'error=0.05&pins=0.5,0.2,0.1;0.8,0.5,0.3', 'pins');
  await page.getByLabel('Note at probe 2').fill('behind; the & shock');
  await page.keyboard.press('Enter');
  await page.waitForFunction(() =>
    /^behind; the & shock: [\d.]+$/.test(document.querySelectorAll('.pin span')[1]?.textContent),
  );
  await page.waitForFunction(() => /notes=/.test(location.hash));
  await page.getByLabel('Remove probe 1').click();
  await page.waitForFunction(() => /^behind/.test(document.querySelector('.pin span')?.textContent));
  const hash = await page.evaluate(() => window.tetlod.viewer.fragment.slice(1));
  await open('fin', hash, 'pins');
  assert.equal(await page.getByLabel('Note at probe 1').inputValue(), 'behind; the & shock');
}

// Against the values of each step's own mesh; the picture stays at its step.
async function values_over_time_at_a_probe() {
  await open('wake', 'error=0.02&step=2&pins=0.6,0.5,0.3', 'pins');
  await page.getByLabel('Values at probe 1 over time').click();
  await page.waitForFunction(() => /at most$/.test(document.getElementById('time-words')?.textContent));
  const [file] = await Promise.all([page.waitForEvent('download'), page.locator('#time-csv').click()]);
  const [head, ...rows] = readFileSync(await file.path(), 'utf8')
    .trim()
    .split('\n')
    .map((line) => line.split(','));
  assert.deepEqual(head, ['step', 'time', 'Pressure', 'at least', 'at most']);
  assert.equal(rows.length, 6);
  const { low, high, band } = await page.evaluate(() => ({
    ...{ low: window.tetlod.stream.info.bounds[0], high: window.tetlod.stream.info.bounds[1] },
    band: window.tetlod.viewer.wantedBand,
  }));
  const place = [0.6, 0.5, 0.3].map((x, i) => low[i] + x * (high[i] - low[i]));
  const stream = await TetlodStream.open(`${server.url}v1/meshes/wake`);
  if (!stream.series)
    await new Promise((resolve) => {
      stream.addEventListener('series', resolve);
    });
  const exact = stream.series.bands.length - 1;
  for (const [step, time, value, least, most] of rows.map((row) => row.map(Number))) {
    await stream.seekStep(step, { band });
    const { values } = await stream.probe(place);
    assert.ok(Math.abs(values.Pressure[0] - value) < 1e-9, `step ${step}: ${value}, not ${values.Pressure}`);
    assert.equal(time, stream.series.times[step]);
    await stream.seekStep(step, { band: exact });
    const [truth] = (await stream.probe(place)).values.Pressure;
    assert.ok(truth >= least - 1e-9 && truth <= most + 1e-9, `step ${step}: ${truth} is not in ${least} to ${most}`);
  }
  stream.close();
  assert.equal(await page.evaluate(() => window.tetlod.at.step), 2);
  const drawing = await page.locator('#time-plot svg').boundingBox();
  await page.mouse.click(drawing.x + drawing.width - 12, drawing.y + 40);
  await page.waitForFunction(() => window.tetlod.at?.step === 5);
  await page.locator('#time-close').click();
  assert.equal(await page.locator('#time-plot').count(), 0);
}

async function regions_have_colours_of_their_own() {
  await open('cells', 'cells=material&error=0&surface=solid&slices=', 'pins');
  await page.waitForFunction(() => /^[0-9a-f]{6}-/.test(window.tetlod.viewer.colorMap));
  const colors = await page.evaluate(() => [10, 20, 30].map((n) => window.tetlod.scene.colorOf(n).join()));
  assert.equal(new Set(colors).size, 3, `${colors}`);
}

async function streamlines_begin_on_the_slice() {
  await open('fin', 'error=0.05&vectors=streamlines&slices=x@0.3&vectorCount=30', 'seeds');
  const points = () => page.evaluate(() => window.tetlod.scene.vectors[0].part.points.length);
  const before = await points();
  await page.locator('#seeds').selectOption('slice');
  await page.waitForFunction(
    (n) => window.tetlod.settled && window.tetlod.scene.vectors[0].part.points.length !== n,
    before,
  );
  await page.locator('#vector-size').focus();
  await page.keyboard.press('ArrowRight');
  await page.waitForFunction(() => /seeds=slice/.test(location.hash) && /vectorSize=1\.0/.test(location.hash));
  assert.deepEqual([page.complaints, page.strangers], [[], []]);
}

await run([
  a_box_clips_cells,
  a_box_is_moved_by_the_keyboard,
  notes_stay_with_their_probes,
  values_over_time_at_a_probe,
  regions_have_colours_of_their_own,
  streamlines_begin_on_the_slice,
]);
