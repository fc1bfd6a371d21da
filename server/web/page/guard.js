// SPDX-License-Identifier: BSD-3-Clause
// Not a module: it speaks when a module or one of its parts cannot be loaded, where nothing else runs.
addEventListener('error', ({ target }) => {
  if (target?.tagName !== 'SCRIPT') return;
  const place = document.getElementById('loading') ?? document.body.appendChild(document.createElement('p'));
  place.hidden = false;
  place.textContent =
    'A part of this page could not be loaded. Reload the page; if that does not help, clear the browser\u2019s cache.';
}, true);
