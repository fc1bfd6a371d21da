// SPDX-License-Identifier: BSD-3-Clause
// Hosts for the tests of the web client: files with and without Range and with faults, and the program itself.
import { execFileSync, spawn } from 'node:child_process';
import { once } from 'node:events';
import { existsSync, readFileSync, statSync } from 'node:fs';
import { createServer } from 'node:http';
import { extname, join } from 'node:path';

export const { TETLOD, SCRATCH = '.', ROOT = '.' } = process.env;

const mediaTypes = { '.html': 'text/html', '.js': 'text/javascript', '.json': 'application/json', '.wasm': 'application/wasm',
  '.css': 'text/css', '.svg': 'image/svg+xml' };

/** A stream of the sample `fin`, made once. */
export function sampleStream() {
  const path = join(SCRATCH, 'fin.tetlod');
  if (!existsSync(path)) {
    execFileSync(TETLOD, ['sample', 'fin', '-o', join(SCRATCH, 'fin.vtu')], { stdio: 'ignore' });
    execFileSync(TETLOD, ['build', join(SCRATCH, 'fin.vtu'), '-o', path, '--quiet']);
  }
  return { path, bytes: readFileSync(path) };
}

/**
 * A host of bytes. `requests` gathers {url, range, sent}; `fault(request, response, number)` may answer instead and
 * returns true then; `ranges: false` ignores Range; `cut`: a connection breaks after so many bytes; `hold`: after so many
 * bytes an answer waits until the client gives it up (`gone` of the request is a promise of that).
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
    const headers = { ETag: host.etag, 'Access-Control-Allow-Origin': '*', 'Content-Type': mediaTypes[extname(request.url.split('?')[0])] ?? 'application/octet-stream', ...host.headers };
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
      if (host.pace) await new Promise((resolve) => setTimeout(resolve, host.pace));
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
  const child = spawn(TETLOD, ['serve', '--cors', '*', '--listen', `127.0.0.1:${port}`, ...paths], { stdio: ['ignore', 'pipe', 'ignore'] });
  const url = await new Promise((resolve, reject) => {
    child.stdout.once('data', (text) => resolve(String(text).trim()));
    child.once('exit', (code) => reject(new Error(`the server ended with ${code}`)));
  });
  const stop = (signal = 'SIGTERM') => new Promise((resolve) => {
    child.removeAllListeners('exit');
    child.once('exit', resolve);
    child.kill(signal);
  });
  process.once('exit', () => child.kill('SIGKILL'));
  return { url, port: Number(new URL(url).port), stop };
}
