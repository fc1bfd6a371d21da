// SPDX-License-Identifier: BSD-3-Clause
// Direct volume rendering of the grid that the worker resamples. A voxel has two components: its value, which takes
// colour and opacity from the transfer functions, and how much of it is seen, which multiplies the opacity: nothing
// shines outside of the mesh and before the clip plane, and the rim is as sharp as the grid is.

import '@kitware/vtk.js/Rendering/OpenGL/Profiles/Volume.js';
import vtkDataArray from '@kitware/vtk.js/Common/Core/DataArray.js';
import vtkImageData from '@kitware/vtk.js/Common/DataModel/ImageData.js';
import vtkPiecewiseFunction from '@kitware/vtk.js/Common/DataModel/PiecewiseFunction.js';
import vtkColorTransferFunction from '@kitware/vtk.js/Rendering/Core/ColorTransferFunction.js';
import vtkVolume from '@kitware/vtk.js/Rendering/Core/Volume.js';
import vtkVolumeMapper from '@kitware/vtk.js/Rendering/Core/VolumeMapper.js';

const proportional = 1; // vtkVolumeProperty's OpacityMode.PROPORTIONAL: a component that multiplies the opacity

export class VolumeLayer {
  constructor(renderer) {
    this.image = vtkImageData.newInstance();
    this.mapper = vtkVolumeMapper.newInstance();
    this.actor = vtkVolume.newInstance();
    this.colors = vtkColorTransferFunction.newInstance();
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
    property.setRGBTransferFunction(0, this.colors);
    property.setScalarOpacity(0, this.opacity);
    property.setRGBTransferFunction(1, black);
    property.setScalarOpacity(1, mask);
    property.setOpacityMode(1, proportional);
    this.actor.setMapper(this.mapper);
    this.actor.setVisibility(false);
    renderer.addVolume(this.actor);
  }

  // null is no grid
  update(grid) {
    this.actor.setVisibility(Boolean(grid));
    if (!grid) return;
    const scalars = vtkDataArray.newInstance({ name: 'values', values: grid.voxels, numberOfComponents: 2 });
    scalars.setRange({ min: grid.range[0], max: grid.range[1] }, 0);
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

  // `table`: the map's colours. All at once: vtk.js sorts and compares all points for each that is added.
  color(table, [low, high]) {
    const at = (i) => low + ((high - low) * i) / (table.length - 1);
    this.colors.setNodes(
      table.map(([r, g, b], i) => ({ x: at(i), r: r / 255, g: g / 255, b: b / 255, midpoint: 0.5, sharpness: 0 })));
    this.colors.setMappingRange(low, high);
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
