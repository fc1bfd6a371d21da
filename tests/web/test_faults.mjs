// SPDX-License-Identifier: BSD-3-Clause
// The viewer when things go wrong: a server that is killed and comes back, a stream that is damaged, or cut short.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { launch, openPage, firstPicture, pictureFigures, settled } from './browser.mjs';
import { program, sampleStream, SCRATCH, TETLOD } from './hosts.mjs';
import { run } from './tap.mjs';

const { path, bytes } = sampleStream();
const browser = await launch();
const shown = (page) => page.evaluate(() => ({ level: window.tetlod.level, levels: window.tetlod.stream.info.levels.length, received: window.tetlod.stream.received }));

async function askForAll(page) {
  await page.locator('#error-percent').fill('0');
  await page.keyboard.press('Enter');
}

async function resumes_after_a_killed_server() {
  let server = await program([path]);
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}view/fin#error=0.2`);
  await firstPicture(page);
  await settled(page);
  await server.stop('SIGKILL');
  await askForAll(page);
  await page.locator('#notice-retry').waitFor();
  assert.match(await page.locator('#notice-retry').innerText(), /trying again in/);
  const during = await shown(page);
  assert.ok(during.level < during.levels - 1); // what had come is decoded
  assert.ok((await pictureFigures(page)).covered > 0.1);
  server = await program([path], server.port);
  await settled(page);
  const after = await shown(page);
  assert.equal(after.level, after.levels - 1);
  assert.equal(after.received, await page.evaluate(() => window.tetlod.stream.info.levels.at(-1).bytes)); // of the field that is shown
  assert.equal(await page.locator('#notice-retry, #notice-error').count(), 0);
  await page.context().close();
  await server.stop();
}

// One flipped bit in the first field's exact values, which come last: every level before it can be used, and the page says what is wrong.
async function damage_is_said_and_levels_before_it_stay() {
  const damaged = Buffer.from(bytes);
  const { levels: all } = JSON.parse(execFileSync(TETLOD, ['info', path, '--json']));
  damaged[all.at(-2).bytes + 2000] ^= 0x10;
  const file = join(SCRATCH, 'damaged.tetlod');
  writeFileSync(file, damaged);
  const server = await program([file]);
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}view/damaged#error=0.2`);
  await firstPicture(page);
  await settled(page);
  await askForAll(page);
  await page.locator('#notice-error').waitFor();
  const message = await page.locator('#notice-error').innerText();
  assert.match(message, /level|checksum|damaged/);
  console.log(`# ${message.split('\n')[0]}`);
  const { level, levels } = await shown(page);
  assert.ok(level > 0 && level < levels - 1, `level ${level} of ${levels}`);
  await page.locator('#error-percent').fill('20');
  await page.keyboard.press('Enter');
  await settled(page);
  assert.ok((await shown(page)).level < level);
  assert.ok((await pictureFigures(page)).covered > 0.1);
  assert.deepEqual(page.strangers, []);
  await page.context().close();
  await server.stop();
}

await run([resumes_after_a_killed_server, damage_is_said_and_levels_before_it_stay]);
await browser.close();
