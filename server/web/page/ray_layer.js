// SPDX-License-Identifier: BSD-3-Clause
// Volume rendering of the tetrahedra themselves, at every level and between two: colours and opacities in one table.

import vtkVolume from '@kitware/vtk.js/Rendering/Core/Volume.js';
import { colorTable } from './colors.js';
import { newMapper } from './ray_mapper.js';
import { width } from './ray_shader.js';

const most = 0.9999; // opacity: of 1 nothing but a wall would be left

// The opacity of the editor's points at x of 0..1.
function opacityAt(points, x) {
  const next = points.findIndex(([at]) => at >= x);
  if (next < 0) return points.at(-1)[1];
  if (next === 0) return points[0][1];
  const [[a, from], [b, to]] = [points[next - 1], points[next]];
  return b > a ? from + ((x - a) / (b - a)) * (to - from) : to;
}

export class RayLayer {
  // `failed()` is called if the graphics cannot do it
  constructor(renderer, failed) {
    this.mapper = newMapper({ failed });
    this.actor = vtkVolume.newInstance();
    this.actor.setMapper(this.mapper);
    this.actor.setVisibility(false);
    renderer.addVolume(this.actor);
  }

  // null is nothing
  update(cells) {
    this.actor.setVisibility(Boolean(cells));
    if (!cells) return;
    const { vertices, vectors, nodes, corners, neighbours, faces, moves } = cells;
    // a texture that is not used is there, too
    this.mapper.put({
      textures:
        { vertices, vectors: vectors ?? vertices, nodes, corners, neighbours, faces, cells: cells.cells ?? vertices },
      uniforms: { moves, byCells: Boolean(cells.cells), byLengths: Boolean(vectors) }
    });
  }

  // `state` of the picture, [low, high] of the colours, the bounds' `sides`; `clip`: {origin, normal} or null
  style(state, range, sides, clip) {
    const key = JSON.stringify([state.map, state.reversed, state.opacity, sides]);
    const plane =
      clip ? [...clip.normal, clip.normal.reduce((sum, n, i) => sum + n * clip.origin[i], 0)] : [0, 0, 0, 1];
    this.mapper.put({ uniforms: { range, logarithmic: state.log, clip: plane } });
    if (key === this.key) return;
    this.key = key;
    // an opacity of the editor holds for a hundredth of the longest side
    const unit = Math.max(...sides) / 100;
    const table = new Float32Array(4 * width);
    colorTable(state.map, state.reversed, width).forEach((color, i) => {
      const opacity = Math.min(opacityAt(state.opacity, i / (width - 1)), most);
      table.set([...color.map((c) => c / 255), -Math.log(1 - opacity) / unit], 4 * i);
    });
    this.mapper.put({ textures: { table } });
  }

  place(offset) {
    this.actor.setPosition(...offset);
  }
}
