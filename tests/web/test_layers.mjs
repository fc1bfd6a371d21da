// SPDX-License-Identifier: BSD-3-Clause
// Layers against what they promise: the zone of an isosurface, cells within a threshold.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { ROOT, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

const { TetlodStream } = await import(pathToFileURL(join(ROOT, 'build/client/stream.js')));
const stream = await TetlodStream.open(new Blob([sampleStream().bytes]));
const { info } = stream;
const [{ name, range: [low, high] }] = info.fields;
const finest = info.levels.length - 1;

// The pictures of a spec at a level.
async function picturesAt(level, spec) {
  await stream.refineTo({ level });
  for await (const pictures of stream.frames({ field: name, morph: false, ...spec })) return pictures;
  return null;
}

const pointsOf = ({ points }) =>
  Array.from({ length: points.length / 3 }, (_, i) => [...points.subarray(3 * i, 3 * i + 3)]);

// Where the original has the value, a coarse level has it up to the bound; its shells have exactly the bound.
async function the_originals_isosurface_lies_in_the_zone() {
  const value = low + 0.3 * (high - low);
  const original = await picturesAt(finest, { isosurfaces: [{ value, zone: true }] });
  assert.ok(original.zones[0].bound <= info.levels[finest].errors[name].max * (high - low));
  const points = pointsOf(original.isosurfaces[0]).filter((_, i) => i % 5 === 0);
  assert.ok(points.length > 100);
  for (const level of [finest >> 2, finest >> 1]) {
    const { zones: [{ bound, certified, sides }, none] } =
      await picturesAt(level, { isosurfaces: [{ value, zone: true }, { value }] });
    assert.deepEqual([none, certified, bound], [null, true, info.levels[level].errors[name].max * (high - low)]);
    sides.forEach(({ values }, side) => {
      assert.ok(values.length > 10);
      for (const v of values) assert.ok(Math.abs(v - (value + (side ? bound : -bound))) < 1e-5 * high);
    });
    let worst = 0;
    for (const point of points) worst = Math.max(worst, Math.abs((await stream.probe(point)).values[name][0] - value));
    console.log(`# level ${level}: the original's isosurface is up to ${worst} away, within ${bound}`);
    assert.ok(worst <= bound * (1 + 1e-3) && worst > 0.1 * bound, 'within the zone, which is not much too wide');
  }
}

async function a_threshold_leaves_the_cells_in_its_range() {
  const [from, to] = [low + 0.1 * (high - low), low + 0.4 * (high - low)];
  const whole = {
    surface: true,
    slices: [{ origin: info.bounds[0].map((x, i) => (x + info.bounds[1][i]) / 2), normal: [0, 0, 1] }]
  };
  const all = await picturesAt(finest >> 1, whole);
  const { surface, slices } = await picturesAt(finest >> 1, { ...whole, threshold: { low: from, high: to } });
  for (const part of [surface, ...slices]) {
    assert.ok(part.triangles.length > 0);
    for (const v of part.values) assert.ok(v >= from - 1e-5 && v <= to + 1e-5);
  }
  assert.ok(slices[0].triangles.length < all.slices[0].triangles.length);
  // closed: each side of a triangle is one of another, the other way round
  const sides = new Map();
  const { triangles } = surface;
  triangles.forEach((a, i) => {
    const b = triangles[i % 3 === 2 ? i - 2 : i + 1];
    sides.set(`${a} ${b}`, (sides.get(`${a} ${b}`) ?? 0) + 1);
  });
  for (const [side, count] of sides) assert.equal(sides.get(side.split(' ').reverse().join(' ')), count);
  // as many cells as the mesh has in that range: the surface encloses their volume
  const mesh = await stream.mesh();
  const at = (v) => mesh.positions.subarray(3 * v, 3 * v + 3);
  const triple = (a, b, c) =>
    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
  let volume = 0;
  for (let t = 0; t < mesh.tets.length; t += 4) {
    const tet = [...mesh.tets.subarray(t, t + 4)];
    if (!tet.every((v) => mesh.fields[name][v] >= from && mesh.fields[name][v] <= to)) continue;
    const [a, b, c, d] = tet.map(at);
    volume += Math.abs(triple(...[a, b, c].map((p) => p.map((x, i) => x - d[i])))) / 6;
  }
  const points = pointsOf(surface);
  let enclosed = 0;
  for (let i = 0; i < triangles.length; i += 3)
    enclosed += triple(...[0, 1, 2].map((k) => points[triangles[i + k]])) / 6;
  assert.ok(volume > 0 && Math.abs(enclosed - volume) < 1e-3 * volume, `${enclosed}, not ${volume}`);
  const back = await picturesAt(finest >> 1, whole);
  assert.deepEqual(back.surface.triangles, all.surface.triangles);
  await assert.rejects(stream.show({ threshold: { low: 0 } }), /threshold needs a field/);
}

await run([the_originals_isosurface_lies_in_the_zone, a_threshold_leaves_the_cells_in_its_range]);
stream.close();
