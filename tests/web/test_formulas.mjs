// SPDX-License-Identifier: BSD-3-Clause
// Functions of components: read, valued and bounded, and wherever they are shown taken of interpolated components.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { launch, openPage, settled } from './browser.mjs';
import { ROOT, SCRATCH, TETLOD, beam, program, turningStream } from './hosts.mjs';
import { run } from './tap.mjs';

const load = (path) => import(pathToFileURL(join(ROOT, path)));
const { Formula } = await load('server/web/page/formula.js');
const { View, compile } = await load('build/client/tetlod.js');

const field = (name, components, range) => ({ name, components, range });
const fields = [field('p', 1, [1, 5]), field('u', 3, [-2, 3]), field('S', 6, [-50, 80]), field('T 1', 9, [-1, 2])];
const errors = Object.fromEntries(fields.map(({ name }) => [name, { max: 0.01 }]));
const info = { fields, cellFields: [], levels: [{ errors }] };
const values = { p: [2], u: [1, -2, 2], S: [10, 20, 30, 4, 5, 6], 'T 1': [1, 2, 3, 4, 5, 6, 7, 8, 9] };

let state = 1;
const random = (low, high) => {
  state = (state * 48271) % 2147483647;
  return low + (high - low) * (state / 2147483647);
};

function texts_are_functions() {
  const of = (text) => new Formula(text, fields).valueAt(values);
  const near = (text, wanted) =>
    assert.ok(Math.abs(of(text) - wanted) < 1e-9 * Math.max(1, Math.abs(wanted)), `${text}: ${of(text)}`);
  near('1 + 2 × p ^ 2 − 3 ÷ 4', 8.25);
  near('-p^2 + (u.x - u.y) * 2', 2);
  near('norm(u)', 3);
  near('norm(u.x, u.z)', Math.sqrt(5));
  near('sqrt(abs(u.y)) + min(p, 1) + max(p, 1e1)', Math.sqrt(2) + 11);
  near('S.xy + S.yz + S.xz', 15);
  near('mises(S)', Math.sqrt(((10 - 20) ** 2 + (20 - 30) ** 2 + (30 - 10) ** 2) / 2 + 3 * (16 + 25 + 36)));
  near('principal1(S) + principal2(S) + principal3(S)', 60);
  near('mises("T 1")', new Formula('mises("T 1".xx, "T 1".yy, "T 1".zz, 3, 7, 5)', fields).valueAt(values));
  near('T 1.xy + norm(T 1) - norm("T 1")', 2); // names of several words, as they are
  for (const [text, words] of [
    ['1e400 * p', 'too large'],
    ['p +', 'missing'],
    ['u', 'has components'],
    ['q', "no field 'q'"],
    ['sin(p)', "no function 'sin'"],
    ['u.w', 'x, y, z'],
    ['mises(u)', '6 or 9'],
    ['p p', 'not expected'],
    ['p $', 'not understood'],
    ['sqrt(p, p)', 'takes 1'],
    ['(p', "')' is missing"],
  ])
    assert.throws(() => new Formula(text, fields), new RegExp(words.replace(/[()]/g, '\\$&')), text);
}

// Numbers that 32 bits do not hold would be no GLSL.
function shaders_have_numbers() {
  const literals = (text) => new Formula(text, fields).shader(['a']).match(/[\d.]+(e[+-]?\d+)?/g).map(Number);
  for (const x of [...literals('p * 1e300'), ...literals('p + 0.1')])
    assert.ok(Math.fround(x) < Infinity && x > 0, `${x}`);
  assert.doesNotMatch(new Formula('p * 1e300', fields).shader(['a']), /Infinity/);
}

// Whatever the original's components are, as far from the level's as the certificate lets them be.
function bounds_hold() {
  const texts = [
    'p * u.x',
    'u.x / p',
    'sqrt(p)',
    'norm(u)',
    'mises(S)',
    'principal1(S)',
    'principal2(S)',
    'principal3(S)',
    'abs(u.x) - u.y^2',
    'min(p, u.x) * max(u.y, 0.5)',
    'mises("T 1")',
    'norm(u) / (p + 1)',
  ];
  for (const text of texts) {
    const formula = new Formula(text, fields);
    const whole = formula.at(info, 0);
    assert.ok(
      whole.certified && whole.bound > 0 && whole.bound < whole.high - whole.low,
      `${text}: ${JSON.stringify(whole)}`,
    );
    for (let i = 0; i < 400; i++) {
      const original = Object.fromEntries(
        fields.map(({ name, components, range }) => [name, Array.from({ length: components }, () => random(...range))]),
      );
      const level = Object.fromEntries(
        fields.map(({ name, range: [low, high] }) => [
          name,
          original[name].map((x) => x + Math.sign(random(-1, 1)) * 0.01 * (high - low)),
        ]),
      );
      const apart = Math.abs(formula.valueAt(original) - formula.valueAt(level));
      const { bound } = formula.at(info, 0, level);
      assert.ok(
        apart <= bound * (1 + 1e-9) && apart <= whole.bound * (1 + 1e-9),
        `${text}: ${apart}, more than ${bound}, ${whole.bound}`,
      );
    }
  }
  assert.equal(new Formula('p / u.x', fields).at(info, 0).bound, Infinity); // u.x may be nothing
}

