// SPDX-License-Identifier: BSD-3-Clause
// Detail where one looks: of streams with levels in pages, those pages are shown that the picture needs, to an error in
// pixels (client/pages.js).

import { coalesced } from './dom.js';
import { add, cross, dot, length, planeOf, scale, unit } from './geometry.js';
import { measureFor, targetFieldOf } from './levels.js';

const margin = 1.05; // of what is seen, that pages are held for: the next movement
const nearest = 0.002; // of the diagonal: nothing is looked at from nearer
const most = { tets: 1_000_000, bytes: 64_000_000 }; // where no budget is set
const walls = { solid: 'near', inside: 'far' }; // that are seen of the boundary
const pause = 200; // milliseconds between two looks while the camera moves

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

/** Follows the camera while the state has `pixels`, of a stream in pages. */
export class LookHere {
  #viewer;
  #last = '';
  #lastTime = 0;
  #moving = false; // was the last look
  #resting = 0; // a timer
  #id = 0;

  constructor(viewer) {
    this.#viewer = viewer;
    if (!viewer.info.paged) return;
    const soon = coalesced(() => this.#look());
    viewer.store.watch(
      ['pixels', 'field', 'errorField', 'measure', 'maxTets', 'maxBytes', 'clip', 'warp', 'step', 'surface'],
      soon,
    );
    viewer.scene.addEventListener('camera', soon);
    viewer.scene.addEventListener('render', () => this.#lookSometimes());
  }

  // Frames follow each other while the camera moves; what it needs at rest is asked for after the last one.
  #lookSometimes() {
    if (!this.#viewer.store.state.pixels) return;
    clearTimeout(this.#resting);
    this.#resting = setTimeout(() => this.#look(), 2 * pause);
    if (performance.now() - this.#lastTime >= pause) this.#look(true);
  }

  // What is asked of the stream, if it is not the same as before.
  #look(moving = false) {
    const viewer = this.#viewer;
    const { state } = viewer.store;
    if (viewer.scene.closed) return;
    const look = state.pixels ? this.#wanted(state) : null;
    const key = JSON.stringify(look);
    this.#lastTime = performance.now();
    if (key === this.#last && (moving || !this.#moving)) return;
    this.#last = key;
    this.#moving = moving;
    if (!look && !viewer.looking) return;
    viewer.looking = look && ++this.#id;
    viewer.stream.look(look && { ...look, moving, id: moving ? null : this.#id });
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
      walls: walls[state.surface] ?? 'all',
      pixels: state.pixels,
      tets: state.maxTets || most.tets,
      bytes: state.maxBytes || most.bytes,
      field: targetFieldOf(info, state),
      measure: measureFor(info, state),
    };
  }
}
