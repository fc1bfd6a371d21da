// SPDX-License-Identifier: BSD-3-Clause
// How often a level on the way to the goal gets a picture: as often as it costs decoding little.

const slice = 100;       // milliseconds of decoding from one picture to the next, at least
const mostShare = 0.2;   // of the time of decoding that pictures may take

export class Pace {
  #since = 0;            // milliseconds of decoding since the last picture
  #drawing = { time: 0, tets: 1 }; // milliseconds that the last picture took, of so many tetrahedra

  decoded(time) {
    this.#since += time;
  }

  drew(time, tets) {
    this.#since = 0;
    this.#drawing = { time, tets };
  }

  /** Is it time for one of so many tetrahedra? It takes longer than the last one did, in proportion at most. */
  isDue(tets) {
    const { time, tets: drawn } = this.#drawing;
    return this.#since >= Math.max(slice, (Math.min(2, tets / drawn) * time) / mostShare);
  }
}
