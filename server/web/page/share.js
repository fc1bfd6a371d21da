// SPDX-License-Identifier: BSD-3-Clause
// What leaves the page: a picture with its scalar bar and axes, and a link that shows the same again.

import { byId, element } from './dom.js';
import { notice } from './notices.js';
import { withTexts } from './png_text.js';

/** `texts`: what the file says of itself. */
export async function savePicture(scene, name, texts) {
  const shot = await scene.capture();
  const canvas = element('canvas', { width: shot.width, height: shot.height });
  const context = canvas.getContext('2d');
  context.drawImage(shot, 0, 0);
  const stage = byId('stage').getBoundingClientRect();
  const factor = shot.width / stage.width;
  for (const id of ['scalarbar', 'compass']) {
    const box = byId(id).getBoundingClientRect();
    if (!box.width) continue;
    const place = [(box.left - stage.left) * factor, (box.top - stage.top) * factor, box.width * factor, box.height * factor];
    context.fillStyle = getComputedStyle(byId(id)).backgroundColor;
    context.fillRect(...place);
    context.drawImage(byId(id), ...place);
  }
  const blob = await new Promise((done) => canvas.toBlob(done, 'image/png'));
  saveFile(`${name}.png`, withTexts(blob, texts));
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
