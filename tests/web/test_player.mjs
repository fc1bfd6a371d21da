// SPDX-License-Identifier: BSD-3-Clause
// The player of a series in time, in a browser: play, pause, loop, single steps, the time line, and a coarser band on a
// thin line.
import assert from 'node:assert/strict';
import { execFileSync, spawnSync } from 'node:child_process';
import { join } from 'node:path';
import { firstPicture, launch, noticed, openPage, settled } from './browser.mjs';
import { ROOT, SCRATCH, TETLOD, program } from './hosts.mjs';
import { run } from './tap.mjs';

const STEPS = 20;
const make = (...words) => execFileSync(TETLOD, words, { cwd: SCRATCH, stdio: 'ignore' });
make('sample', 'wake', '--size', '14', '--steps', String(STEPS), '-o', 'wake.pvd');
make('build', 'wake.pvd', '--field', 'Pressure', '--quiet', '-o', 'wake.tetlod');
const server = await program([join(SCRATCH, 'wake.tetlod'), join(ROOT, 'tests/golden/series_moving.tetlod')]);
const browser = await launch();
const page = await openPage(browser, server.url, { viewport: { width: 900, height: 620 } });

const look = () =>
  page.evaluate(() => ({
    at: window.tetlod.at,
    series: window.tetlod.stream.series,
    state: window.tetlod.state,
    level: window.tetlod.level,
    now: document.getElementById('player-now')?.textContent,
    error: document.getElementById('shown-error').textContent,
  }));
const until = (check, argument) => page.waitForFunction(check, argument);
const atStep = (step) => until((wanted) => window.tetlod.settled && window.tetlod.at?.step === wanted, step);
const picture = () =>
  page.evaluate(async () => {
    for (let i = 0; i < 3; i++) await new Promise(requestAnimationFrame);
    return (await window.tetlod.scene.capture()).src;
  });

async function open(state, name = 'wake') {
  await page.goto('about:blank');
  await page.goto(`${server.url}view/${name}#error=0.01${state}`);
  await firstPicture(page);
  await page.locator('#player').waitFor();
}

async function stepsAreShown() {
  await open('');
  await settled(page);
  const first = await picture();
  await page.locator('#player-on').click();
  await atStep(1);
  await page.keyboard.press('.');
  await atStep(2);
  const { at, series, now, error } = await look();
  const { stderr: told } = spawnSync(
    TETLOD,
    ['extract', 'wake.tetlod', '--step', '2', '--error', '1%', '-o', 'step.vtu'],
    { cwd: SCRATCH, encoding: 'utf8' },
  );
  const [, own] = /Pressure within ([\d.]+) %/.exec(told);
  assert.ok(Number(own) <= 1, told);
  assert.equal(series.times.length, STEPS);
  assert.deepEqual([at.step, at.error, at.level], [2, 0.01, series.bands[at.band].level]);
  assert.match(now, /2 of 19/);
  assert.ok(error.startsWith(`${own}\u202f%`), `${error} on the page, ${own} % of ${told}`);
  assert.ok((await picture()) !== first, 'another step has the same picture');
  await page.keyboard.press(',');
  await atStep(1);
  await page.locator('#player-step').fill('15');
  await atStep(15);
  await until(() => location.hash.includes('step=15'));
  assert.match(await page.locator('#player-still').innerText(), /^Velocity: no steps/);
  assert.match(await page.locator('#download').getAttribute('href'), /bands\/\d+\/steps\/15\/mesh\.vtu$/);
  assert.deepEqual(page.complaints, []);
}

async function aLinkNamesTheStep() {
  await open('&step=7');
  await atStep(7);
  await page.evaluate(() => window.tetlod.set({ error: 0.05 }));
  await until(() => window.tetlod.settled && window.tetlod.at.error === 0.05);
  assert.equal((await look()).at.step, 7);
  await page.evaluate(() => window.tetlod.set({ step: null }));
  await until(() => window.tetlod.settled && window.tetlod.at === null);
}

