// SPDX-License-Identifier: BSD-3-Clause
// Short messages over the picture, or in the panel, which never stop anybody.

import { byId, element } from './dom.js';

const messages = new Map();

// What a message can offer.
export function button(words, act) {
  const made = element('button', { type: 'button' }, words);
  made.addEventListener('click', act);
  return made;
}

// One message for each `key`; `seconds`: when it goes by itself, 0: it stays until cleared or closed; `place`: id of
// where it is.
export function notice(key, message, { failed = false, seconds = 4, children = [], place = 'notices' } = {}) {
  clear(key);
  const close = element('button', { type: 'button', ariaLabel: 'Close' }, '×');
  const box = element('div', { className: `notice${failed ? ' failed' : ''}`, id: `notice-${key}` },
    element('span', {}, message), ...children, close);
  close.addEventListener('click', () => clear(key));
  byId(place).append(box);
  messages.set(key, { box, timer: seconds ? setTimeout(() => clear(key), 1000 * seconds) : 0 });
}

// Other words in the same message: what it offers stays where a pointer may be about to press it.
export function reword(key, message) {
  const shown = messages.get(key);
  if (shown) shown.box.firstChild.textContent = message;
}

export function clear(key) {
  const shown = messages.get(key);
  if (!shown) return;
  clearTimeout(shown.timer);
  shown.box.remove();
  messages.delete(key);
}
