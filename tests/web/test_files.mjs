// SPDX-License-Identifier: BSD-3-Clause
// Streams that no server knows: chosen or dropped on the page, and a folder on a static host under any path.
import assert from 'node:assert/strict';
import { cpSync, mkdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { firstPicture, launch, openPage, pictureFigures, settled } from './browser.mjs';
import { ROOT, SCRATCH, folderHost, program, sampleStream } from './hosts.mjs';
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
  await page.context().close();
}

async function a_damaged_file_is_said() {
  const page = await openPage(browser, server.url);
  await page.goto(`${server.url}view.html`);
  await page.locator('#choose-file').setInputFiles({ name: 'photo.tetlod', mimeType: '', buffer: Buffer.from('not a stream at all'.repeat(100)) });
  await page.getByText(/photo cannot be shown: .*not a tetlod/).waitFor();
  await page.context().close();
}

async function a_folder_on_a_static_host() {
  const folder = join(SCRATCH, 'site/some/where');
  mkdirSync(folder, { recursive: true });
  cpSync(join(ROOT, 'build/web'), folder, { recursive: true });
  cpSync(path, join(folder, 'fin.tetlod'));
  const host = await folderHost(join(SCRATCH, 'site'));
  const page = await openPage(browser, host.origin);
  await page.goto(`${host.origin}/some/where/view.html?stream=fin.tetlod`);
  await showsAll(page);
  await page.context().close();
  host.close();
}

await run([a_file_that_is_chosen, a_file_that_is_dropped_on_the_catalogue, a_damaged_file_is_said, a_folder_on_a_static_host]);
