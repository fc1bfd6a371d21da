// SPDX-License-Identifier: BSD-3-Clause
// The length of a vector is that of interpolated components, wherever it is shown: slices, isosurfaces, what is
// clipped, lines, grids, arrows, pixels, and the value under the pointer. Held against the mesh's own arrays, in double
// precision.
import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { firstPicture, launch, openPage, settled } from './browser.mjs';
import { ROOT, SCRATCH, program, turningStream } from './hosts.mjs';
import { run } from './tap.mjs';

const built = (name) => pathToFileURL(join(ROOT, 'build/client', name));
const { View, compile } = await import(built('tetlod.js'));
const stream = turningStream();
const view = await View.create(await compile(readFileSync(join(ROOT, 'build/client/tetlod.wasm'))));
view.add(stream.bytes);
const { fields, levels, bounds: [low, high] } = view.describe();
const flow = fields.findIndex(({ name }) => name === 'flow');
view.open(null);
view.seek(levels.length - 1);
const mesh = view.mesh(fields);
const centre = low.map((x, i) => (x + high[i]) / 2);
view.shade(flow, -1);
const lengthAt = (v) => Math.hypot(...mesh.fields.flow.subarray(3 * v, 3 * v + 3));
const longest = Math.max(...Array.from({ length: mesh.positions.length / 3 }, (_, v) => lengthAt(v)));
const normal = [1, 0.7, 0.35];

const triple = (a, b, c) =>
  a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
const corner = (v, list = mesh.positions) => [...list.subarray(3 * v, 3 * v + 3)];
const minus = (a, b) => a.map((x, i) => x - b[i]);
const mean = (rows, weights) => rows[0].map((_, c) => rows.reduce((sum, row, i) => sum + weights[i] * row[c], 0));

// {vector, straight}: the vector at a point, and the mean of the corners' lengths, which is not its length; null
// outside.
function vectorAt(p) {
  for (let t = 0; t < mesh.tets.length; t += 4) {
    const ids = [...mesh.tets.subarray(t, t + 4)];
    const d = ids.map((v) => minus(corner(v), p));
    const parts =
      [triple(d[1], d[2], d[3]), -triple(d[0], d[2], d[3]), triple(d[0], d[1], d[3]), -triple(d[0], d[1], d[2])];
    const whole = parts.reduce((a, b) => a + b);
    const weights = parts.map((x) => x / whole);
    if (whole === 0 || Math.min(...weights) < -1e-7) continue;
    return {
      vector: mean(ids.map((v) => corner(v, mesh.fields.flow)), weights),
      straight: weights.reduce((sum, w, i) => sum + w * lengthAt(ids[i]), 0)
    };
  }
  return null;
}

// The same numbers each time.
let state = 1;
const random = () => { state = (state * 48271) % 2147483647; return state / 2147483647; };

// `count` places in triangles of a part: {point, value}, the value as the picture shows it there.
function placesIn({ points, vectors, triangles, values }, count) {
  assert.equal(vectors.length, 3 * values.length);
  values.forEach((value, v) => assert.ok(Math.abs(value - Math.hypot(...corner(v, vectors))) < 1e-6 * longest));
  return Array.from({ length: count }, () => {
    const t = 3 * Math.floor((random() * triangles.length) / 3);
    const ids = [...triangles.subarray(t, t + 3)];
    const [a, b] = [random(), random()].sort();
    const weights = [a, b - a, 1 - b];
    return {
      point: mean(ids.map((v) => corner(v, points)), weights),
      value: Math.hypot(...mean(ids.map((v) => corner(v, vectors)), weights))
    };
  });
}

// Points of pictures are of single precision.
function holds(part, what) {
  let bent = 0;
  let compared = 0;
  for (const { point, value } of placesIn(part, 150)) {
    const found = vectorAt(point);
    if (!found) continue; // a little outside
    compared++;
    const exact = Math.hypot(...found.vector);
    bent = Math.max(bent, found.straight - exact);
    assert.ok(Math.abs(value - exact) < 2e-5 * longest, `${what}: ${value}, not ${exact}`);
  }
  console.log(`# ${what}: ${compared} places; between lengths of corners it would be ${
    (bent / longest).toFixed(3)} of the longest off`);
  assert.ok(compared > 100 && bent > 0.01 * longest, `${what}: ${compared} places, ${bent}`);
}

