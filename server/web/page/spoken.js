// SPDX-License-Identifier: BSD-3-Clause
// The picture in words, for screen readers: its description, told whenever it has become what was asked for.

import { byId, coalesced, element } from './dom.js';
import { count } from './numbers.js';
import { promiseOf } from './promises.js';

const surfaces = { solid: 'the boundary', inside: 'the far walls', glass: 'the boundary, translucent' };
const many = (n, name) => (n ? `${n} ${name}${n > 1 ? 's' : ''}` : '');

/** What of the state is in the picture. */
export function layersOf(state) {
  const cuts = [state.clip && 'clipped', state.box && 'in a box', state.threshold && 'within a threshold'];
  return [
    surfaces[state.surface],
    many(state.slices.length, 'slice'),
    many(state.isosurfaces.length, 'isosurface'),
    state.vectors !== 'off' && state.vectors,
    state.volume && 'the volume',
    ...cuts,
  ]
    .filter(Boolean)
    .join(', ');
}

function wordsOf(viewer) {
  const { at, info, level, store, told } = viewer;
  const { tets } = told.finer?.pages >= 0 ? told.finer : info.levels[level];
  const step = at ? `, step ${at.step}` : '';
  return `${viewer.title}${step}: ${layersOf(store.state)}. ${promiseOf(told, level)}; ${count(tets)} tetrahedra.`;
}

export function bindSpoken(viewer) {
  const words = element('p', { id: 'spoken', className: 'unseen', role: 'status' });
  byId('promise').after(words);
  byId('picture').setAttribute('aria-describedby', 'spoken');
  const tell = coalesced(() => {
    if (!viewer.settled || viewer.playing) return;
    const text = wordsOf(viewer);
    if (words.textContent !== text) words.textContent = text;
  });
  viewer.addEventListener('pictures', ({ detail: { t } }) => t === 1 && tell());
  viewer.store.addEventListener('change', tell);
  tell();
}
