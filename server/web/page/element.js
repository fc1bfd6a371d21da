// SPDX-License-Identifier: BSD-3-Clause
// <tetlod-view src="…" error="1%" field="Pressure">: a stream in any page, as the viewer's page shows it, without its panel.

import { Axes } from './axes.js';
import { element } from './dom.js';
import { errorOf, shownField, shownMeasure } from './levels.js';
import { Viewer } from './viewer.js';

const style = `
:host { display: block; position: relative; height: 400px; overflow: hidden; font: 14px/1.4 system-ui, sans-serif; --tetlod-background: light-dark(#eceff3, #0b0f14); }
:host([hidden]) { display: none; }
.stage { position: absolute; inset: 0; background: var(--tetlod-background); color: light-dark(#17202b, #dfe6ee); }
.on-white { background: #fff; color-scheme: light; } .on-grey { background: #8a9099; color-scheme: light; } .on-black { background: #000; color-scheme: dark; }
.picture, .over, .over svg { position: absolute; inset: 0; width: 100%; height: 100%; }
.picture { touch-action: none; cursor: grab; } .picture canvas { display: block; width: 100%; height: 100%; }
.over { pointer-events: none; }
.over text { font-size: 12px; fill: currentColor; text-anchor: middle; dominant-baseline: central; opacity: .75; } .over .name { font-style: italic; font-weight: 600; }
.bar { position: absolute; left: 50%; bottom: 8px; width: min(430px, 90%); height: 54px; transform: translateX(-50%); pointer-events: none; }
.notice { position: absolute; left: 8px; top: 8px; max-width: 90%; padding: .3rem .6rem; border-radius: 6px; background: color-mix(in srgb, var(--tetlod-background) 80%, transparent); }
.notice:empty { display: none; }`;

// "1%" or "0.01"
function errorFrom(text) {
  const value = text.trim().endsWith('%') ? parseFloat(text) / 100 : Number(text);
  if (!(value >= 0)) throw new RangeError(`error is a fraction or a percentage, such as 0.01 or 1%, not '${text}'`);
  return value;
}

// Where there are no elements (a page that is made on a server) it can be imported all the same.
export class TetlodView extends (globalThis.HTMLElement ?? class {}) {
  static observedAttributes = ['src', 'error', 'field', 'state'];
  #viewer = null; #source = null; #notice; #resized = null;

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

  connectedCallback() {
    this.#open();
  }

  disconnectedCallback() {
    this.#close();
  }

  attributeChangedCallback(name, before, value) {
    if (!this.isConnected || !this.shadowRoot || before === value) return; // it has not opened yet
    if (name === 'src') this.#open();
    else if (this.#viewer?.scene) this.#follow(name, value); // one that opens reads the attributes when it is there
  }

  #follow(name, value) {
    try {
      if (name === 'state') this.#viewer.fragment = value ?? '';
      if (name === 'error') this.#viewer.store.set({ error: errorFrom(value ?? '0.01') });
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

  // What stands in the element is for where the stream cannot be shown.
  #giveWay() {
    this.#close();
    this.shadowRoot.replaceChildren(element('slot'));
  }

  #close() {
    this.#resized?.disconnect();
    this.#viewer?.close();
    this.#viewer = null;
  }

  #build() {
    const make = (name, className) => element(name, { className });
    const [stage, picture, over, bar] = [make('div', 'stage'), make('div', 'picture'), make('div', 'over'), make('canvas', 'bar')];
    this.#notice = element('div', { className: 'notice', role: 'status' });
    picture.tabIndex = 0;
    picture.setAttribute('role', 'application');
    picture.setAttribute('aria-label', 'The volume. Drag to turn it.');
    stage.append(picture, over, bar, this.#notice);
    const shadow = this.shadowRoot ?? this.attachShadow({ mode: 'open' });
    shadow.replaceChildren(element('style', {}, style), stage);
    return { stage, picture, over, bar };
  }

  // What the attributes ask for before the stream is there.
  #fragment() {
    const asked = new URLSearchParams(this.getAttribute('state') ?? '');
    if (this.hasAttribute('error')) asked.set('error', errorFrom(this.getAttribute('error')));
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
      const hear = (name, tell) => viewer.addEventListener(name, ({ detail }) => viewer === this.#viewer && tell(detail));
      hear('retry', ({ message }) => (this.childElementCount ? this.#giveWay() : this.#say(message)));
      hear('progress', () => this.#say(''));
      hear('failed', (failure) => this.#fail(failure));
      this.#say('Loading…');
      await viewer.open(this.source);
      if (viewer !== this.#viewer) return;
      this.#say('');
      this.#show(viewer, parts);
    } catch (error) {
      if (viewer !== this.#viewer) return;
      if (this.childElementCount) this.#giveWay();
      this.#fail(error);
    }
  }

  #show(viewer, { over, bar }) {
    this.replaceChildren();
    const axes = new Axes(over, viewer.scene, viewer.info.bounds);
    viewer.scene.addEventListener('render', () => axes.update());
    viewer.store.watch(['axes'], ({ axes: shown }) => axes.show(shown));
    this.#resized = new ResizeObserver(viewer.drawBar);
    this.#resized.observe(bar);
    viewer.recolorNow();
    viewer.follow();
    viewer.addEventListener('pictures', ({ detail: { t } }) => t === 1 && this.#tellLevel(viewer));
    if (this.hasAttribute('field')) this.#follow('field', this.getAttribute('field'));
    this.dispatchEvent(new Event('ready'));
    this.#tellLevel(viewer);
  }

  #tellLevel({ info, level, store: { state }, settled }) {
    const error = errorOf(info.levels[level], shownField(info, state), shownMeasure(info, state));
    this.dispatchEvent(new CustomEvent('level', { detail: { level, tets: info.levels[level].tets, error, settled } }));
  }
}

if (globalThis.customElements && !customElements.get('tetlod-view')) customElements.define('tetlod-view', TetlodView); // a page may have it from several servers
