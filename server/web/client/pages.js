// SPDX-License-Identifier: BSD-3-Clause
// Which pages of a stream (SPEC 7.6) a view of it needs: the worst one on the screen first, within budgets.
//
// Pixels are of two kinds, of which the larger counts. The distance that the boundary may have moved is a length, as
// large on the screen as it is at the nearest place of a page that is seen. An error of a value moves colours, or an
// isosurface, by error / gradient: it counts as if the field changed by its range along the diagonal of the bounds, so
// that an error of 1 % of the range is 1 % of the diagonal.

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

// How far a box reaches along a plane's normal: with `sign` 1 its farthest corner, with -1 the nearest one.
const along = ([x, y, z, d], low, high, sign) =>
  x * (sign * x > 0 ? high : low)[0] + y * (sign * y > 0 ? high : low)[1] + z * (sign * z > 0 ? high : low)[2] + d;

/** Is all of a box seen? */
export const isInside = ({ planes }, low, high) => planes.every((plane) => along(plane, low, high, -1) >= 0);

/** Have two boxes a place in common? */
export const meets = (low, high, from, to) =>
  low[0] <= to[0] &&
  from[0] <= high[0] &&
  low[1] <= to[1] &&
  from[1] <= high[1] &&
  low[2] <= to[2] &&
  from[2] <= high[2];

export function distanceTo(eye, low, high) {
  const [x, y, z] = eye;
  return Math.hypot(
    Math.max(low[0] - x, 0, x - high[0]),
    Math.max(low[1] - y, 0, y - high[1]),
    Math.max(low[2] - z, 0, z - high[2]),
  );
}

/**
 * Pixels of a length at the nearest place of a box; 0: it is not seen. `look`: {planes: [[x, y, z, d]], of which
 * x, y, z point to what is seen; eye; near: nothing is seen that is nearer; scale: pixels of a length at a distance of
 * 1, or, where `parallel`, at any}.
 */
export function scaleOf({ planes, eye, near, scale, parallel }, low, high) {
  if (planes.some((plane) => along(plane, low, high, 1) < 0)) return 0;
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

const betters = (reach, level) => reach[level] < reach[level - 1];

/**
 * The pages that make no place that is seen worse than `look.pixels`, the worst first, as far as they fit into
 * `look.tets` and `look.bytes`. `pages`: [{level, low, high, tets, bytes, needed: [numbers of pages]}], `root`: the
 * tetrahedra without any, `reach`: of each level, as reaches() gives it, `scales`: of each page, pixels of a length
 * where it is seen, 0: it is not. Pages that are not `shown`, those of the mesh that is there, come only where the
 * error is `times` as large. `look.boxes`: {boxes, level}, in which all pages are needed up to a level, or null. {has:
 * [page] 1 or 0; tets; bytes; `refused`, how many are left out for the budgets; `pixels`, what is left of the error of
 * the worst page that is seen; `worst`, the coarsest level there, of nothing that is seen the last one without pages;
 * `finest`, in the set; `boxLevel`, where boxes have it}.
 */
export function choosePages({ pages, root, reach, scales }, look, { times = 1, shown = new Set() } = {}) {
  const has = new Uint8Array(pages.length);
  // one that makes nothing better comes with those that need it
  const errorOf = ({ level }, p) => (betters(reach, level) ? reach[level - 1] * scales[p] || 0 : 0);
  const errors = pages.map((page, p) => (isBoxed(page, look.boxes) ? Infinity : errorOf(page, p)));
  const order = [...errors.keys()]
    .filter((p) => errors[p] > look.pixels * (shown.has(p) ? 1 : times))
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
    boxLevel: look.boxes && !refused ? Math.min(look.boxes.level, pages.at(-1).level) : undefined,
    ...whatIsLeft(pages, has, reach, scales),
  };
}

const isBoxed = ({ level, low, high }, boxes) =>
  Boolean(boxes) &&
  level <= boxes.level &&
  boxes.boxes.some((box) => meets(low, high, box.slice(0, 3), box.slice(3)));

// Of what is seen: where a page is missing, the level before it is shown, or, if that made nothing better, one before.
// (Where a page is missing that would make nothing better, the next one that would is missing, too.)
function whatIsLeft(pages, has, reach, scales) {
  const [first, last] = [pages[0].level, pages.at(-1).level];
  const before = (level) => (level > first && !betters(reach, level - 1) ? before(level - 1) : level - 1);
  let [pixels, worst, finest] = [0, scales.some((scale) => scale > 0) ? last : first - 1, first - 1];
  pages.forEach(({ level }, p) => {
    if (has[p]) finest = Math.max(finest, level);
    if (!scales[p] || (level < last && (has[p] || !betters(reach, level)))) return;
    const shown = has[p] ? last : before(level);
    pixels = Math.max(pixels, reach[shown] * scales[p] || 0);
    worst = Math.min(worst, shown);
  });
  return { pixels, worst, finest };
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
