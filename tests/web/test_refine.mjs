// SPDX-License-Identifier: BSD-3-Clause
// A level that is finer in boxes: the mesh against `tetlod extract` and the two levels, and what the page makes of it.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { firstPicture, launch, openPage, settled } from './browser.mjs';
import { ROOT, SCRATCH, TETLOD, cellStream, program, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

const { TetlodStream } = await import(pathToFileURL(join(ROOT, 'build/client/stream.js')));
const { path, bytes } = sampleStream();
const cells = cellStream();
const server = await program([path, cells.path]);
const box = [-0.5, 1, 0, 1, 3, 1];
const refine = { boxes: [box], target: { error: 0.01 } };
const slices = [{ origin: [0, 2, 2], normal: [0, 0, 1] }];

// The pictures of a spec, once they are of a mesh that is finer in boxes; or, without, once they are of none.
function finer(stream, spec, wanted = true) {
  return new Promise((resolve, reject) => {
    const hear = ({ detail }) => {
      if (Boolean(detail.finer) !== wanted || (spec && detail.tag !== (spec.tag ?? null))) return;
      stream.removeEventListener('pictures', hear);
      resolve(detail);
    };
    stream.addEventListener('pictures', hear);
    stream.addEventListener('error', ({ detail }) => reject(new Error(detail.message)));
    if (spec) stream.show(spec);
  });
}

// Each tetrahedron as a text of its corners' places.
function tetsOf({ positions, tets }) {
  const corner = (v) => positions.subarray(3 * v, 3 * v + 3).join();
  return Array.from({ length: tets.length / 4 }, (_, t) =>
    [...tets.subarray(4 * t, 4 * t + 4)].map(corner).sort().join(' '),
  );
}

const meets = (tet) => {
  const corners = tet.split(' ').map((corner) => corner.split(',').map(Number));
  return corners.some((p) => p.every((x, i) => x >= box[i] && x <= box[3 + i]));
};

const volumeOf = ({ positions, tets }) => {
  let sum = 0;
  for (let t = 0; t < tets.length; t += 4) {
    const [a, b, c, d] = [0, 1, 2, 3].map((i) => positions.subarray(3 * tets[t + i], 3 * tets[t + i] + 3));
    const [u, v, w] = [b, c, d].map((p) => [...p].map((x, i) => x - a[i]));
    sum +=
      Math.abs(
        u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0]) + u[2] * (v[0] * w[1] - v[1] * w[0]),
      ) / 6;
  }
  return sum;
};

async function everything_in_a_box_is_there_as_in_the_finer_level() {
  const stream = await TetlodStream.open(new Blob([bytes]));
  await stream.refineTo({ error: 0.01 });
  const fine = await stream.mesh();
  await stream.refineTo({ error: 0.1 });
  const coarse = await stream.mesh();
  const {
    finer: { inside, outside, between, boxLevel, edges },
    level,
  } = await finer(stream, { field: 'Pressure', surface: true, slices, refine });
  assert.deepEqual([level, boxLevel], [coarse.level, fine.level]);
  const made = await stream.mesh();
  const tets = tetsOf(made);
  assert.equal(tets.length, inside + outside + between);
  const [fines, coarses, all] = [fine, coarse, made].map((mesh) => new Set(tetsOf(mesh)));
  const wanted = [...fines].filter(meets);
  assert.ok(
    wanted.length > 100 && wanted.every((tet) => all.has(tet)),
    `${wanted.filter((tet) => !all.has(tet)).length} of ${wanted.length} are missing`,
  );
  assert.equal(tets.filter((tet) => !fines.has(tet) && !coarses.has(tet)).length <= between, true);
  assert.ok(tets.length < fines.size && tets.length > coarses.size, `${coarses.size}, ${tets.length}, ${fines.size}`);
  assert.ok(Math.abs(volumeOf(made) / volumeOf(coarse) - 1) < 2e-3, 'the same volume'); // its boundary moves a little
  const words = execFileSync(
    TETLOD,
    ['extract', path, '--error', '0.1', `--box=${box}`, '--box-error', '0.01', '-o', join(SCRATCH, 'boxes.vtu')],
    { encoding: 'utf8', stdio: ['ignore', 'pipe', 'pipe'] },
  );
  if (words) assert.match(words, new RegExp(`${tets.length} tetrahedra: ${outside} .*; ${inside} of level`));
  assert.ok(
    edges.length === 2 && edges.every(({ lines }) => lines.length),
    'edges of what lies between, on the boundary and on the slice',
  );
  await probes(stream, made, [outside, inside, between]);
  await it_goes_when_it_is_not_wanted(stream, coarse);
  stream.close();
}

