// SPDX-License-Identifier: BSD-3-Clause
// What is around the picture: the panel and its words, handles, keys, and what leaves the page.

import { Axes } from './axes.js';
import { mapNames } from './colors.js';
import { Controls } from './controls.js';
import { byId, coalesced, pause } from './dom.js';
import { bindKeys } from './keys.js';
import {
  colouredOf,
  defaultTets,
  errorOf,
  fieldOf,
  levelForError,
  memoryOf,
  shownField,
  shownMeasure,
  spanOf,
  targetFieldOf,
  titleOf,
  unitOf,
  wantedLevel
} from './levels.js';
import { boundShown, promiseOf } from './promises.js';
import { button, clear, notice } from './notices.js';
import { bytes, count, percent, roundedUp, significant } from './numbers.js';
import { id, name, source, viewer } from './opened.js';
import { Probe } from './probe.js';
import { switchTheme, themes } from './theme.js';

const { store } = viewer;
let controls, compass, handles, axes, tools, probe, player;

// ---- what is asked before it is loaded

// What the device's memory is not for is loaded when somebody says so.
function askForMore() {
  clear('budget');
  const { info } = viewer;
  const { state } = store;
  const wanted = info.levels[levelForError(info, state)];
  if (state.maxTets || (info.paged && state.pixels) || wanted.tets <= defaultTets()) return;
  const look = info.paged ? [button('Detail where I look', () => store.set({ pixels: 2 }))] : [];
  notice('budget',
    `${state.error ? percent(state.error) : 'The original'} needs ${count(wanted.tets)} tetrahedra and about ${
      bytes(memoryOf(wanted.tets))} of memory.`,
    { seconds: 0, place: 'asks', children: [...look, button('Load it', () => store.set({ maxTets: wanted.tets }))] });
}

// A drawn field that the stream does not control has an error of its own; what it takes to limit that, too, is asked.
function askForField() {
  clear('field');
  const { info, level } = viewer;
  const { state } = store;
  if (targetFieldOf(info, state) === shownField(info, state)) return;
  const measure = shownMeasure(info, state);
  const wanted = info.levels[levelForError(info, { ...state, errorField: state.field })];
  if (level >= 0 && errorOf(info.levels[level], state.field, measure) <= state.error) return;
  notice('field',
    `${state.field} is not controlled: the error shown is measured. ${percent(state.error)} of it takes ${
      count(wanted.tets)} tetrahedra, ${bytes(wanted.bytes)}.`,
    { seconds: 0, place: 'asks', children: [button('Load it', () => store.set({ errorField: state.field }))] });
}

// ---- what is shown, in words

let told = -1; // the level that the words are of

// How far off what colours is: a field's components, or what has a bound of its own.
function amountOf(error, field, measure) {
  const { told: info, level, finer, coloredState: state } = viewer;
  const { cells, component, formula } = colouredOf(info, state);
  if (measure === 'max' && (cells || formula || component === 'magnitude'))
    return `${titleOf(info, state)} ${boundShown(info, finer?.worst ?? level, state, undefined, 'outside').words}`;
  if (!error) return 'exact';
  const amount = significant(roundedUp(error * spanOf(fieldOf(info, field)), 2), 2);
  return `± ${amount} ${unitOf(info, field) || 'in its units'}`;
}

function tellShown() {
  const { stream, info, level } = viewer;
  const { state } = store;
  const now = info.levels[level];
  told = level;
  byId('shown').classList.toggle('busy', level !== wantedLevel(info, state));
  const put = (where, value, small = '') => {
    const note = document.createElement('small');
    note.textContent = small;
    byId(where).replaceChildren(value, ' ', note);
  };
  const measure = shownMeasure(info, state);
  byId('stop').hidden = level === wantedLevel(info, state);
  byId('error-kind').textContent = { max: 'Certified error', sampled: 'Sampled error', rms: 'RMS error' }[measure];
  put('shown-bytes', bytes(stream.fetched));
  byId('progress').value = stream.received / info.levels[wantedLevel(info, state)].bytes;
  controls.setShown(level, stream.received);
  if (!now) return;
  const field = shownField(info, state);
  const { finer } = viewer;
  const error = errorOf(viewer.told.levels[finer?.worst ?? level], field, measure);
  put('shown-error', percent(roundedUp(error, 3)), amountOf(error, field, measure));
  const tets = finer?.tets ?? now.tets;
  put('shown-tets', count(tets), percent(tets / info.tets));
  byId('promise').textContent = promiseOf(viewer.told, level);
  if (finer?.finest) put('shown-level', `${finer.worst}–${finer.finest}`);
  else put('shown-level', String(level), `of ${info.levels.length - 1}`);
  const { at } = viewer;
  if (id)
    byId('download').href =
      `${source}/${info.cid}/${at ? `bands/${at.band}/steps/${at.step}` : `levels/${level}`}/mesh.vtu`;
  byId('download').download = `${name}-${at ? `step${at.step}-${at.band}` : level}.vtu`;
}

