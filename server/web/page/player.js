// SPDX-License-Identifier: BSD-3-Clause
// The bar that plays a series in time: steps one after the other; late ones, or missing ones, in a coarser band.

import { element, svg } from './dom.js';
import { percent, significant } from './numbers.js';

const rates = [1, 2, 5, 10, 15, 30]; // steps a second
const usual = 10;
const patience = 1.5; // intervals that a step may take before it is late
const longest = 8; // and before it is not waited for any more,
const least = 1000; // but at least so many milliseconds
const recovered = 16; // steps in time after which a finer band is tried again
const blended = 0.8; // of an interval: what is left is for decoding

const sleep = (milliseconds) =>
  new Promise((resolve) => {
    setTimeout(resolve, milliseconds);
  });

// Fields that only the first step has.
function wordsOfStill({ info, series }) {
  const still = info.fields
    .map(({ name }) => name)
    .filter((name) => !series.fields.some((field) => field.name === name));
  return still.length ? `${still.join(', ')}: no steps; every step shows the values of the first.` : '';
}

export class Player {
  #viewer;
  #parts;
  #playing = null;
  #rate = usual;
  #loop = true;
  // #playing: what tells one play from the next, which may begin while a step of the one before is on its way
  #coarser = 0; // bands below the wanted one, because the steps come late
  #inTime = 0; // steps since one was late

  /** `stage`: where the bar goes; `above`: what lies over it, if there is anything. The viewer's stream is a series. */
  constructor(viewer, stage, above = '') {
    this.#viewer = viewer;
    const { times } = viewer.series;
    const button = (id, label, text, act) => {
      const made = element(
        'button',
        { type: 'button', id, part: id, className: 'small', ariaLabel: label, title: label },
        text,
      );
      made.addEventListener('click', act);
      return made;
    };
    const line = element('input', {
      type: 'range',
      id: 'player-step',
      part: 'player-step',
      min: 0,
      max: times.length - 1,
      step: 1,
      value: 0,
      ariaLabel: 'Step in time',
    });
    line.addEventListener('input', () => this.go(Number(line.value)));
    const speed = element(
      'select',
      { id: 'player-speed', ariaLabel: 'Steps a second' },
      ...rates.map((rate) => element('option', { value: rate, selected: rate === usual }, `${rate} /s`)),
    );
    speed.addEventListener('change', () => {
      this.#rate = Number(speed.value);
    });
    const buffer = svg('svg', {
      id: 'player-buffer',
      viewBox: `0 0 ${times.length} 1`,
      preserveAspectRatio: 'none',
      'aria-hidden': 'true',
    });
    this.#parts = {
      line,
      buffer,
      play: button('player-play', 'Play (space)', '▶', () => this.toggle()),
      loop: button('player-loop', 'Begin again at the end', '⟲', () => this.#setLoop(!this.#loop)),
      now: element('output', { id: 'player-now' }),
      late: element('p', { id: 'player-late', role: 'status' }),
      still: element('p', { id: 'player-still' }, wordsOfStill(viewer)),
    };
    const { play, loop, now, late, still } = this.#parts;
    const buttons = element(
      'span',
      { className: 'buttons' },
      button('player-back', 'One step back (,)', '‹', () => this.step(-1)),
      play,
      button('player-on', 'One step on (.)', '›', () => this.step(1)),
      loop,
      speed,
    );
    stage.append(
      element(
        'section',
        { id: 'player', part: 'player', ariaLabel: 'Time' },
        above,
        buttons,
        element('span', { className: 'track' }, line, buffer),
        now,
        late,
        still,
      ),
    );
    this.#setLoop(true);
    viewer.addEventListener('step', () => this.#tell());
    viewer.addEventListener('buffered', ({ detail }) => this.#drawBuffer(detail.steps));
    this.#tell();
  }

  get playing() {
    return this.#playing !== null;
  }

  toggle() {
    if (this.#playing) this.#stop();
    else this.#play();
  }

  /** Shows a step, and stays there. */
  go(step) {
    this.#stop();
    const { length } = this.#viewer.series.times;
    this.#viewer.store.set({ step: Math.min(Math.max(step, 0), length - 1) });
  }

  step(by) {
    this.go(this.#now + by);
  }

  get #now() {
    return this.#viewer.at?.step ?? this.#viewer.store.state.step ?? 0;
  }

  #setLoop(loop) {
    this.#loop = loop;
    this.#parts.loop.setAttribute('aria-pressed', loop);
  }

  #setPlaying(playing) {
    this.#playing = playing;
    this.#viewer.playing = playing !== null;
    this.#parts.play.textContent = playing ? '⏸' : '▶';
    this.#parts.play.ariaLabel = playing ? 'Pause (space)' : 'Play (space)';
  }

  // Where it stops is what the page shows from now on, as exactly as the state says.
  #stop() {
    if (!this.#playing) return;
    this.#setPlaying(null);
    this.#coarser = 0;
    this.#parts.late.textContent = '';
    this.#viewer.store.set({ step: this.#now });
    this.#viewer.refine();
  }

  // Behind the last step is the first; without loop it ends, and begins at the first if it is at the end.
  #following(begin) {
    const { length } = this.#viewer.series.times;
    if (this.#now + 1 < length) return this.#now + 1;
    return this.#loop || begin ? 0 : null;
  }

  async #play() {
    const mine = {};
    this.#setPlaying(mine);
    for (let begin = true; this.#playing === mine; begin = false) {
      const step = this.#following(begin);
      if (step === null) break;
      const interval = 1000 / this.#rate;
      const started = performance.now();
      const band = Math.max(this.#viewer.wantedBand - this.#coarser, 0);
      const shown = this.#viewer.showStep(step, { band, blend: step && interval > 60 ? blended * interval : 0 });
      const reached = await (band ? Promise.race([shown, sleep(Math.max(longest * interval, least))]) : shown);
      if (reached === false || this.#playing !== mine) break;
      const took = performance.now() - started;
      this.#adapt(took > patience * interval, band);
      if (took < interval) await sleep(interval - took);
    }
    if (this.#playing === mine) this.#stop();
  }

  #adapt(late, band) {
    this.#inTime = late ? 0 : this.#inTime + 1;
    if (late && band > 0) this.#coarser++;
    else if (this.#inTime >= recovered && this.#coarser) {
      this.#coarser--;
      this.#inTime = 0;
    }
    const { bands } = this.#viewer.series;
    const shown = bands[Math.max(this.#viewer.wantedBand - this.#coarser, 0)].error;
    this.#parts.late.textContent = this.#coarser ? `Steps come late: at ${percent(shown)} for now.` : '';
  }

  #tell() {
    const { times } = this.#viewer.series;
    const { line, now } = this.#parts;
    if (this.#viewer.at) this.#drawBuffer(this.#viewer.at.steps);
    line.value = this.#now;
    line.setAttribute('aria-valuetext', `step ${this.#now}, time ${significant(times[this.#now], 5)}`);
    now.textContent = `${significant(times[this.#now], 5)} · ${this.#now} of ${times.length - 1}`;
  }

  #drawBuffer(steps) {
    this.#parts.buffer.replaceChildren(
      ...steps.map(([from, to]) => svg('rect', { x: from, y: 0, width: to - from, height: 1 })),
    );
  }
}
