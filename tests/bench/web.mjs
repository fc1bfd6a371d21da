// SPDX-License-Identifier: BSD-3-Clause
// The web client in headless Chromium, and over a slow link: node web.mjs TETLOD FOLDER. Streams are made in FOLDER
// once. The blunt fin (the usual PLOT3D grid and solution) if BLUNT names its folder, else a large fin sample in its
// place. BIG names a stream of ten million tetrahedra, which is opened, too. Prints what is measured beside its floor.
import { execFileSync } from 'node:child_process';
import { existsSync, mkdirSync, statSync } from 'node:fs';
import { connect, createServer } from 'node:net';
import { basename, join } from 'node:path';

const [, , TETLOD, folder] = process.argv;
process.env.TETLOD = TETLOD;
const { launch, openPage } = await import('../web/browser.mjs');
const { folderHost, program } = await import('../web/hosts.mjs');

const { BLUNT, BIG } = process.env;
const oneWay = 25;            // milliseconds

function make(name, ...command) {
  const path = join(folder, name);
  if (!existsSync(path)) {
    console.log(`making ${name}`);
    execFileSync(command[0], [...command.slice(1), path], { stdio: ['ignore', 'ignore', 'inherit'] });
  }
  return path;
}

function makeStreams() {
  mkdirSync(folder, { recursive: true });
  const cube = make('cube60.vtu', TETLOD, 'sample', 'cube', '--size', '60', '-o');
  make('cube60.tetlod', TETLOD, 'build', cube, '--quiet', '-o');
  const fin = BLUNT ? [join(BLUNT, 'bluntfinxyz.bin'), '--q', join(BLUNT, 'bluntfinq.bin'), '--field', 'Pressure', '--carry',
      'Pressure']
    : [make('large.vtu', TETLOD, 'sample', 'fin', '--size', '40', '-o')];
  const stream = make('fin.tetlod', TETLOD, 'build', ...fin, '--quiet', '-o');
  return make('fin.vtu', TETLOD, 'extract', stream, '--quiet', '-o'); // zlib
}

// Writes pieces at their times; null ends. In order: timers that are late are not.
function deliverTo(socket) {
  const pieces = [];
  const deliver = () => {
    const piece = pieces.shift();
    if (piece) socket.write(piece);
    else socket.end();
  };
  return (time, piece) => {
    pieces.push(piece);
    setTimeout(deliver, time - performance.now());
  };
}

/** A link to a port of this machine that all its connections share. A new one costs a round trip more. */
function slowLink(port, megabits) {
  const rate = megabits * 125; // bytes a millisecond
  let free = 0;
  const server = createServer((near) => {
    const far = connect(port, '127.0.0.1');
    const opened = performance.now();
    const up = deliverTo(far);
    const down = deliverTo(near);
    near.on('data', (bytes) => up(Math.max(performance.now(), opened + 2 * oneWay) + oneWay, bytes));
    far.on('data', (bytes) => {
      for (let at = 0; at < bytes.length; at += 5840) {
        const piece = bytes.subarray(at, at + 5840);
        free = Math.max(free, performance.now()) + piece.length / rate;
        down(free + oneWay, piece);
      }
    });
    far.on('end', () => down(free + oneWay, null));
    near.on('close', () => far.destroy());
    for (const socket of [near, far]) socket.on('error', () => socket.destroy());
  });
  return new Promise((resolve) => server.listen(0, '127.0.0.1', () => resolve(server.address().port)));
}

// ---- in the page

async function decode(url) {
  const { TetlodStream } = await import('./stream.js');
  const began = performance.now();
  const stream = await TetlodStream.open(url);
  let worker = 0;
  stream.addEventListener('level', ({ detail }) => { worker += detail.seconds; });
  await stream.refineTo();
  const whole = (performance.now() - began) / 1000;
  const steps = [];
  const near = stream.info.levels.findIndex(({ tets }) => tets >= 40000);
  await stream.refineTo({ level: near - 1 });
  const spec = { field: stream.info.fields[0].name, surface: true, morph: false };
  stream.addEventListener('level', ({ detail }) => steps.push(detail.seconds));
  stream.addEventListener('pictures', ({ detail }) => { steps[steps.length - 1] += detail.seconds; });
  await stream.show(spec);
  for (let i = 0; i < 5; i++)
    for (const level of [near, near - 1]) await stream.refineTo({ level });
  stream.close();
  return { whole, worker, tets: stream.info.tets, step: steps.sort((a, b) => a - b)[steps.length >> 1] };
}