// Frames a second while the picture moves. A pause of a quarter of a second is none, unless the camera is being moved
// meanwhile.
function countFrames() {
  let last = 0;
  let moving = false;
  let fresh = false; // else nothing is said: screen readers hear of each change
  let intervals = [];
  const isMoving = () => viewer.scene.interactor.isAnimating();
  const tell = () => {
    if (!fresh) return;
    fresh = false;
    const rate = intervals.length / (intervals.reduce((a, b) => a + b, 0) / 1000);
    byId('shown-fps').textContent =
      intervals.length > 2 ? `${rate < 9.5 ? significant(rate, 2) : Math.round(rate)} /s` : '–';
  };
  viewer.scene.addEventListener('render', () => {
    const now = performance.now();
    if (now - last < 250 || (moving && isMoving())) intervals = [...intervals.slice(-30), now - last];
    last = now;
    fresh = true;
    moving = isMoving();
  });
  setInterval(tell, 500);
}

// ---- from the stream

function listen() {
  viewer.addEventListener('level', tellShown);
  viewer.addEventListener('pictures', ({ detail: { t, level, zones } }) => {
    if (t === 1) controls.setZones({ zones, level });
    if (t === 1) probe.look();
    if (level !== told) tellShown();
  });
  const tellSoon = coalesced(tellShown);
  for (const event of ['progress', 'fetched']) viewer.addEventListener(event, tellSoon);
  for (const event of ['step', 'cells', 'info']) viewer.addEventListener(event, tellShown);
  viewer.addEventListener('colors', ({ detail }) => {
    controls.setColors(detail);
    tellSoon();
  });
}

// ---- from the controls

// What somebody chose is a step back of the browser's; how it is turned, and the time, are part of the last one.
const remember = (() => {
  const passing = ['camera', 'step', 'second'];
  let timer = 0;
  let chosen = false;
  const write = () => {
    const { fragment } = viewer;
    if (fragment !== location.hash)
      history[chosen ? 'pushState' : 'replaceState'](null, '', location.pathname + location.search + fragment);
    chosen = false;
  };
  const change = ({ changed }) => {
    chosen ||= [...changed].some((key) => !passing.includes(key));
    clearTimeout(timer);
    timer = setTimeout(write, 250);
  };
  const forget = () => {
    clearTimeout(timer);
    chosen = false;
  };
  return { change, forget };
})();

// What the browser goes back or forward to is no new step, which would end the way forward. The state is that of the
// address at once (which 'hashchange' would tell a task later): nothing is written over the step that was gone to.
function followHash() {
  viewer.fragment = location.hash;
  remember.forget();
}

function watch() {
  viewer.follow();
  store.watch(['field', 'errorField', 'error'], askForField);
  store.watch(['error', 'measure', 'field', 'errorField', 'maxTets', 'maxBytes', 'pixels'], () => {
    askForMore();
    tellShown();
  });
  store.watch(['slices', 'clip'], () => handles?.update());
  store.watch(['axes'], (state) => axes.show(state.axes));
  store.addEventListener('change', remember.change);
  addEventListener('popstate', followHash);
  themes.addEventListener('change', () => viewer.repaint());
}

