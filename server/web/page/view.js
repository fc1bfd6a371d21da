// SPDX-License-Identifier: BSD-3-Clause
// The viewer's page begins: the stream is asked for, and its first picture drawn. The panel is loaded meanwhile.

import { byId, element } from './dom.js';
import { button, clear, notice } from './notices.js';
import { bytes, significant } from './numbers.js';
import { id, name, root, source, viewer } from './opened.js';
import './theme.js';

function tellLoading({ detail: { received } }) {
  byId('loading').textContent = `Loading… ${bytes(received)}`;
}

function tellRetry({ detail: { message, delay, attempt } }) {
  notice('retry', `${message}; trying again in ${significant(delay, 2)} s (attempt ${attempt})`,
         { failed: true, seconds: 0 });
}

function tellWaiting({ detail: { step, retry } }) {
  notice('step', `Step ${step} has not come yet.`, { seconds: 0, children: [button('Try again', retry)] });
}

// What is decoded stays in the picture; a network may have come back.
function tellFailure({ detail: { message, retry } }) {
  clear('retry');
  const again = button('Try again', () => {
    clear('error');
    retry();
  });
  notice('error', message, { failed: true, seconds: 0, children: [again] });
}

function listen() {
  viewer.addEventListener('retry', tellRetry);
  viewer.addEventListener('loading', tellLoading);
  viewer.addEventListener('progress', () => clear('retry'));
  viewer.addEventListener('level', () => clear('error'));
  viewer.addEventListener('pictures', () => { byId('loading').hidden = true; });
  viewer.addEventListener('fieldsloading',
                          ({ detail: { fields } }) => notice('fields', `Loading ${fields.join(', ')}…`,
                                                             { seconds: 0 }));
  viewer.addEventListener('fieldsloaded', () => clear('fields'));
  viewer.addEventListener('stalled', tellWaiting);
  viewer.addEventListener('resumed', () => clear('step'));
  viewer.addEventListener('failed', tellFailure);
}

// The worker takes its module from the cache; browsers complain of what is loaded ahead and not taken by the page.
const takePreload = ({ href }) => fetch(href).catch(() => {});

async function start() {
  document.querySelectorAll('link[rel=preload]').forEach(takePreload);
  document.title = `${name} · tetlod`;
  byId('name').textContent = name;
  listen();
  const opened = viewer.open(source);
  const panel = import('./panel.js'); // needed after the first picture: asked for after what that takes
  panel.catch(() => {}); // if the stream cannot be opened as well, the page says that first
  await opened;
  performance.mark('tetlod-picture', { detail: { received: viewer.stream.received } });
  await (await panel).openPanel();
}

try {
  await start();
} catch (error) {
  byId('loading').hidden = true;
  const all = id ? [element('a', { href: root.href }, 'All streams')] : [];
  notice('error', `${name} cannot be shown: ${error.message}`, { failed: true, seconds: 0, children: all });
}
