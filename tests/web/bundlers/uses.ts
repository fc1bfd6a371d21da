// SPDX-License-Identifier: BSD-3-Clause
// Every public member of TetlodStream, with all that its arguments may have: run-types.mjs holds this against the
// types, runs it, and holds what comes against them, too. What needs a page is held against the types only.
import {
  TetlodStream,
  type DrawnMesh,
  type Events,
  type Info,
  type Look,
  type Mesh,
  type Pictures,
  type Reader,
  type Remote,
  type Series,
  type Spec,
  type Step,
  type Target,
} from 'tetlod';
import type { toPolyData } from 'tetlod/adapters.js';
import type { TetlodView } from 'tetlod/element.js';

type Told = <T>(type: string, value: T) => T;
type Streams = Record<'flow' | 'cells' | 'series' | 'paged', Uint8Array<ArrayBuffer>>;

const names = [
  'started',
  'progress',
  'fetched',
  'level',
  'pictures',
  'retry',
  'series',
  'step',
  'cells',
  'topology',
  'buffered',
  'refined',
  'finished',
  'error',
] as const satisfies (keyof Events)[];

const target: Required<Pick<Target, 'error' | 'tets' | 'bytes' | 'measure'>> & Target = {
  error: 0.05,
  tets: 1e6,
  bytes: 1e9,
  measure: 'max',
};

async function flow(bytes: Uint8Array<ArrayBuffer>, tell: Told) {
  const file = new Blob([bytes]);
  const reader: Reader = {
    read: async (from, to, signal) => {
      signal.throwIfAborted();
      return bytes.slice(from, to);
    },
  };
  const remote: Remote = { url: 'http://127.0.0.1:9/none.tetlod', headers: { Accept: '*/*' }, credentials: 'omit' };
  await TetlodStream.open(remote, { retries: 0, on: { retry: ({ detail }) => tell('Events.retry', detail) } }).then(
    () => Promise.reject(new Error('there is nothing')),
    (error: Error) => error.message,
  );
  const stream = await TetlodStream.open(reader, { target, fields: ['Density'], signal: new AbortController().signal });
  for (const name of names) stream.addEventListener(name, ({ detail }) => tell(`Events.${name}`, detail));
  const info: Info = tell('Info', stream.info);
  tell('TetlodStream.fields', stream.fields);
  tell('TetlodStream.refineTo()', await stream.refineTo(target, { signal: new AbortController().signal }));
  await stream.refineTo({ absError: 0.01, field: 'Density', level: 3 });
  await stream.addFields(['Velocity']);
  const [low, high] = info.bounds;
  const middle = low.map((l, i) => (l + (high[i] ?? 0)) / 2) as Info['bounds'][0];
  const whole: Required<Omit<Spec, 'cellField' | 'regions' | 'refine' | 'formula'>> = {
    field: 'Velocity',
    component: 'magnitude',
    surface: true,
    edges: true,
    slices: [{ origin: middle, normal: [0, 1, 0] }],
    isosurfaces: [{ field: 'Density', component: 0, value: 1, zone: true }],
    threshold: { field: 'Density', component: 0, low: 0, high: 100 },
    clip: { origin: middle, normal: [1, 0, 0] },
    box: [...low, ...high],
    rays: true,
    volume: { size: 8, logarithmic: false },
    vectors: { field: 'Velocity', kind: 'arrows', count: 10, size: 1, places: [middle] },
    warp: { field: 'Velocity', scale: 0.01, outline: true },
    morph: false,
    tag: 'whole',
  };
  for await (const pictures of stream.frames(whole)) {
    const shown: Pictures = tell('Pictures', pictures);
    if (shown.tag === 'whole') break;
  }
  const box = [...low, ...middle] as [number, number, number, number, number, number];
  const refine = { boxes: [box], target: { error: 0 } };
  const finer = new Promise((resolve) => stream.addEventListener('refined', resolve, { once: true }));
  await stream.show({ field: 'Density', surface: true, refine }, { whole: true });
  await finer;
  await stream.show({
    formula: { inputs: [['Density', 0]], program: [[1, 0]], text: 'Density' },
    isosurfaces: [{ formula: true, value: 1 }],
  });
  const mesh: Mesh = tell('Mesh', await stream.mesh());
  const drawn: DrawnMesh = tell('DrawnMesh', await stream.drawn());
  if (!mesh.tets.length || !drawn.numbers.length) throw new Error('nothing is there');
  tell('TetlodStream.probe()', await stream.probe(middle));
  await stream.show({ field: 'Density', surface: true });
  tell('TetlodStream.line()', await stream.line(low, high));
  tell('TetlodStream.draft()', await stream.draft(500));
  tell('TetlodStream.ask()', await stream.ask('max(Density)', { within: 0.1 }));
  tell('TetlodStream.features()', await stream.features('Density', { persistence: 0.1 }));
  await stream.refineTo();
  await stream.compact();
  for (const key of ['level', 'received', 'fetched', 'bytes', 'receivedSteps', 'receivedBefore', 'topology'] as const)
    tell(`TetlodStream.${key}`, stream[key]);
  await stream.show(null);
  stream.close('that is all');
  const again = await TetlodStream.open(file, { fields: 'first', retries: 1, on: {} });
  again.close();
}

