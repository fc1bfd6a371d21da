// SPDX-License-Identifier: BSD-3-Clause
// A mesh of some pages of a stream, which follows a view of it: chooses pages, brings their bytes, has them decoded
// (../refine/paging.h), and gives back those that left. Loaded when it is first wanted.
import { choosePages, rangesOf, reaches } from './pages.js';
import { MORE, Maker } from './maker.js';
import { Sights } from './sights.js';

const vertices = 16_000; // that are decoded in a turn, and at least a page
const mostFrames = 257; // MAX_PAGE_FRAMES
const atOnce = 4; // requests
const steps = [64, 8, 1]; // times the pixels: much is brought and shown in steps, the coarse one first
const much = 100_000; // bytes
// A view for boxes alone, which sees nothing; one that follows the camera says its own budgets.
const unseen = {
  planes: [[0, 0, 0, -1]],
  eye: [0, 0, 0],
  near: 1,
  scale: 0,
  parallel: true,
  pixels: Number.MAX_VALUE,
  tets: 2_000_000,
  bytes: 64_000_000,
  id: null,
};
const coarser = 4; // times the pixels, of pages that come while the camera moves

export class Pager {
  #maker;
  #host;
  #table;
  #sights; // where pages are seen
  #held = new Map(); // bytes of pages, by number: arrays, one for each frame; the one that was needed last at the end
  #heldBytes = 0;
  #shown = null; // the pages of the mesh that was offered last
  #last = null; // {starts, parents, positions, fields} of it; starts: of a page's vertices
  #look = null;
  #reached = null; // the look that is shown
  #bell = () => {};
  #fetching = null; // {wanted: pages, stop}
  #closed = false;
  #turn = new MessageChannel();

  /**
   * `host`: {bytes(), of the stream's first levels; selected, names of the fields these are of, or null; fields,
   * numbers of those to decode, or null; info; spec(), what the pictures show; moves(), whether
   * shapes may pass into each other; apart(offset, size, signal); offer(mesh, told), which resolves when it is copied;
   * fail(error)}.
   */
  static async create(module, host) {
    return new Pager(await Maker.create(module, 'paging'), host);
  }

  constructor(maker, host) {
    this.#maker = maker;
    this.#host = host;
    this.#open(host.info);
    this.#run();
  }

  /**
   * From now on the mesh is to be what this view needs: as pages.js has it, with `field` and `measure` of the error,
   * and an `id`. `again`: it is offered also if it is the same as before.
   */
  look(wanted, again = false) {
    const look = wanted && { ...unseen, ...wanted };
    this.#look = look;
    if (again) this.#shown = this.#reached = null;
    if (this.#fetching && look) {
      const { has } = this.#choose(look, look.moving ? coarser : 1);
      if (this.#fetching.wanted.some((page) => !has[page])) this.#fetching.stop.abort();
    }
    this.#bell();
  }

  close() {
    this.#closed = true;
    this.#fetching?.stop.abort();
    this.#turn.port1.close();
    this.#bell();
  }

  #open({ levels, paged }) {
    const maker = this.#maker;
    const bytes = this.#host.bytes().subarray(0, levels[paged - 1].bytes);
    maker.open(bytes, this.#host, (...fields) => maker.try('open', ...fields));
    const pages = Array.from({ length: maker.run('count') }, (_, p) => this.#page(p));
    const first = new Map();
    pages.forEach(({ level }, p) => first.has(level) || first.set(level, p));
    for (const page of pages) page.needed = page.needed.map((p) => first.get(page.level - 1) + p);
    this.#table = { pages, root: levels[paged - 1].tets };
    const walls = this.#walls();
    const mesh = this.#mesh();
    this.#sights = new Sights(pages, this.#host.info, mesh, walls);
    this.#remember(mesh, []);
  }

  #walls() {
    const address = this.#maker.run('walls');
    if (!address) throw new Error('out of memory: the browser gives no room for pages');
    const [count, corners] = this.#maker.words(address, 2);
    return this.#maker.words(corners, 4 * count).slice(); // the memory may move
  }

  // As struct paging_page has it.
  #page(number) {
    const maker = this.#maker;
    const at = maker.run('page', number);
    const box = [...maker.doubles(at, 6)];
    const [count, level, vertices, tets, neededCount, needed] = maker.words(at + 48 + 16 * mostFrames, 6);
    const numbers = maker.doubles(at + 48, 2 * count);
    const frames = Array.from({ length: count }, (_, i) => [numbers[2 * i], numbers[2 * i + 1]]);
    return {
      level,
      vertices,
      tets,
      low: box.slice(0, 3),
      high: box.slice(3),
      frames,
      bytes: frames.reduce((sum, [, size]) => sum + size, 0),
      needed: [...maker.words(needed, neededCount)],
    };
  }

