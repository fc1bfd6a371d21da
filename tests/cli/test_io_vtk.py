#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Files that VTK writes, in every mode, are read exactly; what tetlod writes, VTK reads exactly."""
import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

from common import case, finish, must, path, read_grid

vtk.vtkObject.GlobalWarningDisplayOff()


def points_of(grid):
    return vtk_to_numpy(grid.GetPoints().GetData())


def tets_of(grid):
    assert set(vtk_to_numpy(grid.GetCellTypesArray())) == {vtk.VTK_TETRA}
    return vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4)


def fields_of(grid):
    data = grid.GetPointData()
    return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())
            if data.GetArray(i)}


def volumes(points, tets):
    p = points.astype(float)[tets]
    return np.einsum('ij,ij->i', p[:, 1] - p[:, 0], np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 0])) / 6


def add_array(grid, name, values):
    array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
    array.SetName(name)
    grid.GetPointData().AddArray(array)


def tet_grid(precision=np.float32, count=400, seed=1):
    """A Delaunay mesh with fields of several types; big enough for several compressed blocks of the small block size.
    """
    from scipy.spatial import Delaunay
    random = np.random.default_rng(seed)
    points = random.random((count, 3)).astype(precision)
    tets = Delaunay(points.astype(float)).simplices
    tets = tets[np.abs(volumes(points, tets)) > 1e-7]
    flip = volumes(points, tets) < 0
    tets[flip] = tets[flip][:, [0, 1, 3, 2]]
    used = np.unique(tets)
    points, tets = points[used], np.searchsorted(used, tets)
    grid = vtk.vtkUnstructuredGrid()
    at = vtk.vtkPoints()
    at.SetData(numpy_to_vtk(points, deep=True))
    grid.SetPoints(at)
    cells = vtk.vtkCellArray()
    for tet in tets:
        cells.InsertNextCell(4, [int(v) for v in tet])
    grid.SetCells(vtk.VTK_TETRA, cells)
    add_array(grid, 'heat in K', random.standard_normal(len(points)).astype(np.float32))
    add_array(grid, 'wind', random.standard_normal((len(points), 3)))
    add_array(grid, 'count', random.integers(-9, 9, len(points)).astype(np.int32))
    add_array(grid, 'stress', random.standard_normal((len(points), 9)).astype(np.float32))
    add_array(grid, 'small', random.integers(0, 255, len(points)).astype(np.uint8))
    return grid


def compare(wanted, got, order=list):
    """None, or how the two differ. Integers come back as integers."""
    if points_of(wanted).dtype != points_of(got).dtype or not np.array_equal(points_of(wanted), points_of(got)):
        return 'points differ'
    if not np.array_equal(tets_of(wanted), tets_of(got)):
        return 'tetrahedra differ'
    a, b = fields_of(wanted), fields_of(got)
    if order(a) != order(b):
        return 'fields %s, not %s' % (list(b), list(a))
    for name in a:
        same = a[name].dtype == b[name].dtype if a[name].dtype.kind == 'f' else b[name].dtype == np.int32
        if not same or not np.array_equal(a[name].astype(float), b[name].astype(float)):
            return 'field %s differs' % name
    return None


def vtu_case(grid, mode, compressor, header, order, block):
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetFileName(path('in.vtu'))
    if mode == 'ascii':
        writer.SetDataModeToAscii()
    elif mode == 'inline':
        writer.SetDataModeToBinary()
    else:
        writer.SetDataModeToAppended()
        writer.SetEncodeAppendedData(mode == 'base64')
    {'none': writer.SetCompressorTypeToNone, 'zlib': writer.SetCompressorTypeToZLib,
     'lz4': writer.SetCompressorTypeToLZ4}[compressor]()
    if header == 64:
        writer.SetHeaderTypeToUInt64()
    else:
        writer.SetHeaderTypeToUInt32()
    if order == 'big':
        writer.SetByteOrderToBigEndian()
    else:
        writer.SetByteOrderToLittleEndian()
    writer.SetBlockSize(block)
    assert writer.Write()
    must('convert', path('in.vtu'), '-o', path('out.vtu'))
    return compare(grid, read_grid('out.vtu'))


def legacy_case(grid, version, binary):
    writer = vtk.vtkUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetFileName(path('in.vtk'))
    writer.SetFileVersion(version)
    writer.SetFileTypeToBinary() if binary else writer.SetFileTypeToASCII()
    assert writer.Write()
    must('convert', path('in.vtk'), '-o', path('out.vtu'))
    return compare(read_grid('in.vtk'), read_grid('out.vtu'))


