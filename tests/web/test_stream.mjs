// SPDX-License-Identifier: BSD-3-Clause
// TetlodStream over servers and hosts of files that behave, fail, stop and lie.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { ROOT, SCRATCH, TETLOD, fileHost, folderHost, program, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

const built = join(ROOT, 'build/client');
const { TetlodStream } = await import(pathToFileURL(join(built, 'stream.js')));
const { View, compile } = await import(pathToFileURL(join(built, 'tetlod.js')));
const { path, bytes } = sampleStream();

// The same stream, decoded at once.
const reference = await View.create(await compile(readFileSync(join(built, 'tetlod.wasm'))));
reference.add(bytes);
const info = reference.describe();
reference.open(null);
const finest = info.levels.length - 1;
const middle = finest >> 1;

function meshAt(level) {
  reference.seek(level);
  return reference.mesh(info.fields);
}

async function isAt(stream, level) {
  assert.equal(stream.level, level);
  assert.deepEqual(await stream.mesh(), meshAt(level));
}

const heard = (stream, name) =>
  new Promise((resolve) => stream.addEventListener(name, (event) => resolve(event.detail), { once: true }));

async function theServersRoutes() {
  const server = await program([path]);
  const stream = await TetlodStream.open(`${server.url}v1/meshes/fin`);
  assert.deepEqual(stream.info, info);
  await isAt(stream, 0);
  assert.deepEqual(await stream.refineTo({ level: middle }), { level: middle, reached: true });
  await isAt(stream, middle);
  await stream.refineTo();
  await isAt(stream, finest);
  await stream.refineTo({ level: 2 });
  await isAt(stream, 2);
  stream.close();
  await server.stop();
}

async function goesOnToATargetAtOnce() {
  const server = await program([path]);
  const host = await fileHost(bytes);
  for (const url of [`${server.url}v1/meshes/fin`, host.url]) {
    const levels = [];
    const stream = await TetlodStream.open(
      url, { target: { level: middle }, on: { level: ({ detail }) => levels.push(detail.level) } });
    if (levels.at(-1) !== middle)
      await new Promise(
        (resolve) => stream.addEventListener('level', ({ detail }) => detail.level === middle && resolve()));
    await isAt(stream, middle);
    assert.ok(stream.received <= Math.max(65536, info.levels[middle].bytes));
    stream.close();
  }
  assert.equal(host.requests.length, 1);
  await assert.rejects(TetlodStream.open(host.url, { target: { level: finest + 1 } }), RangeError);
  host.close();
  await server.stop();
}

// All that a target needs comes with the first answer, and no other one is waited for.
async function oneAnswerIsEnough() {
  const asked = [];
  const host = await fileHost((url) => {
    asked.push(url);
    return bytes.subarray(0, info.levels[middle].bytes);
  });
  host.fault = (request) => request.url === '/v1/meshes/fin'; // the description never comes
  const stream = await TetlodStream.open(
    `${host.origin}/v1/meshes/fin`, { target: { error: 0.02, measure: 'rms', field: 'Pressure' } });
  await stream.refineTo({ level: middle });
  await isAt(stream, middle);
  assert.deepEqual(asked.splice(0), ['/v1/meshes/fin/prefix?error=0.02&field=Pressure&measure=rms']);
  stream.close();
  await assert.rejects(
    TetlodStream.open(`${host.origin}/v1/meshes/fin`, { target: { error: 1, field: 'a + b' } }), /no field 'a \+ b'/);
  assert.deepEqual(asked, ['/v1/meshes/fin/prefix?error=1&field=a%20%2B%20b']);
  host.close();
}

