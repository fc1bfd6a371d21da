// SPDX-License-Identifier: BSD-3-Clause
// The life of <tetlod-view>: it may go, or get another source, at any moment, and leaves neither a worker nor a
// graphics' context.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { launch, openPage } from './browser.mjs';
import { ROOT, SCRATCH, TETLOD, folderHost, program, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

const { path } = sampleStream();
const wake = join(SCRATCH, 'wake.tetlod');
mkdirSync(join(SCRATCH, 'steps'));
const sample = ['sample', 'wake', '--steps', '8', '--size', '8', '-o', join(SCRATCH, 'steps/wake.pvd')];
execFileSync(TETLOD, sample, { stdio: 'ignore' });
execFileSync(TETLOD, ['build', join(SCRATCH, 'steps/wake.pvd'), '-o', wake, '--quiet'], { stdio: 'ignore' });
const server = await program([path, wake]);
const host = await folderHost(join(ROOT, 'build/client'));
const browser = await launch();
const page = await openPage(browser, host.origin);
await page.addInitScript(() => {
  window.contexts = [];
  const plain = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
    const context = plain.call(this, kind, ...rest);
    if (kind.startsWith('webgl') && context && this.isConnected && !window.contexts.includes(context))
      window.contexts.push(context);
    return context;
  };
});
await page.goto(`${host.origin}/empty.html`);
await page.evaluate(() => import('./element.js'));
const src = `${server.url}v1/meshes/fin`;

const until = async (what, check) => {
  for (let i = 0; !(await check()); i++) {
    assert.ok(i < 600, what);
    await new Promise((resolve) => {
      setTimeout(resolve, 100);
    });
  }
};
const live = () => page.evaluate(() => window.contexts.filter((context) => !context.isContextLost()).length);

// Some go before their worker runs, some while bytes come, some when they are shown; four at a time, of which some get
// another source, some are taken away and put back at once, as frameworks do that mount everything twice.
const mounts = 200;

async function mounts_at_random_moments_leave_nothing() {
  const shown = await page.evaluate(
    async ([url, count]) => {
      const wait = (milliseconds) =>
        new Promise((resolve) => {
          setTimeout(resolve, milliseconds);
        });
      let [ready, state] = [0, 12345];
      const chance = (below) => {
        state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
        return Math.floor((state / 2 ** 32) * below);
      };
      const mount = async (i) => {
        const view = document.createElement('tetlod-view');
        const shown = new Promise((resolve) => {
          view.addEventListener('ready', resolve);
        });
        view.addEventListener('ready', () => ready++);
        view.setAttribute('src', url);
        document.body.append(view);
        if (i % 5 === 0) view.replaceWith(view); // StrictMode
        // most of them go soon; each twentieth is waited for
        await (i % 20 ? wait(chance(2) ? chance(60) : chance(300)) : shown);
        if (i % 4 === 1) view.setAttribute('src', `${url}?again=${i}`);
        if (i % 4 === 2) view.replaceWith(view);
        await wait(chance(120));
        view.remove();
      };
      let next = 0;
      await Promise.all(
        Array.from({ length: 4 }, async () => {
          while (next < count) await mount(next++);
        }),
      );
      return ready;
    },
    [src, mounts],
  );
  await until('no worker is left', () => page.workers().length === 0);
  console.log(
    `# ${shown} of ${mounts} came to a picture; ${
      await page.evaluate(() => window.contexts.length)} contexts were made`,
  );
  assert.ok(shown >= mounts / 20 && shown < mounts, `${shown} came to a picture`);
  assert.equal(await live(), 0);
  const tets = await page.evaluate(
    (url) =>
      new Promise((resolve) => {
        const view = document.createElement('tetlod-view');
        view.addEventListener('level', ({ detail }) => detail.settled && resolve(detail.tets));
        view.setAttribute('src', url);
        document.body.append(view);
      }),
    src,
  );
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
    const ready = new Promise((resolve) => {
      view.addEventListener('ready', resolve);
    });
    let fail;
    let go;
    const asked = new Promise((resolve) => {
      view.source = {
        read: () =>
          new Promise((_, reject) => {
            fail = reject;
            resolve();
          }),
      };
      document.body.append(view);
    });
    await asked;
    const gate = new Promise((resolve) => {
      go = resolve;
    });
    view.source = {
      read: async (from, to) => {
        await gate;
        return stream.slice(from, to);
      },
    };
    fail(new Error('too late'));
    await new Promise((resolve) => {
      setTimeout(resolve, 300);
    }); // nothing is to happen
    go();
    await ready;
    const result = {
      errors,
      fields: view.stream.fields.length,
      slot: view.shadowRoot.querySelector('slot:not([name])') !== null,
    };
    view.remove();
    return result;
  }, bytes);
  assert.deepEqual(heard, { errors: [], fields: 3, slot: false });
}

