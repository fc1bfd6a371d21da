// SPDX-License-Identifier: BSD-3-Clause
// Another stream beside this one: in a frame, behind a curtain, or its values subtracted.

import { byId, element } from './dom.js';
import { titleOf, unitOf } from './levels.js';
import { notice } from './notices.js';
import { roundedUp, significant } from './numbers.js';
import { id, root } from './opened.js';
import { row } from './rows.js';

/** Where the stream with this name is: a mesh of this server, or any file. */
export const sourceOf = (other) =>
  /[/:]/.test(other) ? new URL(other, location).href : new URL(`v1/meshes/${encodeURIComponent(other)}`, root).href;

/** The page that shows it. */
export const pageOf = (other) =>
  /[/:]/.test(other)
    ? `${root.pathname}view.html?stream=${encodeURIComponent(sourceOf(other))}`
    : `${root.pathname}view/${encodeURIComponent(other)}`;

// The catalogue's names, when somebody looks for them.
async function listOthers(list) {
  try {
    const { meshes } = await (await fetch(new URL('v1/meshes?limit=200', root))).json();
    list.replaceChildren(
      ...meshes.filter((mesh) => mesh.id !== id).map((mesh) => element('option', { value: mesh.id })),
    );
  } catch {
    list.replaceChildren(); // a host without a catalogue: an address can be typed
  }
}

function makeControls() {
  const others = element('datalist', { id: 'others' });
  const other = element('input', {
    id: 'other',
    className: 'number',
    autocomplete: 'off',
    spellcheck: false,
    placeholder: 'name or address',
  });
  other.setAttribute('list', 'others');
  const ways = [
    ['beside', 'side by side'],
    ['curtain', 'curtain'],
    ['difference', 'difference'],
  ];
  const way = element('select', { id: 'compare' }, ...ways.map(([value, text]) => element('option', { value }, text)));
  const words = element('p', { id: 'compare-words', className: 'hint', role: 'status' });
  const details = element(
    'details',
    { id: 'compare-body' },
    element('summary', {}, 'Another stream'),
    row('Stream', other),
    others,
    row('Compared', way),
    words,
  );
  byId('second-row').after(details);
  let listed = false;
  other.addEventListener('focus', () => {
    if (!listed) listOthers(others);
    listed = true;
  });
  return { other, way, words, details };
}

function wordsOf({ difference, info, store: { state } }) {
  if (!state.other) return '';
  if (state.compare !== 'difference') return 'Fields, layers, colours and camera are those of this view.';
  if (!difference?.bound) return 'On its way …';
  const {
    bound: { bound, certified },
    state: shown,
  } = difference;
  const moved = state.warp ? ' Points are where they are without being moved.' : '';
  const title = `${titleOf(info, shown)} here less there`;
  if (bound === null) return `${title}, without a bound.${moved}`;
  const unit = shown.formula ? '' : unitOf(info, shown.field);
  const amount = `${significant(roundedUp(bound, 2), 2)}${unit && ` ${unit}`}`;
  const how = certified ? 'certified' : 'measured';
  return `${title}: the originals' difference is within ± ${amount} of it (${how}), where both have a place.${moved}`;
}

/** Follows the state's keys `other` and `compare`; second_view.js has the frame. */
export function bindCompare(viewer) {
  const { store } = viewer;
  if (window.name === 'tetlod-second') return; // which is compared itself
  const { other, way, words, details } = makeControls();
  other.addEventListener('change', () => store.set({ other: other.value.trim() }));
  way.addEventListener('change', () => store.set({ compare: way.value }));
  const tell = () => {
    words.textContent = wordsOf(viewer);
  };
  store.watch(['other', 'compare', 'field', 'component', 'formula', 'warp', 'error'], (state) => {
    other.value = state.other;
    way.value = state.compare;
    if (state.other) details.open = true;
    tell();
  });
  viewer.addEventListener('pictures', tell);
  let subtracted = '';
  store.watch(['other', 'compare'], async (state) => {
    const wanted = state.compare === 'difference' ? state.other : '';
    if (wanted === subtracted) return;
    subtracted = wanted;
    const difference = wanted ? new (await import('./difference.js')).Difference(viewer, sourceOf(wanted)) : null;
    if (subtracted !== wanted) return;
    viewer.subtract(difference, (error) =>
      notice('compare', `The difference cannot be shown: ${error.message}`, { failed: true }),
    );
  });
}
