// SPDX-License-Identifier: BSD-3-Clause
// The page's modules that need no browser: the state and its fragment, levels, geometry, numbers.
import assert from 'node:assert/strict';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { run } from './tap.mjs';

const load = (name) => import(pathToFileURL(join(process.env.ROOT ?? '.', 'server/web/page', name)));
const { Store, defaults, fromFragment, toFragment } = await load('state.js');
const { isosurfaceRange, specOf, targetOf } = await load('spec.js');
const { measureFor, titleWithUnit, unitOf, wantedLevel } = await load('levels.js');
const { errorSpan, promiseOf, wordsOfBound } = await load('promises.js');
const { clipToWindow, dot, linesBehind, pickPart, planeOf, planeOutline, sidesOf } = await load('geometry.js');
const { autoRange, firstView, histogram, mapOf } = await load('first_view.js');
const { colorTable, isMap, lineColor, mapNames } = await load('colors.js');
const { categoriesOf } = await load('categories.js');
const { mapOfFile } = await load('color_file.js');
const { Groups } = await load('../client/steps.js');
const { Pace } = await load('../client/pace.js');
const { Source } = await load('../client/network.js');
const { Flow, drawVectors } = await load('../client/vectors.js');
const { bytes, count, parseNumber, percent, significant, ticks } = await load('numbers.js');

function a_state_survives_its_fragment() {
  assert.equal(toFragment(defaults), '');
  assert.deepEqual(fromFragment(''), { ...defaults });
  const state = {
    ...defaults,
    error: 0.003,
    measure: 'rms',
    errorField: 'q',
    shading: 'all',
    maxTets: 5000,
    pixels: 2.5,
    maxBytes: 2.5e6,
    field: 'Größe & mehr=x',
    component: 2,
    formula: 'q * 2',
    units: 'q=m/s',
    range: 'manual',
    low: -1.25,
    high: 3e-7,
    log: true,
    cells: 'material',
    regions: 'part',
    hidden: [-2, 7],
    map: 'cividis',
    reversed: true,
    surface: 'glass',
    edges: true,
    slices: [{ normal: [0, 1, 0], at: 0.25 }, { normal: [0.6, 0, -0.8], at: 1 }],
    sliceEdges: true,
    isosurfaces: [0, 0.5],
    isosurfaceField: 'T',
    isosurfaceOpacity: 0.4,
    zone: true,
    threshold: [0.1, 0.75],
    clip: { normal: [1, 0, 0], at: 0 },
    box: [0, 0.25, 0, 1, 0.5, 1],
    vectors: 'arrows',
    vectorField: 'Größe',
    vectorCount: 77,
    vectorSize: 2.5,
    seeds: 'line',
    second: 'field=T&slices=x@0.5',
    line: [0, 0.25, 0.5, 1, 0.75, 0.5],
    pins: [[0.5, 0, 1], [0.25, 0.75, 0.125]],
    notes: ['', 'hot; & = spot'],
    step: 7,
    warp: 'u',
    warpScale: -2.5,
    outline: true,
    volume: true,
    volumeSize: 64,
    refine: { boxes: [[0, 0.25, 0.5, 0.5, 0.75, 1], [0, 0, 0, 1, 1, 1]], error: 0.002 },
    other: 'https://host/a b.tetlod',
    compare: 'curtain',
    curtain: 0.3,
    opacity: [[0, 0.5], [1, 0]],
    background: 'black',
    axes: false,
    parallel: true,
    smooth: false,
    camera: [1, 2, 3, 0, 0, 0, 0, 0, 1],
  };
  for (const key of Object.keys(defaults)) assert.notDeepEqual(state[key], defaults[key], `${key} is not tested`);
  assert.deepEqual(fromFragment(toFragment(state)), state);
}

