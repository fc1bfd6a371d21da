// SPDX-License-Identifier: BSD-3-Clause
// The life of <tetlod-view>: it may go, or get another source, at any moment, and leaves neither a worker nor a graphics' context.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { launch, openPage } from './browser.mjs';
import { ROOT, folderHost, program, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

const { path } = sampleStream();
const server = await program([path]);
const host = await folderHost(join(ROOT, 'build/client'));
const browser = await launch();
const page = await openPage(browser, host.origin);
await page.addInitScript(() => {
  window.contexts = [];
  const plain = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
    const context = plain.call(this, kind, ...rest);
    if (kind.startsWith('webgl') && context && this.isConnected && !window.contexts.includes(context)) window.contexts.push(context);
    return context;
  };
});
await page.goto(`${host.origin}/empty.html`);
await page.evaluate(() => import('./element.js'));
const src = `${server.url}v1/meshes/fin`;

const until = async (what, check) => {
  for (let i = 0; !await check(); i++) {
    assert.ok(i < 600, what);
    await new Promise((resolve) => { setTimeout(resolve, 100); });
  }
};
const live = () => page.evaluate(() => window.contexts.filter((context) => !context.isContextLost()).length);

// Some go before their worker runs, some while bytes come, some when they are shown; some are two, some get another source.
async function mounts_at_random_moments_leave_nothing() {
  const shown = await page.evaluate(async (url) => {
    const wait = (milliseconds) => new Promise((resolve) => { setTimeout(resolve, milliseconds); });
    let ready = 0;
    for (let i = 0; i < 24; i++) {
      const views = Array.from({ length: 1 + (i % 3 === 0) }, () => document.createElement('tetlod-view'));
      for (const view of views) {
        view.addEventListener('ready', () => ready++);
        view.setAttribute('src', url);
        document.body.append(view);
      }
      await wait(17 * (i * 7 % 40));
      if (i % 4 === 1) views[0].setAttribute('src', `${url}?again=${i}`);
      if (i % 4 === 2) views[0].replaceWith(views[0]); // taken away and put back
      await wait(11 * (i * 5 % 13));
      for (const view of views) view.remove();
    }
    return ready;
  }, src);
  await until('no worker is left', () => page.workers().length === 0);
  console.log(`# ${shown} of 32 came to a picture; ${await page.evaluate(() => window.contexts.length)} contexts were made`);
  assert.ok(shown > 2 && shown < 32, `${shown} came to a picture`);
  assert.equal(await live(), 0);
  const tets = await page.evaluate((url) => new Promise((resolve) => {
    const view = document.createElement('tetlod-view');
    view.addEventListener('level', ({ detail }) => detail.settled && resolve(detail.tets));
    view.setAttribute('src', url);
    document.body.append(view);
  }), src);
  assert.ok(tets > 1000);
  assert.equal(page.workers().length, 1);
  await page.evaluate(() => document.querySelector('tetlod-view').remove());
  await until('its worker ends', () => page.workers().length === 0);
  assert.equal(await live(), 0);
}

// The first source fails when the second is already opening.
async function an_old_source_that_fails_late_closes_nothing() {
  const bytes = readFileSync(path).toString('base64');
  const heard = await page.evaluate(async (text) => {
    const stream = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const view = document.createElement('tetlod-view');
    const errors = [];
    view.append('what stands in for it');
    view.addEventListener('error', ({ detail }) => errors.push(detail.message));
    const ready = new Promise((resolve) => { view.addEventListener('ready', resolve); });
    let fail;
    let go;
    const asked = new Promise((resolve) => {
      view.source = { read: () => new Promise((_, reject) => { fail = reject; resolve(); }) };
      document.body.append(view);
    });
    await asked;
    const gate = new Promise((resolve) => { go = resolve; });
    view.source = { read: async (from, to) => { await gate; return stream.slice(from, to); } };
    fail(new Error('too late'));
    await new Promise((resolve) => { setTimeout(resolve, 300); }); // nothing is to happen
    go();
    await ready;
    const result = { errors, fields: view.stream.fields.length, slot: view.shadowRoot.querySelector('slot') !== null };
    view.remove();
    return result;
  }, bytes);
  assert.deepEqual(heard, { errors: [], fields: 3, slot: false });
}

// A page may be made on a server, from the same modules.
async function it_can_be_imported_where_there_are_no_elements() {
  const module = pathToFileURL(join(ROOT, 'build/client/element.js')).href;
  const said = execFileSync('node', ['--input-type=module', '-e', `const { TetlodView } = await import(${JSON.stringify(module)}); console.log(typeof TetlodView);`]);
  assert.equal(String(said).trim(), 'function');
}

await run([mounts_at_random_moments_leave_nothing, an_old_source_that_fails_late_closes_nothing, it_can_be_imported_where_there_are_no_elements]);
