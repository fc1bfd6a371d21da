// SPDX-License-Identifier: BSD-3-Clause
// The catalogue as a page: key figures of each stream, and its levels as links to mesh files.

import { takeDropped } from './choose_file.js';
import { firstField } from '../client/choose.js';
import { element } from './dom.js';
import { bytes, count, percent } from './numbers.js';
import './theme.js';
import { drawThumbnail } from './thumbnail.js';

const measures = [
  ['max', 'error (max)'],
  ['sampled', 'error (sampled)'],
  ['rms', 'error (rms)'],
];
const shownLevels = 12;

async function getJson(path) {
  const answer = await fetch(path);
  const body = await answer.json();
  if (!answer.ok) throw new Error(body.detail ?? answer.statusText);
  return body;
}

// A server answers at v1/meshes, page by page; in a folder on a host of files (tetlod explode --viewer) all is in
// index.json.
const pageSize = 1000; // streams
let inFolder = false;

async function firstPage() {
  try {
    return await getJson(`v1/meshes?limit=${pageSize}`);
  } catch (error) {
    const catalogue = await getJson('v1/meshes/index.json').catch(() => {
      throw error;
    });
    inFolder = true;
    return catalogue;
  }
}

async function* pages() {
  let page = await firstPage();
  yield page;
  while (page.next && !inFolder) {
    page = await getJson(`v1/${page.next}`);
    yield page;
  }
}

// The stream's address in a query, where percent signs stand for themselves only if they are encoded once more.
const viewOf = ({ id, cid }) =>
  inFolder
    ? `view.html?stream=${`v1/meshes/${encodeURIComponent(id)}/${cid}/stream`.replaceAll('%', '%25')}`
    : `view/${encodeURIComponent(id)}`;

const stepsOf = ({ series, topologies }) =>
  topologies?.length ? topologies.reduce((sum, { steps }) => sum + steps, 0) : series.times.length;

function figures(stream) {
  const pairs = [
    ...(stream.series ? [['steps in time', stepsOf(stream)]] : []),
    ['tetrahedra', count(stream.tets)],
    ['vertices', count(stream.vertices)],
    ['stream', bytes(stream.bytes)],
    ['levels', stream.levels.length],
    ['first picture', bytes(stream.levels[0].bytes)],
    ['fields', stream.fields.map((f) => f.name).join(', ')],
    ['restores the input', stream.lossless ? 'exactly' : 'within its error'],
  ];
  return element(
    'dl',
    {},
    ...pairs.map(([name, value]) =>
      element(
        'div',
        { className: name === 'fields' ? 'wide' : '' },
        element('dt', {}, name),
        element('dd', {}, String(value)),
      ),
    ),
  );
}

// The largest error of a level over the controlled fields, or undefined where the stream does not know it.
function worst(stream, level, measure) {
  const errors = stream.fields.filter((f) => f.controlled).map((f) => level.errors[f.name]?.[measure]);
  return errors.length && errors.every((e) => e !== undefined) ? Math.max(...errors) : undefined;
}

function levelRow(stream, level, columns) {
  const path = (format) =>
    new URL(
      stream.links.level
        .replace(/\{\?.*?\}/, '')
        .replace('{level}', level.level)
        .replace('{format}', format),
      stream.url,
    ).href;
  return element(
    'tr',
    {},
    element('td', {}, String(level.level)),
    element('td', {}, count(level.tets)),
    element('td', {}, bytes(level.bytes)),
    ...columns.map(([measure]) => element('td', {}, percent(worst(stream, level, measure), 3))),
    element(
      'td',
      {},
      element('a', { href: path('vtu'), download: `${stream.id}-${level.level}.vtu` }, 'VTU'),
      ' · ',
      element('a', { href: path('vtk'), download: `${stream.id}-${level.level}.vtk` }, 'VTK'),
      ' · ',
      element('a', { href: path('tetlod'), download: `${stream.id}-${level.level}.tetlod` }, 'stream'),
    ),
  );
}

// Some levels from the coarsest to the finest, evenly spread: levels grow by a factor.
function someLevels(levels) {
  const last = levels.length - 1;
  const steps = Math.min(shownLevels - 1, last);
  return Array.from({ length: steps + 1 }, (_, i) => levels[steps ? Math.round((last * i) / steps) : 0]);
}

