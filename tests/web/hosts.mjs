// SPDX-License-Identifier: BSD-3-Clause
// Hosts for the tests of the web client: files with and without Range and with faults, and the program itself.
import { execFileSync, spawn } from 'node:child_process';
import { once } from 'node:events';
import { existsSync, readFileSync, statSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { extname, join } from 'node:path';

export const { TETLOD, SCRATCH = '.', ROOT = '.' } = process.env;

const mediaTypes = {
  '.html': 'text/html',
  '.js': 'text/javascript',
  '.json': 'application/json',
  '.wasm': 'application/wasm',
  '.css': 'text/css',
  '.svg': 'image/svg+xml'
};

/** A stream of the sample `fin`, made once. */
export function sampleStream() {
  const path = join(SCRATCH, 'fin.tetlod');
  if (!existsSync(path)) {
    execFileSync(TETLOD, ['sample', 'fin', '-o', join(SCRATCH, 'fin.vtu')], { stdio: 'ignore' });
    execFileSync(TETLOD, ['build', join(SCRATCH, 'fin.vtu'), '--field', 'Pressure', '-o', path, '--quiet']);
  }
  return { path, bytes: readFileSync(path) };
}

// A block of 6 * n^3 tetrahedra in a cube of side 1, as the text of a legacy VTK file; `tets` say in which cube they
// are.
function block(n) {
  const at = (x, y, z) => x + (n + 1) * (y + (n + 1) * z);
  const line = Array.from({ length: n + 1 }, (_, i) => i);
  const points = line.flatMap((z) => line.flatMap((y) => line.map((x) => [x, y, z].map((c) => c / n))));
  const orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
  const tets = [];
  for (let cube = 0; cube < n ** 3; cube++) {
    const low = [cube % n, Math.floor(cube / n) % n, Math.floor(cube / n ** 2)];
    for (const [k, order] of orders.entries()) {
      const corner = [...low];
      const [a, b, c, d] = [at(...corner), ...order.map((axis) => { corner[axis]++; return at(...corner); })];
      tets.push({ low, corners: [0, 3, 4].includes(k) ? [a, b, c, d] : [a, c, b, d] }); // none is inside out
    }
  }
  const text = [
    '# vtk DataFile Version 3.0', 'block', 'ASCII', 'DATASET UNSTRUCTURED_GRID', `POINTS ${points.length} double`,
    ...points.map((p) => p.join(' ')), `CELLS ${tets.length} ${5 * tets.length}`,
    ...tets.map(({ corners }) => `4 ${corners.join(' ')}`), `CELL_TYPES ${tets.length}`, ...tets.map(() => '10'),
    `POINT_DATA ${points.length}`
  ];
  return { points, tets, text };
}

function streamOf(name, text, ...options) {
  const path = join(SCRATCH, `${name}.tetlod`);
  writeFileSync(join(SCRATCH, `${name}.vtk`), text.join('\n'));
  execFileSync(TETLOD, ['build', join(SCRATCH, `${name}.vtk`), ...options, '-o', path, '--quiet']);
  return { path, bytes: readFileSync(path) };
}

/**
 * A stream with values of cells: a block of 6 * 8^3 tetrahedra in three materials, of which the third fills a corner, a
 * load of each tetrahedron, which is its number there, and a vector of two components.
 */
export function cellStream() {
  const n = 8;
  const { points, tets, text } = block(n);
  const material = tets.map(({ low }) => (low.every((c) => c >= n / 2) ? 30 : low[0] < n / 2 ? 10 : 20));
  return streamOf('cells',
    [
      ...text, 'SCALARS heat double 1', 'LOOKUP_TABLE default', ...points.map(([x, y, z]) => Math.sin(3 * x) + y * z),
      `CELL_DATA ${tets.length}`, 'SCALARS material int 1', 'LOOKUP_TABLE default', ...material, 'SCALARS load float 1',
      'LOOKUP_TABLE default', ...tets.keys(), 'SCALARS pull float 2', 'LOOKUP_TABLE default',
      ...[...tets.keys()].map((t) => `${t % 3} ${-t}`)
    ],
    '--field', 'heat', '--region', 'material');
}

/** The path of a stream of a block with these fields, each a function of a place; the first drives the contraction. */
export function blockStream(name, n, fields) {
  const { points, text } = block(n);
  const lines = Object.entries(fields).flatMap(([field, of]) => {
    const values = points.map(of);
    return Array.isArray(values[0]) ? [`VECTORS ${field} double`, ...values.map((v) => v.join(' '))]
      : [`SCALARS ${field} double 1`, 'LOOKUP_TABLE default', ...values];
  });
  return streamOf(name, [...text, ...lines], '--field', Object.keys(fields)[0]).path;
}

/**
 * A loaded beam as files of two formats, {name: text}: ids of its points and a constant come before what one wants to
 * see, a displacement and its stresses.
 */
export function beam() {
  const { points, tets, text } = block(4);
  const bend = ([x, , z]) => [0.2 * x * (z - 0.5), 0, -0.3 * x * x];
  const stress = ([x, , z]) => [100 * (1 - x) * (z - 0.5), 0, 0, 0, 0, 5 * (0.25 - (z - 0.5) ** 2)];
  const tensor = (p) => {
    const [xx, yy, zz, xy, yz, xz] = stress(p);
    return [xx, xy, xz, xy, yy, yz, xz, yz, zz];
  };
  const vtk = [...text, 'SCALARS GlobalNodeId double 1', 'LOOKUP_TABLE default', ...points.keys(),
    'SCALARS Zero double 1', 'LOOKUP_TABLE default', ...points.map(() => 0),
    'VECTORS Displacement double', ...points.map((p) => bend(p).join(' ')),
    'TENSORS Stress double', ...points.map((p) => tensor(p).join(' '))];
  const msh = ['$MeshFormat', '2.2 0 8', '$EndMeshFormat', '$Nodes', points.length,
    ...points.map((p, i) => `${i + 1} ${p.join(' ')}`), '$EndNodes', '$Elements', tets.length,
    ...tets.map(({ corners }, i) => `${i + 1} 4 2 1 1 ${corners.map((c) => c + 1).join(' ')}`), '$EndElements',
    '$NodeData', 1, '"Displacement"', 1, 0, 3, 0, 3, points.length,
    ...points.map((p, i) => `${i + 1} ${bend(p).join(' ')}`), '$EndNodeData', ''];
  return { 'beam.vtk': vtk.join('\n'), 'beam.msh': msh.join('\n') };
}

/** A stream with a field whose vectors turn by almost a radian within a tetrahedron, and a scalar. */
export function turningStream() {
  const { points, text } = block(6);
  const turn = ([x, y, z]) => 3 * x + 2 * y - z;
  return streamOf('turning',
    [
      ...text, 'SCALARS heat double 1', 'LOOKUP_TABLE default', ...points.map(([x, y, z]) => Math.sin(3 * x) + y * z),
      'VECTORS flow double',
      ...points.map((p) => `${Math.cos(turn(p))} ${(1 + p[2]) * Math.sin(turn(p))} ${0.6 * p[1]}`)
    ],
    '--field', 'heat');
}

/**
 * A host of bytes. `requests` gathers {url, range, sent}; `fault(request, response, number)` may answer instead and
 * returns true then; `ranges: false` ignores Range; `cut`: a connection breaks after so many bytes; `hold`: after so
 * many bytes an answer waits until the client gives it up (`gone` of the request is a promise of that); `pace`:
 * milliseconds after each piece, or a function of the bytes sent that gives a promise to wait for.
 */
export async function fileHost(bytes, { ranges = true, etag = '"1"' } = {}) {
  const host = { bytes, etag, ranges, fault: null, cut: Infinity, hold: Infinity, pace: 0, requests: [] };
  const server = createServer(async (request, response) => {
    const seen = { url: request.url, range: request.headers.range, sent: 0 };
    host.requests.push(seen);
    if (host.fault?.(request, response, host.requests.length)) return;
    let body = typeof host.bytes === 'function' ? host.bytes(request.url) : host.bytes;
    if (!body) {
      response.writeHead(404).end();
      return;
    }
    const [, first, last] = /^bytes=(\d+)-(\d+)$/.exec(seen.range ?? '') ?? [];
    const headers = {
      ETag: host.etag,
      'Access-Control-Allow-Origin': '*',
      'Content-Type': mediaTypes[extname(request.url.split('?')[0])] ?? 'application/octet-stream',
      ...host.headers
    };
    if (host.ranges && first !== undefined) {
      if (Number(first) >= body.length) {
        response.writeHead(416, { 'Content-Range': `bytes */${body.length}` }).end();
        return;
      }
      const end = Math.min(Number(last) + 1, body.length);
      headers['Content-Range'] = `bytes ${first}-${end - 1}/${body.length}`;
      body = body.subarray(Number(first), end);
      response.statusCode = 206;
    }
    const gone = new AbortController();
    seen.gone = once(response, 'close').then(() => gone.abort());
    response.writeHead(response.statusCode, { ...headers, 'Content-Length': body.length });
    for (let at = 0; at < body.length && !response.destroyed; at += 16384) {
      const piece = body.subarray(at, Math.min(at + 16384, host.cut));
      seen.sent += piece.length;
      const room = response.write(piece);
      if (at + 16384 >= host.cut) {
        setTimeout(() => response.destroy(), 20);
        return;
      }
      if (at + 16384 >= host.hold) await seen.gone;
      if (!room) await once(response, 'drain', { signal: gone.signal }).catch(() => {});
      if (typeof host.pace === 'function') await host.pace(seen.sent);
      else if (host.pace) await new Promise((resolve) => setTimeout(resolve, host.pace));
    }
    response.end();
  });
  await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
  host.url = `http://127.0.0.1:${server.address().port}/fin.tetlod`;
  host.origin = new URL(host.url).origin;
  host.close = () => { server.closeAllConnections?.(); server.close(); };
  return host;
}

/** A folder of files, with index.json for folders, an empty page, and an empty icon for browsers that ask for one. */
export const folderHost = (folder) => fileHost((url) => {
  if (url === '/favicon.ico' || url === '/empty.html') return Buffer.alloc(0);
  let path = join(folder, decodeURIComponent(new URL(url, 'http://x').pathname));
  if (existsSync(path) && statSync(path).isDirectory()) path = join(path, 'index.json');
  return existsSync(path) && readFileSync(path);
});

/** `tetlod serve`; port 0 takes a free one. */
export async function program(paths, port = 0) {
  const child = spawn(TETLOD, ['serve', '--cors', '*', '--listen', `127.0.0.1:${port}`, ...paths],
    { stdio: ['ignore', 'pipe', 'ignore'] });
  const url = await new Promise((resolve, reject) => {
    child.stdout.once('data', (text) => resolve(String(text).trim()));
    child.once('exit', (code) => reject(new Error(`the server ended with ${code}`)));
  });
  const stop = (signal = 'SIGTERM') => new Promise((resolve) => {
    child.removeAllListeners('exit');
    if (child.exitCode !== null || child.signalCode !== null) return void resolve(); // it has ended already
    child.once('exit', resolve);
    child.kill(signal);
  });
  process.once('exit', () => child.kill('SIGKILL'));
  return { url, port: Number(new URL(url).port), stop };
}
