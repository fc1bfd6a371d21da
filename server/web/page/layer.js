// SPDX-License-Identifier: BSD-3-Clause
// One part of the picture as vtk.js has it: triangles coloured by a value, and lines over them.

import vtkDataArray from '@kitware/vtk.js/Common/Core/DataArray.js';
import vtkPolyData from '@kitware/vtk.js/Common/DataModel/PolyData.js';
import vtkActor from '@kitware/vtk.js/Rendering/Core/Actor.js';
import vtkMapper from '@kitware/vtk.js/Rendering/Core/Mapper.js';
import { cells } from '../client/adapters.js';
import { add, linesBehind, sidesOf } from './geometry.js';

const polygonOffset = 1; // vtkMapper's Resolve.PolygonOffset

// Values that are not positive have no logarithm; they take the colour of the lowest.
function logarithms(values) {
  const made = new Float32Array(values.length);
  for (let i = 0; i < values.length; i++) made[i] = values[i] > 0 ? Math.log10(values[i]) : -38;
  return made;
}

export function makeActor(renderer, lookup) {
  const data = vtkPolyData.newInstance();
  const mapper = vtkMapper.newInstance();
  const actor = vtkActor.newInstance();
  mapper.setInputData(data);
  mapper.setResolveCoincidentTopology(polygonOffset);
  if (lookup)
    mapper.set({ lookupTable: lookup, useLookupTableScalarRange: true, interpolateScalarsBeforeMapping: true });
  else mapper.setScalarVisibility(false);
  actor.setMapper(mapper);
  actor.setVisibility(false);
  renderer.addActor(actor);
  return { data, mapper, actor };
}

export class Layer {
  // `lookup`: the colours of triangles; `lines`: the colours of lines on them
  constructor(renderer, lookup, lines) {
    this.renderer = renderer;
    this.part = null;
    this.triangles = makeActor(renderer, lookup);
    this.lines = makeActor(renderer, lines);
    this.showLines = false;
    this.visible = true;
    this.logarithmic = false;
    this.shaderOf = ''; // how many of these, and the function
    this.attributes = []; // of vectors whose lengths colour
    this.shaded = false; // without light, colours are exactly the map's
    this.offset = [0, 0, 0];
    this.behind = null; // where from, if only lines of what is seen from behind are shown
    this.triangles.mapper.setRelativeCoincidentTopologyPolygonOffsetParameters(1, 1);
    this.lines.mapper.setRelativeCoincidentTopologyLineOffsetParameters(-1, -1);
    this.triangles.actor.getProperty().set({ ambient: 0.45, diffuse: 0.55, specular: 0 });
    this.lines.actor.getProperty().set({ lighting: false, lineWidth: 1 });
  }

  // A message that leaves triangles or lines out means the last ones.
  // `lengths`: the module, where a part has vectors whose length colours; null: what somebody else asked the stream
  // for.
  update(part, logarithmic, lengths) {
    if (part) {
      part = {
        ...part,
        triangles: part.triangles ?? this.part?.triangles,
        lines: part.lines === undefined ? this.part?.lines : part.lines,
      };
      const { data } = this.triangles;
      data.getPoints().setData(part.points, 3);
      if (part.triangles !== this.part?.triangles) data.getPolys().setData(cells(part.triangles, 3), 1);
      const normals = part.normals
        ? vtkDataArray.newInstance({ name: 'Normals', values: part.normals, numberOfComponents: 3 })
        : null;
      data.getPointData().setNormals(normals);
      this.part = part;
      this.takeVectors(lengths);
      this.color(logarithmic);
    } else this.part = null;
    this.refresh();
  }

  // Shaders are made anew where there are more or fewer of them.
  takeVectors(lengths) {
    const before = this.shaderOf;
    const formula = this.part.vectors ? (lengths?.formula ?? null) : null;
    this.part.evaluate = formula ? (row) => formula.value(row) : undefined;
    this.attributes = this.part.vectors && lengths ? lengths.attributesOf(this.part, vtkDataArray) : [];
    const names = this.attributes.map((attribute) => attribute.getName());
    this.shaderOf = names.length ? `${names.length} ${formula?.text ?? ''}` : '';
    for (const { data, mapper } of [this.triangles, this.lines]) {
      for (const attribute of this.attributes) data.getPointData().addArray(attribute);
      if (this.shaderOf === before) continue;
      mapper.setViewSpecificProperties(
        names.length ? lengths.shadersOf(names, mapper, () => this.logarithmic, formula) : {},
      );
      mapper.setCustomShaderAttributes(names);
    }
  }

  color(logarithmic) {
    this.logarithmic = logarithmic;
    if (!this.part) return;
    const values = logarithmic ? logarithms(this.part.values) : this.part.values;
    const scalars = vtkDataArray.newInstance({ name: 'values', values, numberOfComponents: 1 });
    for (const { data } of [this.triangles, this.lines]) {
      data.getPointData().setScalars(scalars);
      data.modified();
    }
  }

  // What is there and wanted is visible; lines are only handed to vtk.js while they are.
  refresh() {
    const there = Boolean(this.part?.triangles?.length) && this.visible;
    const lined = there && this.showLines && Boolean(this.part.lines?.length);
    this.triangles.actor.setVisibility(there);
    this.triangles.actor.getProperty().setLighting(this.shaded);
    this.lines.actor.setVisibility(lined);
    if (!lined) return;
    const { data } = this.lines;
    data.getPoints().setData(this.part.points, 3);
    this.drawLines(this.behind ? this.linesBehind() : this.part.lines);
    data.modified();
  }

  hide() {
    for (const { actor } of [this.triangles, this.lines]) actor.setVisibility(false);
  }

  drawLines(lines) {
    if (this.drawnLines === lines) return;
    this.lines.data.getLines().setData(cells(lines, 2), 1);
    this.lines.data.modified();
    this.drawnLines = lines;
  }

  linesBehind() {
    const { part, sides } = this;
    if (sides?.triangles !== part.triangles || sides.lines !== part.lines)
      this.sides = { triangles: part.triangles, lines: part.lines, of: sidesOf(part) };
    return linesBehind(part, this.sides.of, ...this.behind);
  }

  // Lines of triangles that are seen from behind only, from `eye` ([place or direction, parallel]); null: all. True if
  // that changes the picture.
  showBehind(eye) {
    this.behind = eye && [add(eye[0], this.offset, eye[1] ? 0 : -1), eye[1]];
    if (!this.lines.actor.getVisibility()) return false;
    const lines = this.behind ? this.linesBehind() : this.part.lines;
    if (lines.length === this.drawnLines.length && lines.every((x, i) => x === this.drawnLines[i])) return false;
    this.drawLines(lines);
    return true;
  }

  place(offset) {
    this.offset = offset;
    for (const { actor } of [this.triangles, this.lines]) actor.setPosition(...offset);
  }

  remove() {
    for (const { data, mapper, actor } of [this.triangles, this.lines]) {
      this.renderer.removeActor(actor);
      for (const made of [actor, mapper, data]) made.delete();
    }
  }
}
