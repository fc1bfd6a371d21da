// SPDX-License-Identifier: BSD-3-Clause
// A series whose mesh changes: steps on both sides of every border, from a server, hosts of files and a file; in the
// page without a blank picture.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { firstPicture, launch, openPage, settled } from './browser.mjs';
import { ROOT, SCRATCH, TETLOD, fileHost, program } from './hosts.mjs';
import { run } from './tap.mjs';

const { TetlodStream } = await import(pathToFileURL(join(ROOT, 'build/client/stream.js')));
const golden = join(ROOT, 'tests/golden/topologies.tetlod');
const STEPS = 6;
const EACH = 2;
const make = (...words) => execFileSync(TETLOD, words, { cwd: SCRATCH, stdio: 'ignore' });
make('sample', 'wake', '--size', '10', '--steps', String(STEPS), '--remesh', String(EACH), '-o', 'changes.pvd');
make('build', 'changes.pvd', '--field', 'Pressure', '--quiet', '-o', 'changes.tetlod');

// The lists of tests/golden: band by band, all steps of a group.
const listOf = (topology) =>
  readFileSync(`${golden}${topology ? `.${topology}` : ''}.steps`, 'utf8').trim().split('\n');

function hashOf({ fields }, series) {
  const hash = createHash('sha256');
  for (const { name } of series.fields) hash.update(Buffer.from(fields[name].buffer));
  return hash.digest('hex');
}

async function everyStep(source, order) {
  const stream = await TetlodStream.open(source);
  const { topologies } = stream.info;
  let received = 0; // of all groups
  let changed = false;
  const all = topologies.flatMap(({ times }, topology) => times.map((time, own) => ({ time, topology, own })));
  for (const step of order(all.length)) {
    const { topology, own, time } = all[step];
    const at =
      new Promise((resolve) => stream.addEventListener('step', ({ detail }) => resolve(detail), { once: true }));
    const { reached } = await stream.seekStep(step, { error: 0 });
    const { bands, times } = stream.series;
    assert.ok(reached);
    assert.deepEqual([(await at).step, (await at).time, stream.topology, times[step]], [step, time, topology, time]);
    const band = bands.length - 1;
    assert.equal(hashOf(await stream.mesh(), stream.series),
      listOf(topology)[band * topologies[topology].times.length + own], `step ${step}`);
    assert.equal(stream.level, bands[band].level);
    changed ||= topology > 0;
    const now = stream.received + stream.receivedSteps + stream.receivedBefore;
    assert.ok(now > 1000 && now >= received && (stream.receivedBefore > 0) === changed, `${now}, ${received} before`);
    received = now;
  }
  await assert.rejects(stream.seekStep(all.length), /from 0 to 4, not 5/);
  stream.close();
}

const upAndDown = (count) => [...Array(count).keys(), ...[...Array(count - 1).keys()].reverse()];

async function ofAServer() {
  const server = await program([golden]);
  await everyStep(`${server.url}v1/meshes/topologies`, upAndDown);
  await server.stop();
}

async function ofHostsOfFiles() {
  for (const ranges of [true, false]) {
    const host = await fileHost(readFileSync(golden), { ranges });
    await everyStep(host.url, (count) => [count - 1, 0, 2]);
    host.close();
  }
}

async function ofAFile() {
  const bytes = readFileSync(golden);
  await everyStep(new Blob([bytes]), upAndDown);
  await everyStep({ read: async (from, to) => bytes.subarray(from, to) }, (count) => [0, count - 1, 1]);
}

// The same stream in a VTKHDF file (SPEC 3.10), also where answers come in small pieces or the stream lies far behind.
async function ofAVtkhdfFile() {
  if (!execFileSync(TETLOD, ['formats'], { encoding: 'utf8' }).includes('VTKHDF')) return;
  make('convert', golden, '--stream', '-o', 'topologies.vtkhdf');
  const bytes = readFileSync(join(SCRATCH, 'topologies.vtkhdf')), pointer = Buffer.from(bytes.subarray(0, 64));
  const offset = Number(pointer.readBigUInt64LE(8)), size = readFileSync(golden).length;
  for (const far of [0, 100_000]) {
    pointer.writeBigUInt64LE(BigInt(offset + far), 8);
    const file = Buffer.concat([pointer, Buffer.alloc(far), bytes.subarray(64)]);
    for (const ranges of [true, false]) {
      const host = await fileHost(file, { ranges });
      await everyStep(host.url, (count) => [count - 1, 0, 2]);
      const asked = host.requests.map(({ range }) => /=(\d+)-(\d+)$/.exec(range ?? ''));
      const behind = asked.filter((range) => Number(range?.[1]));
      if (ranges) assert.ok(behind.every(([, first, last]) => first >= offset + far && last < offset + far + size));
      host.close();
    }
    await everyStep(new Blob([file]), upAndDown);
    await everyStep({ read: async (from, to) => file.subarray(from, to) }, (count) => [0, count - 1, 1]);
  }
  const bare = await fileHost(readFileSync(golden)), inside = await fileHost(bytes);
  for (const host of [bare, inside]) {
    const stream = await TetlodStream.open(host.url, { target: { error: 0.02 } });
    await stream.refineTo({ error: 0.02 });
    host.levels = host.requests.length;
    stream.close();
    host.close();
  }
  assert.ok(inside.levels <= bare.levels + 1, `${inside.levels} requests, ${bare.levels}`);
}

