// SPDX-License-Identifier: BSD-3-Clause
// Numbers as people read them.

export const clamp = (x, least, most) => Math.min(Math.max(x, least), most);

export const mostFloat = 3.4028234e38; // that 32 bits hold

// 187 395: groups of three, by narrow spaces that do not break
export const count = (n) => n.toLocaleString('en-US').replaceAll(',', '\u202f');

export function significant(x, digits = 4) {
  if (x === 0 || !Number.isFinite(x)) return String(x);
  const size = Math.abs(x);
  const rounded = Number(x.toPrecision(digits));
  const text = size >= 1e6 || size < 1e-4 ? rounded.toExponential().replace('e+', 'e') : String(rounded);
  return text.replaceAll('-', '\u2212');
}

// Rounded up to so many digits: a bound may not be more than it is said to be.
export function roundedUp(x, digits) {
  if (!(x > 0) || !Number.isFinite(x)) return x;
  const step = 10 ** (Math.floor(Math.log10(x)) + 1 - digits);
  return step * Math.ceil(x / step - 1e-9);
}

export const percent = (x, digits = 3) => (x === 0 ? '0' : `${significant(100 * x, digits)}\u202f%`);

export function bytes(n) {
  const units = ['B', 'kB', 'MB', 'GB', 'TB'];
  let unit = 0;
  for (; n >= 1000 && unit < units.length - 1; unit++) n /= 1000;
  return `${unit ? n.toPrecision(3) : n}\u202f${units[unit]}`;
}

// What people type into a number's field: "1e-3", "0,5", "−2"; NaN if it is none.
export function parseNumber(text) {
  const plain = text.trim().replace('\u2212', '-').replace(',', '.').replace(/\s*%$/, '');
  return plain === '' ? NaN : Number(plain);
}

// Round values that divide [low, high] into about `wanted` steps.
export function ticks(low, high, wanted) {
  const rough = (high - low) / wanted;
  if (!(rough > 0)) return [low];
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((m) => m * power >= rough * 0.999);
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) found.push(i * step + 0); // never -0
  return found;
}

/** As significant, as somebody types it. */
export const plain = (x, digits = 4) => significant(x, digits).replaceAll('\u202f', '').replaceAll('\u2212', '-');
