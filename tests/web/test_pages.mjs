// SPDX-License-Identifier: BSD-3-Clause
// Streams in pages that follow a view of them: which pages, the mesh and its bytes, and what the page makes of it.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { firstPicture, launch, openPage, settled } from './browser.mjs';
import { cellStream, fileHost, folderHost, program, ROOT, SCRATCH, TETLOD } from './hosts.mjs';
import { run } from './tap.mjs';

const { TetlodStream } = await import(pathToFileURL(join(ROOT, 'build/client/stream.js')));
const { choosePages, rangesOf, reaches, scaleOf } = await import('../../server/web/client/pages.js');
const { lookOf } = await import('../../server/web/page/look_here.js');
const side = 24;

function paged(name, sample, ...options) {
  const [mesh, path] = ['vtu', 'tetlod'].map((ending) => join(SCRATCH, `${name}.${ending}`));
  execFileSync(TETLOD, ['sample', ...sample, '-o', mesh], { stdio: 'ignore' });
  execFileSync(TETLOD, ['build', mesh, ...options, '-o', path, '--quiet'], { stdio: 'ignore' });
  return path;
}

const cube = paged('pagedcube', ['cube', '--size', String(side)], '--paged=2000');
const fin = paged('pagedfin', ['fin', '--size', '24'], '--paged=2000', '--field', 'Density', '--field', 'Velocity');
const bytes = readFileSync(cube);

// ---- which pages

const everywhere = { planes: [], eye: [0, 0, 0], near: 1, scale: 100, parallel: false };

// Two levels of four pages along x, of length 1; each page of the second needs the one that it lies in.
const rowsOf = (level) =>
  [0, 1, 2, 3].map((x) => ({
    level,
    low: [x, 0, 0],
    high: [x + 1, 1, 1],
    tets: 10 * level,
    bytes: 100 * level,
    needed: level > 1 ? [x] : [],
  }));
const table = { pages: [...rowsOf(1), ...rowsOf(2)], root: 5, reach: [0.4, 0.1, 0.01] };
const numbers = ({ has }) => [...has.keys()].filter((p) => has[p]);
const chooseOf = (of, look, options) => {
  const whole = { ...everywhere, pixels: 1, tets: 1e9, bytes: 1e9, ...look };
  const scales = of.pages.map(({ low, high }) => scaleOf(whole, low, high));
  return choosePages({ ...of, scales }, whole, options);
};
const choose = (look, options) => chooseOf(table, look, options);

async function pages_are_those_whose_error_is_seen() {
  assert.deepEqual(numbers(choose({ pixels: 100 })), []);
  // 0.4 at distances 1 (the nearest), 1, 2 and 3: 40, 40, 20, 13 pixels; 0.1: 10, 10, 5, 3.3
  assert.deepEqual(numbers(choose({ pixels: 15 })), [0, 1, 2]);
  const near = choose({ pixels: 4 });
  assert.deepEqual([numbers(near), near.worst, near.finest], [[0, 1, 2, 3, 4, 5, 6], 1, 2]);
  assert.ok(Math.abs(near.pixels - 10 / 3) < 1e-12, `${near.pixels}`);
  assert.deepEqual([near.tets, near.bytes, near.refused], [5 + 40 + 60, 400 + 600, 0]);
  // what is not seen is not there, and is no part of the worst
  const half = choose({ pixels: 4, planes: [[-1, 0, 0, 1.5]] });
  assert.deepEqual([numbers(half), half.pixels], [[0, 1, 4, 5], 1]);
  assert.deepEqual(numbers(choose({ pixels: 2, parallel: true, scale: 100 })), [0, 1, 2, 3, 4, 5, 6, 7]);
}

async function budgets_hold_and_the_worst_comes_first() {
  const few = choose({ pixels: 1, tets: 5 + 30 });
  assert.deepEqual([numbers(few), few.tets, few.worst, few.finest], [[0, 1, 2], 35, 0, 1]);
  assert.ok(few.refused > 0 && Math.abs(few.pixels - 40 / 3) < 1e-12);
  const light = choose({ pixels: 1, bytes: 350 });
  assert.ok(light.bytes <= 350 && numbers(light).length === 3);
  // a page comes with those that it needs, or not at all
  const odd = { ...table, reach: [0.001, 0.1, 0.01] };
  assert.deepEqual(numbers(chooseOf(odd, { pixels: 8 })), [0, 1, 4, 5]);
  assert.deepEqual(numbers(chooseOf(odd, { pixels: 8, tets: 5 + 25 })), []);
  // one that makes nothing better comes with others only
  const idle = { ...table, reach: [0.4, 0.4, 0.01] };
  assert.deepEqual(numbers(chooseOf(idle, { pixels: 30 })), [0, 1, 4, 5]);
  const stuck = chooseOf({ ...table, reach: [0.4, 0.4, 0.4] }, { pixels: 1 });
  assert.deepEqual([numbers(stuck), stuck.worst, stuck.pixels], [[], 0, 40]);
  assert.equal(chooseOf(idle, { pixels: 39, planes: [[1, 0, 0, -1.5]] }).worst, 0);
  // while the camera moves, what is there stays where it is needed at rest, what is new is coarser
  assert.deepEqual(numbers(choose({ pixels: 4 }, { times: 4, shown: new Set() })), [0, 1, 2]);
  assert.deepEqual(numbers(choose({ pixels: 4 }, { times: 4, shown: new Set([3, 4, 7]) })), [0, 1, 2, 3, 4]);
}

