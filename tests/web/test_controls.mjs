// SPDX-License-Identifier: BSD-3-Clause
// Every control but those of layers does what it says: detail and colours, the camera, what leaves the page, values at
// places.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { firstPicture, noticed, openPage, settled } from './browser.mjs';
import {
  becomes, browser, changesThePicture, enter, infoOf, leave, nothing_was_complained_of, open, page, picture, server, size,
  state, until,
} from './controls.mjs';
import { run } from './tap.mjs';

async function the_error_has_a_slider_and_two_fields() {
  await open('');
  const { levels, fields } = await infoOf();
  const [low, high] = fields[0].range;
  await enter('error-percent', '2');
  await becomes('error', 0.02);
  assert.equal(
    await page.locator('#error-absolute').inputValue(), String(Number((0.02 * (high - low)).toPrecision(3))));
  await enter('error-absolute', String(0.01 * (high - low)));
  assert.ok(Math.abs((await state()).error - 0.01) < 1e-9);
  await enter('error-percent', 'nonsense');
  assert.equal(await page.locator('#error-percent').inputValue(), '1');
  // equal steps of the slider are equal factors of the error; its right end is the finest level
  const at = async (position) => {
    await page.locator('#error').fill(String(position));
    return (await state()).error;
  };
  const [a, b, c] = [await at(200), await at(400), await at(600)];
  assert.ok(Math.abs(a / b - b / c) < 0.02 * (b / c) && a / b > 1.5, `${[a, b, c]}`);
  assert.equal(await at(1000), 0);
  await settled(page);
  assert.equal(await page.evaluate(() => window.tetlod.level), levels.length - 1);
}

async function budgets_limit_the_level() {
  await open('&error=0');
  await page.getByText('Budgets').click();
  const { levels } = await infoOf();
  await enter('max-tets', '5000');
  await settled(page);
  const level = await page.evaluate(() => window.tetlod.level);
  assert.ok(levels[level].tets <= 5000 && levels[level + 1].tets > 5000);
  await enter('max-bytes', '0.03');
  await settled(page);
  assert.ok(levels[await page.evaluate(() => window.tetlod.level)].bytes <= 30000);
  for (const id of ['max-tets', 'max-bytes']) await page.locator(`#${id}`).fill('');
  await settled(page);
  assert.equal(await page.evaluate(() => window.tetlod.level), levels.length - 1);
}

// What is there is asked for by its error, which is seen, not by a budget, which is not.
async function stopping_leaves_no_hidden_budget() {
  await open('&error=0.05');
  const { level, error } = await page.evaluate(() => {
    document.getElementById('stop').click(); // hidden: nothing is loading
    const { level } = window.tetlod;
    return { level, error: window.tetlod.stream.info.levels[level].errors.Pressure.max };
  });
  const { maxTets, maxBytes, error: asked } = await state();
  assert.deepEqual([maxTets, maxBytes, asked], [0, 0, error]);
  await until((wanted) => location.hash.includes(`error=${wanted}`), String(Number(error.toPrecision(5))));
  assert.doesNotMatch(await page.evaluate(() => location.hash), /max/);
  assert.equal(await page.evaluate(() => window.tetlod.level), level);
}

// The progress bar is of the level that is asked for; every byte counts as received.
async function received_is_told() {
  await leave();
  await open('&error=0.05');
  const [value, fetched, own] = await page.evaluate(
    () => [document.getElementById('progress').value, window.tetlod.stream.fetched, window.tetlod.stream.received]);
  assert.equal(value, 1);
  assert.ok(fetched > own, `${fetched} bytes came, ${own} of levels`);
  assert.match(
    await page.locator('#shown-bytes').innerText(), new RegExp(`^${(fetched / 1000).toPrecision(3)}\u202fkB`));
}

// A unit that somebody types stands behind every number of the field, and in the link.
async function units_are_typed() {
  await open('&error=0.05');
  assert.match(await page.locator('#shown-error').innerText(), /± [\d.]+ in its units$/);
  await enter('unit', 'kPa');
  await page.locator('#shown-error').getByText(/± [\d.]+ kPa$/).waitFor();
  await until(() => location.hash.includes('units=Pressure%3DkPa'));
  await page.reload();
  await firstPicture(page);
  await page.locator('#shown-error').getByText(/± [\d.]+ kPa$/).waitFor();
  await page.locator('#field').selectOption('Density');
  assert.equal(await page.locator('#unit').inputValue(), '');
}

// What was chosen is undone by Back, however the camera was turned since.
async function back_undoes() {
  await leave(); // with a history of its own
  await open('&error=0.05');
  await page.locator('#surface').selectOption('glass');
  await until(() => location.hash.includes('surface=glass'));
  await page.locator('#edges').check();
  await until(() => location.hash.includes('edges=1'));
  await page.locator('#picture').press('ArrowLeft');
  await until(() => location.hash.includes('camera='));
  await page.goBack();
  await until(() => !window.tetlod.state.edges && window.tetlod.state.surface === 'glass');
  await page.goBack();
  await becomes('surface', 'solid');
  await page.goForward();
  await becomes('surface', 'glass');
  await page.evaluate(() => new Promise((resolve) => setTimeout(resolve, 300))); // when a new step would be written
  await page.goForward();
  await becomes('edges', true);
}

