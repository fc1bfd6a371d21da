// SPDX-License-Identifier: BSD-3-Clause
// Levels and their errors, as the stream's index has them.

import { firstField } from '../client/choose.js';
import { diagonalOf } from './geometry.js';

export const measureNames = {
  max: 'certified maximum',
  sampled: 'sampled maximum',
  rms: 'root mean square',
};

export const measuresOf = (info, field) =>
  Object.keys(measureNames).filter((m) => info.levels[0].errors[field]?.[m] !== undefined);

// The field whose error the target limits: the one asked for, else the one that is drawn if the stream controls it (of
// a local
// bound the one that it bounds), else the first controlled one. A field that is only drawn changes no level: what it
// would cost
// is asked first.
export function targetFieldOf(info, { field, errorField }) {
  if (fieldOf(info, errorField)) return errorField;
  const shown = shownField(info, { field });
  return fieldOf(info, shown)?.controlled
    ? shown
    : (firstField(info.fields.filter((f) => f.controlled))?.name ?? field ?? info.fields[0].name);
}

// The wanted measure where the field has it, else the strictest that it has.
function measureOf(info, field, measure) {
  const has = measuresOf(info, field);
  return has.includes(measure) ? measure : has[0];
}

export const measureFor = (info, state) => measureOf(info, targetFieldOf(info, state), state.measure);

// The field whose error the panel shows: the drawn field, or the field that a drawn local bound bounds. And which error
// is known of it.
export const shownField = (info, { field }) => fieldOf(info, field)?.bounds ?? field;
export const shownMeasure = (info, state) => measureOf(info, shownField(info, state), state.measure);

export const errorOf = (level, field, measure) => level.errors[field]?.[measure] ?? 1;

// The coarsest level with at most the wanted error, coarser if a budget says so.
export function wantedLevel(info, state) {
  let k = levelForError(info, state);
  const most = state.maxTets || defaultTets();
  if (state.pixels && info.paged) k = Math.min(k, info.paged - 1);
  while (k > 0 && (info.levels[k].tets > most || (state.maxBytes && info.levels[k].bytes > state.maxBytes))) k--;
  return k;
}

// The coarsest level with at most the wanted error, whatever it costs.
export function levelForError(info, state) {
  const field = targetFieldOf(info, state);
  const measure = measureFor(info, state);
  const k = info.levels.findIndex((l) => errorOf(l, field, measure) <= state.error);
  return k < 0 ? info.levels.length - 1 : k;
}

// Bytes that the decoder and the picture take for a tetrahedron, measured.
const bytesPerTet = 170;
export const memoryOf = (tets) => tets * bytesPerTet;

// Where no budget is set, an eighth of the device's memory; browsers that do not tell it have 4 GB at least today.
export const defaultTets = () => Math.floor(((globalThis.navigator?.deviceMemory ?? 4) * 2 ** 30) / 8 / bytesPerTet);

export function fieldOf(info, name) {
  return info.fields.find((f) => f.name === name);
}

export const spanOf = (field) => field.range[1] - field.range[0];

// What is drawn of a field: its only component has no choice.
function componentIn({ components }, component) {
  if (components === 1) return 0;
  return Number.isInteger(component) && component < components ? component : 'magnitude';
}
export const componentOf = (info, state) => componentIn(fieldOf(info, state.field), state.component);

// What colours: values of cells, if the state says so, else the field.
export function colouredOf(info, state) {
  const cells = info.cellFields.find((f) => f.name === state.cells);
  const field = cells ?? fieldOf(info, state.field);
  const formula = formulaNamed(info, formulaText(info, state));
  return { field, cells: Boolean(cells), component: componentIn(field, state.component), formula };
}

// The field that bounds the error of this one at every point, if the stream has it.
export const localBoundOf = (info, name) => info.fields.find((f) => f.bounds === name)?.name;

// Fields of cells whose numbers can be those of regions.
export const regionFields = (info) =>
  info.cellFields.filter(({ components, type }) => components === 1 && type.startsWith('int')).map(({ name }) => name);

// Whose isosurfaces: of what is coloured, or of another field, of its length if it has several components.
export function isosurfacesOf(info, state) {
  const field = fieldOf(info, state.isosurfaceField);
  const { cells, formula } = colouredOf(info, state);
  if (!field || field.name === state.field)
    return { field: state.field, component: componentOf(info, state), colored: !cells, formula };
  return { field: field.name, component: field.components === 1 ? 0 : 'magnitude', colored: false };
}

