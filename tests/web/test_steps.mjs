// SPDX-License-Identifier: BSD-3-Clause
// Steps in time in the browser's decoder: bit for bit those of the C library, from a server, from hosts of files, and
// from a file.
import assert from 'node:assert/strict';
import { createHash } from 'node:crypto';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { ROOT, fileHost, program } from './hosts.mjs';
import { run } from './tap.mjs';

const { TetlodStream } = await import(pathToFileURL(join(ROOT, 'build/client/stream.js')));
const names = ['series_float32', 'series_float64', 'series_moving'];
const pathOf = (name) => join(ROOT, 'tests/golden', `${name}.tetlod`);
const expected = (name) => readFileSync(`${pathOf(name)}.steps`, 'utf8').trim().split('\n');

// As tests/unit/test_golden.c: the values of the fields that have steps, in the series' order; of points that move
// their places.
function hashOf({ fields, positions }, series) {
  const hash = createHash('sha256');
  for (const { name } of series.fields) hash.update(Buffer.from(fields[name].buffer));
  if (series.displacement) hash.update(Buffer.from(positions.buffer));
  return hash.digest('hex');
}

const heard = (stream, name) =>
  new Promise((resolve) => stream.addEventListener(name, (event) => resolve(event.detail), { once: true }));

async function everyStep(source, name, order = (count) => [...Array(count).keys()]) {
  const stream = await TetlodStream.open(source);
  await stream.seekStep(0);
  const { bands, times } = stream.series;
  const hashes = expected(name);
  for (const i of order(hashes.length)) {
    const [band, step] = [Math.floor(i / times.length), i % times.length];
    const at = heard(stream, 'step');
    assert.deepEqual(await stream.seekStep(step, { band }), { level: bands[band].level, reached: true });
    assert.deepEqual([(await at).step, (await at).band], [step, band]);
    assert.equal(hashOf(await stream.mesh(), stream.series), hashes[i], `${name}: band ${band}, step ${step}`);
  }
  stream.close();
}

// As tests/unit/test_golden.c: values of cells at a step; without steps they are known at the first one alone.
async function valuesOfCells() {
  const stream = await TetlodStream.open(new Blob([readFileSync(pathOf('series_cells'))]));
  const hashes = readFileSync(`${pathOf('series_cells')}.cell_steps`, 'utf8').trim().split('\n');
  await stream.seekStep(3);
  const { cellFields, times } = stream.series;
  assert.deepEqual(cellFields.map(({ name }) => name), ['heat', 'flux', 'material', 'load', 'wide']);
  for (const step of [3, 10, 9, 0, 5])
    for (const [f, { name }] of cellFields.entries()) {
      await stream.seekStep(step);
      const hash = createHash('sha256').update(Buffer.from((await stream.cells(name)).buffer)).digest('hex');
      assert.equal(hash, hashes[f * times.length + step], `${name} at step ${step}`);
    }
  await assert.rejects(stream.cells('late'), /late are known at the first step alone/);
  await stream.refineTo({ error: 0 });
  assert.ok((await stream.cells('late')).every((value) => value === 0));
  const first = createHash('sha256').update(Buffer.from((await stream.cells('heat')).buffer)).digest('hex');
  assert.equal(first, hashes[0]);
  stream.close();
}

async function ofAServer() {
  const server = await program(names.map(pathOf));
  for (const name of names) await everyStep(`${server.url}v1/meshes/${name}`, name,
                                            (count) => [count - 1, 0, count >> 1]);
  await server.stop();
}

async function ofHostsOfFiles() {
  for (const ranges of [true, false])
    for (const name of names) {
      const host = await fileHost(readFileSync(pathOf(name)), { ranges });
      await everyStep(host.url, name, (count) => [count - 1, 0, count >> 1]);
      host.close();
    }
}

async function ofAFileInAnyOrder() {
  for (const name of names) {
    const blob = new Blob([readFileSync(pathOf(name))]);
    await everyStep(blob, name);
    await everyStep(blob, name,
                    (count) => [...Array(count).keys()].sort((a, b) => ((a * 7919) % count) - ((b * 7919) % count)));
  }
}

// Geometry is there: a step takes one range of bytes of every field; the next one of its group takes none of its own.
// (What is fetched ahead may be broken off and asked for again.)
async function aStepIsOneRange() {
  const bytes = readFileSync(pathOf('series_float32'));
  const host = await fileHost(bytes);
  const stream = await TetlodStream.open(host.url, { target: {} });
  await stream.refineTo();
  if (!stream.series) await heard(stream, 'series');
  const { fields, times } = stream.series;
  const before = host.requests.length;
  const asked = () => host.requests.slice(before).map((request) => request.range);
  await stream.seekStep(times.length - 1, { error: 0 });
  const own = asked().slice(0, fields.length);
  assert.equal(new Set(own).size, fields.length, `${asked()}`);
  await stream.seekStep(times.length - 2, { error: 0 });
  assert.ok(new Set(asked()).size <= fields.length * Math.ceil(times.length / 8), `${asked()}`);
  assert.ok(asked().slice(fields.length).every((range) => !own.includes(range)), `${asked()}`);
  stream.close();
  host.close();
}

