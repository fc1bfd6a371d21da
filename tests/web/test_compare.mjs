// SPDX-License-Identifier: BSD-3-Clause
// Two streams in one page: their difference against the originals', also of functions and at steps of a series, a
// curtain, and side by side with one camera; what is saved of them.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { copyFileSync } from 'node:fs';
import { join } from 'node:path';
import { firstPicture, launch, openPage, settled } from './browser.mjs';
import { SCRATCH, TETLOD, blockStream, program } from './hosts.mjs';
import { run } from './tap.mjs';

const heat = ([x, y, z]) => Math.sin(3 * x) + y * z;
const extra = ([x, y]) => 0.2 * x * x - 0.1 * y;
const push = ([x, y, z]) => [x, -y, 2 * z];
const here = blockStream('here', 8, { heat, push });
const there = blockStream('there', 8, { heat: (p) => heat(p) - extra(p), push: (p) => push(p).map((c) => 0.5 * c) });
const make = (...words) => execFileSync(TETLOD, words, { cwd: SCRATCH, stdio: 'ignore' });
make('sample', 'wake', '--size', '8', '--steps', '4', '-o', 'wake.pvd');
make('build', 'wake.pvd', '--quiet', '-o', 'wake.tetlod');
copyFileSync(join(SCRATCH, 'wake.tetlod'), join(SCRATCH, 'later.tetlod'));
const server = await program([here, there, ...['wake', 'later'].map((name) => join(SCRATCH, `${name}.tetlod`))]);
const browser = await launch();
const page = await openPage(browser, server.url, { viewport: { width: 800, height: 560 } });

async function open(state) {
  await page.goto('about:blank');
  await page.goto(
    `${server.url}view/here#smooth=0&surface=solid&slices=z@0.45&field=heat&range=data&other=there${state}`,
  );
  await firstPicture(page);
  await settled(page);
}

// What is drawn: places and differences.
const drawn = () =>
  page.evaluate(() => {
    const { viewer, scene } = window.tetlod;
    const origin = scene.centre.map((c, i) => c + scene.offset[i]);
    const parts = [scene.surface, ...scene.slices].map(({ part }) => part);
    return {
      bound: viewer.difference.bound,
      range: viewer.dataRange(),
      low: viewer.colorRange(),
      triangles: parts.map(({ triangles }) => triangles.length),
      values: parts.flatMap(({ points, values }) =>
        [...values].map((value, i) => [origin.map((o, k) => points[3 * i + k] + o), value]),
      ),
    };
  });
const subtracted = () => page.waitForFunction(() => window.tetlod?.viewer.difference?.bound);

async function a_difference_is_within_the_sum_of_both_bounds() {
  for (const error of [0.05, 0.002]) {
    await open(`&compare=difference&error=${error}`);
    await subtracted();
    const {
      bound: { bound, certified },
      values,
      range,
      low,
      triangles,
    } = await drawn();
    assert.ok(certified && bound > 0 && bound <= 2.2 * error * 3, `${bound}`);
    const wrong = values.filter(
      ([p, value]) => Math.abs(value - extra(p)) > bound + 2e-3); // what the originals are between their points
    assert.ok(values.length > 100 && triangles.every((n) => n > 0));
    assert.deepEqual(wrong, []);
    const most = Math.max(...values.map(([, value]) => Math.abs(value)));
    assert.ok(Math.abs(range[1] - most) < 1e-9 && range[0] === -range[1] && low[0] === range[0], `${range}`);
  }
  assert.match(await page.locator('#compare-words').innerText(), /^heat here less there: .* ± .* \(certified\)/);
  await page.mouse.move(360, 380);
  await page.waitForFunction(() => /^heat − there’s/.test(document.getElementById('probe').textContent));
}