// Colours mean the same at every step: their range is that over the series.
async function theRangeIsTheSeries() {
  await open('&step=0&range=data');
  await atStep(0);
  const low = () => page.locator('#low').inputValue();
  const { series } = await look();
  await until(
    (wanted) =>
      Math.abs(Number(document.getElementById('low').value.replace('\u2212', '-')) - wanted) <
      1e-3 * (1 + Math.abs(wanted)),
    series.fields[0].range[0],
  );
  const before = await low();
  await page.locator('#player-step').fill('13');
  await atStep(13);
  assert.equal(await low(), before);
}

// What the state's fractions are of: over all steps at a step, of the first one at a level; as drawn, and as the panel
// says it.
async function valuesAreOfWhatIsShown() {
  await open('&isosurfaces=0.5&threshold=0.3,0.8&surface=solid&step=7');
  const checked = async () => {
    const { value, values, number, least, absolute, range } = await page.evaluate(() => {
      const { scene, viewer } = window.tetlod;
      const numberOf = (id) => Number(document.querySelector(id).value);
      return {
        value: scene.isosurfaces[0].part.values[0],
        values: [...scene.surface.part.values],
        number: numberOf('#isosurfaces .number'),
        least: numberOf('#threshold-least'),
        absolute: numberOf('#error-absolute'),
        range: viewer.info.fields[0].range,
      };
    });
    const span = range[1] - range[0];
    const near = (a, b) => assert.ok(Math.abs(a - b) < 2e-3 * span, `${a} is not ${b}`);
    near(number, range[0] + 0.5 * span);
    near(value, number);
    near(least, range[0] + 0.3 * span);
    near(absolute, 0.01 * span);
    assert.ok(values.length && values.every((x) => x >= least - 2e-3 * span && x <= range[0] + 0.802 * span));
    return span;
  };
  await atStep(7);
  const overAll = await checked();
  await page.evaluate(() => window.tetlod.set({ step: null }));
  await until(() => window.tetlod.settled && window.tetlod.at === null);
  assert.ok((await checked()) < overAll);
  await page.evaluate(() => window.tetlod.set({ step: 12 }));
  await atStep(12);
  assert.equal(await checked(), overAll);
}

async function playsAndLoops() {
  await open('&step=16');
  await atStep(16);
  await page.evaluate(() => {
    window.heard = [];
    window.tetlod.stream.addEventListener('step', ({ detail }) => window.heard.push(detail.step));
  });
  await page.keyboard.press(' ');
  await until(() => window.heard.length >= 8);
  await page.keyboard.press(' ');
  await until(() => window.tetlod.settled && window.tetlod.at.step === window.tetlod.state.step);
  const heard = await page.evaluate(() => window.heard);
  const steps = heard.filter((step, i) => step !== heard[i - 1]);
  assert.deepEqual(steps.slice(0, 6), [17, 18, 19, 0, 1, 2]);
  assert.ok((await page.locator('#player-buffer rect').count()) >= 2);
  await page.locator('#player-loop').click();
  await page.locator('#player-step').fill('18');
  await atStep(18);
  await page.locator('#player-play').click();
  await until(() => document.getElementById('player-play').textContent === '▶' && window.tetlod.at.step === 19);
}

const groups = /bands\/(\d+)\/groups\/(\d+)/;

// Groups of the wanted band and of finer ones but the first do not come until they are sent; the page plays from the
// last step that is there.
async function withoutTheNextGroups() {
  const { bands } = (await look()).series;
  const wanted = bands.findIndex(({ error }) => error === 0.01);
  let send;
  const sent = new Promise((resolve) => {
    send = resolve;
  });
  await page.route(groups, async (route) => {
    const [, band, group] = groups.exec(route.request().url()).map(Number);
    if (band >= wanted && group) await sent;
    await route.continue();
  });
  await open('&step=6');
  await atStep(6);
  await page.evaluate(() => {
    const { viewer } = window.tetlod;
    const text = (id) => document.getElementById(id).textContent;
    window.heard = [];
    viewer.addEventListener('step', () =>
      window.heard.push({
        step: viewer.at.step,
        error: viewer.at.error,
        late: text('player-late'),
        shown: text('shown-error'),
      }),
    );
    viewer.showStep = function (step, options) {
      if (step === viewer.series.group) window.asked ??= performance.now();
      return Object.getPrototypeOf(this).showStep.call(this, step, options);
    };
  });
  await page.keyboard.press(' ');
  return send;
}

