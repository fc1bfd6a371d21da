// SPDX-License-Identifier: BSD-3-Clause
// The catalogue as a page: key figures of each stream, and its levels as links to mesh files.

const measures = [
  ['max', 'error (max)'],
  ['sampled', 'error (sampled)'],
  ['rms', 'error (rms)'],
];
const shownLevels = 12;

function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

const count = (n) => n.toLocaleString('en-US').replaceAll(',', '\u202f');
const percent = (x) => (x === 0 ? '0' : (100 * x).toPrecision(3).replace(/\.?0+$/, '') + ' %');

function bytes(n) {
  const units = ['B', 'KiB', 'MiB', 'GiB', 'TiB'];
  let unit = 0;
  for (; n >= 1024 && unit < units.length - 1; unit++) n /= 1024;
  return `${unit ? n.toPrecision(3) : n} ${units[unit]}`;
}

async function getJson(path) {
  const answer = await fetch(path);
  const body = await answer.json();
  if (!answer.ok) throw new Error(body.detail ?? answer.statusText);
  return body;
}

function figures(stream) {
  const pairs = [
    ['tetrahedra', count(stream.tets)],
    ['vertices', count(stream.vertices)],
    ['stream', bytes(stream.bytes)],
    ['levels', stream.levels.length],
    ['coarsest', `${count(stream.levels[0].tets)} tetrahedra`],
    ['fields', stream.fields.map((f) => f.name).join(', ')],
    ['restores the input', stream.lossless ? 'exactly' : 'within its error'],
  ];
  return element('dl', {}, ...pairs.map(([name, value]) => element('div', {}, element('dt', {}, name), element('dd', {}, String(value)))));
}

// The largest error of a level over the controlled fields, or undefined where the stream does not know it.
function worst(stream, level, measure) {
  const errors = stream.fields.filter((f) => f.controlled).map((f) => level.errors[f.name]?.[measure]);
  return errors.length && errors.every((e) => e !== undefined) ? Math.max(...errors) : undefined;
}

function levelRow(stream, level, columns) {
  const path = (format) => stream.links.level.replace('{level}', level.level).replace('{format}', format);
  const bar = element('i');
  bar.style.width = `${(100 * level.tets) / stream.tets}%`;
  return element(
    'tr', {},
    element('td', {}, String(level.level)),
    element('td', { className: 'tets' }, bar, element('b', {}, count(level.tets))),
    element('td', {}, bytes(level.bytes)),
    ...columns.map(([measure]) => element('td', {}, percent(worst(stream, level, measure)))),
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

async function streamSection(item) {
  const section = element('section', {}, element('h2', {}, element('a', { href: item.links.self }, item.id)));
  try {
    const stream = await getJson(item.links.self);
    section.append(figures(stream), ...levelTable(stream));
  } catch (error) {
    section.append(element('p', { className: 'failed' }, `This stream cannot be described: ${error.message}`));
  }
  return section;
}

const main = document.getElementById('streams');
try {
  const { meshes } = await getJson('/v1/meshes');
  const sections = await Promise.all(meshes.map(streamSection));
  main.replaceChildren(...sections);
  if (!meshes.length) main.replaceChildren(element('p', { className: 'note' }, 'No streams are served yet: put *.tetlod files into the folder.'));
} catch (error) {
  main.replaceChildren(element('p', { className: 'failed' }, `The catalogue cannot be read: ${error.message}`));
}