// The originals' functions are compared, not fields that these are made of; and points that stay where they are.
async function functions_and_what_is_moved() {
  const text = 'heat * 2 + push.x';
  await open(`&compare=difference&error=0.01&formula=${encodeURIComponent(text)}&warp=push&warpScale=0.3`);
  await subtracted();
  await page.waitForFunction(() => window.tetlod.viewer.shade?.formula);
  await page.waitForFunction(
    (title) => document.getElementById('compare-words').textContent.startsWith(title),
    `${text} here less there`,
  );
  assert.match(await page.locator('#compare-words').innerText(), /± .*without being moved\.$/);
  const { bound, values } = await drawn();
  for (const [p, value] of values) {
    const wanted = 2 * extra(p) + 0.5 * p[0];
    assert.ok(Math.abs(value - wanted) <= bound.bound + 5e-3, `${p}: ${value}, not ${wanted} ± ${bound.bound}`);
  }
}

async function lengths_and_what_is_missing() {
  await page.evaluate(() => window.tetlod.set({ formula: '', warp: '', error: 0.002 }));

  await page.evaluate(() => window.tetlod.set({ field: 'push' }));
  await page.waitForFunction(
    () => window.tetlod.viewer.shade?.field === 'push' && window.tetlod.viewer.dataRange()[1] > 1,
  );
  const { values, bound } = await drawn();
  for (const [p, value] of values)
    assert.ok(Math.abs(value - 0.5 * Math.hypot(...push(p))) <= bound.bound + 1e-2, `${p}: ${value}`);
  await page.evaluate(() => window.tetlod.set({ other: 'nothing' }));
  await page.waitForFunction(() =>
    window.notices.some(({ text }) => /^The difference cannot be shown: .*nothing/.test(text)),
  );
  page.complaints.splice(0); // the browser's, of an address that is not there
  await page.evaluate(() => window.tetlod.set({ other: '' }));
  await page.waitForFunction(() => window.tetlod.viewer.shade && window.tetlod.viewer.dataRange()[0] >= 0);
}

// The frame has its name only after it was attached, and is attached again where the second view is arranged anew.
async function inFrame(act, argument) {
  const frame = await (await page.waitForSelector('iframe', { state: 'attached' })).contentFrame();
  return frame.waitForFunction(act, argument);
}

async function a_curtain_is_between_them() {
  await open('&compare=curtain&curtain=0.4');
  await page.frameLocator('iframe').locator('#panel').waitFor({ state: 'attached' });
  await inFrame(() => window.tetlod?.settled && window.tetlod.state.range === 'manual');
  const pictures = () =>
    page.evaluate(() =>
      ['#picture', 'iframe'].map((where) => document.querySelector(where).getBoundingClientRect().toJSON()),
    );
  const [first, second] = await pictures();
  assert.deepEqual(second, first);
  const [mine, other] = await Promise.all(
    [page, page.frame('tetlod-second')].map((where) =>
      where.evaluate(() => [
        window.tetlod.viewer.colorRange(),
        window.tetlod.state.slices,
        window.tetlod.viewer.info.cid,
      ]),
    ),
  );
  assert.deepEqual(other.slice(0, 2), mine.slice(0, 2));
  assert.notEqual(other[2], mine[2]);
  await page.locator('#curtain').focus();
  await page.keyboard.press('ArrowLeft');
  assert.equal(await page.evaluate(() => window.tetlod.state.curtain), 0.38);
  assert.equal(
    await page.evaluate(() => getComputedStyle(document.querySelector('iframe')).clipPath),
    'inset(0px 0px 0px 38%)',
  );
}

async function side_by_side_they_turn_and_change_together() {
  await page.locator('#compare').selectOption('beside');
  await page.waitForFunction(() => document.body.classList.contains('two'));
  await inFrame(() => window.tetlod?.settled);
  await page.evaluate(() => window.tetlod.scene.look('+x'));
  await inFrame(() => window.tetlod.scene.camera()[0] > 1 && Math.abs(window.tetlod.scene.camera()[1]) < 1e-6);
  await page.evaluate(() => window.tetlod.set({ isosurfaces: [0.5] }));
  await inFrame(() => window.tetlod.state.isosurfaces[0] === 0.5);
  assert.match(await page.evaluate(() => location.hash), /other=there/);
  const [width, alone] = await page.evaluate(async () => {
    const { picture, viewer } = window.tetlod;
    const both = await picture([600, 300]);
    viewer.beside = null;
    return [both.width, (await picture([600, 300])).width];
  });
  assert.deepEqual([width, alone], [600, 600]);
  await page.locator('#other').fill('');
  await page.locator('#other').press('Enter');
  await page.waitForFunction(() => !document.querySelector('iframe'));
  assert.deepEqual([page.complaints, page.strangers], [[], []]);
}

