// SPDX-License-Identifier: BSD-3-Clause
// Values of cells in the package: colours by them, and regions that are left out, against the mesh of the level.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { ROOT, cellStream, fileHost, program } from './hosts.mjs';
import { run } from './tap.mjs';

const { TetlodStream } = await import(pathToFileURL(join(ROOT, 'build/client/stream.js')));
const { path, bytes } = cellStream();
const stream = await TetlodStream.open(new Blob([bytes]));
stream.addEventListener(
  'error', ({ detail }) => assert.fail(detail.message)); // else pictures are waited for that never come
const { info } = stream;
const finest = info.levels.length - 1;
const coarse = info.levels.findIndex((level) => level.tets > 800);
const everything = { surface: true, edges: true, rays: true, volume: { size: 24 }, morph: false,
  slices: [{ origin: [0.3, 0.4, 0.5], normal: [1, 2, 3] }], isosurfaces: [{ field: 'heat', value: 0.7 }] };

async function picturesAt(level, spec) {
  await stream.refineTo({ level });
  for await (const pictures of stream.frames({ ...everything, ...spec })) return pictures;
  return null;
}

const partsOf = ({ surface, slices, isosurfaces }) => [surface, ...slices, ...isosurfaces];
const at = (list, i) => [...list.subarray(3 * i, 3 * i + 3)];
const middle = (points) => [0, 1, 2].map((i) => points.reduce((sum, p) => sum + p[i], 0) / points.length);
const triple = (a, b, c) =>
  a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0]);

async function the_index_names_them() {
  assert.deepEqual(
    info.cellFields.map(({ name, components, type, region, range }) => [name, components, type, region, range]), [
      ['material', 1, 'int8', true, [10, 30]], ['load', 1, 'float32', false, [0, 3071]],
      ['pull', 2, 'float32', false, [-3071, 2]]
    ]);
  const [material, load] = await Promise.all(['material', 'load'].map((name) => stream.cells(name)));
  assert.deepEqual([10, 20, 30].map((m) => material.filter((x) => x === m).length), [1536, 1152, 384]);
  assert.deepEqual([...load].sort((a, b) => a - b), [...load.keys()]);
  await assert.rejects(stream.cells('nothing'), /no values of cells 'nothing'; there are: material, load, pull/);
}

// Every triangle has one value: that of the tetrahedron around a place on its inner side, or around it.
async function triangles_have_the_values_of_their_tetrahedra() {
  const load = await stream.cells('load');
  for (const level of [coarse, finest])
    for (const clip of [null, { origin: [0.6, 0.5, 0.5], normal: [1, 0.2, 0] }]) {
      const pictures = await picturesAt(level, { cellField: 'load', clip });
      assert.deepEqual([pictures.shade.field, pictures.shade.cells], ['load', true]);
      const there = new Set(load.subarray(0, info.levels[level].tets));
      let met = 0;
      for (const { points, values, triangles, lines } of partsOf(pictures)) {
        assert.ok(triangles.length > 0 && lines !== undefined);
        for (let i = 0; i < triangles.length; i += 3) {
          const ids = [...triangles.subarray(i, i + 3)];
          assert.ok(there.has(values[ids[0]]) && ids.every((id) => values[id] === values[ids[0]]));
          const found = i % 21 ? null : await stream.probe(middle(ids.map((id) => at(points, id))));
          if (found) met += found.cells.load[0] === values[ids[0]] ? 1 : -1; // in a face either side is right
        }
      }
      assert.ok(met > 20, `${met} more are right than wrong`);
    }
  const lengths = await picturesAt(finest, { cellField: 'pull', component: 'magnitude' });
  assert.ok(Math.abs(lengths.shade.range[1] - Math.hypot(3071 % 3, 3071)) < 1e-3);
}

async function rays_grid_and_line_have_them_too() {
  const load = (await stream.cells('load')).subarray(0, info.levels[coarse].tets);
  const { rays, volume } = await picturesAt(coarse, { cellField: 'load' });
  assert.deepEqual([...rays.cells.subarray(0, load.length)], [...load]);
  assert.equal(rays.cells.length % 4, 0);
  const there = new Set(load);
  for (let i = 0; i < volume.voxels.length; i += 2) assert.ok(!volume.voxels[i + 1] || there.has(volume.voxels[i]));
  await stream.show({ field: 'heat', cellField: 'load' });
  const { ends } = await stream.line([0, 0.31, 0.42], [1, 0.33, 0.47]);
  assert.ok(ends.length > 20);
  for (let i = 0; i < ends.length; i += 4) {
    const t = (ends[i] + ends[i + 2]) / 2;
    const found = await stream.probe([t, 0.31 + 0.02 * t, 0.42 + 0.05 * t]);
    assert.deepEqual([ends[i + 1], ends[i + 3]], [found.cells.load[0], found.cells.load[0]]);
  }
}

