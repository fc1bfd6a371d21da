// SPDX-License-Identifier: BSD-3-Clause
// Streams that no server knows: chosen or dropped on the page, and a folder on a static host under any path.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { copyFileSync, existsSync, mkdirSync, readFileSync, statSync } from 'node:fs';
import { join } from 'node:path';
import { firstPicture, launch, openPage, pictureFigures, settled } from './browser.mjs';
import { SCRATCH, TETLOD, fileHost, program, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

const { path, bytes } = sampleStream();
const server = await program([path]);
const browser = await launch();

async function showsAll(page) {
  await firstPicture(page);
  await settled(page);
  await page.evaluate(() => window.tetlod.set({ error: 0, smooth: false }));
  await settled(page);
  assert.equal(await page.evaluate(() => window.tetlod.stream.info.levels[window.tetlod.level].tets), 38880);
  assert.ok((await pictureFigures(page)).covered > 0.1);
  assert.deepEqual([page.complaints, page.strangers], [[], []]);
}

async function a_file_that_is_chosen() {
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}view.html`);
  await page.locator('#choose-file').setInputFiles(path);
  await showsAll(page);
  assert.equal(await page.locator('#name').innerText(), 'fin');
  await page.context().close();
}

async function a_file_that_is_dropped_on_the_catalogue() {
  const page = await openPage(browser, server.url);
  await page.goto(server.url);
  await page.locator('section').first().waitFor();
  const given = await page.evaluateHandle((text) => {
    const data = new DataTransfer();
    data.items.add(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], 'mine.tetlod'));
    return data;
  }, bytes.toString('base64'));
  await page.dispatchEvent('body', 'drop', { dataTransfer: given });
  await showsAll(page);
  assert.equal(await page.locator('#name').innerText(), 'mine');
  await page.waitForFunction(() => location.hash.includes('error=0')); // what was chosen is a step of its own
  await page.evaluate(() => history.back());
  await page.waitForFunction(() => window.tetlod.state.error > 0);
  await page.evaluate(() => history.back());
  await page.locator('section').first().waitFor();
  await page.context().close();
}

async function a_damaged_file_is_said() {
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}view.html`);
  await page.locator('#choose-file')
    .setInputFiles({ name: 'photo.tetlod', mimeType: '', buffer: Buffer.from('not a stream at all'.repeat(100)) });
  await page.getByText(/photo cannot be shown: .*not a tetlod/).waitFor();
  await page.context().close();
}

// Names need not be as addresses have them.
async function a_file_with_a_percent_sign() {
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}view.html`);
  await page.locator('#choose-file').setInputFiles({ name: 'fin_1%.tetlod', mimeType: '', buffer: bytes });
  await showsAll(page);
  assert.equal(await page.locator('#name').innerText(), 'fin_1%');
  await page.context().close();
}

// Redirects and listings of folders differ from host to host: this one has neither.
async function a_folder_on_a_static_host() {
  const strange = 'a#b?c%d e+f';
  mkdirSync(join(SCRATCH, 'two'));
  copyFileSync(path, join(SCRATCH, 'two/fin.tetlod'));
  copyFileSync(path, join(SCRATCH, `two/${strange}.tetlod`));
  execFileSync(TETLOD, ['explode', join(SCRATCH, 'two'), '-o', join(SCRATCH, 'site/some/where'), '--viewer']);
  const host = await fileHost((url) => {
    const file =
      join(SCRATCH, 'site', decodeURIComponent(new URL(url, 'http://x').pathname).replace(/\/$/, '/index.html'));
    return existsSync(file) && statSync(file).isFile() && readFileSync(file);
  });
  const page = await openPage(browser, host.origin);
  for (const name of ['fin', strange]) {
    await page.goto(`${host.origin}/some/where/index.html`);
    await page.locator('section', { has: page.getByRole('link', { name, exact: true }) })
      .getByRole('link', { name: 'View' })
      .click();
    page.complaints.length = 0; // v1/meshes is no file there
    await showsAll(page);
    assert.equal(await page.locator('#name').innerText(), name);
  }
  await page.context().close();
  host.close();
}

await run([
  a_file_that_is_chosen, a_file_that_is_dropped_on_the_catalogue, a_damaged_file_is_said, a_file_with_a_percent_sign,
  a_folder_on_a_static_host
]);
