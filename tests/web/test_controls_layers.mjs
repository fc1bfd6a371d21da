// SPDX-License-Identifier: BSD-3-Clause
// The controls of the panel's layers: what of the volume is drawn, as surfaces, as arrows and streamlines, and as a
// volume.
import assert from 'node:assert/strict';
import { colorTable } from '../../server/web/page/colors.js';
import { firstPicture, settled } from './browser.mjs';
import {
  becomes,
  changesThePicture,
  enter,
  infoOf,
  leave,
  nothing_was_complained_of,
  open,
  page,
  picture,
  size,
  state,
  until
} from './controls.mjs';
import { run } from './tap.mjs';

const small = { width: 580, height: 480 }; // rays take long where the processor draws

async function layers_are_drawn() {
  await open('');
  for (const surface of ['inside', 'glass', 'off', 'solid'])
    await changesThePicture(`boundary ${surface}`, () => page.locator('#surface').selectOption(surface));
  await changesThePicture('wireframe', () => page.locator('#edges').check());
  await page.locator('#edges').uncheck();
  for (const axis of ['x', 'y', 'z', 'view'])
    await changesThePicture(`slice ${axis}`, () => page.locator(`[data-slice=${axis}]`).click());
  assert.equal((await state()).slices.length, 4);
  assert.equal((await state()).surface, 'inside', 'a solid boundary opens for what is inside');
  await changesThePicture('edges on slices', () => page.locator('#slice-edges').check());
  await changesThePicture(
    'a slice that is moved', () => page.getByLabel('Slice 1: place', { exact: true }).fill('200'));
  await page.getByLabel('Slice 1: place in percent').fill('30 %');
  await page.getByLabel('Slice 1: place in percent').press('Enter');
  assert.equal((await state()).slices[0].at, 0.3);
  const { bounds: [low, high] } = await infoOf();
  await page.getByLabel('Slice 1: coordinate').fill(String(low[0] + 0.6 * (high[0] - low[0])));
  await page.getByLabel('Slice 1: coordinate').press('Enter');
  assert.ok(Math.abs((await state()).slices[0].at - 0.6) < 1e-9);
  await page.getByLabel('Slice 2: across').selectOption('x');
  assert.deepEqual((await state()).slices[1].normal, [1, 0, 0]);
  for (let i = 0; i < 4; i++) await page.getByLabel('Remove slice 1').click();
  assert.equal((await state()).surface, 'solid', 'and closes again');
  for (const axis of ['x', 'y', 'z', 'view'])
    await changesThePicture(`clip ${axis}`, () => page.locator(`[data-clip=${axis}]`).click());
  await changesThePicture('the other side', () => page.getByLabel('Keep the other side').click());
  await changesThePicture('no clip', () => page.getByLabel('Remove clip 1').click());
}

async function a_threshold_leaves_cells() {
  await open('');
  await changesThePicture('a threshold', () => page.locator('#threshold').check());
  await becomes('threshold', [0.5, 1]);
  await changesThePicture('a lower one', () => page.locator('#threshold-low').fill('200'));
  await enter('threshold-most', '6');
  const { fields } = await infoOf();
  const [low, high] = fields[0].range;
  const [from, to] = (await state()).threshold;
  assert.ok(from === 0.2 && Math.abs(to - (6 - low) / (high - low)) < 1e-4, `${from} to ${to}`);
  await settled(page);
  const values = await page.evaluate(() => [...window.tetlod.scene.surface.part.values]);
  assert.ok(values.length > 10 && values.every((x) => x >= low + 0.2 * (high - low) - 1e-4 && x <= 6 + 1e-3));
  await changesThePicture('no threshold', () => page.locator('#threshold').uncheck());
}