// Seconds until the finest level has come, without pictures and with those that the viewer would make of it.
async function showMeanwhile([url, shows]) {
  const { TetlodStream } = await import('./stream.js');
  const stream = await TetlodStream.open(url);
  const [field] = stream.info.fields;
  const origin = stream.info.bounds[0].map((x, i) => (x + stream.info.bounds[1][i]) / 2);
  const spec = { field: field.name, surface: true, slices: [{ origin, normal: [0, 1, 0] }], morph: false };
  let there = 0;
  stream.addEventListener('level', ({ detail }) => { there = detail.level; });
  const began = performance.now();
  const came = new Promise((resolve) => stream.addEventListener('level', () => {
    if (there === stream.info.levels.length - 1) resolve(performance.now());
  }));
  if (shows) await stream.show(spec);
  stream.refineTo();
  const seconds = (await came - began) / 1000;
  stream.close();
  return seconds;
}

async function draw(url) {
  const { TetlodStream } = await import('./stream.js');
  const blocked = [];
  new PerformanceObserver((list) => blocked.push(...list.getEntries().map((entry) => entry.duration))).observe({
    type: 'longtask'
  });
  const began = performance.now();
  const stream = await TetlodStream.open(url);
  const [field] = stream.info.fields;
  const centre = stream.info.bounds[0].map((x, i) => (x + stream.info.bounds[1][i]) / 2);
  await stream.show({ field: field.name, surface: true });
  const { level } = await stream.refineTo({ tets: 500000 });
  const seconds = (performance.now() - began) / 1000;
  const drawn = [];
  stream.addEventListener('pictures', ({ detail }) => drawn.push(detail));
  for (let i = 0; i < 6; i++) {
    const value = field.range[0] + (field.range[1] - field.range[0]) * (0.2 + i / 50);
    const seen = new Promise((resolve) => stream.addEventListener('pictures', resolve, { once: true }));
    await stream.show(
      { field: field.name, slices: [{ origin: centre, normal: [1, 0.2, 0.1 * i] }], isosurfaces: [{ value }] });
    await seen;
  }
  stream.close();
  const triangles = drawn.at(-1).slices[0].triangles.length / 3 + drawn.at(-1).isosurfaces[0].triangles.length / 3;
  return { seconds, tets: stream.info.levels[level].tets, blocked: Math.max(0, ...blocked), triangles,
    cut: drawn.map((picture) => picture.seconds).sort((a, b) => a - b)[drawn.length >> 1] };
}

async function refineOver([url, error]) {
  const { TetlodStream } = await import('./stream.js');
  const began = performance.now();
  const stream = await TetlodStream.open(url, { target: { error } });
  await stream.refineTo({ error });
  const seconds = (performance.now() - began) / 1000;
  stream.close();
  return seconds;
}

async function download(url) {
  const began = performance.now();
  await (await fetch(url)).arrayBuffer();
  return (performance.now() - began) / 1000;
}

// ---- the viewer

const longest = (tasks) => Math.max(0, ...tasks.map(({ tdur }) => tdur / 1000));

/** A page that has never been there, until it is settled: {page, tasks, marks}: what its thread did, and the events of
 * `tetlod-graphics` and `tetlod-picture`. */
async function visit(origin, address) {
  const page = await openPage(browser, origin);
  const tracing = await page.context().newCDPSession(page);
  const events = [];
  tracing.on('Tracing.dataCollected', ({ value }) => events.push(...value));
  await tracing.send('Tracing.start',
    { transferMode: 'ReportEvents', traceConfig: { includedCategories: ['toplevel', 'blink.user_timing'] } });
  await page.addInitScript(() => {
    window.pictures = [];
    const look = () => {
      const { viewer } = window.tetlod ?? {};
      if (!viewer) return void setTimeout(look, 5);
      viewer.addEventListener('pictures', () => window.pictures.push(performance.now()));
    };
    look();
  });
  await page.goto(`${origin}${address}`);
  await page.waitForFunction(() => window.tetlod?.settled && (window.settledAt ??= performance.now()), null,
                             { timeout: 600000 });
  const complete = new Promise((resolve) => tracing.once('Tracing.tracingComplete', resolve));
  await tracing.send('Tracing.end');
  await complete;
  const [made, drawn] = ['tetlod-graphics', 'tetlod-picture'].map((mark) => events.find(({ name }) => name === mark));
  const tasks = events.filter(
    (e) => e.name === 'ThreadControllerImpl::RunTask' && e.tdur && e.pid === made.pid && e.tid === made.tid);
  return { page, tasks, made, drawn };
}

