// SPDX-License-Identifier: BSD-3-Clause
// Short messages over the picture, which never stop anybody.

import { byId, element } from './dom.js';

const places = new Map();

// One message for each `key`; `seconds`: when it goes by itself, 0: it stays until cleared or closed.
export function notice(key, message, { failed = false, seconds = 4, children = [] } = {}) {
  clear(key);
  const close = element('button', { type: 'button', ariaLabel: 'Close' }, '×');
  const box = element('div', { className: `notice${failed ? ' failed' : ''}`, id: `notice-${key}` }, element('span', {}, message), ...children, close);
  close.addEventListener('click', () => clear(key));
  byId('notices').append(box);
  places.set(key, { box, timer: seconds ? setTimeout(() => clear(key), 1000 * seconds) : 0 });
}

export function clear(key) {
  const place = places.get(key);
  if (!place) return;
  clearTimeout(place.timer);
  place.box.remove();
  places.delete(key);
}
