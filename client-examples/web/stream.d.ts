// SPDX-License-Identifier: BSD-3-Clause
export type Point = [number, number, number];
export type Measure = 'max' | 'sampled' | 'rms' | 'predicted';
export type Component = number | 'magnitude';

export interface Field {
  name: string;
  components: number;
  type: 'float32' | 'float64';
  range: [number, number];
  /** Its error drove the contraction: `max` is certified. */
  controlled: boolean;
  /** The field whose error this one bounds at every point of every level (`tetlod build --local-bound`). */
  bounds?: string;
}

/** Values of cells: each tetrahedron of a level is one of the original's, and has its values. */
export interface CellField {
  name: string;
  components: number;
  type: 'float32' | 'float64' | 'int8' | 'int16' | 'int32' | 'int64';
  /** Of the finite ones. */
  range: [number, number];
  /** Its numbers are those of regions: faces between different ones are the original's at every level. */
  region: boolean;
  /** Of its bytes in the stream: offset and size. */
  place: [number, number];
  /** Of the bytes that say which cell of the input each tetrahedron is of, if values are stored once a cell. */
  map?: [number, number];
}

export interface Level {
  level: number;
  vertices: number;
  tets: number;
  offset: number;
  /** Length of the prefix of the stream that decodes to this level. */
  bytes: number;
  /** As a fraction of the diagonal of the bounds. */
  domainError: number;
  /** By field, as fractions of its range; a measure that is not known is absent. */
  errors: Record<string, Partial<Record<Measure, number>>>;
}

export interface Info {
  cid: string;
  vertices: number;
  tets: number;
  bytes: number;
  degenerateTets: number;
  invertedTets: number;
  bounds: [Point, Point];
  lossless: boolean;
  /** The first level in pages, of which some can be shown without the others (`look`); 0: none is. */
  paged: number;
  fields: Field[];
  cellFields: CellField[];
  /** Of a series whose mesh changes; else none. Where the stream of each lies, and the times of its steps. */
  topologies: { cid: string; offset: number; size: number; times: number[] }[];
  levels: Level[];
  /** Of a series in time: offset and size of its table of steps. */
  time: [number, number] | null;
  metadata: Record<string, unknown>;
}

export interface Target {
  /** A fraction of the field's range. */
  error?: number;
  absError?: number;
  /** Of that error; every field that drove the contraction if absent. */
  field?: string;
  measure?: Measure;
  level?: number;
  /** Budgets. */
  tets?: number;
  bytes?: number;
}

/** A series in time. */
export interface Series {
  /** Steps that are stored together. */
  group: number;
  times: number[];
  /** Coarse to fine: the error is a fraction of a field's range over all steps, 0: exact. */
  bands: { error: number; level: number }[];
  /** The fields that have steps. */
  fields: { name: string; range: [number, number] }[];
  /** Fields of cells that have steps. */
  cellFields: { name: string; range: [number, number] }[];
  /** The field that moves the points; null: they keep their places. */
  displacement: string | null;
}

export interface Step {
  step: number;
  band: number;
  /** What the band promises. */
  error: number;
  /** What holds of each field at this step, as fractions of its range. */
  errors: Record<string, number>;
  level: number;
  time: number;
  /** Of the band, those that are here. */
  groups: number[];
  /** The steps of these groups: from, and to before which. */
  steps: [number, number][];
  seconds: number;
}

export interface Mesh {
  level: number;
  positions: Float64Array;
  tets: Uint32Array;
  fields: Record<string, Float64Array>;
  /** Null where the mesh is finer in boxes. */
  parents: Uint32Array | null;
}

/** Of what is drawn: tetrahedra that are cut are divided. */
export interface DrawnMesh {
  level: number;
  positions: Float64Array;
  tets: Uint32Array;
  /** The original's tetrahedra that each is, or is a part of. */
  numbers: Uint32Array;
  fields: Record<string, Float64Array>;
  /** Their values, of fields of cells that are loaded. */
  cells: Record<string, Float64Array>;
}