/** Opens the viewer as somebody does who has not been there: {seconds, bytes} of the first picture, {ours, graphics}:
 * milliseconds of processor time of the longest task of the page's thread, and of the one in which the browser makes
 * the graphics' context. */
async function openViewer(id) {
  const { page, tasks, made } = await visit(server.url, `view/${id}`);
  const [picture] = await page.evaluate(
    () => performance.getEntriesByName('tetlod-picture').map(({ startTime, detail }) => ({ startTime, ...detail })));
  await page.context().close();
  const isGraphics = ({ ts, dur }) => ts <= made.ts && made.ts <= ts + dur;
  return {
    seconds: picture.startTime / 1000,
    bytes: picture.received,
    ours: longest(tasks.filter((t) => !isGraphics(t))),
    graphics: longest(tasks.filter(isGraphics))
  };
}

/** A link that asks for the original: {picture, settled}: seconds from navigation to the first picture and to the last;
 * {gap}: the longest from one picture to the next, after the first; {task}: milliseconds of processor time of the
 * longest task of the page's thread after the first picture. */
async function openAll(origin, id = 'cube60') {
  const { page, tasks, drawn } = await visit(origin, `view/${id}#error=0&maxTets=20000000`);
  const { picture, times, settled } = await page.evaluate(() => ({
    picture: performance.getEntriesByName('tetlod-picture')[0].startTime, times: window.pictures,
    settled: window.settledAt
  }));
  await page.context().close();
  const all = [picture, ...times.filter((time) => time > picture)];
  return {
    picture: picture / 1000,
    settled: settled / 1000,
    gap: Math.max(...all.map((time, i) => (i ? time - all[i - 1] : 0))) / 1000,
    task: longest(tasks.filter(({ ts }) => ts > drawn.ts)),
  };
}

/** The same over a link: {picture, settled}: seconds from navigation to the first picture, and to the 1 % that it is
 * opened with. */
async function visitOver(port) {
  const page = await openPage(browser, `http://127.0.0.1:${port}`);
  await page.goto(`http://127.0.0.1:${port}/view/fin`);
  const settled = await page.waitForFunction(() => window.tetlod?.settled && performance.now() / 1000)
                    .then((handle) => handle.jsonValue());
  const picture = await page.evaluate(() => performance.getEntriesByName('tetlod-picture')[0].startTime / 1000);
  await page.context().close();
  return { picture, settled };
}

// ---- the report

function report(what, value, unit, floor, atLeast = false) {
  const met = floor === undefined || (atLeast ? value >= floor : value <= floor);
  const asked =
    floor === undefined ? '' : `  (${atLeast ? 'at least' : 'at most'} ${floor} ${unit})${met ? '' : '  MISSED'}`;
  console.log(`${what.padEnd(64)} ${value.toFixed(value < 10 ? 3 : 0).padStart(9)} ${unit}${asked}`);
}

const vtu = makeStreams();
const server = await program([join(folder, 'fin.tetlod'), join(folder, 'cube60.tetlod'), ...(BIG ? [BIG] : [])]);
const host = await folderHost('build/client');
const files = await folderHost(folder);
const browser = await launch();

// In a browser that has seen nothing yet.
async function inPage(work, argument) {
  const page = await openPage(browser, host.origin);
  await page.goto(`${host.origin}/empty.html`);
  const result = await page.evaluate(work, argument);
  await page.context().close();
  return result;
}

const name = BLUNT ? 'blunt fin' : 'fin of 180,000 tetrahedra';

const { whole, worker, step } = await inPage(decode, `${server.url}v1/meshes/fin`);
report(`${name}: opened and decoded whole`, whole, 's', 6);
report(`${name}: decoding alone`, worker, 's');
report(`${name}: one level and its picture near 40,000 tetrahedra, median`, 1000 * step, 'ms', 60);
const large = await inPage(decode, `${server.url}v1/meshes/cube60`);
report(`cube 60: decoding alone, of ${large.tets} tetrahedra`, large.tets / large.worker / 1e6, 'M/s', 1, true);
const cube = await inPage(draw, `${server.url}v1/meshes/cube60`);
report(`cube 60: to ${cube.tets} tetrahedra, with its surface`, cube.seconds, 's');
report(`cube 60: isosurface and slice (${cube.triangles} triangles), median`, 1000 * cube.cut, 'ms', 250);
report('cube 60: longest that the page was blocked', cube.blocked, 'ms', 50);

