// SPDX-License-Identifier: BSD-3-Clause
// Every number on the screen: random probes, hovers and samples of plotted lines, of components, lengths and functions
// of them, against the mesh that `tetlod extract` writes, as VTK reads it.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { firstPicture, launch, openPage, settled } from './browser.mjs';
import { program, SCRATCH, TETLOD } from './hosts.mjs';
import { run } from './tap.mjs';

const [mesh, path] = ['vtu', 'tetlod'].map((ending) => join(SCRATCH, `truth.${ending}`));
execFileSync(TETLOD, ['sample', 'fin', '--size', '16', '-o', mesh], { stdio: 'ignore' });
execFileSync(TETLOD, ['build', mesh, '--field', 'Pressure', '-o', path, '--quiet']);
const server = await program([path]);
const browser = await launch();
const page = await openPage(browser, server.url, { viewport: { width: 1000, height: 700 } });
const each = 50;
const formula = 'norm(Velocity) * Pressure';

// Random numbers that are the same each time.
function* chances(state) {
  for (;;) {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    yield state / 2 ** 32;
  }
}
const chance = chances(31);
const random = () => chance.next().value;

// Pressure and Velocity at these places, linear in the tetrahedron that a place lies deepest in; null: it is outside of
// all by more than a fraction of it. VTK reads the mesh; its own probe takes a neighbour now and then.
const judge = `
import json, sys, numpy, vtk_box
from vtk.util.numpy_support import vtk_to_numpy
mesh = vtk_box.read(sys.argv[1])
points, tets = vtk_to_numpy(mesh.GetPoints().GetData()), vtk_box.corners_of(mesh)
values = numpy.column_stack([vtk_to_numpy(mesh.GetPointData().GetArray(name)) for name in ('Pressure', 'Velocity')])
first = points[tets[:, 0]]
inverse = numpy.linalg.inv(numpy.stack([points[tets[:, i]] - first for i in (1, 2, 3)], axis=2))
found = []
for place in json.load(sys.stdin):
    inner = numpy.einsum('tij,tj->ti', inverse, place - first)
    weights = numpy.column_stack([1 - inner.sum(axis=1), inner])
    tet = weights.min(axis=1).argmax()
    inside = weights[tet].min() >= -float(sys.argv[2])
    found.append((weights[tet] @ values[tets[tet]]).tolist() if inside else None)
print(json.dumps(found))`;

let extracted = '';
function truthAt(places, tolerance = 1e-9) {
  const input = JSON.stringify(places);
  return JSON.parse(execFileSync('/usr/bin/python3', ['-c', judge, extracted, String(tolerance)], { input }));
}

const shownAs = {
  Pressure: ([p]) => p,
  '|Velocity|': ([, ...v]) => Math.hypot(...v),
  'Velocity y': ([, , y]) => y,
  [formula]: ([p, ...v]) => p * Math.hypot(...v),
};
const looks = [
  { field: 'Pressure', title: 'Pressure' },
  { field: 'Velocity', component: 'magnitude', title: '|Velocity|' },
  { field: 'Velocity', component: 1, title: 'Velocity y' },
  { field: 'Pressure', formula, title: formula },
];
const spans = {};

function assertNear(title, found, truth, place) {
  const off = Math.abs(found - shownAs[title](truth)) / spans[title];
  assert.ok(off <= 1e-6, `${title} at ${place}: ${found}, not ${shownAs[title](truth)}: ${off} of the range`);
}

const show = async ({ title, ...look }) => {
  await page.evaluate((patch) => window.tetlod.set({ component: 'magnitude', formula: '', ...patch }), look);
  await page.waitForFunction((wanted) => window.tetlod.settled && window.tetlod.viewer.title === wanted, title);
};

