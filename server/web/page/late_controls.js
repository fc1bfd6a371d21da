// SPDX-License-Identifier: BSD-3-Clause
// The part of the panel that is farther down: vectors, threshold, what the stream is.

import { bindNumber, byId, element, options } from './dom.js';
import { vectorFields, vectorsOf } from './levels.js';
import { bytes, clamp, plain, significant } from './numbers.js';
import { thresholdRange } from './spec.js';
import { mostVectors } from './state.js';

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

/** What the panel's `controls` leave to others. */
export function bindLate(controls) {
  bindVectors(controls);
  bindThreshold(controls);
  describe(controls);
}
