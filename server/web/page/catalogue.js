// SPDX-License-Identifier: BSD-3-Clause
// The catalogue as a page: key figures of each stream, and its levels as links to mesh files.

import { takeDropped } from './choose_file.js';
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

// A server answers at v1/meshes; in a folder on a host of files (tetlod explode --viewer) the same is in index.json.
let inFolder = false;

async function getCatalogue() {
  try {
    return await getJson('v1/meshes');
  } catch (error) {
    const catalogue = await getJson('v1/meshes/index.json').catch(() => { throw error; });
    inFolder = true;
    return catalogue;
  }
}

// The stream's address in a query, where percent signs stand for themselves only if they are encoded once more.
const viewOf = ({ id, cid }) => (inFolder ? `view.html?stream=${`v1/meshes/${encodeURIComponent(id)}/${cid}/stream`.replaceAll('%', '%25')}` : `view/${encodeURIComponent(id)}`);

function figures(stream) {
  const pairs = [
    ['tetrahedra', count(stream.tets)],
    ['vertices', count(stream.vertices)],
    ['stream', bytes(stream.bytes)],
    ['levels', stream.levels.length],
    ['first picture', bytes(stream.levels[0].bytes)],
    ['fields', stream.fields.map((f) => f.name).join(', ')],
    ['restores the input', stream.lossless ? 'exactly' : 'within its error'],
  ];
  return element('dl', {}, ...pairs.map(([name, value]) => element('div', { className: name === 'fields' ? 'wide' : '' }, element('dt', {}, name), element('dd', {}, String(value)))));
}

// The largest error of a level over the controlled fields, or undefined where the stream does not know it.
function worst(stream, level, measure) {
  const errors = stream.fields.filter((f) => f.controlled).map((f) => level.errors[f.name]?.[measure]);
  return errors.length && errors.every((e) => e !== undefined) ? Math.max(...errors) : undefined;
}

function levelRow(stream, level, columns) {
  const path = (format) => new URL(stream.links.level.replace(/\{\?.*?\}/, '').replace('{level}', level.level).replace('{format}', format), stream.url).href;
  return element(
    'tr', {},
    element('td', {}, String(level.level)),
    element('td', {}, count(level.tets)),
    element('td', {}, bytes(level.bytes)),
    ...columns.map(([measure]) => element('td', {}, percent(worst(stream, level, measure), 3))),
    element('td', {}, element('a', { href: path('vtu'), download: `${stream.id}-${level.level}.vtu` }, 'VTU'), ' · ',
      element('a', { href: path('vtk'), download: `${stream.id}-${level.level}.vtk` }, 'VTK'), ' · ',
      element('a', { href: path('tetlod'), download: `${stream.id}-${level.level}.tetlod` }, 'stream')),
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
  const table = element('table', {}, element('thead', {}, element('tr', {}, ...head.map((h) => element('th', {}, h)))), body);
  const parts = [element('div', { className: 'scroll' }, table)];
  if (stream.levels.length > shownLevels) {
    const more = element('button', { type: 'button' }, `Show all ${stream.levels.length} levels`);
    more.addEventListener('click', () => { show(stream.levels); more.remove(); });
    parts.push(more);
  }
  return parts;
}

// What some accuracies cost, as links to the viewer.
function accuracies(stream) {
  const measure = measures.map(([m]) => m).find((m) => worst(stream, stream.levels[0], m) !== undefined);
  if (!measure) return '';
  const cards = [0.05, 0.01, 0.001].map((error) => {
    const level = stream.levels.find((l) => worst(stream, l, measure) <= error);
    return element('a', { className: 'accuracy', href: `${viewOf(stream)}#error=${error}` },
      element('b', {}, percent(error)), element('span', {}, `${count(level.tets)} tetrahedra`), element('span', {}, bytes(level.bytes)));
  });
  const name = measure === 'max' ? 'Certified error at most' : 'Error at most';
  return element('div', { className: 'accuracies' }, element('span', { className: 'note' }, name), ...cards);
}

// Thumbnails are asked for when they come into sight.
const sight = new IntersectionObserver((entries) => {
  for (const { isIntersecting, target } of entries)
    if (isIntersecting) {
      sight.unobserve(target);
      drawThumbnail(target, target.stream).catch(() => {}); // a catalogue without a picture is still one
    }
});

async function streamSection(item) {
  const view = viewOf(item);
  const section = element('section', {}, element('div', { className: 'head' },
    element('h2', {}, element('a', { href: view }, item.id)), element('a', { className: 'button main', href: view }, 'View')));
  try {
    const url = new URL(inFolder ? `${item.links.self}/index.json` : item.links.self, meshesUrl);
    const stream = { ...await getJson(url), url: new URL(item.links.self, meshesUrl) };
    const picture = element('canvas', { className: 'thumbnail', role: 'img', ariaLabel: `The boundary of ${item.id}` });
    picture.stream = stream;
    section.append(element('div', { className: 'body' }, element('a', { href: view, tabIndex: -1 }, picture),
      element('div', {}, figures(stream), accuracies(stream))), inFolder ? '' : element('details', {}, element('summary', {}, 'Levels and files'), ...levelTable(stream)));
    sight.observe(picture);
  } catch (error) {
    section.append(element('p', { className: 'failed' }, `This stream cannot be described: ${error.message}`));
  }
  return section;
}

// The viewer in place of the catalogue: a page that is gone to cannot be given a file.
takeDropped(async (file) => {
  globalThis.tetlodFile = file;
  const page = new DOMParser().parseFromString(await (await fetch('view.html')).text(), 'text/html');
  history.pushState(null, '', 'view.html');
  addEventListener('popstate', () => location.reload());
  document.head.replaceChildren(...page.head.querySelectorAll('title, meta, link[rel=stylesheet], link[rel=icon]'));
  document.body.replaceWith(document.adoptNode(page.body));
  await import('./view.js');
});

const meshesUrl = new URL('v1/meshes', location); // what the links are relative to
const main = document.getElementById('streams');
try {
  const { meshes } = await getCatalogue();
  const sections = await Promise.all(meshes.map(streamSection));
  main.replaceChildren(...sections);
  if (!meshes.length) main.replaceChildren(element('p', { className: 'note' }, 'No streams are served yet: put *.tetlod files into the folder.'));
} catch (error) {
  main.replaceChildren(element('p', { className: 'failed' }, `The catalogue cannot be read: ${error.message}`));
}
