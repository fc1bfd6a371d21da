// SPDX-License-Identifier: BSD-3-Clause
// Vectors, planes through the bounds, and the ray under the pointer.

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
export const mix = (a, b, t) => a.map((x, i) => x + t * (b[i] - x));
export const scale = (a, s) => [s * a[0], s * a[1], s * a[2]];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a) => Math.hypot(...a);
export const unit = (a) => scale(a, 1 / (length(a) || 1));
export const diagonalOf = ({ bounds: [low, high] }) => length(add(high, low, -1));
export const middle = ([low, high]) => scale(add(low, high), 0.5);

export const corners = ([low, high]) =>
  Array.from({ length: 8 }, (_, i) => [i & 1 ? high[0] : low[0], i & 2 ? high[1] : low[1], i & 4 ? high[2] : low[2]]);

// From where to where the bounds reach along a direction.
export function extent(bounds, normal) {
  const along = corners(bounds).map((c) => dot(c, normal));
  return [Math.min(...along), Math.max(...along)];
}

// A plane of the state, { normal, at: 0..1 across the bounds }, as { origin, normal }.
export function planeOf(bounds, { normal, at }) {
  const n = unit(normal);
  const [low, high] = extent(bounds, n);
  const centre = middle(bounds);
  return { origin: add(centre, n, low + at * (high - low) - dot(centre, n)), normal: n };
}

/** Where a plane is along its normal, from side to side of the bounds; for one across an axis these are its
 * coordinates. */
export function reachOf(bounds, { normal }) {
  const [low, high] = extent(bounds, unit(normal));
  const negative = normal.filter((c) => c !== 0).length === 1 && normal.some((c) => c < 0);
  return negative ? [-low, -high] : [low, high];
}

// The polygon in which a plane cuts the bounds, in order around its middle.
export function planeOutline(bounds, plane) {
  const c = corners(bounds);
  const points = [];
  for (let i = 0; i < 8; i++)
    for (const bit of [1, 2, 4]) {
      if (i & bit) continue;
      const [a, b] = [c[i], c[i | bit]];
      const [da, db] = [dot(add(a, plane.origin, -1), plane.normal), dot(add(b, plane.origin, -1), plane.normal)];
      if (da === db || da * db > 0) continue;
      points.push(add(a, add(b, a, -1), da / (da - db)));
    }
  if (points.length < 3) return [];
  const centre = scale(points.reduce((s, p) => add(s, p), [0, 0, 0]), 1 / points.length);
  const u = unit(cross(plane.normal, Math.abs(plane.normal[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]));
  const v = cross(plane.normal, u);
  const angle = (p) => Math.atan2(dot(add(p, centre, -1), v), dot(add(p, centre, -1), u));
  return points.sort((p, q) => angle(p) - angle(q));
}

// The part of a polygon { x, y } that is inside a rectangle from (margin, margin), side by side (Sutherland and
// Hodgman).
export function clipToWindow(polygon, width, height, margin) {
  const sides = [(p) => p.x - margin, (p) => width - margin - p.x, (p) => p.y - margin, (p) => height - margin - p.y];
  return sides.reduce((points, inside) => points.flatMap((p, i) => {
    const last = points.at(i - 1);
    const [here, before] = [inside(p), inside(last)];
    const f = before / (before - here);
    const crossing = here * before < 0 ? [{ x: last.x + f * (p.x - last.x), y: last.y + f * (p.y - last.y) }] : [];
    return here >= 0 ? [...crossing, p] : crossing;
  }), polygon);
}

// The value of a part within a triangle, with these weights of its corners: of vectors the length, or another function,
// which is not linear.
function valueIn({ values, vectors, evaluate = (row) => Math.hypot(...row) }, corners, weights) {
  const at = (list, n, c) => corners.reduce((sum, corner, i) => sum + weights[i] * list[n * corner + c], 0);
  if (!vectors) return at(values, 1, 0);
  const n = vectors.length / values.length;
  return evaluate(Array.from({ length: n }, (_, c) => at(vectors, n, c)));
}

// The nearest triangle of a part that a ray meets (Möller and Trumbore): { distance, value, point } or null.
// `facing`: 1 takes front faces only, -1 back faces only, 0 both.
export function pickPart(part, from, direction, facing = 0) {
  const { points, triangles } = part;
  let best = Infinity;
  let found = null;
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [3 * triangles[t], 3 * triangles[t + 1], 3 * triangles[t + 2]];
    const e1x = points[b] - points[a], e1y = points[b + 1] - points[a + 1], e1z = points[b + 2] - points[a + 2];
    const e2x = points[c] - points[a], e2y = points[c + 1] - points[a + 1], e2z = points[c + 2] - points[a + 2];
    const px = direction[1] * e2z - direction[2] * e2y, py = direction[2] * e2x - direction[0] * e2z,
          pz = direction[0] * e2y - direction[1] * e2x;
    const det = e1x * px + e1y * py + e1z * pz;
    if (det === 0 || facing * det < 0) continue;
    const inverse = 1 / det;
    const sx = from[0] - points[a], sy = from[1] - points[a + 1], sz = from[2] - points[a + 2];
    const u = (sx * px + sy * py + sz * pz) * inverse;
    if (u < 0 || u > 1) continue;
    const qx = sy * e1z - sz * e1y, qy = sz * e1x - sx * e1z, qz = sx * e1y - sy * e1x;
    const v = (direction[0] * qx + direction[1] * qy + direction[2] * qz) * inverse;
    if (v < 0 || u + v > 1) continue;
    const distance = (e2x * qx + e2y * qy + e2z * qz) * inverse;
    if (distance <= 0 || distance >= best) continue;
    best = distance;
    found = { t, weights: [1 - u - v, u, v] };
  }
  return found && {
    distance: best,
    value: valueIn(part, [...triangles.subarray(found.t, found.t + 3)], found.weights),
    point: add(from, direction, best)
  };
}