async function errors_are_lengths_and_near_ranges_are_one() {
  const info = {
    bounds: [
      [0, 0, 0],
      [3, 4, 0],
    ],
    levels: [{ errors: {} }, { errors: { p: { max: 0.1 } }, domainError: 0.2 }, { errors: { p: { max: 0.1 } } }],
  };
  assert.deepEqual(reaches(info, 'p', 'max'), [Infinity, 1, 0.5]);
  assert.deepEqual(
    rangesOf(
      [
        [200, 10],
        [100, 50],
        [0, 0],
        [155, 10],
      ],
      8,
    ),
    [
      { offset: 100, size: 65 },
      { offset: 200, size: 10 },
    ],
  );
  assert.deepEqual(
    rangesOf(
      [
        [0, 10],
        [10, 10],
      ],
      0,
      15,
    ),
    [
      { offset: 0, size: 10 },
      { offset: 10, size: 10 },
    ],
  );
}

// A camera of vtk.js's as far as it is asked.
function camera({ position, to, parallel }) {
  const ahead = to.map((c, i) => c - position[i]);
  const far = Math.hypot(...ahead);
  return {
    getPosition: () => position,
    getDirectionOfProjection: () => ahead.map((c) => c / far),
    getViewUp: () => [0, 0, 1],
    getParallelProjection: () => parallel,
    getViewAngle: () => 30,
    getUseHorizontalViewAngle: () => false,
    getParallelScale: () => 2,
  };
}

async function a_camera_sees_its_pyramid_or_its_box() {
  const size = { height: 600, wide: 1.5, shift: [10, 0, 0], diagonal: 10 };
  const sees = (look, point) => scaleOf(look, point, point);
  const persp = lookOf(camera({ position: [0, 0, 0], to: [0, 10, 0], parallel: false }), size);
  assert.deepEqual(persp.eye, [10, 0, 0]);
  const tangent = Math.tan(Math.PI / 12);
  assert.ok(Math.abs(sees(persp, [10, 5, 0]) - 300 / tangent / 5) < 1e-9);
  for (const [point, seen] of [
    [[10, -1, 0], 0],
    [[10, 5, 5 * 1.04 * tangent], 1],
    [[10, 5, 5 * 1.06 * tangent], 0],
    [[10 - 5 * 1.5 * 1.04 * tangent, 5, 0], 1],
    [[10 + 5 * 1.5 * 1.06 * tangent, 5, 0], 0],
  ])
    assert.equal(sees(persp, point) > 0, Boolean(seen), `${point}`);
  const flat = lookOf(camera({ position: [0, 0, 0], to: [0, 10, 0], parallel: true }), size);
  assert.equal(sees(flat, [10, 50, 0]), 150);
  assert.deepEqual(
    [
      sees(flat, [10, 5, 2.09]) > 0,
      sees(flat, [10, 5, 2.11]) > 0,
      sees(flat, [6.86, 5, 0]) > 0,
      sees(flat, [6.84, 5, 0]) > 0,
    ],
    [true, false, true, false],
  );
}

// ---- the mesh and its bytes

const lookAt = (id, look = {}) => ({
  ...everywhere,
  eye: [30, 30, 30],
  near: 0.1,
  scale: 800,
  pixels: 2,
  tets: 1e6,
  bytes: 64e6,
  field: 'xyz',
  measure: 'max',
  id,
  ...look,
});

// The pictures once a view is followed.
function looked(stream, look) {
  return new Promise((resolve, reject) => {
    stream.addEventListener('error', ({ detail }) => reject(new Error(detail.message)), { once: true });
    const hear = ({ detail }) => {
      if (detail.finer?.look !== look.id || (look.pixels < detail.finer.pixels && look.id !== -1)) return;
      stream.removeEventListener('pictures', hear);
      resolve(detail.finer);
    };
    stream.addEventListener('pictures', hear);
    stream.look(look);
  });
}

// With a volume in the pictures, all that the view takes in is seen.
async function opened(source, field = 'xyz', parts = { surface: true, volume: { size: 2 } }) {
  const stream = await TetlodStream.open(source, { target: { error: 1 }, fields: 'first' });
  await stream.refineTo({ level: stream.info.paged - 1 });
  await stream.show({ field, morph: false, ...parts });
  return stream;
}

