// SPDX-License-Identifier: BSD-3-Clause
// Which pages of a stream (SPEC 7.6) a view of it needs: the worst one on the screen first, within budgets.
//
// Errors of values become pixels as if each value was drawn as a height over its place, and the field's range as long
// as the diagonal of the bounds: an error of 1 % of the range is 1 % of the diagonal, as large as that is on the screen
// at the nearest corner of a page. So is the distance that the boundary may have moved, which is a fraction of the
// diagonal, too; the larger one counts.

/**
 * How far off each level may be, as a length, by the measure of a field's error; not known: without a limit.
 * `info`: as of a stream.
 */
export function reaches({ levels, bounds: [low, high] }, field, measure) {
  const diagonal = Math.hypot(...high.map((h, i) => h - low[i]));
  return levels.map(
    ({ errors, domainError = 0 }) => diagonal * Math.max(errors[field]?.[measure] ?? Infinity, domainError),
  );
}

const isOutside = ([x, y, z, d], low, high) =>
  x * (x > 0 ? high : low)[0] + y * (y > 0 ? high : low)[1] + z * (z > 0 ? high : low)[2] + d < 0;

function distanceTo(eye, low, high) {
  return Math.hypot(...eye.map((c, i) => Math.max(low[i] - c, 0, c - high[i])));
}

/**
 * Pixels of a length at the nearest place of a box; 0: it is not seen. `look`: {planes: [[x, y, z, d]], of which
 * x, y, z point to what is seen; eye; near: nothing is seen that is nearer; scale: pixels of a length at a distance of
 * 1, or, where `parallel`, at any}.
 */
export function scaleOf({ planes, eye, near, scale, parallel }, low, high) {
  if (planes.some((plane) => isOutside(plane, low, high))) return 0;
  return parallel ? scale : scale / Math.max(distanceTo(eye, low, high), near);
}

// A page and all that it needs which is not there, as long as it costs no more than `tets` and `bytes`; null: it does.
function missingOf(page, pages, has, { tets, bytes }) {
  const found = new Set([page]);
  let [more, bigger] = [0, 0];
  for (const p of found) {
    more += pages[p].tets;
    bigger += pages[p].bytes;
    if (more > tets || bigger > bytes) return null;
    for (const needed of pages[p].needed) if (!has[needed]) found.add(needed);
  }
  return { found, tets: more, bytes: bigger };
}

/**
 * The pages that make no place on the screen worse than `look.pixels`, the worst first, as far as they fit into
 * `look.tets` and `look.bytes`. `pages`: [{level, low, high, tets, bytes, needed: [numbers of pages]}], `root`: the
 * tetrahedra without any, `reach`: of each level, as reaches() gives it. {has: [page] 1 or 0; tets; bytes; `refused`,
 * how many are left out for the budgets; `pixels`, what is left of the error of the worst page on the screen; `worst`,
 * the coarsest level there; `finest`, in the set}.
 */
export function choosePages({ pages, root, reach }, look) {
  const has = new Uint8Array(pages.length);
  const errors = pages.map(({ level, low, high }) => reach[level - 1] * scaleOf(look, low, high) || 0);
  const order = [...errors.keys()]
    .filter((p) => errors[p] > look.pixels)
    .sort((a, b) => errors[b] - errors[a] || a - b);
  const left = { tets: look.tets - root, bytes: look.bytes };
  let refused = 0;
  for (const page of order) {
    if (has[page]) continue;
    const missing = missingOf(page, pages, has, left);
    refused += !missing;
    if (!missing) continue;
    for (const p of missing.found) has[p] = 1;
    left.tets -= missing.tets;
    left.bytes -= missing.bytes;
  }
  return {
    has,
    tets: look.tets - left.tets,
    bytes: look.bytes - left.bytes,
    refused,
    ...whatIsLeft(pages, has, errors, reach, look),
  };
}

// Of what is on the screen: where a page is missing, the level before it is shown.
function whatIsLeft(pages, has, errors, reach, look) {
  const last = pages.at(-1).level;
  let [pixels, worst, finest, nearest] = [0, last, pages[0].level - 1, 0];
  pages.forEach(({ level, low, high }, p) => {
    if (has[p]) finest = Math.max(finest, level);
    if (!has[p] && errors[p]) [pixels, worst] = [Math.max(pixels, errors[p]), Math.min(worst, level - 1)];
    if (level === last) nearest = Math.max(nearest, scaleOf(look, low, high));
  });
  return { pixels: Math.max(pixels, reach[last] * nearest || 0), worst, finest };
}

/** Ranges of bytes with all of these frames, [offset, size] each, in order: those that are near become one. */
export function rangesOf(frames, gap = 512, most = 1 << 19) {
  const ranges = [];
  for (const [offset, size] of frames.filter(([, size]) => size).sort(([a], [b]) => a - b)) {
    const last = ranges.at(-1);
    const end = offset + size;
    if (last && offset - (last.offset + last.size) <= gap && end - last.offset <= most)
      last.size = Math.max(last.size, end - last.offset);
    else ranges.push({ offset, size });
  }
  return ranges;
}
