// SPDX-License-Identifier: BSD-3-Clause
// What the keys do, in words: loaded when somebody asks.

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
  ['R', 'finer in a box under the pointer; so does Shift with a double click'],
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

const dialogHtml = `
<dialog id="help" aria-labelledby="help-title" tabindex="-1">
  <h2 id="help-title">Keys</h2>
  <dl id="keys"></dl>
  <a href="${new URL('./notices.txt', import.meta.url)}">Licences</a>
  <button type="button" id="help-close">Close</button>
</dialog>`;

/** Shows them. */
export function showKeys() {
  if (!document.getElementById('help')) make();
  byId('help').showModal();
  byId('help').focus(); // its name is read, not its link's
}

function make() {
  document.body.insertAdjacentHTML('beforeend', dialogHtml);
  byId('help-close').addEventListener('click', () => byId('help').close());
  byId('keys').replaceChildren(
    ...groups.flatMap(([keys, does]) => [
      element('dt', {}, ...keys.split(' ').flatMap((k, i) => [i ? ' ' : '', k === '…' ? k : element('kbd', {}, k)])),
      element('dd', {}, does),
    ]),
  );
}