// A server leaves out the frames of fields that are not asked for; hosts of files send everything.
async function someFields() {
  const server = await program([path]);
  const folder = join(SCRATCH, 'exploded');
  execFileSync(TETLOD, ['explode', path, '-o', folder], { stdio: 'ignore' });
  const files = await folderHost(folder);
  const all = meshAt(finest);
  for (const fields of [['Pressure'], []])
    for (const [url, partial] of [[`${server.url}v1/meshes/fin`, true], [`${files.origin}/v1/meshes/fin`, false]]) {
      const stream = await TetlodStream.open(url, { fields, target: { level: 2 } });
      assert.deepEqual(await stream.refineTo({ level: 2 }), { level: 2, reached: true });
      const { fields: coarse } = await stream.mesh();
      assert.deepEqual(coarse.Pressure, fields.length ? meshAt(2).fields.Pressure : undefined);
      await stream.refineTo();
      const mesh = await stream.mesh();
      assert.deepEqual([mesh.positions, mesh.tets, Object.keys(mesh.fields)], [all.positions, all.tets, fields]);
      if (fields.length) assert.deepEqual(mesh.fields.Pressure, all.fields.Pressure);
      const { bytes: end } = stream.info.levels[finest];
      assert.equal(stream.received, end);
      assert.ok(partial ? end < 0.8 * info.levels[finest].bytes : end === info.levels[finest].bytes,
        `${end} of ${info.levels[finest].bytes}`);
      stream.close();
    }
  await assert.rejects(
    TetlodStream.open(`${server.url}v1/meshes/fin`, { fields: ['Speed'] }), /no field 'Speed'; there are: /);
  // broken off before the index is there: from the start again, as nobody knows yet where the frames are
  const prefix =
    Buffer.from(await (await fetch(`${server.url}v1/meshes/fin/prefix?level=3&fields=Pressure`)).arrayBuffer());
  const host = await fileHost(prefix, { ranges: false });
  Object.assign(host, { headers: { 'Tetlod-Level': '3' }, cut: 200 });
  host.fault = (request) => {
    if (host.requests.filter(({ url }) => url.includes('prefix')).length > 1) host.cut = Infinity;
    return !request.url.includes('prefix');
  };
  const stream =
    await TetlodStream.open(`${host.origin}/v1/meshes/fin`, { fields: ['Pressure'], target: { level: 3 } });
  await stream.refineTo({ level: 3 });
  assert.deepEqual((await stream.mesh()).fields, { Pressure: meshAt(3).fields.Pressure });
  stream.close();
  host.close();
  files.close();
  await server.stop();
}

// Of a server only the first field comes, of other sources all; more of them join the stream while it is used.
async function fieldsThatJoin() {
  const names = info.fields.map(({ name }) => name);
  const [first] = info.fields.filter((field) => field.controlled).map(({ name }) => name);
  assert.ok(names.length > 1);
  const server = await program([path]);
  const stream = await TetlodStream.open(`${server.url}v1/meshes/fin`, { fields: 'first', target: { level: middle } });
  await stream.refineTo({ level: middle });
  assert.deepEqual(stream.fields, [first]);
  assert.ok(stream.received < info.levels[middle].bytes);
  const [other] = names.filter((name) => name !== first);
  await assert.rejects(stream.show({ field: other, surface: true }), /was not opened/);
  await stream.show({ field: first, surface: true });
  const finer = stream.refineTo(); // under way while the field comes
  await stream.addFields([other, first]);
  assert.deepEqual([stream.fields, (await finer).level], [[first, other], finest]);
  const { fields, positions } = await stream.mesh();
  const all = meshAt(finest);
  assert.deepEqual([positions, fields], [all.positions, { [first]: all.fields[first], [other]: all.fields[other] }]);
  const pictures = heard(stream, 'pictures');
  await stream.show({ field: other, surface: true });
  assert.equal((await pictures).shade.field, other);
  await assert.rejects(stream.addFields(['Speed']), /no field 'Speed'/);
  // memory is given back by a new worker: the same stream goes on
  await stream.refineTo({ level: 2 });
  const before = await stream.mesh();
  await stream.compact();
  assert.deepEqual([stream.level, await stream.mesh()], [2, before]);
  await stream.refineTo();
  assert.deepEqual(Object.keys((await stream.mesh()).fields), [first, other]); // as before
  stream.close();
  await server.stop();
  const host = await fileHost(bytes);
  const whole = await TetlodStream.open(host.url, { fields: 'first' });
  assert.deepEqual(whole.fields, names);
  whole.close();
  host.close();
}