// A cube of n³ small cubes of six tetrahedra, with a field given by its values at points.
function cubeWith(n, vectorAt) {
  const number = (x, y, z) => x + (n + 1) * (y + (n + 1) * z);
  const vertices = [];
  const vectors = [];
  for (let z = 0; z <= n; z++) for (let y = 0; y <= n; y++) for (let x = 0; x <= n; x++) {
    const p = [x, y, z].map((c) => (2 * c) / n - 1);
    vertices.push(...p, p[0]);
    vectors.push(...vectorAt(p));
  }
  const corners = [];
  for (let z = 0; z < n; z++) for (let y = 0; y < n; y++) for (let x = 0; x < n; x++)
    for (const order of [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]]) {
      const at = [x, y, z];
      corners.push(number(...at));
      for (const axis of order) {
        at[axis]++;
        corners.push(number(...at));
      }
    }
  const faces = new Map();
  const neighbours = new Uint32Array(corners.length).fill(0xffffffff);
  corners.forEach((_, slot) => {
    const tet = slot - (slot % 4);
    const key = corners.slice(tet, tet + 4).filter((_, i) => i !== slot % 4).sort((a, b) => a - b).join();
    if (faces.has(key)) [neighbours[slot], neighbours[faces.get(key)]] = [faces.get(key), slot];
    else faces.set(key, slot);
  });
  return new Flow({
    vertices: Float32Array.from(vertices),
    corners: Uint32Array.from(corners),
    neighbours,
    vectors: Float64Array.from(vectors)
  });
}

// A field that turns about the z axis is linear, so that its streamlines are circles, and helices where it rises.
function streamlines_follow_the_field() {
  const flow = cubeWith(6, ([x, y]) => [-y, x, 0.1]);
  const { tets, volume } = flow.seeds(40);
  assert.equal(tets.length, 40);
  assert.ok(Math.abs(volume - 8) < 1e-9);
  for (const octant of [0, 1])
    assert.ok(Math.abs(tets.filter((tet) => flow.middle(tet).point[2] > 0 === Boolean(octant)).length - 20) < 3);
  for (const seed of tets) {
    const places = flow.streamline(flow.middle(seed), 0.05);
    const radius = ({ point: [x, y] }) => Math.hypot(x, y);
    const from = radius(flow.middle(seed));
    for (const at of places) {
      assert.ok(Math.abs(radius(at) - from) < 1e-4, `${radius(at)}, not ${from}`);
      assert.ok(Math.abs(flow.shadeAt(at) - at.point[0]) < 1e-6);
    }
    const [low, high] = [places[0], places.at(-1)].map(({ point }) => point[2]);
    assert.ok(high > low && places.length > (from < 0.9 ? 30 : 1), `${places.length} places, from ${low} to ${high}`);
    if (from < 0.99) assert.ok(high > 0.95 && low < -0.95, 'it ends within the mesh');
  }
  const still = cubeWith(2, () => [0, 0, 0]);
  assert.equal(drawVectors(still, { kind: 'streamlines', count: 5 }, 1).points.length, 0);
}

// Places that somebody chose: each is found in its tetrahedron, those outside of the mesh are left out.
function vectors_are_at_chosen_places() {
  const flow = cubeWith(4, ([x, y]) => [3, 0, y > 0 ? 4 : 0]);
  const places = [[0.1, 0.2, 0.3], [5, 0, 0], [-0.9, 0.9, -0.9], [0, 0, 0]];
  const found = flow.find(places);
  assert.deepEqual(found.map(({ point }) => point), [places[0], places[2], places[3]]);
  for (const at of found) assert.ok(Math.abs(flow.shadeAt(at) - at.point[0]) < 1e-6 && Math.min(...at.weights) > -1e-9);
  const draw = (more) => drawVectors(flow, { kind: 'arrows', count: 50, places, ...more }, 1);
  const xs = ({ points }) => [...points.filter((_, i) => i % 3 === 0)];
  const reach = (part) => Math.max(...xs(part)) - Math.min(...xs(part));
  assert.equal(draw().points.length, (3 * drawVectors(flow, { kind: 'arrows', count: 50 }, 1).points.length) / 50);
  assert.ok(reach(draw({ places: [places[0]], size: 2 })) > 1.9 * reach(draw({ places: [places[0]] })));
  const tubes = drawVectors(flow, { kind: 'streamlines', count: 1, places: [places[0]], size: 3 }, 1);
  assert.ok(tubes.points.length > 300);
}

