// SPDX-License-Identifier: BSD-3-Clause
// The viewer of one stream: state, stream and scene told of one another.

import { TetlodStream } from '../client/stream.js';
import { Axes } from './axes.js';
import { chooseFile } from './choose_file.js';
import { Compass } from './compass.js';
import { mapNames } from './colors.js';
import { Controls } from './controls.js';
import { byId, coalesced, element, pause } from './dom.js';
import { planeOf } from './geometry.js';
import { autoRange, firstView, mapOf } from './first_view.js';
import { Handles } from './handles.js';
import { bindKeys, listKeys } from './keys.js';
import { componentOf, defaultTets, errorOf, fieldOf, isosurfacesOf, levelForError, measureFor, memoryOf, promiseOf, shownFields, shownMeasure, targetFieldOf, titleOf,
  wantedLevel } from './levels.js';
import { clear, notice } from './notices.js';
import { bytes, count, percent, significant } from './numbers.js';
import { Probe } from './probe.js';
import { drawScalarBar } from './scalarbar.js';
import { copyLink, savePicture } from './share.js';
import { Store, defaults, fromFragment, toFragment } from './state.js';
import { switchTheme, themes } from './theme.js';

// view/{id} on a server; ?stream=URL is any stream that can be fetched; without either somebody chooses a file. This module
// lies at the root of the site.
const root = new URL('.', import.meta.url);
const id = decodeURIComponent(/^view\/(.*)$/.exec(location.pathname.slice(root.pathname.length))?.[1] ?? '');
const file = new URLSearchParams(location.search).get('stream');
const source = await (id ? new URL(`v1/meshes/${encodeURIComponent(id)}`, root).href : file ?? chooseFile());
const name = id || nameOf(source);

// fin of …/fin.tetlod, and of …/fin/{content id}/stream
function nameOf(from) {
  const path = decodeURIComponent(from.name ?? new URL(from, location).pathname);
  return /([^/]+)\/[0-9a-f]{32}\/stream$/.exec(path)?.[1] ?? path.split('/').pop().replace(/\.tetlod$/, '');
}

const stillness = matchMedia('(prefers-reduced-motion: reduce)');
const store = new Store(fromFragment(location.hash));
let base = defaults; // what the fragment leaves out
let stream, info, scene, controls, compass, handles, axes, probe;
const workerPatience = 50; // milliseconds
let tellPictured;
const pictured = new Promise((resolve) => { tellPictured = resolve; }); // the first picture is on the screen
let level = -1; // the stream's, which the words tell
let asked = 0; // changes of what the worker is to make
let early = null; // pictures that came before there was where to draw them
let drawn = -1; // the picture's, when it has come to rest and is what was asked for
let shade = null; // { field, component, range, sample } of the picture's colours

// ---- colours and their range

// What the picture is coloured by: until a field has come, the one before.
function coloredState() {
  const { state } = store;
  return shade && !stream.fields.includes(state.field) ? { ...state, field: shade.field, component: shade.component } : state;
}

// The index has one range for all components; that of one of them, or of their length, is the picture's.
function dataRange() {
  const state = coloredState();
  const { range, components } = fieldOf(info, state.field);
  const component = componentOf(info, state);
  if (components > 1 && shade?.field === state.field && shade.component === component) return shade.range;
  return component === 'magnitude' ? [0, Math.max(...range.map(Math.abs)) || 1] : range;
}

// What isosurfaces are fractions of; it must not change while the stream comes.
function isosurfaceRange() {
  const { field, component } = isosurfacesOf(info, store.state);
  const { range, components } = fieldOf(info, field);
  return component === 'magnitude' ? [0, Math.sqrt(components) * Math.max(...range.map(Math.abs))] : range;
}

// Where there are isosurfaces, as far as is known.
function isosurfaceSpan() {
  const { colored, component } = isosurfacesOf(info, store.state);
  return colored && component === 'magnitude' ? dataRange() : isosurfaceRange();
}

// The colours' range as values; a logarithm needs positive ones.
function colorRange() {
  const { range, low, high, log } = store.state;
  let [from, to] = range === 'manual' ? [low, high]
    : range === 'auto' && !log ? autoRange(dataRange(), shade?.sample) : (range === 'visible' && scene.visibleRange()) || dataRange();
  if (from > to) [from, to] = [to, from];
  if (from === to) to = from + (Math.abs(from) * 1e-6 || 1); // a constant has one colour
  if (log && !(from > 0)) from = to > 0 ? to / 1000 : 1e-3;
  if (log && !(to > from)) to = 10 * from;
  return [from, to];
}