function levelTable(stream) {
  const columns = measures.filter(([measure]) => worst(stream, stream.levels[0], measure) !== undefined);
  const body = element('tbody');
  const show = (levels) => body.replaceChildren(...levels.map((level) => levelRow(stream, level, columns)));
  show(someLevels(stream.levels));
  const head = ['level', 'tetrahedra', 'bytes', ...columns.map(([, title]) => title), 'mesh'];
  const table = element(
    'table',
    {},
    element('thead', {}, element('tr', {}, ...head.map((h) => element('th', {}, h)))),
    body,
  );
  const parts = [element('div', { className: 'scroll' }, table)];
  if (stream.levels.length > shownLevels) {
    const more = element('button', { type: 'button' }, `Show all ${stream.levels.length} levels`);
    more.addEventListener('click', () => {
      show(stream.levels);
      more.remove();
    });
    parts.push(more);
  }
  return parts;
}

// Bytes that the viewer loads for a level: of several fields it takes the first one only, which the server knows to do.
async function tellBytes(stream, level, place) {
  if (inFolder || stream.fields.length < 2) return;
  const { name } = firstField(stream.fields);
  const query = `level=${level.level}&fields=${encodeURIComponent(name)}`;
  const { ok, headers } = await fetch(new URL(`${stream.url}/prefix?${query}`), { method: 'HEAD' });
  if (ok) place.textContent = bytes(Number(headers.get('Content-Length')));
}

// What some accuracies cost, as links to the viewer.
function accuracies(stream) {
  const measure = measures.map(([m]) => m).find((m) => worst(stream, stream.levels[0], m) !== undefined);
  if (!measure) return '';
  const cards = [0.05, 0.01, 0.001].map((error) => {
    const level = stream.levels.find((l) => worst(stream, l, measure) <= error);
    const size = element('span', {}, bytes(level.bytes));
    const link = element(
      'a',
      { className: 'accuracy', href: `${viewOf(stream)}#error=${error}` },
      element('b', {}, percent(error)),
      element('span', {}, `${count(level.tets)} tetrahedra`),
      size,
    );
    const say = () => { link.ariaLabel = `${percent(error)}: ${count(level.tets)} tetrahedra, ${size.textContent}`; };
    say();
    tellBytes(stream, level, size).then(say, () => {}); // else it is what all fields take
    return link;
  });
  const name = measure === 'max' ? 'Certified error at most' : 'Error at most';
  return element('div', { className: 'accuracies' }, element('span', { className: 'note' }, name), ...cards);
}

// Streams are described, and their pictures drawn, when they come into sight.
const sight = new IntersectionObserver(
  (entries) => {
    for (const { isIntersecting, target } of entries)
      if (isIntersecting) {
        sight.unobserve(target);
        describe(target, target.item);
      }
  },
  { rootMargin: '300px' },
);

const mark = ({ series }) =>
  series ? [' ', element('span', { className: 'mark', title: 'Steps in time' }, 'series')] : [];

function streamSection(item) {
  const view = viewOf(item);
  const section = element(
    'section',
    {},
    element(
      'div',
      { className: 'head' },
      element('h2', {}, element('a', { href: view }, item.id), ...mark(item)),
      element('a', { className: 'button main', href: view }, 'View'),
    ),
  );
  section.item = item;
  sight.observe(section);
  return section;
}

async function describe(section, item) {
  const view = viewOf(item);
  try {
    const url = new URL(inFolder ? `${item.links.self}/index.json` : item.links.self, meshesUrl);
    const stream = { ...(await getJson(url)), url: new URL(item.links.self, meshesUrl) };
    const picture = element('canvas', { className: 'thumbnail', role: 'img', ariaLabel: `The boundary of ${item.id}` });
    picture.stream = stream;
    section.append(
      element(
        'div',
        { className: 'body' },
        element('a', { href: view, tabIndex: -1 }, picture),
        element('div', {}, figures(stream), accuracies(stream)),
      ),
      inFolder ? '' : element('details', {}, element('summary', {}, 'Levels and files'), ...levelTable(stream)),
    );
    drawThumbnail(picture, stream).catch(() => {}); // a catalogue without a picture is still one
  } catch (error) {
    section.append(element('p', { className: 'failed' }, `This stream cannot be described: ${error.message}`));
  }
}

function streamRow(item) {
  const numbers = [count(item.tets), bytes(item.bytes), String(item.levels)].map((text) => element('td', {}, text));
  const row = element(
    'tr',
    {},
    element('td', {}, element('a', { href: viewOf(item) }, item.id), ...mark(item)),
    ...numbers,
    element('td', { className: 'names' }, item.fields.join(', ')),
  );
  row.item = item;
  return row;
}

// ---- which streams, in which order, as what