// ---- as the decoder shows them

const turning = turningStream();
const view = await View.create(await compile(readFileSync(join(ROOT, 'build/client/tetlod.wasm'))));
view.add(turning.bytes);
const described = view.describe();
view.open(null);
view.seek(described.levels.length - 1);
const numberOf = (name) => described.fields.findIndex((f) => f.name === name);

function define(text) {
  const formula = new Formula(text, described.fields);
  view.define({ inputs: formula.inputs.map(([name, c]) => [numberOf(name), c]), program: formula.program });
  view.shade(described.fields.length, 0);
  return formula;
}

const texts = [
  'flow.x * flow.y + heat',
  'norm(flow)',
  'principal1(flow.x, flow.y, flow.z, heat, 0.3, flow.x)',
  'mises(flow.x, flow.y, flow.z, heat, 0, 1)',
];

function pictures_and_lines_have_the_value_of_interpolated_components() {
  const [low, high] = described.bounds;
  const centre = low.map((x, i) => (x + high[i]) / 2);
  for (const text of texts) {
    const formula = define(text);
    const at = (point) => formula.valueAt(view.probe(point, described.fields).values);
    for (const part of [view.slice(centre, [1, 0.7, 0.35]), view.surface()])
      for (let v = 0; v < part.values.length; v += 7) {
        const row = [...part.vectors.subarray(formula.inputs.length * v, formula.inputs.length * (v + 1))];
        assert.ok(
          Math.abs(formula.value(row) - part.values[v]) < 1e-5,
          `${text}: ${part.values[v]}, not ${formula.value(row)}`,
        );
      }
    const [from, to] = [low.map((x) => x + 0.03), high.map((x, i) => x - 0.05 * (i + 1))];
    const ends = view.along(from, to);
    for (let k = 0; k < ends.length; k += 4) {
      const f = random(0.1, 0.9);
      const [where, value] = [0, 1].map((j) => ends[k + j] + f * (ends[k + 2 + j] - ends[k + j]));
      assert.ok(Math.abs(value - at(from.map((x, i) => x + where * (to[i] - x)))) < 1e-5, `${text} along a line`);
    }
  }
}

function isosurfaces_are_where_the_value_is() {
  for (const text of texts) {
    const formula = define(text);
    const [least, greatest] = view.shade(described.fields.length, 0);
    const value = (least + greatest) / 2;
    const part = view.isosurface(described.fields.length, 0, value, { normals: true });
    assert.ok(part.triangles.length > 100, text);
    for (let v = 0; v < part.values.length; v += 11) {
      const found = view.probe([...part.points.subarray(3 * v, 3 * v + 3)], described.fields);
      if (found)
        assert.ok(
          Math.abs(formula.valueAt(found.values) - value) < (greatest - least) / 200,
          `${text}: ${formula.valueAt(found.values)}, not ${value}`,
        );
    }
  }
  assert.throws(
    () =>
      view.define({
        inputs: [[0, 0]],
        program: [
          [1, 0],
          [2, 0],
        ],
      }),
    /do not leave one number/,
  );
  assert.throws(() => view.define({ inputs: [[0, 5]], program: [[1, 0]] }), /do not leave one number/);
}

// Points are moved at every level, and all the way of a move; what is asked about them is where they are then.
function points_are_moved_by_a_field() {
  const by = { field: numberOf('flow'), scale: 0.25 };
  for (const level of [described.levels.length - 1, 3]) {
    view.warp(null);
    view.seek(level);
    const plain = view.mesh(described.fields);
    assert.ok(view.warp(by) && !view.warp(by));
    const moved = view.mesh(described.fields);
    plain.positions.forEach((x, i) => assert.equal(moved.positions[i], x + by.scale * plain.fields.flow[i]));
    view.move(level - 1);
    view.place(0);
    view.shade(by.field, 0);
    const ends = view.surface();
    view.warp(null);
    view.move(level - 1);
    view.place(0);
    view.shade(by.field, 0);
    const unmoved = view.surface();
    ends.values.forEach((x, v) =>
      assert.ok(
        Math.abs(ends.points[3 * v] - unmoved.points[3 * v] - by.scale * x) < 1e-6,
        'the coarser shape is moved, too',
      ),
    );
    view.rest();
  }
  assert.throws(() => view.warp({ field: numberOf('heat'), scale: 1 }), /three components/);
}