async function slices_and_what_is_clipped() {
  holds(view.slice(centre, normal), 'slice');
  view.clip({ origin: centre, normal: [0.3, 1, -0.2] });
  holds(view.slice(centre, normal), 'clipped slice');
  holds(view.surface(), 'clipped boundary');
  view.clip(null);
  holds(view.surface(), 'boundary');
  view.shade(flow, 1);
  assert.equal(view.slice(centre, normal).vectors, null);
  view.shade(flow, -1);
}

// Its places, not only its colours: triangles of an isosurface are near the curved surface.
async function isosurfaces_are_where_the_length_is() {
  for (const value of [0.6 * longest, 0.8 * longest]) {
    const part = view.isosurface(flow, -1, value, { normals: true });
    console.log(`# ${value}: ${part.triangles.length / 3} triangles`);
    assert.ok(view.isNear && part.triangles.length > 300);
    let compared = 0;
    for (const { point } of placesIn(part, 150)) {
      const found = vectorAt(point);
      if (found)
        assert.ok(Math.abs(Math.hypot(...found.vector) - value) < longest / 500,
          `${Math.hypot(...found.vector)}, not ${value}`);
      compared += Boolean(found);
    }
    assert.ok(compared > 100);
    const far = view.isosurface(flow, -1, value, { margin: true });
    for (const { point } of placesIn(far, 150)) {
      const found = vectorAt(point);
      if (found)
        assert.ok(
          Math.hypot(...found.vector) > value - 2e-5 * longest, 'the far side of a zone is not nearer than the value');
    }
  }
  view.shade(0, 0); // another field colours
  const part = view.isosurface(flow, -1, 0.6 * longest, { normals: true });
  assert.equal(part.vectors, null);
  const probe = (v) => view.probe(corner(v, part.points), fields)?.values[fields[0].name][0];
  for (const v of [0, part.values.length >> 1, part.values.length - 1])
    assert.ok(Math.abs(probe(v) - part.values[v]) < 1e-4 * Math.abs(part.values[v]));
  view.shade(flow, -1);
}

async function lines_and_grids() {
  const lineThrough = (from, to) => {
    const ends = view.along(from, to);
    assert.ok(ends.length > 40);
    let bent = 0;
    for (let i = 0; i < 150; i++) {
      const k = 4 * Math.floor(random() * (ends.length / 4));
      const f = random();
      const [at, value] = [0, 1].map((j) => ends[k + j] + f * (ends[k + 2 + j] - ends[k + j]));
      const found = vectorAt(mean([from, to], [1 - at, at]));
      if (!found) continue;
      const exact = Math.hypot(...found.vector);
      bent = Math.max(bent, found.straight - exact);
      assert.ok(Math.abs(value - exact) < 1e-6 * longest, `line: ${value}, not ${exact}`);
    }
    return bent;
  };
  const bends = Array.from({ length: 4 },
    (_, i) => lineThrough(low.map((x, k) => x + (k === 0 ? 0.01 : 0.11 + 0.2 * i) * (high[k] - x)),
      high.map((x, k) => x - (k === 0 ? 0.01 : 0.7 - 0.2 * i) * (x - low[k]))));
  assert.ok(Math.max(...bends) > 0.01 * longest);
  const { dims, origin, spacing, voxels } = view.resample(24, false);
  let compared = 0;
  for (let i = 0; i < voxels.length / 2; i += 7) {
    const at = [i % dims[0], Math.floor(i / dims[0]) % dims[1], Math.floor(i / dims[0] / dims[1])].map(
      (n, k) => origin[k] + n * spacing[k]);
    const found = voxels[2 * i + 1] && vectorAt(at);
    if (!found) continue;
    compared++;
    assert.ok(Math.abs(voxels[2 * i] - Math.hypot(...found.vector)) < 1e-4 * longest,
      `grid: ${voxels[2 * i]}, not ${Math.hypot(...found.vector)}`);
  }
  assert.ok(compared > 100, `${compared} grid points`);
}

