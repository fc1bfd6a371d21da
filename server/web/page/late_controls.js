// SPDX-License-Identifier: BSD-3-Clause
// The part of the panel that is farther down: vectors, threshold, what the stream is.

import { bindNumber, byId, element, options } from './dom.js';
import { vectorFields, vectorsOf } from './levels.js';
import { clear, notice } from './notices.js';
import { bytes, clamp, mostFloat, percent, plain, significant } from './numbers.js';
import { thresholdRange } from './spec.js';
import { mostVectors } from './state.js';
import { row } from './rows.js';

// As many as a slider from 1 to 1000 says: most of its way is for few.
function bindVectors(controls) {
  const { store, info } = controls;
  const [choice, field, slider] = ['vectors', 'vector-field', 'vector-count'].map(byId);
  const able = vectorFields(info);
  byId('vectors-body').hidden = !able.length;
  options(
    field,
    able.map((name) => [name, name]),
  );
  choice.addEventListener('change', () => controls.setInner({ vectors: choice.value }));
  field.addEventListener('change', () => store.set({ vectorField: field.value }));
  slider.addEventListener('input', () =>
    store.set({ vectorCount: Math.max(1, Math.round(mostVectors ** (slider.value / 1000))) }),
  );
  const size = element('input', { type: 'range', id: 'vector-size', className: 'short', min: -100, max: 100 });
  const seeds = element('select', { id: 'seeds' });
  options(seeds, [
    ['volume', 'whole volume'],
    ['line', 'plotted line'],
    ['slice', 'first slice'],
  ]);
  byId('vectors-more').append(row('Size', size), row('Where', seeds));
  size.addEventListener('input', () => store.set({ vectorSize: Number((10 ** (size.value / 100)).toPrecision(3)) }));
  seeds.addEventListener('change', () => {
    const { line, slices } = store.state;
    store.set({ seeds: seeds.value });
    if (seeds.value === 'line' && !line) controls.toggleLine();
    if (seeds.value === 'slice' && !slices.length) controls.addSlice('x');
  });
  store.watch(['vectorSize', 'seeds'], (state) => {
    size.value = 100 * Math.log10(state.vectorSize);
    size.ariaValueText = `${state.vectorSize} times`;
    seeds.value = state.seeds;
  });
  store.watch(['vectors', 'vectorField', 'vectorCount', 'field'], (state) => {
    choice.value = state.vectors;
    byId('vectors-more').hidden = state.vectors === 'off';
    field.value = vectorsOf(info, state) ?? '';
    slider.value = (1000 * Math.log(state.vectorCount)) / Math.log(mostVectors);
    slider.ariaValueText = String(state.vectorCount);
  });
}

function bindThreshold(controls) {
  const { store } = controls;
  const box = byId('threshold');
  // what is left is looked at from outside
  box.addEventListener('change', () =>
    store.set(box.checked ? { threshold: [0.5, 1], surface: 'solid' } : { threshold: null }),
  );
  const put = (end, x) => {
    const both = [...store.state.threshold];
    both[end] = Number(clamp(x, 0, 1).toPrecision(5));
    store.set({ threshold: end ? [Math.min(...both), both[1]] : [both[0], Math.max(...both)] });
  };
  const ends = ['low', 'high'].map((name, end) => {
    const slider = byId(`threshold-${name}`);
    slider.addEventListener('input', () => put(end, slider.value / 1000));
    const range = () => thresholdRange(store.state, controls.info);
    const number = bindNumber(
      byId(`threshold-${end ? 'most' : 'least'}`),
      () => plain(range()[0] + store.state.threshold[end] * (range()[1] - range()[0])),
      (x) => put(end, (x - range()[0]) / (range()[1] - range()[0] || 1)),
    );
    return () => {
      slider.value = 1000 * store.state.threshold[end];
      number();
      slider.ariaValueText = byId(`threshold-${end ? 'most' : 'least'}`).value;
    };
  });
  controls.follow(['threshold', 'field', 'cells', 'component', 'formula'], ({ threshold, cells }) => {
    box.checked = Boolean(threshold);
    byId('threshold-body').hidden = !threshold;
    byId('threshold-words').textContent = cells
      ? 'Cells with values between these.'
      : 'Cells whose corners all have values between these.';
    if (threshold) for (const update of ends) update();
  });
}