// Steps back in a row, and one while a turn of the camera is not written yet: each is shown as soon as the address
// says it, when nothing can have been written over it.
async function back_is_followed_at_once() {
  await leave();
  await open('&error=0.05');
  for (const surface of ['glass', 'off']) {
    await page.locator('#surface').selectOption(surface);
    await until((wanted) => location.hash.includes(`surface=${wanted}`), surface);
  }
  const seen = await page.evaluate(async () => {
    const { scene, state } = window.tetlod;
    const seen = [];
    scene.turn(20, 0);
    for (let steps = 0; steps < 2; steps++) {
      await new Promise((resolve) => {
        addEventListener('popstate', resolve, { once: true });
        history.back();
      });
      seen.push([location.hash.match(/surface=(\w+)/)?.[1] ?? 'solid', window.tetlod.state.surface]);
    }
    return seen;
  });
  assert.deepEqual(seen, ['glass', 'solid'].map((surface) => [surface, surface]));
}

// What is no number leaves what was there, and the text says what that is.
async function numbers_that_are_none_change_nothing() {
  await open('&slices=x@0.25&isosurfaces=0.5');
  const before = await state();
  const percentage = page.locator('#slices input.number >> nth=0');
  const coordinate = page.locator('#slices input.place');
  const value = page.locator('#isosurfaces input.number');
  for (const field of [percentage, coordinate, value]) {
    const was = await field.inputValue();
    for (const text of ['', 'NaN', 'Infinity', 'x']) {
      await field.fill(text);
      await field.press('Enter');
      assert.equal(await field.inputValue(), was, text);
    }
  }
  assert.deepEqual(await state(), before);
  await percentage.fill('1e300');
  await percentage.press('Enter');
  assert.equal(await percentage.inputValue(), '100 %');
}

// Frames that take half a second are two a second.
async function slow_frames_have_a_number() {
  await open('');
  await page.evaluate(() => window.tetlod.scene.addEventListener('render', () => {
    for (const end = performance.now() + 400; performance.now() < end;);
  }));
  const { x, y } = await page.locator('#picture').boundingBox();
  await page.mouse.move(x + 200, y + 200);
  await page.mouse.down();
  for (let i = 0; !/^[012]\.?\d* \/s$/.test(await page.locator('#shown-fps').innerText()); i++)
    await page.mouse.move(x + 200 + 20 * (i % 2), y + 200);
  await page.mouse.up();
  await leave();
}

// While the camera moves and frames take long, a coarser level is drawn; the fine one comes back when it rests.
async function slow_motion_is_coarser() {
  await open('&error=0&edges=1');
  const before = await picture();
  const triangles = () => page.evaluate(() => window.tetlod.scene.surface.part.triangles.length);
  const fine = await triangles();
  await page.evaluate(() => window.tetlod.scene.addEventListener('render', window.brake = () => {
    for (const end = performance.now() + 80; performance.now() < end;);
  }));
  const { x, y } = await page.locator('#picture').boundingBox();
  await page.mouse.move(x + 200, y + 200);
  await page.mouse.down();
  for (let i = 0; !await page.evaluate(() => window.tetlod.scene.fine); i++) {
    await page.mouse.move(x + 200 + 10 * (i % 2), y + 200);
  }
  assert.ok(await triangles() < 0.7 * fine, `${await triangles()} of ${fine}`);
  await page.mouse.move(x + 260, y + 220);
  await page.mouse.up();
  await until(() => !window.tetlod.scene.fine);
  assert.equal(await triangles(), fine);
  await page.evaluate(() => window.tetlod.scene.removeEventListener('render', window.brake));
  assert.ok(await picture() !== before, 'the camera has moved');
  await page.evaluate(() => window.tetlod.scene.look('oblique'));
  assert.equal(await picture(), before);
}

async function measures_are_chosen() {
  await open('');
  const certified = await page.evaluate(() => window.tetlod.level);
  await page.locator('#measure').selectOption('rms');
  await settled(page);
  assert.ok(await page.evaluate(() => window.tetlod.level) < certified, 'a mean square allows a coarser level');
  assert.match(await page.locator('#shown').innerText(), /RMS error/);
}

async function the_plot_is_dragged() {
  await open('');
  await page.locator('#plot').scrollIntoViewIfNeeded();
  const { x, y, width, height } = await page.locator('#plot').boundingBox();
  const before = await page.evaluate(() => window.tetlod.level);
  const point = await page.locator('#plot-point').boundingBox();
  await page.mouse.move(point.x + 6, point.y + 6);
  await page.mouse.down();
  await page.mouse.move(x + 0.85 * width, y + 0.6 * height, { steps: 4 });
  await page.mouse.up();
  await settled(page);
  const fine = await page.evaluate(() => window.tetlod.level);
  assert.ok(fine > before + 5, `${before} to ${fine}`);
  await page.locator('#plot-point').press('Home');
  await settled(page);
  assert.equal(await page.evaluate(() => window.tetlod.level), 0);
  assert.match(
    await page.locator('#plot-point').getAttribute('aria-valuetext'), /^level 0: error [\d.]+\u202f%, [\d.]+\u202fkB$/);
}