def with_everything():
    """Attributes of each kind, field data, cell data, strings and names with spaces around the tetrahedra."""
    grid = tet_grid(count=60)
    data, points = grid.GetPointData(), grid.GetNumberOfPoints()
    data.SetActiveScalars('count')
    data.SetActiveVectors('wind')
    data.SetActiveTensors('stress')
    normals = numpy_to_vtk(np.full((points, 3), 0.5, np.float32), deep=True)
    normals.SetName('normals')
    data.SetNormals(normals)
    add_array(grid, 'a<&>"b%', np.arange(points, dtype=np.float32))
    words = vtk.vtkStringArray()
    words.SetName('words')
    for i in range(points):
        words.InsertNextValue('word %d\n%s' % (i, 'x' * (i * 3)))
    data.AddArray(words)
    about = vtk.vtkStringArray()
    about.SetName('about')
    about.InsertNextValue('POINTS 3 float')
    grid.GetFieldData().AddArray(about)
    cell = numpy_to_vtk(np.arange(grid.GetNumberOfCells(), dtype=np.float32), deep=True)
    cell.SetName('cell')
    cell.SetComponentName(0, 'a component')
    grid.GetCellData().SetScalars(cell)
    data.GetArray('wind').SetComponentName(0, 'east')
    return grid


def everything_case(binary, version):
    grid = with_everything()
    writer = vtk.vtkUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetFileName(path('in.vtk'))
    writer.SetFileVersion(version)
    writer.SetFileTypeToBinary() if binary else writer.SetFileTypeToASCII()
    assert writer.Write()
    must('convert', path('in.vtk'), '-o', path('out.vtu'))
    a, b = fields_of(read_grid('in.vtk')), fields_of(read_grid('out.vtu'))
    if sorted(a) != sorted(b):
        return 'fields %s, not %s' % (sorted(b), sorted(a))
    wrong = [name for name in a if not np.array_equal(a[name].astype(float), b[name].astype(float))]
    return 'fields %s differ' % wrong if wrong else None


def write_structured(kind, binary):
    """A 3 x 4 x 5 grid as VTK writes it; gives its points and field."""
    dims = (3, 4, 5)
    if kind == 'points':
        grid, writer = vtk.vtkImageData(), vtk.vtkStructuredPointsWriter()
        grid.SetDimensions(*dims)
        grid.SetOrigin(1, 2, 3)
        grid.SetSpacing(0.5, 0.25, 2)
    elif kind == 'rectilinear':
        grid, writer = vtk.vtkRectilinearGrid(), vtk.vtkRectilinearGridWriter()
        grid.SetDimensions(*dims)
        for n, setter in zip(dims, (grid.SetXCoordinates, grid.SetYCoordinates, grid.SetZCoordinates)):
            setter(numpy_to_vtk(np.arange(n, dtype=np.float32) ** 2, deep=True))
    else:
        grid, writer = vtk.vtkStructuredGrid(), vtk.vtkStructuredGridWriter()
        grid.SetDimensions(*dims)
        at = vtk.vtkPoints()
        for k in range(5):
            for j in range(4):
                for i in range(3):
                    at.InsertNextPoint(-i + 0.1 * j, j + 0.1 * k, k)  # left-handed
        grid.SetPoints(at)
    points = np.array([grid.GetPoint(p) for p in range(grid.GetNumberOfPoints())])
    values = numpy_to_vtk(np.arange(len(points), dtype=np.float32), deep=True)
    values.SetName('s')
    grid.GetPointData().SetScalars(values)
    writer.SetInputData(grid)
    writer.SetFileName(path('in.vtk'))
    writer.SetFileTypeToBinary() if binary else writer.SetFileTypeToASCII()
    assert writer.Write()
    return points


def structured_case(kind, binary):
    points = write_structured(kind, binary)
    must('convert', path('in.vtk'), '-o', path('out.vtu'))
    grid = read_grid('out.vtu')
    tets = tets_of(grid)
    if not np.allclose(points_of(grid), points, atol=1e-6) or len(tets) != 5 * 2 * 3 * 4:
        return '%d points, %d tetrahedra' % (len(points_of(grid)), len(tets))
    if not np.array_equal(fields_of(grid)['s'], np.arange(60)):
        return 'the field differs'
    return None if (volumes(points, tets) > 0).all() else 'tetrahedra of volume <= 0'


