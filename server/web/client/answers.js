// SPDX-License-Identifier: BSD-3-Clause
// What the bytes that are here prove of the original. See ../refine/answers.h.
import { Maker } from './maker.js';

const kinds = ['maximum', 'minimum'];

export class Answers {
  #maker;
  #host;
  #added = 0; // bytes of the stream

  /** `host`: as of a Refiner. */
  static async create(module, host) {
    return new Answers(await Maker.create(module, 'answers'), host);
  }

  constructor(maker, host) {
    this.#maker = maker;
    this.#host = host;
    maker.select(host);
  }

  // The bytes that have come since.
  #update() {
    const bytes = this.#host.bytes();
    const more = bytes.subarray(this.#added);
    if (more.length) this.#maker.lend(more, (address) => this.#maker.try('add', address, more.length));
    this.#added = bytes.length;
  }

  #lendText(text, use) {
    this.#maker.lend(new TextEncoder().encode(`${text}\0`), use);
  }

  /** The answer to a question of levels up to `finest`, as narrow as `within` of what it can be at most. */
  ask(question, finest, within) {
    const maker = this.#maker;
    this.#update();
    this.#lendText(question, (address) => maker.try('ask', address, finest, within));
    const [lower, upper, level, exact, tets, bytes] = maker.doubles(maker.run('numbers'), 6);
    return { lower, upper, bound: exact ? 'exact' : 'certified', ...(level >= 0 && { level, tets }), bytes };
  }

  /** Maxima and minima of a persistence above a fraction of the range; `bounded`: there are no others. */
  features(quantity, finest, persistence) {
    const maker = this.#maker;
    this.#update();
    this.#lendText(quantity, (address) => maker.try('find', address, finest, persistence));
    const count = maker.run('feature_count');
    const rows = maker.doubles(maker.run('features'), 14 * count).slice();
    const [level, error, maxima, minima] = maker.doubles(maker.run('found'), 4);
    const list = Array.from({ length: count }, (_, i) => {
      const [kind, proven, ...row] = rows.subarray(14 * i, 14 * i + 14);
      return {
        kind: kinds[kind],
        proven: proven === 1,
        at: row.slice(0, 3),
        box: [row.slice(3, 6), row.slice(6, 9)],
        range: row.slice(9, 11),
        persistence: row[11],
      };
    });
    return { level, error, bounded: { maximum: maxima === 1, minimum: minima === 1 }, features: list };
  }
}
