// SPDX-License-Identifier: BSD-3-Clause
// Rows of the panel, of those that are made after it.

import { element } from './dom.js';

/** Words before what they are of: the label of a control; before a button, words only. */
export function row(text, ...controls) {
  const [first] = controls;
  const words = [text].flat();
  const name = first.matches('input, select')
    ? element('label', { htmlFor: first.id }, ...words)
    : element('span', {}, ...words);
  return element('div', { className: 'row' }, name, ...controls);
}
