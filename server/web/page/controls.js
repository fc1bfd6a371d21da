// SPDX-License-Identifier: BSD-3-Clause
// The panel: every control follows the state and changes it.

import { cssGradient, mapNames } from './colors.js';
import { bindNumber, byId, element, options } from './dom.js';
import {
  colouredOf,
  componentName,
  errorOf,
  fieldOf,
  measureFor,
  measureNames,
  isosurfacesOf,
  measuresOf,
  spanOf,
  targetFieldOf,
  tensorParts,
  unitOf,
  wantedLevel
} from './levels.js';
import { errorForLevel, errorSpan, wordsOfBound } from './promises.js';
import { reachOf } from './geometry.js';
import { notice } from './notices.js';
import { clamp, percent, plain } from './numbers.js';
import { Plot } from './plot.js';
import { histogram } from './first_view.js';
import { axisOf } from './state.js';

// Switches and choices that are a key of the state as it is.
function bindPlain(store) {
  for (const control of document.querySelectorAll('[data-bind]')) {
    const { bind, type } = control.dataset;
    const isSwitch = control.type === 'checkbox';
    control.addEventListener('change', () =>
      store.set({ [bind]: isSwitch ? control.checked : type === 'number' ? Number(control.value) : control.value }));
    store.watch([bind], (state) => {
      if (isSwitch) control.checked = state[bind];
      else control.value = state[bind];
    });
  }
}

// Counts over the colours' range, by their square roots: few values are to be seen, too.
function drawHistogram(path, counts) {
  const most = Math.sqrt(Math.max(1, ...counts));
  const bars = [...counts].map((count, i) => `M${i},1V${(1 - Math.sqrt(count) / most).toFixed(3)}h1V1z`);
  path.setAttribute('d', bars.join(''));
}

export class Controls {
  // `actions`: { look(view), viewNormal() }
  constructor(viewer, actions) {
    const { store, info } = viewer;
    Object.assign(this, { viewer, store, actions });
    this.opened = 'inside'; // what the boundary became when it was opened
    options(byId('field'), info.fields.map((f) => [f.name, f.name]));
    options(byId('cells'), [['', 'no, by the field'], ...info.cellFields.map((f) => [f.name, f.name])]);
    byId('cells-row').hidden = !info.cellFields.length;
    options(byId('isosurface-field'), [['', 'as coloured'], ...info.fields.map((f) => [f.name, f.name])]);
  }

  // Of what is shown now: a series has other ranges and errors at its steps than at its levels.
  get info() {
    return this.viewer.info;
  }

  // Calls `react(state)` now, whenever one of the keys changes, and with another index.
  follow(keys, react) {
    this.store.watch(keys, react);
    this.viewer.addEventListener('info', () => react(this.store.state));
  }

  // What makes the panel, each a short piece of work.
  parts() {
    return [
      () => bindPlain(this.store), () => this.bindDetail(), () => this.bindColors(), () => this.bindLayers(),
      () => this.bindVolume(), () => this.bindView()
    ];
  }

  // ---- detail

