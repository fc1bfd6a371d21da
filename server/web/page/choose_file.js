// SPDX-License-Identifier: BSD-3-Clause
// A stream from the disk: chosen, or dropped on the page. Nothing leaves the browser.

import { byId, element } from './dom.js';

// `take(file)` has the first file that is dropped on the page.
export function takeDropped(take) {
  const stop = new AbortController();
  addEventListener('dragover', (event) => event.preventDefault(), stop);
  addEventListener('drop', (event) => {
    event.preventDefault();
    const [file] = event.dataTransfer.files;
    if (!file) return;
    stop.abort();
    take(file);
  }, stop);
}

// The file that the catalogue was given (catalogue.js), or the one that somebody chooses now.
export function chooseFile() {
  const given = globalThis.tetlodFile;
  if (given) return given;
  const input = element('input', { type: 'file', accept: '.tetlod', id: 'choose-file' });
  byId('loading').replaceChildren(element('label', {}, 'Drop a .tetlod file here, or choose one: ', input));
  return new Promise((resolve) => {
    const take = (file) => {
      byId('loading').textContent = 'Loading…';
      resolve(file);
    };
    input.addEventListener('change', () => input.files[0] && take(input.files[0]));
    takeDropped(take);
  });
}
