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

// What a page has that is no part of a link.
function likeNew(hash) {
  document.activeElement.blur();
  for (const details of document.querySelectorAll('#panel details')) details.open = false;
  window.notices.length = 0;
  history.replaceState(null, '', location.pathname + hash);
  const { viewer, scene } = window.tetlod;
  viewer.fragment = hash;
  if (!viewer.store.state.camera) scene.look('oblique');
}

/** A view of a stream; in the page that there is, if it shows that stream already: making one takes a second. */
export async function open(state, on = page, id = 'fin') {
  const hash = `#smooth=0&error=0.05&surface=solid&slices=&map=viridis&range=data${state}`;
  const path = `${server.url}view/${id}`;
  if (on.url().split('#')[0] === path && await on.evaluate(() => Boolean(window.tetlod?.settled))) {
    await on.mouse.move(0, 0);
    await on.evaluate(likeNew, hash);
  } else {
    await on.goto('about:blank');
    await on.goto(path + hash);
    await firstPicture(on);
  }
  await settled(on);
}

/** A page that is not as others find it is not used again. */
export const leave = (on = page) => on.goto('about:blank');

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
