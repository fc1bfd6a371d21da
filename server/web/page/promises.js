// SPDX-License-Identifier: BSD-3-Clause
// What levels promise, in numbers and words: for the panel and what is loaded after it.

import { boundOf } from '../client/choose.js';
import { colouredOf, errorOf, fieldOf, measureFor, spanOf, targetFieldOf, unitOf } from './levels.js';
import { count, percent, roundedUp, significant } from './numbers.js';

// What a level promises of every field, as `tetlod extract` says it.
export function promiseOf({ finer, ...info }, level) {
  const inBoxes = finer?.boxLevel && `; in boxes ${promiseOf(info, finer.boxLevel)}`;
  if (finer?.pages >= 0)
    return `${promiseOf(info, finer.worst)} in the picture; elsewhere ${promiseOf(info, level)}${inBoxes || ''}`;
  if (finer)
    return `${promiseOf(info, level)}${inBoxes}; between them ${count(finer.between)} tetrahedra without a bound`;
  const { errors } = info.levels[level];
  const held = info.fields
    .filter((f) => f.controlled)
    .map(({ name }) =>
      errors[name].max === undefined
        ? `${name} ${percent(errors[name].sampled)} (measured)`
        : `${name} ≤ ${percent(roundedUp(errors[name].max, 3))} (certified)`,
    );
  const others = info.fields
    .filter((f) => !f.controlled && !f.bounds && !info.metadata?.ids?.includes(f.name))
    .map(({ name }) => ({ name, sampled: errors[name].sampled }));
  const worst = others.reduce((a, b) => (b.sampled > a.sampled ? b : a), others[0]);
  const rest = worst
    && `${
      others.length === 1
        ? `${worst.name} not controlled:`
        : `${others.length} fields not controlled, worst ${worst.name}`} ${percent(worst.sampled)} (measured)`;
  return [held.join(', '), rest].filter(Boolean).join('; ');
}

// The error to ask for so that a level is the answer: levels of the same error are the same to the target.
export const errorForLevel = (info, state, k) =>
  errorOf(info.levels[k], targetFieldOf(info, state), measureFor(info, state));

// The extremes of a field's errors that are not zero: what the slider reaches over.
export function errorSpan(info, state) {
  const measure = measureFor(info, state);
  const field = targetFieldOf(info, state);
  const errors = info.levels.map((l) => errorOf(l, field, measure)).filter((e) => e > 0);
  const most = Math.max(...errors, 1e-9);
  return [Math.min(...errors, most), most];
}

// '± 0.04 (0.5 %, certified)' of what boundOf gives; a length's bound is in proportion to a component's range.
export const wordsOfBound = (info, name, { bound, certified }) => bound
  ? `± ${amountOf(info, name, roundedUp(bound, 2))} (${
    percent(roundedUp(bound / (spanOf(fieldOf(info, name)) || 1), 3))}, ${certified ? 'certified' : 'measured'})`
  : 'exact';

// How far a value that colours may be from the original's: { bound, certified, words }; for values of cells a coarser
// level has no bound: null.
// `local`: what the local bound says there, if it is known.
// `part`: of a mesh that is finer in boxes, where that is known: outside, inside, or between them.
export function boundShown(info, level, state, local, part = 'between') {
  const inBoxes = info.finer && info.finer.pages === undefined;
  if (inBoxes && part === 'between')
    return { bound: null, certified: false, words: 'without a bound, where levels meet' };
  if (inBoxes && part === 'inside') level = info.finer.boxLevel;
  const { field, cells, component, formula } = colouredOf(info, state);
  if (formula) return formulaBound(formula, info, level);
  if (!cells && field.bounds)
    return { bound: null, certified: true, words: `is how far off ${field.bounds} is at most` };
  if (cells)
    return level === info.levels.length - 1
      ? { bound: 0, certified: true, words: 'exact' }
      : { bound: null, certified: false, words: 'of the cell, without a bound' };
  const found = boundOf(info, level, field.name, component, local);
  return { ...found, words: wordsOfBound(info, field.name, found) };
}

/** As boundShown, of a function; with `values` of a probe at that place. */
export function formulaBound(formula, info, level, values = null) {
  const { bound, certified } = formula.at(info, level, values);
  if (!Number.isFinite(bound)) return { bound: null, certified: false, words: 'without a bound' };
  const { low, high } = formula.at(info, info.levels.length - 1);
  const share = Number.isFinite(high - low) && high > low ? `${percent(roundedUp(bound / (high - low), 3))}, ` : '';
  return {
    bound,
    certified,
    words: bound
      ? `± ${significant(roundedUp(bound, 2), 2)} (${share}${certified ? 'certified' : 'measured'})`
      : 'exact',
  };
}

const amountOf = (info, name, x) => `${significant(x, 2)}${unitOf(info, name) && ` ${unitOf(info, name)}`}`;

export const unitsText = (units) =>
  [...units]
    .filter(([name, unit]) => unit && !/[;=]/.test(unit) && !name.includes(';'))
    .map((pair) => pair.join('='))
    .join(';');