async function cells_colour_and_regions_are_hidden() {
  await open('');
  assert.ok(await page.locator('#cells-row').isHidden() && await page.locator('#regions-body').isHidden(),
    'this stream has none');
  await open('', page, 'cells');
  await changesThePicture('colours by values of cells', () => page.locator('#cells').selectOption('material'));
  const values = () => page.evaluate(() => [...new Set(window.tetlod.scene.surface.part.values)].sort());
  assert.deepEqual(await values(), [10, 20, 30]);
  assert.deepEqual(await Promise.all(['low', 'high'].map((id) => page.locator(`#${id}`).inputValue())), ['10', '30']);
  await page.locator('#regions').selectOption('material');
  await page.getByLabel('30 384 cells').waitFor();
  await changesThePicture('a hidden region', () => page.getByLabel('30 384 cells').uncheck());
  await becomes('hidden', [30]);
  assert.deepEqual(await values(), [10, 20]);
  await changesThePicture('and another', () => page.getByLabel(/^10/).uncheck());
  assert.deepEqual(await values(), [20]);
  await until(() => location.hash.includes('cells=material') && location.hash.includes('hidden=10,30'));
  const link = await picture();
  await page.reload();
  await firstPicture(page);
  assert.equal(await picture(), link, 'the link shows the same');
  await page.locator('#regions-hide').click();
  await until(() => !window.tetlod.scene.surface.part.triangles.length);
  await changesThePicture('all again', () => page.locator('#regions-show').click());
  await page.locator('#cells').selectOption('pull');
  await page.locator('#component').selectOption('1');
  await until(() => Number(document.getElementById('low').value) < -3000);
  await page.locator('#cells').selectOption('load');
  await page.locator('#threshold').check();
  await until(() => Math.min(...window.tetlod.scene.surface.part.values) >= 1535.5);
  assert.ok(Math.abs(Number(await page.locator('#threshold-least').inputValue()) - 1535.5) < 1);
  assert.deepEqual(page.complaints, []);
}

async function vectors_are_drawn() {
  await open('');
  const part = () => page.evaluate(() => window.tetlod.scene.vectors[0]?.part.triangles.length ?? 0);
  await changesThePicture('arrows', () => page.locator('#vectors').selectOption('arrows'));
  await until(() => window.tetlod.stream.fields.includes('Velocity') && window.tetlod.scene.vectors.length);
  assert.equal((await state()).surface, 'inside'); // a solid boundary would hide them
  const some = await part();
  await page.locator('#vector-count').fill('500');
  await until((was) => window.tetlod.scene.vectors[0].part.triangles.length < was, some);
  await changesThePicture('streamlines', () => page.locator('#vectors').selectOption('streamlines'));
  assert.equal(await page.locator('#vector-field').inputValue(), 'Velocity');
  assert.ok((await page.locator('#export-part option').allInnerTexts()).includes('vectors 1'));
  const link = await page.evaluate(() => window.tetlod.state);
  assert.ok(link.vectors === 'streamlines' && link.vectorCount < 100);
  await open('&vectors=arrows'); // the field comes after the first picture
  await until(() => window.tetlod.scene.vectors.length);
  await page.locator('#vectors').selectOption('off');
  await until(() => !window.tetlod.scene.vectors.length);
}

async function isosurfaces_are_drawn() {
  await open('');
  await changesThePicture('an isosurface', () => page.locator('#add-isosurface').click());
  await page.locator('#add-isosurface').click();
  assert.deepEqual((await state()).isosurfaces, [0.5, 0.25]);
  await changesThePicture('its value', () => page.getByLabel('Isosurface 1: value').first().fill('300'));
  const number = page.getByLabel('Isosurface 2: value').last();
  await number.fill('2');
  await number.press('Enter');
  const { fields } = await infoOf();
  const [low, high] = fields[0].range;
  assert.ok(Math.abs((await state()).isosurfaces[1] - (2 - low) / (high - low)) < 1e-9);
  await changesThePicture('the zone of the original', () => page.locator('#zone').check());
  assert.match(
    await page.locator('#zone-words').innerText(), /between the shells: ± [\d.]+ \([\d.]+\u202f%, certified\)/);
  await changesThePicture(
    'isosurfaces of another field', () => page.locator('#isosurface-field').selectOption('Density'));
  await changesThePicture('opacity', () => page.locator('#isosurface-opacity').fill('40'));
  await page.getByLabel('Remove isosurface 1').click();
  await changesThePicture('none', () => page.getByLabel('Remove isosurface 1').click());
  assert.equal((await state()).surface, 'solid');
  // lengths of vectors reach over a part of what they could: the first isosurface is where there is one
  await open('&field=Velocity');
  await changesThePicture('an isosurface of the length', () => page.locator('#add-isosurface').click());
  const value = Number(await page.getByLabel('Isosurface 1: value').last().inputValue());
  const [least, most] =
    await page.evaluate(() => ['low', 'high'].map((id) => Number(document.getElementById(id).value)));
  assert.ok(Math.abs(value - (least + most) / 2) < 1e-3 * most, `${value} of ${least} to ${most}`);
  assert.equal(await page.getByLabel('Isosurface 1: value').first().inputValue(), '500');
}