const colorMap = () => mapOf(store.state, dataRange());

const drawBar = coalesced(() => {
  const { reversed, log, isosurfaces } = store.state;
  const [low, high] = colorRange();
  const [least, most] = dataRange();
  const [from, to] = isosurfaceRange();
  drawScalarBar(byId('scalarbar'), {
    title: titleOf(info, coloredState()), low, high, log, map: colorMap(), reversed, below: least < low, above: most > high,
    marks: isosurfacesOf(info, store.state).colored ? isosurfaces.map((f) => from + f * (to - from)) : [],
  });
});

function recolorNow() {
  const range = colorRange();
  const [low, high] = store.state.log ? range.map(Math.log10) : range;
  scene.recolor({ ...store.state, map: colorMap() }, low, high);
  controls?.setColors(range, colorMap(), shade?.sample);
  drawBar();
}

const recolor = coalesced(recolorNow);

const setBackground = () => {
  const stage = byId('stage');
  stage.className = store.state.background === 'auto' ? '' : `on-${store.state.background}`;
  const color = getComputedStyle(stage).backgroundColor.match(/[\d.]+/g).slice(0, 3);
  scene.setBackground(color.map((c) => c / 255));
};

// ---- what the worker is to make

function showNow() {
  const { state } = store;
  const [low, high] = isosurfaceRange();
  const { field, component } = isosurfacesOf(info, state);
  stream.show({
    field: state.field,
    component: componentOf(info, state),
    surface: state.surface !== 'off',
    edges: state.edges || (state.sliceEdges && state.slices.length > 0),
    slices: state.slices.map((p) => planeOf(info.bounds, p)),
    isosurfaces: state.isosurfaces.map((f) => ({ field, component, value: low + f * (high - low) })),
    clip: state.clip && planeOf(info.bounds, state.clip),
    volume: state.volume ? { size: state.volumeSize, logarithmic: state.log } : null,
    morph: state.smooth && !stillness.matches,
    tag: asked,
  });
}

// Fields come when they are first shown; the picture before stays meanwhile.
const show = coalesced(async () => {
  const missing = shownFields(info, store.state).filter((field) => !stream.fields.includes(field));
  if (!missing.length) return showNow();
  notice('fields', `Loading ${missing.join(', ')}…`, { seconds: 0 });
  try {
    await stream.addFields(missing);
    show(); // of what is wanted by now
  } catch (error) {
    tellFailure(`${missing.join(', ')} cannot be loaded: ${error.message}`, show);
  }
  clear('fields');
});

function targetOf({ error, maxTets, maxBytes }) {
  const target = { error, tets: maxTets || defaultTets() };
  if (maxBytes) target.bytes = maxBytes;
  return target;
}

const refine = coalesced(async () => {
  const { state } = store;
  try {
    askForMore();
    await stream.refineTo({ ...targetOf(state), field: targetFieldOf(info, state), measure: measureFor(info, state) });
  } catch (error) {
    if (error.name !== 'AbortError') tellFailure(error.message);
  }
});

// ---- what is asked before it is loaded

const button = (words, act) => {
  const made = element('button', { type: 'button' }, words);
  made.addEventListener('click', act);
  return made;
};

// What the device's memory is not for is loaded when somebody says so.
function askForMore() {
  clear('budget');
  const { state } = store;
  const wanted = info.levels[levelForError(info, state)];
  if (state.maxTets || wanted.tets <= defaultTets()) return;
  notice('budget', `${state.error ? percent(state.error) : 'The original'} needs ${count(wanted.tets)} tetrahedra and about ${bytes(memoryOf(wanted.tets))} of memory.`,
    { seconds: 0, place: 'asks', children: [button('Load it', () => store.set({ maxTets: wanted.tets }))] });
}

// A drawn field that the stream does not control has an error of its own; what it takes to limit that, too, is asked.
function askForField() {
  clear('field');
  const { state } = store;
  if (targetFieldOf(info, state) === state.field) return;
  const measure = shownMeasure(info, state);
  const wanted = info.levels[levelForError(info, { ...state, errorField: state.field })];
  if (level >= 0 && errorOf(info.levels[level], state.field, measure) <= state.error) return;
  notice('field', `${state.field} is not controlled: the error shown is measured. ${percent(state.error)} of it takes ${count(wanted.tets)} tetrahedra, ${bytes(wanted.bytes)}.`,
    { seconds: 0, place: 'asks', children: [button('Load it', () => store.set({ errorField: state.field }))] });
}

