// SPDX-License-Identifier: BSD-3-Clause
// node page.mjs ORIGIN CELLS: the catalogue and the viewer of the stream `fin` as somebody meets them first.
import assert from 'node:assert/strict';
import { once } from 'node:events';
import { readFileSync, statSync } from 'node:fs';
import { createServer } from 'node:http';
import { pathToFileURL } from 'node:url';
import { firstPicture, launch, noticed, openPage, pictureFigures, settled } from './browser.mjs';
import { run } from './tap.mjs';

const [, , origin, cells] = process.argv;
const browser = await launch();
let page;

async function catalogue_lists_streams() {
  const list = await openPage(browser, origin);
  await list.goto(origin);
  await list.getByRole('link', { name: 'View' }).waitFor();
  // the list is drawn before the figures of each stream have come
  await list.waitForFunction(() => document.querySelector('section').innerText.includes('38\u202f880'));
  await list.waitForFunction(() => {
    const canvas = document.querySelector('canvas.thumbnail');
    return canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.some((x) => x > 0);
  });
  await list.getByText('Levels and files').click();
  await list.locator('tbody tr').nth(5).waitFor();
  assert.deepEqual([list.complaints, list.strangers], [[], []]);
  await list.getByRole('link', { name: 'View' }).click();
  await firstPicture(list);
  await list.context().close();
}

async function viewer_shows_a_picture() {
  page = await openPage(browser, origin);
  const start = Date.now();
  await page.goto(`${origin}view/fin`);
  await firstPicture(page);
  console.log(`# first picture after ${Date.now() - start} ms`);
  const loaded = await page.evaluate(() => {
    const [{ startTime: panel }] =
      performance.getEntriesByName('tetlod-panel'); // what comes after the panel is asked for later
    return [...performance.getEntriesByType('resource'), ...performance.getEntriesByType('navigation')]
      .filter((e) => e.startTime <= panel && !new URL(e.name).pathname.startsWith('/v1/'))
      .map((e) => [new URL(e.name).pathname, e.transferSize ? e.encodedBodySize : 0]);
  });
  const total = loaded.reduce((sum, [, size]) => sum + size, 0);
  console.log(`# the page and what it loads by then: ${total} bytes: ${loaded.map((l) => l.join(' ')).join(', ')}`);
  assert.ok(loaded.some(([path]) => path.endsWith('.wasm')) && total > 100e3 && total <= 230e3, `${total} bytes`);
  await settled(page);
  const { covered, colors } = await pictureFigures(page);
  assert.ok(covered > 0.1 && covered < 0.9, `covers ${covered} of the picture`);
  assert.ok(colors > 200, `${colors} colours`);
}

async function refines_and_coarsens() {
  const level = () => page.evaluate(() => window.tetlod.level);
  const before = await level();
  await page.locator('#error-percent').fill('0.1');
  await page.keyboard.press('Enter');
  await settled(page);
  const fine = await level();
  assert.ok(fine > before, `${before} to ${fine}`);
  const shown = await page.evaluate(
    () => [window.tetlod.stream.info.levels[window.tetlod.level], document.getElementById('shown-tets').innerText]);
  assert.ok(shown[0].errors.Pressure.max <= 0.001);
  assert.equal(Number(shown[1].split(/[ \n]/)[0].replaceAll(/\D/g, '')), shown[0].tets);
  await page.locator('#error-percent').fill('20');
  await page.keyboard.press('Enter');
  await settled(page);
  assert.ok(await level() < before);
}

async function state_is_in_the_url() {
  await page.keyboard.press('Escape');
  await page.evaluate(() => window.tetlod.set({ surface: 'glass', slices: [] }));
  await page.locator('#picture').focus();
  for (const key of ['x', 'i', 'm']) await page.keyboard.press(key);
  for (const part of ['error=0.2', 'slices=x@0.5', 'isosurfaces=0.5', 'surface=glass', 'map=cividis'])
    await page.waitForFunction((wanted) => location.hash.includes(wanted), part);
  const again = await openPage(browser, origin);
  await again.goto(page.url());
  await firstPicture(again);
  const states =
    await Promise.all([page, again].map((p) => p.evaluate(() => ({ ...window.tetlod.state, camera: null }))));
  assert.deepEqual(states[1], states[0]);
  await again.context().close();
}

async function a_slice_is_dragged() {
  const at = () => page.evaluate(() => window.tetlod.state.slices[0].at);
  const knob = await page.locator('.knob.slice-0').boundingBox();
  const before = await at();
  await page.mouse.move(knob.x + 9, knob.y + 9);
  await page.mouse.down();
  await page.mouse.move(knob.x + 60, knob.y + 20, { steps: 5 });
  await page.mouse.up();
  const dragged = await at();
  assert.ok(dragged > before + 0.02, `${before} to ${dragged}`);
  await page.locator('.knob.slice-0').focus();
  await page.keyboard.press('ArrowDown');
  assert.ok(Math.abs(await at() - dragged + 0.01) < 1e-9);
}