// What is hidden, or no part of the pictures, needs no pages: of a cube before the eye, only its front wall is seen;
// with a slice, the pages that it cuts, too; with an isosurface, those in which the value may be.
async function only_what_is_shown_needs_pages() {
  const stream = await opened(new Blob([bytes]), 'xyz', { surface: true });
  const shown = async (id, walls, parts) => {
    await stream.show({ field: 'xyz', morph: false, ...parts });
    await looked(stream, lookAt(id, { eye: [12, -6, 12], scale: 400, pixels: 0.8, walls }));
    const at = async (...place) => (await stream.probe(place)).level;
    return { front: await at(12, 0.4, 12), inside: await at(12, 20, 12), back: await at(12, 23.6, 12) };
  };
  const coarse = stream.info.paged;
  const near = await shown(1, 'near', { surface: true });
  assert.ok(near.front > coarse && near.inside < near.front && near.back < near.front, JSON.stringify(near));
  const far = await shown(2, 'far', { surface: true });
  assert.ok(far.back > near.back && far.front < near.front, JSON.stringify(far));
  const slice = { origin: [12, 20, 12], normal: [0, 1, 0] };
  const cut = await shown(3, 'near', { surface: true, slices: [slice] });
  assert.ok(cut.front === near.front && cut.inside > near.inside, JSON.stringify(cut));
  const iso = await shown(4, 'near', { isosurfaces: [{ value: 12 * 20 * 12 }] });
  assert.ok(iso.inside === cut.inside && iso.front < near.front, JSON.stringify(iso));
  const whole = await shown(5, 'near', { volume: { size: 2 } });
  assert.deepEqual(whole, { front: near.front, inside: cut.inside, back: far.back });
  stream.close();
}

// Faces of one tetrahedron only lie on the cube's boundary: there are no gaps where pages of different levels meet.
function assertWhole({ positions, tets }) {
  const faces = new Map();
  for (let t = 0; t < tets.length; t += 4)
    for (let i = 0; i < 4; i++) {
      const corners = [0, 1, 2, 3].filter((c) => c !== i).map((c) => tets[t + c]);
      const [a, b, c] = [...corners].sort((x, y) => x - y);
      const key = (a * 2 ** 16 + b) * 2 ** 16 + c; // of at most 2^16 vertices
      faces.set(key, faces.has(key) ? null : corners);
    }
  const open = [...faces.values()].filter(Boolean);
  const isAtSide = (corners) =>
    [0, 1, 2].some((axis) => [0, side].some((at) => corners.every((v) => positions[3 * v + axis] === at)));
  assert.ok(open.length > 100, `${open.length} faces`);
  assert.equal(open.filter((corners) => !isAtSide(corners)).length, 0, 'faces inside');
}

const corner = (v) => (i) => v[i];
const tetsNear = ({ positions, tets }, place) => {
  let near = 0;
  for (let t = 0; t < tets.length; t += 4)
    if ([0, 1, 2].every((i) => Math.abs(positions[3 * tets[t] + i] - corner(place)(i)) < side / 3)) near++;
  return near;
};

async function a_view_of_all_is_the_whole_level() {
  const stream = await opened(new Blob([bytes]));
  const finest = stream.info.levels.length - 2;
  const finer = await looked(stream, lookAt(1, { pixels: 1e-9, scale: 1, id: 1 }));
  const mesh = await stream.mesh();
  assert.deepEqual([finer.worst, finer.finest], [finest, finest]);
  await stream.refineTo({ level: finest });
  const uniform = await stream.mesh();
  assert.equal(uniform.level, finest);
  assert.deepEqual(
    [mesh.tets.length, mesh.positions, mesh.fields.xyz].map((a) => a.length ?? a),
    [uniform.tets.length, uniform.positions, uniform.fields.xyz].map((a) => a.length ?? a),
  );
  assert.deepEqual([mesh.positions, mesh.fields.xyz, mesh.tets], [uniform.positions, uniform.fields.xyz, uniform.tets]);
  stream.close();
}

async function what_is_seen_is_fine_and_nothing_cracks() {
  const host = await fileHost(bytes);
  const stream = await opened(host.url);
  const root = stream.info.levels[stream.info.paged - 1];
  const begun = stream.fetched;
  for (const [id, eye] of [
    [1, [26, 26, 26]],
    [2, [26, 12, 12]],
    [3, [-2, -2, -2]],
    [4, [12, 12, 12]],
    [5, [26, 26, 26]],
  ]) {
    const look = lookAt(id, { eye, scale: 200, planes: id === 2 ? [[1, 0, 0, -12]] : [], tets: 60_000 });
    const told = new Promise((resolve) => {
      stream.addEventListener('refined', ({ detail }) => detail.look === id && resolve(detail));
    });
    stream.look(look);
    const finer = await told;
    const mesh = await stream.mesh();
    assertWhole(mesh);
    assert.ok(finer.tets === mesh.tets.length / 4 && finer.tets <= 60_000 && finer.tets > root.tets, `${finer.tets}`);
    const near = await stream.probe(eye.map((c) => Math.min(Math.max(c, 0.5), side - 0.5)));
    const far = await stream.probe([0.5, 23, 0.7]);
    assert.ok(near.level > far.level, `look ${id}: level ${near.level} near, ${far.level} far`);
    assert.ok(near.level >= finer.worst || !finer.planes);
  }
  // a place that was seen before costs nothing
  const ranges = host.requests.slice(-1)[0].range;
  const before = stream.fetched;
  await new Promise((resolve) => {
    stream.addEventListener('refined', ({ detail }) => detail.look === 6 && resolve());
    stream.look(lookAt(6, { eye: [26, 12, 12], scale: 200, planes: [[1, 0, 0, -12]], tets: 60_000 }));
  });
  assert.deepEqual([stream.fetched, host.requests.slice(-1)[0].range], [before, ranges]);
  assert.ok(begun < before && before - begun < 1.3 * bytes.length, `${begun}, ${before} of ${bytes.length}`);
  // and nothing of it is left
  stream.look(null);
  await new Promise((resolve) => {
    stream.addEventListener('pictures', ({ detail }) => detail.finer || resolve());
  });
  assert.equal((await stream.mesh()).tets.length / 4, root.tets);
  stream.close();
  host.close();
}

