// SPDX-License-Identifier: BSD-3-Clause
// Styles of what is loaded after the panel.

import { element } from './dom.js';

let loaded = null;

/** Resolves when they are there, or cannot be had. */
export const lateStyles = () =>
  (loaded ??= new Promise((resolve) => {
    const href = new URL('./tools.css', import.meta.url).href;
    document.head.append(element('link', { rel: 'stylesheet', href, onload: resolve, onerror: resolve }));
  }));
