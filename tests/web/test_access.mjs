// SPDX-License-Identifier: BSD-3-Clause
// Whether everybody can use the page: by keyboard alone, with contrast, on a small screen, without motion.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import { launch, openPage, firstPicture, settled } from './browser.mjs';
import { ROOT, cellStream, program, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

const server = await program([sampleStream().path, cellStream().path, join(ROOT, 'tests/golden/series_moving.tetlod')]);
const browser = await launch();
const viewer = `${server.url}view/fin#error=0.1&slices=x@0.5&isosurfaces=0.4&clip=z@0.7`;

async function open(url, options) {
  const page = await openPage(browser, server.url, options);
  await page.goto(url);
  if (url.includes('/view/')) {
    await firstPicture(page);
    await settled(page);
  } else {
    await page.getByRole('link', { name: 'View' }).first().waitFor();
    await page.waitForFunction(() => [...document.querySelectorAll('section')].every( // those in sight are described
      (section) => section.getBoundingClientRect().top > innerHeight || section.querySelector('.body')));
  }
  return page;
}

async function every_control_is_reached_by_tab() {
  const page = await open(viewer);
  const wanted = await page.evaluate(() => {
    const all = [...document.querySelectorAll('a[href], button, input, select, summary, [tabindex="0"]')].filter(
      (e) => !e.disabled && e.checkVisibility({ visibilityProperty: true })
        && !e.closest('dialog:not([open]), details:not([open]) > :not(summary)'));
    // what a focus may change: of the control or of the frame around it
    window.looks = (e) => [e, e.parentElement].map((x) => {
      const { outline, boxShadow, borderColor, stroke, strokeWidth, backgroundColor } = getComputedStyle(x);
      return [outline, boxShadow, borderColor, stroke, strokeWidth, backgroundColor];
    }).join();
    document.activeElement.blur();
    window.before = all.map(window.looks);
    all.forEach((e, i) => { e.dataset.tabTest = i; });
    return all.length;
  });
  assert.ok(wanted > 40, `${wanted} controls`);
  const reached = new Set();
  const unseen = [];
  for (let i = 0; i < 2 * wanted && reached.size < wanted; i++) {
    await page.keyboard.press('Tab');
    const [number, seen, html] = await page.evaluate(() => {
      const e = document.activeElement;
      const k = e.dataset.tabTest;
      return [k, window.looks(e) !== window.before[k], e.outerHTML.slice(0, 100)];
    });
    if (number !== undefined) reached.add(number);
    if (number !== undefined && !seen) unseen.push(html);
  }
  assert.equal(reached.size, wanted);
  assert.deepEqual(unseen, [], 'where the focus is must be seen');
  await page.context().close();
}

// What is removed by keyboard takes its button along, but not the focus.
async function what_is_removed_leaves_the_focus_near() {
  const page = await open(`${viewer}&pins=0.5,0.3,0.1&line=0,0.1,0.2,1,0.9,0.8`);
  await page.locator('#line-drawing .line').waitFor({ state: 'attached' });
  const names = ['Remove slice 1', 'Remove isosurface 1', 'Remove clip 1', 'Remove probe 1'];
  for (const button of [page.locator('#line-close'), ...names.map((name) => page.getByRole('button', { name }))]) {
    await button.focus();
    await page.keyboard.press('Enter');
    await button.waitFor({ state: 'hidden' });
    await page.waitForFunction(() => document.activeElement !== document.body);
  }
  await page.context().close();
}

// Of all text against what is behind it, as WCAG 2 computes it: 4.5, or 3 where letters are large.
const contrasts = () => {
  const canvas = new OffscreenCanvas(1, 1);
  const context = canvas.getContext('2d', { willReadFrequently: true });
  const parse = (color) => {
    context.clearRect(0, 0, 1, 1);
    context.fillStyle = color;
    context.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = context.getImageData(0, 0, 1, 1).data;
    return [r, g, b, a / 255];
  };
  const over = ([r, g, b, a], below) => [r, g, b].map((c, i) => a * c + (1 - a) * below[i]);
  const behind = (e) => {
    if (!e) return [255, 255, 255];
    const color = parse(getComputedStyle(e).backgroundColor);
    return color[3] === 1 ? color.slice(0, 3) : over(color, behind(e.parentElement));
  };
  const light = (color) => {
    const [r, g, b] = color.map((c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const elements = [...document.querySelectorAll('body *')].filter(
    (e) => e.checkVisibility({ visibilityProperty: true, opacityProperty: true })
      && !e.closest('[disabled], [aria-hidden=true]')
      && (e.matches('input:not([type=range]):not([type=checkbox]), select') ||
        [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim())));
  const poor = elements.flatMap((e) => {
    const style = getComputedStyle(e);
    const back = behind(e);
    const ink = e instanceof SVGElement ? style.fill : style.color;
    const [low, high] = [light(over(parse(ink), back)), light(back)].sort((a, b) => a - b);
    const ratio = (high + 0.05) / (low + 0.05);
    const size = parseFloat(style.fontSize);
    const large = size >= 24 || (size >= 18.66 && style.fontWeight >= 700);
    return ratio < (large ? 3 : 4.5) ? [`${ratio.toFixed(2)}: ${e.outerHTML.slice(0, 90)}`] : [];
  });
  return { count: elements.length, poor };
};

async function text_has_contrast() {
  for (const url of [server.url, viewer]) {
    const page = await open(url);
    for (const colorScheme of ['light', 'dark']) {
      await page.emulateMedia({ colorScheme });
      await page.waitForFunction((wanted) => document.documentElement.dataset.theme === wanted, colorScheme);
      const { count, poor } = await page.evaluate(contrasts);
      assert.ok(count > 10, `${count} texts`);
      assert.deepEqual(poor, [], `${colorScheme} ${url}`);
    }
    await page.context().close();
  }
}

// Notes the size of what is written on canvases, in pixels of the page, or of the picture that is saved.
const noteCanvases = () => {
  window.written = [];
  const plain = CanvasRenderingContext2D.prototype.fillText;
  CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) {
    const { canvas } = this;
    const { a, b } = this.getTransform();
    const drawn = parseFloat(/([\d.]+)px/.exec(this.font)[1]) * Math.hypot(a, b);
    window.written.push({
      text,
      size: canvas.isConnected ? (drawn * canvas.getBoundingClientRect().width) / canvas.width : drawn,
      where: canvas.id || canvas.className
    });
    return plain.call(this, text, ...rest);
  };
};

// The size of all letters that are there, in shadow trees, too, but for those of a chosen file's name, which is shown
// nowhere.
const letters = () => {
  const found = [...window.written];
  const walk = (root) => {
    for (const e of root.querySelectorAll('*')) {
      if (e.shadowRoot) walk(e.shadowRoot);
      if (!e.checkVisibility({ visibilityProperty: true }) || e.closest('.hidden, noscript')) continue;
      const file = e.type === 'file';
      const written = e.matches('input:not([type=range], [type=checkbox]), select') ||
        [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim());
      if (!written) continue;
      const size = parseFloat(getComputedStyle(e, file ? '::file-selector-button' : null).fontSize)
        * (e instanceof SVGGraphicsElement ? e.getScreenCTM().a : 1);
      found.push({ text: e.textContent.trim().slice(0, 40) || e.id, size, where: e.closest('[id]')?.id ?? e.tagName });
    }
  };
  walk(document);
  return found;
};

async function checkLetters(page, what, ...wanted) {
  const found = await page.evaluate(letters);
  assert.deepEqual(found.filter(({ size }) => size < 11.99), [], what);
  for (const place of wanted)
    assert.ok(
      found.some(({ where, text }) => where === place || text === place), `${what}: nothing is written in '${place}'`);
}

// Notices go after some seconds, which is no matter of their letters.
function keepNotices() {
  const plain = window.setTimeout;
  window.setTimeout = (act, milliseconds, ...rest) =>
    plain(act, milliseconds === 4000 ? 2 ** 30 : milliseconds, ...rest);
}

// Everything opened: all of the panel, and what lies over the picture.
async function letters_are_large_enough() {
  const page = await openPage(browser, server.url, { permissions: ['clipboard-write'] });
  await page.addInitScript(noteCanvases);
  await page.addInitScript(keepNotices);
  await page.goto(server.url);
  await page.getByText('Levels and files').first().click();
  await checkLetters(page, 'catalogue', 'Certified error at most', 'VTU', '152\u202fkB');
  const everything =
    '&isosurfaces=0.4&zone=1&vectors=arrows&threshold=0,0.9&clip=z@0.9&line=0,0.1,0.2,1,0.9,0.8'
    + '&pins=0.5,0.5,0.25;0.2,0.2,0.5&volume=1&volumeSize=48&surface=glass';
  for (const [id, more, ...wanted] of [[
         'fin', everything, 'line-words', 'line-drawing', 'pins', 'zone-words', 'vector-field', 'plot', 'scalarbar',
         'compass', 'Y'
       ],
         ['cells', '&cells=material&regions=material', 'region-list', 'cells'],
         ['series_moving', '&step=3', 'player-now', 'player-speed']]) {
    await page.goto('about:blank');
    await page.goto(`${server.url}view/${id}#slices=x@0.5${more}`);
    await firstPicture(page);
    await page.waitForFunction(() => !document.getElementById('controls').inert);
    for (const details of await page.locator('#controls details').all())
      await details.evaluate((e) => {
        e.open = true;
      });
    if (id === 'fin') await page.locator('#line-drawing text').first().waitFor();
    if (id === 'cells') await page.locator('#region-list label').first().waitFor();
    if (id === 'series_moving') await page.locator('#player').waitFor();
    await settled(page);
    await page.locator('#copy-link').click(); // a notice
    await page.locator('#notice-share').waitFor();
    await page.mouse.move(...await page.evaluate(() => {
      const { width, height } = document.getElementById('picture').getBoundingClientRect();
      const places = Array.from(
        { length: 400 }, (_, i) => [(0.1 + (i % 20) / 25) * width, (0.1 + Math.floor(i / 20) / 25) * height]);
      return places.find(
        (place) => window.tetlod.scene.pick(...place) && document.elementFromPoint(...place).closest('#picture'));
    }));
    await page.locator('#probe').waitFor();
    await checkLetters(page, id, 'notice-share', 'probe', 'controls', 'name', 'about', ...wanted);
    await page.keyboard.press('?');
    await page.locator('#keys kbd').first().waitFor();
    await checkLetters(page, id, 'keys');
    await page.keyboard.press('Escape');
  }
  await page.context().close();
}

// A picture that is smaller than on the screen has letters of the same size, and fewer of them.
async function letters_of_saved_pictures() {
  const page = await openPage(browser, server.url);
  await page.addInitScript(noteCanvases);
  await page.goto(`${viewer}&pins=0.5,0.5,0.25`);
  await firstPicture(page);
  await settled(page);
  for (const [width, height] of [[300, 260], [700, 500], [2000, 1500]]) {
    await page.locator('#png-width').fill(String(width));
    await page.locator('#png-height').fill(String(height));
    await page.evaluate(() => { window.written.length = 0; });
    await Promise.all([page.waitForEvent('download'), page.locator('#save-png').click()]);
    const written = await page.evaluate(() => window.written.filter(({ where }) => !where));
    assert.ok(written.some(({ text }) => text === 'x') && written.some(({ text }) => text === '1'),
      `${written.map(({ text }) => text)}`);
    assert.deepEqual(written.filter(({ size }) => size < 11.99), [], `${width} x ${height}`);
  }
  await page.context().close();
}

async function letters_of_the_element() {
  const page = await openPage(browser, server.url);
  await page.addInitScript(noteCanvases);
  const html =
    `<!doctype html><title>t</title><script type="module" src="/element.js"></script>
<tetlod-view src="/v1/meshes/fin" error="10%"></tetlod-view>`;
  await page.route(`${server.url}host.html`, (route) => route.fulfill({ contentType: 'text/html', body: html }));
  await page.goto(`${server.url}host.html`);
  await page.waitForFunction(() => document.querySelector('tetlod-view').shadowRoot?.querySelector('.over text'));
  await checkLetters(page, 'element', 'x', 'bar');
  await page.context().close();
}

// What a screen reader is given: the browser's own tree of roles and names, without what it ignores.
async function treeOf(page, cdp) {
  const { nodes } = await cdp.send('Accessibility.getFullAXTree');
  return nodes
    .filter(({ ignored }) => !ignored)
    .map(({ role, name, description, value, properties = [], backendDOMNodeId }) => ({
      role: role.value, name: name?.value ?? '', description: description?.value ?? '', value: value?.value,
      live: properties.find((property) => property.name === 'live')?.value.value, backendDOMNodeId,
    }));
}

const controls = ['button', 'checkbox', 'combobox', 'link', 'slider', 'textbox', 'searchbox', 'spinbutton', 'switch'];
const structure = ['complementary', 'region', 'toolbar', 'heading', 'application', 'image', 'DisclosureTriangle'];

// Every control has a name of its own, every slider says what its number means, and the picture is there in words,
// which are told when they change.
async function a_screen_reader_is_told_everything() {
  const everything = '&pins=0.5,0.3,0.1;0.2,0.2,0.2&line=0,0.1,0.2,1,0.9,0.8&box=0,0,0,1,1,0.9&threshold=0,0.9&zone=1';
  for (const url of [server.url, `${viewer}${everything}`, `${server.url}view/cells#cells=material&regions=material`,
    `${server.url}view/series_moving#step=3`]) {
    const page = await open(url);
    const cdp = await page.context().newCDPSession(page);
    const isView = url.includes('/view/');
    if (isView) await page.locator('#spoken').waitFor({ state: 'attached' });
    if (url.includes('pins')) await page.locator('#line-drawing .line').waitFor({ state: 'attached' });
    if (url.includes('regions=')) await page.locator('#region-list label').first().waitFor();
    for (const details of await page.locator('details').all()) await details.evaluate((e) => { e.open = true; });
    const tree = await treeOf(page, cdp);
    const used = tree.filter(({ role }) => controls.includes(role));
    assert.ok(used.length > (isView ? 50 : 20), `${used.length} controls of ${url}`);
    const toName = [...controls, ...structure];
    const unnamed = tree.filter(({ role, name }) => toName.includes(role) && !name.trim());
    assert.deepEqual(unnamed, [], `without a name: ${url}`);
    for (const { name, backendDOMNodeId } of used.filter(({ role }) => role === 'slider')) {
      const { object } = await cdp.send('DOM.resolveNode', { backendNodeId: backendDOMNodeId });
      const { result } = await cdp.send('Runtime.callFunctionOn', {
        objectId: object.objectId, functionDeclaration: 'function () { return this.ariaValueText ?? ""; }',
      });
      assert.ok(result.value, `the slider '${name}' says nothing but its number`);
    }
    if (isView) {
      // 'add' four times, 'CSV' twice would tell nobody what for: what is named alike is described
      const alike = used.filter(({ role, name, description }, i) => role !== 'link' && used.some((other, k) =>
        k !== i && other.role === role && other.name === name && other.description === description));
      assert.deepEqual(alike.map(({ name }) => name), [], url);
      const roles = tree.map(({ role }) => role);
      assert.deepEqual(['main', 'complementary', 'toolbar'].filter((role) => !roles.includes(role)), []);
      const picture = tree.find(({ role }) => role === 'application');
      assert.match(picture.description, /^.+: .*\. .+[%t] .*tetrahedra\.$/);
    } else {
      const links = used.filter(({ role }) => role === 'link').map(({ name }) => name);
      const sizes = links.filter((name) => /^[\d.]+\s%: \d.* tetrahedra, [\d.]+\s.?B$/.test(name));
      assert.ok(sizes.length >= 3, links.join(' | '));
    }
    await page.context().close();
  }
  await what_changes_is_told();
}

// Notes what is done every so often, so that a test need not wait for it.
const noteIntervals = () => {
  const plain = window.setInterval;
  window.ticks = [];
  window.setInterval = (act, ...rest) => {
    window.ticks.push(act);
    return plain(act, ...rest);
  };
};

const changesAtRest = async () => {
  const frame = () => new Promise((resolve) => requestAnimationFrame(resolve));
  const changed = [];
  for (const tick of window.ticks) tick(); // of what was before
  await frame();
  await frame();
  const note = (records) => changed.push(...records.map(({ target }) => target.id || target.nodeName));
  const observer = new MutationObserver(note);
  observer.observe(document.body, { childList: true, subtree: true, characterData: true });
  for (const tick of window.ticks) tick();
  await frame();
  await frame();
  observer.disconnect();
  return { changed, ticks: window.ticks.length };
};

async function what_changes_is_told() {
  const page = await openPage(browser, server.url);
  await page.addInitScript(noteIntervals);
  await page.goto(viewer);
  await firstPicture(page);
  await settled(page);
  const cdp = await page.context().newCDPSession(page);
  const words = () => page.locator('#spoken').innerText();
  await page.waitForFunction(() => /tetrahedra\.$/.test(document.getElementById('spoken')?.textContent));
  const before = await words();
  assert.match(before, /^Pressure: the far walls, 1 slice, 1 isosurface, clipped\. Pressure ≤ [\d.]+\s%/);
  const live = (await treeOf(page, cdp)).filter(({ live: is }) => is === 'polite');
  assert.ok(live.length >= 2, `${live.length} live regions`);
  const { changed, ticks } = await page.evaluate(changesAtRest);
  assert.ok(ticks > 0 && !changed.length, `of ${ticks} ticks: ${changed}`);
  await page.locator('#error-percent').fill('2');
  await page.keyboard.press('Enter');
  await page.waitForFunction((was) => document.getElementById('spoken').textContent !== was, before);
  const { error, tets } = await page.evaluate(() => {
    const level = window.tetlod.viewer.info.levels[window.tetlod.level];
    return { error: level.errors.Pressure.max, tets: level.tets };
  });
  assert.ok(error <= 0.02 && (await words()).replace(/[^\d]/g, '').endsWith(String(tets)), await words());
  await page.locator('#help-open').focus();
  await page.keyboard.press('Enter');
  await page.locator('#help').waitFor();
  assert.equal(await page.evaluate(() => document.activeElement.id), 'help'); // its name is told, not its last link's
  await page.keyboard.press('Escape');
  assert.equal(await page.evaluate(() => document.activeElement.id), 'help-open');
  await page.context().close();
}

async function a_small_screen_is_enough() {
  for (const url of [server.url, viewer]) {
    const page = await open(url, { viewport: { width: 360, height: 640 }, hasTouch: true });
    const { wide, outside } = await page.evaluate(() => ({
      wide: document.documentElement.scrollWidth,
      outside: [...document.querySelectorAll('button, a[href], input, select')]
                 .filter((e) => e.checkVisibility({ visibilityProperty: true })
                     && !e.closest('.knob, details:not([open])') && e.getBoundingClientRect().right > 361)
                 .map((e) => e.outerHTML.slice(0, 90)),
    }));
    assert.ok(wide <= 360, `${url} is ${wide} pixels wide`);
    assert.deepEqual(outside, []);
    await page.context().close();
  }
}

// Figures of any length have room: those of the finest level that is not exact are the longest.
async function figures_do_not_overlap() {
  const page = await open(viewer);
  await page.evaluate(() => {
    const { stream, set } = window.tetlod;
    set({ error: Math.min(...stream.info.levels.map((l) => l.errors.Pressure.max).filter((e) => e > 0)) });
  });
  await settled(page);
  for (const viewport of [{ width: 1200, height: 800 }, { width: 700, height: 360 }, { width: 360, height: 640 }]) {
    await page.setViewportSize(viewport);
    const over = await page.evaluate(() => [...document.querySelectorAll('#shown dd')].flatMap((e) => {
      const text = document.createRange();
      text.selectNodeContents(e);
      const room = e.parentElement.getBoundingClientRect().right - text.getBoundingClientRect().right;
      return room < 0 ? [`${e.innerText}: ${room}`] : [];
    }));
    assert.deepEqual(over, [], JSON.stringify(viewport));
  }
  await page.context().close();
}

// On a wide and low screen the controls are beside the picture, on a high one under it.
async function the_picture_keeps_most_of_the_screen() {
  const page = await open(viewer);
  for (const viewport of [{ width: 740, height: 360 }, { width: 390, height: 800 }, { width: 1200, height: 800 }]) {
    await page.setViewportSize(viewport);
    const { width, height } = await page.locator('#stage').boundingBox();
    assert.ok(
      width * height > 0.5 * viewport.width * viewport.height, `${width} x ${height} of ${JSON.stringify(viewport)}`);
  }
  await page.context().close();
}

// What can be in the picture is seen without scrolling.
async function layers_are_above_the_fold() {
  const page = await open(`${server.url}view/fin`);
  for (const viewport of [{ width: 1280, height: 800 }, { width: 1024, height: 700 }]) {
    await page.setViewportSize(viewport);
    for (const id of ['surface', 'edges', 'slices', 'add-isosurface', 'vectors', 'volume', 'threshold', 'clip']) {
      const { y, height } = await page.locator(`#${id}`).evaluate(
        (e) => (e.id === 'clip' ? e.previousElementSibling : e).getBoundingClientRect().toJSON());
      assert.ok(height > 0 && y + height <= viewport.height, `${id} ends at ${y + height} of ${viewport.height}`);
    }
  }
  await page.context().close();
}

async function levels_jump_where_motion_is_unwanted() {
  const page = await open(viewer, { reducedMotion: 'reduce' });
  await page.evaluate(() => {
    window.between = [];
    window.tetlod.stream.addEventListener('pictures', ({ detail }) => window.between.push(detail.t));
  });
  await page.locator('#error-percent').fill('1');
  await page.keyboard.press('Enter');
  await settled(page);
  const moves = await page.evaluate(() => window.between);
  assert.ok(moves.length && moves.every((t) => t === 1), `${moves}`);
  await page.context().close();
}

await run([
  every_control_is_reached_by_tab, what_is_removed_leaves_the_focus_near, text_has_contrast, letters_are_large_enough,
  letters_of_saved_pictures, letters_of_the_element, a_screen_reader_is_told_everything, a_small_screen_is_enough,
  figures_do_not_overlap, the_picture_keeps_most_of_the_screen, layers_are_above_the_fold,
  levels_jump_where_motion_is_unwanted
]);
await browser.close();
await server.stop();
