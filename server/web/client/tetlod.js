// SPDX-License-Identifier: BSD-3-Clause
// The C codec and its geometry as WebAssembly: one View per stream. See ../wasm/view.h.

export const NONE = 0xffffffff;
const MORE = 1; // TETLOD_MORE

/** An error of the library: invalid bytes, an invalid argument, or too little memory. `status` is an enum tetlod_status. */
export class TetlodError extends Error {
  constructor(status, message) {
    super(message || `the stream cannot be decoded (status ${status})`);
    this.name = 'TetlodError';
    this.status = status;
  }
}

// libc refers to three calls for files that nothing here makes; 52 is "not there" in WASI.
const noFiles = Object.fromEntries(['fd_close', 'fd_seek', 'fd_write'].map((name) => [name, () => 52]));

/** Compiles the module: from a Response, or from bytes. */
export async function compile(source) {
  if (!(source instanceof Response)) return WebAssembly.compile(source);
  if (!source.ok) throw new Error(`${source.url}: ${source.status} ${source.statusText}`);
  const typed = source.headers.get('Content-Type')?.startsWith('application/wasm');
  return typed ? WebAssembly.compileStreaming(source) : WebAssembly.compile(await source.arrayBuffer());
}

/** What JSON text holds, if that is an object: metadata are text from elsewhere. */
function objectOf(text) {
  try {
    const value = JSON.parse(text);
    return value && typeof value === 'object' && !Array.isArray(value) ? value : {};
  } catch {
    return {};
  }
}

// What describe.c wrote: numbers that are not whole are their bits.
const parse = (text) => JSON.parse(text, (_, value) =>
  /^\x01[0-9a-f]{16}$/.test(value)
    ? new Float64Array(BigUint64Array.of(BigInt(`0x${value.slice(1)}`)).buffer)[0] : value);

// The exports; none of them throws but by a trap, which ends what they are part of.
function guarded(exports, broken) {
  const guard = (call) => (...words) => {
    try {
      return call(...words);
    } catch (error) {
      broken(error);
      throw error;
    }
  };
  return Object.fromEntries(
    Object.entries(exports).map(([name, value]) => [name, typeof value === 'function' ? guard(value) : value]));
}

/** The exports of a module of ours. */
export async function instantiate(module) {
  const { exports } = await WebAssembly.instantiate(module, { wasi_snapshot_preview1: noFiles });
  exports._initialize();
  return exports;
}

export class View {
  #code; #view; #warp = 'null';

  /** `broken(error)` hears that a call trapped: what the module's memory holds is worth nothing then. */
  static async create(module, broken = () => {}) {
    return new View(guarded(await instantiate(module), broken));
  }

  constructor(code) {
    this.#code = code;
    this.#view = code.view_new();
    if (!this.#view) throw new TetlodError(10, 'out of memory');
  }

  // Views of the module's memory do not outlive its growth: they are made anew each time.
  #words(address, count) { return new Uint32Array(this.#code.memory.buffer, address >>> 0, count); }
  #floats(address, count) { return new Float32Array(this.#code.memory.buffer, address >>> 0, count); }
  #doubles(address, count) { return new Float64Array(this.#code.memory.buffer, address >>> 0, count); }

  #text(address) {
    const bytes = new Uint8Array(this.#code.memory.buffer, address >>> 0);
    return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
  }

  #check(status) {
    if (status) throw new TetlodError(status, this.#text(this.#code.view_message(this.#view)));
  }

  // Calls `use` with the address of a copy of the bytes.
  #lend(bytes, use) {
    const address = this.#code.view_allocate(bytes.byteLength) >>> 0;
    if (!address)
      throw new TetlodError(10, `out of memory: the browser gives the decoder no ${bytes.byteLength} bytes more`);
    new Uint8Array(this.#code.memory.buffer, address, bytes.byteLength)
      .set(new Uint8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength));
    try {
      return use(address);
    } finally {
      this.#code.view_release(address);
    }
  }

  /** Before the first bytes: they leave out all fields but those with these names. */
  select(names) {
    const bytes = new TextEncoder().encode(names.map((name) => `${name}\0`).join(''));
    this.#check(this.#lend(bytes, (address) => this.#code.view_select(this.#view, address, names.length)));
  }

  /** Adds the next bytes of the stream. True once the index is there. */
  add(bytes) {
    const status = this.#lend(bytes, (address) => this.#code.view_add(this.#view, address, bytes.byteLength));
    if (status !== MORE) this.#check(status);
    return status !== MORE;
  }