const manyStreams = 24; // of so many the page is a list at first
const orders = {
  name: ['by name', (a, b) => a.id.localeCompare(b.id, undefined, { numeric: true })],
  tets: ['by tetrahedra', (a, b) => b.tets - a.tets],
  bytes: ['by bytes', (a, b) => b.bytes - a.bytes],
  series: ['series first', (a, b) => Number(b.series ?? false) - Number(a.series ?? false)],
};

// The address has the choice, so that whoever comes back finds it again.
const choiceOf = () => Object.fromEntries(new URLSearchParams(location.hash.slice(1)));

class Catalogue {
  #all = [];
  #total = 0;
  #main;
  #controls;

  constructor(main) {
    this.#main = main;
    const { q = '', order = 'name', as = '' } = choiceOf();
    const names = Object.entries(orders).map(([value, [text]]) =>
      element('option', { value, selected: value === order }, text),
    );
    const kinds = ['', 'list', 'cards'].map((value) =>
      element('option', { value, selected: value === as }, value || 'as suits'),
    );
    this.#controls = {
      q: element('input', {
        type: 'search',
        id: 'find',
        placeholder: 'Find: name or field',
        ariaLabel: 'Find streams by name or field',
        value: q,
      }),
      order: element('select', { id: 'order', ariaLabel: 'Order' }, ...names),
      as: element('select', { id: 'as', ariaLabel: 'List or cards' }, ...kinds),
      told: element('output', { id: 'found', role: 'status' }),
    };
    this.bar = element('div', { className: 'find' }, ...Object.values(this.#controls));
    for (const name of ['q', 'order', 'as']) this.#controls[name].addEventListener('input', () => this.#choose());
  }

  add({ meshes, count: total }) {
    this.#all.push(...meshes);
    this.#total = total ?? this.#all.length;
    this.#show();
  }

  #choose() {
    const chosen = ['q', 'order', 'as'].map((name) => [name, this.#controls[name].value]).filter(([, value]) => value);
    const text = new URLSearchParams(chosen.filter(([name, value]) => name !== 'order' || value !== 'name')).toString();
    history.replaceState(null, '', `${location.pathname}${location.search}${text && `#${text}`}`);
    this.#show();
  }

  // Every word is somewhere in the name or in those of the fields.
  get #found() {
    const words = this.#controls.q.value.toLowerCase().split(/\s+/).filter(Boolean);
    const has = ({ id, fields }) =>
      words.every((word) => [id, ...fields].some((text) => text.toLowerCase().includes(word)));
    return this.#all.filter(has).sort(orders[this.#controls.order.value][1]);
  }

  #show() {
    const found = this.#found;
    const as = this.#controls.as.value || (this.#total > manyStreams ? 'list' : 'cards');
    this.bar.hidden = this.#total < 2;
    this.#controls.told.textContent =
      found.length === this.#total
        ? `${count(this.#total)} streams`
        : `${count(found.length)} of ${count(this.#total)} streams`;
    if (as === 'cards') this.#main.replaceChildren(this.bar, ...found.map(streamSection));
    else this.#main.replaceChildren(this.bar, tableOf(found));
  }
}

function tableOf(found) {
  const head = ['stream', 'tetrahedra', 'bytes', 'levels', 'fields'].map((text) =>
    element('th', { scope: 'col' }, text),
  );
  return element(
    'div',
    { className: 'scroll' },
    element(
      'table',
      { className: 'list' },
      element('thead', {}, element('tr', {}, ...head)),
      element('tbody', {}, ...found.map(streamRow)),
    ),
  );
}

// The viewer in place of the catalogue: a page that is gone to cannot be given a file. Its own steps back stay in it.
let shown = location.pathname;
addEventListener('popstate', () => location.pathname !== shown && location.reload());
takeDropped(async (file) => {
  globalThis.tetlodFile = file;
  const page = new DOMParser().parseFromString(await (await fetch('view.html')).text(), 'text/html');
  history.pushState(null, '', 'view.html');
  shown = location.pathname;
  document.head.replaceChildren(...page.head.querySelectorAll('title, meta, link[rel=stylesheet], link[rel=icon]'));
  document.body.replaceWith(document.adoptNode(page.body));
  await import('./view.js');
});

const meshesUrl = new URL('v1/meshes', location); // what the links are relative to
const main = document.getElementById('streams');
try {
  const catalogue = new Catalogue(main);
  let none = true;
  for await (const page of pages()) {
    catalogue.add(page);
    none &&= !page.meshes.length;
  }
  if (none)
    main.replaceChildren(
      element('p', { className: 'note' }, 'No streams are served yet: put *.tetlod files into the folder.'),
    );
} catch (error) {
  main.replaceChildren(element('p', { className: 'failed' }, `The catalogue cannot be read: ${error.message}`));
}