async function fields_and_components() {
  await open('');
  await changesThePicture('another field', () => page.locator('#field').selectOption('Density'));
  const density = await picture();
  await page.locator('#field').selectOption('Velocity');
  await page.locator('#component').waitFor();
  const pictures = [density];
  for (const component of ['magnitude', '0', '1', '2']) {
    await page.locator('#component').selectOption(component);
    pictures.push(await picture());
  }
  assert.equal(new Set(pictures).size, 5);
  await page.locator('#field').selectOption('Pressure');
  assert.ok(await page.locator('#component').isHidden());
}

async function ranges_of_the_colours() {
  await open('&error=0.05&clip=x@0.25');
  const fields = () =>
    Promise.all(['low', 'high'].map(async (id) => Number(await page.locator(`#${id}`).inputValue())));
  const data = await fields();
  await changesThePicture('the visible range', () => page.locator('#range').selectOption('visible'));
  const visible = await fields();
  assert.ok(visible[0] >= data[0] && visible[1] <= data[1] && visible[1] - visible[0] < data[1] - data[0],
    `${visible} of ${data}`);
  await changesThePicture('a range by hand', async () => {
    await enter('high', '2');
    await enter('low', '1.5');
  });
  assert.deepEqual(
    await page.evaluate(() => [window.tetlod.state.range, window.tetlod.state.low, window.tetlod.state.high]),
    ['manual', 1.5, 2]);
  assert.equal(await page.locator('#range').inputValue(), 'manual');
  const become = (wanted) => until(
    (values) => ['low', 'high'].every((id, i) => Number(document.getElementById(id).value) === values[i]), wanted);
  await enter('low', '7'); // above the highest: the range is from 2 to 7
  await become([2, 7]);
  await page.locator('#range').selectOption('data');
  await become(data);
}

async function logarithm_map_and_direction() {
  await open('');
  const plain = await picture();
  await changesThePicture('a logarithm', () => page.locator('#log').check());
  const log = await picture();
  await changesThePicture('the reversed map', () => page.locator('#reversed').check());
  await page.locator('#reversed').uncheck();
  await page.locator('#log').uncheck();
  assert.equal(await picture(), plain, 'and back');
  const looks = [plain, log];
  for (const { value } of await page.locator('#map option').evaluateAll((all) => all.map(({ value }) => ({ value })))) {
    await page.locator('#map').selectOption(value);
    looks.push(await picture());
  }
  assert.equal(new Set(looks).size, looks.length - 2, 'every map looks different'); // the first two are the plain one
}

async function a_map_from_a_file() {
  await open('');
  const choose = (text) =>
    page.locator('#map-file').setInputFiles({ name: 'own.xml', mimeType: 'text/xml', buffer: Buffer.from(text) });
  const points = '<Point x="0" o="0" r="0" g="0" b="1"/><Point x="3" o="1" r="1" g="0" b="0"/>';
  await changesThePicture(
    'a map from a file', () => choose(`<ColorMaps><ColorMap name="own" space="RGB">${points}</ColorMap></ColorMaps>`));
  await becomes('map', '0000ff-ff0000');
  assert.equal(await page.locator('#map option:checked').innerText(), 'from a file');
  await choose('nothing');
  await noticed(page, 'map', 'own.xml: the file has no colours');
  await becomes('map', '0000ff-ff0000');
}

async function a_logarithm_of_what_is_not_positive() {
  await open('&field=Velocity&component=2&log=1');
  const [low, high] = await Promise.all(['low', 'high'].map((id) => page.locator(`#${id}`).inputValue()));
  assert.ok(Number(low) > 0 && Number(high) > Number(low), `${low} to ${high}`);
  await page.locator('#component').selectOption('0');
  await picture();
  assert.deepEqual(page.complaints, []);
}

// Whether all of the volume is in the picture, clear of title and scalar bar.
const allIsSeen = () => page.evaluate(() => {
  const { scene } = window.tetlod;
  const { width, height } = document.getElementById('picture').getBoundingClientRect();
  const corners =
    [0, 1, 2, 3, 4, 5, 6, 7].map((i) => scene.toScreen([0, 1, 2].map((k) => scene.bounds[(i >> k) & 1][k])));
  return corners.every(({ x, y }) => x > 0 && x < width && y > 30 && y < height - 70);
});

async function the_camera_and_the_background() {
  await open('');
  const seen = [];
  for (const look of ['+x', '-x', '+y', '-y', '+z', '-z', 'oblique']) {
    await page.locator(`[data-look="${look}"]`).click();
    seen.push(await picture());
    assert.ok(await allIsSeen(), `${look} shows everything`);
  }
  assert.equal(new Set(seen).size, 7);
  await changesThePicture('parallel projection', () => page.locator('#parallel').check());
  await page.locator('#picture').press('+');
  const zoomed = (await state()).camera;
  assert.equal(zoomed.length, 10, 'the height of a parallel projection is part of the state');
  for (const background of ['white', 'grey', 'black'])
    await changesThePicture(background, () => page.locator('#background').selectOption(background));
  await page.locator('#reset').click();
  const { error, surface, background, parallel } = await state();
  assert.deepEqual(
    { error, surface, background, parallel }, { error: 0.01, surface: 'inside', background: 'auto', parallel: false });
  assert.equal(await page.evaluate(() => document.getElementById('error-percent').value), '1');
}

