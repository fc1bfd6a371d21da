// SPDX-License-Identifier: BSD-3-Clause
// What the browser tests share: Chromium without a window, pages whose complaints are kept.
import { existsSync } from 'node:fs';
import { createRequire } from 'node:module';
import { fileURLToPath } from 'node:url';

const root = fileURLToPath(new URL('../../', import.meta.url));
const { chromium } = createRequire(`${root}server/web/package.json`)('playwright-core');
// The shell is the engine of the whole browser without its windows: all these tests take a quarter less processor time.
const executablePath =
  ['/usr/bin/chromium-headless-shell', '/usr/bin/chromium', '/usr/bin/google-chrome'].find(existsSync);

export async function launch() {
  // SwiftShader draws WebGL on the processor: the same picture on every machine. It would draw the page around it, too,
  // which takes it three times as long as Chromium without it.
  return chromium.launch({
    executablePath,
    args: [
      '--headless=new', '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
      '--ignore-gpu-blocklist', '--disable-gpu-compositing'
    ],
  });
}

// In the page: every notice that came, also those that have gone.
function rememberNotices() {
  window.notices = [];
  new MutationObserver((records) => {
    const added =
      records.flatMap(({ addedNodes }) => [...addedNodes]).filter((node) => node.classList?.contains('notice'));
    window.notices.push(...added.map(({ id, textContent }) => ({ key: id.replace('notice-', ''), text: textContent })));
  }).observe(document, { childList: true, subtree: true });
}

// A page that remembers what went wrong (`complaints`), which other hosts were asked (`strangers`), and its notices.
export async function openPage(browser, origin, options = {}) {
  const context =
    await browser.newContext({ viewport: { width: 960, height: 640 }, acceptDownloads: true, ...options });
  const page = await context.newPage();
  page.setDefaultTimeout(120000); // what has not come by then, on however slow a machine, will not come
  await page.addInitScript(rememberNotices);
  page.complaints = [];
  page.strangers = [];
  page.on('pageerror', (error) => page.complaints.push(String(error.stack ?? error)));
  // where the machine's network changes meanwhile, Chromium breaks off requests to any host; the viewer asks again
  page.on('console', (message) => message.type() === 'error' && !message.text().endsWith('ERR_NETWORK_CHANGED')
    && page.complaints.push(message.text()));
  page.on('request', (request) => {
    const url = request.url();
    if (!url.startsWith(origin) && !/^(data|blob):/.test(url)) page.strangers.push(url);
  });
  return page;
}

// The text of the first notice with this key and these words, once it has come: by then it may have gone again.
export const noticed = (page, key, words = '') =>
  page
    .waitForFunction(
      (wanted) =>
        window.notices.find((notice) => notice.key === wanted.key && notice.text.includes(wanted.words))?.text,
      { key, words })
    .then((text) => text.jsonValue());

// Until the viewer has a picture.
export const firstPicture = (page) =>
  page.waitForFunction(() => window.tetlod?.level >= 0 && document.getElementById('loading').hidden);

// Until the stream is at the level that the state asks for.
export const settled = (page) => page.waitForFunction(() => window.tetlod?.settled);

// How much of the picture is not background, and how many colours it has.
export const pictureFigures = (page) => page.evaluate(async () => {
  const image = await window.tetlod.scene.capture();
  const canvas = new OffscreenCanvas(image.width, image.height);
  const context = canvas.getContext('2d');
  context.drawImage(image, 0, 0);
  const pixels = new Uint32Array(context.getImageData(0, 0, image.width, image.height).data.buffer);
  const colors = new Set(pixels);
  return { covered: pixels.reduce((n, p) => n + (p !== pixels[0]), 0) / pixels.length, colors: colors.size };
});
