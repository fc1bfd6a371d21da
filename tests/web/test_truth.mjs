// SPDX-License-Identifier: BSD-3-Clause
// Every number on the screen: random probes, hovers and samples of plotted lines, of components, lengths and functions
// of them, against the mesh that `tetlod extract` writes, as VTK reads it.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { firstPicture, launch, openPage, settled } from './browser.mjs';
import { program, ROOT, SCRATCH, TETLOD } from './hosts.mjs';
import { run } from './tap.mjs';

const load = (name) => import(pathToFileURL(join(ROOT, 'server/web/page', name)));
const { colouredOf, useFormulas } = await load('levels.js');
useFormulas(await load('formula.js'));

const [mesh, path] = ['vtu', 'tetlod'].map((ending) => join(SCRATCH, `truth.${ending}`));
execFileSync(TETLOD, ['sample', 'fin', '--size', '16', '-o', mesh], { stdio: 'ignore' });
// With a tensor beside the sample's fields, in the order that VTK has.
const addTensor = `
import sys, numpy, vtk, vtk_box
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy
mesh = vtk_box.read(sys.argv[1])
x, y, z = vtk_to_numpy(mesh.GetPoints().GetData()).T.astype(float)
waves = [numpy.sin(2 * x), numpy.cos(3 * y), numpy.sin(z + x), x * y, numpy.cos(y * z), numpy.sin(x - 2 * z)]
stress = numpy_to_vtk(100 * numpy.column_stack(waves), deep=True)
stress.SetName('Stress')
mesh.GetPointData().AddArray(stress)
writer = vtk.vtkXMLUnstructuredGridWriter()
writer.SetFileName(sys.argv[1])
writer.SetInputData(mesh)
assert writer.Write()`;
execFileSync('/usr/bin/python3', ['-c', addTensor, mesh], { stdio: 'inherit' });
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

// Pressure, Velocity, and Stress with its von Mises and principal values, at these places: components are linear in the
// tetrahedron that a place lies deepest in; null: it is outside of all by more than a fraction of it. VTK reads the
// mesh; its own probe takes a neighbour now and then. Or, of `vertices`, all of the mesh's.
const judge = `
import json, sys, numpy, vtk_box
from vtk.util.numpy_support import vtk_to_numpy
mesh = vtk_box.read(sys.argv[1])
points, tets = vtk_to_numpy(mesh.GetPoints().GetData()), vtk_box.corners_of(mesh)
fields = ('Pressure', 'Velocity', 'Stress')
values = numpy.column_stack([vtk_to_numpy(mesh.GetPointData().GetArray(name)) for name in fields])
def derived(row):
    xx, yy, zz, xy, yz, xz = row[4:]
    tensor = numpy.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    deviator = tensor - numpy.eye(3) * numpy.trace(tensor) / 3
    mises = numpy.sqrt(1.5 * (deviator * deviator).sum())
    return [*row, mises, *numpy.linalg.eigvalsh(tensor)[::-1]]
if sys.argv[2] == 'vertices':
    print(json.dumps([derived(row) for row in values]))
    sys.exit()
first = points[tets[:, 0]]
inverse = numpy.linalg.inv(numpy.stack([points[tets[:, i]] - first for i in (1, 2, 3)], axis=2))
found = []
for place in json.load(sys.stdin):
    inner = numpy.einsum('tij,tj->ti', inverse, place - first)
    weights = numpy.column_stack([1 - inner.sum(axis=1), inner])
    tet = weights.min(axis=1).argmax()
    inside = weights[tet].min() >= -float(sys.argv[2])
    found.append(derived(weights[tet] @ values[tets[tet]]) if inside else None)
print(json.dumps(found))`;

let extracted = '';
function truthAt(places, tolerance = 1e-9) {
  const input = JSON.stringify(places);
  return JSON.parse(execFileSync('/usr/bin/python3', ['-c', judge, extracted, String(tolerance)], { input }));
}