// Also in a view from near, where edges are many times as long as the picture and foreshortened: few numbers, each
// beside the place of an edge that it names.
async function axes_have_few_numbers_where_they_belong() {
  await open('');
  const labels = () => page.evaluate(() => {
    const { scene, stream: { info: { bounds } } } = window.tetlod;
    const distances = (value) => [0, 1, 2].flatMap((axis) => [0, 1, 2, 3].map((k) => {
      const point = [0, 1, 2].map((i) => bounds[k >> ((i - axis + 2) % 3) & 1][i]);
      point[axis] = value;
      const { x, y } = scene.toScreen(point.map((c, i) => c - scene.centre[i]));
      return { x, y };
    }));
    return [...document.querySelectorAll('.axes text:not(.name)')].map((node) => {
      const [x, y] = ['x', 'y'].map((name) => Number(node.getAttribute(name)));
      const value = Number(node.textContent.replaceAll('\u2212', '-').replaceAll('\u202f', ''));
      return Math.min(...distances(value).map((at) => Math.abs(Math.hypot(at.x - x, at.y - y) - 16)));
    });
  });
  const [low, high] = await page.evaluate(() => window.tetlod.scene.bounds);
  const reach = high.map((h, i) => h - low[i]);
  for (const [from, to] of [
    [[0, -2, 0.1], [0, 1, 0]],
    [[0.1, -0.51, 0.05], [0.4, 0.5, -0.3]],
    [[-0.49, -0.505, -0.45], [0.5, 0.1, 0.2]],
  ]) {
    const camera = [from, to].flatMap((p) => p.map((c, i) => c * reach[i]));
    await page.evaluate((at) => {
      window.tetlod.scene.setCamera([...at, 0, 0, 1]);
      window.tetlod.scene.interactor.render();
    }, camera);
    const off = await labels();
    assert.ok(off.length <= 60, `${off.length} numbers`);
    assert.ok(off.every((pixels) => pixels < 1), `${Math.max(...off)} pixels off`);
    if (from[1] === -2) assert.ok(off.length > 5);
  }
}

// Until somebody moves the camera the volume fills the picture, whatever the window becomes.
async function the_volume_fits_the_window() {
  await leave();
  await open('');
  const place = () => page.evaluate(() => String(window.tetlod.scene.camera()));
  const before = await place();
  const resized = async (to) => {
    const width = await page.evaluate(() => window.tetlod.scene.view.getSize()[0]);
    await page.setViewportSize(to);
    await until((was) => window.tetlod.scene.view.getSize()[0] !== was, width);
  };
  await resized({ width: 620, height: 560 });
  assert.ok(await place() !== before && await allIsSeen());
  assert.equal((await state()).camera, null);
  await resized(size);
  assert.equal(await place(), before);
  await page.locator('#picture').press('ArrowLeft');
  const turned = await place();
  await resized({ width: 620, height: 560 });
  assert.equal(await place(), turned, 'it stays as somebody has turned it');
  await page.setViewportSize(size);
}

async function a_second_view_turns_along() {
  await open('');
  await page.locator('#second').check();
  const beside = await (await page.locator('iframe').elementHandle()).contentFrame(); // it has its name a moment later
  await beside.waitForFunction(() => window.tetlod?.settled && window.tetlod.state.error === 0.05);
  const together = () => until(() => {
    const other = document.querySelector('iframe').contentWindow.tetlod;
    return other && other.scene.camera().join() === window.tetlod.scene.camera().join();
  });
  await together();
  const before = await page.evaluate(() => window.tetlod.scene.camera().join());
  await page.locator('#picture').focus();
  await page.keyboard.press('ArrowLeft');
  await until((was) => window.tetlod.scene.camera().join() !== was, before);
  await together();
  await beside.evaluate(() => window.tetlod.scene.look('+x'));
  await until(() => Math.abs(window.tetlod.scene.axes().towards[0]) > 0.999);
  await together();
  await beside.evaluate(() => window.tetlod.set({ field: 'Density' }));
  await until(() => /second=[^&]*field%3DDensity/.test(location.hash));
  assert.equal((await state()).field, 'Pressure');
  assert.equal(await beside.locator('#second-row').isHidden(), true);
  await page.locator('#second').uncheck();
  assert.equal(await page.locator('iframe').count(), 0);
  assert.ok((await state()).second === null);
}

async function a_link_shows_the_same() {
  await open(
    '&field=Velocity&component=1&range=manual&low=-1&high=2&map=magma&reversed=1&surface=glass&edges=1'
    + '&slices=x@0.3;0.6,0,0.8@0.5'
    + '&isosurfaces=0.3&isosurfaceField=Pressure&isosurfaceOpacity=0.5&clip=z@0.8&background=black&parallel=1');
  await page.locator('#picture').focus();
  for (const key of ['ArrowLeft', 'ArrowUp', '+']) await page.keyboard.press(key);
  const camera = (await state()).camera;
  await until((c) => location.hash.includes(`camera=${c}`), String(Number(camera[0].toPrecision(5))));
  await page.locator('#copy-link').click();
  await noticed(page, 'share', 'The link to this picture is copied.');
  const link = await page.evaluate(() => navigator.clipboard.readText());
  const [there, was] = [await picture(), await state()];
  const other = await openPage(browser, server.url);
  await other.goto(link);
  await firstPicture(other);
  await settled(other);
  const restored = await other.evaluate(() => window.tetlod.state);
  assert.deepEqual({ ...restored, camera: null }, { ...was, camera: null });
  restored.camera.forEach((c, i) => assert.ok(Math.abs(c - camera[i]) < 1e-3, `${restored.camera} is not ${camera}`));
  await other.context().close();
  assert.ok(there.length > 1000);
}