function watchScene() {
  const { scene } = viewer;
  scene.addEventListener('render', () => {
    compass?.draw(scene.axes());
    handles?.update();
    axes.update();
    tools?.update();
  });
  scene.addEventListener('lost',
    () => notice('graphics', 'The browser took the graphics away; the picture comes back when it gives them again.',
      { failed: true, seconds: 0 }));
  scene.addEventListener('restored', () => clear('graphics'));
  scene.addEventListener('camera', () => store.set({ camera: scene.camera() }));
  byId('picture').addEventListener('dblclick', (event) => {
    const hit = scene.pick(event.offsetX, event.offsetY);
    if (hit && event.shiftKey) tools?.refine({ x: event.offsetX, y: event.offsetY });
    else if (hit) scene.centreOn(hit.point);
  });
  new ResizeObserver(viewer.drawBar).observe(byId('scalarbar'));
}

function planes() {
  const { slices, clip } = store.state;
  const move = (i) => (at) => store.set({ slices: store.state.slices.map((p, k) => (k === i ? { ...p, at } : p)) });
  const found = slices.map(
    (plane, i) => ({ key: `slice-${i}`, label: `Slice ${i + 1}: place across the volume`, plane, move: move(i) }));
  if (clip)
    found.push({
      key: 'clip',
      label: 'Clip: place across the volume',
      plane: clip,
      move: (at) => store.set({ clip: { ...store.state.clip, at } })
    });
  return found;
}

// The direction towards the viewer, the nearest axis if the camera is all but along it.
function viewNormal() {
  const { towards } = viewer.scene.axes();
  const axis = towards.findIndex((c) => Math.abs(c) > 0.999);
  return axis < 0 ? towards.map((c) => Number(c.toPrecision(4)))
                  : [0, 1, 2].map((i) => (i === axis ? Math.sign(towards[axis]) : 0));
}

// What is there is asked for from now on: its error, which the panel shows and the link has.
const stop = () => controls.chooseLevel(viewer.level);

function togglePanel() {
  const closed = document.body.classList.toggle('closed');
  byId('panel-toggle').ariaExpanded = String(!closed);
}

const toggleFullScreen = () =>
  (document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen?.());
const cycle = (values, now) => values[(values.indexOf(now) + 1) % values.length];
const textsOfPicture = () => ({
  Title: name,
  Description: `${titleOf(viewer.info, viewer.coloredState)}, level ${viewer.level} of ${
    viewer.info.levels.length - 1}: ${promiseOf(viewer.told, viewer.level)}; content ${viewer.info.cid}`,
  Source: new URL(location.pathname + location.search + viewer.fragment, location).href,
  Software: 'tetlod',
});
const drawOver = () => {
  viewer.drawBarNow();
  compass?.draw(viewer.scene.axes());
};
const sharing = () => import('./share.js');
const copyLink = async () => (await sharing()).copyLink();
const asShown = () => ({
  size: tools?.pictureSize() ?? null,
  redraw: drawOver,
  layers: [axes, ...(tools?.layers ?? [])],
  beside: viewer.beside,
});
const save = async () =>
  (await sharing()).savePicture(viewer.scene, `${name}-${viewer.level}`, { texts: textsOfPicture(), ...asShown() });
const picture = async (size) => (await sharing()).pictureOf(viewer.scene, { ...asShown(), ...(size && { size }) });
const saveAs = async (ending, blob) => (await sharing()).saveFile(`${name}-${viewer.level}-${ending}`, blob);
const inPicture = (act) => (event) => (document.activeElement === byId('picture') ? act(event) : false);

