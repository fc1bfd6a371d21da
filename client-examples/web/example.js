// SPDX-License-Identifier: BSD-3-Clause
// The surface of a stream with vtk.js, refining: example.html?url=http://127.0.0.1:8080/v1/meshes/fin
import '@kitware/vtk.js/Rendering/Profiles/Geometry.js';
import vtkActor from '@kitware/vtk.js/Rendering/Core/Actor.js';
import vtkDataArray from '@kitware/vtk.js/Common/Core/DataArray.js';
import vtkFullScreenRenderWindow from '@kitware/vtk.js/Rendering/Misc/FullScreenRenderWindow.js';
import vtkMapper from '@kitware/vtk.js/Rendering/Core/Mapper.js';
import vtkPolyData from '@kitware/vtk.js/Common/DataModel/PolyData.js';
import { TetlodStream } from './stream.js';

const url = new URLSearchParams(location.search).get('url') ?? 'http://127.0.0.1:8080/v1/meshes/fin';
const said = document.querySelector('output');
const view = vtkFullScreenRenderWindow.newInstance({ background: [0.1, 0.12, 0.15] });
const surface = vtkPolyData.newInstance();
const mapper = vtkMapper.newInstance();
const actor = vtkActor.newInstance();
mapper.setInputData(surface);
actor.setMapper(mapper);

const target = { error: 0.001, tets: 500_000 };
const stream = await TetlodStream.open(url, { target, on: { retry: ({ detail }) => { said.value = detail.message; } } });
const [field] = stream.info.fields;
mapper.setScalarRange(...field.range);

stream.addEventListener('pictures', ({ detail: { level, origin, surface: { points, values, triangles } } }) => {
  surface.getPoints().setData(points, 3);
  surface.getPointData().setScalars(vtkDataArray.newInstance({ name: field.name, values }));
  if (triangles) {
    const cells = new Uint32Array(triangles.length / 3 * 4).fill(3);
    triangles.forEach((vertex, i) => { cells[Math.floor(i / 3) * 4 + i % 3 + 1] = vertex; });
    surface.getPolys().setData(cells);
  }
  surface.modified();
  actor.setPosition(origin);
  if (!view.getRenderer().getActors().length) view.getRenderer().addActor(actor), view.getRenderer().resetCamera();
  view.getRenderWindow().render();
  const { tets, bytes } = stream.info.levels[level];
  said.value = `level ${level}: ${tets} tetrahedra, ${Math.round(bytes / 1024)} KiB`;
});
await stream.show({ field: field.name, surface: true });
