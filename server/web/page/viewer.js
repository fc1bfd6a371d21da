// SPDX-License-Identifier: BSD-3-Clause
// A stream in a picture: state, stream and scene kept in step. The page puts its panel around it, the element
// <tetlod-view> nothing.

import { firstField } from '../client/choose.js';
import { TetlodStream } from '../client/stream.js';
import { chooseBand, infoOfSteps } from '../client/steps.js';
import { coalesced } from './dom.js';
import { autoRange, firstView, mapOf } from './first_view.js';
import {
  colouredOf,
  fieldOf,
  formulaNamed,
  formulaText,
  isosurfacesOf,
  regionFields,
  shownFields,
  targetFieldOf,
  titleOf,
  titleWithUnit,
  unitsOf,
  useFormulas,
  wantedLevel,
} from './levels.js';
import { drawScalarBar } from './scalarbar.js';
import { isosurfaceRange, specOf, targetOf } from './spec.js';
import { Store, defaults, fromFragment, toFragment } from './state.js';

const workerPatience = 50; // milliseconds
const stepPatience = 5000; // until somebody is asked
const muchTets = 500_000;  // that it is worth giving back
const stillness = globalThis.matchMedia?.('(prefers-reduced-motion: reduce)');

// A link may name a field that this stream does not have.
function valid(state, info) {
  const known = {
    ...state,
    errorField: fieldOf(info, state.errorField) ? state.errorField : '',
    cells: info.cellFields.some(({ name }) => name === state.cells) ? state.cells : '',
    regions: regionFields(info).includes(state.regions) ? state.regions : '',
  };
  return fieldOf(info, state.field) ? known : { ...known, field: firstField(info.fields).name };
}

export class Viewer extends EventTarget {
  base = defaults; // what a fragment leaves out
  stream = null;
  info = null;
  scene = null;
  level = -1;      // the stream's
  series = null;   // of a series in time: its steps and bands
  at = null;       // the step that is shown: { step, band, error, time }; null: a level
  playing = false; // the player says which step is shown
  shade = null;    // { field, cells, component, range, sample } of the picture's colours
  finer = null;    // { boxLevel, outside, inside, between, edges } where the picture is finer in boxes
  outline = null;  // the part of the picture that is not moved, if it was asked for
  regions = new Map(); // of fields of cells that are here: [{ number, tets }], or null if their numbers are no regions'
  #index = null;   // the stream's info; `info` is that of the steps while one is shown
  #parts; #fragment; #pictured; #tellPictured;
  #lengths = null; // lengths.js, from the first spec on in which a length colours
  #categories = null; // {of}, from categories.js, or a promise of it
  #formulas = false; // formula.js is loaded, or being loaded
  #closing = new AbortController();
  #asked = 0;      // changes of what the worker is to make
  #spec = '';      // what it was asked to make last
  #told = null; #toldAt = null; // the step that the errors are told of
  #early = null;   // pictures that came before there was where to draw them
  #most = 0;       // tetrahedra of the finest level since memory was given back
  beside = null;   // the second view: { picture(size), showStep(step), curtain }
  subtracting = null; // a promise of pictures that a difference is made of
  looking = null;  // the number of the view that pages follow (look_here.js)
  difference = null; // of another stream, that is subtracted from the pictures (difference.js)
  #failedToSubtract;
  #whole = false;  // the next pictures are to leave nothing out
  #subtracting = 0; // pictures that a difference was asked of
  #drawn = -1;     // the picture's level, when it has come to rest and is what was asked for

