// SPDX-License-Identifier: BSD-3-Clause
// Two streams in one page: their difference against the originals', a curtain, and side by side with one camera.
import assert from 'node:assert/strict';
import { firstPicture, launch, openPage, settled } from './browser.mjs';
import { blockStream, program } from './hosts.mjs';
import { run } from './tap.mjs';

const heat = ([x, y, z]) => Math.sin(3 * x) + y * z;
const extra = ([x, y]) => 0.2 * x * x - 0.1 * y;
const push = ([x, y, z]) => [x, -y, 2 * z];
const here = blockStream('here', 8, { heat, push });
const there = blockStream('there', 8, { heat: (p) => heat(p) - extra(p), push: (p) => push(p).map((c) => 0.5 * c) });
const server = await program([here, there]);
const browser = await launch();
const page = await openPage(browser, server.url, { viewport: { width: 1000, height: 700 } });

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

async function lengths_and_what_is_missing() {
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
  await page.locator('#other').fill('');
  await page.locator('#other').press('Enter');
  await page.waitForFunction(() => !document.querySelector('iframe'));
  assert.deepEqual([page.complaints, page.strangers], [[], []]);
}

await run([
  a_difference_is_within_the_sum_of_both_bounds,
  lengths_and_what_is_missing,
  a_curtain_is_between_them,
  side_by_side_they_turn_and_change_together,
]);
