// SPDX-License-Identifier: BSD-3-Clause
// The surface of a stream with vtk.js, refining. Bundle it, then open
// example.html?url=http://127.0.0.1:8080/v1/meshes/fin
import '@kitware/vtk.js/Rendering/Profiles/Geometry.js';
import vtkActor from '@kitware/vtk.js/Rendering/Core/Actor.js';
import vtkDataArray from '@kitware/vtk.js/Common/Core/DataArray.js';
import vtkFullScreenRenderWindow from '@kitware/vtk.js/Rendering/Misc/FullScreenRenderWindow.js';
import vtkMapper from '@kitware/vtk.js/Rendering/Core/Mapper.js';
import vtkPolyData from '@kitware/vtk.js/Common/DataModel/PolyData.js';
import { toPolyData } from 'tetlod/adapters.js';
import { TetlodStream } from 'tetlod';

const stream =
  await TetlodStream.open(new URLSearchParams(location.search).get('url'), { target: { error: 0.001, tets: 500_000 } });
const [field] = stream.info.fields;
const view = vtkFullScreenRenderWindow.newInstance({ background: [0.1, 0.12, 0.15] });
const [surface, mapper, actor] = [vtkPolyData, vtkMapper, vtkActor].map((made) => made.newInstance());
mapper.setInputData(surface);
mapper.setScalarRange(...field.range);
actor.setMapper(mapper);
for await (const frame of stream.frames({ field: field.name, surface: true })) {
  toPolyData(frame.surface, surface, vtkDataArray, field.name);
  actor.setPosition(frame.origin);
  if (!view.getRenderer().getActors().length) view.getRenderer().addActor(actor), view.getRenderer().resetCamera();
  view.getRenderWindow().render();
  document.querySelector('output').value = `level ${frame.level}: ${stream.info.levels[frame.level].tets} tetrahedra`;
}
