// SPDX-License-Identifier: BSD-3-Clause
// What is certain of a picture: answers and features in the worker as the program gives them, the panel, marks.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { countWords } from '../../server/web/page/certain.js';
import { firstPicture, launch, openPage, settled } from './browser.mjs';
import { TETLOD, blockStream, program } from './hosts.mjs';
import { run } from './tap.mjs';

const heat = ([x, y, z]) => Math.sin(4 * x) * Math.cos(3 * y) + 0.5 * z;
const push = ([x, y, z]) => [x, -y, 2 * z];
const glyphs = {
  'mark proven maximum': '▲',
  'mark possible maximum': '△',
  'mark proven minimum': '▼',
  'mark possible minimum': '▽',
};
const file = blockStream('certain', 9, { heat, push });
const server = await program([file]);
const browser = await launch();
const page = await openPage(browser, server.url, { viewport: { width: 1000, height: 700 } });

async function open(state = '') {
  await page.goto('about:blank');
  await page.goto(`${server.url}view/certain#smooth=0&surface=solid&slices=&field=heat${state}`);
  await firstPicture(page);
  await settled(page);
  await page.waitForSelector('#certain', { state: 'attached' });
}

const tetlod = (...given) => JSON.parse(execFileSync(TETLOD, [...given, '--json'], { encoding: 'utf8' }));
const inPage = (what, ...given) =>
  page.evaluate(([name, list]) => window.tetlod.stream[name](...list), [what, given]);

async function answers_are_those_of_the_program() {
  await open('&error=0');
  for (const question of ['max(heat)', 'mean(heat)', 'volume(heat > 0.3)', 'heat at (0.4,0.4,0.4)', 'volume()']) {
    const here = await inPage('ask', question, { within: 0.01 });
    const there = tetlod('ask', file, question, '--within', '1%');
    assert.equal(here.level, there.level, question);
    assert.equal(here.bound, there.bound, question);
    for (const end of ['lower', 'upper'])
      assert.ok(Math.abs(here[end] - there[end]) <= 1e-12 * (1 + Math.abs(there[end])), `${question} ${end}`);
  }
  const here = await inPage('features', 'heat', { persistence: 0.02 });
  const there = tetlod('features', file, '--field', 'heat', '--persistence', '2%');
  const brief = ({ kind, proven, at }) => [kind, proven, ...at];
  assert.deepEqual(here.features.map(brief), there.features.map(brief));
  assert.ok(here.features.some(({ proven }) => proven) && here.level === there.level);
}

async function a_coarse_picture_answers_by_its_own_level() {
  await open('&error=0.2');
  const [found, level] = [
    await inPage('ask', 'max(heat) in box(0.1,0.1,0.1, 0.8,0.8,0.8)', { within: 0 }),
    await page.evaluate(() => window.tetlod.level)
  ];
  assert.ok(found.level <= level && found.upper > found.lower && found.bound === 'certified');
  await assert.rejects(inPage('ask', 'mean(nothing)'), /no field 'nothing'/);
  await assert.rejects(inPage('ask', 'mean(heat'), /'\)'/);
  await assert.rejects(inPage('ask', 'mean(push:0)'), /'push' is not loaded/);
}

function counts_are_said_in_words() {
  const words = (proven, possible, bounded) => countWords({
    features: Array.from({ length: proven + possible }, (_, i) => ({ kind: 'minimum', proven: i < proven })),
    bounded: { minimum: bounded },
  }, 'minimum');
  assert.deepEqual([words(1, 0, true), words(1, 0, false), words(0, 0, true), words(1, 2, true), words(2, 3, false)],
                   ['1 minimum', 'at least 1 minimum', '0 minima', 'at least 1 and at most 3 minima',
                    'at least 2 minima']);
}

async function the_panel_loads_it_when_it_is_opened() {
  const loaded = [];
  const listen = (request) => loaded.push(new URL(request.url()).pathname);
  page.on('request', listen);
  await open('&error=0.02&isosurfaces=0.5');
  assert.ok(!loaded.some((path) => /refine/.test(path)), `${loaded}`);
  await page.locator('#certain > summary').click();
  await page.waitForFunction(() => document.querySelectorAll('#certain-list div').length >= 5);
  page.off('request', listen);
  assert.ok(loaded.some((path) => /refine.*wasm/.test(path)), `${loaded}`);
  const rows = await page.locator('#certain-list div').allInnerTexts();
  assert.match(rows[0], /Least value[\s\S]*exact, by the stream’s index$/);
  assert.match(rows.at(-1), /Volume above/);
  await page.fill('#certain-question', 'quantile(heat, 0.5)');
  await page.locator('#certain-ask').click();
  await page.waitForFunction(() => /by level/.test(document.getElementById('certain-answer').textContent));
  await page.fill('#certain-question', 'median(heat)');
  await page.keyboard.press('Enter');
  await page.waitForFunction(() => /quantile/.test(document.getElementById('certain-answer').textContent));
}

async function marks_are_solid_where_it_is_proven() {
  const marked = async () => {
    await page.waitForFunction(() => /^The original has/.test(document.getElementById('certain-words').textContent));
    return page.$$eval('.mark', (marks) => marks.map(({ className, textContent }) => [className, textContent]));
  };
  await open('&error=0');
  await page.locator('#certain > summary').click();
  await page.check('#certain-marks');
  const fine = await marked();
  const truth = tetlod('features', file, '--field', 'heat', '--persistence', '2%').features;
  assert.equal(fine.length, truth.length);
  for (const [name, text] of fine)
    assert.equal(text, glyphs[name]);
  const places = await page.$$eval('.mark', (marks) => marks.map(({ style }) => style.transform));
  assert.equal(new Set(places).size, places.length);
  await open('&error=0.02');
  await page.locator('#certain > summary').click();
  await page.fill('#certain-persistence', '4');
  await page.check('#certain-marks');
  assert.ok((await marked()).some(([name]) => /possible/.test(name)));
  await page.evaluate(() => window.tetlod.set({ component: 'magnitude', field: 'push' }));
  await page.waitForFunction(() => !/^The original has|^$/.test(document.getElementById('certain-words').textContent));
  await page.uncheck('#certain-marks');
  await page.waitForFunction(() => !document.querySelector('.mark'));
}

await run([
  answers_are_those_of_the_program,
  a_coarse_picture_answers_by_its_own_level,
  counts_are_said_in_words,
  the_panel_loads_it_when_it_is_opened,
  marks_are_solid_where_it_is_proven,
]);