// Of several budgets a server's prefix takes one: the first levels come with the first answer, the others with the
// second.
// Whatever came is counted: of a file what its host sent, for a second worker, too; of a server also its description.
async function everyByteIsCounted() {
  const host = await fileHost(bytes);
  const stream = await TetlodStream.open(host.url, { target: { level: middle }, fields: [info.fields[0].name] });
  await stream.refineTo({ level: middle });
  await stream.addFields(info.fields.map(({ name }) => name));
  await stream.refineTo();
  const sent = host.requests.reduce((sum, request) => sum + request.sent, 0);
  assert.ok(stream.fetched <= sent && stream.fetched > sent - 16384
      && sent > stream.received, // what nobody has read of an answer is not known
    `${stream.fetched} of ${sent} bytes are counted, ${stream.received} are of levels`);
  stream.close();
  host.close();
  const server = await program([path]);
  const url = `${server.url}v1/meshes/fin`;
  const described = (await (await fetch(url)).arrayBuffer()).byteLength;
  const served = await TetlodStream.open(url);
  await served.refineTo();
  assert.equal(served.fetched, bytes.length + described);
  served.close();
  await server.stop();
}

async function severalBudgets() {
  const server = await program([path]);
  const target = { error: 0, tets: info.levels[middle].tets };
  const stream = await TetlodStream.open(`${server.url}v1/meshes/fin`, { target });
  assert.deepEqual(await stream.refineTo(target), { level: middle, reached: true });
  await isAt(stream, middle);
  stream.close();
  await server.stop();
}

// The link is not idle between two answers.
async function asksAhead() {
  const host = await fileHost(bytes);
  let sent = null;
  let second;
  const asked = new Promise((resolve) => { second = resolve; });
  // The first answer stops before its end until there is a second request; a client that waits for all of it gets it
  // late.
  host.pace = (bytesSent) =>
    (bytesSent >= 49152 ? Promise.race([asked, new Promise((resolve) => setTimeout(resolve, 60000).unref())]) : null);
  host.fault = (request, response, number) => {
    if (number === 2) {
      sent = host.requests[0].sent;
      host.pace = 0;
      second();
    }
    return false;
  };
  const stream = await TetlodStream.open(host.url, { target: {} });
  await stream.refineTo();
  await isAt(stream, finest);
  assert.ok(sent < 65536, `after ${sent} bytes`);
  assert.equal(
    host.requests.reduce((sum, request) => sum + request.sent, 0), info.levels[finest].bytes); // no byte twice
  stream.close();
  host.close();
}

async function levelsAreChosenAsTheServerDoes() {
  const server = await program([path]);
  const host = await fileHost(bytes);
  const stream = await TetlodStream.open(host.url);
  const field = info.fields.find((f) => f.controlled);
  const range = field.range[1] - field.range[0];
  const targets = [
    { error: 0.05 }, { error: 0.01, measure: 'sampled' }, { error: 0 }, { abs_error: 0.02 * range, field: field.name },
    { tets: 5000 }, { tets: 1 }, { bytes: 40000 }
  ];
  for (const target of targets) {
    const query = new URLSearchParams({ ...target, format: 'tetlod' });
    const { headers } = await fetch(`${server.url}v1/meshes/fin/mesh?${query}`, { redirect: 'manual' });
    const [, level] = /levels\/(\d+)\//.exec(headers.get('Location')) ?? assert.fail(String(query));
    const { abs_error: absError, ...rest } = target;
    assert.deepEqual(await stream.refineTo(absError ? { ...rest, absError } : rest),
      { level: Number(level), reached: true }, String(query));
  }
  const within = await stream.refineTo({ error: 0, tets: 9000, bytes: 60000 });
  assert.ok(info.levels[within.level].tets <= 9000 && info.levels[within.level].bytes <= 60000);
  const next = info.levels[within.level + 1];
  assert.ok(next.tets > 9000 || next.bytes > 60000);
  await assert.rejects(stream.refineTo({ error: 0.1, measure: 'least' }), /measure is one of max, sampled/);
  await assert.rejects(stream.refineTo({ error: 0.1, field: 'Speed' }), /no field 'Speed'; there are: /);
  await assert.rejects(stream.refineTo({ error: -1 }), /error is a number of at least 0/);
  await assert.rejects(stream.refineTo({ level: finest + 1 }), RangeError);
  stream.close();
  host.close();
  await server.stop();
}