async function the_value_under_the_pointer() {
  const { width, height } = await page.locator('#picture').boundingBox();
  await page.mouse.move(width / 2, height / 2);
  await page.locator('#probe').waitFor();
  const found = /^Pressure ([\d.]+)\s+at ([^\n]+)/.exec(await page.locator('#probe').innerText());
  assert.ok(Number(found[1]) > 0.9 && Number(found[1]) < 9.4, found[0]);
  const [low, high] = await page.evaluate(() => window.tetlod.stream.info.bounds);
  found[2]
    .replaceAll('\u2212', '-')
    .split(', ')
    .map(Number)
    .forEach((x, i) => assert.ok(x >= low[i] - 1e-3 && x <= high[i] + 1e-3, found[2]));
}

// The index has the range of a vector's components; the colours have that of its length.
async function lengths_have_a_range_of_their_own() {
  const other = await openPage(browser, origin);
  await other.goto(`${origin}view/fin#error=0&smooth=0&field=Velocity`);
  await settled(other);
  const { low, high, range, of } = await other.evaluate(async () => {
    const { stream } = window.tetlod;
    const { Velocity } = (await stream.mesh()).fields;
    const lengths =
      Array.from({ length: Velocity.length / 3 }, (_, i) => Math.hypot(...Velocity.subarray(3 * i, 3 * i + 3)));
    return {
      low: document.getElementById('low').value,
      high: document.getElementById('high').value,
      range: [Math.min(...lengths), Math.max(...lengths)],
      of: stream.info.fields.find((f) => f.name === 'Velocity').range,
    };
  });
  assert.notDeepEqual(range, of);
  // coarser levels were on the way: what they had may reach a little further
  assert.ok(Number(low) <= range[0] + 1e-3 * range[1] && Math.abs(Number(high) - range[1]) < 0.02 * range[1],
    `${low} to ${high}, not ${range}`);
  await other.locator('#component').selectOption('0');
  await other.waitForFunction(
    (most) => Number(document.getElementById('high').value) === Number(most.toPrecision(4)), of[1]);
  await other.context().close();
}

async function a_picture_is_saved() {
  const [download] = await Promise.all([page.waitForEvent('download'), page.locator('#screenshot').click()]);
  assert.match(download.suggestedFilename(), /^fin-\d+\.png$/);
  const size = statSync(await download.path()).size;
  assert.ok(size > 20000, `${size} bytes`);
}

async function what_is_wrong_is_said() {
  const other = await openPage(browser, origin);
  await other.goto(`${origin}view/nothing`);
  await other.getByText("there is no mesh 'nothing'").waitFor();
  await other.addInitScript(() => {
    const plain = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
      return kind.startsWith('webgl') ? null : plain.call(this, kind, ...rest);
    };
  });
  await other.goto(`${origin}view/fin`);
  await noticed(other, 'error', 'this browser has no WebGL 2');
  await other.context().close();
}

async function every_control_has_a_name() {
  const nameless = await page.evaluate(
    () => [...document.querySelectorAll('button, a, input, select, [role=slider]')]
            .filter((e) => !(e.ariaLabel || e.getAttribute('aria-label') || e.labels?.[0]?.textContent.trim()
                      || (e.matches('button, a') && e.textContent.trim())))
            .map((e) => e.outerHTML.slice(0, 120)));
  assert.deepEqual(nameless, []);
}

async function nothing_went_wrong() {
  assert.deepEqual([page.complaints, page.strangers], [[], []]);
}

async function the_base_mesh_is_a_target() {
  const coarse = await openPage(browser, origin);
  await coarse.goto(`${origin}view/fin#error=1`);
  await settled(coarse);
  assert.equal(await coarse.evaluate(() => window.tetlod.level), 0);
  assert.match(await coarse.locator('#shown-level').innerText(), /^0 of/);
  await coarse.context().close();
}