export interface Spec {
  /** Colours every part. */
  field?: string;
  component?: Component;
  /** Values of cells that colour instead: every triangle has one, that of its tetrahedron. `component` is then of
   * these. */
  cellField?: string;
  /** Draw no tetrahedra with these values of cells, which are whole numbers. */
  regions?: { field: string; hidden: number[] } | null;
  surface?: boolean;
  slices?: { origin: Point; normal: Point }[];
  /** A function of components colours instead of `field`: steps over a stack, as formula.js makes them. */
  formula?: {
    inputs: [field: string, component: number][];
    program: [operation: number, number: number][];
    text: string;
  } | null;
  /** Points are moved by a field of three components; `outline`: the boundary without that comes, too. */
  warp?: { field: string; scale: number; outline?: boolean } | null;
  /** `zone`: the two isosurfaces between which the original's lies, too. */
  isosurfaces?: { field?: string; component?: Component; formula?: true; value: number; zone?: boolean }[];
  /** Draw only tetrahedra whose corners have values from `low` to `high`. */
  threshold?: { field?: string; cellField?: string; component?: Component; low?: number; high?: number } | null;
  /** Lines of the cells in surface and slices. */
  edges?: boolean;
  /** Everything is of what is behind the plane; the surface is closed there. */
  clip?: { origin: Point; normal: Point } | null;
  /** What it takes to follow rays through the tetrahedra. */
  rays?: boolean;
  /** A grid with so many points along its longest side, of the values or of their decimal logarithms. */
  volume?: { size: number; logarithmic?: boolean } | null;
  /**
   * Arrows, or lines along the flow, through `count` places (300) that are spread over the volume, or through `places`;
   * `size`: times as long, or as thick, as usual.
   */
  vectors?: {
    field: string;
    kind?: 'arrows' | 'streamlines';
    count?: number;
    size?: number;
    places?: Point[] | null;
  } | null;
  /** Draw only what lies in it (low corner, high corner); the cuts are capped. */
  box?: [number, number, number, number, number, number] | null;
  /** In these boxes the mesh is that of the level that `target` chooses, if it is finer. */
  refine?: { boxes: [number, number, number, number, number, number][]; target?: Target } | null;
  /** Whether a change of the level is a move (the default) or a jump. */
  morph?: boolean;
  /** Comes back with its pictures. */
  tag?: unknown;
}

export interface Part {
  /** Relative to the pictures' origin. */
  points: Float32Array;
  /** Linear on each triangle, unless there are `vectors`. */
  values: Float32Array;
  /** Of the vectors whose length colours, all components of each point: these are linear on a triangle, `values`, their
   * lengths, are not. */
  vectors: Float32Array | null;
  /** Absent where it is the same as in the last message. */
  triangles?: Uint32Array;
  lines?: Uint32Array | null;
  normals: Float32Array | null;
}

/** The original's isosurface lies between the two at value - bound and value + bound. */
export interface Zone {
  bound: number;
  /** The bound is proved; else it is the largest error that was measured. */
  certified: boolean;
  sides: [Part, Part];
}

export interface Grid {
  dims: Point;
  origin: Point;
  spacing: Point;
  /** x fastest, two for each point: the value, and how much of it is seen, 0 outside and before the clip plane, else 1.
   * */
  voxels: Float32Array;
  /** Of the values inside. */
  range: [number, number];
  logarithmic: boolean;
}

/** For rays that go from tetrahedron to tetrahedron. What a move does not change is absent where it is the same as in
 * the last message. */
export interface Rays {
  /** Four numbers for each: the place, relative to the pictures' origin, and the value. */
  vertices: Float32Array;
  /** A tree of boxes over the boundary's faces, eight numbers for each: low corner, number of the node to go on with
   * behind this
   *  one's; high corner, number of the leaf or -1. A node's first child is the next one; leaf i has faces 4 i to 4 i +
   *  3. */
  nodes: Float32Array;
  /** Of vectors with at most four components whose length colours: four numbers for each vertex. Rays take the length
   * of what is interpolated. */
  vectors: Float32Array | null;
  /** Values of the tetrahedra, if those colour, filled up to a multiple of four. */
  cells: Float32Array | null;
  /** Four for each tetrahedron: its vertices; 4 times the neighbour opposite each, plus which of its faces that is, or
   * 2^32 - 1. */
  corners?: Uint32Array;
  neighbours?: Uint32Array;
  /** Of the boundary, four for each: vertices, counter-clockwise seen from outside; 4 times the tetrahedron plus which
   * of its faces. */
  faces?: Uint32Array;
}

/** What colours. */
export interface Shade {
  field: string;
  /** The field is one of cells. */
  cells: boolean;
  component: Component;
  /** A formula colours: `field` is its text. */
  formula: boolean;
  /** Over all of the mesh. */
  range: [number, number];
  /** Sorted values, as many of each as it has of the volume. Absent while the mesh moves, and where it is the same as
   * in the last message. */
  sample?: Float32Array;
}

