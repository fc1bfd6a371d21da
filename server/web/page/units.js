// SPDX-License-Identifier: BSD-3-Clause
// The unit of what colours, as somebody types it where the file does not say it.

import { byId, element } from './dom.js';
import { unitOf, unitsOf } from './levels.js';
import { unitsText } from './promises.js';
import { row } from './rows.js';

export function bindUnits(viewer) {
  const { store } = viewer;
  const input = element('input', {
    id: 'unit',
    className: 'number',
    autocomplete: 'off',
    spellcheck: false,
    maxLength: 24,
  });
  byId('component-row').after(row('Unit', input));
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
