// SPDX-License-Identifier: BSD-3-Clause
// node series_steps.mjs STREAM: what a step of a series costs the browser's decoder: bytes and requests of a seek, time
// of a step.
import { readFileSync } from 'node:fs';
import { pathToFileURL } from 'node:url';
import { resolve } from 'node:path';
import { fileHost } from '../web/hosts.mjs';

const { TetlodStream } = await import(pathToFileURL(resolve('build/client/stream.js')));
const host = await fileHost(readFileSync(process.argv[2]));
const stream = await TetlodStream.open(host.url);
await stream.show(
  { field: stream.info.fields[0].name, surface: true, slices: [{ origin: [0, 0, 0.5], normal: [0, 0, 1] }] });
const decoding = [];
stream.addEventListener('step', ({ detail }) => decoding.push(detail.seconds));
const median = (list) => 1000 * list.toSorted((a, b) => a - b)[list.length >> 1];
await stream.seekStep(0, { error: 0.01 });
const { times, bands } = stream.series;
const size = (range) => range.slice(6).split('-').reduce((first, last) => last - first + 1);
const before = host.requests.length;
await stream.seekStep(times.length - 1, { error: 0.01 });
const first = host.requests[before];
console.log(`seek at 1 %: the group is 1 range, ${first ? size(first.range) : 0} bytes`);
for (const band of [bands.findIndex(({ error }) => error === 0.01), bands.length - 1]) {
  await stream.seekStep(0, { band });
  decoding.length = 0;
  const { user, system } = process.cpuUsage();
  for (let step = 1; step < times.length; step++) await stream.seekStep(step, { band });
  const used = process.cpuUsage({ user, system });
  const all = (used.user + used.system) / 1000 / (times.length - 1);
  console.log(`${100 * bands[band].error} %, step after step: ${median(decoding).toFixed(1)} ms decoding; ${
    all.toFixed(1)} ms of processor time with surface and slice`);
  decoding.length = 0;
  for (let step = times.length - 1; step > 8; step -= 9) await stream.seekStep(step, { band });
  console.log(`${100 * bands[band].error} %, anywhere: ${median(decoding).toFixed(1)} ms decoding`);
}
process.exit(0);
