// SPDX-License-Identifier: BSD-3-Clause
// The widget of notebooks: its module as anywidget loads it, in a page without a network, before a kernel in Python.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { createInterface } from 'node:readline';
import { launch, openPage } from './browser.mjs';
import { ROOT, folderHost, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

const { path } = sampleStream();
const text = readFileSync(join(ROOT, 'build/widget.js'), 'utf8');
const code = `
import base64, json, sys
import tetlod
from tetlod._widget import answer
stream = tetlod.open(sys.argv[1], level=0)
for line in sys.stdin:
    reply, buffers = answer(stream, json.loads(line))
    print(json.dumps([reply, [base64.b64encode(one).decode() for one in buffers]]), flush=True)
`;
const kernel = spawn('/usr/bin/python3', ['-c', code, path], { stdio: ['pipe', 'pipe', 'inherit'] });
const lines = createInterface({ input: kernel.stdout })[Symbol.asyncIterator]();
const questions = [];
let lost = 1; // the first question never arrives
let last = Promise.resolve();
const ask = (content) => {
  questions.push(content);
  if (lost-- > 0) return null;
  last = last.then(async () => {
    kernel.stdin.write(`${JSON.stringify(content)}\n`);
    return JSON.parse((await lines.next()).value);
  });
  return last;
};

const host = await folderHost(join(ROOT, 'build/client'));
const browser = await launch();
const page = await openPage(browser, host.origin);
await page.exposeFunction('askKernel', ask);
await page.goto(`${host.origin}/empty.html`);
await page.context().setOffline(true);
const asked = [];
page.on('request', (request) => {
  if (/^http/.test(request.url()) && !request.url().endsWith('/favicon.ico')) asked.push(request.url());
});
await page.evaluate(async (source) => {
  const plain = window.setInterval;
  window.setInterval = (call, milliseconds) => plain(call, milliseconds / 50); // a lost message is soon missed
  const heard = {};
  const values = { error: '5%', field: '', state: '', height: 300 };
  window.model = {
    get: (name) => values[name],
    set(name, value) { values[name] = value; for (const call of heard[`change:${name}`] ?? []) call(); },
    on: (name, call) => (heard[name] ??= new Set()).add(call),
    off: (name, call) => heard[name]?.delete(call),
    async send(content) {
      const answer = await window.askKernel(content);
      const [reply, buffers] = answer ?? [{}, []];
      const views = buffers.map((one) => new DataView(Uint8Array.from(atob(one), (c) => c.charCodeAt(0)).buffer));
      for (const call of [...heard['msg:custom'] ?? []]) call(reply, views);
    },
  };
  window.heard = heard;
  const { default: widget } = await import(URL.createObjectURL(new Blob([source], { type: 'text/javascript' })));
  window.show = () => {
    const el = document.createElement('div');
    document.body.append(el);
    const end = widget.render({ model: window.model, el });
    const view = el.querySelector('tetlod-view');
    view.addEventListener('level', ({ detail }) => { view.shown = detail; });
    return { view, end };
  };
}, text);
const settled = (name, error) => page.waitForFunction(([which, most]) => {
  const { view } = window[which];
  return view.shown?.settled && view.shown.error <= most && view.shown.tets;
}, [name, error]).then((found) => found.jsonValue());

async function the_kernel_gives_the_bytes() {
  await page.evaluate(() => { window.one = window.show(); });
  const coarse = await settled('one', 0.05);
  assert.ok(questions.length > 1 && questions[0].question === questions[1].question, 'what was lost is asked again');
  assert.ok(questions.every(({ size }) => size <= 1 << 18));
  await page.evaluate(() => window.model.set('error', '0.5%'));
  const fine = await settled('one', 0.005);
  assert.ok(coarse > 100 && fine > coarse, `${coarse}, then ${fine} tetrahedra`);
  const { length } = await page.locator('tetlod-view').screenshot();
  assert.ok(length > 15e3, `a picture of ${length} bytes`);
  assert.deepEqual(asked, [], 'nothing is asked of the network');
  assert.deepEqual(page.complaints.filter((text) => !text.includes('ERR_INTERNET_DISCONNECTED')), []); // the favicon's
}

async function a_second_view_asks_for_itself() {
  await page.evaluate(() => { window.two = window.show(); });
  assert.equal(await settled('two', 0.005), await settled('one', 0.005));
  await page.evaluate(() => { window.one.end(); window.two.end(); });
  assert.equal(await page.locator('tetlod-view').count(), 0);
  assert.equal(await page.evaluate(() => Object.values(window.heard).reduce((sum, calls) => sum + calls.size, 0)), 0);
}

async function a_kernel_that_fails_says_why() {
  await page.evaluate(() => {
    window.askKernel = async ({ question }) => [{ answer: question, error: 'the disk is gone' }, []];
    window.three = window.show();
  });
  const notice = () => window.three.view.shadowRoot.querySelector('.notice')?.textContent.includes('the disk is gone');
  await page.waitForFunction(notice);
  await page.evaluate(() => window.three.end());
}

await run([the_kernel_gives_the_bytes, a_second_view_asks_for_itself, a_kernel_that_fails_says_why]);