// Fields that arrows and streamlines can be of, and the one that is chosen.
export const vectorFields = (info) => info.fields.filter(({ components }) => components === 3).map(({ name }) => name);
export function vectorsOf(info, { vectors, vectorField, field }) {
  const able = vectorFields(info);
  return vectors === 'off' ? null : [vectorField, field].find((name) => able.includes(name)) ?? able[0] ?? null;
}

// The field that moves the points, or null.
export const warpField = (info, { warp }) => (vectorFields(info).includes(warp) ? warp : null);

// How many times it does: what leads farther away than a thousand diagonals is no picture.
export function warpScale(info, { warp, warpScale: scale }) {
  const most = (1000 * diagonalOf(info)) / (Math.max(...fieldOf(info, warp).range.map(Math.abs)) || 1);
  return Math.min(Math.max(scale, -most), most);
}

// Names of the fields that the picture needs; probes and a plotted line tell the local bound, where there is one.
export const shownFields = (info, state) => [...new Set([
  state.field, ...(warpField(info, state) ? [state.warp] : []), ...(colouredOf(info, state).formula?.fields ?? []),
  ...(state.isosurfaces.length ? [isosurfacesOf(info, state).field] : []), vectorsOf(info, state) ?? state.field,
  (state.pins.length || state.line ? localBoundOf(info, state.field) : null) ?? state.field
])];

export function titleOf(info, state) {
  const { field: { name, components }, component, formula } = colouredOf(info, state);
  if (formula) return state.formula || `${tensorParts[state.component] ?? formula.text} ${name}`;
  if (components === 1) return name;
  return component === 'magnitude' ? `|${name}|` : `${name} ${componentName(components, component)}`;
}

/** Units as the state has them, by the names of fields; and back. */
export const unitsOf = ({ units }) => new Map(units.split(';').map((part) => {
  const end = part.lastIndexOf('=');
  return [part.slice(0, end), part.slice(end + 1)];
}).filter(([name, unit]) => name && unit));
// The unit of a field, or nothing: what somebody typed, else metadata, which hold what a file said, or anything.
export function unitOf(info, name) {
  const unit = info.typedUnits?.get(name) ?? info.metadata?.units?.[name];
  return typeof unit === 'string' ? unit : '';
}

// 'Pressure [Pa]', as it stands at the scalar bar.
export function titleWithUnit(info, state) {
  const unit = state.formula ? '' : unitOf(info, state.cells || state.field);
  return titleOf(info, state) + (unit && ` [${unit}]`);
}

const named = { 6: 'xx yy zz xy yz xz'.split(' '), 9: 'xx xy xz yx yy yz zx zy zz'.split(' ') };
export const componentNames = (components) =>
  named[components] ?? Array.from({ length: components }, (_, i) => (components <= 3 ? 'xyz'[i] : String(i)));
export const componentName = (components, i) => componentNames(components)[i];

// ---- functions of components (formula.js, which is loaded when one is shown)

/** What is drawn of tensors beside their components. */
export const tensorParts = {
  mises: 'von Mises',
  principal1: 'largest principal',
  principal2: 'middle principal',
  principal3: 'smallest principal'
};
const isTensor = ({ components }) => components === 6 || components === 9;

let Formula = null;
const formulas = new Map(); // by text and names of the fields

export const useFormulas = (module) => { ({ Formula } = module); };

/** The text of the function that colours, or ''. */
export function formulaText(info, { field, cells, component, formula }) {
  if (info.cellFields.some((f) => f.name === cells)) return '';
  if (formula) return formula;
  return Object.hasOwn(tensorParts, component) && isTensor(fieldOf(info, field)) ? `${component}("${field}")` : '';
}

/** The function with this text; null: none, it is not loaded yet, or it is not understood. */
export function formulaNamed(info, text) {
  if (!text || !Formula) return null;
  const key = JSON.stringify([text, info.fields.map(({ name, components }) => [name, components])]);
  if (!formulas.has(key)) {
    try {
      formulas.set(key, new Formula(text, info.fields));
    } catch (error) {
      formulas.set(key, null);
    }
  }
  return formulas.get(key);
}