const placesOf = ({ positions, fields }) =>
  new Map(
    Array.from(fields.xyz, (value, v) => [[...positions.subarray(3 * v, 3 * v + 3)].map(Math.fround).join(), value]),
  );

// A look, and the pictures of the way there; the last one is at rest.
function watched(stream, look) {
  const pictures = [];
  return new Promise((resolve) => {
    const hear = ({ detail }) => {
      pictures.push(detail);
      if (detail.finer?.look !== look.id || detail.t < 1) return;
      stream.removeEventListener('pictures', hear);
      resolve(pictures);
    };
    stream.addEventListener('pictures', hear);
    stream.look(look);
  });
}

// Points and values of a surface that moves, at t: all is linear in it. Null: there are too few pictures of it, as
// where the machine is busy.
function surfaceAt(t, pictures) {
  const [one, other] = [pictures[0], pictures.at(-1)];
  if (!(Math.abs(other?.t - one?.t) > 0.1)) return null;
  const [points, values] = ['points', 'values'].map((key) => {
    const [a, b] = [one, other].map(({ surface }) => surface[key]);
    return Array.from(a, (x, i) => x + ((t - one.t) / (other.t - one.t)) * (b[i] - x));
  });
  return { points, values };
}

function assertAmong({ points, values }, places) {
  const known = [...places.keys()].map((key) => key.split(',').map(Number));
  for (let v = 0; v < values.length; v += 23) {
    const point = points.slice(3 * v, 3 * v + 3);
    const far = (p) => Math.hypot(...p.map((c, i) => c - point[i]));
    const nearest = known.reduce((best, p) => (far(p) < far(best) ? p : best), known[0]);
    assert.ok(far(nearest) < 1e-3, `${point} is no vertex of the other mesh`);
    assert.ok(Math.abs(places.get(nearest.join()) - values[v]) < 1, `${values[v]} at ${point}`);
  }
}

const movedBetween = (from, to) =>
  from.values.filter((_, v) => Math.hypot(...[0, 1, 2].map((i) => from.points[3 * v + i] - to.points[3 * v + i])) > 0.1)
    .length;

// Pages do not pop. One that is new: at first each vertex is where one of the old mesh is, with its value, and goes to
// its own place as time passes. One that leaves: each of its vertices goes to where one of the new mesh is.
async function pages_pass_into_each_other() {
  const stream = await opened(new Blob([bytes]));
  await stream.show({ field: 'xyz', surface: true, morph: true });
  const seen = { come: 0, leave: 0 };
  // where the machine is busy a move may have too few pictures: then the next one is looked at
  for (let id = 1; !(seen.come && seen.leave) && id <= 40; id++) {
    const before = placesOf(await stream.mesh());
    const look = lookAt(id, { eye: [26, 26, 26], pixels: id % 2 ? 1.5 : 4, scale: 200, tets: 60_000 });
    const pictures = await watched(stream, look);
    const rest = pictures.at(-1);
    const moving = pictures.filter(({ t }) => t < 1);
    const [begin, end] = [0, 1].map((t) => surfaceAt(t, moving));
    if (!begin) continue;
    if (id % 2) {
      assertAmong(begin, before);
      assert.ok(end.points.every((x, i) => Math.abs(x - rest.surface.points[i]) < 1e-3));
      seen.come += movedBetween(begin, end) > 10;
    } else {
      assert.ok(moving.every(({ t, finer }, i) => finer.look !== id && (!i || t < moving[i - 1].t)));
      assertAmong(begin, placesOf(await stream.mesh()));
      assertAmong(end, before);
      seen.leave += movedBetween(begin, end) > 10;
    }
  }
  assert.ok(seen.come && seen.leave, JSON.stringify(seen));
  stream.close();
}

// Boxes of a stream in pages: their pages alone come, from any host that knows ranges; a view may be followed, too.
async function boxes_bring_their_pages() {
  const host = await fileHost(bytes);
  const stream = await opened(host.url, 'xyz', { surface: true });
  const begun = stream.fetched;
  const root = stream.info.levels[stream.info.paged - 1];
  const shown = async (boxes, look = null) => {
    const told = new Promise((resolve) => {
      const hear = ({ detail }) => {
        if (detail.boxLevel === undefined || (look && detail.look !== look.id)) return;
        stream.removeEventListener('refined', hear);
        resolve(detail);
      };
      stream.addEventListener('refined', hear);
    });
    if (look) stream.look(look);
    await stream.show({ field: 'xyz', surface: true, morph: false, refine: { boxes, target: { error: 0.0004 } } });
    const finer = await told;
    assertWhole(await stream.mesh());
    return finer;
  };
  const level = async (...place) => (await stream.probe(place)).level;
  const first = await shown([[20, 20, 20, 24, 24, 24]]);
  const wanted = first.boxLevel;
  assert.ok(stream.info.levels[wanted - 1].errors.xyz.max > 0.0004 && wanted > stream.info.paged);
  assert.deepEqual([first.refused, first.worst, first.finest], [0, stream.info.paged - 1, wanted]);
  assert.ok((await level(22, 22, 22)) === wanted && (await level(20.2, 23.8, 21)) === wanted);
  assert.ok((await level(1, 1, 1)) < wanted && first.tets < 0.8 * stream.info.levels[wanted].tets);
  assert.ok(stream.fetched - begun < 0.8 * (stream.info.levels[wanted].bytes - root.bytes), `${stream.fetched}`);
  await shown([[0, 0, 0, 4, 4, 4]]);
  assert.equal(await level(1, 1, 1), wanted);
  const both = await shown([[0, 0, 0, 4, 4, 4]], lookAt(1, { eye: [30, 30, 30], pixels: 3, scale: 400 }));
  assert.ok((await level(1, 1, 1)) === wanted && (await level(23.5, 23.5, 23.5)) > stream.info.paged);
  assert.ok(both.look === 1 && both.pixels <= 3);
  stream.look(null);
  await stream.show({ field: 'xyz', surface: true, morph: false });
  await new Promise((resolve) => {
    stream.addEventListener('pictures', ({ detail }) => detail.finer || resolve());
  });
  assert.equal((await stream.mesh()).tets.length / 4, root.tets);
  stream.close();
  host.close();
}

