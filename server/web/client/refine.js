// SPDX-License-Identifier: BSD-3-Clause
// Levels that are finer in boxes, of the bytes that a view has: a module of its own. See ../refine/finer.h.
import { MORE, Maker } from './maker.js';
export { Answers } from './answers.js';
export { Pager } from './paging.js';

const kinds = ['outside', 'inside', 'between']; // of the parts of a mesh that is finer in boxes (src/stream/region.h)
const transition = 2;

/** Where a probe is: a part of a mesh that is finer in boxes, or a level of one of pages. */
export const placeOf = (part, { pages }) => (pages === undefined ? { part: kinds[part] } : { level: part });

/** Which levels are shown where, and the edges of the tetrahedra between them, of which nothing is proved. */
export function drawFiner(view, told, { surface, slices, threshold, regions, box }) {
  if (told.pages !== undefined) return { ...told, edges: [] };
  const marked = surface ? [view.marks(transition)] : [];
  view.pick(transition);
  view.filter(threshold, regions, box);
  const cut = slices.map(({ origin, normal }) => view.slice(origin, normal, { lines: true }));
  const edges = [...marked, ...cut].map(({ points, lines }) => ({ points, lines }));
  view.pick(null);
  view.filter(threshold, regions, box);
  return { ...told, edges };
}

export class Refiner {
  #module;
  #host;
  #maker = null;
  #level = -1; // the finest that it has

  /**
   * `host`: {bytes(), of the stream; selected, names of the fields these are of, or null; fields, numbers of those to
   * decode, or null}.
   */
  constructor(module, host) {
    this.#module = module;
    this.#host = host;
  }

  // Decodes on its own, in turns; false: it is not wanted any more.
  async #open(level, takeTurn) {
    this.#level = -1;
    this.#maker = await Maker.create(this.#module, 'refine');
    this.#maker.open(this.#host.bytes(), this.#host, (...fields) => this.#maker.try('begin', level, ...fields));
    while (this.#maker.try('grow') === MORE) if (!(await takeTurn())) return false;
    this.#level = level;
    return true;
  }

  /**
   * The mesh of level `coarse`, and of `fine` in the boxes, as View.adopt takes it; `told`: tetrahedra of its parts.
   * Its arrays hold until the next call. `takeTurn` waits for the next turn, or is false; then null.
   */
  async make(coarse, fine, boxes, takeTurn) {
    if (fine > this.#level && !(await this.#open(fine, takeTurn))) return null;
    const maker = this.#maker;
    const { fields } = this.#host;
    const numbers = Float64Array.from(boxes.flat());
    maker.lend(numbers, (address) => maker.try('make', coarse, fine, address, boxes.length));
    const valuesOf = (vertices) =>
      Array.from({ length: maker.run('field_count') }, (_, f) =>
        !fields || fields.includes(f)
          ? maker.doubles(maker.run('values', f), vertices * maker.run('components', f))
          : null,
      );
    const { counts, ...mesh } = maker.mesh(maker.run('mesh'), valuesOf);
    const [outside, inside, between] = counts;
    return { ...mesh, told: { tets: mesh.tets, boxLevel: fine, outside, inside, between } };
  }
}
