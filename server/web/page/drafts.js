// SPDX-License-Identifier: BSD-3-Clause
// While the camera moves and frames take long, a coarser level is drawn; what was there comes back when it rests.

const slow = 50; // milliseconds of a frame
const wanted = 35; // of one of the coarser level's
const fewest = 2000; // tetrahedra of that

export class Drafts {
  #viewer;
  #pictures = null;
  #asked = false;
  #last = 0;
  #slow = 0;
  #age = 0;

  constructor(viewer) {
    this.#viewer = viewer;
    viewer.addEventListener('pictures', () => this.#forget());
    viewer.scene.addEventListener('camera', () => this.#rest());
    viewer.scene.addEventListener('render', () => this.#look());
  }

  // Of what is no longer shown.
  #forget() {
    this.#pictures = null;
    this.#asked = false;
    this.#age++;
  }

  #rest() {
    this.#slow = 0;
    this.#last = 0;
    this.#viewer.scene.draft(null);
  }

  #look() {
    const { scene } = this.#viewer;
    const now = performance.now();
    const took = scene.interactor.isAnimating() && this.#last ? now - this.#last : 0;
    this.#last = scene.interactor.isAnimating() ? now : 0;
    this.#slow = took > slow ? this.#slow + 1 : 0;
    if (this.#slow < 2 || scene.fine) return;
    if (this.#pictures) scene.draft(this.#pictures);
    else if (!this.#asked) this.#ask(took);
  }

  async #ask(took) {
    const { stream, info, level, at } = this.#viewer;
    if (at) return; // steps have bands
    const age = this.#age;
    this.#asked = true;
    const pictures = await stream.draft(Math.max(fewest, (info.levels[level].tets * wanted) / took)).catch(() => null);
    if (age === this.#age) this.#pictures = pictures;
  }
}
