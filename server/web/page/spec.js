// SPDX-License-Identifier: BSD-3-Clause
// What the state asks of the stream: which pictures, and how exact they are to be.

import { add, cross, dot, mix, planeOf, planeOutline, scale, unit } from './geometry.js';
import {
  colouredOf,
  defaultTets,
  fieldOf,
  isosurfacesOf,
  measureFor,
  targetFieldOf,
  vectorsOf,
  warpField,
  warpScale,
} from './levels.js';

// A quotient may be anything: then as far as the largest component reaches.
function spanOfFormula(formula, info) {
  const { low, high } = formula.at(info, info.levels.length - 1);
  if (Number.isFinite(high - low)) return [low, high > low ? high : low + 1];
  const most = Math.max(...formula.fields.flatMap((name) => fieldOf(info, name).range.map(Math.abs)));
  return [-most, most];
}

// What the state's fractions are of; it does not change while the stream comes.
function rangeIn({ field: { range, components }, component, formula }, info) {
  if (formula) return spanOfFormula(formula, info);
  return component === 'magnitude' ? [0, Math.sqrt(components) * Math.max(...range.map(Math.abs))] : range;
}

/** What isosurfaces are fractions of, and what a threshold's ends are. */
export const isosurfaceRange = (state, info) => {
  const { field, component, formula } = isosurfacesOf(info, state);
  return rangeIn({ field: fieldOf(info, field), component, formula }, info);
};
export const thresholdRange = (state, info) => rangeIn(colouredOf(info, state), info);

function thresholdOf(state, info) {
  if (!state.threshold) return null;
  const [low, high] = thresholdRange(state, info);
  const [from, to] = state.threshold;
  const {
    field: { name },
    cells,
    component,
    formula,
  } = colouredOf(info, state);
  const of = formula ? { formula: true } : { [cells ? 'cellField' : 'field']: name, component };
  return {
    ...of,
    low: from > 0 ? low + from * (high - low) : -Infinity,
    high: to < 1 ? low + to * (high - low) : Infinity,
  };
}

const boxOf = (box, [low, high]) => box.map((x, i) => low[i % 3] + x * (high[i % 3] - low[i % 3]));

// Boxes in coordinates; their error is of what the target's is.
function refineOf({ refine, ...state }, info) {
  if (!refine) return null;
  const boxes = refine.boxes.map((box) => boxOf(box, info.bounds));
  return { boxes, target: { ...targetOf({ ...state, maxBytes: 0, error: refine.error }, info), tets: Infinity } };
}

const evenly = (from, to, n) => Array.from({ length: n }, (_, i) => mix(from, to, (i + 0.5) / n));

// Where arrows and streamlines are to be, if not in the whole volume: along the line, or on the slice in rows and
// columns, of which some may be outside of the mesh.
function placesOf({ seeds, line, slices, vectorCount: count }, bounds) {
  const [low, high] = bounds;
  if (seeds === 'line' && line) {
    const ends = [line.slice(0, 3), line.slice(3)].map((end) => end.map((x, i) => low[i] + x * (high[i] - low[i])));
    return evenly(...ends, count);
  }
  if (seeds !== 'slice' || !slices.length) return null;
  const plane = planeOf(bounds, slices[0]);
  const outline = planeOutline(bounds, plane);
  if (!outline.length) return [];
  const along = unit(add(outline[1], outline[0], -1));
  const sides = [along, cross(plane.normal, along)].map((side) => {
    const reach = outline.map((corner) => dot(add(corner, plane.origin, -1), side));
    return evenly([Math.min(...reach)], [Math.max(...reach)], Math.ceil(Math.sqrt(count))).map(([x]) => scale(side, x));
  });
  return sides[0].flatMap((x) => sides[1].map((y) => add(plane.origin, add(x, y))));
}

/** The pictures, as `TetlodStream.show` takes them. */
export function specOf(state, info) {
  const [low, high] = isosurfaceRange(state, info);
  const { field, component, formula } = isosurfacesOf(info, state);
  const of = formula ? { formula: true } : { field, component };
  const coloured = colouredOf(info, state);
  return {
    field: state.field,
    cellField: coloured.cells ? coloured.field.name : undefined,
    component: coloured.component,
    formula: coloured.formula && {
      inputs: coloured.formula.inputs,
      program: coloured.formula.program,
      text: coloured.formula.text,
    },
    regions: state.regions && state.hidden.length ? { field: state.regions, hidden: state.hidden } : null,
    surface: state.surface !== 'off',
    edges: state.edges || (state.sliceEdges && state.slices.length > 0),
    slices: state.slices.map((plane) => planeOf(info.bounds, plane)),
    isosurfaces: state.isosurfaces.map((fraction) => ({
      ...of,
      value: low + fraction * (high - low),
      zone: state.zone,
    })),
    threshold: thresholdOf(state, info),
    clip: state.clip && planeOf(info.bounds, state.clip),
    box: state.box && boxOf(state.box, info.bounds),
    rays: state.volume && !state.volumeSize,
    volume: state.volume && state.volumeSize ? { size: state.volumeSize, logarithmic: state.log } : null,
    vectors: vectorsOf(info, state) && {
      field: vectorsOf(info, state),
      kind: state.vectors,
      count: state.vectorCount,
      size: state.vectorSize,
      places: placesOf(state, info.bounds),
    },
    warp: warpField(info, state) && { field: state.warp, scale: warpScale(info, state), outline: state.outline },
    refine: refineOf(state, info),
    morph: state.smooth,
  };
}

/**
 * The level, as `TetlodStream.refineTo` takes it; without `info`, which says what there is, for `TetlodStream.open`.
 */
export function targetOf(state, info) {
  const target = { error: state.pixels && !info ? 1 : state.error, tets: state.maxTets || defaultTets() };
  if (state.pixels && info?.paged) target.level = info.paged - 1;
  if (state.maxBytes) target.bytes = state.maxBytes;
  return info ? { ...target, field: targetFieldOf(info, state), measure: measureFor(info, state) } : target;
}
