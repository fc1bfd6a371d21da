// SPDX-License-Identifier: BSD-3-Clause
// Flying through a stream in pages in headless Chromium: node fly.mjs TETLOD FOLDER [SIDE]. The cube of SIDE^3 · 6
// tetrahedra (119: 10 million) is made in FOLDER once. Prints what is held and fetched beside the uniform level of the
// same error, how the frames come meanwhile, and the longest task of the page's thread: its processor time, and how
// long it took where the browser waits for what draws, which is the processor here.
import { execFileSync } from 'node:child_process';
import { existsSync, mkdirSync } from 'node:fs';
import { join } from 'node:path';

const [, , TETLOD, folder, side = '119'] = process.argv;
process.env.TETLOD = TETLOD;
const { firstPicture, launch, openPage, settled } = await import('../web/browser.mjs');
const { program } = await import('../web/hosts.mjs');

const pixels = 2;
const stops = 12; // each a picture that is waited for; between them the camera moves without a pause
const moves = 15; // frames from one stop to the next

function make(name, ...command) {
  const path = join(folder, name);
  if (existsSync(path)) return path;
  console.log(`making ${name}`);
  execFileSync(TETLOD, [...command, path], { stdio: ['ignore', 'ignore', 'inherit'] });
  return path;
}

mkdirSync(folder, { recursive: true });
const mesh = make(`paged${side}.vtu`, 'sample', 'cube', '--size', side, '-o');
const paged = ['--paged=50000', '--bands', 'coarse']; // what is looked at in parts wants small pages and few groups
const stream = make(`fly${side}.tetlod`, 'build', mesh, ...paged, '--quiet', '-o');
const server = await program([stream]);
const browser = await launch();
const page = await openPage(browser, server.url);

function report(what, value, unit, floor, atLeast = false) {
  const met = floor === undefined || (atLeast ? value >= floor : value <= floor);
  const asked =
    floor === undefined ? '' : `  (${atLeast ? 'at least' : 'at most'} ${floor} ${unit})${met ? '' : '  MISSED'}`;
  console.log(`${what.padEnd(64)} ${value.toFixed(value < 10 ? 3 : 0).padStart(9)} ${unit}${asked}`);
}

const tracing = await page.context().newCDPSession(page);
const events = [];
tracing.on('Tracing.dataCollected', ({ value }) => events.push(...value));

// From now on: how long frames take, and tasks.
const watch = async () => {
  const traceConfig = { includedCategories: ['toplevel', 'blink.user_timing'] };
  await tracing.send('Tracing.start', { transferMode: 'ReportEvents', traceConfig });
  await page.evaluate(() => {
    performance.mark('tetlod-flight');
    window.flight = { frames: [], tasks: [0] };
    const { frames, tasks } = window.flight;
    new PerformanceObserver((list) => tasks.push(...list.getEntries().map(({ duration }) => duration))).observe({
      type: 'longtask',
    });
    let last = performance.now();
    const look = (now) => {
      frames.push(now - last);
      last = now;
      requestAnimationFrame(look);
    };
    requestAnimationFrame(look);
  });
};

// Of the page's thread, in milliseconds of processor time.
async function longestTask() {
  const complete = new Promise((resolve) => tracing.once('Tracing.tracingComplete', resolve));
  await tracing.send('Tracing.end');
  await complete;
  const { pid, tid } = events.find(({ name }) => name === 'tetlod-flight');
  const isTask = (e) => e.name === 'ThreadControllerImpl::RunTask' && e.pid === pid && e.tid === tid;
  return Math.max(0, ...events.filter(isTask).map(({ tdur = 0 }) => tdur / 1000));
}

// Along a wall and into a corner, nearer and nearer: places as fractions of the side, about the cube's middle.
const placeAt = (t) => [0.45 * Math.cos(2 * t), -0.55 + 0.02 * Math.sin(5 * t), 0.4 * Math.sin(3 * t)];

// Moves the camera frame by frame; resolves when the pages of the last place are there.
const flyTo = (places) =>
  page.evaluate(async (all) => {
    const { scene, viewer } = window.tetlod;
    for (const [x, y, z] of all) {
      scene.setCamera([x, y, z, x, y + 1, z, 0, 0, 1]);
      await new Promise(requestAnimationFrame);
    }
    scene.cameraRests();
    for (let i = 0; i < 3; i++) await new Promise(requestAnimationFrame); // what it needs is asked for by then
    await new Promise((resolve) => {
      const look = () => (window.tetlod.settled ? resolve() : setTimeout(look, 10));
      look();
    });
    return { ...viewer.finer, fetched: window.tetlod.stream.fetched };
  }, places);

const began = performance.now();
await page.goto(`${server.url}view/fly${side}#pixels=${pixels}&surface=solid&slices=&smooth=0`);
await firstPicture(page);
report(`cube ${side}: first picture`, (performance.now() - began) / 1000, 's', 2);
await settled(page);
const { levels, tets, bytes } = await page.evaluate(() => window.tetlod.viewer.info);
await watch();
const seen = [];
for (let stop = 0; stop < stops; stop++) {
  const places = Array.from({ length: moves }, (_, i) =>
    placeAt((stop + (i + 1) / moves) / 4).map((c) => c * Number(side)),
  );
  const started = performance.now();
  seen.push({ ...(await flyTo(places)), seconds: (performance.now() - started) / 1000 });
}
const { frames, tasks } = await page.evaluate(() => window.flight);
const most = (key) => Math.max(...seen.map((picture) => picture[key]));
const uniform = levels[most('finest')];
report(`cube ${side}, ${tets} tetrahedra, ${(bytes / 1e6).toFixed(1)} MB: most tetrahedra held`, most('tets'), '', 1e6);
report('  of the uniform level of the same error', (100 * most('tets')) / uniform.tets, '%');
report('  most bytes of pages held', most('held') / 1e6, 'MB');
report('  all bytes that came, of the uniform level', (100 * most('fetched')) / uniform.bytes, '%', 25);
report('  worst place in a picture', most('pixels'), 'pixels', pixels);
report(
  '  from a stop to the next one, with all its pages, median',
  seen.map(({ seconds }) => seconds).sort((a, b) => a - b)[stops >> 1],
  's',
);
report('  frames of at most 100 ms', (100 * frames.filter((f) => f <= 100).length) / frames.length, '%', 95, true);
report('  longest task of the page, processor time', await longestTask(), 'ms', 100);
report('  until such a task ended, waiting for what draws too', Math.max(...tasks), 'ms');
if (page.complaints.length) console.log(page.complaints.join('\n'));
process.exit(0);