// ---- what is shown, in words

function tellShown() {
  if (!controls) return;
  const { state } = store;
  const now = info.levels[level];
  byId('shown').classList.toggle('busy', level !== wantedLevel(info, state));
  const put = (where, value, small = '') => {
    const note = document.createElement('small');
    note.textContent = small;
    byId(where).replaceChildren(value, ' ', note);
  };
  const measure = shownMeasure(info, state);
  byId('stop').hidden = level === wantedLevel(info, state);
  byId('error-kind').textContent = { max: 'Certified error', sampled: 'Sampled error', rms: 'RMS error' }[measure];
  put('shown-bytes', bytes(stream.received), `of ${bytes(info.bytes)}`);
  byId('progress').value = stream.received / info.bytes;
  controls.setShown(level, stream.received);
  if (!now) return;
  const error = errorOf(now, state.field, measure);
  const span = fieldOf(info, state.field).range;
  put('shown-error', percent(error), error ? `± ${significant(error * (span[1] - span[0]), 2)}` : 'exact');
  put('shown-tets', count(now.tets), percent(now.tets / info.tets));
  byId('promise').textContent = promiseOf(info, level);
  put('shown-level', String(level), `of ${info.levels.length - 1}`);
  if (id) byId('download').href = `${source}/${info.cid}/levels/${level}/mesh.vtu`;
  byId('download').download = `${name}-${level}.vtu`;
}

// Frames a second while the picture moves; a pause of a quarter of a second is none.
function countFrames() {
  let last = 0;
  let intervals = [];
  const tell = coalesced(() => {
    const rate = intervals.length / (intervals.reduce((a, b) => a + b, 0) / 1000);
    byId('shown-fps').textContent = intervals.length > 2 ? `${Math.round(rate)} /s` : '–';
  });
  scene.addEventListener('render', () => {
    const now = performance.now();
    if (now - last < 250) intervals = [...intervals.slice(-30), now - last];
    last = now;
  });
  setInterval(tell, 500);
}

// ---- from the stream

function tellLoading({ detail: { received } }) {
  byId('loading').textContent = `Loading… ${bytes(received)}`;
}

function tellRetry({ detail: { message, delay, attempt } }) {
  notice('retry', `${message}; trying again in ${significant(delay, 2)} s (attempt ${attempt})`, { failed: true, seconds: 0 });
}

// What is decoded stays in the picture; a network may have come back.
function tellFailure(message, retry = refine) {
  clear('retry');
  const again = button('Try again', () => {
    clear('error');
    retry();
  });
  notice('error', message, { failed: true, seconds: 0, children: [again] });
}

// Colours follow what is drawn. A vector's lengths are known as they come; their range only grows, so that colours do not flicker.
function takeShade({ field, component, range: [low, high], sample }) {
  const fresh = field !== shade?.field || component !== shade.component;
  const [least, most] = fresh ? [Infinity, -Infinity] : shade.range;
  const grown = low < least || high > most;
  if (fresh || grown) shade = { field, component, range: [Math.min(low, least), Math.max(high, most)], sample: shade?.sample };
  if (sample) shade.sample = sample;
  if (fresh || sample || (grown && fieldOf(info, field).components > 1) || store.state.range === 'visible') recolorNow();
}

function takePictures(event) {
  if (!scene?.box) {
    early = event;
    return;
  }
  const pictures = event.detail;
  byId('loading').hidden = true;
  scene.addEventListener('render', tellPictured, { once: true });
  scene.update(pictures, store.state);
  takeShade(pictures.shade);
  drawn = pictures.t === 1 && pictures.tag === asked ? pictures.level : -1;
  if (pictures.t === 1) probe?.look();
  if (level === pictures.level) return;
  level = pictures.level; // the base: nothing was refined to get there
  tellShown();
}

function follow() {
  stream.addEventListener('progress', () => {
    clear('retry');
    tellShown();
  });
  stream.addEventListener('level', ({ detail }) => {
    level = detail.level;
    clear('error');
    tellShown();
  });
  stream.addEventListener('pictures', takePictures);
  stream.addEventListener('error', ({ detail }) => tellFailure(detail.message));
}

// ---- from the controls

const remember = (() => {
  let timer = 0;
  return () => {
    clearTimeout(timer);
    timer = setTimeout(() => history.replaceState(null, '', location.pathname + location.search + toFragment(store.state, base)), 250);
  };
})();