// The largest difference, of 255, between the picture and what the values along the rays give, where nothing else is
// drawn. `behind`: the plane {origin, normal} that clips, or null
const differenceFromRays = (behind) => page.evaluate(async ([clip, map]) => {
  const { stream, scene, state } = window.tetlod;
  scene.box.setVisibility(false);
  const image = await scene.capture();
  const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
  context.drawImage(image, 0, 0);
  const sides = scene.bounds[1].map((h, i) => h - scene.bounds[0][i]);
  const background = scene.renderer.getBackground();
  const [low, high] = scene.range;
  const opacityAt = (x) => {
    const k = Math.max(1, state.opacity.findIndex(([at]) => at >= x));
    const [[a, from], [b, to]] = [state.opacity[k - 1], state.opacity[k]];
    return Math.min(from + ((x - a) / (b - a)) * (to - from), 0.9999);
  };
  const seenAlong = (ends, length) => {
    const seen = [0, 0, 0];
    let light = 1;
    for (let i = 0; i < ends.length; i += 4) {
      const steps = Math.ceil(400 * Math.abs(ends[i + 3] - ends[i + 1]) / (high - low)) + 4;
      for (let k = 0; k < steps; k++) {
        const value = ends[i + 1] + ((k + 0.5) / steps) * (ends[i + 3] - ends[i + 1]);
        const x = Math.min(1, Math.max(0, (value - low) / (high - low)));
        const taken =
          light * (1 - (1 - opacityAt(x)) ** ((ends[i + 2] - ends[i]) * length / steps * 100 / Math.max(...sides)));
        map[Math.round(x * (map.length - 1))].forEach((c, d) => { seen[d] += taken * (c / 255); });
        light -= taken;
      }
    }
    return { seen: seen.map((c, d) => 255 * (c + light * background[d])), opacity: 1 - light };
  };
  let worst = 0;
  let covered = 0;
  for (let x = 20; x < image.width - 20; x += 15)
    for (let y = 90; y < image.height - 120; y += 13) {
      const { from, direction } = scene.ray(x + 0.5, y + 0.5);
      const begin = from.map((c, i) => c + scene.centre[i]);
      const length = 10 * Math.max(...sides);
      let [near, far] = [begin, begin.map((c, i) => c + length * direction[i])];
      if (clip) { // what is before the plane is cut off
        const along = clip.normal.reduce((s, n, i) => s + n * direction[i], 0);
        const at = begin.map((c, i) => c
            + (clip.normal.reduce((s, n, k) => s + n * (clip.origin[k] - begin[k]), 0) / along) * direction[i]);
        if (along < 0) near = at; else far = at;
      }
      const { ends } = await stream.line(near, far);
      const { seen, opacity } = seenAlong(ends, Math.hypot(...far.map((c, i) => c - near[i])));
      const pixel = context.getImageData(x, y, 1, 1).data;
      covered += opacity > 0.2;
      worst = Math.max(worst, ...seen.map((c, d) => Math.abs(c - pixel[d])));
    }
  return { worst, covered };
}, [behind, colorTable('viridis', false, 1025)]);