async function aFileByRanges() {
  const host = await fileHost(bytes);
  const stream = await TetlodStream.open(host.url);
  assert.equal(host.requests[0].range, 'bytes=0-32767');
  await stream.refineTo({ level: middle });
  await isAt(stream, middle);
  assert.equal(stream.received, Math.max(32768, info.levels[middle].bytes));
  await stream.refineTo({ level: 1 });
  await stream.refineTo();
  await isAt(stream, finest);
  const sent = host.requests.reduce((sum, request) => sum + request.sent, 0);
  assert.equal(sent, info.levels[finest].bytes); // no byte twice
  for (const { range } of host.requests) assert.match(range, /^bytes=\d+-\d+$/);
  stream.close();
  host.close();
}

async function aFileWithoutRange() {
  const host = await fileHost(bytes, { ranges: false });
  let goOn;
  const goesOn = new Promise((resolve) => { goOn = resolve; });
  host.pace = (sent) => sent > info.levels[middle].bytes && goesOn;
  const stream = await TetlodStream.open(host.url);
  await stream.refineTo({ level: middle });
  assert.ok(stream.received < bytes.length);
  goOn();
  await isAt(stream, middle);
  await stream.refineTo();
  await isAt(stream, finest);
  assert.equal(host.requests.length, 1);
  stream.close();
  host.close();
}

async function explodedFiles() {
  const folder = join(SCRATCH, 'exploded');
  execFileSync(TETLOD, ['explode', path, '-o', folder], { stdio: 'ignore' });
  const host = await folderHost(folder);
  const stream = await TetlodStream.open(`${host.origin}/v1/meshes/fin`);
  await stream.refineTo();
  await isAt(stream, finest);
  stream.close();
  host.close();
}

async function brokenConnectionsLoseNothing() {
  for (const ranges of [true, false]) {
    const host = await fileHost(bytes, { ranges });
    const retries = [];
    const stream = await TetlodStream.open(host.url, { on: { retry: ({ detail }) => retries.push(detail) } });
    host.cut = 50000;
    const levels = [];
    stream.addEventListener('level', ({ detail }) => levels.push(detail.level));
    if (!ranges) host.fault = () => { host.cut += 60000; };
    await stream.refineTo();
    await isAt(stream, finest);
    assert.deepEqual(levels, [...levels].sort((a, b) => a - b));
    if (ranges)
      assert.ok(retries.length >= 1 && retries[0].attempt === 1 && retries[0].delay > 0 && retries[0].message);
    stream.close();
    host.close();
  }
}

async function waitsAsTheServerAsks() {
  const host = await fileHost(bytes);
  const stream = await TetlodStream.open(host.url);
  const times = [];
  host.fault = (request, response) => {
    times.push(performance.now());
    if (times.length > 2) return false;
    response
      .writeHead(times.length === 1 ? 503 : 429,
        { 'Retry-After': times.length === 1 ? '2' : new Date(Date.now() + 3000).toUTCString() })
      .end();
    return true;
  };
  await stream.refineTo();
  await isAt(stream, finest);
  assert.ok(times[1] - times[0] >= 1990, `${times[1] - times[0]} ms`);
  assert.ok(times[2] - times[1] >= 1500, `${times[2] - times[1]} ms`);
  stream.close();
  host.close();
}

// A host that asks for a day is asked again within a minute: somebody waits.
async function waitsNoLongerThanAMinute() {
  const host = await fileHost(bytes);
  host.fault = (request, response) => response.writeHead(503, { 'Retry-After': '86400' }).end();
  const stop = new AbortController();
  const heard = [];
  const opening = TetlodStream.open(host.url, {
    signal: stop.signal,
    on: {
      retry: ({ detail }) => {
        heard.push(detail.delay);
        stop.abort();
      }
    }
  });
  await assert.rejects(opening, { name: 'AbortError' });
  assert.deepEqual(heard, [60]);
  host.close();
}