async function the_level_is_extracted() {
  const place = '#error=0.02&smooth=0&surface=solid&slices=z@0.4&field=Pressure';
  await page.goto(`${server.url}view/truth${place}`);
  await firstPicture(page);
  await settled(page);
  for (const look of looks) await show(look); // all fields are loaded then
  const level = await page.evaluate(() => window.tetlod.level);
  extracted = join(SCRATCH, 'truth-level.vtu');
  execFileSync(TETLOD, ['extract', path, '--level', String(level), '-o', extracted], { stdio: 'ignore' });
  const mesh = await page.evaluate(async () => {
    const { positions, fields } = await window.tetlod.stream.mesh();
    return { positions: [...positions], Pressure: [...fields.Pressure], Velocity: [...fields.Velocity] };
  });
  const rows = mesh.Pressure.map((p, v) => [p, ...mesh.Velocity.slice(3 * v, 3 * v + 3)]);
  for (const [title, of] of Object.entries(shownAs)) {
    const values = rows.map(of);
    spans[title] = Math.max(...values) - Math.min(...values);
    assert.ok(spans[title] > 0);
  }
}

async function probes_tell_what_is_there() {
  const [low, high] = await page.evaluate(() => window.tetlod.stream.info.bounds);
  const places = Array.from({ length: 2 * each }, () => low.map((l, i) => l + random() * (high[i] - l)));
  const truth = truthAt(places);
  const inside = places
    .map((place, i) => [place, truth[i]])
    .filter(([, there]) => there)
    .slice(0, each);
  assert.ok(inside.length >= each * 0.8, `${inside.length} are inside`);
  for (const [place, there] of inside) {
    const { values } = await page.evaluate((p) => window.tetlod.stream.probe(p), place);
    const found = [...values.Pressure, ...values.Velocity];
    for (const title of Object.keys(shownAs)) assertNear(title, shownAs[title](found), there, place);
  }
  console.log(`# ${inside.length} probes, ${Object.keys(shownAs).length} values each`);
}

// What is under the pointer, at the place that it says: as the page computes both, before they are written.
async function hovers_tell_what_is_there() {
  const { width, height } = await page.locator('#picture').boundingBox();
  let [count, most] = [0, 0];
  for (const look of looks) {
    await show(look);
    const spots = Array.from({ length: each }, () => [random() * width, random() * height]);
    const hits = await page.evaluate((all) => {
      const { scene } = window.tetlod;
      return all
        .map(([x, y]) => scene.pick(x, y))
        .filter(Boolean)
        .map(({ value, point }) => ({ value, place: point.map((c, i) => c + scene.centre[i]) }));
    }, spots);
    const wanted = hits.slice(0, Math.ceil(each / looks.length));
    assert.ok(wanted.length > 5, `${wanted.length} of ${spots.length} hit something`);
    // the page's places are float32, and may lie a little outside
    const truth = truthAt(
      wanted.map(({ place }) => place),
      1e-5,
    );
    wanted.forEach(({ value, place }, i) => {
      if (!truth[i]) return;
      count++;
      const off = Math.abs(value - shownAs[look.title](truth[i])) / spans[look.title];
      most = Math.max(most, off);
      assert.ok(off <= 1e-6, `${look.title} at ${place}: ${value}, not ${shownAs[look.title](truth[i])}`);
    });
  }
  console.log(`# ${count} hovers, at most ${most} of the range off`);
  assert.ok(count > 30, `${count} hovers`);
}

async function lines_tell_what_is_there() {
  let count = 0;
  for (const look of looks) {
    await show(look);
    const [low, high] = await page.evaluate(() => window.tetlod.stream.info.bounds);
    const end = () => low.map((l, i) => l + random() * (high[i] - l));
    const [from, to] = [end(), end()];
    const ends = await page.evaluate(async ([a, b]) => [...(await window.tetlod.stream.line(a, b)).ends], [from, to]);
    const pieces = Array.from({ length: ends.length / 4 }, (_, i) => ends.slice(4 * i, 4 * i + 4));
    const chosen = pieces
      .filter(([a, , b]) => b - a > 1e-6)
      .sort(() => random() - 0.5)
      .slice(0, Math.ceil(each / looks.length));
    // in the middle of a piece: lengths and functions are given at places that are as near as the curve needs
    const places = chosen.map(([a, , b]) => from.map((c, i) => c + ((a + b) / 2) * (to[i] - c)));
    truthAt(places).forEach((there, i) => {
      if (!there) return;
      const [, one, , other] = chosen[i];
      count++;
      const linear = (one + other) / 2;
      const off = Math.abs(linear - shownAs[look.title](there)) / spans[look.title];
      assert.ok(
        off <= 1e-6,
        `${look.title} at ${places[i]}: ${linear}, not ${shownAs[look.title](there)}`,
      );
    });
    const atEnds = chosen.map(([a]) => from.map((c, i) => c + a * (to[i] - c)));
    truthAt(atEnds, 1e-7).forEach((there, i) => there && assertNear(look.title, chosen[i][1], there, atEnds[i]));
  }
  console.log(`# ${count} samples of lines`);
  assert.ok(count > 20, `${count} samples`);
}