def mixed_grid():
    """A box of hexahedra with pyramids, wedges, voxels and tetrahedra grown on it; volume 1 each for the hexahedra."""
    grid, at = vtk.vtkUnstructuredGrid(), vtk.vtkPoints()
    def corner(i, j, k):
        return i + 4 * (j + 3 * k)
    for k in range(3):
        for j in range(3):
            for i in range(4):
                at.InsertNextPoint(i, j, k)
    grid.SetPoints(at)
    grid.Allocate(20)
    def box(i, j, k):
        return [corner(i + a, j + b, k + c) for c in (0, 1) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    for k in range(2):
        for j in range(2):
            h = box(0, j, k)
            grid.InsertNextCell(vtk.VTK_HEXAHEDRON, 8, h)
            v = box(1, j, k)
            grid.InsertNextCell(vtk.VTK_VOXEL, 8, [v[i] for i in (0, 1, 3, 2, 4, 5, 7, 6)])
            w = box(2, j, k)
            grid.InsertNextCell(vtk.VTK_WEDGE, 6, [w[i] for i in (0, 1, 2, 4, 5, 6)])
            grid.InsertNextCell(vtk.VTK_WEDGE, 6, [w[i] for i in (0, 2, 3, 4, 6, 7)])
    top = at.InsertNextPoint(-1, 0.5, 0.5)
    grid.InsertNextCell(vtk.VTK_PYRAMID, 5, [corner(0, 0, 0), corner(0, 1, 0), corner(0, 1, 1), corner(0, 0, 1), top])
    far = at.InsertNextPoint(-1, 1.5, 0.5)
    grid.InsertNextCell(vtk.VTK_TETRA, 4, [corner(0, 1, 0), corner(0, 1, 1), top, far])
    grid.InsertNextCell(vtk.VTK_TRIANGLE, 3, [0, 1, 2])
    grid.InsertNextCell(vtk.VTK_VERTEX, 1, [0])
    at.InsertNextPoint(9, 9, 9)
    add_array(grid, 'id', np.arange(at.GetNumberOfPoints(), dtype=np.float64))
    return grid


def mixed_case():
    grid = mixed_grid()
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetFileName(path('in.vtu'))
    assert writer.Write()
    must('convert', path('in.vtu'), '-o', path('out.vtu'))
    got = read_grid('out.vtu')
    tets, points = tets_of(got), points_of(got)
    volume = volumes(points, tets)
    wanted = 12 + 1 / 3 + abs(volume[0])  # the first one is the tetrahedron, as it was
    if len(points) != grid.GetNumberOfPoints() - 1 or abs(np.abs(volume).sum() - wanted) > 1e-6:
        return '%d points, volume %g instead of %g' % (len(points), np.abs(volume).sum(), wanted)
    faces = np.sort(tets[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3), axis=1)
    _, uses = np.unique(faces, axis=0, return_counts=True)
    boundary = np.abs(uses == 1).sum()
    surface = 2 * 32 - 2 + 4 - 1 + 3  # the box's squares; a pyramid on one; a tetrahedron on that
    if uses.max() > 2 or (volume[1:] * volume[0] <= 0).any():
        return 'faces of %d cells, least volume %g' % (uses.max(), volume.min())
    return None if boundary == surface else '%d boundary faces, not %d' % (boundary, surface)


def quadratic_case():
    grid, at = vtk.vtkUnstructuredGrid(), vtk.vtkPoints()
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    middles = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]
    for p in corners + [tuple(np.mean([corners[a], corners[b]], axis=0)) for a, b in middles]:
        at.InsertNextPoint(*p)
    grid.SetPoints(at)
    grid.Allocate(1)
    grid.InsertNextCell(vtk.VTK_QUADRATIC_TETRA, 10, list(range(10)))
    add_array(grid, 'id', np.arange(10, dtype=np.float32))
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetFileName(path('in.vtu'))
    assert writer.Write()
    must('convert', path('in.vtu'), '-o', path('out.vtu'))
    got = read_grid('out.vtu')
    good = len(points_of(got)) == 4 and np.array_equal(tets_of(got), [[0, 1, 2, 3]])
    return None if good else 'not the tetrahedron of its corners'


def pieces_case():
    """Two pieces in one file: points and cells follow one another."""
    one, two = tet_grid(count=50, seed=2), tet_grid(count=70, seed=3)
    append = vtk.vtkAppendFilter()
    append.AddInputData(one)
    append.AddInputData(two)
    append.Update()
    texts = []
    for part, grid in enumerate((one, two)):
        writer = vtk.vtkXMLUnstructuredGridWriter()
        writer.SetInputData(grid)
        writer.SetFileName(path('part%d.vtu' % part))
        writer.SetDataModeToBinary()
        assert writer.Write()
        texts.append(open(path('part%d.vtu' % part)).read())
    piece = texts[1][texts[1].index('<Piece'):texts[1].index('</Piece>') + len('</Piece>')]
    both = texts[0].replace('</Piece>', '</Piece>\n    <Piece NumberOfPoints="0" NumberOfCells="0"></Piece>\n' + piece)
    open(path('in.vtu'), 'w').write(both)
    must('convert', path('in.vtu'), '-o', path('out.vtu'))
    return compare(append.GetOutput(), read_grid('out.vtu'), order=sorted)