function seeds_lie_on_the_line_or_the_slice() {
  const fields = [{ name: 'v', components: 3, range: [0, 1] }];
  const info = { bounds: [[0, 0, 0], [2, 4, 8]], levels: [{ errors: {} }], cellFields: [], fields };
  const state = { ...defaults, field: 'v', vectors: 'arrows', vectorCount: 9 };
  const places = (patch) => specOf({ ...state, ...patch }, info).vectors.places;
  assert.equal(places({}), null);
  assert.equal(places({ seeds: 'line' }), null);
  const line = places({ seeds: 'line', line: [0, 0.5, 0, 1, 0.5, 0] });
  assert.deepEqual([line.length, line[4]], [9, [1, 2, 0]]);
  const slice = places({ seeds: 'slice', slices: [{ normal: [0, 0, 1], at: 0.25 }] });
  assert.equal(slice.length, 9);
  assert.ok(slice.every(([x, y, z]) => x > 0 && x < 2 && y > 0 && y < 4 && Math.abs(z - 2) < 1e-12));
  assert.equal(new Set(slice.map((p) => p.map((c) => c.toFixed(6)).join())).size, 9);
  assert.deepEqual(specOf({ ...state, box: [0, 0.25, 0, 1, 0.5, 1] }, info).box, [0, 1, 0, 2, 2, 8]);
}

function categories_have_colours_of_their_own() {
  const colorOf = (map, value, [low, high]) => {
    const list = map.split('-');
    return list[Math.round(((value - low) / (high - low)) * (list.length - 1))];
  };
  const range = [10, 40];
  const map = categoriesOf(range, [10, 20, 30, 40]);
  assert.ok(isMap(map) && isMap('categories'));
  const colors = [10, 20, 30, 40].map((n) => colorOf(map, n, range));
  assert.equal(new Set(colors).size, 4);
  assert.equal(colorOf(map, 23, range), colors[1]);
  const all = categoriesOf([0, 10]);
  assert.equal(new Set(Array.from({ length: 11 }, (_, n) => colorOf(all, n, [0, 10]))).size, 11);
  assert.equal(mapOf({ map: 'auto' }, [0, 1], true), 'categories');
}

function arrows_point_along_the_field() {
  const flow = cubeWith(4, ([x, y]) => [3, 0, y > 0 ? 4 : 0]);
  const { points, values, triangles, normals } = drawVectors(flow, { kind: 'arrows', count: 50 }, 1);
  const each = points.length / 50;
  assert.ok(each > 30 && normals.length === points.length && triangles.every((corner) => corner < values.length));
  for (let i = 0; i < 50; i++) {
    const end = (at) => points.subarray(at, at + 15).reduce((sum, c, k) => (sum[k % 3] += c / 5, sum), [0, 0, 0]);
    const [tail, tip] = [end(each * i), end(each * (i + 1) - 15)];
    const way = tip.map((c, k) => c - tail[k]);
    const [x, , z] = way;
    assert.ok(x > 0 && Math.abs(way[1]) < 1e-4 && (Math.abs(z) < 1e-4 || (z > 0 && z < 1.34 * x)), `${way}`);
  }
}

// What is before the plane is cut off, and only that: the area behind it and the area before it are the whole's.
function a_plane_cuts_arrows() {
  const flow = cubeWith(4, ([x, y]) => [3, 0, y > 0 ? 4 : 0]);
  const areaOf = (clip) => {
    const { points, values, triangles, normals } = drawVectors(flow, { kind: 'arrows', count: 50 }, 1, clip);
    assert.ok(normals.length === points.length && points.length === 3 * values.length);
    let sum = 0;
    for (let i = 0; i < triangles.length; i += 3) {
      const [a, b, c] = [0, 1, 2].map((k) => [...points.subarray(3 * triangles[i + k], 3 * triangles[i + k] + 3)]);
      for (const p of [a, b, c]) assert.ok(!clip || clip.normal[0] * (p[0] - clip.origin[0]) < 1e-6);
      const [u, v] = [b, c].map((p) => p.map((x, k) => x - a[k]));
      sum += Math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
    }
    return sum;
  };
  const [whole, ...sides] =
    [null, [1, 0, 0], [-1, 0, 0]].map((normal) => areaOf(normal && { origin: [0.1, 0, 0], normal }));
  assert.ok(sides.every((side) => side > 0.2 * whole) && Math.abs(sides[0] + sides[1] - whole) < 1e-5 * whole,
    `${sides} of ${whole}`);
}

