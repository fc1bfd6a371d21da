// SPDX-License-Identifier: BSD-3-Clause
// A second view beside the first, or behind a curtain over it, turned together with it: the same page in a frame. It is
// of the same stream, with a state of its own, which is part of the link; or of another one, in the state of the first.

import { pageOf } from './compare.js';
import { byId, element } from './dom.js';
import { add } from './geometry.js';
import { fieldOf } from './levels.js';
import { clamp } from './numbers.js';

const frameName = 'tetlod-second';
const isSecond = () => window.name === frameName;

// The camera is each view's own part of the link, and the second one's is the first one's.
const own = (fragment) =>
  fragment
    .replace(/^#/, '')
    .split('&')
    .filter((part) => part && !/^(camera|second|other|compare|curtain)=/.test(part))
    .join('&');

// What the page in the frame offers, when it is there; null once the frame is gone.
async function opened(frame) {
  while (frame.isConnected) {
    if (frame.contentWindow?.tetlod) return frame.contentWindow.tetlod;
    await new Promise((resolve) => {
      setTimeout(resolve, 50);
    });
  }
  return null;
}

// A camera is relative to the middle of its stream.
const moved = (place, by) => place.map((x, i) => (i < 6 ? x + by[i % 3] : x));

// Each takes the other's camera, unless it is the one that it has.
function turnTogether(scenes) {
  let last = '';
  const take = (from, to) => () => {
    const place = moved(from.camera(), add(from.centre, to.centre, -1));
    if (place.join() === last) return;
    to.setCamera(place);
    last = moved(to.camera(), add(to.centre, from.centre, -1)).join();
  };
  const [first, second] = scenes;
  const listeners = [
    [first, take(first, second)],
    [second, take(second, first)],
  ];
  for (const [scene, listener] of listeners) scene.addEventListener('render', listener);
  return () => listeners.forEach(([scene, listener]) => scene.removeEventListener('render', listener));
}

// What the view of another stream has of the first one's state: all but what is of that one only.
function shared({ camera, second, other, compare, curtain, maxTets, maxBytes, pins, line, ...state }, { info }) {
  const { field, ...rest } = state;
  return fieldOf(info, field) ? state : rest;
}

// A bar that is dragged across the picture.
function makeCurtain(store, stage) {
  const bar = element('div', {
    id: 'curtain',
    role: 'slider',
    tabIndex: 0,
    ariaLabel: 'Curtain: left this stream, right the other',
    ariaValueMin: '0',
    ariaValueMax: '100',
  });
  const put = (at) => store.set({ curtain: Number(clamp(at, 0, 1).toPrecision(4)) });
  bar.addEventListener('pointerdown', (event) => {
    bar.setPointerCapture(event.pointerId);
    event.preventDefault();
    bar.focus();
  });
  bar.addEventListener('pointermove', (event) => {
    const { left, width } = stage.getBoundingClientRect();
    if (bar.hasPointerCapture(event.pointerId)) put((event.clientX - left) / width);
  });
  bar.addEventListener('keydown', (event) => {
    const step = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
    if (!step) return;
    event.preventDefault();
    put(store.state.curtain + step);
  });
  return bar;
}

/** Follows the state's keys `second`, `other`, `compare` and `curtain`. `hasAddress`: whether another page can open the
 * stream. */
export function bindSecondView(viewer, hasAddress) {
  const { store } = viewer;
  const box = byId('second');
  const stage = byId('stage');
  byId('second-row').hidden = isSecond() || !hasAddress;
  if (isSecond()) return;
  const bar = makeCurtain(store, stage);
  let frame = null;
  let other = null; // what the page in the frame offers
  let shown = ''; // whose page that is
  let shownAs = ''; // and how
  let part = () => {};

  // The stream whose page is wanted in the frame: '.' this one, '' none.
  const wanted = (state) =>
    state.other && state.compare !== 'difference' ? state.other : state.second !== null && hasAddress ? '.' : '';

  async function open(whose) {
    const { state } = store;
    const src =
      whose === '.'
        ? `${location.pathname}${location.search}#${state.second}`
        : `${pageOf(whose)}#${own(viewer.fragment)}`;
    const made = (frame = element('iframe', { name: frameName, title: 'Second view', src }));
    place(state);
    const there = await opened(made);
    if (!there || made !== frame) return;
    other = there;
    made.contentDocument.body.classList.add('closed', 'second'); // its panel has a button; time is the first one's
    other.viewer.scene.setBottom(viewer.scene.bottom);
    other.viewer.scene.setCamera(moved(viewer.scene.camera(), add(viewer.scene.centre, other.viewer.scene.centre, -1)));
    part = turnTogether([viewer.scene, other.viewer.scene]);
    const { viewer: beside } = other;
    beside.store.addEventListener(
      'change',
      () => beside === other?.viewer && shown === '.' && store.set({ second: own(beside.fragment) }),
    );
    viewer.beside = {
      picture: (size) => there.picture(size),
      showStep: (step) => beside.series && beside.showStep(step, { band: beside.wantedBand }),
    };
    place(store.state);
    follow(store.state);
  }

  function follow(state) {
    if (!other) return;
    if (shown === '.') return other.viewer.store.set({ parallel: state.parallel, step: state.step });
    const [low, high] = viewer.colorRange(); // the same colours for the same values
    other.viewer.store.set({ ...shared(state, other.viewer), range: 'manual', low, high, map: viewer.colorMap });
  }

  function close() {
    part();
    part = () => {};
    frame.remove();
    frame = other = viewer.beside = null;
    place(store.state);
  }

  // Beside the first, or over it.
  function place({ compare, curtain }) {
    const over = Boolean(frame) && shown !== '.' && compare === 'curtain';
    if (viewer.beside) viewer.beside.curtain = over ? curtain : null;
    document.body.classList.toggle('two', Boolean(frame) && !over);
    stage.classList.toggle('curtained', over);
    stage.style.setProperty('--curtain', `${100 * curtain}%`);
    bar.ariaValueNow = String(Math.round(100 * curtain));
    if (!over) bar.remove();
    if (frame && frame.parentNode !== (over ? stage : document.body)) {
      if (over) stage.append(frame);
      else stage.after(frame);
    }
    if (over && !bar.isConnected) stage.append(bar);
  }

  store.watch(['curtain'], place);
  store.addEventListener(
    'change',
    ({ changed }) => [...changed].some((key) => key !== 'camera') && follow(store.state),
  );
  viewer.addEventListener('colors', () => follow(store.state));
  viewer.addEventListener('step', ({ detail: { step } }) => viewer.playing && other?.viewer.store.set({ step }));
  box.addEventListener('change', () => store.set({ second: box.checked ? own(viewer.fragment) : null }));
  store.watch(['second', 'other', 'compare'], (state) => {
    box.checked = state.second !== null;
    const whose = wanted(state);
    const key = whose && whose !== '.' ? `${whose} ${state.compare}` : whose; // a frame that is moved loads anew anyway
    if (key === shownAs) return;
    if (frame) close();
    shownAs = key;
    shown = whose;
    if (whose) open(whose);
  });
}