// ---- on the page

writeFileSync(join(SCRATCH, 'beam.vtk'), beam()['beam.vtk']);
execFileSync(TETLOD, ['build', 'beam.vtk', '--quiet', '-o', 'beam.tetlod'], { cwd: SCRATCH });
const server = await program([join(SCRATCH, 'beam.tetlod')]);
const browser = await launch();
const page = await openPage(browser, server.url, { viewport: { width: 800, height: 560 } });

async function open(text) {
  await page.goto('about:blank');
  await page.goto(`${server.url}view/beam#smooth=0&axes=0&shading=off&range=data&map=viridis${text}`);
  await settled(page);
}
const coloured = (title) =>
  page.waitForFunction(
    (wanted) =>
      window.tetlod?.settled && window.tetlod.viewer.shade?.formula && window.tetlod.viewer.shade.field === wanted,
    title,
  );

// Pixels and what is told under the pointer, against the mesh's own values.
async function a_tensor_has_von_mises_on_the_page() {
  await open('&field=Stress&error=0.05');
  assert.deepEqual(await page.locator('#component option').allInnerTexts(), [
    'magnitude',
    'von Mises',
    'largest principal',
    'middle principal',
    'smallest principal',
    'xx',
    'xy',
    'xz',
    'yx',
    'yy',
    'yz',
    'zx',
    'zy',
    'zz',
  ]);
  await page.locator('#component').selectOption('mises');
  await coloured('mises("Stress")');
  assert.match(
    await page.locator('#formula-words').innerText(),
    /^von Mises Stress ± [\d.]+ \([\d.]+\u202f%, certified\)\.$/,
  );
  const { seen, wrong, told } = await page.evaluate(async () => {
    const { scene, stream, viewer } = window.tetlod;
    const image = await scene.capture();
    const context = Object.assign(document.createElement('canvas'), {
      width: image.width,
      height: image.height,
    }).getContext('2d', { willReadFrequently: true });
    context.drawImage(image, 0, 0);
    const [from, to] = viewer.colorRange();
    const result = { seen: 0, wrong: 0, told: 0 };
    for (let y = 60; y < 440; y += 17)
      for (let x = 60; x < 460; x += 19) {
        const hit = scene.pick(x + 0.5, y + 0.5);
        const found = hit && (await stream.probe(hit.point.map((c, i) => c + scene.centre[i])));
        if (!found) continue;
        const [xx, xy, xz, , yy, yz, , , zz] = found.values.Stress;
        const exact = Math.sqrt(
          ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * (xy ** 2 + yz ** 2 + xz ** 2),
        );
        const colour =
          scene.table[Math.round(Math.min(1, Math.max(0, (exact - from) / (to - from))) * (scene.table.length - 1))];
        const pixel = context.getImageData(x, y, 1, 1).data;
        result.seen++;
        result.told = Math.max(result.told, Math.abs(hit.value - exact) / to);
        if (colour.some((c, i) => Math.abs(c - pixel[i]) > 4)) result.wrong++;
      }
    return result;
  });
  assert.ok(seen > 100 && wrong <= 0.02 * seen && told < 1e-5, JSON.stringify({ seen, wrong, told }));
}