// Colours at equal distances stand for what they were taken from, which does not always round.
function maps_are_those_they_are_named_after() {
  const require = createRequire(join(process.env.ROOT ?? '.', 'server/web/package.json'));
  const original = require('d3-scale-chromatic');
  const turned = (at) => (t) => at(1 - t);
  const known = {
    viridis: original.interpolateViridis,
    cividis: original.interpolateCividis,
    inferno: original.interpolateInferno,
    magma: original.interpolateMagma,
    plasma: original.interpolatePlasma,
    turbo: original.interpolateTurbo,
    blueRed: turned(original.interpolateRdBu),
    orangePurple: original.interpolatePuOr,
    grey: turned(original.interpolateGreys)
  };
  const own = ['coolWarm', 'categories'];
  assert.deepEqual(mapNames.map(([map]) => map).filter((map) => !own.includes(map)), Object.keys(known));
  const channels = (css) =>
    (css[0] === '#' ? [1, 3, 5].map((i) => parseInt(css.slice(i, i + 2), 16)) : css.match(/\d+/g).map(Number));
  for (const [map, at] of Object.entries(known))
    colorTable(map, false, 65).forEach((color, i) => channels(at(i / 64)).forEach((c, k) =>
      assert.ok(Math.abs(c - color[k]) <= 2, `${map} at ${i}: ${color}, not ${at(i / 64)}`)));
}

// The same map as a preset of ParaView, as lines, and with places that are not even.
function maps_from_files() {
  const wanted = '0000ff-808080-ff0000';
  const preset = [{ Name: 'x', RGBPoints: [-2, 0, 0, 1, 0, 0.5, 0.5, 0.5, 2, 1, 0, 0] }];
  for (const text of [JSON.stringify(preset), JSON.stringify(preset[0]), 'r,g,b\n0,0,255\n128,128,128\n255,0,0\n',
         '5 0 0 1\n6 .5 .5 .5\n7 1 0 0'])
    assert.equal(mapOfFile(text), wanted);
  assert.deepEqual(
    colorTable(wanted, false, 5), [[0, 0, 255], [64, 64, 192], [128, 128, 128], [192, 64, 64], [255, 0, 0]]);
  assert.deepEqual(colorTable(wanted, true, 3)[0], [255, 0, 0]);
  const uneven = mapOfFile('0 0 0 0\n1 1 1 1\n4 1 1 1').split('-');
  assert.deepEqual(
    [uneven.length, uneven[0], uneven[4], uneven[8], uneven[32]], [33, '000000', '808080', 'ffffff', 'ffffff']);
  for (const text of ['', '{}', '[{"RGBPoints": [1, 2]}]', 'one two three', '1 1 1'])
    assert.throws(() => mapOfFile(text), /no colours/);
  assert.equal(fromFragment(`#map=${wanted}`).map, wanted);
  assert.equal(fromFragment('#map=0000ff-80').map, 'auto');
}

function a_broken_fragment_gives_defaults() {
  const written =
    '#error=-1&measure=best&slices=q@0.5;x@7;y@0.5;0,0,0@0.5&isosurfaces=2,nothing,0.5&threshold=0.5,2&pins=2,0,0;0,1;x'
    + '&clip=x&volumeSize=1e9&opacity=0:0&component=-3&camera=1,2&unknown=1&low=a';
  const state = fromFragment(written);
  assert.deepEqual(
    state, { ...defaults, slices: [{ normal: [0, 1, 0], at: 0.5 }], isosurfaces: [0.5], volumeSize: 256 });
}

// What a stream's first view shows is its default: a link holds what differs from that, and what was taken away.
function a_link_is_of_what_differs_from_the_first_view() {
  const base = { ...defaults, ...firstView({ bounds: [[0, 0, 0], [3, 1, 2]], fields: [] }) };
  assert.deepEqual([base.surface, base.slices], ['inside', [{ normal: [0, 1, 0], at: 0.5 }]]);
  assert.equal(toFragment(base, base), '');
  assert.deepEqual(fromFragment('', base), base);
  for (const state of [{ ...base, slices: [] }, { ...base, surface: 'solid' },
         { ...base, slices: [...base.slices, { normal: [1, 0, 0], at: 0.1 }] }])
    assert.deepEqual(fromFragment(toFragment(state, base), base), state);
  assert.equal(toFragment({ ...base, slices: [] }, base), '#slices=');
}

