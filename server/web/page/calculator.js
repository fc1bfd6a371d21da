// SPDX-License-Identifier: BSD-3-Clause
// A formula of components of fields that colours the picture, with the bound of its error.

import { byId, element } from './dom.js';
import { Formula } from './formula.js';
import { colouredOf, componentNames, titleOf } from './levels.js';
import { boundShown } from './promises.js';
import { row } from './rows.js';

function exampleOf({ fields }) {
  const [vector, scalar] = [
    fields.find(({ components }) => components > 1),
    fields.find(({ components }) => components === 1),
  ];
  const quoted = (name) => (/^[\p{L}_][\p{L}\p{N}_:]*$/u.test(name) ? name : `"${name}"`);
  if (vector)
    return `norm(${quoted(vector.name)})${
      scalar ? ` * ${quoted(scalar.name)}` : ` + ${quoted(vector.name)}.${componentNames(vector.components)[0]}`}`;
  return `sqrt(abs(${quoted(fields[0].name)}))`;
}

export function bindCalculator(viewer) {
  const { store, info } = viewer;
  const input = element('input', {
    id: 'formula',
    className: 'number',
    autocomplete: 'off',
    spellcheck: false,
    placeholder: exampleOf(info),
  });
  input.title =
    'Components as Velocity.x or Stress.xy; + − × ÷ ^, sqrt, abs, min, max, norm, mises, principal1 to principal3';
  const words = element('p', { className: 'hint', id: 'formula-words', role: 'status' });
  byId('component-row').after(
    row('Formula', input),
    words,
  );
  input.setAttribute('aria-describedby', 'formula-words');
  input.addEventListener('change', () => {
    const text = input.value.trim();
    try {
      if (text) new Formula(text, info.fields);
      store.set({ formula: text, ...(text && { cells: '' }) });
    } catch (error) {
      words.textContent = `${error.message}.`;
      input.setAttribute('aria-invalid', 'true');
    }
  });
  byId('field').addEventListener('change', () => store.set({ formula: '' }));
  const placesWithout = () =>
    viewer.dataRange().every(Number.isFinite) ? '' : ' It has places without a finite value.';
  const tell = () => {
    const { told, level, coloredState: state } = viewer;
    input.removeAttribute('aria-invalid');
    words.textContent =
      colouredOf(told, state).formula && level >= 0
        ? `${titleOf(told, state)} ${boundShown(told, level, state).words}.${placesWithout()}`
        : '';
  };
  store.watch(['formula'], ({ formula }) => {
    input.value = formula;
  });
  viewer.addEventListener('colors', tell);
  viewer.addEventListener('level', tell);
  tell();
}
