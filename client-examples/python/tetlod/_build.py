# SPDX-License-Identifier: BSD-3-Clause
"""Building streams from meshes in memory: by libtetlod-build where it is installed, else by the program, of a VTU file.
"""
from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple, Type, Union

import numpy as np

from . import _build_library
from ._mesh import VTK_TETRA, Mesh
from ._words import speak

Arrays = Tuple[Any, Any, Mapping[str, Any], Mapping[str, Any]]

TYPES = {'f4': 'Float32', 'f8': 'Float64', 'i1': 'Int8', 'u1': 'UInt8', 'i2': 'Int16', 'u2': 'UInt16', 'i4': 'Int32',
         'u4': 'UInt32',
         'i8': 'Int64', 'u8': 'UInt64'}


def build(mesh: Any, tets: Any = None, fields: Union[Mapping[str, Any], Sequence[Mapping[str, Any]], None] = None, *,
          cells: Optional[Mapping[str, Any]] = None, times: Optional[Sequence[float]] = None, output: Any = None,
          program: Optional[str] = None, **options: Any) -> Optional[bytes]:
    """Builds a stream. Returns its bytes, or writes it to the file `output`.

    `mesh` is a Mesh, a meshio mesh, a grid of VTK or PyVista, or an array of points with `tets` (m, 4) and `fields` of
    the points and `cells` of the tetrahedra by name. Options are those of `tetlod build`, with _ for -:
    field='Pressure', max_error=0.1, keep_order=True; lists repeat an option.

    A series: `fields` is a list of such mappings, one a step, or `mesh` is a list of meshes; `times` are the steps'
    times, 0, 1, 2, ... without. Series are built by the program.

    Arrays, a Mesh, and meshio's tetrahedra are built by libtetlod-build where it is installed, without a file between.
    It also takes progress=function(phase, fraction), which cancels by returning False, and metadata=dict or JSON text.
    Otherwise the program builds: `program`, $TETLOD, or `tetlod` of the PATH.
    """
    if isinstance(fields, (list, tuple)) or isinstance(mesh, (list, tuple)) and tets is None:
        return build_series(mesh, tets, fields, cells or {}, times, output, program, options)
    if times is not None:
        raise TypeError('times= is for a series: give a list of fields, one mapping a step, or a list of meshes')
    library = None if program else _build_library.library_path()
    assert fields is None or isinstance(fields, Mapping)
    arrays = arrays_of(mesh, tets, fields, cells)
    if library and arrays and set(options) <= _build_library.OPTIONS:
        stream = _build_library.build(library, *arrays, options)
        if output is None:
            return stream
        part = os.fspath(output) + '.part'
        with open(part, 'wb') as file:
            file.write(stream)
        os.replace(part, output)
        return None
    for name in {'progress', 'metadata'} & set(options):
        raise TypeError(
            '%s= is for libtetlod-build, which %s' % (name, 'does not take this' if library else 'is not installed'))
    return build_by_program(mesh, arrays, output, program, options)


def build_by_program(mesh: Any, arrays: Optional[Arrays], output: Any, program: Optional[str],
                     options: Mapping[str, Any]) -> Optional[bytes]:
    with tempfile.TemporaryDirectory(prefix='tetlod-') as folder:
        path = os.path.join(folder, 'mesh.vtu')
        save_any(path, mesh, arrays)
        return run_program(program, folder, path, output, options)


def build_series(mesh: Any, tets: Any, fields: Any, cells: Mapping[str, Any], times: Optional[Sequence[float]],
                 output: Any, program: Optional[str], options: Mapping[str, Any]) -> Optional[bytes]:
    """Steps of one mesh, or of a list of meshes, as files that the program makes a series of."""
    meshes = mesh if isinstance(mesh, (list, tuple)) and tets is None else [mesh] * len(fields)
    count = len(meshes)
    moments = [float(number) for number in range(count)] if times is None else [float(time) for time in times]
    if not count or len(moments) != count or fields is not None and len(fields) != count:
        raise ValueError('a series needs as many times as steps, and one at least: %d times, %d steps' % (
            len(moments), count))
    if any(later <= time for time, later in zip(moments, moments[1:])):
        raise ValueError('the times of a series rise')
    with tempfile.TemporaryDirectory(prefix='tetlod-') as folder:
        entries = []
        for number, (time, own) in enumerate(zip(moments, meshes)):
            name = 'step_%d.vtu' % number
            save_any(os.path.join(folder, name), own, arrays_of(own, tets, fields[number] if fields else None, cells))
            entries.append('<DataSet timestep="%r" file="%s"/>' % (time, name))
        path = os.path.join(folder, 'mesh.pvd')
        with open(path, 'w') as file:
            file.write('<?xml version="1.0"?><VTKFile type="Collection" version="0.1"><Collection>%s</Collection>'
                       '</VTKFile>' % ''.join(entries))
        return run_program(program, folder, path, output, options)


def save_any(path: str, mesh: Any, arrays: Optional[Arrays]) -> None:
    if arrays:
        write_vtu(path, *arrays)
    else:
        save(path, mesh)


