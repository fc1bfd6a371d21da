// SPDX-License-Identifier: BSD-3-Clause
// Detail where one looks: of streams with levels in pages, those pages are shown that the picture needs, to an error in
// pixels (client/pages.js).

import { byId, coalesced, element } from './dom.js';
import { add, cross, dot, length, planeOf, scale, unit } from './geometry.js';
import { measureFor, targetFieldOf } from './levels.js';
import { bytes, count, parseNumber, percent, significant } from './numbers.js';

const margin = 1.2; // of what is seen, that pages are held for: the next movement
const nearest = 0.002; // of the diagonal: nothing is looked at from nearer
const most = { tets: 1_000_000, bytes: 64_000_000 }; // where no budget is set
const pause = 200; // milliseconds between two looks while the camera moves
const usual = 2; // pixels

const planeThrough = (point, normal) => [...normal, -dot(normal, point)];

/**
 * What `camera` sees in a picture of so many pixels, in its own coordinates moved by `shift`, as `TetlodStream.look`
 * takes it. `wide`: width to height; `diagonal`: of the bounds.
 */
export function lookOf(camera, { height, wide, shift, diagonal }) {
  const eye = add(camera.getPosition(), shift);
  const ahead = camera.getDirectionOfProjection();
  const right = unit(cross(ahead, camera.getViewUp()));
  const up = cross(right, ahead);
  const parallel = Boolean(camera.getParallelProjection());
  const angle = Math.tan((camera.getViewAngle() * Math.PI) / 360) / (camera.getUseHorizontalViewAngle() ? wide : 1);
  const half = parallel ? camera.getParallelScale() : angle; // of the picture's height; at a distance of 1
  const sides = [
    [up, margin * half],
    [right, margin * half * wide],
  ].flatMap(([way, reach]) =>
    [-1, 1].map((sign) => {
      const inwards = scale(way, -sign);
      return parallel
        ? planeThrough(add(eye, scale(inwards, -reach)), inwards)
        : planeThrough(eye, add(inwards, scale(ahead, reach)));
    }),
  );
  return {
    planes: [...sides, planeThrough(eye, ahead)],
    eye,
    near: nearest * diagonal,
    scale: height / 2 / half,
    parallel,
  };
}

export class LookHere {
  #viewer;
  #parts = null;
  #last = '';
  #lastTime = 0;
  #id = 0;

  constructor(viewer) {
    this.#viewer = viewer;
    if (!viewer.info.paged) return;
    this.#parts = this.#build();
    const soon = coalesced(() => this.#look());
    viewer.store.watch(
      ['pixels', 'field', 'errorField', 'measure', 'maxTets', 'maxBytes', 'clip', 'warp', 'step'],
      soon,
    );
    viewer.store.watch(['pixels'], () => this.#tell());
    viewer.addEventListener('info', () => this.#tell());
    viewer.scene.addEventListener('camera', soon);
    viewer.scene.addEventListener('render', () => this.#lookSometimes());
  }

  #build() {
    const on = element('input', { id: 'look-on', className: 'switch', type: 'checkbox' });
    const pixels = element('input', { id: 'look-pixels', className: 'number', inputMode: 'decimal' });
    const words = element('p', { id: 'look-words', className: 'hint' });
    words.role = 'status';
    const row = (control, text) =>
      element('div', { className: 'row' }, element('label', { htmlFor: control.id }, text), control);
    const details = element(
      'details',
      { id: 'look' },
      element('summary', {}, 'Detail where one looks'),
      row(on, 'More where the picture is near'),
      row(pixels, 'Error on the screen, pixels'),
      words,
    );
    byId('max-tets').closest('details').after(details);
    const { store } = this.#viewer;
    on.addEventListener('change', () => store.set({ pixels: on.checked ? usual : 0 }));
    pixels.addEventListener('change', () => {
      const value = parseNumber(pixels.value);
      if (value > 0) store.set({ pixels: value });
      this.#tell();
    });
    return { details, on, pixels, words };
  }

  #lookSometimes() {
    if (!this.#viewer.store.state.pixels || performance.now() - this.#lastTime < pause) return;
    this.#look();
  }

  // What is asked of the stream, if it is not the same as before.
  #look() {
    const viewer = this.#viewer;
    const { state } = viewer.store;
    const look = state.pixels ? this.#wanted(state) : null;
    const key = JSON.stringify(look);
    this.#lastTime = performance.now();
    if (key === this.#last) return;
    this.#last = key;
    if (!look && !viewer.looking) return;
    viewer.looking = look && ++this.#id;
    viewer.stream.look(look && { ...look, id: this.#id });
  }

  #wanted(state) {
    const { info, scene } = this.#viewer;
    const [low, high] = info.bounds;
    const { width, height } = scene.container.getBoundingClientRect();
    const diagonal = length(add(high, low, -1));
    const look = lookOf(scene.renderer.getActiveCamera(), {
      height,
      wide: width / (height || 1),
      shift: scene.centre,
      diagonal,
    });
    if (state.clip) {
      const { origin, normal } = planeOf(info.bounds, state.clip);
      look.planes.push(planeThrough(origin, scale(unit(normal), -1)));
    }
    return {
      ...look,
      planes: state.warp ? [] : look.planes, // pages' boxes are of places that are not moved
      pixels: state.pixels,
      tets: state.maxTets || most.tets,
      bytes: state.maxBytes || most.bytes,
      field: targetFieldOf(info, state),
      measure: measureFor(info, state),
    };
  }

  #tell() {
    const { details, on, pixels, words } = this.#parts;
    const { state } = this.#viewer.store;
    on.checked = state.pixels > 0;
    pixels.disabled = !on.checked;
    pixels.value = on.checked ? significant(state.pixels, 3) : '';
    if (on.checked) details.open = true;
    words.textContent = this.#words(state);
  }

  #words(state) {
    const { finer, info, at } = this.#viewer;
    if (!state.pixels)
      return `${info.levels.length - info.paged} levels are stored in pages: only those that are seen are loaded.`;
    if (at) return 'Steps in time are shown without pages.';
    if (finer?.pages === undefined) return 'On the way.';
    const { worst, pixels, refused } = finer;
    const field = targetFieldOf(info, state);
    const error = info.levels[worst].errors[field]?.[measureFor(info, state)] ?? 1;
    const why = refused ? '; more would pass the budget of tetrahedra or bytes' : '; pages have nothing finer';
    const off = `${percent(error)}, ${significant(pixels, 2)} pixels off${pixels > state.pixels ? why : ''}`;
    return `${count(finer.pages)} pages, ${bytes(finer.held)} held. The worst place in the picture is ${off}.`;
  }
}