// What the page has already is not left out for somebody who begins to look; then what was shown before is there again.
async function framesBesideOtherPictures() {
  const stream = await TetlodStream.open(new Blob([bytes]));
  const shown = [];
  stream.addEventListener('pictures', ({ detail }) => shown.push(detail));
  const another = (from, tag) => new Promise((resolve) => {
    const look = () => (
      shown.slice(from).some((pictures) => pictures.tag === tag && pictures.t === 1) ? resolve() : setTimeout(look, 5));
    look();
  });
  const spec = { field: 'Pressure', surface: true, edges: true, volume: { size: 8 }, tag: 'before' };
  await stream.refineTo({ level: finest });
  await stream.show(spec);
  await another(0, 'before');
  const centre = info.bounds[0].map((c, i) => (c + info.bounds[1][i]) / 2);
  for await (const { tag, surface, slices, volume, shade } of stream.frames(
    { ...spec, slices: [{ origin: centre, normal: [1, 0, 0] }], tag: 'frames' })) {
    assert.equal(tag, 'frames');
    assert.ok(
      surface.triangles?.length && surface.lines?.length && slices[0].triangles.length && volume && shade.sample);
    break;
  }
  const from = shown.length;
  await another(from, 'before');
  const last = shown.at(-1);
  assert.ok(last.surface.triangles?.length && last.slices.length === 0);
  stream.close();
}

// All bytes are here at once: pictures do not wait until all of them are decoded. What the worker runs, in this thread.
async function aPictureOnTheWay() {
  const { Engine } = await import(pathToFileURL(join(ROOT, 'server/web/client/engine.js')));
  const shown = [];
  const engine = new Engine((event, { level }) => {
    if (event !== 'pictures') return;
    shown.push(level);
    setTimeout(() => engine.seen());
  });
  await engine.open({
    module: compile(readFileSync(join(built, 'tetlod.wasm'))),
    source: { read: async (from) => bytes.slice(from) },
    target: {}
  });
  await engine.show({ field: 'Pressure', surface: true, morph: false });
  await engine.refineTo({}, 0);
  console.log(`# pictures of levels ${shown.join(', ')}`);
  assert.ok(shown[0] < finest / 2 && shown.at(-1) === finest, shown.join());
  engine.close();
}

async function waitsForADescriptionToo() {
  const folder = join(SCRATCH, 'exploded');
  execFileSync(TETLOD, ['explode', path, '-o', folder], { stdio: 'ignore' });
  const host = await folderHost(folder);
  const times = [];
  host.fault = (request, response) => {
    if (request.url.includes('/prefix')) response.writeHead(404).end(); // an older server
    if (request.url !== '/v1/meshes/fin') return response.writableEnded;
    times.push(performance.now());
    if (times.length === 1) response.writeHead(503, { 'Retry-After': '2' }).end();
    return times.length === 1;
  };
  const retries = [];
  const stream =
    await TetlodStream.open(`${host.origin}/v1/meshes/fin`, { on: { retry: ({ detail }) => retries.push(detail) } });
  assert.equal(retries.length, 1);
  assert.ok(times[1] - times[0] >= 1990, `${times[1] - times[0]} ms`);
  stream.close();
  host.fault = (request, response) => response.writeHead(200, { 'Content-Type': 'application/json' }).end('{}');
  await assert.rejects(TetlodStream.open(`${host.origin}/v1/meshes/fin`), /does not describe a stream/);
  host.close();
}

async function givesUpAndGoesOnLater() {
  const host = await fileHost(bytes);
  const errors = [];
  const stream =
    await TetlodStream.open(host.url, { retries: 1, on: { error: ({ detail }) => errors.push(detail.message) } });
  await stream.refineTo({ level: 3 });
  host.fault = (request, response) => { response.writeHead(500).end(); return true; };
  await assert.rejects(stream.refineTo(), /500 .*2 attempts/);
  assert.match(errors.join(), /500/);
  const usable = stream.level;
  await isAt(stream, usable);
  await stream.refineTo({ level: 1 });
  await isAt(stream, 1);
  host.fault = null;
  await stream.refineTo();
  await isAt(stream, finest);
  stream.close();
  host.close();
}

async function aServerThatIsKilledAndStartsAgain() {
  let server = await program([path]);
  const { port, url } = server;
  const stream = await TetlodStream.open(`${url}v1/meshes/fin`);
  await stream.refineTo({ level: 3 });
  await server.stop('SIGKILL');
  const retried = heard(stream, 'retry');
  const done = stream.refineTo();
  assert.match((await retried).message, /127\.0\.0\.1|fetch|connect/i);
  server = await program([path], port);
  assert.deepEqual(await done, { level: finest, reached: true });
  await isAt(stream, finest);
  stream.close();
  await server.stop();
}