// With what else is drawn of them: values of cells, hidden regions, slices, a clip box.
async function boxes_of_pages_have_cells_and_regions() {
  cellStream();
  const [source, path] = ['cells.vtk', 'pagedcells.tetlod'].map((name) => join(SCRATCH, name));
  const options = ['--paged=100', '--bands', 'fine', '--field', 'heat', '--region', 'material', '--quiet'];
  execFileSync(TETLOD, ['build', source, ...options, '-o', path]);
  const stream = await opened(new Blob([readFileSync(path)]), 'heat', { surface: true });
  const refine = { boxes: [[0, 0, 0, 0.5, 0.5, 0.5]], target: { error: 0 } };
  const show = async (tag, spec) => {
    const drawn = new Promise((resolve) => {
      const hear = ({ detail }) => {
        if (detail.tag !== tag || detail.finer?.boxLevel === undefined) return;
        stream.removeEventListener('pictures', hear);
        resolve();
      };
      stream.addEventListener('pictures', hear);
    });
    await stream.show({ field: 'heat', surface: true, morph: false, refine, tag, ...spec });
    await drawn;
  };
  await show(1, { cellField: 'load' });
  const [load, material] = [await stream.cells('load'), await stream.cells('material')];
  const levels = [];
  for (const place of [0.1, 0.3, 0.95].map((c) => [c, c + 0.01, c + 0.02])) {
    const { tet, cells, level } = await stream.probe(place);
    assert.deepEqual([cells.load, cells.material], [[load[tet]], [material[tet]]]);
    levels.push(level);
  }
  assert.ok(levels[0] === levels[1] && levels[0] > levels[2], `${levels}`);
  const regions = { field: 'material', hidden: [30] };
  const slices = [{ origin: [0.5, 0.5, 0.25], normal: [0, 0, 1] }];
  await show(2, { cellField: 'material', regions, slices, box: [0, 0, 0, 1, 1, 0.7] });
  const { positions, tets, numbers: originals } = await stream.drawn();
  assert.ok(originals.length > 100 && originals.every((number) => material[number] !== 30));
  let volume = 0;
  for (let t = 0; t < tets.length; t += 4) {
    const [a, b, c, d] = [0, 1, 2, 3].map((k) => positions.subarray(3 * tets[t + k], 3 * tets[t + k] + 3));
    const [u, v, w] = [b, c, d].map((p) => [...p].map((x, i) => x - a[i]));
    const normal = u.map((_, i) => u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]);
    volume += Math.abs(normal.reduce((sum, n, i) => sum + n * w[i], 0)) / 6;
  }
  assert.ok(Math.abs(volume - (0.7 - 0.5 * 0.5 * 0.2)) < 1e-9, `${volume}`);
  stream.close();
}

async function bytes_are_given_back() {
  const stream = await opened(new Blob([bytes]));
  const sides = [
    [1, 0, 0, -16],
    [-1, 0, 0, 8],
    [0, 1, 0, -16],
    [0, -1, 0, 8],
  ];
  for (const [id, plane] of sides.entries()) {
    const look = lookAt(id + 1, { eye: [12, 12, 12], pixels: 0.5, planes: [plane], bytes: 25_000 });
    const told = await new Promise((resolve) => {
      stream.addEventListener('refined', ({ detail }) => detail.look === look.id && resolve(detail));
      stream.look(look);
    });
    assert.ok(told.held <= 25_000 && told.bytes <= 25_000 && told.bytes > 1000, JSON.stringify(told));
  }
  stream.close();
}

async function a_host_that_fails_is_told_and_asked_again() {
  const host = await fileHost(bytes);
  const stream = await TetlodStream.open(host.url, { target: { error: 1 }, retries: 0 });
  await stream.refineTo({ level: stream.info.paged - 1 });
  await stream.show({ field: 'xyz', surface: true });
  host.fault = (request, response) => {
    response.writeHead(404).end();
    return true;
  };
  const failed = new Promise((resolve) => {
    stream.addEventListener('error', ({ detail }) => resolve(detail.message), { once: true });
  });
  stream.look(lookAt(1));
  assert.match(await failed, /pages are missing: .*404/);
  host.fault = null;
  const told = new Promise((resolve) => {
    stream.addEventListener('refined', ({ detail }) => detail.look === 2 && resolve(detail));
  });
  stream.look(lookAt(2));
  assert.ok((await told).pages > 0);
  stream.close();
  host.close();
}