// Right of the curtain is the other's picture, at the same places and the same step, also while it plays, and when it
// is saved.
async function a_series_behind_a_curtain() {
  await page.goto('about:blank');
  await page.goto(`${server.url}view/wake#smooth=0&error=0.05&step=1&other=wake&compare=curtain&curtain=0.5`);
  await inFrame(() => window.tetlod?.settled && window.tetlod.at?.step === 1);
  await page.waitForFunction(() => window.frames['tetlod-second'].tetlod.scene.bottom === window.tetlod.scene.bottom);
  await page.frameLocator('iframe').locator('#player').waitFor({ state: 'hidden' });
  await page.locator('#player-play').click();
  await inFrame(() => window.tetlod.at?.step >= 2); // one step alone may be over between two looks
  await page.locator('#player-play').click();
  await settled(page);
  const { step } = await page.evaluate(() => window.tetlod.at);
  await inFrame((wanted) => window.tetlod.settled && window.tetlod.at.step === wanted, step);
  const halves = await page.evaluate(async () => {
    const [here, there] = [window.tetlod, window.frames['tetlod-second'].tetlod];
    there.set({ background: 'black', axes: false });
    await new Promise(requestAnimationFrame);
    const { width, height } = await here.picture([500, 400]);
    const context = (await here.picture([500, 400])).getContext('2d');
    const at = (x) => [...context.getImageData(x, 30, 1, 1).data].slice(0, 3);
    return { size: [width, height], left: at(240), right: at(260) };
  });
  assert.deepEqual(halves.size, [500, 400]);
  assert.ok(Math.max(...halves.right) < 40 && Math.max(...halves.left) > 40, JSON.stringify(halves));
}

async function a_difference_at_a_step() {
  await page.goto('about:blank');
  await page.goto(`${server.url}view/wake#smooth=0&error=0.05&step=2&other=wake&compare=difference`);
  await subtracted();
  await page.waitForFunction(() => window.tetlod.settled && window.tetlod.viewer.dataRange()[1] < 1e-5);
  await page.evaluate(() => window.tetlod.set({ other: 'here' }));
  await page.waitForFunction(() => window.notices.some(({ text }) => /no steps in time|no field/.test(text)));
  assert.deepEqual([page.complaints, page.strangers], [[], []]);
}

// The step comes while the other stream's first level is on its way, which then has no table of steps yet.
async function a_step_while_the_other_stream_opens() {
  const held = [/\/later\/prefix/, /\/later\/[^/]*\/stream$/].map((address) => {
    let release;
    const released = new Promise((resolve) => { release = resolve; });
    return { address, release, hold: (route) => released.then(() => route.continue()) };
  });
  for (const { address, hold } of held) await page.route(address, hold);
  const asked = page.waitForRequest(held[0].address);
  await page.goto('about:blank');
  await page.goto(`${server.url}view/wake#smooth=0&error=0.05&other=later&compare=difference`);
  await asked;
  await page.evaluate(() => window.tetlod.set({ step: 2 }));
  await page.waitForFunction(() => window.tetlod.viewer.at?.step === 2);
  held[0].release();
  await page.waitForFunction(() => window.tetlod.viewer.difference?.bound || window.notices.length);
  held[1].release();
  assert.deepEqual(await page.evaluate(() => window.notices), []);
  await page.waitForFunction(() => window.tetlod.settled && window.tetlod.viewer.dataRange()[1] < 1e-5);
  for (const { address } of held) await page.unroute(address);
  assert.deepEqual([page.complaints, page.strangers], [[], []]);
}

await run([
  a_difference_is_within_the_sum_of_both_bounds,
  functions_and_what_is_moved,
  lengths_and_what_is_missing,
  a_curtain_is_between_them,
  side_by_side_they_turn_and_change_together,
  a_series_behind_a_curtain,
  a_step_while_the_other_stream_opens,
  a_difference_at_a_step,
]);
