// SPDX-License-Identifier: 0BSD
// The page that validates a stream. `make` puts it, the decoder and its WebAssembly into one file: build/validate.html.
import { placeOf } from '../../server/web/client/network.js';
import { View, compile } from '../../server/web/client/tetlod.js';
import { CutOff, NOT_READ, clauseOf, readAll } from './read_all.mjs';
import wasm from 'tetlod.wasm';

const byId = (id) => document.getElementById(id);
const compiled = compile(wasm);

function row(cells, kind) {
  const line = document.createElement('tr');
  line.append(...cells.map((text) => Object.assign(document.createElement(kind), { textContent: text })));
  return line;
}

function showLevels({ levels }, decoded) {
  const table = document.createElement('table');
  table.append(row(['level', 'vertices', 'tetrahedra', 'bytes'], 'th'));
  table.append(
    ...levels.slice(0, decoded).map(({ vertices, tets, end }, level) => row([level, vertices, tets, end], 'td')));
  byId('details').replaceChildren(table);
}

function say(kind, text) {
  byId('verdict').className = kind;
  byId('verdict').textContent = text;
}

const ofLevels = (count) => (count === 1 ? 'level 0' : `levels 0 to ${count - 1}`);

function refuse(name, error, info) {
  if (error instanceof CutOff) {
    const of = error.levels && `${ofLevels(error.levels)} of ${error.info.levels.length}`;
    const held = `it holds ${of || 'no level'}`;
    if (error.levels) showLevels(error.info, error.levels);
    return say('cut', `${name}: cut off; ${held} (SPEC.md, 3)`);
  }
  return say('invalid', `${name}: refused by SPEC.md, ${clauseOf(error.message, info)}: ${error.message}`);
}

/** What is wrong with an HDF5 file's pointer (SPEC 3.10) is found where the stream should be. */
function streamOf(bytes) {
  const { base, size } = placeOf(bytes);
  return base ? bytes.subarray(base, base + size) : bytes;
}

let latest = 0; // of what was asked for last alone there is an answer

async function validate(name, read) {
  const number = ++latest;
  let info = null;
  say('', `${name}: reading …`);
  byId('details').replaceChildren();
  try {
    const bytes = streamOf(new Uint8Array(await read()));
    const decoder = { View, module: await compiled, digest: () => '' };
    const found = await readAll(decoder, bytes, (index) => { info = index; });
    if (number !== latest) return;
    showLevels(found.info, found.info.levels.length);
    say('valid', `${name}: valid, ${bytes.length} bytes, content id ${found.info.cid}`);
    const note = `Not decoded here: ${NOT_READ.join(', ')}. Not checked: errors. tetlod verify does both.`;
    byId('details').append(Object.assign(document.createElement('p'), { textContent: note }));
  } catch (error) {
    if (number !== latest) return;
    if (error instanceof TypeError) say('invalid', `${name}: cannot be read: ${error.message}`);
    else refuse(name, error, info);
  }
}

const validateFile = (file) => file && validate(file.name, () => file.arrayBuffer());

async function fetched(url) {
  const answer = await fetch(url);
  if (!answer.ok) throw new TypeError(`${answer.status} ${answer.statusText}`);
  return answer.arrayBuffer();
}

byId('file').addEventListener('change', ({ target }) => validateFile(target.files[0]));
byId('remote').addEventListener('submit', (event) => {
  event.preventDefault();
  validate(byId('url').value, () => fetched(byId('url').value));
});
for (const kind of ['dragover', 'dragleave', 'drop']) {
  document.addEventListener(kind, (event) => {
    event.preventDefault();
    byId('drop').classList.toggle('over', kind === 'dragover');
    if (kind === 'drop') validateFile(event.dataTransfer.files[0]);
  });
}