def written_case(precision, extension):
    """tetlod's own output, read by VTK and by tetlod."""
    grid = tet_grid(precision)
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetFileName(path('in.vtu'))
    assert writer.Write()
    must('convert', path('in.vtu'), '-o', path('out' + extension))
    problem = compare(grid, read_grid('out' + extension))
    if problem:
        return 'VTK: ' + problem
    must('convert', path('out' + extension), '-o', path('again.vtu'))
    return compare(grid, read_grid('again.vtu'))


BY_HAND = '''<VTKFile type="UnstructuredGrid" version="%s" byte_order="LittleEndian"%s>
<UnstructuredGrid><Piece NumberOfPoints='4' NumberOfCells="1"><Points>
<DataArray type="Float64" NumberOfComponents="3" format="%s">%s</DataArray></Points>
<Cells><DataArray type="Int64" Name="connectivity" format="ascii">0 1 2
3</DataArray><DataArray type="Int32" Name="offsets" format="ascii">4</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">10</DataArray></Cells>
<PointData><DataArray type="Int64" Name="n" format="ascii"> 1 -2 3 4 </DataArray></PointData>
</Piece></UnstructuredGrid></VTKFile>'''


def by_hand_case(version, attributes, format_name, points):
    open(path('in.vtu'), 'w').write(BY_HAND % (version, attributes, format_name, points))
    must('convert', path('in.vtu'), '-o', path('out.vtu'))
    got = read_grid('out.vtu')
    wanted = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    good = np.array_equal(points_of(got), wanted) and np.array_equal(fields_of(got)['n'], [1, -2, 3, 4])
    return None if good and np.array_equal(tets_of(got), [[0, 1, 2, 3]]) else 'not what was written'


def base64_points(pieces):
    """As one run of base64 per element of `pieces`."""
    import base64
    return ''.join(base64.b64encode(p).decode() for p in pieces)


def by_hand_cases():
    import struct
    import zlib
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float).tobytes()
    packed = [zlib.compress(points[:40]), zlib.compress(points[40:80]), zlib.compress(points[80:])]
    header = struct.pack('<6I', 3, 40, 16, *map(len, packed))
    exact = [zlib.compress(points[:48]), zlib.compress(points[48:])]
    exact_header = struct.pack('<5I', 2, 48, 0, *map(len, exact))
    zipped = ' compressor="vtkZLibDataCompressor"'
    ascii_points = '0 0 0 1.0e0 0 0\n\t0 1. 0 0 0 +1'
    case('by hand: ascii, version 0.1', lambda: by_hand_case('0.1', '', 'ascii', ascii_points))
    case('by hand: ascii, version 2.2', lambda: by_hand_case('2.2', ' header_type="UInt64"', 'ascii', ascii_points))
    case('by hand: header and values in one run of base64',
         lambda: by_hand_case('0.1', '', 'binary', base64_points([struct.pack('<I', 96) + points])))
    case('by hand: header and values in two runs of base64',
         lambda: by_hand_case('1.0', '', 'binary', '\n ' + base64_points([struct.pack('<I', 96), points]) + '\n'))
    case('by hand: partial last block', lambda: by_hand_case('0.1', zipped, 'binary',
                                                             base64_points([header, b''.join(packed)])))
    case('by hand: whole last block', lambda: by_hand_case('0.1', zipped, 'binary',
                                                           base64_points([exact_header, b''.join(exact)])))


def main():
    grids = {np.float32: tet_grid(np.float32), np.float64: tet_grid(np.float64)}
    for mode in 'ascii', 'inline', 'raw', 'base64':
        for compressor in 'none', 'zlib', 'lz4':
            for header, order, block, precision in ((32, 'little', 1024, np.float32), (64, 'big', 32768, np.float64)):
                case('vtu %s %s UInt%d %s-endian' % (mode, compressor, header, order),
                     lambda: vtu_case(grids[precision], mode, compressor, header, order, block))
    for version, label in ((42, '4.2'), (51, '5.1')):
        for binary in False, True:
            kind = 'binary' if binary else 'ascii'
            case('vtk %s %s' % (label, kind), lambda: legacy_case(grids[np.float32], version, binary))
            case('vtk %s %s with all attributes' % (label, kind), lambda: everything_case(binary, version))
    for kind in 'points', 'rectilinear', 'grid':
        for binary in False, True:
            case('vtk structured %s %s' % (kind, 'binary' if binary else 'ascii'),
                 lambda: structured_case(kind, binary))
    case('mixed cells are split so that neighbours match', mixed_case)
    case('a quadratic tetrahedron is taken by its corners', quadratic_case)
    case('pieces follow one another', pieces_case)
    for precision in np.float32, np.float64:
        for extension in '.vtu', '.vtk':
            case('written %s %s' % (extension, np.dtype(precision)), lambda: written_case(precision, extension))
    by_hand_cases()
    finish()


main()