function watch() {
  store.watch(['map', 'reversed', 'range', 'low', 'high', 'log', 'isosurfaces', 'isosurfaceField'], recolor);
  store.watch(['log'], (state) => scene.setLogarithmic(state.log));
  store.watch(['shading'], (state) => scene.restyle(state));
  store.watch(['field', 'errorField', 'error'], askForField);
  store.watch(['field', 'component', 'surface', 'edges', 'sliceEdges', 'slices', 'isosurfaces', 'isosurfaceField', 'clip', 'volume', 'volumeSize', 'log', 'smooth'], () => {
    drawn = -1;
    asked++;
    show();
  });
  store.watch(['error', 'measure', 'field', 'errorField', 'maxTets', 'maxBytes'], () => {
    refine();
    tellShown();
  });
  store.watch(['surface', 'edges', 'sliceEdges', 'parallel', 'opacity', 'isosurfaceOpacity'], (state) => scene.restyle(state));
  store.watch(['slices', 'clip'], () => handles.update());
  store.watch(['axes'], (state) => axes.show(state.axes));
  const repaint = () => {
    setBackground();
    scene.restyle(store.state);
    drawBar();
  };
  store.watch(['background'], repaint);
  store.addEventListener('change', remember);
  addEventListener('hashchange', () => {
    store.set(valid(fromFragment(location.hash, base)));
    if (store.state.camera) scene.setCamera(store.state.camera);
  });
  themes.addEventListener('change', repaint);
}

function watchScene() {
  scene.addEventListener('render', () => {
    compass.draw(scene.axes());
    handles.update();
    axes.update();
  });
  scene.addEventListener('lost', () => notice('graphics', 'The browser took the graphics away; the picture comes back when it gives them again.', { failed: true, seconds: 0 }));
  scene.addEventListener('restored', () => clear('graphics'));
  scene.addEventListener('camera', () => store.set({ camera: scene.camera() }));
  byId('picture').addEventListener('dblclick', (event) => {
    const hit = scene.pick(event.offsetX, event.offsetY);
    if (hit) scene.centreOn(hit.point);
  });
  new ResizeObserver(drawBar).observe(byId('scalarbar'));
}

function planes() {
  const { slices, clip } = store.state;
  const move = (i) => (at) => store.set({ slices: store.state.slices.map((p, k) => (k === i ? { ...p, at } : p)) });
  const found = slices.map((plane, i) => ({ key: `slice-${i}`, label: `Slice ${i + 1}: place across the volume`, plane, move: move(i) }));
  if (clip) found.push({ key: 'clip', label: 'Clip: place across the volume', plane: clip, move: (at) => store.set({ clip: { ...store.state.clip, at } }) });
  return found;
}

// The direction towards the viewer, the nearest axis if the camera is all but along it.
function viewNormal() {
  const { towards } = scene.axes();
  const axis = towards.findIndex((c) => Math.abs(c) > 0.999);
  return axis < 0 ? towards.map((c) => Number(c.toPrecision(4))) : [0, 1, 2].map((i) => (i === axis ? Math.sign(towards[axis]) : 0));
}

// The level that is there is what is asked for from now on.
const stop = () => store.set({ maxTets: info.levels[level].tets });

function togglePanel() {
  const closed = document.body.classList.toggle('closed');
  byId('panel-toggle').ariaExpanded = String(!closed);
}

const toggleFullScreen = () => (document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen?.());
const cycle = (values, now) => values[(values.indexOf(now) + 1) % values.length];
const save = () => savePicture(scene, `${name}-${level}`);
const inPicture = (act) => (event) => (document.activeElement === byId('picture') ? act(event) : false);

function bindActions() {
  const help = byId('help');
  listKeys();
  for (const [id, act] of [['screenshot', save], ['stop', stop], ['copy-link', copyLink], ['fullscreen', toggleFullScreen], ['theme', switchTheme],
    ['panel-toggle', togglePanel], ['help-open', () => help.showModal()], ['help-close', () => help.close()]])
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
    b: () => store.set({ surface: cycle(['solid', 'inside', 'glass', 'off'], store.state.surface) }),
    w: () => store.set({ edges: !store.state.edges }),
    x: toggleSlice('x'),
    y: toggleSlice('y'),
    z: toggleSlice('z'),
    i: () => controls.addIsosurface(),
    c: () => store.set({ clip: store.state.clip ? null : { normal: viewNormal(), at: 0.5 } }),
    n: () => store.set({ axes: !store.state.axes }),
    v: () => controls.setInner({ volume: !store.state.volume }),
    m: () => store.set({ map: cycle(mapNames.map(([key]) => key), colorMap()) }),
    p: save,
    l: copyLink,
    f: toggleFullScreen,
    d: switchTheme,
    h: togglePanel,
    '?': () => help.showModal(),
    ArrowLeft: inPicture(() => scene.turn(10, 0)),
    ArrowRight: inPicture(() => scene.turn(-10, 0)),
    ArrowUp: inPicture(() => scene.turn(0, -10)),
    ArrowDown: inPicture(() => scene.turn(0, 10)),
    '+': inPicture(() => scene.zoom(1.2)),
    '=': inPicture(() => scene.zoom(1.2)),
    '-': inPicture(() => scene.zoom(1 / 1.2)),
  });
}