  // ---- towards a view

  #choose(look, times = 1) {
    const reach = reaches(this.#host.info, look.field, look.measure);
    const scales = this.#sights.scales(look, this.#host.spec());
    const shown = this.#shown ?? new Set();
    return { ...choosePages({ ...this.#table, reach, scales }, look, { times, shown }), scales };
  }

  async #run() {
    while (!this.#closed) {
      const look = this.#look;
      if (!look || look === this.#reached) {
        await new Promise((resolve) => {
          this.#bell = resolve;
        });
        continue;
      }
      try {
        await this.#follow(look);
      } catch (error) {
        if (this.#closed || look !== this.#look) continue; // somebody looks elsewhere
        this.#reached = look;
        this.#host.fail(error);
      }
    }
  }

  // In steps, if much is missing; whoever looks elsewhere meanwhile is followed there.
  async #follow(look) {
    const started = performance.now();
    const least = look.moving ? coarser : 1;
    const last = this.#choose(look, least);
    const numbers = (has) => [...has.keys()].filter((p) => has[p]);
    const missing = numbers(last.has).reduce((sum, p) => sum + (this.#held.has(p) ? 0 : this.#table.pages[p].bytes), 0);
    for (const times of missing > much ? steps : [1]) {
      const isLast = times === 1;
      const chosen = isLast ? last : this.#choose(look, times * least);
      const pages = numbers(chosen.has);
      if (!isLast && pages.every((p) => this.#shown?.has(p))) continue;
      await this.#bring(pages, look.bytes);
      if (this.#look !== look && this.#shown) return;
      await this.#show(pages, { ...chosen, look: isLast ? look.id : null, started });
    }
    this.#reached = look;
  }

  async #show(pages, { started, has, scales, ...told }) {
    const isSame = this.#shown?.size === pages.length && pages.every((p) => this.#shown.has(p));
    const made = isSame ? null : await this.#make(pages, scales);
    await this.#host.offer(made, {
      ...told,
      held: this.#heldBytes,
      pages: pages.length,
      seconds: (performance.now() - started) / 1000,
    });
  }

  // Pages that leave go to the shape without them first, if they are seen; those that are new come from there.
  async #make(pages, scales) {
    const isSeen = (page) => scales[page] > 0;
    const before = this.#shown ?? new Set();
    const stay = pages.filter((p) => before.has(p));
    const moves = this.#host.moves();
    const wanted = new Set(pages);
    const leaves = moves && [...before].some((p) => !wanted.has(p) && isSeen(p)) ? await this.#leaving(stay) : null;
    const last = this.#last;
    await this.#decode(pages);
    this.#shown = wanted;
    const made = this.#mesh();
    const next = this.#remember(made, pages);
    const from = moves && pages.some((p) => !before.has(p) && isSeen(p)) ? this.#placesOf(next, last) : null;
    return { ...made, leaves, from };
  }

  // Where the vertices of the mesh that was offered last are without the pages that go.
  async #leaving(stay) {
    const last = this.#last;
    await this.#decode(stay);
    return this.#placesOf(last, this.#remember(this.#mesh(), stay));
  }

  async #decode(pages) {
    const maker = this.#maker;
    try {
      for (const page of pages) {
        this.#table.pages[page].frames.forEach(([offset, size], i) => {
          if (size) maker.lend(this.#held.get(page)[i], (address) => maker.try('put', offset, address, size));
        });
      }
      maker.lend(Uint32Array.from(pages), (address) => maker.try('choose', address, pages.length));
      while (!this.#closed && maker.try('step', vertices) === MORE) await this.#takeTurn();
    } finally {
      maker.run('forget');
    }
  }

  #takeTurn() {
    return new Promise((resolve) => {
      this.#turn.port1.onmessage = resolve;
      this.#turn.port2.postMessage(null);
    });
  }

