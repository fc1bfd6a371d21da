// SPDX-License-Identifier: BSD-3-Clause
// What the tests of the viewer's controls share: a page with a stream, its state, and its picture when nothing moves
// any more.
import assert from 'node:assert/strict';
import { firstPicture, launch, openPage, settled } from './browser.mjs';
import { cellStream, program, sampleStream } from './hosts.mjs';

export const server = await program([sampleStream().path, cellStream().path]);
export const browser = await launch();
export const size = { width: 800, height: 560 };
export const page =
  await openPage(browser, server.url, { viewport: size, permissions: ['clipboard-read', 'clipboard-write'] });

export async function open(state, on = page, id = 'fin') {
  await on.goto('about:blank');
  await on.goto(`${server.url}view/${id}#smooth=0&error=0.05&surface=solid&slices=&map=viridis&range=data${state}`);
  await firstPicture(on);
  await settled(on);
}

export const state = () => page.evaluate(() => window.tetlod.state);
export const until = (check, argument) => page.waitForFunction(check, argument);
export const becomes = (key, value) =>
  until(([k, v]) => JSON.stringify(window.tetlod.state[k]) === JSON.stringify(v), [key, value]);
export const enter = async (id, text) => {
  await page.locator(`#${id}`).fill(text);
  await page.locator(`#${id}`).press('Enter');
};
export const infoOf = () => page.evaluate(() => window.tetlod.stream.info);

// The picture as it is when nothing moves any more: two captures in a row that are the same.
export async function picture() {
  await settled(page);
  return page.evaluate(async () => {
    const frame = () => new Promise(requestAnimationFrame);
    await frame(); // colours and opacities change in the next one
    await frame();
    const shot = async () => (await window.tetlod.scene.capture()).src;
    let last = await shot();
    for (;;) {
      await new Promise((done) => setTimeout(done, 60));
      const next = await shot();
      if (next === last) return next;
      last = next;
    }
  });
}

// Runs `act` and waits until the picture is another one.
export async function changesThePicture(what, act) {
  const before = await picture();
  await act();
  await settled(page);
  await page.evaluate(async (was) => {
    for (const end = performance.now() + 60000; performance.now() < end;) {
      await new Promise(requestAnimationFrame);
      if ((await window.tetlod.scene.capture()).src !== was) return;
    }
    throw new Error('the picture stays as it was');
  }, before).catch((error) => assert.fail(`${what}: ${error.message}`));
}

/** The last test of each file. */
export async function nothing_was_complained_of() {
  assert.deepEqual([page.complaints, page.strangers], [[], []]);
}
