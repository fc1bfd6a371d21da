// SPDX-License-Identifier: BSD-3-Clause
// What must not happen to a picture: graphics that are lost, colours that the scalar bar does not have, a field that
// silently loads the whole mesh, ranges and slices that are wrong, a page that stops at "Loading…".
import assert from 'node:assert/strict';
import { launch, openPage, firstPicture, noticed, pictureFigures, settled } from './browser.mjs';
import { blockStream, program, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

const large = blockStream('large', 3, { p: ([x]) => 1e300 * (x - 0.4) });
const server = await program([sampleStream().path, large]);
const browser = await launch();
const page = await openPage(browser, server.url, { viewport: { width: 800, height: 560 } });

async function open(state) {
  await page.goto('about:blank');
  await page.goto(`${server.url}view/fin#smooth=0&error=0.05&surface=solid&slices=&map=viridis&range=data${state}`);
  await firstPicture(page);
  await settled(page);
}

const capture = () => page.evaluate(async () => {
  await new Promise(requestAnimationFrame);
  return (await window.tetlod.scene.capture()).src;
});

async function lost_graphics_come_back_with_the_same_picture() {
  await open('&slices=x@0.5&surface=inside&isosurfaces=0.4');
  const before = await capture();
  const restored = page.evaluate(() => new Promise((resolve) => {
    const { scene } = window.tetlod;
    scene.addEventListener('restored', resolve, { once: true });
    scene.view.get3DContext().getExtension('WEBGL_lose_context').loseContext();
  }));
  await restored;
  await noticed(page, 'graphics', 'The browser took the graphics away');
  await page.waitForFunction(() => !document.getElementById('notice-graphics'));
  assert.equal(await capture(), before);
  await page.locator('#picture').focus();
  await page.keyboard.press('ArrowLeft'); // it still turns
  assert.notEqual(await capture(), before);
}

// How many pixels inside of surfaces have a colour that the scalar bar does not have; at edges and lines colours blend.
const strayColours = () => page.evaluate(async () => {
  const image = await window.tetlod.scene.capture();
  const pixelsOf = (source) => {
    const context =
      Object.assign(document.createElement('canvas'), { width: source.width, height: source.height }).getContext('2d', {
        willReadFrequently: true
      });
    context.drawImage(source, 0, 0);
    return context.getImageData(0, 0, source.width, source.height).data;
  };
  const bar = pixelsOf(document.getElementById('scalarbar'));
  const colours = new Set();
  for (let i = 0; i < bar.length; i += 4)
    if (bar[i + 3] === 255) colours.add((bar[i] << 16) | (bar[i + 1] << 8) | bar[i + 2]);
  const map = [...colours].map((c) => [c >> 16, (c >> 8) & 255, c & 255]);
  const shown = pixelsOf(image);
  const background = [shown[0], shown[1], shown[2]].join();
  let seen = 0;
  let stray = 0;
  for (let i = 0; i < shown.length; i += 4 * 7) {
    const colour = [shown[i], shown[i + 1], shown[i + 2]];
    const edge = [-4, 4, -4 * image.width, 4 * image.width].some(
      (to) => colour.some((c, k) => !(Math.abs(c - shown[i + to + k]) < 20)));
    if (edge || colour.join() === background) continue;
    seen++;
    if (!map.some((m) => m.every((c, k) => Math.abs(c - colour[k]) <= 2))) stray++;
  }
  return { seen, stray };
});

async function every_surface_has_the_scalar_bars_colours() {
  for (const [what, state] of [['boundary', ''], ['slice', '&surface=off&slices=z@0.5&sliceEdges=0'],
         ['isosurface', '&surface=off&isosurfaces=0.5&shading=off']]) {
    await open(state);
    const { seen, stray } = await strayColours();
    console.log(`# ${what}: ${stray} of ${seen} pixels have no colour of the bar`);
    assert.ok(seen > 500, `${what}: ${seen} pixels`);
    assert.ok(stray < 0.002 * seen, `${what}: ${stray} of ${seen} pixels have a colour that the bar does not have`);
  }
  await open('&shading=all');
  assert.ok((await strayColours()).stray > 0, 'light changes colours where it is asked for');
}

async function a_field_that_is_not_controlled_asks_before_it_loads() {
  await open('');
  const before = await page.evaluate(() => window.tetlod.level);
  await page.locator('#field').selectOption('Velocity');
  await settled(page);
  assert.equal(await page.evaluate(() => window.tetlod.level), before);
  assert.match(
    await page.locator('#notice-field').innerText(), /Velocity is not controlled.*takes [\d\u202f]+ tetrahedra/);
  assert.match(await page.locator('#error-kind').innerText(), /sampled/i);
  await page.locator('#notice-field button', { hasText: 'Load it' }).click();
  await settled(page);
  const { level, errors } = await page.evaluate(
    () => ({ level: window.tetlod.level, errors: window.tetlod.stream.info.levels[window.tetlod.level].errors }));
  assert.ok(level > before && errors.Velocity.sampled <= 0.05, `level ${level}`);
}

async function a_component_has_its_own_range() {
  await open('&field=Velocity&component=1&error=0');
  const { shown, range } = await page.evaluate(async () => {
    const { Velocity } = (await window.tetlod.stream.mesh()).fields;
    const y = Velocity.filter((_, i) => i % 3 === 1);
    return {
      shown: ['low', 'high'].map((id) => Number(document.getElementById(id).value)),
      range: [Math.min(...y), Math.max(...y)]
    };
  });
  shown.forEach((x, i) => assert.ok(Math.abs(x - range[i]) < 0.02 * (range[1] - range[0]), `${shown}, not ${range}`));
}

async function slices_keep_apart() {
  await open('');
  for (let i = 0; i < 3; i++) await page.locator('[data-slice=x]').click();
  assert.deepEqual(await page.evaluate(() => window.tetlod.state.slices.map((p) => p.at)), [0.5, 0.25, 0.75]);
}

async function more_than_the_memory_is_for_is_asked() {
  await page.addInitScript(
    () => Object.defineProperty(navigator, 'deviceMemory', { value: 0.015, configurable: true }));
  await open('&error=0');
  const { level, tets, all } = await page.evaluate(() => {
    const { level, stream: { info } } = window.tetlod;
    return { level, tets: info.levels[level].tets, all: info.tets };
  });
  assert.ok(tets < all, `level ${level} has ${tets} of ${all}`);
  assert.match(await page.locator('#notice-budget').innerText(), /The original needs 38\u202f880 tetrahedra and about/);
  await page.locator('#notice-budget button', { hasText: 'Load it' }).click();
  await page.waitForFunction(
    (n) => window.tetlod.settled && window.tetlod.stream.info.levels[window.tetlod.level].tets === n, all);
}

async function bad_states_are_left_out() {
  await open(
    '&map=nonsense&camera=0,0,0,0,0,0,0,0,0&low=&maxTets=x&field=NoSuch&errorField=NoSuch'
    + '&slices=0,0,0@0.5;x@9&component=77');
  assert.ok((await pictureFigures(page)).covered > 0.1);
  const { map, field, slices, maxTets } = await page.evaluate(() => window.tetlod.state);
  assert.deepEqual({ map, field, slices, maxTets }, { map: 'viridis', field: 'Pressure', slices: [], maxTets: 0 });
}

// Pictures have 32 bits: no number that is not there is told of what they cannot hold.
async function values_beyond_32_bits_are_told() {
  await page.goto('about:blank');
  await page.goto(`${server.url}view/large#smooth=0&slices=&surface=solid`);
  await firstPicture(page);
  await noticed(page, 'large', 'p has values beyond 3.4e38');
  await page.mouse.move(290, 300);
  await page.waitForFunction(
    () => /^p beyond 3\.4e38.*p −?[\d.]+e(29\d|300)$/s.test(document.getElementById('probe').innerText));
}

async function a_missing_part_is_said() {
  const other = await openPage(browser, server.url);
  for (const missing of ['**/chunk-*.js', '**/worker-*.js', '**/tetlod-*.wasm']) {
    await other.route(missing, (route) => route.fulfill({ status: 404, body: '' }));
    await other.goto(`${server.url}view/fin`);
    await other.getByText(/could not be loaded|cannot be shown/).first().waitFor();
    await other.unroute(missing);
  }
  await other.context().close();
}

await run([
  lost_graphics_come_back_with_the_same_picture, every_surface_has_the_scalar_bars_colours,
  a_field_that_is_not_controlled_asks_before_it_loads, a_component_has_its_own_range, slices_keep_apart,
  more_than_the_memory_is_for_is_asked, bad_states_are_left_out, values_beyond_32_bits_are_told,
  a_missing_part_is_said
]);
