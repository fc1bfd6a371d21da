# SPDX-License-Identifier: BSD-3-Clause
"""One level as arrays, and as a mesh of VTK, PyVista and meshio."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Callable, Dict, Iterator, Mapping, Optional, Sequence

VTK_TETRA = 10


class Cells(Mapping[str, Any]):
    """Values of tetrahedra by name. They lie at the end of a stream, and are read when they are asked for. A stream
    that is cut off lacks those of which bytes are missing."""

    def __init__(self, names: Sequence[str], read: Callable[[str], Any], count: int) -> None:
        self._names, self._read, self._count, self._held = names, read, count, {
        }  # type: Sequence[str], Callable[[str], Any], int, Dict[str, Any]

    def __getitem__(self, name: str) -> Any:
        if name not in self._names:
            raise KeyError(name)
        if name not in self._held:
            values = self._read(name)[:self._count]
            values.flags.writeable = False
            self._held[name] = values
        return self._held[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        return '<tetlod.Cells %s>' % (', '.join(self._names) or 'none')


def described(name: str, values: Any) -> str:
    components = ' (%d)' % values.shape[1] if values.ndim > 1 else ''
    extent = ' %.4g … %.4g' % (values.min(), values.max()) if values.size else ''
    return name + components + extent


@dataclass(frozen=True, eq=False, repr=False)
class Mesh:
    """A level. `points` (n, 3), `tets` (m, 4), `fields` by name: (n,) or (n, components). The arrays are read-only.

    `error` is the error that was asked for: the largest of the fields meant, in the measure meant, as a fraction of the
    range.
    `errors[field][measure]` are all of them. `cells` holds values of tetrahedra by name, such as materials.
    `time` is that of the step that `Stream.at` found. `id` is the stream's content id. `tet_levels` of a region is
    the level that each tetrahedron is of, and whose errors hold in it; else None.
    """
    points: Any
    tets: Any
    fields: Dict[str, Any]
    level: int
    error: float
    errors: Dict[str, Dict[str, float]]
    domain_error: float
    cells: Mapping[str, Any]
    time: Optional[float] = None
    id: str = ''
    tet_levels: Optional[Any] = None

    def __repr__(self) -> str:
        """Three lines: what it is, its fields, its cells."""
        moment = '' if self.time is None else ', time %g' % self.time
        known = '' if math.isnan(self.error) else ', error %.3g %%' % (100 * self.error)
        fields = ', '.join(described(name, values) for name, values in self.fields.items()) or 'none'
        return '<tetlod.Mesh level %d%s: %s points, %s tetrahedra%s\n fields: %s\n cells: %s>' % (
            self.level, moment, format(len(self.points), ','), format(len(self.tets), ','), known, fields,
            ', '.join(self.cells) or 'none')

    def to_vtk(self) -> Any:
        """A vtkUnstructuredGrid with copies of the arrays, and field data as `tetlod extract` writes. Needs vtk."""
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
        return meshio.Mesh(self.points, [('tetra', self.tets.astype('int64'))], point_data=dict(self.fields),
                           cell_data=cells)
