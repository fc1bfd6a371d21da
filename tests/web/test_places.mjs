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
const page = await openPage(browser, server.url, { viewport: { width: 800, height: 560 } });
const open = async (name, hash, id = 'box') => {
  await page.goto('about:blank');
  await page.goto(`${server.url}view/${name}#smooth=0&${hash}`);
  await firstPicture(page);
  await settled(page);
  await page.waitForFunction((wanted) => document.getElementById(wanted), id);
};

const volumeOf = ({ positions, tets }) => {
  let sum = 0;
  for (let t = 0; t < tets.length; t += 4) {
    const [a, b, c, d] = [0, 1, 2, 3].map((i) => positions.subarray(3 * tets[t + i], 3 * tets[t + i] + 3));
    const [u, v, w] = [b, c, d].map((p) => p.map((x, i) => x - a[i]));
    sum += Math.abs(
      u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0]) + u[2] * (v[0] * w[1] - v[1] * w[0]),
    );
  }
  return sum / 6;
};

// What a surface encloses, if it is closed and seen from outside.
const enclosedBy = ({ points, triangles }) => {
  let sum = 0;
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [0, 1, 2].map((i) => points.subarray(3 * triangles[t + i], 3 * triangles[t + i] + 3));
    sum += a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
  }
  return sum / 6;
};

const isNear = (a, b, part) => assert.ok(Math.abs(a - b) <= part * Math.abs(b), `${a}, not ${b}`);

// What is in a box is drawn, closed and coloured, by every layer: boxes side by side are all of the mesh. The same is
// there as a mesh, also behind the clip plane, without hidden regions and what is beyond a threshold.
async function a_box_clips_exactly() {
  const stream = await TetlodStream.open(new Blob([bytes]), { target: { error: 0.05 } });
  await stream.refineTo({ error: 0.05 });
  const {
    bounds: [low, high],
  } = stream.info;
  const shown = async (spec) => {
    const tag = Math.random();
    const came = new Promise((resolve) => {
      stream.addEventListener('pictures', ({ detail }) => detail.tag === tag && detail.t === 1 && resolve(detail));
    });
    await stream.show({ field: 'Pressure', surface: true, edges: true, tag, ...spec }, { whole: true });
    return { ...(await came), mesh: await stream.drawn() };
  };
  const x = low[0] + 0.3137 * (high[0] - low[0]);
  const y = low[1] + 0.4271 * (high[1] - low[1]);
  const box = [low[0], low[1], low[2], x, y, high[2]];
  const slices = [{ origin: [0, 0, (low[2] + high[2]) / 2], normal: [0, 0, 1] }];
  const isIn = (p, k = 0) => p[k] <= x + 1e-5 && p[k + 1] <= y + 1e-5;
  const whole = await shown({});
  assert.deepEqual(whole.mesh.tets, (await stream.mesh()).tets);
  const first = await shown({ box, slices });
  for (const part of [first.surface, ...first.slices])
    for (let v = 0; v < part.points.length; v += 3) assert.ok(isIn(part.points, v));
  // the faces of the cut are there, with the colours of their places
  const { surface } = first;
  const onSide = [...surface.values.keys()].filter((v) => Math.abs(surface.points[3 * v] - x) < 1e-5);
  assert.ok(onSide.length > 20, `${onSide.length} points on the side`);
  for (const v of onSide.filter((_, i) => i % 10 === 0)) {
    const { values } = await stream.probe([...surface.points.subarray(3 * v, 3 * v + 3)]);
    isNear(surface.values[v], values.Pressure[0], 1e-4);
  }
  isNear(enclosedBy(surface), volumeOf(first.mesh), 1e-5);
  assert.equal(await stream.probe([x + 0.1 * (high[0] - x), low[1] + 0.01, low[2] + 0.01]), null);
  const others = [
    await shown({ box: [x, low[1], low[2], ...high] }),
    await shown({ box: [low[0], y, low[2], x, high[1], high[2]] }),
  ];
  isNear(
    [first, ...others].reduce((sum, { mesh }) => sum + volumeOf(mesh), 0),
    volumeOf(whole.mesh),
    1e-12,
  );
  const clip = { origin: slices[0].origin, normal: [0.3, 0.2, 1] };
  const clipped = await shown({ box, clip });
  isNear(enclosedBy(clipped.surface), volumeOf(clipped.mesh), 1e-5);
  assert.ok(volumeOf(clipped.mesh) < 0.9 * volumeOf(first.mesh));
  // a threshold keeps whole tetrahedra
  const [least, most] = stream.info.fields[0].range;
  const some = await shown({ threshold: { field: 'Pressure', low: (least + most) / 2 } });
  const { tets, numbers, fields } = some.mesh;
  assert.ok(numbers.length > 100 && numbers.length < whole.mesh.numbers.length && tets.length === 4 * numbers.length);
  assert.ok(fields.Pressure.every((value) => value >= (least + most) / 2));
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
  const written = await page.evaluate(() => {
    const { prototype } = CanvasRenderingContext2D;
    const plain = prototype.fillText;
    const texts = [];
    prototype.fillText = (text) => texts.push(text);
    window.tetlod.viewer.drawBarNow();
    prototype.fillText = plain;
    window.tetlod.viewer.drawBarNow();
    return texts;
  });
  assert.deepEqual(written.sort(), ['10', '20', '30', 'material']); // no value lies between two regions
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
  a_box_clips_exactly,
  a_box_is_moved_by_the_keyboard,
  notes_stay_with_their_probes,
  values_over_time_at_a_probe,
  regions_have_colours_of_their_own,
  streamlines_begin_on_the_slice,
]);