// A link may name a field that this stream does not have.
function valid(state) {
  const known = { ...state, errorField: fieldOf(info, state.errorField) ? state.errorField : '' };
  return fieldOf(info, state.field) ? known : { ...known, field: targetFieldOf(info, { errorField: '' }) };
}

const opening = (options, started) => TetlodStream.open(source, { ...options, on: { retry: tellRetry, progress: tellLoading, started } });

// The target goes with the first request, so that its bytes come at once; a link may ask for a measure or a field that is not there.
async function openStream(started) {
  const { field, isosurfaceField } = store.state;
  const fields = field ? [...new Set([field, isosurfaceField || field])] : 'first';
  stream = await opening({ target: targetOf(store.state), fields }, started)
    .catch((error) => (error instanceof RangeError ? opening({ fields: 'first' }, started) : Promise.reject(error)));
  info = stream.info;
  if (!info.fields.length) throw new Error('this stream has no fields to colour it by');
  base = { ...defaults, ...firstView(info) };
  store.state = valid(fromFragment(location.hash, base));
  follow();
  showNow();
}

function openScene({ Scene }) {
  try {
    scene = new Scene(byId('picture'));
    scene.view.get3DContext();
  } catch (error) {
    throw document.createElement('canvas').getContext('webgl2') ? error : new Error('this browser has no WebGL 2, which draws the picture');
  }
  performance.mark('tetlod-graphics');
  setBackground();
}

// The first picture is made while vtk.js and the graphics start, which takes longest. Making the graphics' context stops
// this thread, and with it a worker that is not running yet: one that is about to is waited for, a slow one is not.
async function open() {
  const code = import('./scene.js');
  let opened;
  const running = new Promise((resolve) => { opened = openStream(resolve); });
  const patience = code.then(() => new Promise((resolve) => setTimeout(resolve, workerPatience)));
  await Promise.race([running, opened, patience]);
  await Promise.all([opened, code.then(openScene)]);
}

function firstPicture() {
  scene.setBounds(info.bounds, store.state.parallel);
  if (store.state.camera) scene.setCamera(store.state.camera);
  if (early) takePictures(early);
  return pictured;
}

// Everything around the picture, in pieces that let others in between.
async function openPanel() {
  compass = new Compass(byId('compass'), (view) => scene.look(view));
  axes = new Axes(byId('handles'), scene, info.bounds);
  handles = new Handles(byId('handles'), scene, planes);
  probe = new Probe(byId('picture'), scene, stream, () => titleOf(info, coloredState()));
  watchScene();
  await pause();
  const made = new Controls(store, info, { look: (view) => scene.look(view), viewNormal, ranges: colorRange, isosurfaceRange, isosurfaceSpan, base });
  for (const build of made.parts()) {
    build();
    await pause();
  }
  controls = made;
  controls.setColors(colorRange(), colorMap(), shade?.sample);
  watch();
  await pause();
  bindActions();
  countFrames();
  tellShown();
  byId('download').hidden = !id;
  byId('controls').inert = false;
}

async function start() {
  document.title = `${name} · tetlod`;
  byId('name').textContent = name;
  await open();
  await firstPicture();
  performance.mark('tetlod-picture', { detail: { received: stream.received } });
  await openPanel();
  // what tests look at
  window.tetlod = {
    stream,
    get state() { return store.state; },
    set: (patch) => store.set(patch),
    get level() { return level; },
    get settled() { return level === wantedLevel(info, store.state) && drawn === level; },
    scene,
    probe,
  };
}

try {
  await start();
} catch (error) {
  byId('loading').hidden = true;
  const all = id ? [element('a', { href: root.href }, 'All streams')] : [];
  notice('error', `${name} cannot be shown: ${error.message}`, { failed: true, seconds: 0, children: all });
}