  bindDetail() {
    const { store } = this;
    this.plot = new Plot(byId('plot'), (k) => this.chooseLevel(k));
    const slider = byId('error');
    const span = () => spanOf(fieldOf(this.info, targetFieldOf(this.info, store.state)));
    slider.addEventListener('input', () => store.set({ error: this.errorAt(Number(slider.value)) }));
    const numbers = [
      bindNumber(
        byId('error-percent'), () => plain(100 * store.state.error), (x) => store.set({ error: clamp(x / 100, 0, 1) })),
      bindNumber(byId('error-absolute'), () => plain(store.state.error * span(), 3),
        (x) => store.set({ error: clamp(x / (span() || 1), 0, 1) })),
      bindNumber(
        byId('max-tets'), () => store.state.maxTets || '', (x) => store.set({ maxTets: Math.max(0, Math.round(x)) })),
      bindNumber(byId('max-bytes'), () => (store.state.maxBytes ? plain(store.state.maxBytes / 1e6) : ''),
        (x) => store.set({ maxBytes: Math.max(0, x * 1e6) })),
    ];
    for (const [id, key] of [['max-tets', 'maxTets'], ['max-bytes', 'maxBytes']])
      byId(id).addEventListener('input', (event) => event.target.value.trim() === '' && store.set({ [key]: 0 }));
    this.follow(['field', 'errorField', 'measure'], (state) => {
      const { info } = this;
      const field = targetFieldOf(info, state);
      const measure = measureFor(info, state);
      options(byId('measure'), measuresOf(info, field).map((m) => [m, measureNames[m]]));
      byId('measure').value = measure;
      this.plot.setLevels(info.levels.map((l) => ({ bytes: l.bytes, error: errorOf(l, field, measure) })), info.bytes);
    });
    this.follow(['field', 'errorField', 'measure', 'error', 'maxTets', 'maxBytes'], (state) => {
      for (const update of numbers) update();
      byId('error-absolute').nextSibling.textContent = unitOf(this.info, targetFieldOf(this.info, state)) || 'absolute';
      slider.value = this.sliderAt(state.error);
      slider.ariaValueText = state.error ? `${plain(100 * state.error)} percent` : 'finest';
      this.placePoint();
    });
  }

  // The slider's end is the finest level: error 0.
  errorAt(position) {
    const [least, most] = errorSpan(this.info, this.store.state);
    return position >= 1000 ? 0 : Number((most * (least / most) ** (position / 980)).toPrecision(3));
  }

  sliderAt(error) {
    const [least, most] = errorSpan(this.info, this.store.state);
    return error <= 0 ? 1000 : clamp(980 * (Math.log(error / most) / (Math.log(least / most) || -1)), 0, 990);
  }

  chooseLevel(k) {
    this.store.set({ error: errorForLevel(this.info, this.store.state, k), maxTets: 0, maxBytes: 0 });
  }

  // By whole levels; those of one error count as one.
  step(by) {
    const { info, store } = this;
    const from = wantedLevel(info, store.state);
    const error = errorForLevel(info, store.state, from);
    for (let k = from + by; k >= 0 && k < info.levels.length; k += by)
      if (errorForLevel(info, store.state, k) !== error) return this.chooseLevel(k);
  }

  setShown(level, received) {
    Object.assign(this, { level, received });
    this.placePoint();
  }

  placePoint() {
    this.plot.setLevel(wantedLevel(this.info, this.store.state), this.level ?? -1, this.received ?? 0);
  }

  // ---- colours

  bindColors() {
    const { store, info } = this;
    const component = byId('component');
    const chosen = () => (/^\d+$/.test(component.value) ? Number(component.value) : component.value);
    component.addEventListener('change', () => store.set({ component: chosen(), formula: '' }));
    store.watch(['field', 'cells', 'component', 'formula'], (state) => {
      const { components } = colouredOf(info, state).field;
      const tensor = !state.cells && [6, 9].includes(components) ? Object.entries(tensorParts) : [];
      byId('component-row').hidden = components === 1;
      options(component, [
        ['magnitude', 'magnitude'], ...tensor,
        ...Array.from({ length: components }, (_, i) => [i, componentName(components, i)])
      ]);
      component.value = state.component;
      if (component.selectedIndex < 0) component.value = 'magnitude'; // a tensor's part, of another field
    });
    this.bindMapFile();
    const hand = (patch) => {
      const [low, high] = this.viewer.colorRange();
      store.set({ range: 'manual', low, high, ...patch });
    };
    this.followRange = ['low', 'high'].map(
      (key, i) => bindNumber(byId(key), () => plain(this.viewer.colorRange()[i]), (x) => hand({ [key]: x })));
    byId('range').addEventListener('change', (event) => {
      const [low, high] = this.shownRange ?? [0, 1];
      if (event.target.value === 'manual') store.set({ low, high });
    });
  }

