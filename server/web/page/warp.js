// SPDX-License-Identifier: BSD-3-Clause
// Points moved by a field of vectors, so many times as it says, with the outline of what is not moved.

import { byId, element } from './dom.js';
import { cross, diagonalOf, dot, unit } from './geometry.js';
import { fieldOf, vectorFields, warpField, warpScale } from './levels.js';
import { parseNumber, significant } from './numbers.js';
import { row } from './rows.js';

const share = 0.1; // of the diagonal: what the largest vector is shown as at first
const bend = Math.cos(Math.PI / 6); // between triangles whose edge is part of the outline

// 1, 2 or 5 times a power of ten
function rounded(x) {
  const power = 10 ** Math.floor(Math.log10(x));
  return power * [5, 2, 1].find((m) => m * power <= x * 1.0001);
}

const largest = (info, name) => Math.max(...fieldOf(info, name).range.map(Math.abs));

export function scaleFor(info, name) {
  const most = largest(info, name);
  return most > 0 ? Number(rounded((share * diagonalOf(info)) / most).toPrecision(1)) : 1;
}

/** Edges of a surface that are sharp or open, as pairs of points. */
export function outlineOf({ points, triangles }) {
  const at = (i) => [points[3 * i], points[3 * i + 1], points[3 * i + 2]];
  const normals = new Map();
  const edges = [];
  for (let t = 0; t < triangles.length; t += 3) {
    const ids = triangles.subarray(t, t + 3);
    const [a, b, c] = [at(ids[0]), at(ids[1]), at(ids[2])];
    const normal = unit(
      cross(
        b.map((x, i) => x - a[i]),
        c.map((x, i) => x - a[i]),
      ),
    );
    for (let k = 0; k < 3; k++) {
      const [from, to] = [ids[k], ids[(k + 1) % 3]].sort((p, q) => p - q);
      const key = from * 0x100000000 + to;
      const other = normals.get(key);
      if (other === undefined) normals.set(key, { normal, from, to });
      else {
        normals.delete(key);
        if (dot(other.normal, normal) < bend) edges.push(from, to);
      }
    }
  }
  for (const { from, to } of normals.values()) edges.push(from, to);
  return Uint32Array.from(edges);
}

export function bindWarp(viewer) {
  const { store, info, scene } = viewer;
  const able = vectorFields(info);
  if (!able.length) return;
  const options = ['', ...able].map((name) => element('option', { value: name }, name || 'off'));
  const field = element('select', { id: 'warp' }, ...options);
  const scale = element('input', { id: 'warp-scale', className: 'number', inputMode: 'decimal', autocomplete: 'off' });
  const outline = element('input', { id: 'outline', type: 'checkbox', className: 'switch' });
  const more = element('div', {}, row('Scale', scale), row('Outline of the undeformed', outline));
  byId('vectors-body').lastElementChild.before(row('Warp by', field), more);
  field.addEventListener('change', () =>
    store.set({ warp: field.value, ...(field.value && { warpScale: scaleFor(viewer.info, field.value) }) }),
  );
  scale.addEventListener('change', () => {
    const value = parseNumber(scale.value);
    if (Number.isFinite(value)) store.set({ warpScale: warpScale(viewer.info, { ...store.state, warpScale: value }) });
    scale.value = significant(store.state.warpScale, 6);
  });
  outline.addEventListener('change', () => store.set({ outline: outline.checked }));
  store.watch(['warp', 'warpScale', 'outline'], (state) => {
    const name = warpField(viewer.info, state);
    field.value = name ?? '';
    more.hidden = !name;
    scale.value = significant(state.warpScale, 6);
    outline.checked = state.outline;
    scene.setRoom(name ? Math.abs(warpScale(viewer.info, state)) * largest(viewer.info, name) : 0);
  });
  let drawn = null;
  const draw = () => {
    scene.refit();
    if (viewer.outline === drawn) return;
    drawn = viewer.outline;
    scene.setEdges('outline', drawn?.points, drawn && outlineOf(drawn));
  };
  viewer.addEventListener('pictures', draw);
  draw();
}