function bindActions() {
  const { scene } = viewer;
  const showHelp = async () => (await import('./keys_list.js')).showKeys();
  for (const [id, act] of [['screenshot', save], ['save-png', save], ['stop', stop], ['copy-link', copyLink],
         ['fullscreen', toggleFullScreen], ['theme', switchTheme], ['panel-toggle', togglePanel],
         ['help-open', showHelp]])
    byId(id).addEventListener('click', act);
  const toggleSlice = (axis) => () => {
    const normal = { x: 0, y: 1, z: 2 }[axis];
    const rest = store.state.slices.filter((p) => Math.abs(p.normal[normal]) !== 1);
    if (rest.length < store.state.slices.length) controls.setInner({ slices: rest });
    else controls.addSlice(axis);
  };
  const views = ['+x', '-x', '+y', '-y', '+z', '-z'];
  bindKeys({
    '[': () => controls.step(-1),
    ']': () => controls.step(1),
    0: () => scene.look('oblique'),
    ...Object.fromEntries(views.map((view, i) => [i + 1, () => scene.look(view)])),
    ' ': ({ target }) => (player && !target.closest('button, a, summary, input, select') ? player.toggle() : false),
    ',': () => player?.step(-1),
    '.': () => player?.step(1),
    b: () => store.set({ surface: cycle(['solid', 'inside', 'glass', 'off'], store.state.surface) }),
    w: () => store.set({ edges: !store.state.edges }),
    x: toggleSlice('x'),
    y: toggleSlice('y'),
    z: toggleSlice('z'),
    i: () => controls.addIsosurface(),
    c: () => store.set({ clip: store.state.clip ? null : { normal: viewNormal(), at: 0.5 } }),
    n: () => store.set({ axes: !store.state.axes }),
    k: () => controls.toggleLine(),
    o: () => tools?.addPin(),
    r: () => tools?.refine(),
    v: () => controls.setInner({ volume: !store.state.volume }),
    m: () => store.set({ map: cycle(mapNames.map(([key]) => key), viewer.colorMap) }),
    p: save,
    l: copyLink,
    f: toggleFullScreen,
    d: switchTheme,
    h: togglePanel,
    '?': showHelp,
    ArrowLeft: inPicture(() => scene.turn(10, 0)),
    ArrowRight: inPicture(() => scene.turn(-10, 0)),
    ArrowUp: inPicture(() => scene.turn(0, -10)),
    ArrowDown: inPicture(() => scene.turn(0, 10)),
    '+': inPicture(() => scene.zoom(1.2)),
    '=': inPicture(() => scene.zoom(1.2)),
    '-': inPicture(() => scene.zoom(1 / 1.2)),
  });
}

// What is not needed at first comes when everything else is there.
async function openTools() {
  try {
    const [tool, { lateStyles }] = await Promise.all([import('./tools.js'), import('./late_styles.js')]);
    await lateStyles();
    compass = new tool.Compass(byId('compass'), (view) => viewer.scene.look(view));
    compass.draw(viewer.scene.axes());
    handles = new tool.Handles(byId('handles'), viewer.scene, planes);
    handles.update();
    tools = new tool.Tools(viewer, {
      layer: byId('handles'),
      save: saveAs,
      picture,
      pointer: () => probe.at,
      canOpenAnother: typeof source === 'string',
      controls
    });
    tools.update();
  } catch (error) {
    notice('tools', `Some of the controls cannot be loaded: ${error.message}`, { failed: true, seconds: 0 });
  }
}

// Everything around the picture, in pieces that let others in between.
export async function openPanel() {
  const { scene, stream, info } = viewer;
  const look = (view) => scene.look(view);
  axes = new Axes(byId('handles'), scene, info.bounds);
  probe = new Probe(byId('picture'), scene, stream, () => viewer.title);
  watchScene();
  await pause();
  const made = new Controls(viewer, { look, viewNormal });
  for (const build of made.parts()) {
    build();
    await pause();
  }
  controls = made;
  listen();
  viewer.recolorNow();
  watch();
  await pause();
  bindActions();
  const offerSteps = async () => {
    const [{ Player }, { lateStyles }] = await Promise.all([import('./player.js'), import('./late_styles.js')]);
    await lateStyles();
    player ??= new Player(viewer, byId('stage'), byId('notices'));
  };
  viewer.addEventListener('series', offerSteps);
  if (viewer.series) offerSteps();
  countFrames();
  tellShown();
  byId('download').hidden = !id;
  performance.mark('tetlod-panel');
  await openTools();
  byId('controls').inert = false;
  // what tests and a second view look at
  window.tetlod = {
    viewer,
    stream: viewer.stream,
    get state() { return store.state; },
    set: (patch) => store.set(patch),
    get level() { return viewer.level; },
    get at() { return viewer.at; },
    get settled() { return viewer.settled; },
    scene: viewer.scene,
    picture,
    probe,
  };
}