  #mesh() {
    const maker = this.#maker;
    const address = maker.run('mesh');
    if (!address) throw new Error('out of memory: the browser gives no room for pages');
    const valuesOf = (vertices) =>
      this.#host.info.fields.map(({ components }, f) => {
        const values = maker.run('values', f);
        return values ? maker.doubles(values, components * vertices) : null;
      });
    return maker.mesh(address, valuesOf);
  }

  // Pages' vertices lie one after the other, in the order of their numbers.
  #remember({ vertices, positions, fields }, pages) {
    const starts = new Map();
    let next = vertices - pages.reduce((sum, p) => sum + this.#table.pages[p].vertices, 0);
    starts.set(null, next);
    for (const page of pages) {
      starts.set(page, next);
      next += this.#table.pages[page].vertices;
    }
    const parents = this.#maker.words(this.#maker.run('parents'), vertices).slice();
    this.#last = { starts, parents, positions: positions.slice(), fields: fields.map((values) => values?.slice()) };
    return this.#last;
  }

  // Positions and values of a mesh's vertices in another one: of one that is there, its own; else of the one that it
  // was split from. Null: none of them is.
  #placesOf({ starts, parents }, { starts: there, positions, fields }) {
    if (starts.get(null) !== there.get(null)) return null;
    const origins = new Uint32Array(parents.length);
    for (let v = 0; v < starts.get(null); v++) origins[v] = v;
    for (const [page, start] of starts) {
      if (page === null) continue;
      const was = there.get(page);
      for (let i = 0; i < this.#table.pages[page].vertices; i++)
        origins[start + i] = was === undefined ? origins[parents[start + i]] : was + i;
    }
    const gather = (values, n) => {
      const out = new Float64Array(n * origins.length);
      for (let v = 0; v < origins.length; v++)
        for (let i = 0; i < n; i++) out[n * v + i] = values[n * origins[v] + i];
      return out;
    };
    const components = this.#host.info.fields.map((field) => field.components);
    const placed = fields.map((values, f) => values && gather(values, components[f]));
    return { positions: gather(positions, 3), fields: placed };
  }

  // ---- bytes

  async #bring(pages, budget) {
    const missing = pages.filter((page) => !this.#held.has(page));
    for (const page of pages) this.#use(page);
    const ranges = rangesOf(missing.flatMap((page) => this.#table.pages[page].frames));
    const stop = new AbortController();
    this.#fetching = { wanted: missing, stop };
    try {
      const came = await this.#fetch(ranges, stop.signal);
      for (const page of missing) this.#hold(page, came);
    } finally {
      stop.abort(); // of a failure the others are not waited for
      this.#fetching = null;
    }
    this.#evict(new Set(pages), budget);
  }

  async #fetch(ranges, signal) {
    const came = [];
    const next = ranges.values();
    const fetchSome = async () => {
      for (const { offset, size } of next)
        came.push({ offset, size, bytes: await this.#host.apart(offset, size, signal) });
    };
    await Promise.all(Array.from({ length: atOnce }, fetchSome));
    return came;
  }

  #use(page) {
    const bytes = this.#held.get(page);
    if (bytes && this.#held.delete(page)) this.#held.set(page, bytes);
  }

  // Copies: the range that they came in may have others' bytes.
  #hold(page, came) {
    const bytesOf = ([offset, size]) => {
      const range = came.find((r) => offset >= r.offset && offset + size <= r.offset + r.size);
      return size ? range.bytes.slice(offset - range.offset, offset - range.offset + size) : null;
    };
    this.#held.set(page, this.#table.pages[page].frames.map(bytesOf));
    this.#heldBytes += this.#table.pages[page].bytes;
  }

  // What left the view goes first of what was needed longest ago.
  #evict(needed, budget) {
    for (const page of this.#held.keys()) {
      if (this.#heldBytes <= budget) return;
      if (needed.has(page)) continue;
      this.#held.delete(page);
      this.#heldBytes -= this.#table.pages[page].bytes;
    }
  }
}
