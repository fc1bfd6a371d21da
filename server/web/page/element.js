// SPDX-License-Identifier: BSD-3-Clause
// <tetlod-view src="…" error="1%" pixels="2" field="Pressure" controls="bar readout player">: a stream in any page, as
// the page of the viewer shows it, without its panel.

import { Axes } from './axes.js';
import { element } from './dom.js';
import { errorOf, shownField, shownMeasure } from './levels.js';
import { promiseOf } from './promises.js';
import { count } from './numbers.js';
import { Viewer } from './viewer.js';

const style = `
:host { display: block; position: relative; height: 400px; overflow: hidden; font: 14px/1.4 system-ui, sans-serif;
  --tetlod-background: light-dark(#eceff3, #0b0f14); }
:host([hidden]) { display: none; }
.stage { position: absolute; inset: 0; --picture: var(--tetlod-background); background: var(--picture);
  color: light-dark(#17202b, #dfe6ee); }
.on-white { --picture: #fff; color-scheme: light; } .on-grey { --picture: #8a9099; color-scheme: light; }
.on-black { --picture: #000; color-scheme: dark; }
.picture, .over, .over svg { position: absolute; inset: 0; width: 100%; height: 100%; }
.picture { touch-action: none; cursor: grab; } .picture canvas { display: block; width: 100%; height: 100%; }
.over { pointer-events: none; stroke: var(--picture); stroke-width: 2px; paint-order: stroke; }
.over text { font-size: 12px; fill: currentColor; text-anchor: middle; dominant-baseline: central; opacity: .75; }
.over .name { font-style: italic; font-weight: 600; }
.bar { position: absolute; left: 50%; bottom: 8px; width: min(430px, 90%); height: 54px; transform: translateX(-50%);
  pointer-events: none; }
.notice { position: absolute; left: 8px; top: 8px; max-width: 90%; padding: .3rem .6rem; border-radius: 6px;
  background: color-mix(in srgb, var(--tetlod-background) 80%, transparent); }
.notice:empty, [hidden] { display: none !important; }
.readout { position: absolute; right: 8px; top: 8px; max-width: 60%; padding: .3rem .6rem; border-radius: 6px;
  font-size: 12px; font-variant-numeric: tabular-nums;
  background: color-mix(in srgb, var(--tetlod-background) 80%, transparent); }
.time { position: absolute; left: 50%; bottom: 66px; width: min(560px, calc(100% - 24px));
  transform: translateX(-50%); }
#player { display: grid; grid-template-columns: auto 1fr auto; gap: 2px 8px; align-items: center; padding: 4px 8px;
  border-radius: 6px; font-size: 12px; background: color-mix(in srgb, var(--tetlod-background) 85%, transparent); }
#player .buttons { display: flex; gap: 3px; } #player .track { position: relative; display: grid; }
#player .track > * { grid-area: 1 / 1; width: 100%; margin: 0; }
#player-buffer { height: 3px; align-self: end; pointer-events: none; } #player-buffer rect { fill: currentColor;
  opacity: .5; }
#player p { grid-column: 1 / -1; margin: 0; } #player p:empty { display: none; }`;

// "1%" or "0.01"
function errorFrom(text) {
  const value = text.trim().endsWith('%') ? parseFloat(text) / 100 : Number(text);
  if (!(value >= 0)) throw new RangeError(`error is a fraction or a percentage, such as 0.01 or 1%, not '${text}'`);
  return value;
}

// Of pages: what is seen is exact to so many pixels; 0: pages are not followed.
function pixelsFrom(text) {
  const value = Number(text);
  if (!(value >= 0)) throw new RangeError(`pixels is a number of at least 0, not '${text}'`);
  return value;
}

const parts = ['bar', 'readout', 'player']; // that may be shown, each with a slot in which another may stand

// Where there are no elements (a page that is made on a server) it can be imported all the same.
export class TetlodView extends (globalThis.HTMLElement ?? class {}) {
  static observedAttributes = ['src', 'error', 'pixels', 'field', 'state', 'controls'];
  #viewer = null;
  #source = null;
  #notice;
  #resized = null;
  #slots = {};
  #player = null;

  /** What is shown, if not `src`: whatever TetlodStream.open takes. */
  set source(source) {
    this.#source = source;
    if (this.isConnected) this.#open();
  }

