// SPDX-License-Identifier: BSD-3-Clause
#include "tetlod_grid.h"

#include <algorithm>
#include <cmath>

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkCellType.h>
#include <vtkDataArray.h>
#include <vtkDoubleArray.h>
#include <vtkFieldData.h>
#include <vtkInformation.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkSmartPointer.h>
#include <vtkTypeInt32Array.h>
#include <vtkTypeInt64Array.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>

namespace
{
using numbers = std::vector<uint32_t>;

// Do the tetrahedron and the box lie on two sides of a plane across the axis?
bool separates(const double axis[3], const double* const corners[4], const double middle[3], const double half[3])
{
  double low = HUGE_VAL, high = -HUGE_VAL, reach = 0;
  for (int c = 0; c < 4; c++)
  {
    double along = 0;
    for (int i = 0; i < 3; i++)
      along += axis[i] * (corners[c][i] - middle[i]);
    low = std::min(low, along);
    high = std::max(high, along);
  }
  for (int i = 0; i < 3; i++)
    reach += std::fabs(axis[i]) * half[i];
  const double slack = 1e-9 * (reach + std::fabs(low) + std::fabs(high));
  return low > reach + slack || high < -reach - slack;
}

// Axes that can separate them: those of the box, across faces, across pairs of edges.
bool meets(const double* const corners[4], const double middle[3], const double half[3])
{
  static const int ends[6][2] = { { 0, 1 }, { 0, 2 }, { 0, 3 }, { 1, 2 }, { 1, 3 }, { 2, 3 } };
  static const int faces[4][2] = { { 0, 1 }, { 0, 2 }, { 1, 2 }, { 3, 4 } }; // as two of the edges
  double edges[6][3];
  for (int e = 0; e < 6; e++)
    for (int i = 0; i < 3; i++)
      edges[e][i] = corners[ends[e][1]][i] - corners[ends[e][0]][i];
  for (int i = 0; i < 3; i++)
  {
    const double axis[3] = { double(i == 0), double(i == 1), double(i == 2) };
    if (separates(axis, corners, middle, half))
      return false;
  }
  for (const int* face : faces)
  {
    const double *a = edges[face[0]], *b = edges[face[1]];
    const double axis[3] = { a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0] };
    if (separates(axis, corners, middle, half))
      return false;
  }
  for (const double* edge : edges)
    for (int i = 0; i < 3; i++)
    {
      double axis[3] = { 0, 0, 0 };
      axis[(i + 1) % 3] = -edge[(i + 2) % 3];
      axis[(i + 2) % 3] = edge[(i + 1) % 3];
      if (separates(axis, corners, middle, half))
        return false;
    }
  return true;
}

numbers tets_in(const tetlod_view& view, const double* box)
{
  numbers found;
  double middle[3], half[3];
  for (int i = 0; i < 3; i++)
  {
    middle[i] = box[2 * i] / 2 + box[2 * i + 1] / 2;
    half[i] = box[2 * i + 1] / 2 - box[2 * i] / 2;
  }
  for (uint32_t t = 0; t < view.tets; t++)
  {
    const double* corners[4];
    for (int c = 0; c < 4; c++)
      corners[c] = view.positions + 3 * static_cast<size_t>(view.corners[4 * static_cast<size_t>(t) + c]);
    if (meets(corners, middle, half))
      found.push_back(t);
  }
  return found;
}

// Rows of doubles as an array of their own type: all of them, or those with these numbers.
vtkSmartPointer<vtkDataArray> array_of(const tetlod_column& column, size_t rows, const numbers* chosen)
{
  auto array = vtkSmartPointer<vtkDataArray>::Take(vtkDataArray::CreateDataArray(column.type));
  const size_t width = static_cast<size_t>(column.components);
  rows = chosen ? chosen->size() : rows;
  array->SetName(column.name.c_str());
  array->SetNumberOfComponents(column.components);
  array->SetNumberOfTuples(static_cast<vtkIdType>(rows));
  void* out = array->GetVoidPointer(0);
  const auto fill = [&](auto* values) {
    using value = std::remove_pointer_t<decltype(values)>;
    for (size_t row = 0; row < rows; row++)
      for (size_t c = 0; c < width; c++)
        values[row * width + c] = static_cast<value>(column.values[(chosen ? (*chosen)[row] : row) * width + c]);
  };
  switch (column.type)
  {
    vtkTemplateMacro(fill(static_cast<VTK_TT*>(out)));
  }
  return array;
}

