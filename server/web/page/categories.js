// SPDX-License-Identifier: BSD-3-Clause
// A colour of its own for each whole number: of regions, materials, parts.

// Colours that differ also for people who do not see red and green apart. After the last one the first follows.
const palette = '4477aa-ee6677-228833-ccbb44-66ccee-aa3377-bbbbbb-dd8833-222255-99ddff-775533'.split('-');
const stops = 513;

/**
 * The map over [low, high], as colors.js takes one: the colour of a value is that of the nearest of `numbers`, which
 * ascend, or, without them, of the nearest whole number.
 */
export function categoriesOf([low, high], numbers) {
  const nth = (i) => palette[((i % palette.length) + palette.length) % palette.length];
  const nearest = (value) =>
    numbers.reduce((best, n, i) => (Math.abs(n - value) < Math.abs(numbers[best] - value) ? i : best), 0);
  const colorAt = (value) => nth(numbers?.length ? nearest(value) : Math.round(value));
  return Array.from({ length: stops }, (_, i) => colorAt(low + (i / (stops - 1)) * (high - low))).join('-');
}