// What is left is enclosed by the surface, at every level: interfaces are the original's.
async function regions_are_left_out() {
  const material = await stream.cells('material');
  for (const level of [0, coarse, finest]) {
    const { surface, slices, rays } =
      await picturesAt(level, { field: 'heat', regions: { field: 'material', hidden: [30, 10] } });
    const mesh = await stream.mesh();
    let volume = 0;
    let kept = 0;
    for (let t = 0; t < mesh.tets.length / 4; t++) {
      if (material[t] !== 20) continue;
      const [a, b, c, d] = [...mesh.tets.subarray(4 * t, 4 * t + 4)].map((v) => at(mesh.positions, v));
      volume += Math.abs(triple(...[a, b, c].map((p) => p.map((x, i) => x - d[i])))) / 6;
      kept++;
    }
    let enclosed = 0;
    for (let i = 0; i < surface.triangles.length; i += 3)
      enclosed += triple(...[0, 1, 2].map((k) => at(surface.points, surface.triangles[i + k]))) / 6;
    assert.ok(Math.abs(volume - 0.375) < 1e-9 && Math.abs(enclosed - volume) < 1e-6, `${enclosed}, ${volume}`);
    assert.equal(rays.corners.length, 4 * kept);
    assert.ok(slices[0].points.length > 0);
    for (let i = 0; i < slices[0].points.length; i += 3) assert.ok(slices[0].points[i] > 0.5 - 1e-6);
  }
  const { surface, shade } = await picturesAt(coarse,
    { cellField: 'material', regions: { field: 'material', hidden: [10] }, threshold: { field: 'heat', low: 1 } });
  assert.deepEqual(new Set(surface.values), new Set([20, 30]));
  assert.deepEqual(shade.range, [10, 30]);
  const none = await picturesAt(coarse, { regions: { field: 'material', hidden: [10, 20, 30] } });
  assert.equal(none.surface.triangles.length, 0);
  await assert.rejects(
    stream.show({ regions: { field: 'load', hidden: [1] } }), /'load' are not whole numbers of one component/);
}

// Tetrahedra are left out by their own values, which other values may colour.
async function a_threshold_is_of_them() {
  const { tets } = info.levels[coarse];
  const load = (await stream.cells('load')).subarray(0, tets);
  const pull = (await stream.cells('pull')).subarray(0, 2 * tets);
  const lengths = Array.from(load, (_, t) => Math.hypot(pull[2 * t], pull[2 * t + 1]));
  for (const [component, values] of [[undefined, load], ['magnitude', lengths]]) {
    const threshold = { cellField: component ? 'pull' : 'load', component, low: 700, high: 2000 };
    const [own, other] = [
      await picturesAt(coarse, { cellField: 'load', threshold }), await picturesAt(coarse, { field: 'heat', threshold })
    ];
    const left = load.filter((_, t) => values[t] >= 700 && values[t] <= 2000);
    assert.ok(left.length > 50 && left.length < tets - 50);
    for (const { rays } of [own, other]) assert.equal(rays.corners.length, 4 * left.length);
    assert.ok(own.surface.values.length && own.surface.values.every((x) => left.includes(x)));
  }
  await assert.rejects(stream.show({ threshold: { cellField: 'heat', low: 1 } }), /no values of cells 'heat'/);
}

// A line has gaps, and a probe no value, where a region or what is beyond a threshold is not drawn.
async function lines_and_probes_are_of_what_is_drawn() {
  const [from, to] = [[0, 0.31, 0.42], [1, 0.31, 0.42]];
  await stream.refineTo({ level: finest });
  await stream.show({ field: 'heat', cellField: 'load', regions: { field: 'material', hidden: [10] } });
  const { ends } = await stream.line(from, to);
  const load = await stream.cells('load');
  const material = await stream.cells('material');
  assert.ok(Math.abs(ends[0] - 0.5) < 1e-9 && Math.abs(ends.at(-2) - 1) < 1e-9, `from ${ends[0]} to ${ends.at(-2)}`);
  for (let i = 1; i < ends.length; i += 2) assert.equal(material[load.indexOf(ends[i])], 20);
  assert.equal(await stream.probe([0.3, 0.31, 0.42]), null);
  const found = await stream.probe([0.7, 0.31, 0.42]);
  assert.deepEqual([found.cells.material, found.cells.load], [[20], [load[found.tet]]]);
  await stream.show({ field: 'heat', threshold: { field: 'heat', low: 0.9 } });
  const rest = (await stream.line(from, to)).ends;
  assert.ok(rest.length > 8 && rest.every((x, i) => i % 2 === 0 || x >= 0.9));
  assert.equal(await stream.probe([0.05, 0.31, 0.42]), null);
  await stream.show(null);
  assert.ok(await stream.probe([0.05, 0.31, 0.42]));
}

// Their bytes come when they are first needed, once; after a failure they can be asked for again.
async function they_come_when_they_are_needed() {
  const host = await fileHost(bytes);
  const remote = await TetlodStream.open(host.url, { retries: 0 });
  const heard = [];
  remote.addEventListener('cells', ({ detail }) => heard.push(detail));
  const { place: [from, size] } = info.cellFields[0];
  const asked = () => host.requests.filter(({ range }) => range === `bytes=${from}-${from + size - 1}`).length;
  assert.equal(asked(), 0);
  host.fault = (request, response) => Boolean(response.writeHead(503).end());
  await assert.rejects(remote.show({ cellField: 'material', surface: true }), /503/);
  host.fault = null;
  await remote.show({ cellField: 'material', surface: true });
  await remote.loadCells('material');
  assert.equal(asked(), 2);
  assert.deepEqual(heard, [{
    field: 'material',
    bytes: size,
    regions: [{ number: 10, tets: 1536 }, { number: 20, tets: 1152 }, { number: 30, tets: 384 }]
  }]);
  assert.equal(remote.receivedCells, size);
  remote.close();
  host.close();
  const server = await program([path]);
  const served = await TetlodStream.open(`${server.url}v1/meshes/cells`, { fields: ['heat'], target: { level: 1 } });
  assert.deepEqual(await served.cells('material'), await stream.cells('material'));
  served.close();
  await server.stop();
}

await run([
  the_index_names_them, triangles_have_the_values_of_their_tetrahedra, rays_grid_and_line_have_them_too,
  regions_are_left_out, a_threshold_is_of_them, lines_and_probes_are_of_what_is_drawn, they_come_when_they_are_needed
]);
stream.close();
