// SPDX-License-Identifier: BSD-3-Clause
// What the page shows: a stream by its name and source, and the picture of it.

import { chooseFile } from './choose_file.js';
import { byId } from './dom.js';
import { Viewer } from './viewer.js';

// view/{id} on a server; ?stream=URL is any stream that can be fetched; without either somebody chooses a file. This
// module lies at the root of the site.
export const root = new URL('.', import.meta.url);
export const id = decoded(/^view\/(.*)$/.exec(location.pathname.slice(root.pathname.length))?.[1] ?? '');
const file = new URLSearchParams(location.search).get('stream');
export const source = await (id ? new URL(`v1/meshes/${encodeURIComponent(id)}`, root).href : file ?? chooseFile());
export const name = id || nameOf(source);

// A name may have percent signs that encode nothing.
function decoded(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

// fin of …/fin.tetlod, and of …/fin/{content id}/stream
function nameOf(from) {
  const path = from.name ?? decoded(new URL(from, location).pathname);
  return /([^/]+)\/[0-9a-f]{32}\/stream$/.exec(path)?.[1] ?? path.split('/').pop().replace(/\.tetlod$/, '');
}

const below = () => (matchMedia('(max-width: 900px)').matches ? 132 : 64); // player.css
export const viewer =
  new Viewer({ stage: byId('stage'), picture: byId('picture'), bar: byId('scalarbar'), below }, location.hash);