const shownAs = {
  Pressure: ([p]) => p,
  '|Velocity|': ([, x, y, z]) => Math.hypot(x, y, z),
  'Velocity y': ([, , y]) => y,
  [formula]: ([p, x, y, z]) => p * Math.hypot(x, y, z),
  'von Mises Stress': (row) => row[10],
  'largest principal Stress': (row) => row[11],
  'middle principal Stress': (row) => row[12],
};
const looks = [
  { field: 'Pressure', title: 'Pressure' },
  { field: 'Velocity', component: 'magnitude', title: '|Velocity|' },
  { field: 'Velocity', component: 1, title: 'Velocity y' },
  { field: 'Pressure', formula, title: formula },
  { field: 'Stress', component: 'mises', title: 'von Mises Stress' },
  { field: 'Stress', component: 'principal1', title: 'largest principal Stress' },
  { field: 'Stress', component: 'principal2', title: 'middle principal Stress' },
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
    return [positions.length, ...['Pressure', 'Velocity', 'Stress'].map((name) => fields[name].length)];
  });
  const rows = truthAt([], 'vertices');
  assert.deepEqual(mesh, [3, 1, 3, 6].map((n) => n * rows.length));
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
  const info = await page.evaluate(() => window.tetlod.stream.info);
  const found = await page.evaluate((all) => Promise.all(all.map((p) => window.tetlod.stream.probe(p))),
                                    inside.map(([place]) => place));
  for (const look of looks) {
    const { field: { name }, component, formula: of } = colouredOf(info, { component: 0, ...look });
    inside.forEach(([place, there], i) => {
      const { values } = found[i];
      const length = () => Math.hypot(...values[name]);
      const value = of ? of.valueAt(values) : component === 'magnitude' ? length() : values[name][component];
      assertNear(look.title, value, there, place);
    });
  }
  console.log(`# ${inside.length} probes, ${Object.keys(shownAs).length} values each`);
}

// Samples are [look, place, value]. Returns how many are where the mesh is.
function assertAllNear(samples, tolerance) {
  const truth = truthAt(samples.map(([, place]) => place), tolerance);
  const there = samples.map(([{ title }, place, value], i) => ({ title, place, value, truth: truth[i] }))
                  .filter((sample) => sample.truth);
  for (const { title, value, truth: row, place } of there) assertNear(title, value, row, place);
  return there.length;
}

// What is under the pointer, at the place that it says: as the page computes both, before they are written.
async function hovers_tell_what_is_there() {
  const { width, height } = await page.locator('#picture').boundingBox();
  const samples = [];
  for (const look of looks) {
    await show(look);
    const spots = Array.from({ length: 2 * each }, () => [random() * width, random() * height]);
    const hits = await page.evaluate((all) => {
      const { scene } = window.tetlod;
      return all
        .map(([x, y]) => scene.pick(x, y))
        .filter(Boolean)
        .map(({ value, point }) => ({ value, place: point.map((c, i) => c + scene.centre[i]) }));
    }, spots);
    assert.ok(hits.length > 10, `${hits.length} of ${spots.length} hit something`);
    samples.push(...hits.slice(0, each / 5).map(({ place, value }) => [look, place, value]));
  }
  const count = assertAllNear(samples, 1e-5); // the page's places are float32, and may lie a little outside
  console.log(`# ${count} hovers`);
  assert.ok(count > 50, `${count} hovers`);
}

async function lines_tell_what_is_there() {
  const [middles, ends] = [[], []];
  for (const look of looks) {
    await show(look);
    const [low, high] = await page.evaluate(() => window.tetlod.stream.info.bounds);
    const end = () => low.map((l, i) => l + random() * (high[i] - l));
    const [from, to] = [end(), end()];
    const at = (part) => from.map((c, i) => c + part * (to[i] - c));
    const line = await page.evaluate(async ([a, b]) => [...(await window.tetlod.stream.line(a, b)).ends], [from, to]);
    const pieces = Array.from({ length: line.length / 4 }, (_, i) => line.slice(4 * i, 4 * i + 4));
    const chosen = pieces
      .filter(([a, , b]) => b - a > 1e-6)
      .sort(() => random() - 0.5)
      .slice(0, each / 5);
    // in the middle of a piece: lengths and functions are given at places that are as near as the curve needs
    middles.push(...chosen.map(([a, one, b, other]) => [look, at((a + b) / 2), (one + other) / 2]));
    ends.push(...chosen.map(([a, one]) => [look, at(a), one]));
  }
  const count = assertAllNear(middles, 1e-9);
  console.log(`# ${count} samples of lines`);
  assert.ok(count > 50, `${count} samples`);
  assertAllNear(ends, 1e-7);
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
