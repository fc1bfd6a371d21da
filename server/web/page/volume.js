// SPDX-License-Identifier: BSD-3-Clause
// Direct volume rendering of the grid that the worker resamples. A voxel has two components: its value, which takes colour
// and opacity from the transfer functions, and whether it is inside the mesh, which multiplies the opacity: nothing shines
// outside, and the rim is as sharp as the grid is.

import '@kitware/vtk.js/Rendering/OpenGL/Profiles/Volume.js';
import vtkDataArray from '@kitware/vtk.js/Common/Core/DataArray.js';
import vtkImageData from '@kitware/vtk.js/Common/DataModel/ImageData.js';
import vtkPiecewiseFunction from '@kitware/vtk.js/Common/DataModel/PiecewiseFunction.js';
import vtkColorTransferFunction from '@kitware/vtk.js/Rendering/Core/ColorTransferFunction.js';
import vtkVolume from '@kitware/vtk.js/Rendering/Core/Volume.js';
import vtkVolumeMapper from '@kitware/vtk.js/Rendering/Core/VolumeMapper.js';

const proportional = 1; // vtkVolumeProperty's OpacityMode.PROPORTIONAL: a component that multiplies the opacity

export class VolumeLayer {
  // `lookup`: the colours that the picture's other parts have too
  constructor(renderer, lookup) {
    this.image = vtkImageData.newInstance();
    this.mapper = vtkVolumeMapper.newInstance();
    this.actor = vtkVolume.newInstance();
    this.opacity = vtkPiecewiseFunction.newInstance();
    const mask = vtkPiecewiseFunction.newInstance();
    mask.addPoint(0, 0);
    mask.addPoint(1, 1);
    const black = vtkColorTransferFunction.newInstance();
    black.addRGBPoint(0, 0, 0, 0);
    black.addRGBPoint(1, 0, 0, 0);
    const property = this.actor.getProperty();
    property.setInterpolationTypeToLinear();
    property.setShade(false);
    property.setRGBTransferFunction(0, lookup);
    property.setScalarOpacity(0, this.opacity);
    property.setRGBTransferFunction(1, black);
    property.setScalarOpacity(1, mask);
    property.setOpacityMode(1, proportional);
    this.actor.setMapper(this.mapper);
    this.actor.setVisibility(false);
    renderer.addVolume(this.actor);
  }

  // null is no grid
  update(grid, logarithmic) {
    this.grid = grid;
    this.actor.setVisibility(Boolean(grid));
    if (!grid) return;
    const { values, low, high } = voxels(grid, logarithmic);
    const scalars = vtkDataArray.newInstance({ name: 'values', values, numberOfComponents: 2 });
    scalars.setRange({ min: low, max: high }, 0);
    scalars.setRange({ min: 0, max: 1 }, 1);
    this.image.set({ origin: [...grid.origin], spacing: [...grid.spacing] });
    this.image.setDimensions(...grid.dims);
    this.image.getPointData().setScalars(scalars);
    this.image.modified();
    this.mapper.setInputData(this.image);
    this.mapper.setSampleDistance(0.7 * Math.min(...grid.spacing));
    this.mapper.setMaximumSamplesPerRay(2000);
    // an opacity of the editor holds for a hundredth of the longest side, whatever the grid
    const longest = Math.max(...grid.spacing.map((s, i) => s * grid.dims[i]));
    for (const component of [0, 1]) this.actor.getProperty().setScalarOpacityUnitDistance(component, longest / 100);
  }

  // Opacities of the editor's points, which are fractions of the colours' range.
  shade(points, [low, high]) {
    this.opacity.removeAllPoints();
    for (const [x, opacity] of points) this.opacity.addPoint(low + x * (high - low), opacity);
  }

  place(offset) {
    this.actor.setPosition(...offset);
  }
}

// Value and mask side by side. Voxels just outside take a neighbour's value: interpolated up to the rim, it stays what it is.
function voxels({ values, inside, dims: [nx, ny, nz] }, logarithmic) {
  const pairs = new Float32Array(2 * values.length);
  let low = Infinity;
  let high = -Infinity;
  for (let i = 0; i < values.length; i++) {
    if (!inside[i]) continue;
    const value = logarithmic ? Math.log10(Math.max(values[i], 1e-38)) : values[i];
    if (value < low) low = value;
    if (value > high) high = value;
    pairs[2 * i] = value;
    pairs[2 * i + 1] = 1;
  }
  const steps = [1, nx, nx * ny];
  for (let z = 0, i = 0; z < nz; z++)
    for (let y = 0; y < ny; y++)
      for (let x = 0; x < nx; x++, i++) {
        if (inside[i]) continue;
        let from = -1;
        if (x > 0 && inside[i - 1]) from = i - 1;
        else if (x < nx - 1 && inside[i + 1]) from = i + 1;
        else if (y > 0 && inside[i - steps[1]]) from = i - steps[1];
        else if (y < ny - 1 && inside[i + steps[1]]) from = i + steps[1];
        else if (z > 0 && inside[i - steps[2]]) from = i - steps[2];
        else if (z < nz - 1 && inside[i + steps[2]]) from = i + steps[2];
        pairs[2 * i] = from < 0 ? low : pairs[2 * from];
      }
  return low <= high ? { values: pairs, low, high } : { values: pairs, low: 0, high: 1 };
}