// A page may be made on a server, from the same modules.
async function it_can_be_imported_where_there_are_no_elements() {
  const module = pathToFileURL(join(ROOT, 'build/client/element.js')).href;
  const said = execFileSync('node', [
    '--input-type=module',
    '-e',
    `const { TetlodView } = await import(${JSON.stringify(module)}); console.log(typeof TetlodView);`,
  ]);
  assert.equal(String(said).trim(), 'function');
}

// Parts that are shown as the attribute says, and what stands in their slots.
async function parts_follow_the_attribute() {
  const seen = await page.evaluate(async (url) => {
    const view = document.createElement('tetlod-view');
    view.innerHTML = '<p>stands in</p><b slot="readout">mine</b>';
    view.setAttribute('controls', 'bar readout');
    const ready = new Promise((resolve) => {
      view.addEventListener('ready', resolve);
    });
    view.setAttribute('src', url);
    document.body.append(view);
    await ready;
    const part = (name) => view.shadowRoot.querySelector(`[part="${name}"]`);
    const isSeen = (node) => node.checkVisibility();
    const own = view.querySelector('b');
    const first = { bar: isSeen(part('bar')), own: isSeen(own), stand: view.querySelector('p') === null };
    own.remove();
    const readout = { seen: isSeen(part('readout')), text: part('readout').textContent };
    view.controls = [];
    const none = [part('bar'), part('readout')].map(isSeen);
    const { step, playing } = view;
    view.remove();
    return { first, readout, none, step, playing };
  }, src);
  assert.deepEqual(seen.first, { bar: true, own: true, stand: true });
  assert.ok(seen.readout.seen);
  assert.match(seen.readout.text, /^Pressure ≤ [\d.]+\s%.*; [\d\s]+ tetrahedra$/);
  assert.deepEqual([seen.none, seen.step, seen.playing], [[false, false], null, false]);
}

// The player of a series, and the same by calls.
async function a_series_is_played() {
  await page.evaluate((url) => {
    document.body.innerHTML = `<tetlod-view src="${url}" controls="bar player" error="5%"></tetlod-view>`;
    window.steps = [];
    document.querySelector('tetlod-view').addEventListener('step', ({ detail }) => window.steps.push(detail));
  }, `${server.url}v1/meshes/wake`);
  const view = page.locator('tetlod-view');
  await view.locator('[part="player-play"]').click();
  await page.waitForFunction(() => window.steps.some(({ step }) => step === 2));
  assert.equal(await view.evaluate((v) => v.playing), true);
  await view.evaluate((v) => v.pause());
  await page.waitForFunction(() => !document.querySelector('tetlod-view').playing);
  await view.evaluate((v) => {
    v.step = 4;
  });
  await page.waitForFunction(() => document.querySelector('tetlod-view').step === 4);
  const { time, error } = await page.evaluate(() => window.steps.at(-1));
  assert.ok(time > 0 && error <= 0.05);
  assert.equal(await view.locator('[part="player-step"]').evaluate(({ value }) => value), '4');
  await view.locator('[part="player-on"]').focus();
  await page.keyboard.press('Enter');
  await page.waitForFunction(() => document.querySelector('tetlod-view').step === 5);
  const nameless = await view.evaluate((v) =>
    [...v.shadowRoot.querySelectorAll('button, input, select, canvas.bar')]
      .filter((node) => !node.ariaLabel && !node.getAttribute('aria-label'))
      .map((node) => node.outerHTML),
  );
  assert.deepEqual(nameless, []);
  await view.screenshot({ path: join(SCRATCH, 'element-player.png') });
  await page.evaluate(() => document.body.replaceChildren());
  await until('its worker ends', () => page.workers().length === 0);
}

await run([
  mounts_at_random_moments_leave_nothing,
  parts_follow_the_attribute,
  a_series_is_played,
  an_old_source_that_fails_late_closes_nothing,
  it_can_be_imported_where_there_are_no_elements,
]);