const server = await program([cube, fin]);

// Of a server that leaves fields out: pages have those that are decoded, and one that comes later, too.
async function from_a_server_field_by_field() {
  const stream = await opened(`${server.url}v1/meshes/pagedfin`, 'Density');
  const {
    bounds: [low, high],
  } = stream.info;
  const middle = low.map((c, i) => (c + high[i]) / 2);
  const look = lookAt(1, { eye: middle, near: 0.5, scale: 300, field: 'Density', pixels: 3 });
  const told = (id) =>
    new Promise((resolve) => {
      stream.addEventListener('refined', ({ detail }) => detail.look === id && resolve(detail));
    });
  const first = told(1);
  stream.look(look);
  const { pages } = await first;
  assert.ok(pages > 8, `${pages} pages`);
  const found = await stream.probe(middle);
  assert.ok(
    found.level > stream.info.paged - 1 && found.values.Density && !found.values.Velocity,
    JSON.stringify(found),
  );
  const again = told(1);
  await stream.addFields(['Velocity']);
  assert.equal((await again).pages, pages);
  const both = await stream.probe(middle);
  assert.deepEqual([both.values.Density, both.level], [found.values.Density, found.level]);
  assert.equal(both.values.Velocity.length, 3);
  stream.close();
}

// ---- the page

const browser = await launch();
const page = await openPage(browser, server.url, { viewport: { width: 800, height: 560 } });
const finerOf = () => page.evaluate(() => window.tetlod.viewer.finer);

// Looks from somewhere, and waits until the pages are there.
async function from(position, focus) {
  const before = await page.evaluate(() => window.tetlod.viewer.looking);
  await page.evaluate(
    (camera) => {
      window.tetlod.scene.setCamera(camera);
      window.tetlod.scene.cameraRests();
    },
    [...[position, focus].flatMap((p) => p.map((c) => c - side / 2)), 0, 0, 1],
  );
  await page.waitForFunction((id) => window.tetlod.viewer.looking > id && window.tetlod.settled, before);
  return finerOf();
}

// Of a picture that a wall of the cube fills: how many pixels are the background's.
const backgroundPixels = () =>
  page.evaluate(async () => {
    const image = await window.tetlod.scene.capture();
    const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
    context.drawImage(image, 0, 0);
    const pixels = new Uint32Array(context.getImageData(0, 0, image.width, image.height).data.buffer);
    return pixels.reduce((n, p) => n + (p === 0xffffffff), 0);
  });

async function flying_loads_what_is_seen() {
  await page.goto(`${server.url}view/pagedcube#pixels=20&surface=solid&slices=&axes=0&background=white&smooth=0`);
  await firstPicture(page);
  await settled(page);
  const { levels, paged: first } = await page.evaluate(() => window.tetlod.viewer.info);
  // along a wall, whose picture it fills
  for (const x of [20, 12, 4]) {
    const finer = await from([x, -3, 12], [x, 0, 12]);
    const uniform = levels[finer.finest];
    assert.ok(finer.pixels <= 20, `${finer.pixels} pixels`);
    assert.ok(finer.finest >= first && finer.tets < 0.8 * uniform.tets, `${finer.tets} of ${uniform.tets} at ${x}`);
    const held = finer.bytes + levels[first - 1].bytes;
    assert.ok(held < 0.8 * uniform.bytes, `${held} of ${uniform.bytes}`);
    assert.equal(await backgroundPixels(), 0, 'the background is seen through the wall');
    const levelAt = async (place) => (await page.evaluate((p) => window.tetlod.stream.probe(p), place)).level;
    assert.ok((await levelAt([x, 0.5, 12])) > (await levelAt([x, 23.5, 12])), 'it is finest where one looks');
  }
}

// Flies along a wall that fills every picture, while pages come, leave, and pass into each other: what is the
// background's in all frames together, and how many of them there were, of a mesh that moved.
const flyAlong = (places) =>
  page.evaluate(async (all) => {
    const { scene, viewer } = window.tetlod;
    const gl = scene.view.get3DContext();
    const seen = { frames: 0, moving: 0, background: 0 };
    const count = () => {
      const [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
      const pixels = new Uint32Array(w * h);
      gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(pixels.buffer));
      for (const pixel of pixels) seen.background += pixel === 0xffffffff;
      seen.frames++;
    };
    const hear = ({ detail }) => {
      seen.moving += detail.t < 1;
    };
    scene.addEventListener('render', count);
    viewer.addEventListener('pictures', hear);
    for (const place of all) {
      scene.setCamera(place);
      await new Promise(requestAnimationFrame);
    }
    scene.cameraRests();
    for (let i = 0; i < 3; i++) await new Promise(requestAnimationFrame);
    await new Promise((resolve) => {
      const look = () => (window.tetlod.settled ? resolve() : requestAnimationFrame(look));
      look();
    });
    scene.removeEventListener('render', count);
    viewer.removeEventListener('pictures', hear);
    return seen;
  }, places);