// The words of a PNG, as another language reads them; every chunk is as long and has the checksum that it says.
const readTexts = `
import json, sys, zlib
png, at, texts = sys.stdin.buffer.read(), 8, {}
assert png[:8] == bytes([137]) + b'PNG' + bytes([13, 10, 26, 10])
while at < len(png):
    end = at + 8 + int.from_bytes(png[at:at + 4], 'big')
    assert int.from_bytes(png[end:end + 4], 'big') == zlib.crc32(png[at + 4:end])
    if png[at + 4:at + 8] == b'iTXt':
        keyword, _, _, _, _, text = png[at + 8:end].decode().split(chr(0))
        texts[keyword] = text
    at = end + 4
print(json.dumps(texts))`;

// What VTK reads in a file.
const readVtp = `
import json, sys, vtk
reader = vtk.vtkXMLPolyDataReader()
reader.SetFileName(sys.argv[1])
reader.Update()
data = reader.GetOutput()
arrays = [data.GetPointData().GetArray(i) for i in range(data.GetPointData().GetNumberOfArrays())]
notes = [data.GetFieldData().GetArray(i) for i in range(data.GetFieldData().GetNumberOfArrays())]
print(json.dumps({'points': data.GetNumberOfPoints(), 'triangles': data.GetNumberOfPolys(),
                  'lines': data.GetNumberOfLines(), 'bounds': data.GetBounds(),
                  'arrays': {a.GetName(): a.GetRange() for a in arrays},
                  'notes': {a.GetName(): a.GetTuple1(0) for a in notes}}))`;

const download = async (id) => {
  const [file] = await Promise.all([page.waitForEvent('download'), page.locator(`#${id}`).click()]);
  const path = await file.path();
  return { name: file.suggestedFilename(), path, bytes: readFileSync(path) };
};
const vtpOf = ({ path }) => JSON.parse(execFileSync('/usr/bin/python3', ['-c', readVtp, path]));
const near = (a, b) => Math.abs(a - b) <= 1e-5 * (1 + Math.abs(b));

// Where two pictures differ otherwise than at each of some places, and only there.
const marksIn = (...pictures) => page.evaluate(async ([one, other, labels]) => {
  const pixels = await Promise.all([one, other].map(async (base64) => {
    const image = await createImageBitmap(new Blob([Uint8Array.from(atob(base64), (c) => c.charCodeAt(0))]));
    const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
    context.drawImage(image, 0, 0);
    return context.getImageData(0, 0, image.width, image.height);
  }));
  const [{ width, data }, { data: without }] = pixels;
  const met = labels.map(() => 0);
  const wrong = [];
  for (let i = 0; i < data.length; i += 4) {
    if ([0, 1, 2].every((c) => Math.abs(data[i + c] - without[i + c]) < 40)) continue;
    const [x, y] = [(i / 4) % width, Math.floor(i / 4 / width)];
    const label = labels.findIndex(
      ({ left, right, top, bottom }) => x > left - 3 && x < right + 3 && y > top - 3 && y < bottom + 3);
    if (label < 0) wrong.push([x, y]);
    else met[label]++;
  }
  return [...wrong, ...labels.filter((_, i) => !met[i])];
}, pictures.map((file) => file.bytes?.toString('base64') ?? file));