export interface Pictures {
  /** Of the spec that they are of. */
  tag: unknown;
  level: number;
  /** In time; null: the level's own values. */
  step: number | null;
  /** 0: the shape of the coarser level, 1: at rest. */
  t: number;
  origin: Point;
  shade: Shade | null;
  surface: Part | null;
  slices: Part[];
  isosurfaces: Part[];
  /** One for each isosurface: null where none was asked for. */
  zones: (Zone | null)[];
  /** Where the mesh is finer in boxes: numbers of tetrahedra there, elsewhere and between, and edges of those between.
   * */
  finer: ((Boxes | Pages) & { edges: Pick<Part, 'points' | 'lines'>[] }) | null;
  rays: Rays | null;
  /** Absent while the mesh moves, and where it is the same as in the last message. */
  volume?: Grid | null;
  /** Absent while the mesh moves, and where it is the same as in the last message. */
  vectors?: Part | null;
  /** The boundary without being moved; absent as `vectors` is. */
  outline?: Part | null;
  seconds: number;
}

/** What is shown of a mesh that is finer in boxes: how many tetrahedra are of each level, and between them. */
export interface Boxes {
  tets: number;
  boxLevel: number;
  inside: number;
  outside: number;
  between: number;
  seconds: number;
}

/** A view of a stream in pages, in the stream's coordinates. */
export interface Look {
  /** Four numbers each, x, y, z, d: what is seen has x · X + y · Y + z · Z + d ≥ 0. */
  planes: [number, number, number, number][];
  eye: Point;
  /** Nothing is seen from nearer. */
  near: number;
  /** Pixels of a length of 1 at a distance of 1; where `parallel`, at any. */
  scale: number;
  parallel: boolean;
  /** That a place may be off on the screen: an error of the whole range counts as the diagonal of the bounds. */
  pixels: number;
  /** Budgets of the mesh, and of the pages' bytes that are held. */
  tets: number;
  bytes: number;
  field: string;
  measure: Measure;
  /** Comes back with what is shown. */
  id: number | null;
  /** Which walls of the boundary the picture shows; 'near' ones hide what is behind. Without it: all. */
  walls?: 'near' | 'far' | 'all';
  /** Pages that are new come only where the error is four times as large; those that are there stay. */
  moving?: boolean;
}

/** What is shown of a view. */
export interface Pages {
  pages: number;
  tets: number;
  /** Of these pages, and of all that are held. */
  bytes: number;
  held: number;
  /** Pages that are left out for the budgets. */
  refused: number;
  /** The worst place that is seen: how far it is off, and its level, whose errors hold for all that is seen. */
  pixels: number;
  worst: number;
  /** The finest level that has a page. */
  finest: number;
  /** The level in boxes, where there are any (`refine`) and the budgets allow it. */
  boxLevel?: number;
  /** Of the look; null: on the way to it, or there are only boxes. */
  look: number | null;
  seconds: number;
}

export interface Events {
  /** The worker runs. */
  started: null;
  progress: { received: number; total: number };
  /** Bytes came: all so far. */
  fetched: { fetched: number };
  level: { level: number; vertices: number; tets: number; seconds: number };
  pictures: Pictures;
  retry: { attempt: number; delay: number; message: string };
  series: Series;
  step: Step;
  /** Values of cells are there; of whole numbers, if they are not too many, with how many of the original's tetrahedra
   * have each. */
  cells: { field: string; bytes: number; regions: { number: number; tets: number }[] | null };
  /** Another topology group is shown: `info` is its own. */
  topology: { topology: number; info: Info };
  buffered: { band: number; groups: number[]; steps: [number, number][]; received: number };
  /** The mesh is finer in boxes now, or has other pages. */
  refined: { level: number } & (Boxes | Pages);
  finished: { level: number };
  /** What is decoded stays, unless the decoder itself has stopped: then the stream has ended. */
  error: { message: string };
}

/** fetch's options for a host that asks who is there. */
export interface Remote {
  url: string | URL;
  headers?: HeadersInit;
  credentials?: RequestCredentials;
}

/** Bytes `from` … `to` - 1 of the stream, fewer at its end, at least one before it. */
export interface Reader {
  read(from: number, to: number, signal: AbortSignal): Promise<Uint8Array>;
}

/** A server's mesh (…/v1/meshes/{id}), any file's URL, a file that somebody chose, or a function. */
export type Source = string | URL | Remote | Blob | Reader;

type Listeners = { [Name in keyof Events]?: (event: CustomEvent<Events[Name]>) => void };

