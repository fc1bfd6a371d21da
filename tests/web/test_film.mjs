// SPDX-License-Identifier: BSD-3-Clause
// A film once around what is shown: it can be played, its frames differ, and the camera is where it was.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { firstPicture, launch, openPage, settled } from './browser.mjs';
import { program, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

const server = await program([sampleStream().path]);
const browser = await launch();
const page = await openPage(browser, server.url, { viewport: { width: 700, height: 500 } });

const player = await openPage(browser, server.url); // the viewer's own may load no media

// The film as the browser plays it: its size, and how many different pictures it has.
const played = (bytes) => player.evaluate(async (text) => {
  const blob = new Blob([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], { type: 'video/webm' });
  const video = Object.assign(document.createElement('video'), { muted: true, src: URL.createObjectURL(blob) });
  const canvas = new OffscreenCanvas(64, 48);
  const context = canvas.getContext('2d', { willReadFrequently: true });
  const seen = new Set();
  const look = () => {
    context.drawImage(video, 0, 0, 64, 48);
    seen.add(context.getImageData(0, 0, 64, 48).data.join());
    video.requestVideoFrameCallback(look);
  };
  video.requestVideoFrameCallback(look);
  const ended = new Promise((resolve, reject) => {
    video.onended = resolve;
    video.onerror = () => reject(video.error);
  });
  await video.play();
  await ended;
  return { size: [video.videoWidth, video.videoHeight], pictures: seen.size };
}, bytes.toString('base64'));

async function once_around() {
  await page.goto(`${server.url}view/fin#error=0.1&smooth=0`);
  await firstPicture(page);
  await settled(page);
  await page.locator('#film-seconds').fill('0.4');
  const before = await page.evaluate(() => window.tetlod.scene.camera());
  const [download] = await Promise.all([page.waitForEvent('download'), page.locator('#film').click()]);
  assert.match(download.suggestedFilename(), /^fin-\d+-film\.webm$/);
  const { size, pictures } = await played(readFileSync(await download.path()));
  const shown = await page.evaluate(() => window.tetlod.scene.view.getSize().map((side) => side & ~1));
  assert.deepEqual(size, shown);
  assert.ok(pictures >= 3, `${pictures} different pictures`); // a busy machine drops some
  const after = await page.evaluate(() => window.tetlod.scene.camera());
  after.forEach((x, i) => assert.ok(Math.abs(x - before[i]) < 1e-9, `${before} to ${after}`));
  await page.waitForFunction(() => !document.getElementById('film').disabled);
}

async function it_can_be_stopped() {
  await page.locator('#film-seconds').fill('60');
  await page.locator('#film').click();
  const stop = await page.locator('#notice-film button').first().elementHandle();
  await page.waitForFunction(() => /Frame [3-9]/.test(document.getElementById('notice-film').textContent));
  await stop.click(); // the button of the first picture: one that each picture makes anew cannot be pressed
  await page.waitForFunction(() => !document.getElementById('film').disabled);
  assert.deepEqual([page.complaints, page.strangers], [[], []]);
}

await run([once_around, it_can_be_stopped]);
