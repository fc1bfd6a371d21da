# SPDX-License-Identifier: BSD-3-Clause
"""One level as arrays, and as a mesh of VTK, PyVista and meshio."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Dict

VTK_TETRA = 10


@dataclass(frozen=True, eq=False)
class Mesh:
    """A level. `points` (n, 3), `tets` (m, 4), `fields` by name: (n,) or (n, components). The arrays are read-only.

    `error` is the error that was asked for: the largest of the fields meant, in the measure meant, as a fraction of the range.
    `errors[field][measure]` are all of them. `cells` holds values of tetrahedra, by name, where the stream has such.
    """
    points: Any
    tets: Any
    fields: Dict[str, Any]
    level: int
    error: float
    errors: Dict[str, Dict[str, float]]
    domain_error: float
    cells: Dict[str, Any] = field(default_factory=dict)

    def to_vtk(self) -> Any:
        """A vtkUnstructuredGrid with copies of the arrays. Needs the vtk package."""
        from .adapters import grid
        return grid(self)

    def to_pyvista(self) -> Any:
        """A pyvista.UnstructuredGrid. Needs pyvista."""
        import pyvista
        return pyvista.wrap(self.to_vtk())

    def to_meshio(self) -> Any:
        """A meshio.Mesh. Needs meshio."""
        import meshio
        cells = {name: [values] for name, values in self.cells.items()}
        return meshio.Mesh(self.points, [('tetra', self.tets.astype('int64'))], point_data=dict(self.fields), cell_data=cells)