// Rays through the tetrahedra: the picture is what the values along each ray give, at any level and behind a plane.
async function tetrahedra_are_rendered() {
  await page.setViewportSize(small);
  const middle = { normal: [1, 0, 0], at: 0.5 };
  for (const [more, clip, id] of [['&error=0.2', null], ['&error=0.2&field=Velocity', null],
         ['&error=0&cells=load', null, 'cells'], ['&error=0', null], ['&error=0.01&clip=x@0.5', middle]]) {
    await open(`&volume=1&surface=off&opacity=0:0,0.3:0.05,1:0.4${more}`, page, id);
    await until(() => window.tetlod.scene.rays?.actor.getVisibility());
    await picture();
    const bounds = (await infoOf()).bounds;
    const behind = clip && { normal: clip.normal, origin: bounds[0].map((c, i) => c + clip.at * (bounds[1][i] - c)) };
    const { worst, covered } = await differenceFromRays(behind);
    console.log(`# ${more}: ${covered} places, at most ${worst.toFixed(2)} of 255 from the rays' values`);
    assert.ok(covered > 10 && worst <= 3, `${worst} at most of ${covered}`);
  }
  // a threshold leaves tetrahedra out, what is opaque ends the rays
  await changesThePicture('a threshold', () => page.evaluate(() => window.tetlod.set({ threshold: [0, 0.3] })));
  await changesThePicture(
    'a wall among them', () => page.evaluate(() => window.tetlod.set({ slices: [{ normal: [0, 1, 0], at: 0.2 }] })));
  await page.setViewportSize(size);
}

// The last frame of a move has the finer level's tetrahedra, many of them flat, in the coarser one's shape: it looks as
// that.
async function rays_pass_flat_tetrahedra() {
  await page.setViewportSize({ width: 440, height: 360 });
  await open('&volume=1&surface=off&opacity=0:0,0.3:0.05,1:0.4&error=0.02');
  await until(() => window.tetlod.scene.rays?.actor.getVisibility());
  const moved = () => page.evaluate(() => new Promise((resolve) => {
    const { stream, scene, set } = window.tetlod;
    stream.addEventListener('pictures', function keep({ detail: { t } }) {
      if (t !== 0) return;
      stream.removeEventListener('pictures', keep);
      window.flat = { ...scene.cells, moves: false };
      resolve(scene.cells.corners.length / 4);
    });
    set({ smooth: true, error: 0.1 });
  }));
  const before = await moved();
  await picture();
  const { worst, tets } = await page.evaluate(async () => {
    const { scene } = window.tetlod;
    const pixels = async () => {
      const image = await scene.capture();
      const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
      context.drawImage(image, 0, 0);
      return context.getImageData(0, 0, image.width, image.height).data;
    };
    const coarse = await pixels();
    const now = scene.cells.corners.length / 4;
    scene.rays.update(window.flat);
    const fine = await pixels();
    return { worst: coarse.reduce((most, x, i) => Math.max(most, Math.abs(x - fine[i])), 0), tets: now };
  });
  assert.ok(before > 1.5 * tets, `${before} of which ${tets} are not flat`);
  assert.ok(worst <= 3, `${worst} of 255`);
  await page.setViewportSize(size);
}

async function a_volume_is_rendered() {
  await open('');
  await page.locator('#volume').check();
  await until(() => window.tetlod.scene.rays?.actor.getVisibility());
  await changesThePicture('voxels', () => page.locator('#volume-size').selectOption('96'));
  await until(() => window.tetlod.scene.volume?.actor.getVisibility());
  const before = await picture();
  await page.locator('#transfer').scrollIntoViewIfNeeded();
  const editor = await page.locator('#transfer').boundingBox();
  await page.mouse.dblclick(editor.x + 0.6 * editor.width, editor.y + 0.2 * editor.height);
  assert.equal((await state()).opacity.length, 5);
  assert.ok(await picture() !== before, 'opacities are seen');
  await page.locator('#transfer circle').nth(3).press('Delete');
  assert.equal((await state()).opacity.length, 4);
  await page.locator('#transfer circle').nth(1).press('ArrowUp');
  await changesThePicture('voxels', () => page.locator('#volume-size').selectOption('48'));
  await page.locator('#volume').uncheck();
  await until(() => !window.tetlod.scene.volume.actor.getVisibility());
  assert.equal((await state()).surface, 'solid');
}

await run([
  layers_are_drawn, a_threshold_leaves_cells, cells_colour_and_regions_are_hidden, vectors_are_drawn,
  isosurfaces_are_drawn, tetrahedra_are_rendered, rays_pass_flat_tetrahedra, a_volume_is_rendered,
  nothing_was_complained_of
], leave);
