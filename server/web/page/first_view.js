// SPDX-License-Identifier: BSD-3-Clause
// What a stream is shown as before anybody chose anything, from its index and the values in the picture.

// A field whose values lie on both sides of zero, neither side being negligible.
const isSigned = ([low, high]) => low < 0 && high > 0 && Math.min(-low, high) > 0.1 * Math.max(-low, high);

// Fields of solids: what one looks at is on their surface.
const solidFields = /displ|deform|stress|strain|mises|plastic|damage/i;
const flowFields =
  [/veloc|momentum|^u$/i, /press|mach|vortic|^p$/i]; // that flows have both kinds of, with stresses or not

/** Whether the stream shows a body, not what flows or spreads within walls. */
export function isSolid({ fields, cellFields = [] }) {
  const has = (words) => [...fields, ...cellFields].some(({ name }) => words.test(name));
  return has(solidFields) && !flowFields.every(has);
}

/** What replaces the defaults: solids are closed and lit; else one slice across the shortest side, within far walls. */
export function firstView({ bounds: [low, high], fields, cellFields }) {
  if (isSolid({ fields, cellFields })) return { surface: 'solid', shading: 'all' };
  const sides = low.map((l, i) => high[i] - l);
  const shortest = sides.lastIndexOf(Math.min(...sides));
  return { surface: 'inside', slices: [{ normal: [0, 1, 2].map((i) => Number(i === shortest)), at: 0.5 }] };
}

/**
 * The colour map where none is chosen: a diverging one for values of both signs. `range`: of the data; `regions`: the
 * values are their numbers.
 */
export function mapOf({ map }, range, regions = false) {
  if (map !== 'auto') return map;
  return regions ? 'categories' : isSigned(range) ? 'coolWarm' : 'viridis';
}

const tail = 0.01; // of the values, on each side
const few = 0.5;   // of the range: when so much of it is the tails', they are cut off

/**
 * The colours' range where none is chosen. `sample`: sorted values of the mesh. Outliers, which would leave one colour
 * to all others, are beyond its ends; values of both signs have zero in the middle.
 */
export function autoRange([low, high], sample) {
  const at = (fraction) => sample[Math.round(fraction * (sample.length - 1))];
  const inner = sample?.length > 16 ? [at(tail), at(1 - tail)] : [low, high];
  const long = inner[1] > inner[0] && inner[1] - inner[0] < few * (high - low);
  const [from, to] = long ? inner : [low, high];
  if (!isSigned([low, high])) return [from, to];
  const most = Math.max(Math.abs(from), Math.abs(to));
  return [-most, most];
}

/** How many values of a sorted sample lie in each of `bins` equal parts of [low, high]; of their logarithms if `log`.
 * */
export function histogram(sample, [low, high], log, bins) {
  const of = log ? Math.log10 : (x) => x;
  const counts = new Uint32Array(bins);
  for (const value of sample) {
    const bin = Math.floor((bins * (of(value) - of(low))) / (of(high) - of(low)));
    if (value === high) counts[bins - 1]++;
    else if (bin >= 0 && bin < bins) counts[bin]++;
  }
  return counts;
}
