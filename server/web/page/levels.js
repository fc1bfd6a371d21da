// SPDX-License-Identifier: BSD-3-Clause
// Levels and their errors, as the stream's index has them.

import { boundOf, firstField } from '../client/choose.js';
import { percent, roundedUp, significant } from './numbers.js';

export const measureNames = {
  max: 'certified maximum',
  sampled: 'sampled maximum',
  rms: 'root mean square',
};

export const measuresOf = (info, field) => Object.keys(measureNames).filter((m) => info.levels[0].errors[field]?.[m] !== undefined);

// The field whose error the target limits: the one asked for, else the one that is drawn if the stream controls it (of
// a local
// bound the one that it bounds), else the first controlled one. A field that is only drawn changes no level: what it
// would cost
// is asked first.
export function targetFieldOf(info, { field, errorField }) {
  if (fieldOf(info, errorField)) return errorField;
  const shown = shownField(info, { field });
  return fieldOf(info, shown)?.controlled ? shown : (firstField(info.fields.filter((f) => f.controlled))?.name ?? field ?? info.fields[0].name);
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

// What a level promises of every field, as `tetlod extract` says it.
export function promiseOf(info, level) {
  const { errors } = info.levels[level];
  const held = info.fields.filter((f) => f.controlled)
    .map(({ name }) => (errors[name].max === undefined ? `${name} ${percent(errors[name].sampled)} (measured)` : `${name} ≤ ${percent(roundedUp(errors[name].max, 3))} (certified)`));
  const others = info.fields.filter((f) => !f.controlled && !f.bounds).map(({ name }) => ({ name, sampled: errors[name].sampled }));
  const worst = others.reduce((a, b) => (b.sampled > a.sampled ? b : a), others[0]);
  const rest = worst && `${others.length === 1 ? `${worst.name} not controlled:` : `${others.length} fields not controlled, worst ${worst.name}`} ${percent(worst.sampled)} (measured)`;
  return [held.join(', '), rest].filter(Boolean).join('; ');
}

// The coarsest level with at most the wanted error, coarser if a budget says so.
export function wantedLevel(info, state) {
  let k = levelForError(info, state);
  const most = state.maxTets || defaultTets();
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

// The error to ask for so that a level is the answer: levels of the same error are the same to the target.
export const errorForLevel = (info, state, k) => errorOf(info.levels[k], targetFieldOf(info, state), measureFor(info, state));

// The extremes of a field's errors that are not zero: what the slider reaches over.
export function errorSpan(info, state) {
  const measure = measureFor(info, state);
  const field = targetFieldOf(info, state);
  const errors = info.levels.map((l) => errorOf(l, field, measure)).filter((e) => e > 0);
  const most = Math.max(...errors, 1e-9);
  return [Math.min(...errors, most), most];
}

export function fieldOf(info, name) {
  return info.fields.find((f) => f.name === name);
}

// '± 0.04 (0.5 %, certified)' of what boundOf gives; a length's bound is in proportion to a component's range.
export const wordsOfBound = (info, name, { bound, certified }) =>
  (bound ? `± ${amountOf(info, name, roundedUp(bound, 2))} (${percent(roundedUp(bound / (spanOf(fieldOf(info, name)) || 1), 3))}, ${certified ? 'certified' : 'measured'})` : 'exact');
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

// How far a value that colours may be from the original's: { bound, certified, words }; for values of cells a coarser
// level has no bound: null.
// `local`: what the local bound says there, if it is known.
export function boundShown(info, level, state, local) {
  const { field, cells, component, formula } = colouredOf(info, state);
  if (formula) return formulaBound(formula, info, level);
  if (!cells && field.bounds) return { bound: null, certified: true, words: `is how far off ${field.bounds} is at most` };
  if (cells) return level === info.levels.length - 1 ? { bound: 0, certified: true, words: 'exact' } : { bound: null, certified: false, words: 'of the cell, without a bound' };
  const found = boundOf(info, level, field.name, component, local);
  return { ...found, words: wordsOfBound(info, field.name, found) };
}

/** As boundShown, of a function; with `values` of a probe at that place. */
export function formulaBound(formula, info, level, values = null) {
  const { bound, certified } = formula.at(info, level, values);
  if (!Number.isFinite(bound)) return { bound: null, certified: false, words: 'without a bound' };
  const { low, high } = formula.at(info, info.levels.length - 1);
  const share = Number.isFinite(high - low) && high > low ? `${percent(roundedUp(bound / (high - low), 3))}, ` : '';
  return { bound, certified, words: bound ? `± ${significant(roundedUp(bound, 2), 2)} (${share}${certified ? 'certified' : 'measured'})` : 'exact' };
}

// Fields of cells whose numbers can be those of regions.
export const regionFields = (info) => info.cellFields.filter(({ components, type }) => components === 1 && type.startsWith('int')).map(({ name }) => name);

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

// Names of the fields that the picture needs; probes and a plotted line tell the local bound, where there is one.
export const shownFields = (info, state) => [...new Set([
  state.field, ...(warpField(info, state) ? [state.warp] : []), ...(colouredOf(info, state).formula?.fields ?? []), ...(state.isosurfaces.length ? [isosurfacesOf(info, state).field] : []), vectorsOf(info, state) ?? state.field,
  (state.pins.length || state.line ? localBoundOf(info, state.field) : null) ?? state.field])];

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
export const unitsText = (units) => [...units].filter(([name, unit]) => unit && !/[;=]/.test(unit) && !name.includes(';')).map((pair) => pair.join('=')).join(';');

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

const amountOf = (info, name, x) => `${significant(x, 2)}${unitOf(info, name) && ` ${unitOf(info, name)}`}`;

const named = { 6: 'xx yy zz xy yz xz'.split(' '), 9: 'xx xy xz yx yy yz zx zy zz'.split(' ') };
export const componentNames = (components) =>
  named[components] ?? Array.from({ length: components }, (_, i) => (components <= 3 ? 'xyz'[i] : String(i)));
export const componentName = (components, i) => componentNames(components)[i];

// ---- functions of components (formula.js, which is loaded when one is shown)

/** What is drawn of tensors beside their components. */
export const tensorParts = { mises: 'von Mises', principal1: 'largest principal', principal2: 'middle principal', principal3: 'smallest principal' };
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