async function a_body_is_warped() {
  await open('&field=Stress&component=mises&error=0.05');
  await page.locator('#warp').selectOption('Displacement');
  await page.waitForFunction(
    () => window.tetlod.settled && window.tetlod.scene.surface.part && window.tetlod.scene.room > 0,
  );
  const { warpScale } = await page.evaluate(() => window.tetlod.state);
  assert.equal(warpScale, 0.5); // the largest is 0.3, the diagonal 1.73
  const lowest = () =>
    page.evaluate(() => {
      const { part } = window.tetlod.scene.surface;
      return part.points.reduce((low, x, i) => (i % 3 === 2 ? Math.min(low, x) : low), Infinity);
    });
  await page.waitForFunction(
    () => window.tetlod.settled && window.tetlod.scene.surface.part.points.some((x, i) => i % 3 === 2 && x < -0.1),
  );
  assert.ok(Math.abs((await lowest()) + 0.15) < 0.01, `${await lowest()}`);
  await page.locator('#outline').check();
  await page.waitForFunction(() => window.tetlod.scene.edges.outline?.actor.getVisibility());
  const edges = await page.evaluate(() => window.tetlod.scene.edges.outline.data.getLines().getData().length / 3);
  assert.ok(edges >= 12 && edges < 200, `${edges} edges`); // those of a cube, in pieces
  await page.locator('#warp-scale').fill('-1');
  await page.locator('#warp-scale').press('Enter');
  await page.waitForFunction(
    () =>
      location.hash.includes('warp=Displacement') &&
      location.hash.includes('warpScale=-1') &&
      location.hash.includes('outline=1'),
  );
  const link = page.url();
  await page.goto('about:blank');
  await page.goto(link);
  await page.waitForFunction(() => window.tetlod?.settled && window.tetlod.scene.edges.outline?.actor.getVisibility());
  assert.ok((await lowest()) > -0.01);
  // what is moved is in the picture, however far it is
  const reach = () =>
    page.evaluate(() => {
      const { scene } = window.tetlod;
      const { points } = scene.surface.part;
      const { clientWidth: width, clientHeight: height } = scene.container;
      const places = Array.from({ length: points.length / 3 }, (_, i) =>
        scene.toScreen([0, 1, 2].map((k) => points[3 * i + k] + scene.offset[k])),
      );
      return Math.max(...places.flatMap(({ x, y }) => [Math.abs(x / width - 0.5), Math.abs(y / height - 0.5)]));
    });
  await page.evaluate(() => window.tetlod.scene.look('+y'));
  assert.ok((await reach()) < 0.5, `${await reach()}`);
  for (const [typed, kept] of [['20', '20'], ['1e300', '5774'], ['NaN', '5774']]) {
    await page.locator('#warp-scale').fill(typed);
    await page.locator('#warp-scale').press('Enter');
    await page.waitForFunction((scale) => Math.round(window.tetlod.state.warpScale) === scale, Number(kept));
    await page.waitForFunction(() => window.tetlod.settled);
    await page.waitForFunction(() => window.tetlod.scene.overflow(window.tetlod.scene.extent()) < 1.05);
    assert.ok((await reach()) < 0.5, `${typed}: ${await reach()}`);
  }
  await page.locator('#warp').selectOption('');
  await page.waitForFunction(() => window.tetlod.settled && !window.tetlod.scene.edges.outline.actor.getVisibility());
  await page.waitForFunction(() => Math.abs(window.tetlod.scene.overflow(window.tetlod.scene.bounds) - 1) < 0.05);
  assert.deepEqual(page.complaints, []);
}

// A length is farther off than each of its components, which the level's error is of; so is a function.
async function the_panel_tells_the_bound_of_what_colours() {
  await open('&field=Displacement&error=0.05');
  const told = async (pattern) => {
    const words = (source) => new RegExp(source).exec(document.getElementById('shown-error').textContent)?.[1];
    return Number(await page.waitForFunction(words, pattern.source).then((found) => found.jsonValue()));
  };
  const length = await told(/\|Displacement\| ± ([\d.]+) /);
  await page.locator('#component').selectOption('0');
  const component = await told(/^[\d.]+\u202f% ± ([\d.]+) in its units$/);
  assert.ok(Math.abs(length / component - Math.sqrt(3)) < 0.2, `${length}, ${component}`);
  await page.locator('#formula').fill('Displacement.x * 3');
  await page.locator('#formula').press('Enter');
  const thrice = await told(/Displacement\.x \* 3 ± ([\d.]+) /);
  assert.ok(Math.abs(thrice / component - 3) < 0.3, `${thrice}, ${component}`);
}

async function a_formula_is_typed_and_linked() {
  await open('&field=Displacement&error=0.05&pins=0.5,0.5,0.5');
  await page.locator('#formula').fill('norm(Displacement) * 2 + Zro');
  await page.locator('#formula').press('Enter');
  await page.getByText("there is no field 'Zro'").waitFor();
  assert.equal(await page.evaluate(() => window.tetlod.state.formula), '');
  const text = 'Displacement.z * 2 + Stress.xx / 100';
  await page.locator('#formula').fill(text);
  await page.locator('#formula').press('Enter');
  await coloured(text); // Stress is loaded for it
  await page
    .locator('#pins')
    .getByText(/Displacement\.z.* ± [\d.]+ \(.*certified\)/)
    .waitFor();
  await page.waitForFunction(() => location.hash.includes('formula='));
  const link = page.url();
  await page.goto('about:blank');
  await page.goto(link);
  await coloured(text);
  assert.equal(await page.locator('#formula').inputValue(), text);
  await page.locator('#field').selectOption('Stress');
  await page.waitForFunction(() => window.tetlod?.settled && !window.tetlod.viewer.shade.formula);
  assert.deepEqual(page.complaints, []);
}

await run([
  texts_are_functions,
  shaders_have_numbers,
  bounds_hold,
  pictures_and_lines_have_the_value_of_interpolated_components,
  isosurfaces_are_where_the_value_is,
  points_are_moved_by_a_field,
  a_body_is_warped,
  a_tensor_has_von_mises_on_the_page,
  the_panel_tells_the_bound_of_what_colours,
  a_formula_is_typed_and_linked,
]);
