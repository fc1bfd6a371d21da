# SPDX-License-Identifier: BSD-3-Clause
"""tetlod for VTK, PyVista (entry points `pyvista.readers` and `pyvista.writers`) and meshio."""
from __future__ import annotations

import math
from typing import Any, Dict

from . import _stream
from ._mesh import VTK_TETRA, Mesh


def facts(mesh: Mesh) -> Dict[str, Any]:
    """What `tetlod extract` writes as field data: ERRORS.md."""
    import numpy as np
    numbers = {'tetlod_level': mesh.level, 'tetlod_domain_error': mesh.domain_error}
    if mesh.time is not None:
        numbers['TimeValue'] = mesh.time
    for name, known in mesh.errors.items():
        if not math.isnan(known.get('max', math.nan)):
            numbers['tetlod_max_error ' + name] = known['max']
    found = {name: np.array([number], float) for name, number in numbers.items()}
    return {'tetlod_id': np.frombuffer(mesh.id.encode(), np.uint8), **found}


def grid(mesh: Mesh) -> Any:
    """A vtkUnstructuredGrid."""
    import numpy as np
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkUnstructuredGrid
    points, cells, made = vtkPoints(), vtkCellArray(), vtkUnstructuredGrid()
    points.SetData(numpy_to_vtk(mesh.points, deep=True))
    offsets = np.arange(0, 4 * len(mesh.tets) + 1, 4, dtype=np.int64)
    cells.SetData(numpy_to_vtkIdTypeArray(offsets, deep=True),
                  numpy_to_vtkIdTypeArray(mesh.tets.astype(np.int64).ravel(), deep=True))
    made.SetPoints(points)
    made.SetCells(VTK_TETRA, cells)
    for data, arrays in ((made.GetPointData(), mesh.fields), (made.GetCellData(), mesh.cells),
                         (made.GetFieldData(), facts(mesh))):
        for name, values in arrays.items():
            array = numpy_to_vtk(values, deep=True)
            array.SetName(name)
            data.AddArray(array)
    return made


def read_pyvista(path: str, **choice: Any) -> Any:
    """What `pyvista.read('x.tetlod', error=0.01)` calls."""
    return _stream.read(path, **choice).to_pyvista()


def write_pyvista(dataset: Any, path: str, **options: Any) -> None:
    """What `mesh.save('x.tetlod', field='p')` calls; options are those of `tetlod.build`."""
    from ._build import build
    if not dataset.IsA('vtkUnstructuredGrid'):
        cast = getattr(dataset, 'cast_to_unstructured_grid', None)
        if cast is None:
            raise TypeError('%s cannot become a stream: it has to be a volume of cells' % type(dataset).__name__)
        dataset = cast()
    build(dataset, output=path, **options)


def register_meshio() -> None:
    """Makes `meshio.read('x.tetlod')` and `meshio.write('x.tetlod', mesh)` work."""
    import meshio
    from ._build import build

    def read(path: Any) -> Any:
        return _stream.read(path).to_meshio()

    def write(path: Any, mesh: Any, **options: Any) -> None:
        build(mesh, output=path, **options)

    meshio.register_format('tetlod', ['.tetlod'], read, {'tetlod': write})