  bindMapFile() {
    const { store } = this;
    const input = byId('map-file');
    input.addEventListener('change', async () => {
      try {
        const { mapOfFile } = await import('./color_file.js');
        store.set({ map: mapOfFile(await input.files[0].text()) });
      } catch (error) {
        notice('map', `${input.files[0].name}: ${error.message}`, { failed: true });
      }
    });
    store.watch(['map'], ({ map }) => {
      const own = mapNames.some(([name]) => name === map) || map === 'auto' ? [] : [[map, 'from a file']];
      options(byId('map'), [['auto', 'by the data'], ...mapNames, ...own]);
      byId('map').value = map;
    });
  }

  // The colours as they are now; `sample`: sorted values of the mesh.
  setColors({ range, map, sample }) {
    this.shownRange = range;
    for (const update of this.followRange) update();
    const { log, reversed } = this.store.state;
    for (const id of ['swatch', 'transfer-swatch']) byId(id).style.background = cssGradient(map, reversed, '90deg');
    for (const id of ['histogram', 'transfer-histogram'])
      drawHistogram(byId(id), sample ? histogram(sample, range, log, 64) : []);
    this.listIsosurfaces(this.store.state.isosurfaces);
  }

  // ---- layers

  // What lies inside is hidden by a solid boundary: the first such layer opens it, or takes it away; the last one
  // brings it back.
  setInner(patch) {
    const before = this.store.state;
    const inner = (s) => s.slices.length + s.isosurfaces.length + (s.volume ? 1 : 0) + (s.vectors === 'off' ? 0 : 1);
    const after = { ...before, ...patch };
    const opened = patch.volume ? 'off' : 'inside';
    if (!inner(before) && inner(after) && before.surface === 'solid') this.opened = patch.surface = opened;
    if (inner(before) && !inner(after) && before.surface === this.opened) patch.surface = 'solid';
    this.store.set(patch);
  }