function colours_chosen_from_the_data() {
  const even = Float32Array.from({ length: 1000 }, (_, i) => i / 999);
  assert.deepEqual(autoRange([0, 1], even), [0, 1]);
  assert.deepEqual(autoRange([0, 1], undefined), [0, 1]);
  // a few values far above all others are beyond the end
  const tailed = Float32Array.from(even, (x, i) => (i > 995 ? 100 : x)).sort();
  const [low, high] = autoRange([0, 100], tailed);
  assert.ok(low >= 0 && low < 0.02 && high > 0.98 && high < 1, `${low} to ${high}`);
  assert.deepEqual(autoRange([5, 5], new Float32Array(100).fill(5)), [5, 5]);
  // both signs: zero in the middle, in a diverging map; not where one side is a trace
  assert.deepEqual(autoRange([-1, 3], even.map((x) => 4 * x - 1)).map(Math.round), [-3, 3]);
  assert.deepEqual([[-1, 3], [-0.01, 3], [0, 1], [-2, 0]].map((range) => mapOf({ map: 'auto' }, range)),
    ['coolWarm', 'viridis', 'viridis', 'viridis']);
  assert.equal(mapOf({ map: 'magma' }, [-1, 1]), 'magma');
  assert.deepEqual([...histogram([0, 0.1, 0.5, 1, 2], [0, 1], false, 2)], [2, 2]);
  assert.deepEqual([...histogram([1, 10, 99, 1000], [1, 1000], true, 3)], [1, 2, 1]);
}

function a_store_tells_what_changed() {
  const store = new Store({ ...defaults });
  const seen = [];
  store.watch(['map', 'log'], (state) => seen.push([state.map, state.log]));
  store.set({ error: 0.5 });
  store.set({ map: 'magma', log: false });
  store.set({ map: 'magma' });
  store.set({ slices: [] });
  assert.deepEqual(seen, [[defaults.map, false], ['magma', false]]);
}

const info = {
  levels: [[0.5, 10, 100], [0.1, 50, 300], [0.1, 60, 400], [0.01, 200, 900], [0, 500, 2000]].map(
    ([error, tets, size], level) =>
      ({ level, tets, bytes: size, errors: { p: { max: error, rms: error / 4 }, q: { rms: error } } })),
  fields: [{ name: 'p' }, { name: 'q' }],
  cellFields: [],
};

function units_of_fields() {
  const said = { ...info, metadata: { units: { p: 'Pa', q: 5 } } };
  assert.deepEqual(['p', 'q', 'constructor'].map((field) => unitOf(said, field)), ['Pa', '', '']);
  assert.equal(
    titleWithUnit({ ...said, fields: [{ name: 'p', components: 1 }], cellFields: [] }, { field: 'p', component: 0 }),
    'p [Pa]');
  // what a bound is said to be is not less than it is
  assert.equal(
    wordsOfBound({ ...said, fields: [{ name: 'p', range: [0, 1] }] }, 'p', { bound: 0.01231, certified: true }),
    '± 0.013 Pa (1.24\u202f%, certified)');
  assert.deepEqual(
    [{}, { units: null }, { units: 'Pa' }].map((metadata) => unitOf({ ...info, metadata }, 'p')), ['', '', '']);
}

function the_wanted_level() {
  const wanted = (patch) => wantedLevel(info, { ...defaults, field: 'p', ...patch });
  assert.deepEqual([1, 0.3, 0.1, 0.05, 0.01, 0.001, 0].map((error) => wanted({ error })), [0, 1, 1, 3, 3, 4, 4]);
  assert.equal(wanted({ error: 0.05, measure: 'rms' }), 1);
  assert.equal(wanted({ error: 0, maxTets: 60 }), 2);
  assert.equal(wanted({ error: 0, maxBytes: 899 }), 2);
  assert.equal(wanted({ error: 0, maxTets: 1 }), 0);
  assert.equal(measureFor(info, { field: 'q', measure: 'max' }), 'rms');
  assert.deepEqual(errorSpan(info, { ...defaults, field: 'p' }), [0.01, 0.5]);
}