// The server whose streams any origin may read shows the element; that of the other one gives way to what stands in it,
// the server's page.
async function showsCells(url) {
  const notebook = await openPage(browser, origin);
  await notebook.route(/^https:/,
    (route) =>
      route.fulfill({ contentType: 'text/javascript', body: '' })); // what nbconvert's pages load from elsewhere
  await notebook.goto(url);
  const [closed, open] = await notebook.locator('tetlod-view').elementHandles();
  await notebook.waitForFunction((view) => view.stream?.level > 0 && !view.childElementCount, open);
  await notebook.waitForFunction((view) => view.shadowRoot.querySelector('slot:not([name])'), closed);
  const [, frame] = notebook.frames();
  assert.equal(await closed.$eval('iframe', ({ src }) => src), frame.url());
  await frame.waitForFunction(() => window.tetlod?.settled);
  assert.equal(await frame.evaluate(() => window.tetlod.state.error), 0.2);
  assert.equal(await open.evaluate(({ state }) => new URLSearchParams(state).get('error')), '0.2');
  for (const view of [closed, open]) {
    await view.scrollIntoViewIfNeeded();
    const { length } = await view.screenshot();
    assert.ok(length > 15e3, `a picture of ${length} bytes`);
  }
  assert.ok(notebook.complaints.every((text) => /CORS|ERR_FAILED|ERR_FILE_NOT_FOUND|local resource/.test(text)),
    notebook.complaints.join());
  await notebook.context().close();
}

async function notebook_cells_show_the_stream() {
  const host = createServer((_, response) => response.setHeader('Content-Type', 'text/html').end(readFileSync(cells)))
                 .listen(0, '127.0.0.1');
  await once(host, 'listening');
  await showsCells(`http://localhost:${host.address().port}`);
  host.close();
}

async function notebook_cells_of_a_file_show_the_stream() {
  await showsCells(pathToFileURL(cells).href);
}

// What was mailed or kept outlives its server.
async function a_cell_says_what_it_needs() {
  const notebook = await openPage(browser, origin);
  await notebook.route(/^https?:/, (route) => route.abort('connectionrefused'));
  await notebook.goto(pathToFileURL(cells).href);
  await notebook.getByText(/Nothing is shown while its server does not run/).first().waitFor();
  assert.equal(await notebook.locator('tetlod-view a').first().getAttribute('href'), `${origin}view/fin#error=0.2`);
  await notebook.context().close();
}

// A frame has no size until it is shown, as in a cell that first tries something else.
async function a_frame_that_is_shown_later() {
  const host = await openPage(browser, origin);
  await host.setContent(
    `<iframe src="${origin}view/fin#error=0.2" style="display: none; width: 900px; height: 480px"></iframe>`);
  const [, frame] = host.frames();
  await frame.waitForFunction(() => performance.getEntriesByName('tetlod-graphics').length, null,
    { polling: 50 }); // it has no animation frames either
  await host.locator('iframe').evaluate((e) => { e.style.display = 'block'; });
  await frame.waitForFunction(() => window.tetlod?.settled);
  const outside = await frame.evaluate(() => {
    const { scene } = window.tetlod;
    const { width, height } = document.getElementById('picture').getBoundingClientRect();
    const corners =
      Array.from({ length: 8 }, (_, i) => scene.toScreen([0, 1, 2].map((k) => scene.bounds[(i >> k) & 1][k])));
    return corners.filter(({ x, y, depth }) => !(x > 0 && x < width && y > 0 && y < height && depth < 1));
  });
  assert.deepEqual(outside, []);
  await host.context().close();
}

async function what_is_loaded_is_small() {
  const all = await openPage(browser, origin);
  await all.goto(`${origin}view/fin#volume=1&error=0.2`);
  await firstPicture(all);
  await all.waitForFunction(() => window.tetlod.scene.rays);
  await all.evaluate(() => window.tetlod.set({ volumeSize: 96 }));
  await all.waitForFunction(() => window.tetlod.scene.volume);
  const loaded = await all.evaluate(
    () => [...performance.getEntriesByType('resource'), ...performance.getEntriesByType('navigation')]
            .filter((e) => !new URL(e.name).pathname.startsWith('/v1/'))
            .map((e) => [new URL(e.name).pathname, e.encodedBodySize]));
  const total = loaded.reduce((sum, [, size]) => sum + size, 0);
  console.log(`# the page loads ${total} bytes: ${loaded.map((l) => l.join(' ')).join(', ')}`);
  assert.ok(total > 100e3 && total <= 700e3, `${total} bytes`);
  assert.deepEqual(all.complaints, []);
  await all.context().close();
}

await run([
  catalogue_lists_streams, viewer_shows_a_picture, refines_and_coarsens, state_is_in_the_url, a_slice_is_dragged,
  the_value_under_the_pointer, lengths_have_a_range_of_their_own, a_picture_is_saved, what_is_wrong_is_said,
  every_control_has_a_name, nothing_went_wrong, the_base_mesh_is_a_target, notebook_cells_show_the_stream,
  notebook_cells_of_a_file_show_the_stream, a_cell_says_what_it_needs, a_frame_that_is_shown_later,
  what_is_loaded_is_small,
]);
