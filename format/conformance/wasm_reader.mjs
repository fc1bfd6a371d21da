#!/usr/bin/env node
// SPDX-License-Identifier: 0BSD
// A reader as README.md defines it: the decoder of the browser. `make` puts it together in build/client.
import { createHash } from 'node:crypto';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath, pathToFileURL } from 'node:url';

const built = process.env.TETLOD_CLIENT ?? join(fileURLToPath(new URL('../..', import.meta.url)), 'build', 'client');
const { View, compile } = await import(pathToFileURL(join(built, 'tetlod.js')));
const module = await compile(readFileSync(join(built, 'tetlod.wasm')));

const digest = (...arrays) => {
  const sum = createHash('sha256');
  for (const array of arrays) sum.update(Buffer.from(array.buffer, array.byteOffset, array.byteLength));
  return sum.digest('hex').slice(0, 16);
};

function levelsOf(view, { fields, levels }) {
  view.open(null);
  return levels.map((_, level) => {
    view.seek(level);
    const mesh = view.mesh(fields);
    return [digest(mesh.positions), digest(mesh.tets), digest(...fields.map(({ name }) => mesh.fields[name]))];
  });
}

function cellsOf(view, { cellFields, tets }, number, step = 0) {
  view.loadCells(number, step);
  return digest(view.cells(number, cellFields[number].components * tets));
}

function stepsOf(view, info) {
  const series = view.series(null);
  const steps = series.bands.flatMap((_, band) => series.times.map((_, step) => {
    view.step(band, step);
    const { positions, fields } = view.mesh(info.fields);
    return digest(...series.fields.map(({ name }) => fields[name]), ...(series.displacement ? [positions] : []));
  }));
  const known = new Set(series.cellFields.map(({ name }) => name));
  const cellSteps = info.cellFields.flatMap(({ name }, number) =>
    (known.has(name) ? [series.times.map((_, step) => cellsOf(view, info, number, step))] : []));
  return { steps, cell_steps: cellSteps };
}

async function ofStream(bytes) {
  const view = await View.create(module);
  if (!view.add(bytes)) throw new Error('the stream ends too early');
  const info = view.describe();
  if (info.bytes !== bytes.length) throw new Error('the stream is cut off');
  const levels = levelsOf(view, info), cells = info.cellFields.map((_, number) => cellsOf(view, info, number));
  const answer = { levels, cells };
  return { info, answer: info.time ? { ...answer, ...stepsOf(view, info) } : answer };
}

const bytes = readFileSync(process.argv[2]);
try {
  const { info, answer } = await ofStream(bytes);
  const groups = [];
  for (const { offset, size, cid } of info.topologies.slice(1)) {
    const group = await ofStream(bytes.subarray(offset, offset + size));
    if (group.info.cid !== cid) throw new Error('a topology group is another stream than the table says');
    groups.push(group.answer);
  }
  console.log(JSON.stringify(groups.length ? { ...answer, groups } : answer));
} catch (error) {
  console.error(`${process.argv[2]}: ${error.message}`);
  process.exitCode = 1;
}
