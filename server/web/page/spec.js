// SPDX-License-Identifier: BSD-3-Clause
// What the state asks of the stream: which pictures, and how exact they are to be.

import { planeOf } from './geometry.js';
import { colouredOf, defaultTets, fieldOf, isosurfacesOf, measureFor, targetFieldOf, vectorsOf } from './levels.js';

// What the state's fractions are of; it does not change while the stream comes.
function rangeIn({ field: { range, components }, component }) {
  return component === 'magnitude' ? [0, Math.sqrt(components) * Math.max(...range.map(Math.abs))] : range;
}

/** What isosurfaces are fractions of, and what a threshold's ends are. */
export const isosurfaceRange = (state, info) => {
  const { field, component } = isosurfacesOf(info, state);
  return rangeIn({ field: fieldOf(info, field), component });
};
export const thresholdRange = (state, info) => rangeIn(colouredOf(info, state));

function thresholdOf(state, info) {
  if (!state.threshold) return null;
  const [low, high] = thresholdRange(state, info);
  const [from, to] = state.threshold;
  const { field: { name }, cells, component } = colouredOf(info, state);
  return { [cells ? 'cellField' : 'field']: name, component, low: from > 0 ? low + from * (high - low) : -Infinity, high: to < 1 ? low + to * (high - low) : Infinity };
}

/** The pictures, as `TetlodStream.show` takes them. */
export function specOf(state, info) {
  const [low, high] = isosurfaceRange(state, info);
  const { field, component } = isosurfacesOf(info, state);
  const coloured = colouredOf(info, state);
  return {
    field: state.field,
    cellField: coloured.cells ? coloured.field.name : undefined,
    component: coloured.component,
    regions: state.regions && state.hidden.length ? { field: state.regions, hidden: state.hidden } : null,
    surface: state.surface !== 'off',
    edges: state.edges || (state.sliceEdges && state.slices.length > 0),
    slices: state.slices.map((plane) => planeOf(info.bounds, plane)),
    isosurfaces: state.isosurfaces.map((fraction) => ({ field, component, value: low + fraction * (high - low), zone: state.zone })),
    threshold: thresholdOf(state, info),
    clip: state.clip && planeOf(info.bounds, state.clip),
    rays: state.volume && !state.volumeSize,
    volume: state.volume && state.volumeSize ? { size: state.volumeSize, logarithmic: state.log } : null,
    vectors: vectorsOf(info, state) && { field: vectorsOf(info, state), kind: state.vectors, count: state.vectorCount },
    morph: state.smooth,
  };
}

/** The level, as `TetlodStream.refineTo` takes it; without `info`, which says what there is, for `TetlodStream.open`. */
export function targetOf(state, info) {
  const target = { error: state.error, tets: state.maxTets || defaultTets() };
  if (state.maxBytes) target.bytes = state.maxBytes;
  return info ? { ...target, field: targetFieldOf(info, state), measure: measureFor(info, state) } : target;
}