// What the stream is asked for is a function of the state and the index alone.
function the_state_says_what_to_ask_for() {
  const stream = {
    ...info,
    bounds: [[0, 0, 0], [2, 4, 8]],
    fields:
      [{ name: 'p', components: 1, range: [1, 3], controlled: true }, { name: 'v', components: 3, range: [-1, 2] }]
  };
  const state = {
    ...defaults,
    field: 'p',
    surface: 'off',
    slices: [{ normal: [0, 0, 1], at: 0.25 }],
    sliceEdges: true,
    isosurfaces: [0.5],
    volume: true,
    log: true
  };
  const spec = specOf(state, stream);
  assert.deepEqual(
    [spec.field, spec.component, spec.surface, spec.edges, spec.clip, spec.volume], ['p', 0, false, true, null, null]);
  assert.equal(spec.rays, true);
  const grid = specOf({ ...state, volumeSize: 64 }, stream);
  assert.deepEqual([grid.rays, grid.volume], [false, { size: 64, logarithmic: true }]);
  assert.deepEqual([spec.slices[0].normal, spec.slices[0].origin[2]], [[0, 0, 1], 2]);
  assert.deepEqual(spec.isosurfaces, [{ field: 'p', component: 0, value: 2, zone: false }]);
  assert.equal(spec.threshold, null);
  assert.deepEqual(specOf({ ...state, threshold: [0, 0.25] }, stream).threshold,
    { field: 'p', component: 0, low: -Infinity, high: 1.5 });
  const cells = { ...stream, cellFields: [{ name: 'm', components: 3 }] };
  const coloured = specOf({ ...state, cells: 'm', component: 1, regions: 'r', hidden: [2] }, cells);
  assert.deepEqual([coloured.field, coloured.cellField, coloured.component, coloured.regions],
    ['p', 'm', 1, { field: 'r', hidden: [2] }]);
  assert.deepEqual([spec.cellField, spec.regions], [undefined, null]);
  assert.deepEqual(isosurfaceRange({ ...state, isosurfaceField: 'v' }, stream), [0, 2 * Math.sqrt(3)]);
  assert.deepEqual(targetOf({ ...state, error: 0.02, maxTets: 7, maxBytes: 9 }), { error: 0.02, tets: 7, bytes: 9 });
  assert.deepEqual(targetOf({ ...state, error: 0.02, maxTets: 7, field: 'v' }, stream),
    { error: 0.02, tets: 7, field: 'p', measure: 'max' }); // v is not controlled
}

function what_a_level_promises() {
  const fields = [
    { name: 'a', controlled: true }, { name: 'b', controlled: false }, { name: 'c', controlled: false },
    { name: 'd', controlled: true }
  ];
  const errors = { a: { max: 0.01, sampled: 0.002 }, b: { sampled: 0.1 }, c: { sampled: 0.319 }, d: { sampled: 0.05 } };
  const say = (...names) => promiseOf({ fields: fields.filter((f) => names.includes(f.name)), levels: [{ errors }] },
    0).replaceAll('\u202f', ' ');
  assert.equal(say('a', 'b', 'c', 'd'),
    'a ≤ 1 % (certified), d 5 % (measured); 2 fields not controlled, worst c 31.9 % (measured)');
  assert.equal(say('a', 'b'), 'a ≤ 1 % (certified); b not controlled: 10 % (measured)');
  const ids = { fields, levels: [{ errors: { ...errors, b: {}, c: {} } }], metadata: { ids: ['b', 'c'] } };
  const said = promiseOf(ids, 0).replaceAll('\u202f', ' ');
  assert.equal(said, 'a ≤ 1 % (certified), d 5 % (measured)'); // how far ids are off means nothing
  assert.equal(say('a'), 'a ≤ 1 % (certified)');
}

const box = [[0, 0, 0], [2, 4, 6]];

function planes_cross_the_bounds() {
  assert.deepEqual(planeOf(box, { normal: [0, 2, 0], at: 0.25 }), { origin: [1, 1, 3], normal: [0, 1, 0] });
  const skew = planeOf(box, { normal: [1, 1, 1], at: 0.5 });
  assert.ok(Math.abs(dot(skew.origin, skew.normal) - 6 / Math.sqrt(3)) < 1e-12);
  const outline = planeOutline(box, planeOf(box, { normal: [0, 0, 1], at: 0.5 }));
  assert.equal(outline.length, 4);
  for (const p of outline) assert.equal(p[2], 3);
  const six = planeOutline([[0, 0, 0], [1, 1, 1]], planeOf([[0, 0, 0], [1, 1, 1]], { normal: [1, 1, 1], at: 0.5 }));
  assert.equal(six.length, 6);
  // in order: every side is as long as the next
  const sides = six.map((p, i) => Math.hypot(...p.map((c, k) => c - six[(i + 1) % 6][k])));
  for (const side of sides) assert.ok(Math.abs(side - Math.SQRT1_2) < 1e-12);
}