// Which of `lines` (pairs of points) each side of each triangle is, three to a triangle; -1: none of them.
export function sidesOf({ triangles, lines, points }) {
  const firsts = new Uint32Array(points.length / 3 + 1); // lines by their lesser end, one run after another
  for (let l = 0; l < lines.length; l += 2) firsts[Math.min(lines[l], lines[l + 1]) + 1]++;
  for (let v = 1; v < firsts.length; v++) firsts[v] += firsts[v - 1];
  const room = firsts.slice();
  const sorted = new Uint32Array(lines.length / 2);
  for (let l = 0; l < lines.length; l += 2) sorted[room[Math.min(lines[l], lines[l + 1])]++] = l / 2;
  return Int32Array.from(triangles, (a, i) => {
    const b = triangles[i % 3 === 2 ? i - 2 : i + 1];
    const [low, high] = a < b ? [a, b] : [b, a];
    for (let k = firsts[low]; k < firsts[low + 1]; k++)
      if (lines[2 * sorted[k]] + lines[2 * sorted[k] + 1] === low + high) return sorted[k];
    return -1;
  });
}

// The lines of a part that are sides of triangles seen from behind. `eye` is where the viewer is, or where he looks if
// that
// is `parallel`; `sides` of sidesOf.
export function linesBehind({ points, triangles, lines }, sides, eye, parallel) {
  const wanted = new Uint8Array(lines.length / 2);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [3 * triangles[t], 3 * triangles[t + 1], 3 * triangles[t + 2]];
    const ux = points[b] - points[a], uy = points[b + 1] - points[a + 1], uz = points[b + 2] - points[a + 2];
    const vx = points[c] - points[a], vy = points[c + 1] - points[a + 1], vz = points[c + 2] - points[a + 2];
    const [ex, ey, ez] = parallel ? eye : [points[a] - eye[0], points[a + 1] - eye[1], points[a + 2] - eye[2]];
    if (ex * (uy * vz - uz * vy) + ey * (uz * vx - ux * vz) + ez * (ux * vy - uy * vx) <= 0) continue;
    for (let k = t; k < t + 3; k++) if (sides[k] >= 0) wanted[sides[k]] = 1;
  }
  return lines.filter((_, i) => wanted[i >> 1]);
}