  /** The index, once it is there. */
  describe() {
    const text = this.#code.view_describe(this.#view);
    if (!text) throw new TetlodError(10, 'out of memory');
    const described = parse(this.#text(text));
    return { ...described, metadata: objectOf(described.metadata) };
  }

  /** The finest level that is there whole, or -1. */
  get ready() {
    return this.#code.view_ready(this.#view) | 0;
  }

  /** Decodes the base mesh. `fields` are indices; null: all. */
  open(fields) {
    const list = Uint32Array.from(fields ?? []);
    this.#check(this.#lend(list, (address) => this.#code.view_open(this.#view, address, fields ? list.length : NONE)));
  }

  /** Replays or undoes to a level. After a failure the view is at the last level that could be decoded. */
  seek(level) {
    this.#check(this.#code.view_seek(this.#view, level));
  }

  get level() {
    return this.#words(this.#code.view_mesh(this.#view), 3)[2];
  }

  get counts() {
    const [vertices, tets] = this.#words(this.#code.view_mesh(this.#view), 2);
    return { vertices, tets };
  }

  get centre() {
    return [...this.#doubles(this.#code.view_centre(this.#view), 3)];
  }

  /** Copies of the current level's arrays. `fields` are those of describe(). */
  mesh(fields) {
    const [vertices, tets, level, positions, values, corners, parents] =
      this.#words(this.#code.view_mesh(this.#view), 7);
    const addresses = this.#words(values, fields.length);
    return {
      level,
      positions: this.#doubles(positions, 3 * vertices).slice(),
      tets: this.#words(corners, 4 * tets).slice(),
      fields: Object.fromEntries(fields.flatMap(({ name, components }, f) =>
        addresses[f] ? [[name, this.#doubles(addresses[f], components * vertices).slice()]] : [])),
      parents: parents ? this.#words(parents, vertices).slice() : null, // of a mesh that is finer in boxes
    };
  }

  /**
   * What is drawn, as filter() and clip() have it, cut by the plane, too: {level, positions, tets, numbers, fields,
   * cells}; `numbers` are the original's that they are or are of, `cells` their values of fields of cells that are
   * loaded. Then filter() anew.
   */
  collect(fields, cellFields) {
    const address = this.#code.view_collect(this.#view) >>> 0;
    if (!address) this.#check(10);
    const [vertices, tets, positions, corners, originals] = this.#words(address, 5);
    const numbers = this.#words(originals, tets).slice();
    const all = this.#words(corners, 4 * tets);
    const places = new Uint32Array(vertices); // of those that have a corner, from 1 on
    let count = 0;
    for (const v of all) places[v] = 1;
    places.forEach((used, v) => { places[v] = used && ++count; });
    const gather = (address, components) => {
      const [from, to] = [this.#doubles(address, components * vertices), new Float64Array(components * count)];
      places.forEach((k, v) => k && to.set(from.subarray(components * v, components * (v + 1)), components * (k - 1)));
      return to;
    };
    const valuesOf = ({ components }, f) => {
      const address = this.#code.view_values(this.#view, f) >>> 0;
      return address ? gather(address, components) : null;
    };
    const named = (list, of) =>
      Object.fromEntries(list.map((field, f) => [field.name, of(field, f)]).filter(([, values]) => values));
    return {
      level: this.level, positions: gather(positions, 3), tets: all.map((v) => places[v] - 1), numbers,
      fields: named(fields, valuesOf),
      cells: named(cellFields, ({ components }, f) => this.#cellsOf(f, components, numbers)),
    };
  }

  // Values of those with these numbers; null: the field is not loaded.
  #cellsOf(field, components, numbers) {
    const address = this.#code.view_cells(this.#view, field) >>> 0;
    if (!address) return null;
    const row = (tet) => this.#doubles(address + 8 * components * tet, components);
    const values = new Float64Array(components * numbers.length);
    numbers.forEach((tet, t) => values.set(row(tet), components * t));
    return values;
  }

  // ---- a mesh that is finer in boxes

  /** What was added, until the next call. */
  get added() {
    const [address, size] = this.#words(this.#code.view_added(this.#view), 2);
    return new Uint8Array(this.#code.memory.buffer, address, size);
  }

  /** From now on a mesh is shown that refine.js made, until the cursor moves, or readopt(false). */
  adopt({ vertices, tets, positions, corners, numbers, parts, fields }) {
    const address = this.#code.view_adopt(this.#view, vertices, tets) >>> 0;
    if (!address) throw new TetlodError(10, 'out of memory: the browser gives the decoder none for a finer mesh');
    const [places, ends, originals, kinds, values] = this.#words(address, 5);
    this.#doubles(places, 3 * vertices).set(positions);
    this.#words(ends, 4 * tets).set(corners);
    this.#words(originals, tets).set(numbers);
    this.#words(kinds, tets).set(parts);
    this.#words(values, fields.length).forEach((at, f) => at && this.#doubles(at, fields[f].length).set(fields[f]));
    this.readopt(true);
  }

  /** From now on it moves: from these places and values of its vertices, as adopt() has them. See place(). */
  moveAdopted({ positions, fields }) {
    this.#check(this.#code.view_make_origins(this.#view));
    const fill = (field, values) =>
      this.#doubles(this.#code.view_origins(this.#view, field), values.length).set(values);
    fill(NONE, positions);
    fields.forEach((values, f) => values && fill(f, values));
    this.#code.view_move_adopted(this.#view);
  }

  /** Shows the mesh that was adopted last, or the cursor's again. */
  readopt(shown) {
    this.#check(this.#code.view_show_adopted(this.#view, shown ? 1 : 0));
  }

  /** From now on pictures are of a part of it only; null: of all. */
  pick(part) {
    this.#code.view_pick(this.#view, part ?? NONE);
  }

  // ---- steps in time

  /** Bytes from elsewhere in the stream, until they are forgotten. */
  put(offset, bytes) {
    this.#check(this.#lend(bytes, (address) => this.#code.view_put(this.#view, offset, address, bytes.byteLength)));
  }

  forget() {
    this.#code.view_forget(this.#view);
  }

  /**
   * Reads the table of steps, which is put. `fields`: as of open. {group, times, bands: [{error, level}], fields:
   * [{name, range}]}.
   */
  series(fields) {
    const list = Uint32Array.from(fields ?? []);
    this.#check(
      this.#lend(list, (address) => this.#code.view_series(this.#view, address, fields ? list.length : NONE)));
    return parse(this.#text(this.#code.view_describe_series(this.#view)));
  }

  /** Where the bytes are that a step needs in a band, of the series' field with this number. */
  span(field, band, step) {
    const [offset, size] = this.#doubles(this.#code.view_span(this.#view, field, band, step), 2);
    return { offset, size };
  }

  /** A bound of the error of the series' field with this number at a step in a band, a fraction of its range. */
  stepError(field, band, step) {
    return this.#code.view_step_error(this.#view, field, band, step);
  }

  /**
   * Shows a step in a band, at the band's level; with `move` on the way from the step that is shown, of the same level.
   */
  step(band, step, move = false) {
    this.#check((move ? this.#code.view_step_move : this.#code.view_step)(this.#view, band, step));
  }

  /** Shows a copy of the current level that can move from and to the shape of a coarser one, while the view goes on. */
  move(level) {
    this.#check(this.#code.view_move(this.#view, level));
  }

  /** Shows the mesh at t of the move: 0 the coarser level's shape, 1 the finer one's. */
  place(t) {
    this.#code.view_place(this.#view, t);
  }

  /** Shows the current level itself. */
  rest() {
    this.#check(this.#code.view_rest(this.#view));
  }

  /**
   * The field behind those of the stream is from now on a function {inputs: [[field, component]], program: [[operation,
   * number]]}.
   */
  define({ inputs, program }) {
    const words = Float64Array.from([...inputs, ...program].flat());
    this.#check(
      this.#lend(words, (address) => this.#code.view_define(this.#view, address, inputs.length, program.length)));
  }

  /** From now on points are moved by `scale` times a field of vectors, {field, scale}; null: they are not. True if that
   * is new. */
  warp(by) {
    const key = JSON.stringify(by);
    if (key === this.#warp) return false;
    this.#check(this.#code.view_warp(this.#view, by?.field ?? 0, by?.scale ?? 0));
    this.#warp = key;
    return true;
  }

  /** Chooses the value that colours parts; component -1 is the magnitude. It holds for the mesh as it is shown now,
   * whose
   *  least and greatest value it returns. */
  shade(field, component) {
    return [...this.#doubles(this.#code.view_shade(this.#view, field, component), 2)];
  }

  /** Sorted values that colour, some thousands, as many of each as it has of the volume. */
  sample() {
    const address = this.#code.view_sample(this.#view) >>> 0;
    const [values, count] = this.#words(address, 2);
    return this.#floats(values, count).slice().sort();
  }

  /** Where the bytes are that values of cells at a step need beside the field's own. */
  cellsSpan(field, step) {
    const [offset, size] = this.#doubles(this.#code.view_cells_span(this.#view, field, step), 2);
    return { offset, size };
  }

  /** Decodes values of cells at a step, whose bytes are put: the field with this number of describe().cellFields. After
   * a
   *  failure they are NaN. */
  loadCells(field, step = 0) {
    this.#check(this.#code.view_load_cells(this.#view, field, step));
  }

  /** A copy of the values of all the original's tetrahedra, `count` numbers; those of a level's are the first. */
  cells(field, count) {
    return this.#doubles(this.#code.view_cells(this.#view, field), count).slice();
  }

  /** As shade(), by values of cells that are loaded. After filter(). */
  shadeCells(field, component) {
    this.#check(this.#code.view_shade_cells(this.#view, field, component));
    return [...this.#doubles(this.#code.view_shade_range(this.#view), 2)];
  }

  // `lines`, `normals`: what the part has beside points, values and triangles; `keep`: without triangles and lines;
  // `margin`: WITH_MARGIN.
  #part({ lines = false, normals = false, keep = false, margin = false } = {}, make) {
    this.#check(make((lines ? 1 : 0) | (normals ? 2 : 0) | (margin ? 4 : 0)));
    const [points, triangles, edges, ...at] = this.#words(this.#code.view_part(this.#view), 10);
    const part = {
      points: this.#floats(at[0], 3 * points).slice(),
      values: this.#floats(at[1], points).slice(),
      vectors: at[5] ? this.#floats(at[6], at[5] * points).slice() : null,
      normals: normals ? this.#floats(at[4], 3 * points).slice() : null,
    };
    if (keep) return part;
    part.triangles = this.#words(at[2], 3 * triangles).slice();
    part.lines = lines ? this.#words(at[3], 2 * edges).slice() : null;
    return part;
  }

  /** From now on pictures are of what is behind a plane {origin, normal}, or of everything (null). */
  clip(plane) {
    if (plane) this.#code.view_clip(this.#view, ...plane.origin, ...plane.normal);
    else this.#code.view_unclip(this.#view);
  }

  /**
   * From now on pictures are of tetrahedra whose corners, or which themselves (`cells`), have values from `low` to
   * `high` of `range` at the end of a move, or of all (null), but not of those of `regions`: {field, hidden}, numbers
   * of a field of cells that is loaded; null: none are left out. And of what is in `box`, if there is one, whose faces
   * close it.
   */
  filter(range, regions, box) {
    if (range) this.#code.view_threshold(this.#view, range.cells, range.field, range.component, range.low, range.high);
    else this.#code.view_unthreshold(this.#view);
    this.#code.view_box(this.#view, box ? 1 : 0, ...(box ?? [0, 0, 0, 0, 0, 0]));
    const hidden = Float64Array.from(regions?.hidden ?? []).sort();
    this.#check(
      this.#lend(hidden, (address) => this.#code.view_hide(this.#view, regions?.field ?? 0, address, hidden.length)));
    this.#check(this.#code.view_filter(this.#view));
  }

  /** The boundary; its triangles and lines are the same all the way of a move. */
  surface(options) {
    return this.#part(options, (flags) => this.#code.view_surface(this.#view, flags));
  }

  /** The boundary's points; its lines are the edges of what is of a part of a mesh that is finer in boxes. */
  marks(part) {
    return this.#part({ lines: true }, () => this.#code.view_mark(this.#view, part));
  }

  slice(origin, normal, options) {
    return this.#part(options, (flags) => this.#code.view_slice(this.#view, flags, ...origin, ...normal));
  }

  isosurface(field, component, value, options) {
    return this.#part(options, (flags) => this.#code.view_isosurface(this.#view, flags, field, component, value));
  }

  /** Is the last isosurface as near as it is to be? One of a length may need too many triangles for that. */
  get isNear() {
    return Boolean(this.#code.view_is_near(this.#view));
  }

  /** The value that colours, or its logarithm, on a grid over the bounds with `size` points along the longest side. */
  resample(size, logarithmic) {
    this.#check(this.#code.view_resample(this.#view, size, logarithmic ? 1 : 0));
    const grid = this.#code.view_grid(this.#view) >>> 0;
    const voxels = this.#code.view_voxels(this.#view) >>> 0;
    const dims = [...this.#words(grid, 3)];
    const place = [...this.#doubles(grid + 16, 6)];
    return {
      dims, origin: place.slice(0, 3), spacing: place.slice(3), logarithmic: Boolean(logarithmic),
      voxels: this.#floats(this.#words(voxels, 1)[0], 2 * dims[0] * dims[1] * dims[2]).slice(),
      range: [...this.#floats(voxels + 4, 2)],
    };
  }

  // Counts and addresses of struct cut_rays.
  #rayData() {
    this.#check(this.#code.view_rays(this.#view));
    return this.#words(this.#code.view_ray_data(this.#view), 11);
  }

  /** What is drawn, and a field of vectors, as `Flow` takes them: the module's own arrays, until the next call.
   * `lengthOf`: {field,
   *  components} of the field whose length colours, or null. */
  flow(field, lengthOf) {
    const [vertexCount, tetCount, , , vertices, corners, neighbours, , , ofTets, hasOfTets] = this.#rayData();
    const valuesOf = (of, components) =>
      this.#doubles(this.#code.view_values(this.#view, of), components * vertexCount);
    return {
      cells: hasOfTets ? this.#floats(ofTets, tetCount) : null,
      vertices: this.#floats(vertices, 4 * vertexCount),
      corners: this.#words(corners, 4 * tetCount),
      neighbours: this.#words(neighbours, 4 * tetCount),
      vectors: valuesOf(field, 3),
      lengths: lengthOf && { values: valuesOf(lengthOf.field, lengthOf.components), components: lengthOf.components },
    };
  }

  // Four numbers for each vertex, of vectors that have at most four components.
  #vectors({ field, components }, count) {
    const values = this.#doubles(this.#code.view_values(this.#view, field), components * count);
    const four = new Float32Array(4 * count);
    for (let v = 0; v < count; v++) for (let c = 0; c < components; c++) four[4 * v + c] = values[components * v + c];
    return four;
  }

  /**
   * What rays through the tetrahedra need (src/cut/rays.h); `keep`: only what a move changes. `lengthOf`: as of flow().
   */
  rays({ keep = false, lengthOf = null } = {}) {
    const [vertexCount, tetCount, faceCount, nodeCount, vertices, corners, neighbours, faces, nodes, ofTets,
      hasOfTets] = this.#rayData();
    const placed = {
      vectors: lengthOf?.components <= 4 ? this.#vectors(lengthOf, vertexCount) : null,
      vertices: this.#floats(vertices, 4 * vertexCount).slice(), nodes: this.#floats(nodes, 8 * nodeCount).slice(),
      cells: hasOfTets ? this.#floats(ofTets, 4 * Math.ceil(tetCount / 4)).slice() : null,
    };
    const words = (address, count) => this.#words(address, 4 * count).slice();
    return keep ? placed : {
      ...placed,
      corners: words(corners, tetCount),
      neighbours: words(neighbours, tetCount),
      faces: words(faces, faceCount)
    };
  }

  /** The value that colours along a segment: [at, value] of begin and end of each piece, `at` from 0 to 1. */
  along(from, to) {
    this.#check(this.#code.view_along(this.#view, ...from, ...to));
    const [count, ends] = this.#words(this.#code.view_line(this.#view), 2);
    return this.#doubles(ends, count ? 4 * count : 0).slice();
  }

  /** {tet, values: {field: [components]}, cells: {the same of fields of cells that are loaded}} of the mesh that is
   * shown, or null outside.
   *  `fields` and `cellFields` are those of describe(). */
  probe([x, y, z], fields, cellFields = []) {
    const tet = this.#code.view_probe(this.#view, x, y, z) >>> 0;
    if (tet === NONE) return null;
    let at = this.#code.view_probed(this.#view) >>> 0;
    const values = {};
    for (const { name, components } of fields) {
      const value = [...this.#doubles(at, components)];
      if (!Number.isNaN(value[0])) values[name] = value; // else it is not decoded
      at += 8 * components;
    }
    const cells = {};
    cellFields.forEach(({ name, components }, f) => {
      const address = this.#code.view_cells(this.#view, f) >>> 0;
      if (address) cells[name] = [...this.#doubles(address + 8 * components * tet, components)];
    });
    return { tet, values, cells };
  }

  /** The part of an adopted mesh that the last probe was in. */
  get probedPart() {
    return this.#code.view_probed_part(this.#view);
  }
}