// Of several steps that are asked for at once, the last one is shown; earlier ones are not reached, and do not fail.
async function theLastOneWins() {
  const stream = await TetlodStream.open(new Blob([readFileSync(golden)]));
  await stream.seekStep(0);
  const answers = await Promise.all([2, 0, 4, 3, 2].map((step) => stream.seekStep(step, { error: 0 })));
  assert.deepEqual(
    [0, 2, 3, 4].map((i) => answers[i].reached), [false, false, false, true]); // step 0 was shown already
  assert.equal(stream.topology, 1);
  const [crossing, back] = await Promise.all([stream.seekStep(4), stream.refineTo({ level: 0 })]);
  assert.deepEqual([crossing.reached, back.reached, stream.topology, stream.level], [false, true, 1, 0]);
  await stream.addFields(['Velocity']);
  await stream.seekStep(4, { error: 0 });
  assert.deepEqual([stream.topology, (await stream.mesh()).tets.length / 4], [2, stream.info.tets]);
  await stream.compact();
  assert.equal(hashOf(await stream.mesh(), stream.series), listOf(2).at(-1));
  stream.close();
}

// Bytes of another stream in the place of a group are refused; what is shown stays.
async function anotherStreamIsRefused() {
  const bytes = Uint8Array.from(readFileSync(golden));
  const stream = await TetlodStream.open(new Blob([bytes]));
  const { offset } = stream.info.topologies[1];
  stream.close();
  bytes[offset + 41] ^= 1;
  const damaged = await TetlodStream.open(new Blob([bytes]));
  await damaged.seekStep(1, { error: 0 });
  await assert.rejects(damaged.seekStep(2, { error: 0 }));
  assert.deepEqual([damaged.topology, hashOf(await damaged.mesh(), damaged.series)], [0, listOf(0).at(-1)]);
  await damaged.seekStep(4, { error: 0 });
  assert.equal(damaged.topology, 2);
  damaged.close();
}

// ---- in the page

const server = await program([join(SCRATCH, 'changes.tetlod')]);
const browser = await launch();
const page = await openPage(browser, server.url, { viewport: { width: 700, height: 520 } });

// Every frame around the borders has the mesh in it: counted where the page draws.
async function noBlankPicture() {
  await page.goto(`${server.url}view/changes#error=0&step=0`);
  await firstPicture(page);
  await page.locator('#player').waitFor();
  await settled(page);
  await page.evaluate(() => {
    window.drawn = [];
    const { scene } = window.tetlod;
    const count =
      () => [scene.surface, ...scene.slices].reduce((sum, { part }) => sum + (part?.triangles?.length ?? 0), 0);
    scene.addEventListener('render', () => window.drawn.push(count()));
  });
  const shown = [];
  for (let step = 1; step < STEPS; step++) {
    await page.locator('#player-on').click();
    await page.waitForFunction((wanted) => window.tetlod.settled && window.tetlod.at?.step === wanted &&
      window.drawn.length >= wanted, step); // a step is drawn in a frame of its own
    shown.push(await page.evaluate(() => [window.tetlod.stream.topology, window.tetlod.stream.info.tets,
                                     document.getElementById('player-now').textContent]));
  }
  assert.deepEqual(shown.map(([topology]) => topology), [0, 1, 1, 2, 2]);
  assert.ok(shown[0][1] < shown[1][1] && shown[2][1] < shown[3][1], JSON.stringify(shown));
  assert.match(shown[4][2], /5 of 5/);
  const frames = await page.evaluate(() => window.drawn);
  assert.ok(frames.length >= 5 && frames.every((triangles) => triangles > 0), JSON.stringify(frames));
}

async function playsOverBorders() {
  await page.evaluate(() => {
    window.seen = [];
    window.tetlod.stream.addEventListener('step', ({ detail }) => window.seen.push(detail.step));
  });
  await page.locator('#player-play').click();
  await page.waitForFunction((steps) => new Set(window.seen).size === steps, STEPS);
  await page.locator('#player-play').click();
  await page.waitForFunction(() => window.tetlod.settled);
  assert.equal(await page.locator('#player-late').textContent(), '');
}

await run([
  ofAServer,
  ofHostsOfFiles,
  ofAFile,
  ofAVtkhdfFile,
  theLastOneWins,
  anotherStreamIsRefused,
  noBlankPicture,
  playsOverBorders,
]);
await browser.close();
await server.stop();