  get source() {
    return this.#source ?? this.getAttribute('src');
  }

  get stream() {
    return this.#viewer?.stream ?? null;
  }

  /** The state as the viewer's page has it in its link: slices, isosurfaces, camera and so on. */
  get state() {
    return this.#viewer?.fragment.replace(/^#/, '') ?? this.getAttribute('state') ?? '';
  }

  /** Which parts are shown: bar, readout, player. */
  get controls() {
    return (this.getAttribute('controls') ?? 'bar').split(/\s+/).filter((name) => parts.includes(name));
  }

  set controls(names) {
    this.setAttribute('controls', [names].flat().join(' '));
  }

  /** Of a series in time: the step that is shown, or null; and whether it plays. */
  get step() {
    return this.#viewer?.at?.step ?? null;
  }

  set step(step) {
    this.#viewer?.store.set({ step });
  }

  get playing() {
    return this.#player?.playing ?? false;
  }

  /** Plays a series in time, from the step that is shown on; does nothing where there is none. */
  async play() {
    await this.#makePlayer();
    if (this.#player && !this.playing) this.#player.toggle();
  }

  pause() {
    if (this.playing) this.#player.toggle();
  }

  connectedCallback() {
    this.#open();
  }

  disconnectedCallback() {
    this.#close();
  }

  attributeChangedCallback(name, before, value) {
    if (!this.isConnected || !this.shadowRoot || before === value) return; // it has not opened yet
    if (name === 'src') this.#open();
    else if (name === 'controls') this.#showParts();
    else if (this.#viewer?.scene) this.#follow(name, value); // one that opens reads the attributes when it is there
  }

  #follow(name, value) {
    try {
      if (name === 'state') this.#viewer.fragment = value ?? '';
      if (name === 'error') this.#viewer.store.set({ error: errorFrom(value ?? '0.01') });
      if (name === 'pixels') this.#viewer.store.set({ pixels: pixelsFrom(value ?? '0') });
      if (name === 'field' && value) this.#viewer.store.set({ field: this.#known(value) });
    } catch (error) {
      this.#fail(error);
    }
  }

  #known(field) {
    const names = this.#viewer.info.fields.map(({ name }) => name);
    if (!names.includes(field)) throw new RangeError(`there is no field '${field}'; there are: ${names.join(', ')}`);
    return field;
  }