  normal(axis) {
    return { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] }[axis] ?? this.actions.viewNormal();
  }

  // In the widest gap between the slices across the same direction and the ends.
  addSlice(axis) {
    const { slices } = this.store.state;
    const normal = this.normal(axis);
    const taken =
      [0, ...slices.filter((p) => p.normal.every((c, i) => c === normal[i])).map((p) => p.at).sort((a, b) => a - b), 1];
    const gaps = taken.slice(1).map((at, i) => ({ width: at - taken[i], at: (at + taken[i]) / 2 }));
    const { at } = gaps.reduce((best, gap) => (gap.width > best.width + 1e-9 ? gap : best));
    this.setInner({ slices: [...slices, { normal, at: Number(at.toPrecision(4)) }] });
  }

  addIsosurface() {
    const { isosurfaces } = this.store.state;
    const [low, high] = this.isosurfaceSpan();
    const places = [0.5, 0.25, 0.75, 0.1, 0.9].map((x) => low + x * (high - low));
    this.setInner({ isosurfaces: [...isosurfaces, places.find((x) => !isosurfaces.includes(x)) ?? places[0]] });
  }

  // The fractions that have isosurfaces, as far as is known: lengths of vectors reach over a part of what they could.
  isosurfaceSpan() {
    const [low, high] = this.viewer.isosurfaceRange();
    return this.viewer.isosurfaceSpan().map((value) => clamp((value - low) / (high - low || 1), 0, 1));
  }

  bindLayers() {
    const { store } = this;
    for (const button of document.querySelectorAll('[data-slice]'))
      button.addEventListener('click', () => this.addSlice(button.dataset.slice));
    for (const button of document.querySelectorAll('[data-clip]'))
      button.addEventListener('click',
        () => store.set({ clip: { normal: this.normal(button.dataset.clip), at: store.state.clip?.at ?? 0.5 } }));
    byId('add-isosurface').addEventListener('click', () => this.addIsosurface());
    byId('line').addEventListener('change', () => this.toggleLine());
    store.watch(['line'], (state) => { byId('line').checked = Boolean(state.line); });
    store.watch(['slices'], (state) => {
      this.listPlanes(byId('slices'), state.slices, 'Slice', (slices) => this.setInner({ slices }));
      byId('slice-edges-row').hidden = !state.slices.length;
    });
    store.watch(['clip'],
      (state) => this.listPlanes(
        byId('clip'), state.clip ? [state.clip] : [], 'Clip', ([clip]) => store.set({ clip: clip ?? null }), true));
    store.watch(['isosurfaces', 'isosurfaceField', 'field', 'component', 'formula'],
      (state) => this.listIsosurfaces(state.isosurfaces));
    const opacity = byId('isosurface-opacity');
    opacity.addEventListener('input', () => store.set({ isosurfaceOpacity: opacity.value / 100 }));
    store.watch(['isosurfaceOpacity'], (state) => {
      opacity.value = 100 * state.isosurfaceOpacity;
      opacity.ariaValueText = percent(state.isosurfaceOpacity, 2);
    });
  }

  // At first through the middle, along the longest side; far walls do not hide it.
  toggleLine() {
    const { line } = this.store.state;
    if (line) return this.store.set({ line: null });
    const [low, high] = this.info.bounds;
    const sides = low.map((l, i) => high[i] - l);
    const longest = sides.indexOf(Math.max(...sides));
    const end = (at) => sides.map((_, i) => (i === longest ? at : 0.5));
    this.store.set({ line: [...end(0), ...end(1)] });
  }

  // Rows are kept while their number holds, so that a slider that is being dragged stays.
  rows(box, wanted, make) {
    while (box.children.length > wanted) box.lastChild.remove();
    while (box.children.length < wanted) box.append(make(box.children.length));
    return [...box.children];
  }

  listPlanes(box, planes, name, change, flips) {
    box.planes = planes;
    const put = (i, patch) => change(box.planes.map((p, k) => (k === i ? { ...p, ...patch } : p)));
    const rows = this.rows(box, planes.length, (i) => {
      const axis = element('select', { ariaLabel: `${name} ${i + 1}: across`, name: 'axis' });
      const slider = element('input', { type: 'range', min: 0, max: 1000, ariaLabel: `${name} ${i + 1}: place` });
      const third = flips
        ? element('button', { type: 'button', className: 'small', ariaLabel: 'Keep the other side' }, 'flip')
        : element('input', {
            className: 'number',
            inputMode: 'decimal',
            autocomplete: 'off',
            ariaLabel: `${name} ${i + 1}: place in percent`
          });
      const remove = element(
        'button', { type: 'button', className: 'remove', ariaLabel: `Remove ${name.toLowerCase()} ${i + 1}` }, '×');
      const place = element('input', { className: 'number place', inputMode: 'decimal', autocomplete: 'off' });
      place.ariaLabel = `${name} ${i + 1}: coordinate`;
      const reach = () => reachOf(this.info.bounds, box.planes[i]);
      const across = () => reach()[1] - reach()[0];
      const moveTo = (at) => put(i, { at: clamp(at, 0, 1) });
      const numbers = [bindNumber(place, () => plain(reach()[0] + box.planes[i].at * across()),
                                  (x) => moveTo((x - reach()[0]) / (across() || 1)))];
      axis.addEventListener('change', () => put(i, { normal: this.normal(axis.value) }));
      slider.addEventListener('input', () => put(i, { at: slider.value / 1000 }));
      if (flips)
        third.addEventListener(
          'click', () => put(i, { normal: box.planes[i].normal.map((c) => -c || 0), at: 1 - box.planes[i].at }));
      else numbers.push(bindNumber(third, () => `${plain(100 * box.planes[i].at, 3)} %`, (x) => moveTo(x / 100)));
      remove.addEventListener('click', () => change(box.planes.filter((_, k) => k !== i)));
      return Object.assign(element('div', { className: 'item' }, axis, slider, third, place, remove), { numbers });
    });
    rows.forEach((row, i) => {
      const [axis, slider, , place] = row.children;
      for (const update of row.numbers) update();
      const at = axisOf(planes[i].normal);
      const negative = axisOf(planes[i].normal.map((c) => -c || 0));
      options(axis, [
        ['x', 'x'], ['y', 'y'], ['z', 'z'], ['view', 'view'],
        ...(at         ? []
            : negative ? [['now', `−${negative}`]]
                       : [['now', 'free']])
      ]);
      axis.value = at ?? 'now';
      slider.value = 1000 * planes[i].at;
      slider.ariaValueText = `${percent(planes[i].at, 3)}, ${place.value}`;
    });
  }

  listIsosurfaces(values) {
    const { store, info } = this;
    const span = () => {
      const [least, most] = this.isosurfaceSpan();
      return { least, length: most - least || 1 };
    };
    const change = (i, value) =>
      store.set({ isosurfaces: store.state.isosurfaces.map((v, k) => (k === i ? clamp(value, 0, 1) : v)) });
    const rows = this.rows(byId('isosurfaces'), values.length, (i) => {
      const slider = element('input', { type: 'range', min: 0, max: 1000, ariaLabel: `Isosurface ${i + 1}: value` });
      const number = element('input',
        { className: 'number', inputMode: 'decimal', autocomplete: 'off', ariaLabel: `Isosurface ${i + 1}: value` });
      const remove =
        element('button', { type: 'button', className: 'remove', ariaLabel: `Remove isosurface ${i + 1}` }, '×');
      slider.addEventListener('input', () => change(i, span().least + (slider.value / 1000) * span().length));
      const reach = () => this.viewer.isosurfaceRange();
      const across = () => reach()[1] - reach()[0];
      const update = bindNumber(number, () => plain(reach()[0] + store.state.isosurfaces[i] * across()),
                                (x) => change(i, (x - reach()[0]) / (across() || 1)));
      remove.addEventListener(
        'click', () => this.setInner({ isosurfaces: store.state.isosurfaces.filter((_, k) => k !== i) }));
      return Object.assign(element('div', { className: 'item iso' }, slider, number, remove), { update });
    });
    byId('isosurface-body').hidden = !values.length;
    byId('isosurface-field-row').hidden = info.fields.length < 2;
    rows.forEach((row, i) => {
      const [slider, number] = row.children;
      slider.value = (1000 * (values[i] - span().least)) / span().length;
      row.update();
      slider.ariaValueText = number.value;
    });
  }

  // The shells of the picture at a level, in words.
  setZones({ zones, level }) {
    const zone = zones.find(Boolean);
    byId('zone-words').hidden = !zone;
    if (!zone) return;
    const { domainError } = this.info.levels[level];
    const field = isosurfacesOf(this.info, this.store.state).field;
    const moved =
      domainError > 1e-9 ? `; where the boundary moved, within ${percent(domainError)} of the diagonal` : '';
    byId('zone-words').textContent =
      `The original's isosurface lies between the shells: ${wordsOfBound(this.info, field, zone)}${moved}.`;
  }

  // ---- volume rendering and the view

  bindVolume() {
    const { store } = this;
    let editor = null; // loaded with the first volume
    const edit = async () => {
      editor = import('./transfer.js');
      const { TransferEditor } = await editor;
      const made = new TransferEditor(byId('transfer'), (opacity) => store.set({ opacity }));
      store.watch(['opacity'], (state) => made.set(state.opacity));
    };
    store.watch(['volume'], (state) => {
      if (state.volume && !editor) edit();
      byId('volume').checked = state.volume;
      byId('volume-body').hidden = !state.volume;
    });
    byId('volume').addEventListener('change', (event) => this.setInner({ volume: event.target.checked }));
  }

  bindView() {
    const { actions, store } = this;
    const views =
      [['+x', '+x'], ['-x', '−x'], ['+y', '+y'], ['-y', '−y'], ['+z', '+z'], ['-z', '−z'], ['oblique', '∡']];
    byId('looks').append(...views.map(([view, text]) => {
      const name = view === 'oblique' ? 'Look from a corner' : `Look from ${text}`;
      const button = element('button', { type: 'button', className: 'small', ariaLabel: name, title: name }, text);
      button.dataset.look = view;
      button.addEventListener('click', () => actions.look(view));
      return button;
    }));
    byId('reset').addEventListener('click', () => {
      const { field } = store.state;
      store.set({ ...this.viewer.base, field });
      actions.look('oblique');
    });
  }
}