async function nothing_cracks_on_the_way() {
  const whole = { frames: 0, moving: 0, background: 0 };
  await page.evaluate(() => window.tetlod.set({ smooth: true, pixels: 8 }));
  const at = (x, z) => [x - side / 2, -3 - side / 2, z - side / 2, x - side / 2, -side / 2, z - side / 2, 0, 0, 1];
  for (let flight = 0; flight < 12 && (flight < 2 || !whole.moving); flight++) {
    const [from, to] = flight % 2 ? [18, 4] : [4, 18];
    const heights = Array.from({ length: 12 }, (_, i) => 12 + 2 * Math.sin(i + flight));
    const places = heights.map((z, i) => at(from + ((to - from) * i) / 11, z));
    const seen = await flyAlong(places);
    for (const key in whole) whole[key] += seen[key];
  }
  assert.ok(whole.frames > 20 && whole.moving > 0, JSON.stringify(whole));
  assert.equal(whole.background, 0, JSON.stringify(whole));
  await page.evaluate(() => window.tetlod.set({ surface: 'off' }));
  await settled(page);
  assert.ok((await flyAlong([at(12, 12), at(12, 13)])).background > 1000, 'nothing is seen where nothing is');
  await page.evaluate(() => window.tetlod.set({ surface: 'solid', smooth: false, pixels: 20 }));
  await from([4, -3, 12], [4, 0, 12]);
}

// Where frames are slow, here by a clock that runs fast, a picture that moves has fewer pixels; at rest it has all.
async function slow_frames_have_fewer_pixels() {
  await page.waitForFunction(() => window.tetlod.scene.share === 1); // at rest
  const widths = await page.evaluate(() => {
    const { scene } = window.tetlod;
    const camera = scene.renderer.getActiveCamera();
    const seen = [scene.view.getCanvas().width];
    let time = performance.now();
    performance.now = () => time;
    for (let frame = 0; frame < 8; frame++) {
      time += 80;
      camera.setPosition(...camera.getPosition().map((c) => c + 0.01));
      scene.dispatchEvent(new Event('render'));
      seen.push(scene.view.getCanvas().width);
    }
    window.shot = scene.capture();
    camera.setPosition(...camera.getPosition().map((c) => c + 0.01));
    scene.dispatchEvent(new Event('render'));
    delete performance.now;
    return seen;
  });
  const [full] = widths;
  assert.equal(await page.evaluate(async () => (await window.shot).width), full, 'a saved picture has all pixels');
  await page.evaluate(() => window.tetlod.scene.cameraRests());
  assert.ok(widths.at(-1) <= full / 4 + 1, `${widths}`); // at once, if frames were slow before
  await page.waitForFunction((width) => window.tetlod.scene.view.getCanvas().width === width, full);
  await settled(page);
}

async function the_panel_and_the_link_tell_it() {
  const finer = await finerOf();
  const { error, level } = await page.evaluate(() => ({
    error: document.getElementById('shown-error').innerText,
    level: document.getElementById('shown-level').innerText,
  }));
  const shown = await page.evaluate((worst) => window.tetlod.viewer.info.levels[worst].errors.xyz.max, finer.worst);
  assert.ok(Math.abs(parseFloat(error) / 100 / shown - 1) < 0.01, `${error}, not ${shown}`);
  assert.equal(level.trim(), `${finer.worst}–${finer.finest}`);
  assert.match(
    await page.locator('#look-words').innerText(),
    new RegExp(`^${finer.pages} pages, .* held\\. The worst place in the picture is .* pixels off`),
  );
  await page.waitForFunction(() => /pixels=20/.test(location.hash) && /camera=/.test(location.hash));
  const again = await openPage(browser, server.url, { viewport: { width: 800, height: 560 } });
  await again.goto(page.url());
  await firstPicture(again);
  await again.waitForFunction(() => window.tetlod.viewer.looking && window.tetlod.settled);
  const other = await again.evaluate(() => window.tetlod.viewer.finer);
  assert.deepEqual(
    [other.pages, other.tets, other.worst, other.finest],
    [finer.pages, finer.tets, finer.worst, finer.finest],
  );
  await again.context().close();
}

async function it_is_switched_by_the_keyboard() {
  await page.locator('#look-on').focus();
  await page.keyboard.press('Space');
  await page.waitForFunction(() => !window.tetlod.viewer.finer && window.tetlod.settled);
  assert.ok(!/pixels=/.test(await page.evaluate(() => window.tetlod.viewer.fragment)));
  await page.keyboard.press('Space');
  await page.waitForFunction(() => window.tetlod.viewer.finer && window.tetlod.settled);
  await page.locator('#look-pixels').fill('40');
  await page.keyboard.press('Enter');
  await page.waitForFunction(() => window.tetlod.state.pixels === 40 && window.tetlod.settled);
  assert.deepEqual([page.complaints, page.strangers], [[], []]);
}

