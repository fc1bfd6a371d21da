// SPDX-License-Identifier: BSD-3-Clause
// What leaves the page: a picture with its scalar bar, axes, line and probes, and a link that shows the same again.

import { byId, element } from './dom.js';
import { notice } from './notices.js';
import { withTexts } from './png_text.js';

const beside = 220; // pixels at both sides of the scalar bar, where the compass is
const narrow = 200; // a bar that would be narrower has the width for itself

// Makes the bar as narrow as a picture that is `room` pixels wide needs it; whether there is room for the compass, too.
function fitBar(bar, room) {
  const { width } = bar.getBoundingClientRect();
  const both = room - beside >= Math.min(width, narrow);
  bar.style.width = `${Math.min(width, room - (both ? beside : 20))}px`;
  return both;
}

// What lies over the picture, beside it as on the screen, below, in the middle or at the left, and never smaller: words
// can be read in any picture.
function drawOver(context, shot, { redraw, layers }) {
  const { width, height } = shot;
  const stage = byId('stage').getBoundingClientRect();
  const factor = Math.max(1, Math.min(width / stage.width, height / stage.height));
  for (const layer of layers) layer.drawOn(context, shot, factor);
  const [bar, compass] = ['scalarbar', 'compass'].map(byId);
  const room = width / factor;
  const over = (room >= stage.width || fitBar(bar, room)
      ? [bar, compass]
      : [bar]).filter((canvas) => canvas.getBoundingClientRect().width);
  for (const canvas of over) canvas.dataset.pixels = factor;
  redraw();
  for (const canvas of over) {
    const box = canvas.getBoundingClientRect();
    const left = canvas === compass ? (box.left - stage.left) * factor
                                    : width / 2 + (box.left - stage.left - stage.width / 2) * factor;
    const place = [left, height - (stage.bottom - box.top) * factor, box.width * factor, box.height * factor];
    context.fillStyle = getComputedStyle(canvas).backgroundColor;
    context.fillRect(...place);
    context.drawImage(canvas, ...place);
    delete canvas.dataset.pixels;
  }
  bar.style.width = '';
  redraw();
}

/**
 * `size`: [width, height], if not as on the screen; `texts`: the texts that the file contains; `redraw()` draws the bar
 * and the compass anew; `layers`: what else lies over the picture, each with `drawOn`.
 */
export async function savePicture(scene, name, { texts, ...shown }) {
  const canvas = await pictureOf(scene, shown);
  const blob = await new Promise((done) => canvas.toBlob(done, 'image/png'));
  saveFile(`${name}.png`, withTexts(blob, texts));
}

// Two pictures of one size as the screen has them: the second right of the curtain, or beside the first.
function joined(first, second, curtain) {
  const { width, height } = first;
  const canvas = element('canvas', { width: curtain === null ? 2 * width : width, height });
  const context = canvas.getContext('2d');
  context.drawImage(first, 0, 0);
  const from = curtain === null ? 0 : Math.round(curtain * width);
  const part = [width - from, height];
  if (from < width) context.drawImage(second, from, 0, ...part, canvas.width - width + from, 0, ...part);
  return canvas;
}

/**
 * The same as a canvas. `beside`: { picture(size), curtain } of the second view, if there is one; `curtain`: where that
 * is across the picture, null: none.
 */
export async function pictureOf(scene, { size, beside, ...over }) {
  const half = size && beside?.curtain === null;
  const canvas = await onePicture(scene, { size: half ? [Math.round(size[0] / 2), size[1]] : size, ...over });
  return beside ? joined(canvas, await beside.picture([canvas.width, canvas.height]), beside.curtain) : canvas;
}

async function onePicture(scene, { size, redraw, layers }) {
  const shot = await scene.capture(size);
  const canvas = element('canvas', { width: shot.width, height: shot.height });
  const context = canvas.getContext('2d');
  context.drawImage(shot, 0, 0);
  drawOver(context, shot, { redraw, layers });
  return canvas;
}

export function saveFile(name, blob) {
  const url = URL.createObjectURL(blob);
  element('a', { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
  notice('share', `Saved ${name}`);
}

export async function copyLink() {
  try {
    await navigator.clipboard.writeText(location.href);
    notice('share', 'The link to this picture is copied.');
  } catch {
    // no clipboard without HTTPS, or it is forbidden: the link can be copied by hand
    const field = element('input', { value: location.href, readOnly: true, ariaLabel: 'Link to this picture' });
    notice('share', 'Link', { seconds: 0, children: [field] });
    field.select();
  }
}