// A probe in the middle of a tetrahedron has the mean of its corners, and says which part it is of.
async function probes(stream, { positions, tets, fields }, counts) {
  const parts = { outside: 0, inside: 0, between: 0 };
  for (let t = 0; t < tets.length / 4; t += Math.ceil(tets.length / 4 / 60)) {
    const corners = [...tets.subarray(4 * t, 4 * t + 4)];
    const mean = (values, n, c) => corners.reduce((sum, v) => sum + values[n * v + c] / 4, 0);
    const answer = await stream.probe([0, 1, 2].map((c) => mean(positions, 3, c)));
    assert.ok(Math.abs(answer.values.Pressure[0] - mean(fields.Pressure, 1, 0)) < 1e-5 * 8.3, `tetrahedron ${t}`);
    parts[answer.part]++;
  }
  assert.ok(
    Object.values(parts).every((n, i) => n > 0 || !counts[i]),
    JSON.stringify(parts),
  );
}

async function it_goes_when_it_is_not_wanted(stream, coarse) {
  const { tag } = await finer(stream, { field: 'Pressure', surface: true, tag: 'plain' }, false);
  assert.equal(tag, 'plain');
  assert.deepEqual(tetsOf(await stream.mesh()), tetsOf(coarse));
  // and with it again, at another level
  await finer(stream, { field: 'Pressure', surface: true, refine, tag: 'again' });
  const next = finer(stream);
  await stream.refineTo({ error: 0.05 });
  const { level } = await next;
  assert.equal(level, stream.level);
  assert.ok((await stream.mesh()).tets.length / 4 > stream.info.levels[level].tets);
}

// Of a server that leaves fields out, and with values of cells.
async function from_a_server_with_values_of_cells() {
  const stream = await TetlodStream.open(`${server.url}v1/meshes/cells`, { fields: 'first' });
  await stream.refineTo({ error: 0.2 });
  const {
    finer: { inside },
    shade,
  } = await finer(stream, {
    field: 'heat',
    cellField: 'load',
    surface: true,
    refine: { boxes: [[0, 0, 0, 0.2, 0.2, 0.2]], target: { error: 0 } },
  });
  assert.ok(inside > 0 && shade.cells);
  const load = await stream.cells('load');
  const {
    tet,
    cells: {
      load: [found],
    },
    part,
  } = await stream.probe([0.06, 0.07, 0.02]);
  assert.deepEqual([found, part], [load[tet], 'inside']);
  await assert.rejects(stream.show({ refine: { boxes: [[1, 0, 0, 0, 1, 1]] } }), /boxes of six numbers/);
  stream.close();
}

const browser = await launch();
const page = await openPage(browser, server.url, { viewport: { width: 1000, height: 700 } });
const untilFiner = (is = true) => page.waitForFunction((wanted) => Boolean(window.tetlod?.viewer.finer) === wanted, is);

async function a_click_refines_there() {
  await page.goto(`${server.url}view/fin#smooth=0&error=0.1&surface=solid&slices=`);
  await firstPicture(page);
  await settled(page);
  await page.waitForFunction(() => document.getElementById('refine'));
  await page.keyboard.down('Shift');
  await page.mouse.dblclick(360, 400);
  await page.keyboard.up('Shift');
  await untilFiner();
  assert.match(
    await page.locator('#promise').innerText(),
    /^Pressure ≤ .*in boxes Pressure ≤ .*\(certified\).*; between them .* without a bound$/,
  );
  assert.match(await page.locator('#refine-words').innerText(), /tetrahedra of level \d+ in boxes/);
  const {
    boxes: [first],
    error,
  } = await page.evaluate(() => window.tetlod.state.refine);
  assert.equal(error, 0.01);
  await page.locator('button[aria-label^="Finer in box 1"]').focus();
  await page.keyboard.press('ArrowRight');
  await page.locator('button[aria-label="Box 1: smaller"]').click();
  const {
    boxes: [second],
  } = await page.evaluate(() => window.tetlod.state.refine);
  assert.ok(second[3] - second[0] < first[3] - first[0], `${first} to ${second}`);
}

async function it_is_in_the_link_and_probes_tell_their_part() {
  const hash =
    'smooth=0&error=0.1&slices=&surface=solid&refine=0.45,0.1,0,0.65,0.4,0.3@0.005&pins=0.55,0.2,0.1;0.9,0.9,0.9';
  await page.goto('about:blank');
  await page.goto(`${server.url}view/fin#${hash}`);
  await untilFiner();
  await page.waitForFunction(
    () =>
      document.querySelectorAll('#pins .pinned').length === 2 &&
      /certified/.test(document.querySelector('#pins .pinned').textContent),
  );
  const shown = await page.locator('#pins .pinned').allInnerTexts();
  const share = (text) => Number(/([\d.]+)\u202f?\s?%/.exec(text)[1]);
  assert.ok(share(shown[0]) <= 0.5, shown[0]);
  assert.match(await page.evaluate(() => location.hash), /refine=0\.45,0\.1,0,0\.65,0\.4,0\.3@0\.005/);
  await page.locator('#refine button[aria-label="Box 1: remove"]').click();
  await untilFiner(false);
  assert.deepEqual([page.complaints, page.strangers], [[], []]);
}

await run([
  everything_in_a_box_is_there_as_in_the_finer_level,
  from_a_server_with_values_of_cells,
  a_click_refines_there,
  it_is_in_the_link_and_probes_tell_their_part,
]);