// In a box: no point is outside of it, and the volume is what VTK's own clip leaves.
async function a_box_is_saved_as_it_is_drawn() {
  await page.evaluate(() => window.tetlod.set({ box: [0.2, 0, 0, 0.7, 0.6, 1] }));
  await page.waitForFunction(() => window.tetlod.settled);
  const [file] = await Promise.all([page.waitForEvent('download'), page.locator('#export-vtu').click()]);
  await page.evaluate(() => window.tetlod.set({ box: null }));
  const compare = `
import sys, vtk_box
saved, mesh = vtk_box.read(sys.argv[1]), vtk_box.read(sys.argv[2])
b = mesh.GetBounds()
at = lambda axis, part: b[2 * axis] + part * (b[2 * axis + 1] - b[2 * axis])
left = vtk_box.in_box(mesh, (at(0, .2), b[2], b[4]), (at(0, .7), at(1, .6), b[5]))
volume, wanted = vtk_box.volumes(saved).sum(), vtk_box.volumes(left).sum()
got = saved.GetBounds()
assert abs(got[0] - at(0, .2)) + abs(got[1] - at(0, .7)) + abs(got[3] - at(1, .6)) < 1e-9, got
assert abs(volume - wanted) < 1e-6 * wanted, (volume, wanted)
assert saved.GetCellData().GetArray('original tetrahedron') and saved.GetPointData().GetArray('Velocity')`;
  execFileSync('/usr/bin/python3', ['-c', compare, await file.path(), extracted], { encoding: 'utf8' });
}

// The tetrahedra that are shown, as VTK reads them from the page's own file.
async function a_saved_mesh_is_the_level() {
  const [file] = await Promise.all([page.waitForEvent('download'), page.locator('#export-vtu').click()]);
  const saved = await file.path();
  assert.match(file.suggestedFilename(), /^truth-\d+-mesh\.vtu$/);
  const compare = `
import sys
from vtk.util.numpy_support import vtk_to_numpy
from vtk_box import corners_of, read
one, other = read(sys.argv[1]), read(sys.argv[2])
assert one.GetNumberOfCells() == other.GetNumberOfCells() > 100
assert (vtk_to_numpy(one.GetPoints().GetData()) == vtk_to_numpy(other.GetPoints().GetData())).all()
corners = [corners_of(mesh) for mesh in (one, other)]
assert (corners[0] == corners[1]).all()
for name in ('Pressure', 'Velocity'):
    values = [vtk_to_numpy(mesh.GetPointData().GetArray(name)) for mesh in (one, other)]
    assert (values[0] == values[1]).all(), name
print(int(one.GetFieldData().GetArray('level').GetTuple1(0)))`;
  const level = execFileSync('/usr/bin/python3', ['-c', compare, saved, extracted], { encoding: 'utf8' });
  assert.equal(Number(level), await page.evaluate(() => window.tetlod.level));
  assert.ok(readFileSync(saved).length > 10_000);
  await a_box_is_saved_as_it_is_drawn();
  assert.deepEqual([page.complaints, page.strangers], [[], []]);
}

await run([
  the_level_is_extracted,
  probes_tell_what_is_there,
  hovers_tell_what_is_there,
  lines_tell_what_is_there,
  a_saved_mesh_is_the_level,
]);
