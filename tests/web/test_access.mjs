// SPDX-License-Identifier: BSD-3-Clause
// Whether everybody can use the page: by keyboard alone, with contrast, on a small screen, without motion.
import assert from 'node:assert/strict';
import { launch, openPage, firstPicture, settled } from './browser.mjs';
import { program, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

const server = await program([sampleStream().path]);
const browser = await launch();
const viewer = `${server.url}view/fin#error=0.1&slices=x@0.5&isosurfaces=0.4&clip=z@0.7`;

async function open(url, options) {
  const page = await openPage(browser, server.url, options);
  await page.goto(url);
  if (url.includes('/view/')) {
    await firstPicture(page);
    await settled(page);
  } else await page.getByRole('link', { name: 'View' }).waitFor();
  return page;
}

async function every_control_is_reached_by_tab() {
  const page = await open(viewer);
  const wanted = await page.evaluate(() => {
    const all = [...document.querySelectorAll('a[href], button, input, select, summary, [tabindex="0"]')]
      .filter((e) => !e.disabled && e.checkVisibility({ visibilityProperty: true }) && !e.closest('dialog:not([open]), details:not([open]) > :not(summary)'));
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
  const elements = [...document.querySelectorAll('body *')].filter((e) => e.checkVisibility({ visibilityProperty: true, opacityProperty: true })
    && !e.closest('[disabled], [aria-hidden=true]') && (e.matches('input:not([type=range]):not([type=checkbox]), select')
    || [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim())));
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

async function a_small_screen_is_enough() {
  for (const url of [server.url, viewer]) {
    const page = await open(url, { viewport: { width: 360, height: 640 }, hasTouch: true });
    const { wide, outside } = await page.evaluate(() => ({
      wide: document.documentElement.scrollWidth,
      outside: [...document.querySelectorAll('button, a[href], input, select')]
        .filter((e) => e.checkVisibility({ visibilityProperty: true }) && !e.closest('.knob, details:not([open])') && e.getBoundingClientRect().right > 361)
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
    assert.ok(width * height > 0.5 * viewport.width * viewport.height, `${width} x ${height} of ${JSON.stringify(viewport)}`);
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

await run([every_control_is_reached_by_tab, text_has_contrast, a_small_screen_is_enough, figures_do_not_overlap, the_picture_keeps_most_of_the_screen,
  levels_jump_where_motion_is_unwanted]);
await browser.close();
await server.stop();