// The coarsest band in which the step's own errors are within the asked one, though the band promises less.
async function byItsOwnError(stream) {
  const { bands, times } = stream.series;
  const told = Promise.all(times.map(() => heard(stream, 'step')));
  const own = [];
  for (const step of times.keys()) {
    const shown = heard(stream, 'step');
    await stream.seekStep(step, { band: 0 });
    own.push(Math.max(...Object.values((await shown).errors)));
  }
  await told;
  const least = own.indexOf(Math.min(...own));
  assert.ok(own[least] < bands[0].error);
  for (const [error, band] of [[own[least], 0], [own[least] * (1 - 1e-9), 1]]) {
    const shown = heard(stream, 'step');
    await stream.seekStep(least, { error });
    assert.equal((await shown).band, band);
  }
}

// Levels and steps in turn: each has its own values.
async function thereAndBack() {
  const stream = await TetlodStream.open(new Blob([readFileSync(pathOf('series_float32'))]));
  await stream.refineTo({ level: 1 });
  const level = await stream.mesh();
  await stream.seekStep(3, { error: 1 });
  assert.equal(hashOf(await stream.mesh(), stream.series), expected('series_float32')[3]);
  await stream.refineTo({ level: 1 });
  assert.deepEqual(await stream.mesh(), level);
  await byItsOwnError(stream);
  await assert.rejects(stream.seekStep(1000), RangeError);
  await assert.rejects(stream.seekStep(0, { band: 99 }), RangeError);
  stream.close();
  const one = await TetlodStream.open(new Blob([readFileSync(pathOf('grid_float32'))]));
  await assert.rejects(one.seekStep(0), RangeError);
  one.close();
}

// Pictures of a step have its values; with `blend` they pass from one step to the next, and end there.
async function picturesBlend() {
  const stream = await TetlodStream.open(new Blob([readFileSync(pathOf('series_float32'))]));
  const shown = [];
  stream.addEventListener('pictures', ({ detail }) => shown.push(detail));
  const { name } = stream.info.fields[0];
  await stream.show({ field: name, surface: true });
  let from, to, between = [];
  for (let blend = 200; between.length < 2 && blend < 10_000; blend *= 5) { // a busy machine draws fewer of them
    await stream.seekStep(1, { error: 0 });
    from = shown.at(-1).surface.values;
    shown.length = 0;
    await stream.seekStep(2, { error: 0, blend });
    to = shown.at(-1);
    assert.deepEqual([to.step, to.t], [2, 1]);
    between = shown.filter(({ t }) => t > 0 && t < 1);
  }
  assert.ok(between.length > 1 && between.every(({ surface }) => !surface.triangles), `${between.length} pictures`);
  for (const { t, surface } of between)
    surface.values.forEach((value, i) => assert.ok(Math.abs(value - (from[i] + t * (to.surface.values[i] - from[i])))
                             < 1e-5 * (1 + Math.abs(value))));
  assert.ok(to.surface.values.some((value, i) => value !== from[i]));
  stream.close();
}

// A damaged group is refused, what is shown stays, and other groups can still be shown.
async function damageIsFound() {
  const bytes = readFileSync(pathOf('series_float32'));
  const whole = await TetlodStream.open(new Blob([bytes]));
  await whole.seekStep(0);
  const { bands } = whole.series;
  whole.close();
  const damaged = Uint8Array.from(bytes);
  damaged[bytes.length - 1] ^= 1; // the last group of the exact band
  const stream = await TetlodStream.open(new Blob([damaged]));
  await stream.seekStep(0, { band: 0 });
  await assert.rejects(stream.seekStep(stream.series.times.length - 1, { band: bands.length - 1 }), /checksum/);
  await stream.seekStep(1, { band: 0 });
  assert.equal(hashOf(await stream.mesh(), stream.series), expected('series_float32')[1]);
  stream.close();
}

// Whoever gives up a step and asks for it again gets it, even if the host never answers the first time.
async function aGroupThatDoesNotCome() {
  const host = await fileHost(readFileSync(pathOf('series_float32')));
  const stream = await TetlodStream.open(host.url);
  await stream.seekStep(0, { band: 0 });
  const silent = new Promise((resolve) => { host.fault = () => { resolve(); return true; }; });
  const giveUp = new AbortController();
  const finest = { band: stream.series.bands.length - 1 };
  const step = stream.seekStep(1, finest, { signal: giveUp.signal });
  await silent;
  giveUp.abort();
  await assert.rejects(step, { name: 'AbortError' });
  host.fault = null;
  assert.ok((await stream.seekStep(1, finest)).reached);
  assert.equal(hashOf(await stream.mesh(), stream.series),
               expected('series_float32')[finest.band * stream.series.times.length + 1]);
  stream.close();
  host.close();
}

await run([valuesOfCells, ofAServer, ofHostsOfFiles, ofAFileInAnyOrder, aStepIsOneRange, thereAndBack, picturesBlend,
           damageIsFound, aGroupThatDoesNotCome]);