function polygons_end_at_the_window() {
  const clipped =
    clipToWindow([{ x: -50, y: 50 }, { x: 50, y: -50 }, { x: 150, y: 50 }, { x: 50, y: 150 }], 100, 100, 0);
  for (const { x, y } of clipped) assert.ok(x >= -1e-9 && x <= 100 + 1e-9 && y >= -1e-9 && y <= 100 + 1e-9);
  assert.deepEqual(new Set(clipped.map(({ x, y }) => `${Math.round(x)},${Math.round(y)}`)),
    new Set(['0,0', '100,0', '100,100', '0,100']));
  assert.deepEqual(clipToWindow([{ x: 200, y: 200 }, { x: 300, y: 200 }, { x: 250, y: 300 }], 100, 100, 0), []);
}

function the_nearest_triangle_is_picked() {
  const points = [];
  for (const z of [1, 2]) points.push(0, 0, z, 4, 0, z, 0, 4, z);
  const part = {
    points: Float32Array.from(points),
    triangles: Uint32Array.from([0, 1, 2, 3, 5, 4]),
    values: Float32Array.from([0, 4, 8, 100, 100, 100])
  };
  const hit = pickPart(part, [1, 1, 5], [0, 0, -1]);
  assert.deepEqual(hit, { distance: 3, value: 100, point: [1, 1, 2] });
  const front = pickPart(part, [1, 1, 5], [0, 0, -1], 1);
  assert.deepEqual(front, { distance: 4, value: 3, point: [1, 1, 1] });
  assert.deepEqual(pickPart(part, [1, 1, 5], [0, 0, -1], -1), hit);
  assert.equal(pickPart(part, [3, 3, 5], [0, 0, -1]), null);
  assert.equal(pickPart(part, [1, 1, 5], [0, 0, 1]), null);
}

// A tetrahedron with triangles outward, and one of its sides and a line of nothing left out.
function lines_of_the_far_walls() {
  const part = {
    points: Float32Array.from([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]),
    triangles: Uint32Array.from([0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3]),
    lines: Uint32Array.from([1, 0, 2, 3, 0, 3, 1, 2, 3, 1]), // not 0–2
  };
  const sides = sidesOf(part);
  assert.deepEqual([...sides], [-1, 3, 0, 0, 4, 2, 3, 1, 4, -1, 2, 1]);
  const seen = (eye, parallel) => [...linesBehind(part, sides, eye, parallel)];
  assert.deepEqual(seen([0, 0, 1], true), [2, 3, 1, 2, 3, 1]); // looking up, only the slope is seen from behind
  assert.deepEqual(seen([0, 0, -1], true), [1, 0, 1, 2]); // looking down, only the floor
  assert.deepEqual(seen([-1, -1, -1], false), [2, 3, 1, 2, 3, 1]);
  assert.deepEqual(seen([0.1, 0.1, 0.1], false), [...part.lines]); // from within, all
}

