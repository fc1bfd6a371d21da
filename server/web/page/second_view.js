// SPDX-License-Identifier: BSD-3-Clause
// A second view of the same stream beside the first, turned together with it: the same page in a frame. What it shows is
// part of the link.

import { byId, element } from './dom.js';

const frameName = 'tetlod-second';
const isSecond = () => window.name === frameName;

// The camera is each view's own part of the link, and the second one's is the first one's.
const own = (fragment) => fragment.replace(/^#/, '').split('&').filter((part) => part && !/^(camera|second)=/.test(part)).join('&');

// What the page in the frame offers, when it is there; null once the frame is gone.
async function opened(frame) {
  while (frame.isConnected) {
    if (frame.contentWindow?.tetlod) return frame.contentWindow.tetlod;
    await new Promise((resolve) => { setTimeout(resolve, 50); });
  }
  return null;
}

// Each takes the other's camera, unless it is the one that it has.
function turnTogether(scenes) {
  let last = '';
  const take = (from, to) => () => {
    const place = from.camera();
    if (place.join() === last) return;
    last = place.join();
    to.setCamera(place);
  };
  const [first, second] = scenes;
  const listeners = [[first, take(first, second)], [second, take(second, first)]];
  for (const [scene, listener] of listeners) scene.addEventListener('render', listener);
  return () => listeners.forEach(([scene, listener]) => scene.removeEventListener('render', listener));
}

/** Follows the state's key `second`. `hasAddress`: whether another page can open the stream. */
export function bindSecondView(viewer, hasAddress) {
  const { store } = viewer;
  const box = byId('second');
  byId('second-row').hidden = isSecond() || !hasAddress;
  if (isSecond() || !hasAddress) return;
  let frame = null;
  let other = null; // what the page in the frame offers
  let part = () => {};

  async function open(fragment) {
    frame = element('iframe', { name: frameName, title: 'Second view', src: `${location.pathname}${location.search}#${fragment}` });
    byId('stage').after(frame);
    document.body.classList.add('two');
    other = await opened(frame);
    if (!other) return;
    frame.contentDocument.body.classList.add('closed'); // its panel has a button
    other.viewer.scene.setCamera(viewer.scene.camera());
    part = turnTogether([viewer.scene, other.viewer.scene]);
    const { viewer: beside } = other;
    beside.store.addEventListener('change', () => beside === other?.viewer && store.set({ second: own(beside.fragment) }));
    follow(store.state);
  }

  const follow = ({ parallel, step }) => other?.viewer.store.set({ parallel, step });

  function close() {
    part();
    frame.remove();
    frame = other = null;
    document.body.classList.remove('two');
  }

  store.watch(['parallel', 'step'], follow);
  box.addEventListener('change', () => store.set({ second: box.checked ? own(viewer.fragment) : null }));
  store.watch(['second'], ({ second }) => {
    box.checked = second !== null;
    if (second !== null && !frame) open(second);
    if (second === null && frame) close();
  });
}