async function what_leaves_the_page() {
  await open('&pins=0.5,0.5,0.25&line=0.2,0.5,0.5,0.35,0.5,0.6');
  await until(() => /^[\d.]+$/.test(document.querySelector('.pin span').textContent));
  const { level, tets } = await page.evaluate(() => window.tetlod.stream.info.levels[window.tetlod.level]);
  const mesh = await download('download');
  assert.equal(mesh.name, `fin-${level}.vtu`);
  assert.match(mesh.bytes.subarray(0, 2000).toString('latin1'), new RegExp(`NumberOfCells="${tets}"`));
  const shot = await download('screenshot');
  const labels = await page.locator('.axes text, .pin b, .pin span, .knob.along, line.rim')
                   .evaluateAll((all) => all.map((mark) => mark.getBoundingClientRect().toJSON()));
  assert.ok(labels.length > 10);
  assert.equal(shot.name, `fin-${level}.png`);
  const texts = JSON.parse(execFileSync('python3', ['-c', readTexts], { input: shot.bytes }));
  assert.equal(texts.Title, 'fin');
  assert.match(texts.Description, new RegExp(`^Pressure, level ${level} of \\d+: Pressure ≤ [\\d.]+\\s%`));
  assert.match(texts.Source, /view\/fin#.*error=0.05/);
  await page.locator('#axes').uncheck();
  await page.evaluate(() => window.tetlod.set({ pins: [], line: null }));
  assert.deepEqual(await marksIn(shot, await download('screenshot'), labels), [],
    'axes, line and probe are where the screen has them');
  await page.locator('#axes').check();
  const { width, height } = await page.locator('#stage').boundingBox();
  assert.deepEqual([shot.bytes.readUInt32BE(16), shot.bytes.readUInt32BE(20)], [Math.round(width), Math.round(height)]);
  await page.locator('#png-width').fill('900');
  await page.locator('#png-height').fill('1100');
  const before = await picture();
  const large = await download('save-png');
  assert.deepEqual([large.bytes.readUInt32BE(16), large.bytes.readUInt32BE(20)], [900, 1100]);
  assert.ok(large.bytes.length > shot.bytes.length);
  assert.equal(await picture(), before); // on the screen all is as it was
}

// Slices and isosurfaces as other programs read them, at their places in the mesh, with the values that colour them.
async function surfaces_are_saved() {
  await open('&slices=z@0.25&isosurfaces=0.4&surface=off');
  assert.deepEqual(await page.locator('#export-part option').allInnerTexts(), ['slice 1', 'isosurface 1']);
  const { bounds: [low, high], fields } = await infoOf();
  const { level, bound } = await page.evaluate(() => ({
    level: window.tetlod.level,
    bound: window.tetlod.stream.info.levels[window.tetlod.level].errors.Pressure.max
  }));
  const slice = await download('export-vtp');
  assert.equal(slice.name, `fin-${level}-slice-1.vtp`);
  const { points, triangles, bounds, arrays, notes } = vtpOf(slice);
  const z = low[2] + 0.25 * (high[2] - low[2]);
  assert.ok(points > 50 && triangles > 50 && near(bounds[4], z) && near(bounds[5], z), `${bounds}`);
  const [least, most] = fields.find(({ name }) => name === 'Pressure').range;
  assert.ok(arrays.Pressure[0] >= least - 1e-4 && arrays.Pressure[1] <= most + 1e-4);
  assert.ok(notes.level === level && near(notes['certified bound'], bound * (most - least)));
  const rows = (await download('export-csv')).bytes.toString().trim().split('\n').map((row) => row.split(','));
  assert.deepEqual([rows.length - 1, rows[0]], [points, ['x', 'y', 'z', 'Pressure']]);
  for (const row of rows.slice(1).filter((_, i) => i % 40 === 0)) {
    const [x, y, zOf, value] = row.map(Number);
    const found =
      await page.evaluate(async (point) => (await window.tetlod.stream.probe(point)).values.Pressure[0], [x, y, zOf]);
    assert.ok(Math.abs(found - value) < 1e-3 * (most - least), `${value}, ${found} there`);
  }
  const glb = (await download('export-glb')).bytes;
  const json = JSON.parse(glb.subarray(20, 20 + glb.readUInt32LE(12)));
  assert.ok(glb.toString('latin1', 0, 4) === 'glTF' && glb.readUInt32LE(8) === glb.length);
  assert.deepEqual([json.accessors[0].count, json.accessors.at(-1).count], [points, 3 * triangles]);
  assert.ok(near(json.accessors[0].min[2] + json.nodes[0].translation[2], z)
    && json.bufferViews.at(-1).byteOffset + json.bufferViews.at(-1).byteLength === json.buffers[0].byteLength);
  await page.locator('#export-part').selectOption('isosurface 1');
  const iso = vtpOf(await download('export-vtp'));
  assert.ok(iso.triangles > 10 && iso.arrays.Pressure.every((value) => near(value, least + 0.4 * (most - least))),
    `${iso.arrays.Pressure}`);
}

async function the_whole_screen_and_the_panel() {
  await open('');
  await page.locator('#fullscreen').click();
  await until(() => document.fullscreenElement);
  await page.locator('#fullscreen').click();
  await until(() => !document.fullscreenElement);
  const before = await page.locator('#picture').boundingBox();
  await page.locator('#panel-toggle').click();
  await until((width) => document.getElementById('picture').getBoundingClientRect().width > width + 200, before.width);
  assert.equal(await page.locator('#panel-toggle').getAttribute('aria-expanded'), 'false');
  assert.ok(await page.locator('#error').isHidden());
  await page.keyboard.press('h');
  await until((width) => document.getElementById('picture').getBoundingClientRect().width === width, before.width);
  const light = await picture();
  await page.locator('#theme').click();
  assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), 'dark');
  assert.ok(await picture() !== light, 'the picture follows the page');
  await page.locator('#theme').click();
  await page.locator('#help-open').click();
  await page.locator('#help').waitFor();
  await page.keyboard.press('Escape');
  assert.ok(await page.locator('#help').isHidden());
}

// Every key that the help lists does something that can be seen in the state or on the page.
async function keys_do_what_the_help_says() {
  await open('&volumeSize=48');
  await page.locator('#picture').focus();
  await page.keyboard.press('?');
  await page.locator('#keys kbd').first().waitFor();
  const listed = await page.locator('#keys kbd').allInnerTexts();
  await page.keyboard.press('Escape');
  await page.evaluate(() => {
    window.open = () => null;
    window.snapshot = () => JSON.stringify([
      window.tetlod.state, window.tetlod.scene.camera(), document.body.className,
      document.documentElement.dataset.theme, Boolean(document.fullscreenElement),
      document.getElementById('help')?.open, window.notices.length
    ]); // a notice may have gone
  });
  const names = { '←': 'ArrowLeft', '↑': 'ArrowUp', '→': 'ArrowRight', '↓': 'ArrowDown', '−': '-', '?': '?' };
  const elsewhere = ['double-click', 'Space', ',', '.']; // the steps of a series: test_player.mjs
  for (const text of listed.filter((t) => !elsewhere.includes(t))) {
    const key = names[text] ?? text.toLowerCase();
    await page.locator('#picture').focus();
    const before = await page.evaluate(() => window.snapshot());
    await page.keyboard.press(key);
    await until((was) => window.snapshot() !== was, before).catch(() => assert.fail(`'${key}' does nothing`));
    if (key === '?') await page.keyboard.press('Escape');
  }
  assert.ok(listed.length > 25, `${listed}`);
  await leave();
}