// Contrast as WCAG 2 computes it.
function lines_are_seen_on_every_colour() {
  const light = (color) => {
    const [r, g, b] = color.map((c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  for (const [map] of mapNames)
    for (const color of colorTable(map, false, 65)) {
      const [low, high] = [light(color), light(lineColor(color))].sort((a, b) => a - b);
      assert.ok((high + 0.05) / (low + 0.05) >= 1.85, `${map} ${color}: ${(high + 0.05) / (low + 0.05)}`);
    }
}

function numbers_as_people_read_them() {
  assert.equal(count(187395), '187\u202f395');
  assert.deepEqual([0, 0.01, 0.0012345, 1].map((x) => percent(x)), ['0', '1\u202f%', '0.123\u202f%', '100\u202f%']);
  assert.deepEqual([1234.5678, -0.5, 1e-7, 12345678, 0].map((x) => significant(x)),
    ['1235', '\u22120.5', '1e\u22127', '1.235e7', '0']);
  assert.deepEqual([999, 1500, 2.5e6].map(bytes), ['999\u202fB', '1.50\u202fkB', '2.50\u202fMB']);
  assert.deepEqual(['1e-3', ' 0,5 ', '\u22122', '5 %'].map(parseNumber), [0.001, 0.5, -2, 5]);
  assert.ok(Number.isNaN(parseNumber('')) && Number.isNaN(parseNumber('x')));
  assert.deepEqual(ticks(0, 10, 5), [0, 2, 4, 6, 8, 10]);
  assert.deepEqual(ticks(3, 3, 5), [3]);
}

// Groups of steps are read one after the other, each once; what is not wanted any more ends.
async function groups_of_steps_are_read_in_turn() {
  const asked = [];
  const groups = new Groups((band, group, signal) => new Promise((resolve) => {
    asked.push({ band, group, signal, come: () => resolve([{ offset: 0, bytes: new Uint8Array(4) }]) });
  }),
    () => {});
  const come = async (i) => { asked[i].come(); await new Promise(setImmediate); };
  assert.equal(groups.take(0, [1, 2, 3]), null);
  assert.equal(groups.take(0, [1, 2, 3]), null); // while the first is on its way
  await come(0);
  assert.equal(groups.take(0, [1, 2, 3]).length, 1);
  assert.deepEqual(asked.map(({ group }) => group), [1, 2]);
  assert.equal(groups.take(0, [7, 8, 9]), null);
  assert.ok(asked[1].signal.aborted && !asked[2].signal.aborted);
  await come(1); // too late
  assert.deepEqual([asked.map(({ group }) => group), groups.of(0)], [[1, 2, 7], [1]]);
  assert.equal(groups.take(1, [7, 8, 9]), null);
  assert.ok(!asked[2].signal.aborted, 'another band goes on');
  groups.drop();
  assert.ok(asked[2].signal.aborted && asked[3].signal.aborted);
  groups.take(0, [7, 8, 9]);
  await come(4);
  assert.deepEqual([groups.of(0), groups.of(1)], [[1, 7], []]);
}

// A host that never answers is asked again after a long silence, and its request ends.
async function a_silent_host_is_asked_again() {
  const [plainFetch, plainTimeout] = [globalThis.fetch, globalThis.setTimeout];
  const [signals, retries, waited] = [[], [], []];
  globalThis.setTimeout = (act, milliseconds) => plainTimeout(act, (waited.push(milliseconds), 1));
  globalThis.fetch = (url, { signal }) => {
    signals.push(signal);
    if (signals.length > 1) return Promise.resolve(new Response(new Uint8Array([7, 8, 9]), { status: 206 }));
    return new Promise((_, reject) => { signal.addEventListener('abort', () => reject(signal.reason)); });
  };
  const source = new Source({ url: 'http://127.0.0.1/a.tetlod' }, { onRetry: ({ message }) => retries.push(message) });
  const bytes =
    await source.apart(0, 3).finally(() => Object.assign(globalThis, { fetch: plainFetch, setTimeout: plainTimeout }));
  assert.deepEqual([[...bytes], signals.map(({ aborted }) => aborted), waited[0]], [[7, 8, 9], [true, false], 30000]);
  assert.match(retries[0], /a\.tetlod: no answer came for 30 s/);
}

// A large stream, decoded at a million tetrahedra a second, in levels a fortieth apart, and pictures that take 80 ns a
// tetrahedron, or five times that: never more than a fifth of the time, and as often as that allows.
function pictures_on_the_way_take_a_fifth_of_the_time() {
  for (const [cost, longest] of [[8e-5, 1000], [4e-4, 5000]]) {
    const pace = new Pace();
    let [decoding, drawing, gap, at] = [0, 0, 0, 0];
    for (let tets = 6; tets < 1.3e6; tets += 1 + tets / 40) {
      const took = (1 + tets / 40) / 1000;
      pace.decoded(took);
      decoding += took;
      if (!pace.isDue(tets)) continue;
      pace.drew(cost * tets, tets);
      gap = Math.max(gap, decoding + drawing + cost * tets - at);
      drawing += cost * tets;
      at = decoding + drawing;
    }
    assert.ok(drawing <= 0.2 * decoding && drawing > 0.1 * decoding, `${drawing} of ${decoding} ms`);
    assert.ok(gap <= longest, `${gap} ms without a picture`);
  }
}

await run([
  pictures_on_the_way_take_a_fifth_of_the_time,
  groups_of_steps_are_read_in_turn, a_silent_host_is_asked_again, streamlines_follow_the_field,
  vectors_are_at_chosen_places, seeds_lie_on_the_line_or_the_slice, categories_have_colours_of_their_own,
  arrows_point_along_the_field, a_plane_cuts_arrows, a_state_survives_its_fragment,
  maps_are_those_they_are_named_after, maps_from_files, a_broken_fragment_gives_defaults,
  a_link_is_of_what_differs_from_the_first_view, colours_chosen_from_the_data, a_store_tells_what_changed,
  units_of_fields, the_wanted_level, the_state_says_what_to_ask_for, what_a_level_promises, planes_cross_the_bounds,
  polygons_end_at_the_window, the_nearest_triangle_is_picked, lines_of_the_far_walls, lines_are_seen_on_every_colour,
  numbers_as_people_read_them,
]);