async function aDamagedStream() {
  const damaged = Buffer.from(bytes);
  damaged[info.levels[middle].offset + 20] ^= 1;
  const host = await fileHost(damaged);
  const errors = [];
  const stream = await TetlodStream.open(host.url, { on: { error: ({ detail }) => errors.push(detail.message) } });
  await assert.rejects(stream.refineTo(), /checksum/);
  assert.match(errors.join(), /checksum/);
  await isAt(stream, middle - 1);
  await stream.refineTo({ level: 2 });
  await isAt(stream, 2);
  await stream.refineTo({ level: middle - 1 });
  await isAt(stream, middle - 1);
  await assert.rejects(stream.refineTo({ level: middle }), /cannot be decoded: .*checksum/);
  stream.close();
  host.close();
}

async function aStreamThatEndsTooEarly() {
  for (const ranges of [true, false]) {
    const host = await fileHost(bytes.subarray(0, info.levels[middle].bytes + 10), { ranges });
    const stream = await TetlodStream.open(host.url);
    await assert.rejects(stream.refineTo(), /ends too early/);
    await isAt(stream, middle);
    stream.close();
    host.close();
  }
  const host = await fileHost(bytes.subarray(0, 100));
  await assert.rejects(TetlodStream.open(host.url), /ends too early/);
  host.close();
}

async function aFileThatChanges() {
  const host = await fileHost(bytes);
  const stream = await TetlodStream.open(host.url);
  host.etag = '"2"';
  await assert.rejects(stream.refineTo(), /has changed; open it again/);
  stream.close();
  host.close();
}

async function whatIsNotAStream() {
  const host = await fileHost(
    Buffer.from('<!doctype html><title>Welcome</title><p>Nothing to see here, but long enough for a header.'));
  await assert.rejects(TetlodStream.open(host.url), /not a tetlod stream/);
  host.bytes = () => null;
  await assert.rejects(TetlodStream.open(host.url), /404/);
  host.close();
  const server = await program([path]);
  await assert.rejects(TetlodStream.open(`${server.url}v1/meshes/none`), /none/);
  await assert.rejects(TetlodStream.open(`${server.url}v1/meshes/fin`, { fields: ['Speed'] }), /no field 'Speed'/);
  await server.stop();
}

async function requestsEndEarly() {
  const host = await fileHost(bytes);
  const retries = [];
  const stream = await TetlodStream.open(host.url, { on: { retry: ({ detail }) => retries.push(detail) } });
  host.hold = 16384;
  const first = stream.refineTo();
  await heard(stream, 'progress');
  const second = stream.refineTo({ level: 2 });
  assert.equal((await first).reached, false);
  assert.deepEqual(await second, { level: 2, reached: true });
  await isAt(stream, 2);
  const controller = new AbortController();
  const third = stream.refineTo({}, { signal: controller.signal });
  await heard(stream, 'progress');
  controller.abort();
  await assert.rejects(third, { name: 'AbortError' });
  await host.requests.at(-1).gone;
  assert.deepEqual(retries, []);
  const fourth = stream.refineTo();
  stream.close();
  await assert.rejects(fourth, { name: 'AbortError' });
  await assert.rejects(stream.mesh(), { name: 'InvalidStateError' });
  const opening = new AbortController();
  host.fault = () => { opening.abort(); return true; };
  await assert.rejects(TetlodStream.open(host.url, { signal: opening.signal }), { name: 'AbortError' });
  host.close();
}

