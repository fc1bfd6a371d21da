// SPDX-License-Identifier: BSD-3-Clause
// Parts of pictures as the libraries that draw them have them. A part without triangles has those of the one before.

/** Of three.js: fills `geometry`, a BufferGeometry, with a part; attribute `value` has the field. `three`: the library.
 * */
export function toGeometry(part, geometry, { BufferAttribute }) {
  geometry.setAttribute('position', new BufferAttribute(part.points, 3));
  geometry.setAttribute('value', new BufferAttribute(part.values, 1));
  if (part.normals) geometry.setAttribute('normal', new BufferAttribute(part.normals, 3));
  if (part.triangles) geometry.setIndex(new BufferAttribute(part.triangles, 1));
  geometry.computeBoundingSphere();
  return geometry;
}

/** vtk's cell arrays: the number of corners before the corners. */
export function cells(corners, each) {
  const packed = new Uint32Array((corners.length / each) * (each + 1));
  for (let i = 0, at = 0; i < corners.length; i += each) {
    packed[at++] = each;
    for (let k = 0; k < each; k++) packed[at++] = corners[i + k];
  }
  return packed;
}

/** Of vtk.js: fills `data`, a vtkPolyData, with a part; its scalars are a new vtkDataArray called `name`. */
export function toPolyData(part, data, vtkDataArray, name) {
  data.getPoints().setData(part.points, 3);
  data.getPointData().setScalars(vtkDataArray.newInstance({ name, values: part.values }));
  if (part.triangles) data.getPolys().setData(cells(part.triangles, 3));
  if (part.lines) data.getLines().setData(cells(part.lines, 2));
  data.modified();
  return data;
}
