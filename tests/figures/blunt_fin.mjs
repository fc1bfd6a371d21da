// SPDX-License-Identifier: BSD-3-Clause
// node blunt_fin.mjs STREAM BOUNDED FOLDER: what the viewer shows of the blunt fin at several errors, side by side
// (blunt_levels.png): rendered as a volume, and its boundary with the cells' edges, as in Figures 4.7 and 4.8 of the
// thesis; and the viewer itself (viewer.png), and with a stream that has a local bound, coloured by it
// (local_bound.png). TETLOD names the program.
import { writeFileSync } from 'node:fs';
import { basename, join } from 'node:path';
import { launch } from '../web/browser.mjs';
import { program } from '../web/hosts.mjs';
import { capture, openViewer, showView } from '../web/pictures.mjs';

const [, , stream, bounded, folder] = process.argv;
const width = 270; // of each picture
const errors = [0, 0.002, 0.005, 0.01, 0.05];
const view = 'camera=20.4,-23,13.2,0.6,-1,-1,0,0,1&log=1'
    + '&range=manual&low=0.4&high=5';
const rows = [
  'surface=off&volume=1&volumeSize=128&opacity=0:0,0.2:0.004,0.3:0.03,0.6:0.2,1:0.6',
  'edges=1',
];
const size = { viewport: { width: 884, height: 360 }, deviceScaleFactor: 2 };

// Draws the pictures and what is under them; returns PNG bytes.
async function compose(browser, cells, labels) {
  const page = await browser.newPage();
  const base64 = await page.evaluate(async ({ cells: pictures, labels: texts }) => {
    const images = await Promise.all(pictures.map(async (row) => Promise.all(row.map(async (source) => {
      const image = new Image();
      image.src = `data:image/png;base64,${source}`;
      await image.decode();
      return image;
    }))));
    const [w, h] = [images[0][0].width, images[0][0].height];
    const canvas = new OffscreenCanvas(w * texts.length, h * images.length + 34);
    const context = canvas.getContext('2d');
    context.fillStyle = 'white';
    context.fillRect(0, 0, canvas.width, canvas.height);
    images.forEach((row, y) => row.forEach((image, x) => context.drawImage(image, x * w, y * h)));
    context.fillStyle = '#222';
    context.textAlign = 'center';
    texts.forEach((lines, x) => lines.forEach((line, i) => {
      context.font = `${i ? '' : 'bold '}13px sans-serif`;
      context.fillText(line, (x + 0.5) * w, images.length * h + 12 + 16 * i);
    }));
    const bytes = new Uint8Array(await (await canvas.convertToBlob()).arrayBuffer());
    return btoa(Array.from(bytes, (b) => String.fromCharCode(b)).join(''));
  }, { cells, labels });
  return Buffer.from(base64, 'base64');
}

const server = await program([stream, bounded]);
const browser = await launch();
const id = basename(stream, '.tetlod');
const small = await openViewer(browser, server.url, size);
const cells = rows.map(() => []);
const labels = [];
for (const error of errors) {
  for (const [i, row] of rows.entries()) {
    await showView(small, server.url, id, `error=${error}&${view}&${row}`);
    cells[i].push((await capture(small, width)).toString('base64'));
    const { tets, all } = await small.evaluate(() => {
      const { stream: { info }, level } = window.tetlod;
      return { tets: info.levels[level].tets, all: info.tets };
    });
    const text = `${tets.toLocaleString('en')} tetrahedra`;
    labels[errors.indexOf(error)] = [
      error ? `${+(100 * error).toPrecision(3)} %` : 'original',
      error ? `${text}, ${((100 * tets) / all).toFixed(1)} %` : text
    ];
  }
}
writeFileSync(join(folder, 'blunt_levels.png'), await compose(browser, cells, labels));
const whole =
  'error=0.01&camera=26.6,-29.1,19.4,0.6,-0.8,-0.8,0,0,1&log=1'
    + '&range=manual&low=0.4&high=5&surface=inside&slices=z@0.12&isosurfaces=0.2';
const page = await openViewer(browser, server.url, { viewport: { width: 1200, height: 720 }, colorScheme: 'light' });
await showView(page, server.url, id, whole);
writeFileSync(join(folder, 'viewer.png'), await page.screenshot());
const bound =
  'error=0.01&camera=26.6,-29.1,19.4,0.6,-0.8,-0.8,0,0,1'
    + '&range=auto&surface=inside&slices=z@0.12&field=Pressure%20bound';
await showView(page, server.url, basename(bounded, '.tetlod'), bound);
writeFileSync(
  join(folder, 'local_bound.png'), await page.screenshot({ clip: { x: 0, y: 0, width: 876, height: 720 } }));
await browser.close();
await server.stop();
