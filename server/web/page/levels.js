// SPDX-License-Identifier: BSD-3-Clause
// Levels and their errors, as the stream's index has them.

export const measureNames = {
  max: 'certified maximum',
  sampled: 'sampled maximum',
  rms: 'root mean square',
};

export const measuresOf = (info, field) => Object.keys(measureNames).filter((m) => info.levels[0].errors[field]?.[m] !== undefined);

// The wanted measure where the field has it, else the strictest that it has.
export function measureFor(info, { field, measure }) {
  const has = measuresOf(info, field);
  return has.includes(measure) ? measure : has[0];
}

export const errorOf = (level, field, measure) => level.errors[field]?.[measure] ?? 1;

// The coarsest level with at most the wanted error, coarser if a budget says so.
export function wantedLevel(info, state) {
  const measure = measureFor(info, state);
  const last = info.levels.length - 1;
  let k = info.levels.findIndex((l) => errorOf(l, state.field, measure) <= state.error);
  if (k < 0) k = last;
  while (k > 0 && ((state.maxTets && info.levels[k].tets > state.maxTets) || (state.maxBytes && info.levels[k].bytes > state.maxBytes))) k--;
  return k;
}

// The error to ask for so that a level is the answer: levels of the same error are the same to the target.
export const errorForLevel = (info, state, k) => errorOf(info.levels[k], state.field, measureFor(info, state));

// The extremes of a field's errors that are not zero: what the slider reaches over.
export function errorSpan(info, state) {
  const measure = measureFor(info, state);
  const errors = info.levels.map((l) => errorOf(l, state.field, measure)).filter((e) => e > 0);
  const most = Math.max(...errors, 1e-9);
  return [Math.min(...errors, most), most];
}

export const fieldOf = (info, name) => info.fields.find((f) => f.name === name);
export const spanOf = (field) => field.range[1] - field.range[0];

// What is drawn of a field: its only component has no choice.
export function componentOf(info, state) {
  const { components } = fieldOf(info, state.field);
  if (components === 1) return 0;
  return state.component === 'magnitude' || state.component >= components ? 'magnitude' : state.component;
}

// Whose isosurfaces: of what is coloured, or of another field, of its length if it has several components.
export function isosurfacesOf(info, state) {
  const field = fieldOf(info, state.isosurfaceField);
  if (!field || field.name === state.field) return { field: state.field, component: componentOf(info, state), colored: true };
  return { field: field.name, component: field.components === 1 ? 0 : 'magnitude', colored: false };
}

export function titleOf(info, state) {
  const component = componentOf(info, state);
  const { components } = fieldOf(info, state.field);
  if (components === 1) return state.field;
  return component === 'magnitude' ? `|${state.field}|` : `${state.field} ${componentName(components, component)}`;
}

export const componentName = (components, i) => (components <= 3 ? 'xyz'[i] : String(i));
