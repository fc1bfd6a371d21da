// SPDX-License-Identifier: BSD-3-Clause
// The panel's part of look_here.js: whether pages follow what the camera sees, how exactly, and what came of it.

import { byId, element } from './dom.js';
import { measureFor, targetFieldOf } from './levels.js';
import { bytes, count, parseNumber, percent, significant } from './numbers.js';
import { row } from './rows.js';

const usual = 2; // pixels

export class LookControls {
  #viewer;
  #parts;

  constructor(viewer) {
    this.#viewer = viewer;
    if (!viewer.info.paged) return;
    this.#parts = this.#build();
    viewer.store.watch(['pixels'], () => this.#tell());
    viewer.addEventListener('info', () => this.#tell());
  }

  #build() {
    const on = element('input', { id: 'look-on', className: 'switch', type: 'checkbox' });
    const pixels = element('input', { id: 'look-pixels', className: 'number', inputMode: 'decimal' });
    const words = element('p', { id: 'look-words', className: 'hint' });
    words.role = 'status';
    const details = element(
      'details',
      { id: 'look' },
      element('summary', {}, 'Detail where one looks'),
      row('More where the picture is near', on),
      row('Error on the screen, pixels', pixels),
      words,
    );
    byId('max-tets').closest('details').after(details);
    const { store } = this.#viewer;
    on.addEventListener('change', () => store.set({ pixels: on.checked ? usual : 0 }));
    pixels.addEventListener('change', () => {
      const value = parseNumber(pixels.value);
      if (value > 0) store.set({ pixels: value });
      this.#tell();
    });
    return { details, on, pixels, words };
  }

  #tell() {
    const { details, on, pixels, words } = this.#parts;
    const { state } = this.#viewer.store;
    on.checked = state.pixels > 0;
    pixels.disabled = !on.checked;
    pixels.value = on.checked ? significant(state.pixels, 3) : '';
    if (on.checked) details.open = true;
    words.textContent = this.#words(state);
  }

  #words(state) {
    const { finer, info, at } = this.#viewer;
    if (!state.pixels)
      return `${info.levels.length - info.paged} levels are stored in pages: only those that are seen are loaded.`;
    if (at) return 'Steps in time are shown without pages.';
    if (finer?.pages === undefined) return 'On the way.';
    const { worst, pixels, refused } = finer;
    const field = targetFieldOf(info, state);
    const error = info.levels[worst].errors[field]?.[measureFor(info, state)] ?? 1;
    const why = refused ? '; more would pass the budget of tetrahedra or bytes' : '; pages have nothing finer';
    const off = `${percent(error)}, ${significant(pixels, 2)} pixels off${pixels > state.pixels ? why : ''}`;
    return `${count(finer.pages)} pages, ${bytes(finer.held)} held. The worst place in the picture is ${off}.`;
  }
}