async function cells(bytes: Uint8Array<ArrayBuffer>, tell: Told) {
  const stream = await TetlodStream.open(new Blob([bytes]));
  stream.addEventListener('cells', ({ detail }) => tell('Events.cells', detail));
  const info: Info = tell('Info', stream.info);
  const cellField = info.cellFields.find(
    ({ type, components }) => type.startsWith('int') && components === 1)?.name ?? '';
  await stream.loadCells(cellField);
  tell('TetlodStream.cells()', await stream.cells(cellField));
  tell('TetlodStream.receivedCells', stream.receivedCells);
  const spec: Spec = { cellField, surface: true, regions: { field: cellField, hidden: [] }, rays: true };
  for await (const pictures of stream.frames(spec)) {
    tell('Pictures', pictures);
    break;
  }
  tell('DrawnMesh', await stream.drawn());
  stream.close();
}

async function series(bytes: Uint8Array<ArrayBuffer>, tell: Told) {
  const stream = await TetlodStream.open(new Blob([bytes]));
  for (const name of names) stream.addEventListener(name, ({ detail }) => tell(`Events.${name}`, detail));
  const steps: Series | null = await new Promise((resolve) =>
    stream.addEventListener('series', ({ detail }) => resolve(detail), { once: true }),
  );
  tell('TetlodStream.series', stream.series);
  const shown: Promise<Step> = new Promise((resolve) =>
    stream.addEventListener('step', ({ detail }) => resolve(detail), { once: true }),
  );
  const [choice, options] = [{ band: 0, error: 0, blend: 0 }, { signal: new AbortController().signal }];
  tell('TetlodStream.seekStep()', await stream.seekStep((steps?.times.length ?? 1) - 1, choice, options));
  tell('Step', await shown);
  stream.close();
}

async function paged(bytes: Uint8Array<ArrayBuffer>, tell: Told) {
  const stream = await TetlodStream.open(new Blob([bytes]), { target: { error: 1 } });
  await stream.refineTo({ level: stream.info.paged - 1 });
  const [low, high] = stream.info.bounds;
  const look: Look = {
    planes: [[1, 0, 0, -low[0]]],
    eye: high,
    near: 0.1,
    scale: 1000,
    parallel: false,
    pixels: 1,
    tets: 1e6,
    bytes: 1e8,
    field: stream.fields[0] ?? '',
    measure: 'max',
    walls: 'near',
    moving: false,
    id: 1,
  };
  await stream.show({ field: look.field, surface: true });
  const there = new Promise((resolve) =>
    stream.addEventListener('refined', ({ detail }) => resolve(tell('Events.refined', detail))),
  );
  stream.look(look);
  await there;
  tell('TetlodStream.probe()', await stream.probe(high));
  for await (const pictures of stream.frames({ field: look.field, surface: true })) {
    tell('Pictures', pictures);
    if (pictures.finer) break;
  }
  stream.look(null);
  stream.close();
}

export async function inPage(file: File, adapt: typeof toPolyData) {
  const view: TetlodView = document.createElement('tetlod-view');
  view.source = file;
  view.controls = ['bar', 'player'];
  const shown: string = view.controls.join() + view.state;
  view.step = (view.step ?? 0) + 1;
  if (!view.playing) await view.play();
  view.pause();
  view.addEventListener('level',
    ({ detail }) => (detail.error + detail.tets + (detail.pages ?? 0)).toFixed(shown.length));
  view.addEventListener('step', ({ detail }) => detail.time + detail.step);
  view.addEventListener('error', ({ detail }) => detail.message.trim());
  view.addEventListener('ready', () => view.stream?.info.cid.slice(0, 4));
  const plain: EventTarget = view.stream ?? view;
  plain.dispatchEvent(new Event('x'));
  const stream = await TetlodStream.open(file, { wasm: new URL('https://example.org/tetlod.wasm') });
  for await (const { surface, shade } of stream.frames({ surface: true }))
    if (surface && shade?.sample) adapt(surface, {}, { newInstance: (values: object) => values }, shade.field);
}

export async function use(streams: Streams, tell: Told) {
  await flow(streams.flow, tell);
  await cells(streams.cells, tell);
  await series(streams.series, tell);
  await paged(streams.paged, tell);
}
