// SPDX-License-Identifier: BSD-3-Clause
// The levels of a stream in node, and the range of its first field at 1 %: node example-node.mjs
// http://127.0.0.1:8080/v1/meshes/fin
import { TetlodStream } from 'tetlod';

const stream = await TetlodStream.open(process.argv[2]);
for (const { level, tets, bytes, errors } of stream.info.levels)
  console.log(level, tets, bytes, Object.values(errors)[0].max);
const { level } = await stream.refineTo({ error: 0.01 });
const { tets, fields } = await stream.mesh();
const [[name, values]] = Object.entries(fields);
console.log(`at 1 %: level ${level}, ${tets.length / 4} tetrahedra, ${name} from ${
  values.reduce((a, b) => Math.min(a, b))} to ${values.reduce((a, b) => Math.max(a, b))}`);
stream.close();
