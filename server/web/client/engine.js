// SPDX-License-Identifier: BSD-3-Clause
// What the worker does: fetches the bytes that the goal needs, moves the cursor towards it, and makes the pictures of
// what it shows. Two loops, one for bytes and one for levels; whoever changes something wakes them.
import { boundOf, chooseLevel } from './choose.js';
import { Held, readerOf, readerOfPart } from './held.js';
import { FetchError, Source, canList, query, sleep } from './network.js';
import { Pace } from './pace.js';
import { Groups, chooseBandAt, infoOfSteps } from './steps.js';
import { View } from './tetlod.js';

const moveTime = 250;   // milliseconds that a move between two levels takes
const heavyFrame = 120; // milliseconds: above, a move would be seen as one jump anyway
const ahead = 2;        // groups of steps that are fetched before they are needed
const patience = 1000;  // milliseconds until a picture counts as seen

const mostRegions = 500; // that somebody may want to choose from

// Which numbers there are, ascending, and how many tetrahedra have each; null: too many.
function countRegions(values) {
  const tets = new Map();
  for (const value of values) {
    tets.set(value, (tets.get(value) ?? 0) + 1);
    if (tets.size > mostRegions) return null;
  }
  return [...tets].sort(([a], [b]) => a - b).map(([number, count]) => ({ number, tets: count }));
}

const rangesOf = (source) => (from, to) => source.apart(from, to - from);

const aborted = () => new DOMException('the request was aborted', 'AbortError');

const isBox = (box) => box.length === 6 && box.every(Number.isFinite) && [0, 1, 2].every((i) => box[i] <= box[3 + i]);

export class Engine {
  #emit; #source; #view; #info;
  #stop = new AbortController();
  #fields = null;     // indices that are decoded, null for all
  #received = 0;
  #goal = -1;         // level
  #limit = Infinity;  // finest level that can be decoded: the stream is damaged after it
  #shown = 0;         // level of the mesh that is shown; the cursor may be ahead of it
  #moved = -1;        // level whose copy is shown, if one is
  #coarser = 0;       // level that it comes from or goes to
  #request = null;    // {id, level, resolve, reject} of refineTo
  #spec = null; #dirty = false;
  #decoding = 0;      // milliseconds since the last level was announced
  #pace = new Pace();
  #frameTime = 0;     // milliseconds of the last pictures, as they are made while the mesh moves
  #sampleOf = '';     // what the page has a sample of the values of
  #surfaceOf = '';    // what the page has the triangles of
  #volumeOf = '';     // what the page has a volume of
  #raysOf = '';       // what the page has the tetrahedra of
  #outlineOf = '';    // what the page has the outline of
  #vectorsOf = '';    // what the page has arrows or streamlines of
  #vectors = null;    // vectors.js, from when it is first wanted on
  #cells = new Map(); // promises of fields of cells, by number
  #cellBytes = new Map(); // what they are made from, by number
  #cellMap; // and the bytes that say which cell a tetrahedron is of
  #cellsAt = 0; // the step that they are those of
  #shows = 0;
  #seen = null;       // resolves when the page has seen the last pictures
  #bells = [];        // of loops that wait
  #turn = new MessageChannel(); // lets messages in between two pieces of work
  #base = null;       // #info while levels are shown; of steps it has other ranges and errors
  #series = null;     // {group, times, bands, fields, displacement}, a promise of it until then
  #groups = null;     // of its steps
  #time = null;       // {band, step, blend}: the step that is wanted; null: a level
  #at = null;         // {band, step}: the step that is shown
  #draft = null;      // {tets, resolve}: a picture of a coarser level that is wanted beside
  #refining;          // promises makers of meshes that are finer somewhere: refine.js, and its module
  #tools = null;      // which are here
  #answers;           // promises what proves something of the original
  #refiner = null;    // one for boxes, while such a mesh is wanted
  #look = null;       // the view that pages follow
  #pager = null;      // what follows it, and what ends that
  #offered = null;    // {made, told, taken}: a mesh of pages that is not shown yet
  #finer = null;      // {key, told} of the mesh that is shown, if it is such a one
  #unrefinable = '';  // key of one that could not be made
  #failure = null;    // of the network or the stream: no bytes come any more, until the next request

  /** `emit(name, detail)` sends an event to the page. */
  constructor(emit) {
    this.#emit = emit;
  }

  // ---- what the page asks