  #say(text) {
    this.#notice.textContent = text;
  }

  #fail(error) {
    this.#say(error.message);
    this.dispatchEvent(new CustomEvent('error', { detail: { message: error.message } }));
  }

  get #hasStandIn() {
    return [...this.children].some(({ slot }) => !slot);
  }

  // What stands in the element is for where the stream cannot be shown.
  #giveWay() {
    this.#close();
    this.shadowRoot.replaceChildren(element('slot'));
  }

  #close() {
    this.#resized?.disconnect();
    this.#viewer?.close();
    this.#viewer = this.#player = null;
  }

  #build() {
    const make = (name, className) => element(name, { className });
    const [stage, picture, over, bar] = [
      make('div', 'stage'),
      make('div', 'picture'),
      make('div', 'over'),
      make('canvas', 'bar'),
    ];
    this.#notice = element('div', { className: 'notice', role: 'status' });
    picture.tabIndex = 0;
    picture.setAttribute('role', 'application');
    picture.setAttribute('aria-label', 'The volume. Drag to turn it.');
    picture.part = 'picture';
    const readout = element('div', { className: 'readout', part: 'readout', role: 'status' });
    const time = make('div', 'time');
    bar.part = 'bar';
    bar.setAttribute('role', 'img');
    bar.setAttribute('aria-label', 'Colours and their values');
    this.#slots = {
      bar: element('slot', { name: 'bar' }, bar),
      readout: element('slot', { name: 'readout' }, readout),
      player: element('slot', { name: 'player' }, time),
    };
    stage.append(picture, over, ...Object.values(this.#slots), this.#notice);
    const shadow = this.shadowRoot ?? this.attachShadow({ mode: 'open' });
    shadow.replaceChildren(element('style', {}, style), stage);
    this.#showParts();
    return { stage, picture, over, bar };
  }

  // A slot that is not shown hides what stands in it, too.
  #showParts() {
    for (const name of parts) if (this.#slots[name]) this.#slots[name].hidden = !this.controls.includes(name);
    if (this.controls.includes('player')) this.#makePlayer();
  }

  async #makePlayer() {
    const viewer = this.#viewer;
    if (this.#player || !viewer?.series) return;
    const { Player } = await import('./player.js');
    if (viewer === this.#viewer) this.#player ??= new Player(viewer, this.#slots.player.querySelector('.time'));
  }

  async #followPages(viewer) {
    const { LookHere } = await import('./look_here.js');
    if (viewer === this.#viewer) new LookHere(viewer);
  }

  // What the attributes ask for before the stream is there.
  #fragment() {
    const asked = new URLSearchParams(this.getAttribute('state') ?? '');
    if (this.hasAttribute('error')) asked.set('error', errorFrom(this.getAttribute('error')));
    if (this.hasAttribute('pixels')) asked.set('pixels', pixelsFrom(this.getAttribute('pixels')));
    if (this.hasAttribute('field')) asked.set('field', this.getAttribute('field'));
    return asked.toString().replaceAll('+', '%20');
  }

  // A later source, or an element that is taken away, ends what opens; nothing is heard of it any more.
  async #open() {
    this.#close();
    const parts = this.#build();
    if (!this.source) return;
    let viewer = null;
    try {
      viewer = this.#viewer = new Viewer(parts, this.#fragment());
      const hear = (name, tell) =>
        viewer.addEventListener(name, ({ detail }) => viewer === this.#viewer && tell(detail));
      hear('retry', ({ message }) => (this.#hasStandIn ? this.#giveWay() : this.#say(message)));
      hear('progress', () => this.#say(''));
      hear('failed', (failure) => this.#fail(failure));
      this.#say('Loading…');
      await viewer.open(this.source);
      if (viewer !== this.#viewer) return;
      this.#say('');
      this.#show(viewer, parts);
    } catch (error) {
      if (viewer !== this.#viewer) return;
      if (this.#hasStandIn) this.#giveWay();
      this.#fail(error);
    }
  }

  #show(viewer, { over, bar }) {
    for (const child of [...this.childNodes]) if (!child.slot) child.remove(); // what stood in for the picture
    const axes = new Axes(over, viewer.scene, viewer.info.bounds);
    viewer.scene.addEventListener('render', () => axes.update());
    viewer.store.watch(['axes'], ({ axes: shown }) => axes.show(shown));
    this.#resized = new ResizeObserver(viewer.drawBar);
    this.#resized.observe(bar);
    viewer.recolorNow();
    viewer.follow();
    if (viewer.info.paged) this.#followPages(viewer);
    viewer.addEventListener('pictures', ({ detail: { t } }) => t === 1 && this.#tellLevel(viewer));
    viewer.addEventListener('info', () => this.#tellReadout(viewer));
    viewer.addEventListener('series', () => this.#showParts());
    viewer.addEventListener('step', ({ detail: { step, time, error } }) =>
      this.dispatchEvent(new CustomEvent('step', { detail: { step, time, error } })),
    );
    if (this.hasAttribute('field')) this.#follow('field', this.getAttribute('field'));
    this.#showParts();
    this.dispatchEvent(new Event('ready'));
    this.#tellLevel(viewer);
  }

  #tellReadout({ info, level, told }) {
    const { tets } = told.finer?.pages >= 0 ? told.finer : info.levels[level];
    const text = `${promiseOf(told, level)}; ${count(tets)} tetrahedra`;
    const [readout] = this.#slots.readout.children;
    if (readout.textContent !== text) readout.textContent = text;
  }

  #tellLevel(viewer) {
    const {
      info,
      level,
      store: { state },
      settled,
    } = viewer;
    this.#tellReadout(viewer);
    const { pages, worst = level, tets = info.levels[level].tets } =
      viewer.finer?.pages === undefined ? {} : viewer.finer;
    const error = errorOf(info.levels[worst], shownField(info, state), shownMeasure(info, state));
    this.dispatchEvent(new CustomEvent('level', { detail: { level: worst, tets, error, pages, settled } }));
  }
}

if (globalThis.customElements && !customElements.get('tetlod-view'))
  customElements.define('tetlod-view', TetlodView); // a page may have it from several servers