// What was shown coarser, and why; where it stops, and all is there, it is exact again.
async function coarserForNow(send) {
  await until(() => window.heard.some(({ error }) => error > 0.01));
  await page.keyboard.press(' ');
  const { step, late, shown } = await page.evaluate(() => window.heard.find(({ error }) => error > 0.01));
  assert.match(late, /late/);
  assert.match(shown, /^[25]\u202f%/);
  send();
  await until(() => window.tetlod.settled && window.tetlod.at.error === 0.01);
  assert.equal(await page.locator('#player-late').textContent(), '');
  await page.unrouteAll();
  return step;
}

async function lateStepsAreCoarser() {
  const send = await withoutTheNextGroups();
  await until(() => performance.now() - window.asked > 400); // until it is late by every measure
  send();
  await coarserForNow(send);
}

async function stepsThatDoNotComeAreCoarser() {
  assert.equal(await coarserForNow(await withoutTheNextGroups()), (await look()).series.group);
}

// A host that is silent: whoever waits is told so and can ask anew, which the host then answers; by single steps and
// while playing in the coarsest band.
async function aStepThatDoesNotComeIsAskedForAgain() {
  let silent;
  await page.route(groups, async (route) => {
    const [, , group] = groups.exec(route.request().url()).map(Number);
    if (!silent || !group) await route.continue();
  });
  for (const [state, key, next] of [
    ['&step=7', '.', 8],
    ['&step=7&error=0.5', ' ', 10],
  ]) {
    silent = true;
    await open(state);
    await atStep(7);
    await page.keyboard.press(key);
    await noticed(page, 'step', 'Step 8 has not come yet.');
    assert.equal((await look()).at.step, 7);
    silent = false;
    await page.locator('#notice-step').getByRole('button', { name: 'Try again' }).click();
    await until((step) => window.tetlod.at.step >= step, next);
    await page.waitForFunction(() => !document.getElementById('notice-step'));
  }
  await page.keyboard.press(' ');
  assert.deepEqual(page.complaints, []);
  await page.unrouteAll();
}

// The body bends: the surface that is drawn has other places at another step, and covers other pixels.
async function pointsMove() {
  await open('&field=point_displacement', 'series_moving');
  const ranges = () => page.evaluate(() => [window.tetlod.viewer.dataRange(), window.tetlod.stream.series.fields]);
  const [shown, fields] = await ranges(); // nothing has moved yet: the colours are those of all steps
  const { range } = fields.find(({ name }) => name === 'point_displacement');
  assert.deepEqual(shown, [0, Math.max(...range.map(Math.abs))]);
  await open('&step=0', 'series_moving');
  const shape = () =>
    page.evaluate(async () => {
      for (let i = 0; i < 3; i++) await new Promise(requestAnimationFrame);
      const image = await window.tetlod.scene.capture();
      const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
      context.drawImage(image, 0, 0);
      const pixels = new Uint32Array(context.getImageData(0, 0, image.width, image.height).data.buffer);
      const { positions } = await window.tetlod.stream.mesh();
      return {
        highest: positions.reduce((most, x, i) => (i % 3 === 2 ? Math.max(most, x) : most), -Infinity),
        covered: [...pixels].map((p) => p !== pixels[0]),
      };
    });
  const shapes = [];
  for (const step of [0, 8]) {
    await page.locator('#player-step').fill(String(step));
    await atStep(step);
    shapes.push(await shape());
  }
  const [before, after] = shapes;
  assert.ok(Math.abs(after.highest - before.highest) > 0.1, `${before.highest} and ${after.highest}`);
  assert.ok(before.covered.reduce((n, is, i) => n + (is !== after.covered[i]), 0) > 1000);
  assert.deepEqual(page.complaints, []);
}

await run([
  stepsAreShown,
  pointsMove,
  aLinkNamesTheStep,
  theRangeIsTheSeries,
  valuesAreOfWhatIsShown,
  playsAndLoops,
  lateStepsAreCoarser,
  stepsThatDoNotComeAreCoarser,
  aStepThatDoesNotComeIsAskedForAgain,
]);