// <tetlod-view pixels>: pages follow its camera, and it tells the worst place of what is seen.
async function the_element_follows_pages() {
  const host = await folderHost(join(ROOT, 'build/client'));
  const other = await openPage(browser, host.origin, { viewport: { width: 800, height: 600 } });
  await other.goto(`${host.origin}/empty.html`);
  await other.evaluate(() => import('./element.js'));
  await other.evaluate((url) => {
    document.body.innerHTML = `<tetlod-view src="${url}" pixels="3" state="surface=solid&slices=&smooth=0"
      controls="bar readout"></tetlod-view>`;
    window.told = [];
    document.querySelector('tetlod-view').addEventListener('level', ({ detail }) => window.told.push(detail));
  }, `${server.url}v1/meshes/pagedcube`);
  const next = (seen) =>
    other.waitForFunction((n) => window.told.length > n && window.told.at(-1).pages > 0 && window.told.at(-1), seen);
  const first = await (await next(0)).jsonValue();
  const readout = await other.locator('[part="readout"]').innerText();
  assert.match(readout, / in the picture; elsewhere /);
  assert.ok(readout.replace(/[^0-9]/g, '').endsWith(String(first.tets)), `${readout}: ${first.tets}`);
  await other.locator('tetlod-view').hover();
  for (let i = 0; i < 4; i++) await other.mouse.wheel(0, -300);
  await other.waitForFunction(
    ([pages, level]) => window.told.at(-1).pages !== pages && window.told.at(-1).level >= level,
    [first.pages, first.level],
  );
  await other.evaluate(() => document.querySelector('tetlod-view').removeAttribute('pixels'));
  await other.waitForFunction(() => window.told.at(-1).pages === undefined);
  await other.evaluate(() => {
    document.querySelector('tetlod-view').setAttribute('pixels', '2');
    document.querySelector('tetlod-view').remove(); // on its way
  });
  while (other.workers().length) await other.evaluate(() => new Promise(requestAnimationFrame));
  assert.deepEqual(other.complaints, []);
  await other.context().close();
  host.close();
}

// In the page: a click refines there, with slices and a clip box, too, and Back undoes it.
async function a_click_refines_in_pages_and_back_undoes() {
  await page.goto('about:blank');
  await page.goto(`${server.url}view/pagedcube#error=0.05&surface=solid&slices=&smooth=0`);
  await firstPicture(page);
  await settled(page);
  await page.waitForFunction(() => document.getElementById('refine'));
  const written = (pattern) => page.waitForFunction((p) => new RegExp(p).test(location.hash), pattern);
  const boxLevel = async (least) => {
    const found = await page.waitForFunction((n) => {
      const level = window.tetlod.viewer.finer?.boxLevel;
      return level > n && level;
    }, least);
    return found.jsonValue();
  };
  await page.keyboard.down('Shift');
  await page.mouse.dblclick(340, 360);
  await page.keyboard.up('Shift');
  const first = await boxLevel(0);
  await written('refine=.*@0.005');
  assert.match(await page.locator('#refine-words').innerText(), new RegExp(`pages have level ${first} in boxes`));
  assert.match(await page.locator('#promise').innerText(), /; in boxes xyz ≤ .* \(certified\)$/);
  await page.locator('#refine-error').fill('0.04');
  await page.keyboard.press('Enter');
  const second = await boxLevel(first);
  await written('refine=.*@0.0004');
  await page.evaluate(() => window.tetlod.set({ slices: [{ normal: [1, 0, 0], at: 0.4 }], box: [0, 0, 0, 1, 1, 0.7] }));
  await written('slices=.*box=|box=.*slices=');
  await settled(page);
  assert.equal(await boxLevel(0), second);
  await page.goBack();
  await page.waitForFunction(() => !window.tetlod.state.box && window.tetlod.state.refine);
  await page.goBack();
  await page.waitForFunction((level) => window.tetlod.viewer.finer?.boxLevel === level, first);
  await page.goBack();
  await page.waitForFunction(() => !window.tetlod.state.refine && !window.tetlod.viewer.finer);
  assert.deepEqual([page.complaints, page.strangers], [[], []]);
}

// What the device's memory is not for can be looked at in parts.
async function a_stream_that_is_too_large_is_offered_in_pages() {
  const small = await openPage(browser, server.url, { viewport: { width: 800, height: 560 } });
  await small.addInitScript(() => Object.defineProperty(navigator, 'deviceMemory', { get: () => 0.01 }));
  await small.goto(`${server.url}view/pagedcube#error=0`);
  await small.getByRole('button', { name: 'Detail where I look' }).click();
  await small.waitForFunction(() => window.tetlod?.state.pixels === 2 && window.tetlod.settled);
  assert.equal(await small.getByRole('button', { name: 'Load it' }).count(), 0);
  assert.deepEqual(small.complaints, []);
  await small.context().close();
}

await run([
  pages_are_those_whose_error_is_seen,
  budgets_hold_and_the_worst_comes_first,
  errors_are_lengths_and_near_ranges_are_one,
  a_camera_sees_its_pyramid_or_its_box,
  a_view_of_all_is_the_whole_level,
  only_what_is_shown_needs_pages,
  what_is_seen_is_fine_and_nothing_cracks,
  pages_pass_into_each_other,
  boxes_bring_their_pages,
  boxes_of_pages_have_cells_and_regions,
  bytes_are_given_back,
  a_host_that_fails_is_told_and_asked_again,
  from_a_server_field_by_field,
  flying_loads_what_is_seen,
  nothing_cracks_on_the_way,
  slow_frames_have_fewer_pixels,
  the_panel_and_the_link_tell_it,
  it_is_switched_by_the_keyboard,
  a_click_refines_in_pages_and_back_undoes,
  the_element_follows_pages,
  a_stream_that_is_too_large_is_offered_in_pages,
]);
