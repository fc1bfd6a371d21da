// SPDX-License-Identifier: BSD-3-Clause
// Direct volume rendering of the grid that the worker resamples. Voxels get colour and opacity here, not in the shader:
// outside the mesh nothing may shine, and interpolating between a value and none would.

import '@kitware/vtk.js/Rendering/OpenGL/Profiles/Volume.js';
import vtkDataArray from '@kitware/vtk.js/Common/Core/DataArray.js';
import vtkImageData from '@kitware/vtk.js/Common/DataModel/ImageData.js';
import vtkPiecewiseFunction from '@kitware/vtk.js/Common/DataModel/PiecewiseFunction.js';
import vtkColorTransferFunction from '@kitware/vtk.js/Rendering/Core/ColorTransferFunction.js';
import vtkVolume from '@kitware/vtk.js/Rendering/Core/Volume.js';
import vtkVolumeMapper from '@kitware/vtk.js/Rendering/Core/VolumeMapper.js';
import { colorTable } from './colors.js';
import { clamp } from './numbers.js';

const entries = 512;

// Opacity at a fraction of the range, linear between the editor's points.
export function opacityAt(points, x) {
  const next = points.findIndex((p) => p[0] >= x);
  if (next === 0) return points[0][1];
  if (next < 0) return points[points.length - 1][1];
  const [[x0, y0], [x1, y1]] = [points[next - 1], points[next]];
  return x1 === x0 ? y1 : y0 + ((y1 - y0) * (x - x0)) / (x1 - x0);
}

export class VolumeLayer {
  constructor(renderer) {
    this.image = vtkImageData.newInstance();
    this.mapper = vtkVolumeMapper.newInstance();
    this.actor = vtkVolume.newInstance();
    this.actor.setMapper(this.mapper);
    this.actor.setVisibility(false);
    const property = this.actor.getProperty();
    property.setIndependentComponents(false);
    property.setInterpolationTypeToLinear();
    property.setShade(false);
    const straight = vtkPiecewiseFunction.newInstance();
    straight.addPoint(0, 0);
    straight.addPoint(255, 1);
    property.setScalarOpacity(0, straight);
    property.setScalarOpacity(3, straight);
    property.setRGBTransferFunction(0, vtkColorTransferFunction.newInstance());
    renderer.addVolume(this.actor);
    this.grid = null;
  }

  update(grid) {
    this.grid = grid;
    this.actor.setVisibility(Boolean(grid));
    if (!grid) return;
    const step = Math.min(...grid.spacing);
    this.image.set({ origin: [...grid.origin], spacing: [...grid.spacing] });
    this.image.setDimensions(...grid.dims);
    this.mapper.setSampleDistance(step);
    this.mapper.setMaximumSamplesPerRay(2000);
    // an opacity of the editor holds for a sixteenth of the longest side, whatever the grid
    const longest = Math.max(...grid.spacing.map((s, i) => s * grid.dims[i]));
    for (const component of [0, 3]) this.actor.getProperty().setScalarOpacityUnitDistance(component, longest / 16);
  }

  place(offset) {
    this.actor.setPosition(...offset);
  }

  classify(state, [low, high]) {
    if (!this.grid) return;
    const { values, inside, dims } = this.grid;
    const table = this.table(state);
    const voxels = new Uint8Array(4 * values.length);
    const words = new Uint32Array(voxels.buffer);
    const factor = (entries - 1) / (high - low || 1);
    for (let i = 0; i < values.length; i++) {
      if (!inside[i]) continue;
      const value = state.log ? Math.log10(values[i]) : values[i];
      words[i] = table[clamp(Math.round((value - low) * factor), 0, entries - 1) || 0];
    }
    spreadColors(words, inside, dims);
    this.image.getPointData().setScalars(vtkDataArray.newInstance({ name: 'colors', values: voxels, numberOfComponents: 4 }));
    this.image.modified();
    this.mapper.setInputData(this.image);
  }

  // Colour and opacity of each of the table's values as one word.
  table({ map, reversed, opacity }) {
    const bytes = new Uint8Array(4 * entries);
    colorTable(map, reversed, entries).forEach((color, i) => bytes.set([...color, Math.round(255 * opacityAt(opacity, i / (entries - 1)))], 4 * i));
    return new Uint32Array(bytes.buffer);
  }
}

// Voxels just outside take a neighbour's colour, with no opacity: interpolation darkens the rim otherwise.
function spreadColors(words, inside, [nx, ny, nz]) {
  const color = new Uint32Array(new Uint8Array([255, 255, 255, 0]).buffer)[0];
  const steps = [1, nx, nx * ny];
  for (let z = 0, i = 0; z < nz; z++)
    for (let y = 0; y < ny; y++)
      for (let x = 0; x < nx; x++, i++) {
        if (inside[i]) continue;
        if (x > 0 && inside[i - 1]) words[i] = words[i - 1] & color;
        else if (x < nx - 1 && inside[i + 1]) words[i] = words[i + 1] & color;
        else if (y > 0 && inside[i - steps[1]]) words[i] = words[i - steps[1]] & color;
        else if (y < ny - 1 && inside[i + steps[1]]) words[i] = words[i + steps[1]] & color;
        else if (z > 0 && inside[i - steps[2]]) words[i] = words[i - steps[2]] & color;
        else if (z < nz - 1 && inside[i + steps[2]]) words[i] = words[i + steps[2]] & color;
      }
}