async function picturesOfEveryStep() {
  const host = await fileHost(bytes);
  const stream = await TetlodStream.open(host.url);
  const [{ name }] = info.fields;
  const [low, high] = info.bounds;
  const centre = low.map((x, i) => (x + high[i]) / 2);
  const pictures = [];
  stream.addEventListener('pictures', ({ detail }) => pictures.push(detail));
  const value = (info.fields[0].range[0] + info.fields[0].range[1]) / 2;
  await stream.show(
    { field: name, surface: true, slices: [{ origin: centre, normal: [0, 0, 1] }], isosurfaces: [{ value }] });
  const moves = () => pictures.some(({ level, t }) => level > 0 && t > 0 && t < 1);
  for (let i = 0; i < 5 && !moves(); i++) { // a machine that is busy may see a jump
    await stream.refineTo({ level: 0 });
    pictures.splice(0, pictures.length - 1);
    await stream.refineTo({ level: middle });
  }
  assert.equal(pictures.at(-1).level, middle);
  assert.ok(moves(), 'levels move');
  for (const { shade } of pictures) assert.deepEqual([shade.field, shade.component], [name, 0]);
  const { fields: { [name]: values } } = await stream.mesh();
  assert.deepEqual(pictures.at(-1).shade.range, [Math.min(...values), Math.max(...values)]);
  let level = -1;
  let t = 1;
  for (const picture of pictures) {
    if (picture.level === level) assert.ok(picture.t > t, `${pictures.map((p) => [p.level, p.t])}`);
    else assert.equal(t, 1); // every move ends
    assert.equal(Boolean(picture.surface.triangles), picture.level !== level);
    for (const z of picture.slices[0].points.filter((_, i) => i % 3 === 2)) assert.ok(Math.abs(z - centre[2]) < 1e-4);
    for (const v of picture.isosurfaces[0].values) assert.ok(Math.abs(v - value) < 1e-4 * Math.abs(value) + 1e-6);
    for (const part of [picture.surface, ...picture.slices, ...picture.isosurfaces]) {
      assert.equal(part.points.length, 3 * part.values.length);
      part.triangles?.forEach((v) => assert.ok(v < part.values.length));
    }
    ({ level, t } = picture);
  }
  pictures.length = 0;
  await stream.refineTo({ level: 0 });
  const falling = pictures.slice(0, -1).map((picture) => picture.t);
  assert.deepEqual(falling, [...falling].sort((a, b) => b - a));
  assert.equal(falling.at(-1), 0);
  assert.deepEqual([pictures.at(-1).level, pictures.at(-1).t], [0, 1]);
  pictures.length = 0;
  await stream.show({ field: name, surface: true, morph: false });
  await stream.refineTo({ level: 3 });
  assert.deepEqual([...new Set(pictures.map((picture) => picture.t))], [1]);
  pictures.length = 0;
  const everything = {
    field: name,
    surface: true,
    edges: true,
    clip: { origin: centre, normal: [1, 0, 0] },
    volume: { size: 16 },
    slices: [{ origin: centre, normal: [0, 0, 1] }],
    isosurfaces: [{ value }]
  };
  await stream.show(everything);
  await stream.refineTo({ level: middle });
  for (const { t: at, volume, surface, slices, isosurfaces } of pictures) {
    assert.equal(volume === undefined, at !== 1);
    assert.ok(
      surface.triangles.length && surface.lines.length && slices[0].lines.length && isosurfaces[0].normals.length);
    for (const part of [surface, ...slices, ...isosurfaces])
      part.points.forEach((x, i) => assert.ok(i % 3 || x <= centre[0] + 1e-4));
  }
  const { dims, voxels } = pictures.at(-1).volume;
  assert.equal(voxels.length, 2 * dims[0] * dims[1] * dims[2]);
  const { values: found, tet } = await stream.probe(centre) ?? assert.fail('nothing in the middle');
  assert.ok(tet < info.levels[middle].tets && found[name][0] >= info.fields[0].range[0]
    && found[name][0] <= info.fields[0].range[1]);
  assert.equal(await stream.probe(high.map((x) => x + 1)), null);
  // a plane that is dragged: only the newest place is drawn
  pictures.length = 0;
  for (let i = 0; i < 50; i++)
    stream.show({ ...everything, slices: [{ origin: centre.map((x) => x + i * 1e-3), normal: [0, 0, 1] }] });
  while (!pictures.some(({ slices }) => Math.abs(slices[0].points[2] - centre[2] - 0.049) < 1e-6))
    await heard(stream, 'pictures');
  assert.ok(pictures.length < 10);
  assert.ok(pictures.every(({ volume }) => volume === undefined)); // it is the same
  for (const change of [{ clip: null }, { volume: { size: 17 } }, { volume: { size: 17, logarithmic: true } },
         { component: 'magnitude', field: 'Velocity' }]) {
    stream.show(Object.assign(everything, change));
    while (!(await heard(stream, 'pictures')).volume);
  }
  await assert.rejects(stream.show({ field: name, volume: { size: 1e6 } }), /volume.size is from/);
  await assert.rejects(stream.show({ field: 'Speed' }), /no field 'Speed'/);
  await assert.rejects(stream.show({ field: name, component: 7 }), /component is one of/);
  stream.close();
  host.close();
}