  /**
   * `parts`: the elements { stage, picture, bar }: what has the background, what the picture is drawn in, the scalar
   * bar's canvas; `below()`: pixels that the player of a series takes above that. `fragment`: the state at first.
   * Events: 'retry', 'loading', 'progress', 'level', 'pictures', 'error', 'series', 'step', 'buffered', 'cells' and
   * 'fetched' as of the stream; 'colors' and 'info' when they changed, 'fieldsloading' and 'fieldsloaded' {fields},
   * 'stalled' {step, retry} and 'resumed', 'failed' {message, retry}.
   */
  constructor(parts, fragment) {
    super();
    this.#parts = parts;
    this.#fragment = fragment;
    this.store = new Store(fromFragment(fragment));
    this.#pictured = new Promise((resolve) => { this.#tellPictured = resolve; });
    this.recolor = coalesced(() => this.recolorNow());
    this.drawBar = coalesced(() => this.drawBarNow());
    this.show = coalesced(() => this.#show());
    this.refine = coalesced(() => this.#refine());
  }

  /**
   * Resolves when the first picture is on the screen. It is made while vtk.js and the graphics start, which takes
   * longest. Making the graphics' context stops this thread, and with it a worker that is not running yet: one that is
   * about to is waited for, a slow one is not.
   */
  async open(source) {
    const { signal } = this.#closing;
    const code = import('./scene.js');
    let opened;
    const running = new Promise((resolve) => { opened = this.#openStream(source, resolve); });
    const patience = code.then(() => new Promise((resolve) => setTimeout(resolve, workerPatience)));
    await Promise.race([running, opened, patience]);
    await Promise.all([opened, code.then((module) => this.#openScene(module))]);
    signal.throwIfAborted();
    const { state } = this.store;
    this.scene.setBounds(this.info.bounds, state.parallel, this.info.time ? this.#parts.below?.() : 0);
    if (state.camera) this.scene.setCamera(state.camera);
    if (this.#early) this.#takePictures(this.#early);
    await this.#pictured;
  }

  /** From now on changes of the state are followed. */
  follow() {
    const { store, scene } = this;
    store.watch(
      ['map', 'cells', 'formula', 'reversed', 'range', 'low', 'high', 'log', 'isosurfaces', 'isosurfaceField'],
      this.recolor);
    store.watch(['log'], (state) => scene.setLogarithmic(state.log));
    store.watch(
      [
        'field', 'component', 'formula', 'cells', 'regions', 'hidden', 'surface', 'edges', 'sliceEdges', 'slices',
        'isosurfaces', 'isosurfaceField', 'zone', 'threshold', 'clip', 'box', 'vectors', 'vectorField', 'vectorCount',
        'vectorSize', 'seeds', 'volume', 'volumeSize', 'warp', 'warpScale', 'outline', 'log', 'smooth', 'refine'
      ],
      () => this.#remake());
    store.watch(['measure', 'errorField'], ({ refine }) => refine && this.#remake());
    store.watch(['line'], ({ seeds, vectors }) => seeds === 'line' && vectors !== 'off' && this.#remake());
    store.watch(['pins', 'line'], () => this.#missing.length && this.show()); // they tell the local bound
    store.watch(['error', 'measure', 'field', 'errorField', 'maxTets', 'maxBytes', 'pixels', 'step'], this.refine);
    store.watch(['shading', 'surface', 'edges', 'sliceEdges', 'parallel', 'opacity', 'isosurfaceOpacity'],
                (state) => scene.restyle(state));
    store.watch(['units'], () => this.#takeUnits());
    store.watch(['background'], () => this.repaint());
  }

  get settled() {
    const { step } = this.store.state;
    const level = this.#inTime ? this.series.bands[this.wantedBand].level : wantedLevel(this.info, this.store.state);
    if (this.looking && !this.#inTime && this.finer?.look !== this.looking) return false;
    return this.level === level && this.#drawn === this.level && (!this.#inTime ||
                                                                  (this.at?.step === step &&
                                                                   this.at.band === this.wantedBand));
  }

  /**
   * The index with the errors of what is shown: at a step that stays they are the step's own, which the band's promise
   * covers.
   */
  get told() {
    if (!this.at && this.finer) return { ...this.info, finer: this.finer };
    if (!this.at || this.playing) return this.info;
    if (this.#toldAt !== this.at) this.#told = infoOfSteps(this.#index, this.series, this.at.band, this.at.errors);
    this.#toldAt = this.at;
    return this.#told;
  }

  get #inTime() {
    return this.series !== null && this.store.state.step !== null;
  }

  /** The band that the state asks for, of a level within its budgets. */
  get wantedBand() {
    return chooseBand(this.series, this.store.state.error, wantedLevel(this.info, { ...this.store.state, error: 0 }));
  }

  /**
   * Shows a step in a band; false: another one is shown instead. Of one that does not come 'stalled' tells, and
   * 'resumed' when that is over.
   */
  async showStep(step, options) {
    for (;;) {
      const again = new AbortController();
      const waiting = setTimeout(() => this.#tell('stalled', { step, retry: () => again.abort() }), stepPatience);
      try {
        return (await this.stream.seekStep(step, options, { signal: again.signal })).reached;
      } catch (error) {
        if (again.signal.aborted) continue;
        if (error.name !== 'AbortError') this.#tell('failed', { message: error.message, retry: this.refine });
        return false;
      } finally {
        clearTimeout(waiting);
        this.#tell('resumed');
      }
    }
  }

  /** From now on pictures show how they differ from another stream's; null: they do not. `failed(error)` */
  subtract(difference, failed) {
    this.difference?.close();
    this.difference = difference;
    this.#failedToSubtract = failed;
    this.shade = null;
    this.#whole = true;
    this.#remake();
  }

  /** What colours. */
  get title() {
    return titleOf(this.info, this.coloredState) + (this.difference ? ` − ${this.store.state.other}’s` : '');
  }

  /** The state as a link holds it, and back. */
  get fragment() {
    return toFragment(this.store.state, this.base);
  }

  set fragment(text) {
    this.store.set(valid(fromFragment(text, this.base), this.info));
    if (this.store.state.camera) this.scene.setCamera(this.store.state.camera);
  }

  /** Also of one that is opening, which then rejects: neither a worker nor a graphics' context is left. */
  close() {
    this.#closing.abort();
    this.difference?.close();
    this.stream?.close();
    this.scene?.close();
  }

  // ---- opening

  #open(source, options, started) {
    const pass = (event) => this.#tell(event.type, event.detail);
    const loading = ({ detail }) => this.#tell('loading', detail);
    return TetlodStream.open(
      source, { ...options, signal: this.#closing.signal, on: { retry: pass, progress: loading, started } });
  }

  // The target goes with the first request, so that its bytes come at once; a link may ask for a measure or a field
  // that is not there.
  async #openStream(source, started) {
    const { field, isosurfaceField, vectorField, warp } = this.store.state;
    const fields =
      field ? [...new Set([field, isosurfaceField || field, vectorField || field, warp || field])] : 'first';
    this.stream = await this.#open(source, { target: targetOf(this.store.state), fields }, started)
      .catch((error) => (error instanceof RangeError ? this.#open(source, { fields: 'first' },
                                                                  started) : Promise.reject(error)));
    if (this.#closing.signal.aborted) this.stream.close(); // while the answer was on its way
    this.#closing.signal.throwIfAborted();
    this.info = this.#index = this.stream.info;
    if (!this.info.fields.length) throw new Error('this stream has no fields to colour it by');
    this.base = { ...defaults, ...firstView(this.info) };
    this.store.state = valid(fromFragment(this.#fragment, this.base), this.info);
    this.#takeUnits();
    this.#hear();
    if (!this.#missing.length) return this.#showNow();
    this.#showNow(
      { ...this.store.state, isosurfaces: [], vectors: 'off', warp: '' }); // what there is, until the others are here
    this.#remake();
  }

  #openScene({ Scene }) {
    this.#closing.signal.throwIfAborted();
    try {
      this.scene = new Scene(this.#parts.picture);
      this.scene.view.get3DContext();
    } catch (error) {
      throw document.createElement('canvas').getContext('webgl2')
        ? error
        : new Error('this browser has no WebGL 2, which draws the picture');
    }
    performance.mark('tetlod-graphics');
    this.scene.addEventListener('norays', () => this.store.set({ volumeSize: 96 })); // a grid is less sharp
    this.#setBackground();
  }

  #tell(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }

  #hear() {
    this.stream.addEventListener('progress', ({ detail }) => this.#tell('progress', detail));
    this.stream.addEventListener('level', ({ detail }) => {
      this.level = detail.level;
      this.#tell('level', detail);
    });
    this.stream.addEventListener('fetched', () => this.#tell('fetched'));
    this.stream.addEventListener('series', ({ detail }) => {
      this.series = detail;
      this.#tell('series', detail);
      if (this.#inTime) this.refine();
    });
    this.stream.addEventListener('topology', ({ detail }) => {
      this.info = this.#index = detail.info;
      this.#takeUnits();
      this.series = this.stream.series;
      this.at = null;
    });
    this.stream.addEventListener('step', ({ detail }) => this.#arrive(detail));
    this.stream.addEventListener('cells', ({ detail }) => {
      this.regions.set(detail.field, detail.regions);
      this.#tell('cells', detail);
    });
    this.stream.addEventListener('buffered', ({ detail }) => this.#tell('buffered', detail));
    this.stream.addEventListener('pictures', (event) => this.#takePictures(event));
    this.stream.addEventListener('error', ({ detail }) => this.#tell('failed', { ...detail, retry: this.refine }));
  }

  // At a step: ranges and errors are those of the series.
  #arrive(at) {
    const before = this.at;
    this.at = at;
    if (before?.band !== at.band) this.#takeInfo(infoOfSteps(this.#index, this.series, at.band));
    this.level = at.level;
    this.#tell('step', at);
  }

  // What somebody typed goes before what the file says.
  #takeUnits() {
    for (const info of [this.#index, this.info, this.#told]) if (info) info.typedUnits = unitsOf(this.store.state);
    if (this.scene?.box) this.drawBar();
    this.#tell('info');
  }

  #leaveSteps() {
    if (!this.at) return;
    this.at = null;
    this.#takeInfo(this.#index);
  }

  // The state's fractions are of ranges and bounds, which may be others at steps.
  #takeInfo(info) {
    this.info = info;
    this.recolor();
    if (JSON.stringify(specOf(this.store.state, info)) !== this.#spec) this.#remake();
    this.#tell('info');
  }

  #remake() {
    this.#drawn = -1;
    this.#asked++;
    this.show();
  }

  // ---- colours and their range

  // What the picture is coloured by: until a field has come, the one before.
  get coloredState() {
    const { store: { state }, shade } = this;
    const text = colouredOf(this.info, state).formula?.text ?? null;
    const here = state.cells ? shade?.cells && shade.field === state.cells
      : this.stream.fields.includes(state.field) && text === (shade?.formula ? shade.field : null);
    if (!shade || here) return state;
    const { field, cells, component } = shade;
    if (shade.formula) return { ...state, formula: field };
    const shown = { ...state, formula: '', component };
    return cells ? { ...shown, cells: field } : { ...shown, cells: '', field };
  }

  // The index has one range for all components; that of one of them, or of their length, is the picture's.
  dataRange() {
    if (this.difference) return this.difference.range;
    const coloured = colouredOf(this.info, this.coloredState);
    const [low, high] = this.#rangeOf(coloured);
    const inTime = low === high && this.series?.fields.find(({ name }) => name === coloured.field.name)?.range;
    if (!inTime || coloured.formula) return [low, high];
    // a first step of zeros
    return coloured.component === 'magnitude' ? [0, Math.max(...inTime.map(Math.abs))] : inTime;
  }

  #rangeOf({ field: { name, range, components }, cells, component, formula }) {
    if (formula)
      return this.#isShade({ field: formula.text, cells, component: 0 })
        ? this.shade.range
        : isosurfaceRange({ ...this.coloredState, isosurfaceField: '' }, this.info);
    if (components > 1 && this.#isShade({ field: name, cells, component })) return this.shade.range;
    return component === 'magnitude' ? [0, Math.max(...range.map(Math.abs)) || 1] : range;
  }

  #isShade({ field, cells, component }) {
    const { shade } = this;
    return Boolean(shade) && shade.field === field && shade.cells === cells && shade.component === component;
  }

  isosurfaceRange() {
    return isosurfaceRange(this.store.state, this.info);
  }

  // Where there are isosurfaces, as far as is known.
  isosurfaceSpan() {
    const { colored, component, formula } = isosurfacesOf(this.info, this.store.state);
    return colored && (formula || component === 'magnitude') ? this.dataRange() : this.isosurfaceRange();
  }

  // The colours' range as values; a logarithm needs positive ones.
  colorRange() {
    const { range, low, high, log } = this.store.state;
    let [from, to] = range === 'manual' ? [low, high]
      : range === 'auto' && !log        ? autoRange(this.dataRange(), this.at ? undefined : this.shade?.sample)
                                        : (range === 'visible' && this.scene.visibleRange()) || this.dataRange();
    if (!Number.isFinite(to - from)) [from, to] = [0, 1]; // of a quotient that has no ends
    if (from > to) [from, to] = [to, from];
    if (from === to) to = from + (Math.abs(from) * 1e-6 || 1); // a constant has one colour
    if (log && !(from > 0)) from = to > 0 ? to / 1000 : 1e-3;
    if (log && !(to > from)) to = 10 * from;
    return [from, to];
  }

  get #regionNumbers() {
    return this.regions.get(this.store.state.cells)?.map(({ number }) => number);
  }

  get #mapName() {
    const { state } = this.store;
    return mapOf(state, this.dataRange(), this.info.cellFields.find(({ name }) => name === state.cells)?.region);
  }

  get colorMap() {
    if (this.#mapName !== 'categories') return this.#mapName;
    if (this.#categories?.of) return this.#categories.of(this.colorRange(), this.#regionNumbers);
    this.#categories ??= import('./categories.js').then(({ categoriesOf }) => {
      this.#categories = { of: categoriesOf };
      this.recolor();
    });
    return 'viridis';
  }

  drawBarNow() {
    const { reversed, log, isosurfaces } = this.store.state;
    const [low, high] = this.colorRange();
    const [least, most] = this.dataRange();
    const [from, to] = this.isosurfaceRange();
    drawScalarBar(this.#parts.bar, {
      title: this.difference ? this.title : titleWithUnit(this.info, this.coloredState),
      low,
      high,
      log,
      map: this.colorMap,
      reversed,
      below: least < low,
      above: most > high,
      numbers: this.#mapName === 'categories' ? this.#regionNumbers : null,
      marks: isosurfacesOf(this.info, this.store.state).colored && !this.difference
        ? isosurfaces.map((f) => from + f * (to - from))
        : [],
    });
  }

  recolorNow() {
    const range = this.colorRange();
    const [low, high] = this.store.state.log ? range.map(Math.log10) : range;
    this.scene.recolor({ ...this.store.state, map: this.colorMap }, low, high);
    this.#tell('colors', { range, map: this.colorMap, sample: this.shade?.sample });
    this.drawBar();
  }

  #setBackground() {
    const { stage } = this.#parts;
    const { background } = this.store.state;
    for (const name of ['white', 'grey', 'black']) stage.classList.toggle(`on-${name}`, name === background);
    const color = getComputedStyle(stage).backgroundColor.match(/[\d.]+/g).slice(0, 3);
    this.scene.setBackground(color.map((c) => c / 255));
  }

  /** The background or the page's colours have changed. */
  repaint() {
    this.#setBackground();
    this.scene.restyle(this.store.state);
    this.drawBar();
  }

  // ---- what the worker is to make

  // Fields that the picture needs and that have not been asked for.
  get #missing() {
    return shownFields(this.info, this.store.state).filter((field) => !this.stream.fields.includes(field));
  }

  // Values of cells come when they are first shown.
  async #showNow(state = this.store.state) {
    const spec = specOf(this.difference ? this.difference.plain(state) : state, this.info);
    this.#spec = JSON.stringify(spec);
    const needed = new Set([spec.cellField, spec.regions?.field]);
    const fields = [...needed].filter((name) => name && !this.regions.has(name));
    if (fields.length) this.#tell('fieldsloading', { fields });
    try {
      if (spec.component === 'magnitude' || spec.formula) this.#lengths ??= await import('./lengths.js');
      if (formulaText(this.info, state) && !this.#formulas) this.#loadFormulas();
      const whole = this.#whole;
      this.#whole = false;
      await this.stream.show({ ...spec, morph: spec.morph && !stillness?.matches, tag: this.#asked }, { whole });
    } catch (error) {
      if (!['AbortError', 'InvalidStateError'].includes(error.name))
        this.#tell('failed', { message: error.message, retry: this.show });
    }
    if (fields.length) this.#tell('fieldsloaded', { fields });
  }

  // The picture is of the field until they are there.
  async #loadFormulas() {
    this.#formulas = true;
    useFormulas(await import('./formula.js'));
    this.#tell('info'); // what is told of the state
    this.#remake();
  }

  // Fields come when they are first shown; the picture before stays meanwhile.
  async #show() {
    const fields = this.#missing;
    if (!fields.length) return this.#showNow();
    this.#tell('fieldsloading', { fields });
    try {
      await this.stream.addFields(fields);
      this.show(); // of what is wanted by now
    } catch (error) {
      this.#tell('failed', { message: `${fields.join(', ')} cannot be loaded: ${error.message}`, retry: this.show });
    }
    this.#tell('fieldsloaded', { fields });
  }

  async #refine() {
    if (this.playing) return;
    if (this.#inTime) {
      await this.showStep(Math.min(this.store.state.step, this.series.times.length - 1), { band: this.wantedBand });
      return;
    }
    this.#leaveSteps();
    try {
      await this.stream.refineTo(targetOf(this.store.state, this.info));
      this.#giveBack();
    } catch (error) {
      if (error.name !== 'AbortError') this.#tell('failed', { message: error.message, retry: this.refine });
    }
  }

  // After a much coarser level than before: a worker keeps its memory.
  #giveBack() {
    const { tets } = this.info.levels[this.level];
    this.#most = Math.max(this.#most, tets);
    if (this.#most < muchTets || 4 * tets > this.#most) return;
    this.#most = tets;
    this.stream.compact().catch(() => {}); // it goes on as it is
  }

  // ---- from the stream

  // How what colours is made of vectors in the picture.
  #lengthsOf(shade) {
    const formula = shade?.formula ? formulaNamed(this.info, shade.field) : null;
    return this.#lengths && { ...this.#lengths, formula };
  }

  // Colours follow what is drawn. A vector's lengths are known as they come; their range only grows, so that colours do
  // not flicker.
  #takeShade({ field, cells, component, formula, range: [low, high], sample }) {
    const fresh = !this.#isShade({ field, cells, component });
    const [least, most] = fresh ? [Infinity, -Infinity] : this.shade.range;
    const grown = low < least || high > most;
    if (fresh || grown) this.shade = { field, cells, component, formula, range: [Math.min(low, least),
                                                                        Math.max(high,
                                                                                 most)], sample: this.shade?.sample };
    if (sample) this.shade.sample = sample;
    if (fresh || sample || (grown && (formula || colouredOf(this.info, this.coloredState).field.components > 1)) ||
        this.store.state.range === 'visible') this.recolorNow();
  }

  #takePictures(event) {
    if (!this.scene?.box) this.#early = event;
    else if (this.difference) this.subtracting = this.#takeDifference(event.detail);
    else this.#drawPictures(event.detail);
  }

  // Of several that are under way, the last.
  async #takeDifference(pictures) {
    const { difference } = this;
    const mine = ++this.#subtracting;
    try {
      const made = await difference.of(pictures);
      if (made && mine === this.#subtracting && difference === this.difference) {
        this.#drawPictures(made);
        this.recolorNow();
      }
    } catch (error) {
      if (difference !== this.difference || error.name === 'AbortError') return;
      this.#failedToSubtract(error);
      this.subtract(null);
    }
  }

  #drawPictures(pictures) {
    if (pictures.outline !== undefined) this.outline = pictures.outline;
    const changed = pictures.finer?.seconds !== this.finer?.seconds;
    this.finer = pictures.finer;
    this.scene.addEventListener('render', this.#tellPictured, { once: true });
    this.scene.update(pictures, this.store.state, this.#lengthsOf(pictures.shade));
    this.#takeShade(pictures.shade);
    this.#drawn = pictures.t === 1 && pictures.tag === this.#asked ? pictures.level : -1;
    this.level = pictures.level; // the base: nothing was refined to get there
    this.#tell('pictures', pictures);
    if (changed) this.#tell('info');
  }
}