const meanwhile = [];
for (let i = 0; i < 5; i++) {
  const [without, shown] = [false, true].map((shows) => [`${server.url}v1/meshes/cube60`, shows]);
  meanwhile.push([await inPage(showMeanwhile, without), await inPage(showMeanwhile, shown)]);
}
const [bare, shown] = [0, 1].map((which) => meanwhile.map((run) => run[which]).sort((a, b) => a - b)[2]);
report('cube 60: the finest level without pictures, median of 5', bare, 's');
report('  with pictures on the way, of that', shown / bare, 'times', 1.2);

const visits = [];
for (let i = 0; i < 5; i++) visits.push(await openViewer('fin'));
const middle = (key) => visits.map((visit) => visit[key]).sort((a, b) => a - b)[visits.length >> 1];
report(`viewer, ${name}: first picture after navigation, median of 5`, middle('seconds'), 's', 1);
report(`viewer, ${name}: bytes of the mesh until then`, middle('bytes') / 1000, 'kB', 60);
report('viewer: longest task of its thread at start, processor time', middle('ours'), 'ms', 50);
report("viewer: the browser's making of the graphics' context, processor time", middle('graphics'), 'ms');

for (const [how, port] of [['on the loopback', server.port], ['over 10 Mbit/s', await slowLink(server.port, 10)]]) {
  const all = [];
  for (let i = 0; i < 3; i++) all.push(await openAll(`http://127.0.0.1:${port}/`));
  const second = (key) => all.map((visit) => visit[key]).sort((a, b) => a - b)[1];
  report(`viewer, a link to the original of cube 60, ${how}: first picture`, second('picture'), 's', 1);
  report('  the original', second('settled'), 's');
  report('  longest from one picture to the next', second('gap'), 's', 1);
  report('  longest task of the page after the first picture, processor time', second('task'), 'ms', 100);
}

if (BIG) {
  const id = basename(BIG, '.tetlod');
  const all = await openAll(server.url, id);
  report(`viewer, a link to the original of ${id}, on the loopback: first picture`, all.picture, 's', 2);
  report('  the original', all.settled, 's');
  report('  longest from one picture to the next', all.gap, 's', 1);
  report('  longest task of the page after the first picture, processor time', all.task, 'ms', 100);
}

const [slowServer, slowFiles] =
  await Promise.all([slowLink(server.port, 10), slowLink(Number(new URL(files.origin).port), 10)]);
// The median of some runs: others use this machine, too.
async function median(work, argument) {
  const runs = [];
  for (let i = 0; i < 5; i++) runs.push(await inPage(work, argument));
  return runs.sort((x, y) => x - y)[2];
}

for (const [megabits, most] of [[10, 1.2], [1, 3.5]]) {
  const port = await slowLink(server.port, megabits);
  const over = [];
  for (let i = 0; i < 5; i++) over.push(await visitOver(port));
  const at = (key) => over.map((visit) => visit[key]).sort((a, b) => a - b)[2];
  console.log(`viewer over ${megabits} Mbit/s with a round trip of ${2 * oneWay} ms, after navigation, medians of 5:`);
  report('  first picture', at('picture'), 's');
  report('  1 %, panel and all', at('settled'), 's', most);
}

console.log(`over 10 Mbit/s with a round trip of ${2 * oneWay} ms, ${name}, certified error, medians of 5:`);
const downloaded = await median(download, `http://127.0.0.1:${slowFiles}/fin.vtu`);
for (const error of [0.05, 0.01, 0.001]) {
  const seconds = await median(refineOver, [`http://127.0.0.1:${slowServer}/v1/meshes/fin`, error]);
  report(`  to ${100 * error} %`, seconds, 's');
  report(
    '    sooner than the whole VTU by', downloaded / seconds, 'times', BLUNT && error === 0.01 ? 5 : undefined, true);
}
report(`  the whole VTU with zlib (${statSync(vtu).size} bytes)`, downloaded, 's');
await browser.close();
await server.stop();
process.exit(0);
