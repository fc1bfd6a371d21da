// SPDX-License-Identifier: BSD-3-Clause
// The viewer when things go wrong: a server that is killed and comes back, a stream that is damaged, or cut short.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { firstPicture, launch, noticed, openPage, pictureFigures, settled } from './browser.mjs';
import { TETLOD, program, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

const { path, bytes } = sampleStream();
const browser = await launch();
const shown = (page) => page.evaluate(() => ({
  level: window.tetlod.level,
  levels: window.tetlod.stream.info.levels.length,
  received: window.tetlod.stream.received
}));

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
  await noticed(page, 'retry', 'trying again in');
  const during = await shown(page);
  assert.ok(during.level < during.levels - 1); // what had come is decoded
  assert.ok((await pictureFigures(page)).covered > 0.1);
  server = await program([path], server.port);
  await settled(page);
  const after = await shown(page);
  assert.equal(after.level, after.levels - 1);
  assert.equal(after.received,
    await page.evaluate(() => window.tetlod.stream.info.levels.at(-1).bytes)); // of the field that is shown
  await page.waitForFunction(() => !document.querySelector('#notice-retry, #notice-error'));
  await page.context().close();
  await server.stop();
}

// One flipped bit in the first field's exact values, which come last: every level before it can be used, and the page
// says what is wrong.
async function damage_is_said_and_levels_before_it_stay() {
  const damaged = Buffer.from(bytes);
  const { levels: all } = JSON.parse(execFileSync(TETLOD, ['info', path, '--json']));
  damaged[all.at(-2).bytes + 2000] ^= 0x10;
  const server = await program([path]);
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}view.html#error=0.2`);
  await page.locator('#choose-file')
    .setInputFiles({ name: 'damaged.tetlod', mimeType: '', buffer: damaged }); // a server checks what it serves
  await firstPicture(page);
  await settled(page);
  await askForAll(page);
  const message = await noticed(page, 'error');
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
