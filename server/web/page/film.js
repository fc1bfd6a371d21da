// SPDX-License-Identifier: BSD-3-Clause
// A film of what is shown: once around it, or the steps of a series. Frames are drawn first, however long that takes,
// and recorded at their pace afterwards.

import { byId, element } from './dom.js';
import { add, cross, dot, scale, unit } from './geometry.js';
import { button, clear, notice, reword } from './notices.js';
import { clamp, parseNumber } from './numbers.js';
import { row } from './rows.js';

const rate = 25; // frames a second, once around
const stepRate = 10;
const longest = 60; // seconds
const kinds = ['video/webm;codecs=vp9', 'video/webm;codecs=vp8', 'video/webm', 'video/mp4'];

// A vector turned about an axis (Rodrigues).
function turned(v, axis, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return add(add(scale(v, c), cross(axis, v), s), axis, dot(axis, v) * (1 - c));
}

/** The camera `place` of scene.camera(), turned about the middle of the picture. */
export function orbited(place, angle) {
  const [position, focal, up] = [0, 3, 6].map((i) => place.slice(i, i + 3));
  const from = turned(add(position, focal, -1), unit(up), angle);
  return [...add(focal, from), ...place.slice(3)];
}

// Each frame is made by `show(i)`; false: somebody stopped it.
async function drawFrames(count, show, picture, told) {
  const frames = [];
  for (let i = 0; i < count; i++) {
    if (!told(i)) return null;
    await show(i);
    const canvas = await picture();
    frames.push(
      await new Promise((done) => {
        canvas.toBlob(done, 'image/webp', 0.95);
      }),
    );
  }
  return frames;
}

// In real time: recorders take the clock's.
async function record(frames, perSecond) {
  const type = kinds.find((kind) => MediaRecorder.isTypeSupported(kind));
  if (!type) throw new Error('this browser records no films');
  const first = await createImageBitmap(frames[0]);
  const canvas = element('canvas', { width: first.width & ~1, height: first.height & ~1 });
  const context = canvas.getContext('2d');
  const stream = canvas.captureStream(0);
  const recorder = new MediaRecorder(stream, { mimeType: type, videoBitsPerSecond: 12e6 });
  const parts = [];
  recorder.addEventListener('dataavailable', ({ data }) => parts.push(data));
  const ended = new Promise((resolve) => {
    recorder.addEventListener('stop', resolve);
  });
  recorder.start();
  for (const [i, frame] of frames.entries()) {
    const due = new Promise((resolve) => {
      setTimeout(resolve, 1000 / perSecond);
    });
    context.drawImage(i ? await createImageBitmap(frame) : first, 0, 0);
    stream.getVideoTracks()[0].requestFrame();
    await due;
  }
  recorder.stop();
  await ended;
  return new Blob(parts, { type: type.split(';')[0] });
}

/** `picture()`: a canvas with the picture as it would be saved; `save(ending, blob)`. */
export function bindFilm(viewer, { picture, save }) {
  const { scene, store } = viewer;
  const choice = element('select', { id: 'film-of', className: 'tight', ariaLabel: 'Film' });
  const seconds = element('input', { id: 'film-seconds', className: 'number tight', inputMode: 'decimal', value: '6' });
  seconds.ariaLabel = 'Length of the film, in seconds';
  const make = element(
    'button',
    { type: 'button', id: 'film', className: 'small', title: 'Draws each frame, and saves them as a film' },
    'WebM',
  );
  byId('save-png')
    .closest('.row')
    .after(row('Film', element('span', { className: 'buttons' }, choice, seconds, make)));
  const list = () => {
    const ways = [['orbit', 'once around'], ...(viewer.series ? [['steps', 'all steps']] : [])];
    choice.replaceChildren(...ways.map(([value, text]) => element('option', { value }, text)));
    choice.dispatchEvent(new Event('change'));
  };
  choice.addEventListener('change', () => {
    seconds.hidden = choice.value === 'steps';
  });
  viewer.addEventListener('series', list);
  list();

  async function film() {
    const { step } = store.state;
    const place = scene.camera();
    const steps = choice.value === 'steps';
    const perSecond = steps ? stepRate : rate;
    const count = steps
      ? viewer.series.times.length
      : Math.max(2, Math.round(rate * clamp(parseNumber(seconds.value) || 6, 0.1, longest)));
    const show = steps
      ? async (i) => {
          await viewer.showStep(i, { band: viewer.wantedBand });
          await Promise.all([viewer.subtracting, viewer.beside?.showStep(i)]);
        }
      : (i) => scene.setCamera(orbited(place, (2 * Math.PI * i) / count));
    let stopped = false;
    const stop = button('Stop', () => {
      stopped = true;
    });
    notice('film', 'The film begins…', { seconds: 0, children: [stop] });
    const told = (i) => {
      reword('film', `Frame ${i + 1} of ${count}`);
      return !stopped;
    };
    try {
      const frames = await drawFrames(count, show, picture, told);
      if (!frames) return;
      notice('film', 'The film is recorded…', { seconds: 0 });
      const blob = await record(frames, perSecond);
      save(`film.${blob.type.split('/')[1]}`, blob);
    } finally {
      clear('film');
      if (steps) viewer.refine();
      else scene.setCamera(place);
      store.set({ step });
      if (steps && step !== null) viewer.beside?.showStep(step);
    }
  }
  make.addEventListener('click', async () => {
    make.disabled = true;
    await film().catch(({ message }) => notice('share', `The film is not made: ${message}`, { failed: true }));
    make.disabled = false;
  });
}
