// SPDX-License-Identifier: BSD-3-Clause
// Making and finding elements.

import { parseNumber } from './numbers.js';

export const byId = (id) => document.getElementById(id);

export function element(name, properties = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(properties))
    if (key in made) made[key] = value;
    else made.setAttribute(key, value);
  made.append(...children);
  return made;
}

const svgSpace = 'http://www.w3.org/2000/svg';

export function svg(name, attributes = {}, ...children) {
  const made = document.createElementNS(svgSpace, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

// Calls `draw` in the next animation frame, once however often it is asked for.
export function coalesced(draw) {
  let asked = false;
  return () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      draw();
    });
  };
}

// Lets what else waits for this thread go first: a long piece of work in steps.
export const pause = () => globalThis.scheduler?.yield?.() ?? new Promise((resolve) => setTimeout(resolve));

// Choices, as pairs of value and text.
export const options = (select, pairs) =>
  select.replaceChildren(...pairs.map(([value, text]) => element('option', { value }, text)));

// A text field for a number: what cannot be read falls back to what holds. It follows what holds unless somebody types.
export function bindNumber(input, read, write) {
  let typing = false;
  input.addEventListener('input', () => (typing = true));
  input.addEventListener('blur', () => (typing = false));
  input.addEventListener('change', () => {
    typing = false;
    const value = parseNumber(input.value);
    if (Number.isFinite(value)) write(value);
    input.value = read();
  });
  return () => {
    if (!typing) input.value = read();
  };
}