// The values along a line are the mesh's, within a band of the certified error; both leave as CSV.
async function a_line_is_plotted() {
  await open('');
  await page.locator('#line').check();
  await page.locator('#line-drawing .band').waitFor();
  assert.match(
    await page.locator('#line-words').innerText(), /^Pressure ± [\d.]+ \([\d.]+\u202f%, certified\), length [\d.]+$/);
  const rows = (await download('line-csv')).bytes.toString().trim().split('\n').map((row) => row.split(','));
  assert.deepEqual(rows.shift(), ['distance', 'x', 'y', 'z', 'Pressure', 'at least', 'at most']);
  assert.ok(rows.length > 20);
  const vtp = vtpOf(await download('line-vtp'));
  assert.deepEqual([vtp.points, vtp.lines, Object.keys(vtp.arrays)],
    [rows.length, rows.length / 2, ['Pressure', 'distance', 'at least', 'at most']]);
  const bound = await page.evaluate(() => {
    const { stream, level } = window.tetlod;
    const { range } = stream.info.fields.find((f) => f.name === 'Pressure');
    return stream.info.levels[level].errors.Pressure.max * (range[1] - range[0]);
  });
  for (const row of rows.filter((_, i) => i % 7 === 0)) {
    const [, x, y, z, value, least, most] = row.map(Number);
    const found =
      await page.evaluate(async (point) => (await window.tetlod.stream.probe(point)).values.Pressure[0], [x, y, z]);
    assert.ok(Math.abs(found - value) < 1e-4 * Math.abs(value) + 1e-6, `${value} along the line, ${found} there`);
    assert.ok(Math.abs(most - value - bound) < 1e-9 && Math.abs(value - least - bound) < 1e-9);
  }
  const words = await page.locator('#line-words').innerText();
  const drawing = await page.locator('#line-drawing').boundingBox();
  await page.mouse.move(drawing.x + drawing.width / 2, drawing.y + 40);
  await page.waitForFunction((was) => document.getElementById('line-words').innerText !== was, words);
  assert.match(await page.locator('#line-words').innerText(), /^[\d.]+ ± [\d.]+ at /);
  const curve = await page.locator('#line-drawing .line').getAttribute('d');
  await page.locator('.knob.along').last().press('ArrowUp');
  await page.waitForFunction((was) => document.querySelector('#line-drawing .line').getAttribute('d') !== was, curve);
  await page.setViewportSize({ width: 360, height: 640 }); // on a phone the picture stays free
  const [over, below] = await Promise.all(['#picture', '#line-plot'].map((id) => page.locator(id).boundingBox()));
  assert.ok(below.y >= over.y + over.height && below.y + below.height <= 640, JSON.stringify([over, below]));
  await page.setViewportSize(size);
  await page.locator('#line-close').click();
  assert.equal((await state()).line, null);
  await page.locator('#line-plot').waitFor({ state: 'hidden' });
}

async function values_are_probed() {
  await open('&field=Velocity&slices=z@0.5&surface=off');
  const box = await page.locator('#picture').boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + 0.56 * box.height);
  await page.locator('#probe').getByText(/\|Velocity\| [\d.]+/).waitFor();
  // of the other fields those that were shown
  await page.evaluate(() => window.tetlod.stream.addFields(['Pressure']));
  await page.mouse.move(box.x + box.width / 2 + 1, box.y + 0.56 * box.height);
  await page.locator('#probe').getByText(/Pressure [\d.]+/).waitFor();
  const text = await page.locator('#probe').innerText();
  assert.match(text, /^\|Velocity\| [\d.]+/);
  const [, value] = /\|Velocity\| ([\d.e\u2212]+)/.exec(text);
  const hit = await page.evaluate(async () => {
    const { probe, stream } = window.tetlod;
    return (await stream.probe(probe.world(probe.hit))).values.Velocity;
  });
  assert.ok(Math.abs(Math.hypot(...hit) - Number(value)) < 0.1 * Math.hypot(...hit) + 0.05,
    `${value} is not the length of ${hit}`);
  // without anything under the pointer any more, nothing is said
  await page.keyboard.press('z');
  await until(() => document.getElementById('probe').hidden);
}

