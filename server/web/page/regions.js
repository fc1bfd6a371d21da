// SPDX-License-Identifier: BSD-3-Clause
// The panel's list of regions: values of cells say which region each is in; each can be hidden.

import { byId, element } from './dom.js';
import { regionFields } from './levels.js';
import { count } from './numbers.js';
import { row } from './rows.js';

const none = ''; // of the choice: no regions

function rowOf({ number, tets }, change) {
  const box = element('input', { type: 'checkbox', className: 'switch', id: `region-${number}` });
  box.addEventListener('change', () => change(number, box.checked));
  return row([`${number} `, element('small', {}, `${count(tets)} cells`)], box);
}

export function bindRegions(viewer) {
  const { store, info, stream } = viewer;
  const [choice, list, words] = ['regions', 'region-list', 'regions-words'].map(byId);
  const able = regionFields(info);
  byId('regions-body').hidden = !able.length;
  if (!able.length) return;
  choice.replaceChildren(
    element('option', { value: none }, 'none'), ...able.map((name) => element('option', { value: name }, name)));

  // what is left is looked at from outside
  const hide = (hidden) => store.set({
    hidden: hidden.sort((a, b) => a - b),
    ...(hidden.length && !store.state.hidden.length ? { surface: 'solid' } : {})
  });
  const put = (number, shown) =>
    hide(shown ? store.state.hidden.filter((n) => n !== number) : [...store.state.hidden, number]);
  const numbers = () => (viewer.regions.get(store.state.regions) ?? []).map(({ number }) => number);
  choice.addEventListener('change', () => store.set({ regions: choice.value, hidden: [] }));
  byId('regions-show').addEventListener('click', () => hide([]));
  byId('regions-hide').addEventListener('click', () => hide(numbers()));

  let listed = null;
  const tick = () => {
    const { hidden } = store.state;
    for (const number of numbers()) byId(`region-${number}`).checked = !hidden.includes(number);
  };
  const tell = () => {
    const name = store.state.regions;
    const regions = viewer.regions.get(name);
    choice.value = name;
    byId('regions-all').hidden = !name;
    words.textContent = regions === null ? 'These are too many numbers for a list.' : '';
    if (listed !== regions) list.replaceChildren(...(regions ?? []).map((region) => rowOf(region, put)));
    listed = regions;
    tick();
  };
  store.watch(['regions'], ({ regions }) => {
    tell();
    if (regions && !viewer.regions.has(regions))
      stream.loadCells(regions).catch((error) => {
        words.textContent = error.message;
      });
  });
  store.watch(['hidden'], tick);
  viewer.addEventListener('cells', tell);
}