def run_program(program: Optional[str], folder: str, path: str, output: Any,
                options: Mapping[str, Any]) -> Optional[bytes]:
    command = program or os.environ.get('TETLOD') or shutil.which('tetlod')
    if not command:
        raise FileNotFoundError(
            'neither libtetlod-build nor the program tetlod is installed (or name it: program=, or $TETLOD)')
    made = os.path.join(folder, 'mesh.tetlod') if output is None else os.fspath(output)
    done = subprocess.run([command, 'build', path, '-o', made, '--quiet', *arguments(options)],
                          stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    if done.returncode:
        message = speak(done.stderr.decode('utf-8', 'replace').replace(path, 'the mesh').replace(folder + os.sep, ''))
        kind: Type[Exception] = ValueError if done.returncode in (2, 3) else OSError
        if message.startswith('there is no option'):
            kind = TypeError
        raise kind(message or 'tetlod build failed with status %d' % done.returncode)
    if output is not None:
        return None
    with open(made, 'rb') as file:
        return file.read()


def arguments(options: Mapping[str, Any]) -> List[str]:
    given = []
    for name, value in options.items():
        option = '--' + name.replace('_', '-')
        for one in value if isinstance(value, (list, tuple)) else [value]:
            if one is True:
                given.append(option)
            elif one is not None and one is not False:
                given += [option, str(one)]
    return given


def arrays_of(mesh: Any, tets: Any, fields: Optional[Mapping[str, Any]],
              cells: Optional[Mapping[str, Any]]) -> Optional[Arrays]:
    """Points, tets, fields and cells of a mesh; None for a grid that a file has to be written of."""
    if hasattr(mesh, 'GetPointData'):  # VTK, and PyVista, whose grids are VTK's
        return None
    if hasattr(mesh, 'point_data') and hasattr(mesh, 'cells'):  # meshio
        if [block.type for block in mesh.cells] != ['tetra']:
            return None
        return checked(mesh.points, mesh.cells[0].data, mesh.point_data,
                       {name: values[0] for name, values in mesh.cell_data.items()})
    if isinstance(mesh, Mesh):
        return checked(mesh.points, mesh.tets, mesh.fields, mesh.cells)
    if tets is None:
        raise TypeError('with an array of points, give their tets, too')
    return checked(mesh, tets, fields or {}, cells or {})


def checked(points: Any, tets: Any, fields: Mapping[str, Any], cells: Mapping[str, Any]) -> Arrays:
    points, tets = np.asarray(points), np.asarray(tets)
    if points.ndim != 2 or points.shape[1] != 3 or tets.ndim != 2 or tets.shape[1] != 4:
        raise ValueError(
            'points are an array of (n, 3), tets one of (m, 4), not %s and %s' % (points.shape, tets.shape))
    if points.dtype.kind != 'f':
        points = points.astype(np.float64)
    for name, values, count in [(n, v, len(points)) for n, v in fields.items()] + [(n, v, len(tets))
                                                                                   for n, v in cells.items()]:
        if np.shape(values)[:1] != (count,):
            raise ValueError('%r has values of shape %s; there are %d %s' % (name, np.shape(values), count,
                                                                             'points' if name in fields else 'tets'))
    return points, tets, fields, cells


def save(path: str, mesh: Any) -> None:
    """Writes a grid of VTK, or a meshio mesh of any cells, as VTU."""
    if not hasattr(mesh, 'GetPointData'):
        import meshio
        meshio.write(path, mesh, file_format='vtu')
        return
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetFileName(path)
    writer.SetInputData(mesh)
    if not writer.Write():
        raise OSError('VTK cannot write this grid as VTU: it has to be a vtkUnstructuredGrid')


def write_vtu(path: str, points: Any, tets: Any, fields: Mapping[str, Any], cells: Mapping[str, Any]) -> None:
    """A VTU file with raw appended arrays."""
    appended: List[Tuple[str, Any]] = []

    def section(tag: str, arrays: Dict[str, Any]) -> str:
        return '<%s>%s</%s>' % (tag, ''.join(header(name, values) for name, values in arrays.items()), tag)

    def header(name: str, values: Any) -> str:
        values = np.ascontiguousarray(values)
        if values.dtype.str[1:] not in TYPES:
            raise TypeError('%r has values of type %s, which VTU does not have' % (name, values.dtype))
        values = values.astype(values.dtype.newbyteorder('<'), copy=False)
        offset = sum(8 + v.nbytes for _, v in appended)
        appended.append((name, values))
        quoted = name.replace('&', '&amp;').replace('<', '&lt;').replace('"', '&quot;')
        return '<DataArray type="%s" Name="%s" NumberOfComponents="%d" format="appended" offset="%d"/>' % (
            TYPES[values.dtype.str[1:]], quoted, values.size // max(1, len(values)), offset)

    topology = {'connectivity': tets.astype(np.int64).ravel(),
                'offsets': np.arange(4, 4 * len(tets) + 1, 4, dtype=np.int64),
                'types': np.full(len(tets), VTK_TETRA, np.uint8)}
    body = ('<Piece NumberOfPoints="%d" NumberOfCells="%d">' % (len(points), len(tets)) +
            section('Points', {'Points': points}) + section('Cells', topology) + section('PointData', dict(fields)) +
            section('CellData', dict(cells)) + '</Piece>')
    with open(path, 'wb') as file:
        file.write((
            '<?xml version="1.0"?><VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
            'header_type="UInt64">'
            '<UnstructuredGrid>%s</UnstructuredGrid><AppendedData encoding="raw">_' % body).encode())
        for _, values in appended:
            file.write(values.nbytes.to_bytes(8, 'little') + values.tobytes())
        file.write(b'</AppendedData></VTKFile>')
