// SPDX-License-Identifier: BSD-3-Clause
// Keyboard shortcuts.

import { byId } from './dom.js';

const typing = (target) =>
  target.matches?.('input:not([type=checkbox]):not([type=range]), textarea, select') || target.closest?.('dialog');

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