// Probes that stay: their values are the mesh's at every level, within the bound, and the distance between them is a
// ruler's.
async function probes_stay() {
  await open('&pins=0.5,0.5,0.25');
  const first = page.locator('#pins .item').first();
  const said = async () =>
    /Pressure ([\d.]+) ± ([\d.]+) \([\d.]+\u202f%, certified\)/.exec(await first.innerText())?.slice(1).map(Number);
  const { bounds } = await infoOf();
  const place = [0.5, 0.5, 0.25].map((x, i) => bounds[0][i] + x * (bounds[1][i] - bounds[0][i]));
  const at = () => page.evaluate(async (p) => (await window.tetlod.stream.probe(p)).values.Pressure[0], place);
  await first.getByText(/±/).waitFor();
  const coarse = await said();
  assert.ok(Math.abs(coarse[0] - await at()) < 1e-4 * coarse[0], `${coarse} is not ${await at()}`);
  await page.evaluate(() => window.tetlod.set({ error: 0 }));
  await settled(page);
  await first.getByText(/exact/).waitFor();
  const exact = Number(/Pressure ([\d.]+)/.exec(await first.innerText())[1]);
  assert.ok(Math.abs(exact - coarse[0]) <= coarse[1] * 1.05, `${exact}, ${coarse}`);
  await page.locator('#add-pin').click();
  const [, pin] = (await state()).pins;
  const apart = Math.hypot(...place.map((c, i) => bounds[0][i] + pin[i] * (bounds[1][i] - bounds[0][i]) - c));
  const told = Number(/([\d.]+) from 1/.exec(await page.locator('#pins .item').nth(1).innerText())[1]);
  assert.ok(Math.abs(told - apart) < 1e-3 * apart, `${told}, not ${apart}`);
  assert.equal(await page.locator('.pin').count(), 2);
  await page.getByLabel('Remove probe 1').click();
  assert.deepEqual((await state()).pins, [pin]);
}

async function fingers_turn_and_probe() {
  const touch =
    await openPage(browser, server.url, { viewport: { width: 390, height: 800 }, hasTouch: true, isMobile: true });
  await open('', touch);
  const box = await touch.locator('#picture').boundingBox();
  await touch.touchscreen.tap(box.x + box.width / 2, box.y + box.height / 2);
  await touch.locator('#probe').waitFor();
  const cdp = await touch.context().newCDPSession(touch);
  const camera = () => touch.evaluate(() => window.tetlod.scene.camera());
  const before = await camera();
  // a frame for each: a busy browser would make one move of several
  const fingers = async (type, points) => {
    const touchPoints = points.map(([x, y], id) => ({ x: box.x + x, y: box.y + y, id }));
    await cdp.send('Input.dispatchTouchEvent', { type, touchPoints });
    await touch.evaluate(() => new Promise((resolve) => requestAnimationFrame(resolve)));
  };
  await fingers('touchStart', [[150, 200]]);
  for (let i = 1; i <= 5; i++) await fingers('touchMove', [[150 + 12 * i, 200 + 4 * i]]);
  await fingers('touchEnd', []);
  await touch.waitForFunction((was) => JSON.stringify(window.tetlod.scene.camera()) !== was, JSON.stringify(before));
  const far = ([x, y, z, fx, fy, fz]) => Math.hypot(x - fx, y - fy, z - fz);
  const turned = await camera();
  assert.ok(Math.abs(far(turned) / far(before) - 1) < 1e-3, 'one finger turns');
  await touch.evaluate(() => { // as where frames are slow; then all pixels are drawn again, with the fingers down
    const { scene } = window.tetlod;
    scene.share = 0.5;
    scene.resize();
  });
  await fingers('touchStart', [[150, 200], [250, 200]]);
  await touch.waitForFunction(() => {
    const { scene } = window.tetlod;
    scene.dispatchEvent(new Event('capture'));
    return scene.share === 1;
  });
  for (let i = 1; i <= 6; i++) await fingers('touchMove', [[150 - 8 * i, 200], [250 + 8 * i, 200]]);
  await fingers('touchEnd', []);
  await touch.waitForFunction((was) => {
    const [x, y, z, fx, fy, fz] = window.tetlod.scene.camera();
    return Math.abs(Math.hypot(x - fx, y - fy, z - fz) / was - 100 / 196) < 0.02; // as far as the fingers went
  }, far(turned));
  await touch.locator('#error').scrollIntoViewIfNeeded();
  const slider = await touch.locator('#error').boundingBox();
  await touch.touchscreen.tap(slider.x + 0.8 * slider.width, slider.y + slider.height / 2);
  await touch.waitForFunction(() => window.tetlod.state.error < 0.01);
  await touch.context().close();
}

await run([
  the_error_has_a_slider_and_two_fields,
  budgets_limit_the_level,
  stopping_leaves_no_hidden_budget,
  received_is_told,
  units_are_typed,
  back_undoes,
  back_is_followed_at_once,
  numbers_that_are_none_change_nothing,
  slow_frames_have_a_number,
  slow_motion_is_coarser,
  measures_are_chosen,
  the_plot_is_dragged,
  fields_and_components,
  ranges_of_the_colours,
  logarithm_map_and_direction,
  a_logarithm_of_what_is_not_positive,
  a_map_from_a_file,
  the_camera_and_the_background,
  axes_have_few_numbers_where_they_belong,
  the_volume_fits_the_window,
  a_second_view_turns_along,
  a_link_shows_the_same,
  what_leaves_the_page,
  surfaces_are_saved,
  the_whole_screen_and_the_panel,
  keys_do_what_the_help_says,
  a_line_is_plotted,
  values_are_probed,
  probes_stay,
  fingers_turn_and_probe,
  nothing_was_complained_of,
], leave);