async function arrows_have_the_length_of_their_vector() {
  const { Flow } = await import(pathToFileURL(join(ROOT, 'server/web/client/vectors.js')));
  const arrows = new Flow(view.flow(flow, { field: flow, components: 3 }));
  const { tets } = arrows.seeds(150);
  for (const tet of tets) {
    const middle = arrows.middle(tet);
    assert.ok(Math.abs(arrows.shadeAt(middle) - Math.hypot(...arrows.vectorAt(middle))) < 1e-12 * longest);
  }
}

// ---- on the screen

const server = await program([stream.path]);
const browser = await launch();
const page = await openPage(browser, server.url, { viewport: { width: 800, height: 560 } });
const coarse =
  'field=flow&component=magnitude&errorField=heat&error=0&smooth=0&surface=off&sliceEdges=0&range=data&map=viridis';

async function open(stateText) {
  await page.goto('about:blank');
  await page.goto(`${server.url}view/turning#${coarse}${stateText}`);
  await firstPicture(page);
  await settled(page);
}

// [wrong, seen]: of the pixels of a slice, those whose colour is not that of the length there, and all that were looked
// at.
const wrongPixels = () => page.evaluate(async () => {
  const { scene, stream, viewer } = window.tetlod;
  const image = await scene.capture();
  const canvas = Object.assign(document.createElement('canvas'), { width: image.width, height: image.height });
  const context = canvas.getContext('2d', { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  const [from, to] = viewer.colorRange();
  const { log } = viewer.store.state;
  const { table } = scene;
  const result = { wrong: 0, seen: 0, told: 0 };
  for (let y = 60; y < 440; y += 17)
    for (let x = 60; x < 460; x += 19) {
      const hit = scene.pick(x + 0.5, y + 0.5);
      if (!hit) continue;
      const found = await stream.probe(hit.point.map((c, i) => c + scene.centre[i]));
      if (!found) continue;
      const exact = Math.hypot(...found.values.flow);
      result.told = Math.max(result.told, Math.abs(hit.value - exact) / to);
      const place = (value) => (log ? Math.log(value / from) / Math.log(to / from) : (value - from) / (to - from));
      const colour = table[Math.round(Math.min(1, Math.max(0, place(exact))) * (table.length - 1))];
      const pixel = context.getImageData(x, y, 1, 1).data;
      result.seen++;
      if (colour.some((c, i) => Math.abs(c - pixel[i]) > 4)) result.wrong++;
    }
  return result;
});

async function every_pixel_has_the_colour_of_its_length() {
  for (const [what, more] of [['slice', '&slices=z@0.3'],
         ['logarithmic slice', '&slices=z@0.3&log=1&range=manual&low=0.4&high=2'],
         ['clipped boundary', '&surface=solid&clip=y@0.4']]) {
    await open(more);
    await page.evaluate(() => new Promise((resolve) => {
      window.tetlod.scene.addEventListener('render', resolve, { once: true });
      window.tetlod.scene.look('+z');
    }));
    const { wrong, seen, told } = await wrongPixels();
    console.log(`# ${what}: ${wrong} of ${seen} pixels have another colour; the pointer is told ${told} off`);
    writeFileSync(join(SCRATCH, `lengths_${what.replaceAll(' ', '_')}.png`), await page.screenshot());
    writeFileSync(join(SCRATCH, `lengths_${what.replaceAll(' ', '_')}.png`), await page.screenshot());
    assert.ok(seen > 100 && wrong <= 0.02 * seen,
      `${what}: ${wrong} of ${seen} pixels`); // at a silhouette, and where tetrahedra overlap
    assert.ok(told < 1e-4, `${what}: the pointer is told ${told} of the range off`);
  }
  await page.evaluate(() => window.tetlod.set({ field: 'heat', log: false, range: 'data' }));
  await settled(page);
  assert.deepEqual(page.complaints, []);
}

await run([
  slices_and_what_is_clipped, isosurfaces_are_where_the_length_is, lines_and_grids,
  arrows_have_the_length_of_their_vector, every_pixel_has_the_colour_of_its_length
]);
