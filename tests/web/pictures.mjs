// SPDX-License-Identifier: BSD-3-Clause
// Pictures of the viewer as PNG files, small, and how far one is from another.
import { readFileSync } from 'node:fs';
import { firstPicture, openPage, settled } from './browser.mjs';

/** A page for the views of an origin. */
export const openViewer = (browser, origin, options) =>
  openPage(browser, origin, { viewport: { width: 900, height: 480 }, ...options });

/** Shows a stream with a state and waits until everything that it asks for is drawn. */
export async function showView(page, origin, id, state) {
  await page.goto('about:blank');
  await page.goto(`${origin}view/${
    id}#smooth=0&background=white&surface=solid&slices=&map=viridis&range=data&axes=0&sliceEdges=1&${state}`);
  await firstPicture(page);
  await settled(page);
  await page.waitForFunction(() => !window.tetlod.state.volume || window.tetlod.scene.volume?.actor.getVisibility());
}

/** The picture, without what lies over it, scaled to a width: PNG bytes. */
export async function capture(page, width) {
  const base64 = await page.evaluate(async (w) => {
    const image = await window.tetlod.scene.capture();
    const canvas = document.createElement('canvas');
    canvas.width = w;
    canvas.height = Math.round((w * image.height) / image.width);
    const context = canvas.getContext('2d');
    context.imageSmoothingQuality = 'high';
    context.drawImage(image, 0, 0, canvas.width, canvas.height);
    return canvas.toDataURL('image/png').split(',')[1];
  }, width);
  return Buffer.from(base64, 'base64');
}

/** The share of pixels that differ plainly, and the mean difference of all, of 255. */
export async function difference(page, path, picture) {
  return page.evaluate(async (sources) => {
    const [a, b] = await Promise.all(sources.map(async (base64) => {
      const image = new Image();
      image.src = `data:image/png;base64,${base64}`;
      await image.decode();
      const canvas = new OffscreenCanvas(image.width, image.height);
      const context = canvas.getContext('2d');
      context.drawImage(image, 0, 0);
      return context.getImageData(0, 0, image.width, image.height);
    }));
    if (a.width !== b.width || a.height !== b.height) return { plain: 1, mean: 255 };
    let sum = 0;
    let plain = 0;
    for (let i = 0; i < a.data.length; i += 4) {
      const steps = [0, 1, 2].map((c) => Math.abs(a.data[i + c] - b.data[i + c]));
      sum += steps[0] + steps[1] + steps[2];
      plain += Math.max(...steps) > 32;
    }
    return { plain: plain / (a.width * a.height), mean: sum / (3 * a.width * a.height) };
  }, [readFileSync(path).toString('base64'), picture.toString('base64')]);
}
