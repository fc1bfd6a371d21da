// SPDX-License-Identifier: BSD-3-Clause
// While the camera or the mesh moves and frames take long, fewer pixels are drawn, then a coarser level, too; what was
// there comes back when it rests.

const slow = 50; // milliseconds of a frame
const quick = 17; // with twice the pixels in each direction it would not be slow
const fewestPixels = 0.25; // a share of them in each direction
const stillness = 250; // milliseconds without a frame
const wanted = 35; // of one of the coarser level's
const fewest = 2000; // tetrahedra of that

// Where a gesture began, and was last, is remembered in the pixels that were drawn then.
function scaleGesture(interactor, factor) {
  const { startingEventPositions } = interactor.get();
  const { previousPosition } = interactor.getInteractorStyle().get();
  for (const place of new Set([...Object.values(startingEventPositions ?? {}), previousPosition].filter(Boolean))) {
    place.x *= factor;
    place.y *= factor;
  }
}

// Draws a share of the screen's pixels in each direction, from now on.
function thin(scene, share) {
  if (share === scene.share) return;
  const before = scene.pixels;
  scene.share = share;
  scene.resize();
  scaleGesture(scene.interactor, scene.pixels / before);
  scene.window.render(); // the canvas is empty
}

export class Drafts {
  #viewer;
  #pictures = null;
  #asked = false;
  #last = 0;
  #slow = 0;
  #age = 0;
  #place = ''; // of the camera
  #morphs = false;
  #resting = 0; // a timer
  #saving = 0; // another
  #waits = false; // for pages, to draw all pixels
  #share = 1; // of the pixels in each direction, while something moves; the next time, too
  #longest = 0; // frame of a movement

  constructor(viewer) {
    this.#viewer = viewer;
    viewer.addEventListener('pictures', ({ detail }) => {
      this.#morphs = detail.t < 1;
      this.#forget();
      if (this.#waits) this.#rest();
    });
    viewer.scene.addEventListener('camera', () => this.#rest());
    viewer.scene.addEventListener('capture', () => this.#save());
    viewer.scene.addEventListener('render', () => this.#look());
  }

  // A saved picture is of one of the next frames: these have all pixels.
  #save() {
    thin(this.#viewer.scene, 1);
    clearTimeout(this.#saving);
    this.#saving = setTimeout(() => {
      this.#saving = 0;
    }, stillness);
  }

  // Of what is no longer shown.
  #forget() {
    this.#pictures = null;
    this.#asked = false;
    this.#age++;
  }

  // While pages come, pictures follow each other.
  #rest() {
    const { scene, looking, settled } = this.#viewer;
    clearTimeout(this.#resting);
    if (this.#longest && this.#longest <= quick) this.#share = Math.min(1, 2 * this.#share);
    this.#slow = this.#last = this.#longest = 0;
    this.#waits = Boolean(looking) && !settled;
    if (scene.closed) return;
    scene.draft(null);
    if (!this.#waits) thin(scene, 1);
  }

  // Whether something has moved since the last frame.
  #moves() {
    const camera = this.#viewer.scene.renderer.getActiveCamera();
    const place = [...camera.getPosition(), ...camera.getFocalPoint(), camera.getParallelScale()].join();
    const isSame = place === this.#place;
    this.#place = place;
    return !isSame || this.#morphs;
  }

  #look() {
    const { scene } = this.#viewer;
    const now = performance.now();
    const animates = scene.interactor.isAnimating();
    const moves = this.#moves() || animates;
    const took = moves && this.#last ? now - this.#last : 0;
    this.#last = moves ? now : 0;
    this.#slow = took > slow ? this.#slow + 1 : 0;
    this.#longest = Math.max(this.#longest, took);
    if (!moves) return;
    clearTimeout(this.#resting);
    if (!animates) this.#resting = setTimeout(() => this.#rest(), stillness);
    if (this.#slow > 1 && this.#share > fewestPixels) this.#share /= 2;
    else if (this.#slow > 1 && animates && !scene.fine) this.#roughen(took);
    if (this.#share < scene.share) this.#slow = 0;
    if (!this.#saving) thin(scene, Math.min(this.#share, scene.share));
  }

  #roughen(took) {
    if (this.#pictures) this.#viewer.scene.draft(this.#pictures);
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
