#!/usr/bin/env node
// SPDX-License-Identifier: 0BSD
// A reader as README.md defines it: the decoder of the browser. `make` puts it together in build/client.
import { createHash } from 'node:crypto';
import { readFileSync, realpathSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { readAll } from './read_all.mjs';

const built = process.env.TETLOD_CLIENT ?? join(fileURLToPath(new URL('../..', import.meta.url)), 'build', 'client');
const { View, compile } = await import(pathToFileURL(join(built, 'tetlod.js')));
const module = await compile(readFileSync(join(built, 'tetlod.wasm')));

function digest(...arrays) {
  const sum = createHash('sha256');
  for (const array of arrays) sum.update(Buffer.from(array.buffer, array.byteOffset, array.byteLength));
  return sum.digest('hex').slice(0, 16);
}

export const decoder = { View, module, digest };

async function main(path) {
  try {
    const { answer } = await readAll(decoder, readFileSync(path));
    console.log(JSON.stringify(answer));
  } catch (error) {
    console.error(`${path}: ${error.message}`);
    process.exitCode = 1;
  }
}

if (realpathSync(process.argv[1]) === fileURLToPath(import.meta.url)) await main(process.argv[2]);
