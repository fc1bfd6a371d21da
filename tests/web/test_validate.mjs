// SPDX-License-Identifier: BSD-3-Clause
// The decoder of the browser against every stream of format/conformance, and the clauses by which it refuses; and the
// page that validates streams, from the disk and from a host: valid, invalid and cut files, dropped, chosen and by URL.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { launch, openPage } from './browser.mjs';
import { ROOT } from './hosts.mjs';
import { run } from './tap.mjs';
import { clauseOf, readAll } from '../../format/conformance/read_all.mjs';
import { decoder } from '../../format/conformance/wasm_reader.mjs';

const kit = join(ROOT, 'format/conformance');
const expected = JSON.parse(readFileSync(join(kit, 'expected.json'), 'utf8'));
const bytesOf = ({ stream }) => readFileSync(join(kit, stream));
const page = join(ROOT, 'build/validate.html');

// The tail's frame is read by 9.3, whose numbers are those of 6.3; a table of groups also holds the tables of steps.
const ALSO = { coder_quotient: '9.3', topologies_table: '3.7' };

async function everyValidStream() {
  for (const entry of expected.valid) {
    const { answer } = await readAll(decoder, bytesOf(entry));
    const { region, partly, ball, pages, ...wanted } = entry.answer; // this decoder takes whole levels
    assert.deepEqual(JSON.parse(JSON.stringify(answer)), { ...answer, ...wanted }, entry.stream);
  }
}

async function everyInvalidStream() {
  for (const entry of expected.invalid) {
    let info = null;
    const told = (index) => { info = index; };
    const error = await readAll(decoder, bytesOf(entry), told).then(() => null, (problem) => problem);
    if (!error) {
      assert.ok(entry.validator, `${entry.stream} is taken`);
      continue;
    }
    const name = entry.stream.match(/([a-z_]+)\.tetlod/)[1];
    assert.ok([entry.clause, ALSO[name]].includes(clauseOf(error.message, info)),
              `${name}: ${error.message}: ${clauseOf(error.message, info)}, not ${entry.clause}`);
  }
}

function streams() {
  const whole = bytesOf({ stream: '../../tests/golden/grid_float32.tetlod' });
  const flipped = Uint8Array.from(whole, (byte, i) => (i === whole.length - 9 ? byte ^ 1 : byte));
  const text = Buffer.from('no stream, but a text '.repeat(4)); // as long as a header
  return {
    'valid.tetlod': [whole, 'valid', /valid, \d+ bytes, content id [0-9a-f]{32}/],
    'cut.tetlod': [whole.subarray(0, whole.length - 40), 'cut', /cut off; it holds level.* of \d+ \(SPEC\.md, 3\)/],
    'short.tetlod': [whole.subarray(0, 90), 'cut', /cut off; it holds no level/],
    'flipped.tetlod': [flipped, 'invalid', /refused by SPEC\.md, 3\.1: .*checksum/],
    'text.tetlod': [text, 'invalid', /SPEC\.md, 3\.1/],
    'time.tetlod': [bytesOf({ stream: '../../tests/golden/invalid/time_falls.tetlod' }), 'invalid', /SPEC\.md, 3\.7/],
    'pages.tetlod': [bytesOf({ stream: '../../tests/golden/invalid/paged_moved.tetlod' }), 'invalid', /SPEC\.md, 7\.6/],
  };
}

async function verdict(shown, name) {
  await shown.waitForFunction((wanted) => {
    const { className, textContent } = document.getElementById('verdict');
    return className && textContent.includes(wanted);
  }, name);
  return shown.evaluate(() => {
    const { className, textContent } = document.getElementById('verdict');
    return { kind: className, text: textContent, rows: document.querySelectorAll('#details tr').length };
  });
}

const browser = await launch();

async function chosenAndDropped() {
  const shown = await openPage(browser, pathToFileURL(page).href);
  await shown.goto(pathToFileURL(page).href);
  for (const [name, [bytes, kind, words]] of Object.entries(streams())) {
    await shown.setInputFiles('#file', { name, mimeType: 'application/octet-stream', buffer: Buffer.from(bytes) });
    const found = await verdict(shown, name);
    assert.equal(found.kind, kind, found.text);
    assert.match(found.text, words);
    assert.equal(found.rows > 1, kind === 'valid' || /holds level/.test(found.text), found.text);
  }
  await shown.evaluate((bytes) => {
    const dataTransfer = new DataTransfer();
    dataTransfer.items.add(new File([Uint8Array.from(bytes)], 'dropped.tetlod'));
    const drop = new DragEvent('drop', { dataTransfer, bubbles: true, cancelable: true });
    document.getElementById('drop').dispatchEvent(drop);
  }, [...streams()['valid.tetlod'][0]]);
  assert.equal((await verdict(shown, 'dropped.tetlod')).kind, 'valid');
  assert.deepEqual([shown.complaints, shown.strangers], [[], []]);
}

async function byUrl() {
  const files = streams();
  const host = createServer((request, answer) => {
    const name = request.url.slice(1);
    if (name === 'validate.html') return answer.setHeader('Content-Type', 'text/html').end(readFileSync(page));
    return files[name] ? answer.end(files[name][0]) : answer.writeHead(404).end();
  });
  await new Promise((resolve) => { host.listen(0, '127.0.0.1', resolve); });
  const origin = `http://127.0.0.1:${host.address().port}`;
  const shown = await openPage(browser, origin);
  await shown.goto(`${origin}/validate.html`);
  for (const [name, kind, words] of [['valid.tetlod', 'valid', /valid/], ['cut.tetlod', 'cut', /cut off/],
    ['flipped.tetlod', 'invalid', /3\.1/], ['nothing.tetlod', 'invalid', /cannot be read: 404/]]) {
    await shown.fill('#url', `${origin}/${name}`);
    await shown.click('button');
    const found = await verdict(shown, name);
    assert.equal(found.kind, kind, found.text);
    assert.match(found.text, words);
  }
  assert.deepEqual(shown.strangers, []);
  host.close();
}

await run([everyValidStream, everyInvalidStream, chosenAndDropped, byUrl], () => browser.close());
