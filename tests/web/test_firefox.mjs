// SPDX-License-Identifier: BSD-3-Clause
// The viewer's page in Firefox: picture, refinement, layers, rays through the tetrahedra.
import assert from 'node:assert/strict';
import { launchFirefox, missing } from './firefox.mjs';
import { program, sampleStream } from './hosts.mjs';
import { run } from './tap.mjs';

async function firefox_draws_what_others_draw() {
  if (missing) return missing;
  const server = await program([sampleStream().path]);
  const firefox = await launchFirefox();
  await firefox.goto(`${server.url}view/fin#error=0.05&smooth=0&slices=`);
  const found = await firefox.run(async () => {
    const until = async (check) => {
      while (!check()) {
        const failed = document.querySelector('.notice.failed');
        if (failed) throw new Error(failed.innerText);
        await new Promise((resolve) => { setTimeout(resolve, 50); });
      }
    };
    const colors = async () => {
      await until(() => window.tetlod.settled);
      const image = await window.tetlod.scene.capture();
      const canvas = document.createElement('canvas');
      Object.assign(canvas, { width: image.width, height: image.height });
      const context = canvas.getContext('2d');
      context.drawImage(image, 0, 0);
      return new Set(new Uint32Array(context.getImageData(0, 0, image.width, image.height).data.buffer)).size;
    };
    await until(() => window.tetlod?.settled);
    const { level, stream: { info } } = window.tetlod;
    const first = await colors();
    document.getElementById('add-isosurface').click();
    window.tetlod.set({ error: 0.01 });
    await until(() => window.tetlod.level > level && window.tetlod.settled && window.tetlod.scene.isosurfaces[0]?.part);
    const { errors } = info.levels[window.tetlod.level];
    const second = await colors();
    window.tetlod.set({ volume: true, isosurfaces: [] });
    await until(() => window.tetlod.scene.rays && window.tetlod.scene.cells);
    const third = await colors();
    return {
      first,
      second,
      third,
      error: errors.Pressure.max,
      rays: window.tetlod.state.volumeSize === 0,
      words: document.getElementById('shown-error').innerText
    };
  });
  assert.ok(found.first > 200 && found.second > 200 && found.third > 200, JSON.stringify(found));
  assert.ok(found.error <= 0.01 && found.rays && found.words.includes('%'), JSON.stringify(found));
  firefox.close();
  await server.stop();
}

await run([firefox_draws_what_others_draw]);