  // `source`: { url, headers, credentials }, { blob }, or { read }, a function as of Held.
  // `part`: {cid, offset, size} of the stream, if it is one inside the source; of `fields` it may lack some.
  async open({ module, refining, source, part, fields, retries, target }) {
    this.#refining = refining;
    const options = {
      signal: this.#stop.signal,
      retries,
      onRetry: (detail) => this.#emit('retry', detail),
      onBytes: (count) => this.#emit('fetched', count)
    };
    const read = source.blob ? readerOf(source.blob) : source.read;
    if (part)
      this.#source = new Held(readerOfPart(read ?? rangesOf(new Source(source, options)), part), read ? options : {});
    else this.#source = read ? new Held(read, options) : new Source(source, { ...options, target, fields });
    const first = this.#source.read(0, 1); // while the module is compiled
    first.catch(() => {});
    this.#view = await View.create(await module, (error) => this.#break(error));
    await first;
    let names = this.#source.partial ? this.#source.fields : Array.isArray(fields) ? fields : null;
    if (this.#source.partial) this.#view.select(names);
    for (let reading = first; !await this.#receive(1, reading);) reading = undefined;
    this.#info = this.#base = this.#view.describe();
    this.#source.cid = this.#info.cid;
    for (const topology of this.#info.topologies ?? []) topology.offset += this.#source.base;
    if (part && part.cid !== this.#info.cid)
      throw new FetchError('a topology group is another stream than the table says');
    if (part) names = names?.filter((name) => this.#info.fields.some((field) => field.name === name)) ?? null;
    if (this.#source.partial) this.#source.levels = this.#info.levels;
    if (names) this.#fields = names.map((name) => this.#fieldIndex(name));
    if (target) this.#goal = chooseLevel(this.#info, target);
    const base = this.#info.levels[0].bytes;
    while (this.#received < base) await this.#receive(this.#untilGoal);
    this.#view.open(this.#fields);
    this.#fetchLoop();
    this.#showLoop();
    this.#series = this.#info.time && this.#openSeries();
    this.#series?.catch(
      (error) => this.#emit('error', { message: `the steps in time cannot be read: ${error.message}` }));
    return { info: this.#info, fields: names ?? this.#info.fields.map(({ name }) => name) };
  }

  /** Resolves to {level, reached} when the level is there and seen; a later request ends it earlier, unreached. */
  refineTo(target, id) {
    const level = chooseLevel(this.#base, target);
    if (level <= this.#limit) this.#leaveSteps();
    return this.#ask(level, id);
  }

  #ask(level, id) {
    if (level > this.#limit) this.#failAt(level);
    this.#request?.resolve({ level: this.#view.level, reached: false });
    this.#aim(level);
    if (this.#limit === Infinity) this.#failure = null; // a network may have come back
    return new Promise((resolve, reject) => {
      this.#request = { id, resolve, reject };
      this.#wake();
    });
  }

  /**
   * The same for a step of a series, in a band or in the coarsest within an error; from the step before in `blend`
   * milliseconds.
   */
  async seekStep({ step, band, error = 0, blend = 0 }, id) {
    if (!this.#series) throw new RangeError('the stream is no series in time');
    const { times, bands, fields } = await this.#series;
    if (!(step in times)) throw new RangeError(`step is a whole number from 0 to ${times.length - 1}, not ${step}`);
    const errors = (number) => fields.map((_, field) => this.#view.stepError(field, number, step));
    const wanted = band ?? chooseBandAt({ bands }, error, errors, this.#base.metadata);
    if (!(wanted in bands)) throw new RangeError(`band is a whole number from 0 to ${bands.length - 1}, not ${wanted}`);
    const asked = this.#ask(bands[wanted].level, id);
    this.#time = { band: wanted, step, blend };
    this.#info = infoOfSteps(this.#base, await this.#series, wanted);
    return asked;
  }

  abort(id) {
    if (this.#request?.id !== id) return;
    this.#aim(this.#view.level);
    if (this.#time && this.#at) this.#time = { ...this.#at, blend: 0 };
    else this.#leaveSteps();
    this.#groups?.drop();
    this.#endRequest('reject', aborted());
    this.#wake();
  }

  mesh() {
    return this.#view.mesh(this.#info.fields);
  }

  /** What is drawn, as tetrahedra. */
  drawn() {
    this.#view.clip(this.#spec?.clip ?? null);
    this.#filter();
    return this.#view.collect(this.#info.fields, this.#info.cellFields);
  }

  /** Values at a point of what is drawn. */
  probe(point) {
    this.#filter(); // the mesh may have gone on
    const found = this.#view.probe(point, this.#info.fields, this.#info.cellFields);
    return found && this.#finer ? { ...found, ...this.#tools.placeOf(this.#view.probedPart, this.#finer.told) } : found;
  }

  /** An answer to a question, or features; of the levels up to what is shown. */
  async prove({ question, within, quantity, persistence }) {
    const { Answers, module } = this.#tools ??= await this.#refining();
    const answers = await (this.#answers ??= Answers.create(module, this.#hostOf()));
    const level = this.#shown;
    return question ? answers.ask(question, level, within) : answers.features(quantity, level, persistence);
  }

  /**
   * The value that colours the pictures, along a segment: what is not drawn is a gap. `bounds`: the field's local bound
   * at each end, if it is held.
   */
  line([from, to]) {
    if (!this.#spec || (this.#spec.shade < 0 && this.#spec.cellShade < 0))
      throw new RangeError('a line needs pictures with a field');
    this.#filter();
    this.#colour();
    const found = { level: this.#shown, ends: this.#view.along(from, to) };
    const local = this.#localBound();
    if (local < 0) return found;
    this.#view.shade(local, 0);
    const { shade, component } = this.#spec;
    const lengths = component < 0 ? Math.sqrt(this.#info.fields[shade].components) : 1;
    found.bounds = this.#view.along(from, to).filter((_, i) => i % 2).map((bound) => lengths * bound);
    this.#colour();
    return found;
  }

  // The field, of those that are held, which bounds the error of the one that colours at every point; -1: none.
  #localBound() {
    const { shade, cellShade } = this.#spec;
    const { name } = this.#info.fields[shade] ?? {};
    return cellShade < 0 ? this.#info.fields.findIndex(
             ({ bounds }, f) => bounds && bounds === name && (!this.#fields || this.#fields.includes(f)))
                         : -1;
  }

  /** Fetches the values of a field of cells; `cells` gives those of all the original's tetrahedra, too. */
  loadCells(name) {
    return this.#loadCells(this.#cellIndex(name));
  }

  async cells(name) {
    const field = this.#cellIndex(name);
    await this.#loadCells(field);
    return this.#view.cells(field, this.#info.tets * this.#info.cellFields[field].components);
  }

  async show(spec) {
    const checked = spec && this.#checkSpec(spec);
    const number = ++this.#shows;
    for (const field of [checked?.cellShade ?? -1, checked?.regions?.field ?? -1,
           checked?.threshold?.cells ? checked.threshold.field : -1])
      if (field >= 0) await this.#loadCells(field);
    if (checked?.vectors) this.#vectors ??= await import('./vectors.js');
    if (number === this.#shows) this.#apply(checked); // else a later one came before the bytes
  }

  /** The next pictures leave nothing out. */
  forget() {
    this.#sampleOf = this.#surfaceOf = this.#volumeOf = this.#raysOf = this.#vectorsOf = this.#outlineOf = '';
  }

  #apply(spec) {
    const before = this.#spec;
    this.#spec = spec;
    if (!before) this.#sampleOf = '';
    if (!before?.surface) this.#surfaceOf = '';
    if (!before?.volume) this.#volumeOf = '';
    if (!before?.rays) this.#raysOf = '';
    if (!before?.vectors) this.#vectorsOf = '';
    if (!spec?.refine) this.#refiner = null;
    this.#unrefinable = '';
    this.#dirty = true;
    this.#follow(); // other places are seen
    this.#wake();
  }

  /**
   * Pictures as they are at rest, of the finest level of at most so many tetrahedra, without volume and vectors; null
   * where nothing coarser than what is shown is there, or a step in time is shown.
   */
  draft(tets) {
    this.#draft?.resolve(null);
    return new Promise((resolve) => {
      this.#draft = { tets, resolve };
      this.#wake();
    });
  }

  /** From now on pages are those that a view needs, beyond levels that have none; null: no more than the level's. */
  look(look) {
    this.#look = look;
    this.#follow();
    this.#wake();
  }

  seen() {
    this.#seen?.();
  }

  // The page ends the stream, and with it all that waits.
  #break(error) {
    this.#emit('broken', { message: `the decoder stopped: ${error.message}; open the stream again` });
    this.close();
  }

  close() {
    this.#stop.abort(aborted());
    this.#source?.close();
    this.#leavePages();
    this.#endRequest('reject', aborted());
    this.#wake();
  }

  // ---- waiting

  #wake() {
    for (const ring of this.#bells.splice(0)) ring();
  }

  #change() {
    return new Promise((resolve) => this.#bells.push(resolve));
  }

  get #closed() {
    return this.#stop.signal.aborted;
  }

  #endRequest(how, value) {
    const request = this.#request;
    this.#request = null;
    request?.[how](value);
  }

  #failAt(level) {
    throw new RangeError(`level ${level} cannot be decoded: ${this.#failure.message}`);
  }

  // ---- bytes

  // One more piece of the stream; true once the index is there.
  async #receive(until, reading = this.#source.read(this.#received, until)) {
    const bytes = await reading;
    if (!bytes.length) return false; // paused
    const opened = this.#view.add(bytes);
    this.#received += bytes.length;
    this.#emit('progress', { received: this.#received, total: Math.max(until, this.#received) });
    return opened;
  }

  // What is under way and no longer needed ends at once.
  #aim(level) {
    this.#goal = level;
    if (this.#received >= this.#untilGoal) this.#source.pause();
  }

  get #untilGoal() {
    return this.#info.levels[Math.max(this.#goal, this.#boxLevel, 0)].bytes;
  }

  async #fetchLoop() {
    while (!this.#closed) {
      const until = this.#untilGoal;
      if (this.#received >= until || this.#failure) {
        this.#source.pause();
        await this.#change();
        continue;
      }
      try {
        await this.#receive(until);
        this.#wake();
      } catch (error) {
        this.#fail(error);
      }
    }
  }

  // What is decoded stays; the request ends when everything before the failure is shown.
  #fail(error) {
    if (this.#closed) return;
    this.#failure = error;
    this.#emit('error', { message: error.message });
    this.#wake();
  }

  // ---- steps in time

  // The table of steps, when what was asked for first is there.
  async #openSeries() {
    const [offset, size] = this.#info.time;
    while (!this.#closed && !this.#failure && this.#received < this.#untilGoal) await this.#change();
    const bytes = await this.#source.apart(offset, size);
    this.#view.put(offset, bytes);
    const series = this.#view.series(this.#fields);
    this.#view.forget();
    this.#groups = new Groups((...wanted) => this.#readGroup(series, ...wanted), (band, error) => {
      if (error && band === this.#time?.band) this.#fail(error);
      if (this.#time)
        this.#emit('buffered',
          { band: this.#time.band, groups: this.#groups.of(this.#time.band), received: this.#groups.received });
      this.#wake();
    });
    this.#emit('series', series);
    return series;
  }

  // Of the fields that are decoded, and the one that moves the points, each by an address of its own, which caches
  // keep.
  #readGroup({ fields, group: size, displacement }, band, group, signal) {
    const wanted = fields.map(({ name }, i) => ({ name, ...this.#view.span(i, band, group * size) }))
                     .filter(({ name }) => !this.#fields || name === displacement
                         || this.#fields.some((f) => this.#base.fields[f].name === name));
    const addressOf = (name) => (routes) => canList([name])
      && routes.group?.replace('{band}', band).replace('{group}', group).concat('?', query({ fields: name }));
    return Promise.all(wanted.map(async ({ name, offset, size: length }) => ({
      offset,
      bytes: length ? await this.#source.apart(offset, length, { addressOf: addressOf(name), signal })
                    : new Uint8Array()
    })));
  }

  #leaveSteps() {
    if (!this.#time) return;
    this.#time = this.#at = null;
    this.#info = this.#base;
    if (this.#moved >= 0) this.#view.rest();
    this.#moved = -1;
    this.#view.seek(this.#shown); // the level's own values
    this.#sampleOf = this.#volumeOf = this.#vectorsOf = '';
    this.#dirty = true;
  }

  // The group of a step and those after it, from the first again behind the last.
  #groupsFrom(step, { group, times }) {
    const count = Math.ceil(times.length / group);
    return [...new Set(Array.from({ length: 1 + ahead }, (_, i) => (Math.floor(step / group) + i) % count))];
  }

  async #showStep(series) {
    if (!this.#time) return; // since a moment ago
    const { band, step } = this.#time;
    const { level } = series.bands[band];
    const change = this.#change();
    const pieces = this.#failure ? null : this.#groups.take(band, this.#groupsFrom(step, series));
    if (this.#at?.band === band && this.#at.step === step) return this.#dirty ? this.#present(1) : this.#settle();
    if (pieces && level <= Math.min(this.#view.ready, this.#limit)) return this.#goToStep(series, pieces);
    if (this.#dirty) return this.#present(1);
    if (this.#request && this.#failure) this.#endRequest('reject', this.#failure);
    return change;
  }

  // Within a band, values may pass into those of the next step: each moment is as near to the moment between the
  // original's steps.
  async #goToStep({ bands, times, fields }, pieces) {
    const { band, step, blend } = this.#time;
    const { level, error } = bands[band];
    const moves = blend > 0 && this.#at?.band === band && Boolean(this.#spec?.morph) && 3 * this.#frameTime < blend;
    const started = performance.now();
    try {
      for (const { offset, bytes } of pieces) this.#view.put(offset, bytes);
      this.#view.step(band, step, moves);
    } catch (problem) {
      this.#leaveSteps();
      throw problem;
    } finally {
      this.#view.forget();
    }
    const seconds = (performance.now() - started) / 1000;
    const fresh = this.#shown !== level;
    await this.#goToCells(step);
    this.#at = { band, step };
    this.#moved = moves ? level : -1;
    this.#shown = this.#coarser = level;
    if (fresh) this.#announce(level);
    const errors = Object.fromEntries(fields.map(({ name }, i) => [name, this.#view.stepError(i, band, step)]));
    this.#emit('step', { step, band, error, errors, level, time: times[step], groups: this.#groups.of(band), seconds });
    if (moves) await this.#animate(0, 1, blend);
    if (this.#at?.step === step) await this.#present(1);
  }

  // ---- values of cells

  #cellIndex(name) {
    const { cellFields } = this.#info;
    const index = cellFields.findIndex((field) => field.name === name);
    if (index < 0)
      throw new RangeError(
        `there are no values of cells '${name}'; there are: ${cellFields.map((f) => f.name).join(', ') || 'none'}`);
    return index;
  }

  // They lie behind the levels; each comes once, when it is first needed.
  #loadCells(field) {
    if (!this.#cells.has(field)) {
      this.#cells.set(field, this.#readCells(field));
      this.#cells.get(field).catch(() => this.#cells.delete(field)); // a network may come back
    }
    return this.#cells.get(field);
  }

  async #readCells(field) {
    const { name, components, type, place: [offset, size], map } = this.#base.cellFields[field];
    if (map) this.#cellMap ||= await this.#source.apart(...map);
    this.#cellBytes.set(field, await this.#source.apart(offset, size));
    await this.#stepCells(field, this.#cellsAt);
    if (!this.#base.time) this.#cellBytes.delete(field); // there is no other step
    const whole = components === 1 && type.startsWith('int');
    this.#emit('cells',
      { field: name, bytes: size, regions: whole ? countRegions(this.#view.cells(field, this.#info.tets)) : null });
  }

  // Values of cells become those of a step.
  async #stepCells(field, step) {
    const { place: [own], map } = this.#base.cellFields[field], { offset, size } = this.#view.cellsSpan(field, step);
    const group = size && await this.#source.apart(offset, size).catch(() => 0);
    if (step !== this.#cellsAt) return; // it went on meanwhile
    this.#view.put(own, this.#cellBytes.get(field));
    if (map) this.#view.put(map[0], this.#cellMap);
    if (group) this.#view.put(offset, group);
    try {
      this.#view.loadCells(field, step);
    } finally {
      this.#view.forget();
    }
  }

  // What is not known, or does not come, has no colour.
  async #goToCells(step) {
    if (step === this.#cellsAt) return;
    this.#cellsAt = step;
    const tell = ({ message }) => this.#emit('error', { message });
    for (const field of this.#cellBytes.keys()) await this.#stepCells(field, step).catch(tell);
    this.#dirty = true;
  }

  // ---- levels

  // The level that can be shown now on the way to the goal.
  get #within() {
    return this.#goal < 0 ? 0 : Math.min(this.#goal, this.#view.ready, this.#limit);
  }

  async #showLoop() {
    while (!this.#closed) {
      try {
        if (this.#finer && this.#finer.key !== this.#boxesWanted) this.#leaveBoxes();
        if (this.#time) {
          await this.#showStep(await this.#series);
          continue;
        }
        await this.#goToCells(0); // after the steps
        const next = this.#within;
        if (next > this.#shown) await this.#refine();
        else if (next < this.#shown) await this.#coarsen(next);
        else if (this.#dirty) await this.#present(1);
        else if (this.#canRefine) await this.#refineInBoxes();
        else if (this.#offered && this.#isPaged && this.#shown === this.#coarse) await this.#adoptPages();
        else if (this.#draft) this.#makeDraft();
        else await this.#settle();
      } catch (error) {
        // No memory for a picture, most likely: the level before may have room for it, and a later request may try
        // again.
        this.#emit('error', { message: error.message });
        this.#aim(this.#shown = this.#view.level);
        this.#dirty = false;
        this.#endRequest('reject', error);
      }
    }
  }

  // Damage that is only seen while decoding, or no memory: no finer level than this is tried again.
  #halt(error) {
    this.#limit = this.#view.level;
    this.#fail(error);
  }

  // Nothing is left to do at this level: the request may have ended; then wait.
  async #settle() {
    const level = this.#shown;
    if (this.#view.level !== level) this.#view.seek(level); // it went ahead to a goal that is given up
    const change = this.#change();
    if (this.#request && level === this.#goal) {
      this.#emit('finished', { level });
      this.#endRequest('resolve', { level, reached: true });
    } else if (this.#request && this.#failure) {
      this.#endRequest('reject', this.#failure);
    }
    await change;
  }

  #announce(level) {
    this.#shown = level;
    const { vertices, tets } = this.#info.levels[level];
    this.#emit('level', { level, vertices, tets, seconds: this.#decoding / 1000 });
    this.#decoding = 0;
  }

  // One level up, with the time that it took. False: not possible.
  #step() {
    const started = performance.now();
    try {
      this.#view.seek(this.#view.level + 1);
      const took = performance.now() - started;
      this.#decoding += took;
      this.#pace.decoded(took);
      return true;
    } catch (error) {
      this.#halt(error);
      return false;
    }
  }

  // More levels are here than are decoded.
  get #isBehind() {
    return !this.#time && this.#view.level < this.#within;
  }

  // Levels up: all that are here, or until a picture is due. After each one messages are heard: somebody may want
  // another picture or goal.
  async #refine() {
    const from = this.#shown;
    while (!this.#closed && !this.#dirty && this.#isBehind && this.#step()) {
      await this.#takeTurn();
      if (this.#pace.isDue(this.#info.levels[this.#view.level].tets)) break;
    }
    if (this.#closed || this.#time || (this.#view.level === from && !this.#dirty)) return;
    if (this.#view.level > this.#within) this.#view.seek(Math.max(from, this.#within));
    if (this.#view.level > from) this.#announce(this.#view.level);
    if (!this.#isBehind && this.#shown > from && this.#moves(from)) await this.#animate(0, 1);
    await this.#present(1);
  }

  async #coarsen(next) {
    const from = this.#shown;
    if (this.#view.level !== from) this.#view.seek(from);
    if (this.#moves(next)) await this.#animate(1, 0);
    const started = performance.now();
    this.#view.seek(next);
    this.#decoding += performance.now() - started;
    this.#announce(next);
    await this.#present(1);
  }

  // ---- finer in boxes, or where somebody looks

  // Their level, or the last one without pages; -1: neither is wanted, or it is not finer than the goal.
  get #boxLevel() {
    if (this.#isPaged) return this.#base.paged - 1;
    const level = this.#spec?.refine && !this.#time ? Math.min(this.#spec.refine.level, this.#limit) : -1;
    return level > this.#goal ? level : -1;
  }

  get #coarse() {
    return Math.max(this.#goal, 0);
  }

  get #isPaged() {
    const { paged } = this.#base;
    return this.#pagesWanted && !this.#time && this.#goal < (paged || -1) && paged <= this.#limit;
  }

  // What pages follow: a view, boxes with levels in pages, or both; null: nothing.
  get #pagesWanted() {
    const { refine } = this.#spec ?? {};
    const boxes = refine && this.#base.paged && refine.level >= this.#base.paged ? refine : null;
    return this.#look || boxes ? { ...this.#look, boxes } : null;
  }

  #follow() {
    const wanted = this.#pagesWanted;
    if (!wanted) this.#leavePages();
    this.#pager?.look(wanted);
  }

  // Which mesh is wanted in place of the goal's level; '': none.
  get #boxesWanted() {
    const level = this.#boxLevel;
    return level < 0 ? '' : JSON.stringify([this.#coarse, level, !this.#isPaged && this.#spec.refine.boxes]);
  }

  get #canRefine() {
    const key = this.#boxesWanted;
    const isNew = key && key !== this.#finer?.key && key !== this.#unrefinable;
    return isNew && this.#shown === this.#coarse && this.#view.ready >= this.#boxLevel;
  }

  // Decodes on its own, in turns, as long as that is wanted.
  async #refineInBoxes() {
    const key = this.#boxesWanted;
    try {
      await this.#series; // which goes back to the cursor's mesh
      const started = performance.now();
      const { Refiner, Pager, module } = this.#tools ??= await this.#refining();
      if (key !== this.#boxesWanted) return;
      if (this.#isPaged) {
        this.#unrefinable = key; // it is on its way
        this.#pager ??= await Pager.create(module, this.#hostOf());
        return this.#pager.look(this.#pagesWanted, true);
      }
      this.#refiner ??= new Refiner(module, this.#hostOf());
      const takeTurn = () => !this.#closed && key === this.#boxesWanted && this.#takeTurn();
      const made = await this.#refiner.make(...JSON.parse(key), takeTurn);
      if (!made || this.#shown !== this.#coarse) return;
      this.#adopt(key, made, { ...made.told, seconds: (performance.now() - started) / 1000 });
    } catch (error) {
      this.#unrefinable = key;
      this.#refiner = null;
      this.#emit('error', { message: `it cannot be refined there: ${error.message}` });
    }
  }

  // What they know of the stream.
  #hostOf() {
    return {
      bytes: () => this.#view.added, info: this.#base, fields: this.#fields,
      selected: this.#source.partial ? this.#source.fields : null,
      spec: () => this.#spec, moves: () => this.#canMove,
      apart: (offset, size, signal) => this.#source.apart(offset, size, { signal }),
      offer: (made, told) => new Promise((taken) => { this.#offered = { made, told, taken }; this.#wake(); }),
      fail: ({ message }) => this.#emit('error', { message: `pages are missing: ${message}` }),
    };
  }

  // Pages that leave move to the shape without them, those that are new move to their own, as levels do.
  async #adoptPages() {
    const { made, told, taken } = this.#offered;
    this.#offered = null;
    if (made?.leaves && this.#canMove && this.#finer) await this.#pass(made.leaves, 1, 0);
    if (made || this.#finer) this.#adopt(this.#boxesWanted, made, told);
    const moved = made?.from && this.#canMove ? this.#pass(made.from, 0, 1) : null;
    taken();
    await moved;
    if (moved) await this.#present(1);
  }

  get #canMove() {
    return Boolean(this.#spec?.morph) && this.#frameTime <= heavyFrame;
  }

  // The mesh of pages, between other places and its own.
  #pass(places, start, end) {
    this.#view.moveAdopted(places);
    this.#moved = this.#coarser = this.#shown;
    return this.#animate(start, end);
  }

  #adopt(key, made, told) {
    if (this.#view.level !== this.#shown) this.#view.seek(this.#shown);
    if (made) this.#view.adopt(made);
    if (made) this.#moved = -1;
    this.#finer = { key, told };
    this.#emit('refined', { level: this.#shown, ...told });
    if (made) this.forget(); // another mesh is shown at the same level
    this.#dirty = true;
  }

  #leavePages() {
    this.#pager?.close();
    this.#pager = this.#offered = null;
    this.#unrefinable = '';
  }

  #leaveBoxes() {
    this.#finer = null;
    this.#view.readopt(false);
    this.#unrefinable = '';
    this.forget();
    this.#dirty = true;
  }

  // ---- pictures

  #fieldIndex(name) {
    const index = this.#info.fields.findIndex((field) => field.name === name);
    if (index < 0)
      throw new RangeError(
        `there is no field '${name}'; there are: ${this.#info.fields.map((f) => f.name).join(', ')}`);
    if (this.#fields && !this.#fields.includes(index)) throw new RangeError(`the field '${name}' was not opened`);
    return index;
  }

  #component({ name, components }, component = 0) {
    if (component === 'magnitude') return -1;
    if (Number.isInteger(component) && component >= 0 && component < components) return component;
    throw new RangeError(
      `the field '${name}' has ${components} components; component is one of their numbers from 0, or 'magnitude'`);
  }

  // The spec with indices for names.
  #checkSpec({
    field,
    component,
    cellField,
    regions = null,
    surface = false,
    edges = false,
    slices = [],
    isosurfaces = [],
    threshold = null,
    clip = null,
    volume = null,
    vectors = null,
    rays = false,
    morph = true,
    tag = null,
    formula = null,
    warp = null,
    refine = null,
    box = null
  }) {
    const defined = formula && this.#checkFormula(formula);
    const shade = formula ? this.#info.fields.length : field === undefined ? -1 : this.#fieldIndex(field);
    const of = (name) => (name === undefined ? shade : this.#fieldIndex(name));
    if (shade < 0 &&
      [...isosurfaces, threshold].some((what) => what && what.field === undefined && what.cellField === undefined))
      throw new RangeError('an isosurface or threshold needs a field');
    if (volume && !(volume.size >= 2 && volume.size <= 512))
      throw new RangeError(`volume.size is from 2 to 512, not ${volume.size}`);
    const cellShade = cellField === undefined ? -1 : this.#cellIndex(cellField);
    const componentOf = (what) => what.component ?? (what.field === undefined && cellShade < 0 ? component : 0);
    const valueOf = (what) => {
      if (what.formula) return { field: shade, component: 0 };
      return {
        field: of(what.field),
        component: this.#component(this.#info.fields[of(what.field)], componentOf(what))
      };
    };
    const ofCells = ({ cellField: name, component: of = 0 }) => ({
      cells: true,
      field: this.#cellIndex(name),
      component: this.#component(this.#info.cellFields[this.#cellIndex(name)], of)
    });
    return {
      surface,
      edges,
      slices,
      clip,
      volume,
      rays,
      morph,
      tag,
      shade,
      cellShade,
      formula: defined,
      box: box && this.#checkBox(box),
      warp: warp && this.#checkWarp(warp),
      refine: refine && this.#checkRefine(refine),
      vectors: vectors && this.#checkVectors(vectors),
      regions: regions && this.#checkRegions(regions),
      component: shade < 0 || formula ? 0 : this.#component(this.#info.fields[shade], cellShade < 0 ? component : 0),
      cellComponent: cellShade < 0 ? 0 : this.#component(this.#info.cellFields[cellShade], component),
      threshold: threshold && {
        low: -Infinity,
        high: Infinity,
        ...threshold,
        ...(threshold.cellField === undefined ? { cells: false, ...valueOf(threshold) } : ofCells(threshold))
      },
      isosurfaces: isosurfaces.map((iso) => ({ ...valueOf(iso), value: iso.value, zone: Boolean(iso.zone) })),
    };
  }

  #checkWarp({ field: name, scale = 1, outline = false }) {
    const field = this.#fieldIndex(name);
    const { components } = this.#info.fields[field];
    if (components !== 3)
      throw new RangeError(`the field '${name}' has ${components} components, points are moved by 3`);
    if (!Number.isFinite(scale)) throw new RangeError(`warp.scale is a number, not ${scale}`);
    return { by: { field, scale }, outline };
  }

  #checkBox(box) {
    if (!isBox(box)) throw new RangeError('a box is six numbers, the least corner first');
    return box;
  }

  #checkRefine({ boxes, target = {} }) {
    if (!(boxes.length >= 1 && boxes.length <= 16 && boxes.every(isBox)))
      throw new RangeError('refine.boxes are 1 to 16 boxes of six numbers each, the least corner first');
    return { boxes, level: chooseLevel(this.#base, target) };
  }

  // With the fields' numbers; the module refuses what is no function.
  #checkFormula({ inputs, program, text }) {
    return { inputs: inputs.map(([name, component]) => [this.#fieldIndex(name), component]), program, text };
  }

  #checkRegions({ field: name, hidden = [] }) {
    const field = this.#cellIndex(name);
    const { components, type } = this.#info.cellFields[field];
    if (components !== 1 || !type.startsWith('int'))
      throw new RangeError(`the values of cells '${name}' are not whole numbers of one component, as regions are`);
    return { field, hidden: hidden.map(Number) };
  }

  #checkVectors({ field: name, kind = 'arrows', count = 300, size = 1, places = null }) {
    const field = this.#fieldIndex(name);
    if (this.#info.fields[field].components !== 3)
      throw new RangeError(`the field '${name}' has ${this.#info.fields[field].components} components, vectors have 3`);
    if (!['arrows', 'streamlines'].includes(kind))
      throw new RangeError(`vectors.kind is arrows or streamlines, not '${kind}'`);
    if (!(Number.isInteger(count) && count >= 1 && count <= 10000))
      throw new RangeError(`vectors.count is a whole number from 1 to 10000, not ${count}`);
    if (!(size > 0 && size <= 100)) throw new RangeError(`vectors.size is from 0 to 100, not ${size}`);
    return { field, kind, count, size, places: places?.slice(0, 10000) ?? null };
  }

  // Prepares a move to or from a coarser level, if it would be seen: something is drawn, and quickly.
  #moves(coarser) {
    if (!this.#canMove) return false;
    try {
      this.#view.move(coarser);
      this.#moved = this.#view.level;
      this.#coarser = coarser;
    } catch {
      return false; // no memory for it: then a jump
    }
    return true;
  }

  async #animate(start, end, time = moveTime) {
    const began = performance.now() - this.#frameTime; // the first frame is seen when it is made
    for (;;) {
      const passed = (performance.now() - began) / time;
      if (passed >= 1) break;
      await this.#present(start + passed * (end - start));
      if (this.#closed) return;
    }
    if (!end) await this.#present(0);
  }

  #drawSurface() {
    const { surface, clip, threshold, regions, box, cellShade, edges: lines } = this.#spec;
    if (!surface) return null;
    // a clipped one has other triangles each time
    const what = [this.#shown, (threshold || box) && this.#at, lines, threshold, regions, box, cellShade < 0];
    const key = clip || (box && this.#moved >= 0) ? '' : JSON.stringify(what);
    const keep = key && key === this.#surfaceOf;
    this.#surfaceOf = key;
    return this.#view.surface({ lines, keep });
  }

  // The vectors whose length colours; null: what colours is linear.
  get #lengthOf() {
    const { shade, component, cellShade } = this.#spec;
    return cellShade < 0 && shade >= 0 && component < 0 && !this.#spec.formula
      ? { field: shade, components: this.#info.fields[shade].components }
      : null;
  }

  #drawRays() {
    const { rays, threshold, regions, box } = this.#spec;
    if (!rays) return null;
    const what = [this.#shown, (threshold || box) && this.#at, threshold, regions, box];
    const key = box && this.#moved >= 0 ? '' : JSON.stringify(what);
    const keep = key && key === this.#raysOf;
    this.#raysOf = key;
    return this.#view.rays({ keep, lengthOf: this.#lengthOf });
  }

  // Returns the range.
  // Which tetrahedra are drawn.
  #filter() {
    if (this.#spec?.formula) this.#view.define(this.#spec.formula);
    this.#view.filter(this.#spec?.threshold, this.#spec?.regions, this.#spec?.box);
  }

  #colour() {
    const { shade, component, cellShade, cellComponent } = this.#spec;
    return cellShade < 0 ? this.#view.shade(shade, component) : this.#view.shadeCells(cellShade, cellComponent);
  }

  // The value that colours; with a sample where it is of another mesh or value than the last one.
  #drawShade(t) {
    const { shade, component, cellShade, cellComponent } = this.#spec;
    const range = this.#colour();
    if (shade < 0 && cellShade < 0) return null;
    const cells = cellShade >= 0;
    const { name } =
      cells ? this.#info.cellFields[cellShade] : this.#info.fields[shade] ?? { name: this.#spec.formula.text };
    const of = cells ? cellComponent : component;
    const key = JSON.stringify([this.#shown, cells || this.#at, cells, name, of]);
    const fresh = t === 1 && key !== this.#sampleOf;
    if (fresh) this.#sampleOf = key;
    return {
      field: name,
      cells,
      component: of < 0 ? 'magnitude' : of,
      formula: Boolean(this.#spec.formula) && !cells,
      range,
      sample: fresh ? this.#view.sample() : undefined
    };
  }

  #draw(t) {
    const { edges: lines, slices, isosurfaces, clip } = this.#spec;
    this.#view.clip(clip);
    this.#filter();
    return {
      shade: this.#drawShade(t),
      surface: this.#drawSurface(),
      rays: this.#drawRays(),
      slices: slices.map(({ origin, normal }) => this.#view.slice(origin, normal, { lines })),
      isosurfaces:
        isosurfaces.map((iso) => this.#view.isosurface(iso.field, iso.component, iso.value, { normals: true })),
      zones: isosurfaces.map((iso) => (iso.zone ? this.#drawZone(iso, t) : null)),
      finer: this.#finer && this.#tools.drawFiner(this.#view, this.#finer.told, this.#spec),
    };
  }

  // Where the original's isosurface is: no farther in value than the bound, which goes from one level's to the other's
  // in a move.
  #drawZone({ field, component, value }, t) {
    if (this.#spec.formula && field === this.#info.fields.length) return null; // nothing is proved of it
    const at = (level) =>
      boundOf(this.#info, level, this.#info.fields[field].name, component < 0 ? 'magnitude' : component);
    const { bound: fine, certified } = at(this.#shown);
    const bound = t < 1 ? fine + (1 - t) * (at(this.#coarser).bound - fine) : fine;
    let near = true;
    const sides = [-bound, bound].map((shift) => {
      const side = this.#view.isosurface(field, component, value + shift, { normals: true, margin: shift > 0 });
      near &&= this.#view.isNear;
      return side;
    });
    return { bound, certified: certified && near && !(this.#finer && !this.#finer.told.pages), sides };
  }

  // A grid takes too long to be made while the mesh moves: undefined then and where it is the same, null where none is
  // wanted.
  #drawVolume(t) {
    const { volume, shade, component, cellShade, cellComponent, threshold, regions, box, clip } = this.#spec;
    if (!volume) return null;
    const what =
      [volume.size, volume.logarithmic, shade, component, cellShade, cellComponent, threshold, regions, box, clip];
    const key = JSON.stringify([this.#shown, this.#at, ...what]);
    if (t < 1 || key === this.#volumeOf) return undefined;
    this.#volumeOf = key;
    return this.#view.resample(volume.size, volume.logarithmic);
  }

  // As with the grid: at rest, and where it is not the same.
  #drawVectors(t) {
    const { vectors, shade, component, cellShade, cellComponent, threshold, regions, box, clip } = this.#spec;
    if (!vectors) return null;
    const filters = [threshold, regions, box, clip];
    const key = JSON.stringify([this.#shown, this.#at, vectors, shade, component, cellShade, cellComponent, filters]);
    if (t < 1 || key === this.#vectorsOf) return undefined;
    this.#vectorsOf = key;
    const [low, high] = this.#info.bounds;
    const { centre } = this.#view; // places are relative to it
    const plane = clip && { ...clip, origin: clip.origin.map((c, i) => c - centre[i]) };
    const places = vectors.places?.map((place) => place.map((c, i) => c - centre[i]));
    const { Flow, drawVectors } = this.#vectors;
    const flow = new Flow(this.#view.flow(vectors.field, this.#lengthOf));
    return drawVectors(flow, { ...vectors, places }, Math.hypot(...high.map((h, i) => h - low[i])), plane);
  }

  // Makes the pictures at t of a move (1: at rest) and waits until they are seen.
  async #present(t) {
    this.#dirty = false;
    if (!this.#spec) return this.#pace.drew(0, 1);
    const started = performance.now();
    this.#warp();
    if (this.#moved === this.#shown) this.#view.place(t);
    else this.#rest();
    const parts = this.#draw(t);
    this.#frameTime = performance.now() - started;
    const volume = this.#drawVolume(t);
    const vectors = this.#drawVectors(t);
    const outline = this.#drawOutline(t);
    const seconds = (performance.now() - started) / 1000;
    const seen = new Promise((resolve) => { this.#seen = resolve; });
    this.#pace.drew(performance.now() - started, this.#info.levels[this.#shown].tets);
    this.#emit('pictures', {
      tag: this.#spec.tag,
      level: this.#shown,
      step: this.#at?.step ?? null,
      t,
      origin: this.#view.centre,
      ...parts,
      volume,
      vectors,
      outline,
      seconds
    });
    await this.#workUntil(seen);
  }

  // The cursor goes to a coarser level and back: what the page has of pictures stays known.
  #makeDraft() {
    const { tets, resolve } = this.#draft;
    const fine = this.#shown;
    const level = this.#info.levels.findLastIndex((l, k) => k < fine && l.tets <= tets);
    this.#draft = null;
    if (level < 0 || !this.#spec) return resolve(null);
    const known = [this.#sampleOf, this.#surfaceOf, this.#raysOf];
    this.#rest();
    try {
      this.#surfaceOf = '';
      this.#view.seek(level);
      this.#shown = level;
      const { shade, surface, slices, isosurfaces, zones } = this.#draw(1);
      resolve({ level, origin: this.#view.centre, shade, surface, slices, isosurfaces, zones });
    } finally {
      [this.#sampleOf, this.#surfaceOf, this.#raysOf] = known;
      this.#view.seek(this.#shown = fine);
      if (this.#finer) this.#view.readopt(true);
    }
  }

  // Points are moved as the pictures want it; that ends a move between levels.
  #warp() {
    if (!this.#view.warp(this.#spec.warp?.by ?? null)) return;
    this.#moved = -1;
    this.#volumeOf = this.#vectorsOf = '';
    if (this.#spec.box) this.#surfaceOf = this.#raysOf = ''; // it cuts elsewhere
  }

  // The boundary as it is without being moved: at rest, and where it is not the same.
  #drawOutline(t) {
    const { warp } = this.#spec;
    if (!warp?.outline) {
      this.#outlineOf = '';
      return null;
    }
    const key = JSON.stringify([this.#shown, this.#at]);
    if (t < 1 || key === this.#outlineOf) return undefined;
    this.#outlineOf = key;
    this.#view.clip(null);
    this.#view.filter(null, null);
    this.#view.warp(null);
    const part = this.#view.surface({});
    this.#view.warp(warp.by);
    return part;
  }

  // Shows the cursor's own mesh, at the level that is shown.
  #rest() {
    if (this.#moved >= 0) this.#view.rest();
    this.#moved = -1;
    if (this.#view.level !== this.#shown) this.#view.seek(this.#shown);
  }

  // Decodes on towards the goal until the page has seen the last pictures.
  async #workUntil(seen) {
    let waiting = true;
    const patient = new AbortController();
    Promise.race([seen, sleep(patience, patient.signal)]).catch(() => {}).finally(() => {
      waiting = false;
      this.#wake();
    });
    while (waiting && !this.#closed) {
      if (!this.#time && this.#within > this.#view.level && this.#step()) await this.#takeTurn();
      else if (waiting) await this.#change();
    }
    patient.abort();
  }

  // Lets messages in. Timers would wait for milliseconds.
  #takeTurn() {
    return new Promise((resolve) => {
      this.#turn.port1.onmessage = resolve;
      this.#turn.port2.postMessage(null);
    });
  }
}