// Numbers of 32 bits where they suffice
template <class Array>
vtkSmartPointer<vtkCellArray> cells_of(const tetlod_view& view, const numbers* tets, const numbers& places)
{
  vtkNew<Array> offsets, corners;
  const size_t count = tets ? tets->size() : view.tets;
  auto cells = vtkSmartPointer<vtkCellArray>::New();
  offsets->SetNumberOfValues(static_cast<vtkIdType>(count + 1));
  corners->SetNumberOfValues(static_cast<vtkIdType>(4 * count));
  auto *begin = offsets->GetPointer(0), *corner = corners->GetPointer(0);
  for (size_t t = 0; t <= count; t++)
    begin[t] = static_cast<typename Array::ValueType>(4 * t);
  for (size_t i = 0; i < 4 * count; i++)
  {
    const uint32_t vertex = view.corners[tets ? 4 * static_cast<size_t>((*tets)[i / 4]) + i % 4 : i];
    corner[i] = static_cast<typename Array::ValueType>(tets ? places[vertex] : vertex);
  }
  cells->SetData(offsets, corners);
  return cells;
}

// The vertices that the tetrahedra use, in order; `places` are their new numbers.
numbers vertices_of(const tetlod_view& view, const numbers& tets, numbers& places)
{
  numbers used;
  places.assign(view.vertices, TETLOD_NONE);
  for (uint32_t tet : tets)
    for (size_t c = 0; c < 4; c++)
      places[view.corners[4 * static_cast<size_t>(tet) + c]] = 0;
  for (uint32_t v = 0; v < view.vertices; v++)
    if (places[v] == 0)
    {
      places[v] = static_cast<uint32_t>(used.size());
      used.push_back(v);
    }
  return used;
}

void add_facts(const tetlod_view& view, vtkUnstructuredGrid* grid)
{
  vtkFieldData* data = grid->GetFieldData();
  vtkNew<vtkUnsignedCharArray> id;
  id->SetName("tetlod_id");
  for (char letter : view.id)
    id->InsertNextValue(static_cast<unsigned char>(letter));
  data->AddArray(id);
  for (const auto& fact : view.facts)
  {
    vtkNew<vtkDoubleArray> array;
    array->SetName(fact.first.c_str());
    array->InsertNextValue(fact.second);
    data->AddArray(array);
    if (fact.first == "TimeValue")
      grid->GetInformation()->Set(vtkDataObject::DATA_TIME_STEP(), fact.second);
  }
}
}

void tetlod_fill_grid(const tetlod_view& view, const double* box, vtkUnstructuredGrid* grid)
{
  numbers tets, vertices, places;
  if (box)
  {
    tets = tets_in(view, box);
    vertices = vertices_of(view, tets, places);
  }
  const numbers *chosen = box ? &tets : nullptr, *kept = box ? &vertices : nullptr;
  const tetlod_column positions = { "Points", 3, view.position_type == TETLOD_FLOAT32 ? VTK_FLOAT : VTK_DOUBLE,
    view.positions };
  vtkNew<vtkPoints> points;
  points->SetData(array_of(positions, view.vertices, kept));
  grid->Initialize();
  grid->SetPoints(points);
  if (view.tets < (1u << 29))
    grid->SetCells(VTK_TETRA, cells_of<vtkTypeInt32Array>(view, chosen, places));
  else
    grid->SetCells(VTK_TETRA, cells_of<vtkTypeInt64Array>(view, chosen, places));
  for (const tetlod_column& column : view.fields)
    grid->GetPointData()->AddArray(array_of(column, view.vertices, kept));
  for (const tetlod_column& column : view.cells)
    grid->GetCellData()->AddArray(array_of(column, view.tets, chosen));
  add_facts(view, grid);
}
