// SPDX-License-Identifier: BSD-3-Clause
// Which level a request asks for, from the index alone (tetlod_level_for_* of format/tetlod.h).

const measures = ['max', 'sampled', 'rms', 'predicted'];

function fieldsOf(info, name) {
  if (name === undefined) {
    const controlled = info.fields.filter((field) => field.controlled);
    return controlled.length ? controlled : info.fields;
  }
  const field = info.fields.find((f) => f.name === name);
  if (!field)
    throw new RangeError(`there is no field '${name}'; there are: ${info.fields.map((f) => f.name).join(', ')}`);
  return [field];
}

// NodeId, GlobalIds, node_id, ID; but neither grid nor FLUID.
const saysIds = (name) =>
  /^ids?$/i.test(name) || /Ids?$/.test(name) || /[^A-Z]IDs?$/.test(name) || /[^a-zA-Z]ids?$/.test(name);
const isConstant = ({ range }) => range && !(range[1] > range[0]);

/** The field that is shown first: one that drove the contraction, but neither numbers of things nor a constant. */
export const firstField = (fields) => {
  const telling = fields.filter((field) => !saysIds(field.name) && !isConstant(field));
  const choice = telling.length ? telling : fields;
  return choice.find(({ controlled }) => controlled) ?? choice[0];
};

function atLeast0(name, value) {
  if (!(value >= 0)) throw new RangeError(`${name} is a number of at least 0, not ${value}`);
  return value;
}

function levelForError(info, { error, absError, field, measure = 'max' }) {
  const fields = fieldsOf(info, field);
  const finest = info.levels.length - 1;
  if (!measures.includes(measure)) throw new RangeError(`measure is one of ${measures.join(', ')}, not '${measure}'`);
  const unknown = fields.find((f) => info.levels[finest].errors[f.name]?.[measure] === undefined);
  if (unknown) throw new RangeError(`the stream does not hold the measure '${measure}' of '${unknown.name}'`);
  // an absolute error: of every field in its own range
  const within = (has, [low, high]) => has <= (error ?? Infinity) && has * (high - low) <= (absError ?? Infinity);
  const found = info.levels.findIndex((level) => fields.every((f) => within(level.errors[f.name][measure], f.range)));
  return found < 0 ? finest : found;
}

// The finest level that keeps to a budget; level 0 if even that is over it.
function levelWithin(info, key, most) {
  let level = 0;
  while (level + 1 < info.levels.length && info.levels[level + 1][key] <= most) level++;
  return level;
}

/**
 * How far a value of a level may be from the original's: of a component, or of the length of all, from the errors of
 * each. `certified`: proved; else it is the largest that was measured. `local`: the local bound at a
 * place, if it is known.
 */
export function boundOf(info, level, name, component, local) {
  const { components, range: [low, high] } = info.fields.find((f) => f.name === name);
  const { max, sampled = 1 } = info.levels[level].errors[name] ?? {};
  const lengths = component === 'magnitude' ? Math.sqrt(components) : 1;
  return { bound: local ?? (max ?? sampled) * (high - low) * lengths, certified: (local ?? max) !== undefined };
}

/** The coarsest level for an error, limited by budgets; the finest one if nothing is asked. */
export function chooseLevel(info, target) {
  const finest = info.levels.length - 1;
  let level = finest;
  if (target.level !== undefined) {
    if (!Number.isInteger(target.level) || target.level < 0 || target.level > finest)
      throw new RangeError(`level is a whole number from 0 to ${finest}, not ${target.level}`);
    level = target.level;
  }
  if (target.error !== undefined) atLeast0('error', target.error);
  if (target.absError !== undefined) atLeast0('absError', target.absError);
  if (target.error !== undefined || target.absError !== undefined) level = Math.min(level, levelForError(info, target));
  for (const key of ['tets', 'bytes'])
    if (target[key] !== undefined) level = Math.min(level, levelWithin(info, key, atLeast0(key, target[key])));
  return level;
}
