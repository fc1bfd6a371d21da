// SPDX-License-Identifier: BSD-3-Clause
// A stream with a local bound: it colours like any field, and probes and a plotted line tell it.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { firstPicture, launch, openPage, settled } from './browser.mjs';
import { ROOT, SCRATCH, TETLOD, program } from './hosts.mjs';
import { run } from './tap.mjs';

const { TetlodStream } = await import(pathToFileURL(join(ROOT, 'build/client/stream.js')));
const path = join(SCRATCH, 'bounded.tetlod');
execFileSync(TETLOD, ['sample', 'fin', '-o', join(SCRATCH, 'bounded.vtu')], { stdio: 'ignore' });
execFileSync(
  TETLOD, ['build', join(SCRATCH, 'bounded.vtu'), '--field', 'Pressure', '--local-bound', '-o', path, '--quiet']);
const server = await program([path]);
const browser = await launch();
const page = await openPage(browser, server.url, { viewport: { width: 800, height: 560 } });

async function open(state) {
  await page.goto('about:blank');
  await page.goto(`${server.url}view/bounded#smooth=0&error=0.02${state}`);
  await firstPicture(page);
  await settled(page);
}

const inPage = () => page.evaluate(
  () => ({ level: window.tetlod.level, fields: window.tetlod.stream.fields, field: window.tetlod.state.field }));

// The original's values, where the page has probed or plotted.
async function original(points) {
  const stream = await TetlodStream.open(new Blob([readFileSync(path)]), { fields: ['Pressure'] });
  await stream.refineTo({ error: 0 });
  const values = [];
  for (const point of points) values.push((await stream.probe(point))?.values.Pressure[0]);
  stream.close();
  return values;
}

async function it_colours_at_the_level_of_its_field() {
  await open('');
  const before = await inPage();
  assert.deepEqual(before.fields, ['Pressure'], 'nobody has asked for it');
  await page.locator('#field').selectOption('Pressure bound');
  await page.waitForFunction(() => window.tetlod.stream.fields.includes('Pressure bound'));
  await settled(page);
  const after = await inPage();
  assert.deepEqual([after.field, after.level], ['Pressure bound', before.level],
    'the target is the error of the field that it bounds');
  const { max, range } = await page.evaluate(() => {
    const { stream: { info }, level } = window.tetlod;
    return { max: info.levels[level].errors.Pressure.max, range: info.fields[0].range };
  });
  const [low, high] = await page.evaluate(() => window.tetlod.viewer.shade.range);
  assert.ok(low >= 0, `colours begin at ${low}`);
  assert.ok(high <= max * (range[1] - range[0]) * (1 + 1e-3) && high > 0.5 * max * (range[1] - range[0]),
    `colours end at ${high}`);
  writeFileSync(join(SCRATCH, 'local_bound.png'), await page.screenshot());
}

// The error that is told is that of the field which it bounds.
async function nothing_is_asked_of_it() {
  const text = await page.evaluate(() => document.body.innerText);
  assert.ok(!/Pressure bound (is )?not controlled|worst Pressure bound/.test(text), text);
  assert.equal(await page.locator('#error-kind').innerText(), 'Certified error');
  assert.match(await page.locator('#shown-error').innerText(), /^2\b/);
}

async function probes_tell_it() {
  const place = [0.6, 0.3, 0.4];
  await open(`&pins=${place.join()}`);
  await page.waitForFunction(() => / here$/.test(document.querySelector('#pins .pinned span')?.textContent ?? ''));
  const words = await page.locator('#pins .pinned span').first().innerText();
  const [, value, bound] = words.match(/^Pressure (\S+) ± (\S+) \(\S+\u202f%, certified\) here$/).map(Number);
  const { point, most } = await page.evaluate((at) => {
    const { stream: { info }, level } = window.tetlod;
    const [low, high] = info.bounds;
    const { range } = info.fields[0];
    return {
      point: at.map((x, i) => low[i] + x * (high[i] - low[i])),
      most: info.levels[level].errors.Pressure.max * (range[1] - range[0])
    };
  }, place);
  const [truth] = await original([point]);
  assert.ok(Math.abs(value - truth) <= bound * 1.05, `${value} ± ${bound}, it is ${truth}`);
  assert.ok(bound < most, `no less than the level's: ${most}`);
}

async function a_plotted_line_has_it() {
  await open('&line=0.1,0.3,0.5,0.9,0.3,0.5');
  await page.locator('#line-drawing .band').waitFor();
  await page.waitForFunction(() => window.tetlod.stream.fields.includes('Pressure bound'));
  await settled(page);
  const saved = async () => {
    const waiting = page.waitForEvent('download');
    await page.locator('#line-csv').click();
    const rows = readFileSync(await (await waiting).path(), 'utf8')
                   .trim()
                   .split('\n')
                   .slice(1)
                   .map((row) => row.split(',').map(Number));
    return rows;
  };
  let rows = [];
  const widths = () => new Set(rows.map(([, , , , , least, most]) => (most - least).toPrecision(3)));
  for (const end = Date.now() + 30000; Date.now() < end && widths().size < 4;) rows = await saved();
  assert.ok(widths().size >= 4, 'the band is as wide everywhere');
  const truths = await original(rows.map(([, x, y, z]) => [x, y, z]));
  const outside = rows.filter(([, , , , , least, most], i) => truths[i] < least - 1e-5 || truths[i] > most + 1e-5);
  assert.deepEqual(outside, [], 'the original is within');
  writeFileSync(join(SCRATCH, 'local_bound_line.png'), await page.screenshot());
}

async function nothing_was_complained_of() {
  assert.deepEqual([page.complaints, page.strangers], [[], []]);
}

await run([
  it_colours_at_the_level_of_its_field, nothing_is_asked_of_it, probes_tell_it, a_plotted_line_has_it,
  nothing_was_complained_of
]);
