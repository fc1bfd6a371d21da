// SPDX-License-Identifier: BSD-3-Clause
// Levels that are finer in boxes, of the bytes that a view has: a module of its own. See ../refine/finer.h.
import { NONE, TetlodError, instantiate } from './tetlod.js';

const MORE = 1; // TETLOD_MORE

export class Refiner {
  #code;
  #maker;
  #fields = null;
  #level = -1;
  #ready = false;

  static async create(module) {
    return new Refiner(await instantiate(module));
  }

  constructor(code) {
    this.#code = code;
    this.#maker = code.refine_new();
    if (!this.#maker) throw new TetlodError(10, 'out of memory');
  }

  #words(address, count) {
    return new Uint32Array(this.#code.memory.buffer, address >>> 0, count);
  }
  #doubles(address, count) {
    return new Float64Array(this.#code.memory.buffer, address >>> 0, count);
  }

  #check(status) {
    if (!status || status === MORE) return status;
    const bytes = new Uint8Array(this.#code.memory.buffer, this.#code.refine_message(this.#maker) >>> 0);
    throw new TetlodError(status, new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0))));
  }

  #lend(bytes, use) {
    const address = this.#code.refine_allocate(bytes.byteLength) >>> 0;
    if (!address) throw new TetlodError(10, 'out of memory: the browser gives no room for a finer mesh');
    new Uint8Array(this.#code.memory.buffer, address, bytes.byteLength).set(
      new Uint8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength),
    );
    try {
      return this.#check(use(address));
    } finally {
      this.#code.refine_release(address);
    }
  }

  /**
   * `bytes` of a stream's levels up to `level`, of the fields with the names `selected` (null: all); `fields`: the
   * numbers of those to decode, null for all. Then grow(), until it is true.
   */
  open(bytes, { fields, selected, level }) {
    if (selected) {
      const names = new TextEncoder().encode(selected.map((name) => `${name}\0`).join(''));
      this.#lend(names, (address) => this.#code.refine_select(this.#maker, address, selected.length));
    }
    this.#lend(bytes, (address) => this.#code.refine_add(this.#maker, address, bytes.byteLength));
    const list = Uint32Array.from(fields ?? []);
    this.#lend(list, (address) => this.#code.refine_begin(this.#maker, level, address, fields ? list.length : NONE));
    this.#fields = fields;
    this.#level = level;
  }

  /** Decodes one level more. True when all are there. */
  grow() {
    this.#ready = this.#check(this.#code.refine_grow(this.#maker)) !== MORE;
    return this.#ready;
  }

  /** Whether boxes of a level can be made. */
  reaches(level) {
    return this.#ready && level <= this.#level;
  }

  /** The mesh of level `coarse`, and of `fine` in the boxes, as View.adopt takes it; `counts`: tetrahedra of its parts.
   *  Its arrays hold until the next call. */
  make(coarse, fine, boxes) {
    const numbers = Float64Array.from(boxes.flat());
    this.#lend(numbers, (address) => this.#code.refine_make(this.#maker, coarse, fine, address, boxes.length));
    const [vertices, tets, positions, corners, originals, parts, outside, inside, between] = this.#words(
      this.#code.refine_mesh(this.#maker),
      9,
    );
    const valuesOf = (f) =>
      this.#doubles(this.#code.refine_values(this.#maker, f), vertices * this.#code.refine_components(this.#maker, f));
    const count = this.#code.refine_field_count(this.#maker);
    return {
      vertices,
      tets,
      positions: this.#doubles(positions, 3 * vertices),
      corners: this.#words(corners, 4 * tets),
      numbers: this.#words(originals, tets),
      parts: this.#doubles(parts, tets),
      fields: Array.from({ length: count }, (_, f) => (!this.#fields || this.#fields.includes(f) ? valuesOf(f) : null)),
      counts: { outside, inside, between },
    };
  }
}
