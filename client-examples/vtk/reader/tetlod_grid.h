// SPDX-License-Identifier: BSD-3-Clause
#ifndef tetlod_grid_h
#define tetlod_grid_h

#include "tetlod_stream.h"

class vtkUnstructuredGrid;

// Fills a grid with copies of what the view has. With a box, X0, X1, Y0, Y1, Z0, Z1: with the tetrahedra that meet it.
void tetlod_fill_grid(const tetlod_view& view, const double* box, vtkUnstructuredGrid* grid);

#endif