// The decoder's module with one function that traps at once, as a fault in it would.
function moduleThatTraps(name) {
  const wasm = readFileSync(join(built, 'tetlod.wasm'));
  let at = 8;
  const number = () => {
    for (let value = 0, shift = 0; ; shift += 7) {
      const byte = wasm[at++];
      value += (byte & 127) * 2 ** shift;
      if (byte < 128) return value;
    }
  };
  at = wasm.indexOf(`${String.fromCharCode(name.length)}${name}\0`, 'latin1') + name.length
    + 2; // its export: name, kind, number
  const wanted = number() - WebAssembly.Module.imports(new WebAssembly.Module(wasm)).length;
  for (at = 8; wasm[at] !== 10;) { // the section of code
    at++;
    const size = number();
    at += size;
  }
  at++;
  number();
  const count = number();
  assert.ok(wanted >= 0 && wanted < count);
  for (let i = 0; i < wanted; i++) {
    const size = number();
    at += size;
  }
  const size = number();
  wasm.fill(1, at, at + size - 1); // no operation, but: no locals, unreachable
  wasm.set([0, 0], at);
  const file = join(SCRATCH, `${name}.wasm`);
  writeFileSync(file, wasm);
  return pathToFileURL(file).href;
}

// A trap ends the stream, and all that waits hears why.
async function aDecoderThatTraps() {
  const host = await fileHost(bytes);
  for (const [name, act] of [['view_probe', (stream) => stream.probe([0, 0, 0])],
         ['view_surface', (stream) => stream.show({ surface: true })]]) {
    const stream = await TetlodStream.open(host.url, { wasm: moduleThatTraps(name) });
    host.hold = stream.received; // the rest does not come
    const said = heard(stream, 'error');
    const waiting = [
      stream.refineTo(), act(stream).then(() => said).then(({ message }) => {
        throw new Error(message);
      })
    ];
    for (const settled of await Promise.allSettled(waiting))
      assert.match(settled.reason?.message ?? '', /^the decoder stopped: unreachable; open the stream again$/);
    assert.match((await said).message, /^the decoder stopped/);
    await assert.rejects(stream.mesh(), /the stream is closed/);
    host.hold = Infinity;
  }
  host.close();
}

// Of processor time, the cheapest of some against all of decoding: what others take from this machine makes that more.
async function aPictureCostsATenthOfDecoding() {
  const view = await View.create(await compile(readFileSync(join(built, 'tetlod.wasm'))));
  view.add(bytes);
  view.describe();
  view.open(null);
  const spent = (work) => {
    const before = process.cpuUsage().user;
    work();
    return process.cpuUsage().user - before;
  };
  const decoding = spent(() => {
    while (view.level < finest) view.seek(view.level + 1);
  });
  const pictures = Array.from({ length: 9 }, () => {
    view.seek(finest - 1);
    view.seek(finest);
    return spent(() => {
      view.filter(null, null, null);
      view.shade(0, 0);
      assert.ok(view.sample().length > 1000);
      assert.ok(view.surface({}).triangles.length > 0);
      assert.ok(view.slice([0, 0, 0.5], [0, 0, 1], {}));
    });
  });
  const cheapest = Math.min(...pictures);
  assert.ok(cheapest < 0.1 * decoding, `${cheapest} µs of ${decoding}`);
}

await run([
  theServersRoutes, goesOnToATargetAtOnce, oneAnswerIsEnough, someFields, fieldsThatJoin, everyByteIsCounted,
  severalBudgets, asksAhead, levelsAreChosenAsTheServerDoes, aFileByRanges, aFileWithoutRange, explodedFiles,
  brokenConnectionsLoseNothing, waitsAsTheServerAsks, waitsNoLongerThanAMinute, framesBesideOtherPictures,
  aPictureOnTheWay, waitsForADescriptionToo, givesUpAndGoesOnLater, aServerThatIsKilledAndStartsAgain, aDamagedStream,
  aStreamThatEndsTooEarly, aFileThatChanges, whatIsNotAStream, requestsEndEarly, picturesOfEveryStep,
  aPictureCostsATenthOfDecoding, aDecoderThatTraps,
]);
