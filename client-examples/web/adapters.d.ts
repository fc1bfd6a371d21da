// SPDX-License-Identifier: BSD-3-Clause
import type { Part } from './stream.js';

/** Of three.js: fills a BufferGeometry with a part; attribute `value` has the field. `three`: the library. */
export function toGeometry<Geometry extends {
  setAttribute(name: string, attribute: any): unknown;
  setIndex(index: any): unknown;
  computeBoundingSphere(): void;
}>(
  part: Part, geometry: Geometry, three: { BufferAttribute: new (array: any, itemSize: number) => unknown }): Geometry;

/** Of vtk.js: fills a vtkPolyData with a part; its scalars are a new vtkDataArray called `name`. */
export function toPolyData<Data>(
  part: Part, data: Data, vtkDataArray: { newInstance(values: any): unknown }, name: string): Data;

/** vtk's cell arrays: the number of corners before the corners. */
export function cells(corners: ArrayLike<number>, each: number): Uint32Array;
