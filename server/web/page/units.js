// SPDX-License-Identifier: BSD-3-Clause
// The unit of what colours, as somebody types it where the file does not say it.

import { byId, element } from './dom.js';
import { unitOf, unitsOf } from './levels.js';
import { unitsText } from './promises.js';

export function bindUnits(viewer) {
  const { store } = viewer;
  const input = element('input', { id: 'unit', className: 'number', autocomplete: 'off', spellcheck: false });
  const label = element('label', { htmlFor: 'unit' }, 'Unit');
  byId('component-row').after(element('div', { className: 'row' }, label, input));
  const shown = () => store.state.cells || store.state.field;
  input.addEventListener('change', () => {
    const units = unitsOf(store.state).set(shown(), input.value.trim());
    store.set({ units: unitsText(units) });
  });
  store.watch(['units', 'field', 'cells', 'formula'], (state) => {
    input.value = unitOf(viewer.info, shown());
    input.disabled = Boolean(state.formula);
  });
}