export class TetlodStream extends EventTarget {
  static open(
    source: Source,
    options?: {
      /** Goes on to this at once, as refineTo does; its bytes come with the first ones. */
      target?: Target;
      /** Names of the fields to decode (all); a server leaves the others' data out. 'first': where it does, the first
       * that drove the contraction. */
      fields?: string[] | 'first';
      signal?: AbortSignal;
      retries?: number;
      on?: Listeners;
      wasm?: string | URL;
    },
  ): Promise<TetlodStream>;
  readonly info: Info;
  /** Names of those that are decoded. */
  readonly fields: string[];
  readonly level: number;
  readonly received: number;
  /** All bytes that came, by all workers: descriptions, and what is asked for once more, are counted, too. */
  readonly fetched: number;
  refineTo(target?: Target, options?: { signal?: AbortSignal }): Promise<{ level: number; reached: boolean }>;
  /** Of a series in time, from the event `series` on. */
  readonly series: Series | null;
  /** The topology group that is shown, of a series whose mesh changes: `info` and `series.bands` are its own, steps and
   * times those of all. */
  readonly topology: number;
  /** Bytes of steps, beside `received`. */
  readonly receivedSteps: number;
  /** Bytes of topology groups that were shown before, beside `received` and `receivedSteps`. */
  readonly receivedBefore: number;
  /** Of the whole stream, all topology groups among them. */
  readonly bytes: number;
  /** Shows a step in a band, or in the coarsest one within an error; values pass into it in `blend` milliseconds. */
  seekStep(
    step: number,
    choice?: { band?: number; error?: number; blend?: number },
    options?: { signal?: AbortSignal },
  ): Promise<{ level: number; reached: boolean }>;
  /** Decodes these fields, too, from now on. Pictures go on without them until they are there. */
  addFields(names: string[]): Promise<void>;
  mesh(): Promise<Mesh>;
  /** What is drawn: without hidden regions and what is beyond a threshold, cut by the clip plane and box. */
  drawn(): Promise<DrawnMesh>;
  /** Of what is drawn of the mesh; null elsewhere. */
  probe(point: Point): Promise<{
    tet: number;
    values: Record<string, number[]>;
    cells: Record<string, number[]>;
    part?: 'inside' | 'outside' | 'between';
    level?: number;
  } | null>;
  /** Fetches values of cells, which are there from the event `cells` on. show() does so for those that it needs. */
  loadCells(name: string): Promise<void>;
  /** Bytes of values of cells, beside `received`. */
  readonly receivedCells: number;
  /** Values of cells, of all the original's tetrahedra, component by component: a level's are the first. */
  cells(name: string): Promise<Float64Array>;
  /** The value that colours the pictures, along a segment: `ends` has [at, value] of begin and end of each piece, `at`
   * from 0 to 1; what is not drawn is a gap. `bounds`: how far off the value is at most at each of these ends, where
   * the field's local bound is loaded. */
  line(from: Point, to: Point): Promise<{ level: number; ends: Float64Array; bounds?: Float64Array }>;
  ask(
    question: string,
    options?: { within?: number },
  ): Promise<{
    lower: number;
    upper: number;
    bound: 'exact' | 'certified';
    level?: number;
    tets?: number;
    bytes: number;
  }>;
  features(
    quantity: string,
    options?: { persistence?: number },
  ): Promise<{
    level: number;
    error: number;
    bounded: { maximum: boolean; minimum: boolean };
    features: {
      kind: 'maximum' | 'minimum';
      proven: boolean;
      at: number[];
      box: [number[], number[]];
      range: number[];
      persistence: number;
    }[];
  }>;
  /** Pictures at rest of the finest level of at most so many tetrahedra, which is coarser than what is shown, or null.
   * */
  draft(
    tets: number,
  ): Promise<Pick<Pictures, 'level' | 'origin' | 'shade' | 'surface' | 'slices' | 'isosurfaces' | 'zones'> | null>;
  /** Pages are those that a view needs, from now on, where the level that is shown has none; null: no more than its
   * own. */
  look(look: Look | null): void;
  /** Gives back the memory that finer levels took. */
  compact(): Promise<void>;
  /** `whole`: the first pictures leave nothing out that is the same as in the last message. */
  show(spec: Spec | null, options?: { whole?: boolean }): Promise<void>;
  /** One after the other, each complete; whenever the next one is asked for, the newest. Ends with the stream; where
   * the loop is left,
   *  what was shown before is shown again. */
  frames(spec: Spec): AsyncGenerator<Pictures, void, void>;
  close(reason?: unknown): void;
  addEventListener<Name extends keyof Events>(
    name: Name,
    listener: (event: CustomEvent<Events[Name]>) => void,
    options?: boolean | AddEventListenerOptions,
  ): void;
  addEventListener(
    name: string,
    listener: EventListenerOrEventListenerObject | null,
    options?: boolean | AddEventListenerOptions,
  ): void;
}