// Two sliders an axis, from side to side of the bounds.
function bindBox(controls) {
  const { store } = controls;
  const box = element('input', { type: 'checkbox', className: 'switch', id: 'box' });
  const put = (i, x) => {
    const ends = [...store.state.box];
    const other = (i + 3) % 6;
    ends[i] = i < 3 ? Math.min(x, ends[other]) : Math.max(x, ends[other]);
    store.set({ box: ends });
  };
  const sliders = Array.from({ length: 6 }, (_, i) => {
    const ariaLabel = `Clip box: ${i < 3 ? 'least' : 'greatest'} ${'xyz'[i % 3]}`;
    const slider = element('input', { type: 'range', id: `box-${i}`, min: 0, max: 1000, ariaLabel });
    slider.addEventListener('input', () => put(i, slider.value / 1000));
    return slider;
  });
  const axes = [0, 1, 2].map((i) => element('div', { className: 'row' }, 'xyz'[i], sliders[i], sliders[3 + i]));
  const body = element('div', {}, ...axes);
  byId('clip').after(row('Clip box', box), body);
  // what is left is looked at from outside
  box.addEventListener('change', () =>
    store.set(box.checked ? { box: [0, 0, 0, 0.5, 1, 1], surface: 'solid' } : { box: null }),
  );
  store.watch(['box'], (state) => {
    box.checked = Boolean(state.box);
    body.hidden = !state.box;
    state.box?.forEach((x, i) => {
      sliders[i].value = 1000 * x;
      const [low, high] = controls.info.bounds.map((corner) => corner[i % 3]);
      sliders[i].ariaValueText = `${percent(x, 3)}, ${significant(low + x * (high - low), 4)}`;
    });
  });
}

function describe({ info, viewer }) {
  const size = info.bounds[1].map((h, i) => significant(h - info.bounds[0][i], 3)).join(' × ');
  const rows = [
    ['Vertices', info.vertices.toLocaleString('en-US').replaceAll(',', '\u202f')],
    ['Bytes', bytes(viewer.stream.bytes)],
    ['Levels', String(info.levels.length)],
    ['Size', size],
    ['Fields', info.fields.map((f) => f.name).join(', ')],
    ...(info.cellFields.length ? [['Values of cells', info.cellFields.map((f) => f.name).join(', ')]] : []),
    ['Restores the input', info.lossless ? 'exactly' : 'within its error'],
    ['Content', info.cid.slice(0, 12)],
  ];
  byId('about').replaceChildren(
    ...rows.map(([name, value]) => element('div', {}, element('dt', {}, name), element('dd', {}, value))),
  );
}

// Values that graphics processors do not hold have the colours of the ends.
function bindLarge({ viewer }) {
  const tell = () => {
    const range = viewer.dataRange();
    if (range.every(Number.isFinite) && Math.max(...range.map(Math.abs)) > mostFloat)
      notice(
        'large',
        `${viewer.title} has values beyond 3.4e38, which pictures do not hold: probes tell them, colours are those ` +
          'of the ends. Build the stream in a larger unit.',
      );
    else clear('large');
  };
  viewer.addEventListener('colors', tell);
  tell();
}

// When a button goes with what it removes, the focus goes to the control before it: without a pointer one would begin
// at the top of the page again.
function keepFocus() {
  const isSeen = (control) => control.checkVisibility({ visibilityProperty: true });
  const keep = ({ target }) => {
    const gone = target.closest('button');
    if (!gone || gone !== document.activeElement) return;
    const all = [...document.querySelectorAll('a[href], button, input, select, summary, [tabindex="0"]')];
    const before = all.slice(0, all.indexOf(gone)).reverse();
    const move = () => isSeen(gone) || before.find((control) => !control.disabled && isSeen(control))?.focus();
    requestAnimationFrame(() => requestAnimationFrame(move)); // what follows the state does so in the next frame
  };
  document.addEventListener('click', keep, { capture: true });
}

/** What the panel's `controls` leave to others. */
export function bindLate(controls) {
  keepFocus();
  bindVectors(controls);
  bindThreshold(controls);
  bindBox(controls);
  bindLarge(controls);
  describe(controls);
}
