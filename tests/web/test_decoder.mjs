// SPDX-License-Identifier: BSD-3-Clause
// The decoder of the browser gives the same bits as the C library: every golden stream, every level, up and down.
import assert from 'node:assert/strict';
import { createHash } from 'node:crypto';
import { readFileSync, readdirSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { run } from './tap.mjs';

const root = process.env.ROOT ?? '.';
const built = join(root, 'build/client');
const { View, compile } = await import(pathToFileURL(join(built, 'tetlod.js')));
const module = await compile(readFileSync(join(built, 'tetlod.wasm')));
const golden = join(root, 'tests/golden');
const names = readdirSync(golden).filter((name) => name.endsWith('.tetlod'));
const read = (name) => readFileSync(join(golden, name));

async function viewOf(bytes, step = bytes.length) {
  const view = await View.create(module);
  for (let at = 0; at < bytes.length; at += step) view.add(bytes.subarray(at, at + step));
  return view;
}

// As tests/unit/test_golden.c: positions, tetrahedra, fields.
function hash(view, fields) {
  const { positions, tets, fields: values } = view.mesh(fields);
  const sum = createHash('sha256').update(positions).update(tets);
  for (const { name } of fields) sum.update(values[name]);
  return sum.digest('hex');
}

async function everyGoldenStreamEveryLevelUpAndDown() {
  assert.ok(names.length >= 7);
  for (const name of names) {
    const view = await viewOf(read(name));
    const { fields, levels } = view.describe();
    const expected = readFileSync(join(golden, `${name}.levels`), 'utf8').trim().split('\n');
    assert.equal(expected.length, levels.length, name);
    view.open(null);
    const walk = [...levels.keys(), ...[...levels.keys()].reverse()];
    for (const k of walk) {
      view.seek(k);
      assert.equal(view.level, k);
      assert.equal(hash(view, fields), expected[k], `${name}, level ${k}`);
    }
  }
}

async function bytesInAnyPieces() {
  const bytes = read('grid_float32.tetlod');
  const expected = readFileSync(join(golden, 'grid_float32.tetlod.levels'), 'utf8').trim().split('\n');
  for (const step of [1, 7, 1000]) {
    const view = await View.create(module);
    let opened = false;
    let reached = -1;
    for (let at = 0; at < bytes.length; at += step) {
      const there = view.add(bytes.subarray(at, at + step));
      if (view.ready < 0) continue;
      assert.ok(there);
      if (!opened) view.open(null);
      opened = true;
      const { levels, fields } = view.describe();
      assert.equal(view.ready, levels.findLastIndex((level) => level.bytes <= at + step));
      for (; reached < view.ready; reached++) {
        view.seek(reached + 1);
        assert.equal(hash(view, fields), expected[reached + 1]);
      }
    }
    assert.equal(reached, expected.length - 1);
  }
}

async function onlySomeFields() {
  const view = await viewOf(read('grid_float32.tetlod'));
  const { fields } = view.describe();
  assert.ok(fields.length > 1);
  view.open([1]);
  view.seek(1);
  assert.deepEqual(Object.keys(view.mesh(fields).fields), [fields[1].name]);
  const inside = [0, 1, 2].map(
    (i) => [0, 1, 2, 3].reduce((sum, c) => sum + view.mesh([]).positions[3 * view.mesh([]).tets[c] + i] / 4, 0));
  assert.deepEqual(Object.keys(view.probe(inside, fields).values), [fields[1].name]);
}

async function damageSaysWhere() {
  const bytes = Buffer.from(read('grid_float32.tetlod'));
  const whole = await viewOf(bytes);
  const { levels } = whole.describe();
  bytes[levels[2].offset + 10] ^= 4;
  const view = await viewOf(bytes);
  view.open(null);
  view.seek(1);
  const before = view.mesh([]);
  assert.throws(() => view.seek(3), /checksum/);
  assert.equal(view.level, 1);
  assert.deepEqual(view.mesh([]), before);
  await assert.rejects(viewOf(Buffer.from('<!doctype html><title>not found</title>'.repeat(9))), /not a tetlod stream/);
}

async function aMoveEndsAtBothLevels() {
  const view = await viewOf(read('grid_float32.tetlod'));
  const { fields } = view.describe();
  const [{ name }] = fields;
  view.open(null);
  view.seek(1);
  const coarse = view.mesh(fields);
  view.seek(3);
  const fine = view.mesh(fields);
  view.shade(0, 0);
  const atRest = view.surface();
  view.move(1);
  view.place(0);
  view.shade(0, 0);
  const start = view.surface();
  // every point of the boundary is one of the coarser level's vertices, with its value
  const known = new Set();
  for (let v = 0; v < coarse.positions.length / 3; v++)
    known.add([...new Float32Array([...coarse.positions.subarray(3 * v, 3 * v + 3), coarse.fields[name][v]])].join());
  for (let v = 0; v < start.values.length; v++)
    assert.ok(known.has([...start.points.subarray(3 * v, 3 * v + 3), start.values[v]].join()), `point ${v}`);
  assert.deepEqual(start.triangles, atRest.triangles);
  assert.notDeepEqual(start.points, atRest.points);
  view.place(0.5);
  view.shade(0, 0);
  const half = view.surface();
  half.points.forEach((x, i) => assert.ok(Math.abs(x - (start.points[i] + atRest.points[i]) / 2) < 1e-6));
  // it is a copy: the view may go on
  view.seek(5);
  assert.deepEqual(view.surface(), half);
  view.place(1);
  view.shade(0, 0);
  assert.deepEqual(view.surface(), atRest);
  view.seek(3);
  assert.deepEqual(view.mesh(fields), fine);
  view.rest();
  view.shade(0, 0);
  assert.deepEqual(view.surface(), atRest);
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const point = (points, v) => [...points.subarray(3 * v, 3 * v + 3)];

// The finest level: coarser ones of this stream overlap themselves.
async function oneLevel() {
  const view = await viewOf(read('grid_float32.tetlod'));
  const { fields, levels, bounds: [low, high] } = view.describe();
  view.open(null);
  view.seek(levels.length - 1);
  view.shade(0, 0);
  return { view, fields, low, high, centre: low.map((x, i) => (x + high[i]) / 2), mesh: view.mesh(fields) };
}

async function partsAreWhereTheyShouldBe() {
  const { view, fields, centre } = await oneLevel();
  const normal = [1, -0.5, 0.25];
  const behind = (p) => dot(p, normal) - dot(centre, normal);
  const slice = view.slice(centre, normal, { lines: true });
  view.clip({ origin: centre, normal });
  const clipped = view.surface({ lines: true });
  view.clip(null);
  const whole = view.surface({ lines: true });
  assert.ok(slice.values.length && clipped.triangles.length && clipped.values.length !== whole.values.length);
  for (let v = 0; v < slice.values.length; v++) assert.ok(Math.abs(behind(point(slice.points, v))) < 1e-5);
  for (let v = 0; v < clipped.values.length; v++) assert.ok(behind(point(clipped.points, v)) < 1e-5);
  for (const part of [slice, clipped, whole]) {
    assert.ok(part.lines.length && part.lines.every((v) => v < part.values.length));
    assert.ok(part.triangles.every((v) => v < part.values.length));
  }
  const again = view.surface({ keep: true });
  assert.deepEqual(again.points, whole.points);
  assert.ok(!('triangles' in again) && !('lines' in again));
  const [low, high] = fields[0].range;
  const value = (low + high) / 2;
  const iso = view.isosurface(0, 0, value, { normals: true });
  assert.ok(iso.triangles.length);
  iso.values.forEach((v) => assert.ok(Math.abs(v - value) < 1e-5 * (high - low)));
  for (let v = 0; v < iso.values.length; v++)
    assert.ok(Math.abs(dot(point(iso.normals, v), point(iso.normals, v)) - 1) < 1e-5);
}

const sum = (part, of) =>
  Array.from({ length: part.triangles.length / 3 }, (_, t) => of(...part.triangles.subarray(3 * t, 3 * t + 3)))
    .reduce((a, b) => a + b, 0);

function areaOf(part) {
  return sum(part, (...corners) => {
    const [a, b, c] = corners.map((v) => point(part.points, v));
    const u = b.map((x, i) => x - a[i]);
    const v = c.map((x, i) => x - a[i]);
    return Math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
  });
}

// Both sides of a plane together are the whole, of slices and isosurfaces; and each is on its side, with the values
// that it had.
async function clippedPartsAddUp() {
  const { view, fields, centre } = await oneLevel();
  const [low, high] = fields[0].range;
  const value = low + 0.4 * (high - low);
  const normal = [1, 0.3, -0.2];
  const makers = [
    () => view.slice(centre, [0, 0, 1], { lines: true, normals: true }),
    () => view.isosurface(0, 0, value, { lines: true, normals: true })
  ];
  for (const make of makers) {
    view.clip(null);
    const whole = make();
    const halves = [1, -1].map((sign) => {
      const towards = normal.map((x) => sign * x);
      view.clip({ origin: centre, normal: towards });
      const part = make();
      for (let v = 0; v < part.values.length; v++) {
        assert.ok(dot(point(part.points, v), towards) - dot(centre, towards) < 1e-5);
        assert.ok(Math.abs(Math.hypot(...point(part.normals, v)) - 1) < 0.5);
      }
      assert.ok(part.lines.length && part.lines.every((v) => v < part.values.length));
      assert.ok(part.triangles.length && part.triangles.every((v) => v < part.values.length));
      return part;
    });
    assert.ok(halves.every((part) => areaOf(part) > 0.01 * areaOf(whole)));
    assert.ok(Math.abs(areaOf(halves[0]) + areaOf(halves[1]) - areaOf(whole)) < 1e-4 * areaOf(whole));
    const mean = (part) => sum(part, (a, b, c) => part.values[a] + part.values[b] + part.values[c]);
    assert.ok(
      mean(whole) > 0 && Math.min(...halves[0].values, ...halves[1].values) >= Math.min(...whole.values) - 1e-6);
  }
  view.clip(null);
}

async function volumesAreClippedAndLogarithmic() {
  const { view, centre } = await oneLevel();
  view.clip(null);
  const plain = view.resample(24, false);
  const logarithmic = view.resample(24, true);
  const normal = [0.6, 0.8, 0];
  view.clip({ origin: centre, normal });
  const clipped = view.resample(24, false);
  view.clip(null);
  const { dims, origin, spacing, voxels } = plain;
  let hidden = 0;
  let least = Infinity;
  for (let i = 0; i < voxels.length / 2; i++) {
    const at = [i % dims[0], Math.floor(i / dims[0]) % dims[1], Math.floor(i / dims[0] / dims[1])].map(
      (n, k) => origin[k] + n * spacing[k]);
    const distance = dot(at, normal) - dot(centre, normal);
    const step = dot(spacing, normal);
    const seen = voxels[2 * i + 1];
    assert.ok(seen === 0 || seen === 1);
    assert.equal(clipped.voxels[2 * i], voxels[2 * i]);
    assert.ok(Math.abs(clipped.voxels[2 * i + 1] - seen * Math.min(Math.max(0.5 - distance / step, 0), 1)) < 1e-5);
    hidden += seen && distance > step;
    if (!seen) continue;
    least = Math.min(least, voxels[2 * i]);
    assert.ok(Math.abs(logarithmic.voxels[2 * i] - Math.log10(voxels[2 * i])) < 1e-5);
  }
  assert.ok(hidden > 50);
  assert.equal(plain.range[0], least);
  // a grid is kept while it is that of the same mesh and values
  assert.deepEqual(view.resample(24, false), plain);
  view.shade(1, 0);
  assert.notDeepEqual(view.resample(24, false).voxels, voxels);
  view.seek(1);
  assert.deepEqual(view.resample(24, false).range, [0, 0]); // no value is chosen
  view.shade(0, 0);
  assert.ok(view.resample(24, false).range[1] > 0);
  assert.ok(Math.abs(logarithmic.range[0] - Math.log10(least)) < 1e-5 && logarithmic.logarithmic && !plain.logarithmic);
}

async function probesAndGridsAgreeWithTheMesh() {
  const { view, fields, low, high, mesh } = await oneLevel();
  for (const tet of [0, 7, 100]) {
    const corners = [...mesh.tets.subarray(4 * tet, 4 * tet + 4)];
    const mean = (values, components) =>
      Array.from({ length: components }, (_, c) => corners.reduce((sum, v) => sum + values[components * v + c] / 4, 0));
    const found = view.probe(mean(mesh.positions, 3), fields);
    assert.equal(found.tet, tet);
    for (const { name, components } of fields)
      mean(mesh.fields[name], components).forEach((x, c) => assert.ok(Math.abs(x - found.values[name][c]) < 1e-9));
  }
  assert.equal(view.probe(high.map((x, i) => x + (x - low[i])), fields), null);
  const { dims, origin, spacing, voxels } = view.resample(20, false);
  const count = dims[0] * dims[1] * dims[2];
  assert.equal(Math.max(...dims), 20);
  assert.equal(voxels.length, 2 * count);
  const [{ name, range }] = fields;
  let compared = 0;
  for (let i = 0; i < count; i++) {
    const at = [i % dims[0], Math.floor(i / dims[0]) % dims[1], Math.floor(i / dims[0] / dims[1])];
    const found = view.probe(at.map((n, k) => origin[k] + n * spacing[k]), fields);
    if (!voxels[2 * i + 1] || !found) continue;
    compared++;
    assert.ok(Math.abs(found.values[name][0] - voxels[2 * i]) < 1e-4 * (range[1] - range[0]), `grid point ${at}`);
  }
  assert.ok(compared > count / 4);
}

// wasm32 ends at 4 GiB: that is an error that says so, not a crash. The memory is reserved, never touched.
async function memoryHasAnEnd() {
  const { exports } =
    await WebAssembly.instantiate(module, { wasi_snapshot_preview1: { fd_close() {}, fd_seek() {}, fd_write() {} } });
  exports._initialize();
  const view = new View(exports);
  const bytes = read('grid_float32.tetlod');
  view.add(bytes);
  view.open(null);
  const { fields } = view.describe();
  const taken = [];
  for (let size = 2 ** 30; size >= 16; size >>>= 1)
    for (let block; (block = exports.view_allocate(size)); ) taken.push(block);
  assert.ok(exports.memory.buffer.byteLength > 3.9 * 2 ** 30);
  assert.throws(() => view.add(bytes), /out of memory/);
  assert.throws(() => view.seek(3), /out of memory/);
  assert.throws(() => view.surface(), /out of memory/);
  taken.forEach((block) => exports.view_release(block));
  view.seek(3);
  const expected = readFileSync(join(golden, 'grid_float32.tetlod.levels'), 'utf8').split('\n')[3];
  assert.equal(hash(view, fields), expected);
}

await run([
  everyGoldenStreamEveryLevelUpAndDown, bytesInAnyPieces, onlySomeFields, damageSaysWhere, aMoveEndsAtBothLevels,
  partsAreWhereTheyShouldBe, clippedPartsAddUp, volumesAreClippedAndLogarithmic, probesAndGridsAgreeWithTheMesh,
  memoryHasAnEnd
]);
