// SPDX-License-Identifier: 0BSD
// All of a stream by the decoder of the browser (View, module: build/client/tetlod.js), in node and in pages; and the
// section of SPEC.md that refuses a stream.

/** Tags of sections that this decoder skips. */
export const NOT_READ = ['ORDR', 'ORIG', 'SUMS'];

function levelsOf(view, { fields, levels }, digest) {
  if (view.ready >= 0) view.open(null);
  return levels.slice(0, view.ready + 1).map((_, level) => {
    view.seek(level);
    const mesh = view.mesh(fields);
    return [digest(mesh.positions), digest(mesh.tets), digest(...fields.map(({ name }) => mesh.fields[name]))];
  });
}

function cellsOf(view, { cellFields, tets }, number, digest, step = 0) {
  view.loadCells(number, step);
  return digest(view.cells(number, cellFields[number].components * tets));
}

function stepsOf(view, info, digest) {
  const series = view.series(null);
  const steps = series.bands.flatMap((_, band) => series.times.map((_, step) => {
    view.step(band, step);
    const { positions, fields } = view.mesh(info.fields);
    return digest(...series.fields.map(({ name }) => fields[name]), ...(series.displacement ? [positions] : []));
  }));
  const known = new Set(series.cellFields.map(({ name }) => name));
  const cellSteps = info.cellFields.flatMap(({ name }, number) =>
    (known.has(name) ? [series.times.map((_, step) => cellsOf(view, info, number, digest, step))] : []));
  return { steps, cell_steps: cellSteps };
}

/** The end of the file comes before that of the stream: `levels` are there, of `info.levels`. */
export class CutOff extends Error {
  constructor(info, levels) {
    super('the stream is cut off');
    Object.assign(this, { info, levels });
  }
}

async function ofStream({ View, module, digest }, bytes, told) {
  const view = await View.create(module);
  if (!view.add(bytes)) throw new CutOff(null, 0);
  const info = view.describe();
  told(info);
  if (info.bytes > bytes.length) throw new CutOff(info, levelsOf(view, info, digest).length);
  const levels = levelsOf(view, info, digest);
  const cells = info.cellFields.map((_, number) => cellsOf(view, info, number, digest));
  const answer = { levels, cells };
  return { info, answer: info.time ? { ...answer, ...stepsOf(view, info, digest) } : answer };
}

/** `{ info, answer }` of README.md, with digests by `digest(...arrays)`; `told(info)` as soon as the index is read. */
export async function readAll(decoder, bytes, told = () => {}) {
  const { info, answer } = await ofStream(decoder, bytes, told);
  const groups = [];
  for (const { offset, size, cid } of info.topologies.slice(1)) {
    const group = await ofStream(decoder, bytes.subarray(offset, offset + size), () => {});
    if (group.info.cid !== cid) throw new Error('a topology group is another stream than the table says');
    groups.push(group.answer);
  }
  return { info, answer: groups.length ? { ...answer, groups } : answer };
}

// What the decoder says, and the section of SPEC.md that it says it of; the first that matches.
const CLAUSES = [
  [/disagree about pages|table of pages|, page \d/, '7.6'],
  [/not a tetlod stream|format \d|old layout|needs features|header|content id|disagree about sizes/, '3.1'],
  [/follow the end|cut off/, '3'],
  [/more than their bytes can hold|more levels than go|go with the stream's bytes|memory/, '2.3'],
  [/levels that do not lead|more than a stream can hold|invalid bounds|less (or more )?than it should/, '3.2'],
  [/numbers of an unknown kind/, '5.2'],
  [/fields of one name|field without|field of too many|exact tail/, '3.3'],
  [/levels that do not grow|domain error|errors that grow|tail with a mesh/, '3.4'],
  [/section|without its section/, '3.5'],
  [/packed part/, '6.4'],
  [/cell data|from tetrahedra to cells/, '3.6'],
  [/table of steps|group of steps|step \d+ is damaged/, '3.7'],
  [/topology group/, '3.8'],
  [/^level \d+.*checksum/, '3.1'],
  [/exact values/, '9.3'],
  [/not finite/, '5.1'],
  [/^level 0:/, '9'],
  [/^level \d+:/, '7.5'],
];

/** The section of SPEC.md by which the decoder refused a stream with these words. */
export function clauseOf(message, info = null) {
  const words = message.replace(/^tetlod: /, '');
  const level = Number(words.match(/^level (\d+)/)?.[1] ?? -1);
  const [, clause] = CLAUSES.find(([pattern]) => pattern.test(words)) ?? [null, '16'];
  return clause === '7.5' && info?.paged && level >= info.paged ? '7.6' : clause;
}
