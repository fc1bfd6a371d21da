// SPDX-License-Identifier: BSD-3-Clause
// Keyboard shortcuts, and the list of them.

import { byId, element } from './dom.js';

const groups = [
  ['[ ]', 'one level coarser, finer'],
  ['← ↑ → ↓ + −', 'turn and zoom (in the picture)'],
  ['1 … 6', 'look from ±x, ±y, ±z'],
  ['0', 'everything, from a corner'],
  ['Space', 'play or pause a series in time'],
  [', .', 'one step back, on'],
  ['B', 'boundary: solid, far walls, translucent, off'],
  ['W', 'wireframe'],
  ['X Y Z', 'a slice, or none, across x, y, z'],
  ['I', 'add an isosurface'],
  ['C', 'clip across the view, or no clip'],
  ['K', 'plot over a line, or none'],
  ['O', 'keep a probe under the pointer'],
  ['V', 'volume rendering'],
  ['M', 'next colour map'],
  ['N', 'axes with numbers'],
  ['P', 'save a picture'],
  ['L', 'copy a link'],
  ['F', 'full screen'],
  ['D', 'light or dark'],
  ['H', 'hide or show the controls'],
  ['double-click', 'turn about that point'],
  ['?', 'this list'],
];

export function listKeys() {
  byId('keys').replaceChildren(...groups.flatMap(([keys, does]) => [
    element('dt', {}, ...keys.split(' ').flatMap((k, i) => [i ? ' ' : '', k === '…' ? k : element('kbd', {}, k)])),
    element('dd', {}, does),
  ]));
}

const typing = (target) => target.matches?.('input:not([type=checkbox]):not([type=range]), textarea, select') || target.closest?.('dialog');

// `actions`: what each key does, by the key. vtk.js has shortcuts of its own, which these stand before.
export function bindKeys(actions) {
  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || typing(event.target)) return;
    const act = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!act || act(event) === false) return;
    event.preventDefault();
    event.stopPropagation();
  }, { capture: true });
  byId('picture').addEventListener('keypress', (event) => event.stopPropagation(), { capture: true });
}
