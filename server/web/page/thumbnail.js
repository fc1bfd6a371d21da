// SPDX-License-Identifier: BSD-3-Clause
// A small picture of a stream for the catalogue: the boundary of a coarse level, painted from the back to the front, in
// the colours of the viewer's first view.

import { firstField } from '../client/choose.js';
import { sized } from './canvas.js';
import { colorTable } from './colors.js';
import { autoRange, mapOf } from './first_view.js';
import { add, cross, dot, unit } from './geometry.js';
import { clamp } from './numbers.js';

const towards = unit([0.62, -0.66, 0.42]);
const right = unit(cross([0, 0, 1], towards));
const up = cross(towards, right);
const sizes = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 };

// glTF's binary form: a header of 12 bytes, a chunk of JSON, a chunk of numbers
function readGlb(buffer) {
  const jsonBytes = new DataView(buffer).getUint32(12, true);
  const json = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 20, jsonBytes)));
  const array = (i, Type) => {
    const { bufferView, count, type } = json.accessors[i];
    return new Type(buffer, 28 + jsonBytes + (json.bufferViews[bufferView].byteOffset ?? 0), count * sizes[type]);
  };
  const { indices, attributes } = json.meshes[0].primitives[0];
  const { fields } = json.meshes[0].extras;
  const named = (name) => attributes[Object.keys(fields).find((key) => fields[key] === name)];
  return {
    triangles: array(indices, Uint32Array),
    points: array(attributes.POSITION, Float32Array),
    values: (name) => array(named(name), Float32Array),
  };
}

// Triangles as seen, the nearest last: { corners in the plane of the picture, value, light }.
function project({ triangles, points }, values, components) {
  const at = (i) => [points[3 * i], points[3 * i + 1], points[3 * i + 2]];
  const value = (i) =>
    (components === 1 ? values[i] : Math.hypot(...values.subarray(components * i, components * (i + 1))));
  const seen = [];
  for (let t = 0; t < triangles.length; t += 3) {
    const ids = [triangles[t], triangles[t + 1], triangles[t + 2]];
    const [a, b, c] = ids.map(at);
    const normal = unit(cross(add(b, a, -1), add(c, a, -1)));
    const facing = Math.abs(dot(normal, towards));
    seen.push({
      corners: [a, b, c].map((p) => [dot(p, right), -dot(p, up)]),
      depth: dot(add(add(a, b), c), towards),
      value: (value(ids[0]) + value(ids[1]) + value(ids[2])) / 3,
      light: 0.55 + 0.45 * facing,
    });
  }
  return seen.sort((p, q) => p.depth - q.depth);
}

function paint(canvas, seen) {
  const { context, width, height } = sized(canvas);
  const span = (values) =>
    values.reduce(([low, high], v) => [Math.min(low, v), Math.max(high, v)], [Infinity, -Infinity]);
  const [x0, x1] = span(seen.flatMap((t) => t.corners.map((c) => c[0])));
  const [y0, y1] = span(seen.flatMap((t) => t.corners.map((c) => c[1])));
  const values = Float64Array.from(seen, (t) => t.value).sort();
  const ends = [values[0], values.at(-1)];
  const [low, high] = autoRange(ends, values);
  const table = colorTable(mapOf({ map: 'auto' }, ends), false, 256);
  const factor = 0.94 * Math.min(width / (x1 - x0 || 1), height / (y1 - y0 || 1));
  context.translate(width / 2, height / 2);
  context.scale(factor, factor);
  context.translate(-(x0 + x1) / 2, -(y0 + y1) / 2);
  context.lineWidth = 0.8 / factor; // closes the seams between triangles
  context.lineJoin = 'round';
  for (const { corners, value, light } of seen) {
    const color = table[clamp(Math.round((255 * (value - low)) / (high - low || 1)), 0, 255)];
    context.fillStyle = context.strokeStyle = `rgb(${color.map((c) => Math.round(c * light))})`;
    context.beginPath();
    for (const [x, y] of corners) context.lineTo(x, y);
    context.closePath();
    context.fill();
    context.stroke();
  }
}

// Draws the stream into the canvas; where that fails, the canvas stays empty: its figures are beside it.
export async function drawThumbnail(canvas, stream) {
  const field = firstField(stream.fields);
  const level = stream.levels.findLast((l) => l.tets <= 6000) ?? stream.levels[0];
  const answer =
    await fetch(`v1/meshes/${encodeURIComponent(stream.id)}/${stream.cid}/levels/${level.level}/surface.glb`);
  if (!answer.ok || !field) return;
  const mesh = readGlb(await answer.arrayBuffer());
  paint(canvas, project(mesh, mesh.values(field.name), field.components));
}
