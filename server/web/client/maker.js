// SPDX-License-Identifier: BSD-3-Clause
// The second module, which makes meshes that are finer somewhere (../refine): its memory, and what its functions say.
import { NONE, TetlodError, instantiate } from './tetlod.js';

export const MORE = 1; // TETLOD_MORE

export class Maker {
  #name;
  #made;

  /** `name`: what its functions' names begin with: refine, paging or answers. */
  static async create(module, name) {
    return new Maker(await instantiate(module), name);
  }

  constructor(code, name) {
    this.code = code;
    this.#name = name;
    this.#made = this.run('new');
    if (!this.#made) throw new TetlodError(10, 'out of memory');
  }

  /** What a function gives. */
  run(what, ...given) {
    const own = this.#made === undefined ? [] : [this.#made];
    return this.code[`${this.#name}_${what}`](...own, ...given) >>> 0;
  }

  /** The same of one that may fail; MORE is none. */
  try(what, ...given) {
    const status = this.run(what, ...given);
    if (!status || status === MORE) return status;
    const bytes = new Uint8Array(this.code.memory.buffer, this.run('message'));
    throw new TetlodError(status, new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0))));
  }

  /** The same with bytes in its memory for that long: `use(address)`. */
  lend(bytes, use) {
    const address = this.code.refine_allocate(bytes.byteLength) >>> 0;
    if (!address) throw new TetlodError(10, 'out of memory: the browser gives no room for a finer mesh');
    new Uint8Array(this.code.memory.buffer, address, bytes.byteLength).set(
      new Uint8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength),
    );
    try {
      return use(address);
    } finally {
      this.code.refine_release(address);
    }
  }

  words(address, count) {
    return new Uint32Array(this.code.memory.buffer, address, count);
  }

  doubles(address, count) {
    return new Float64Array(this.code.memory.buffer, address, count);
  }

  /**
   * Begins with a stream's bytes, of the fields with the names `selected` (null: all); `fields`: the numbers of those
   * to decode, null for all.
   */
  open(bytes, { selected, fields }, begin) {
    this.select({ selected });
    this.lend(bytes, (address) => this.try('add', address, bytes.byteLength));
    const list = Uint32Array.from(fields ?? []);
    this.lend(list, (address) => begin(address, fields ? list.length : NONE));
  }

  /** Says of which fields the bytes are, by their names; null: of all. */
  select({ selected }) {
    if (!selected) return;
    const names = new TextEncoder().encode(selected.map((name) => `${name}\0`).join(''));
    this.lend(names, (address) => this.try('select', address, selected.length));
  }

  /** The mesh at struct refine_mesh, as View.adopt takes it, with its fields' values; it holds until the next one. */
  mesh(address, valuesOf) {
    const [vertices, tets, positions, corners, numbers, parts, ...counts] = this.words(address, 9);
    return {
      vertices,
      tets,
      positions: this.doubles(positions, 3 * vertices),
      corners: this.words(corners, 4 * tets),
      numbers: this.words(numbers, tets),
      parts: this.doubles(parts, tets),
      fields: valuesOf(vertices),
      counts,
    };
  }
}
