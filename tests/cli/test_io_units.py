#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Units that a file gives for its fields are in the stream's metadata: VTK's by VTK, CGNS's by libcgns, OpenFOAM's and
XDMF's by hand."""
import ctypes

from common import case, finish, info, must, path, report, tetlod, write

try:
    import vtk
    import cgns_file
    from meshes import tet_mesh, vtk_mesh
    from test_io_foam import write_case
    from test_io_vtkxml import save
except ImportError:
    vtk = None


def differs(name, wanted):
    """Builds the file's stream; None, or which units that says instead of those wanted."""
    must('build', name, '-o', 'out.tetlod', '--time', 'last')
    got = info('out.tetlod')['metadata'].get('units', {})
    return None if got == wanted else '%s, not %s' % (got, wanted)


def labelled():
    grid = vtk_mesh(*tet_mesh(40))
    for data, name, unit in ((grid.GetPointData(), 'wind', 'm/s'), (grid.GetPointData(), 'heat', '°C'),
                             (grid.GetCellData(), 'load', 'N m^-2')):
        data.GetArray(name).GetInformation().Set(vtk.vtkDataArray.UNITS_LABEL(), unit)
    return grid, {'wind': 'm/s', 'heat': '°C', 'load': 'N m^-2'}


def vtk_xml_case(mode):
    grid, units = labelled()
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetFileName(path('in.vtu'))
    getattr(writer, 'SetDataModeTo' + mode)()
    writer.EncodeAppendedDataOff()
    writer.Write()
    return differs('in.vtu', units)


def vtk_legacy_case(binary):
    grid, units = labelled()
    writer = vtk.vtkUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetFileName(path('in.vtk'))
    writer.SetFileType(1 + binary)
    writer.Write()
    return differs('in.vtk', units)


def written_case(extension):
    """A VTU with units, as another format and as VTU again: VTK finds the same in what comes back."""
    grid, units = labelled()
    save(vtk.vtkXMLUnstructuredGridWriter(), grid, 'in.vtu')
    must('convert', 'in.vtu', '-o', 'mid' + extension)
    must('convert', 'mid' + extension, '-o', 'back.vtu')
    return None if units_of('back.vtu') == units else units_of('back.vtu')


def units_of(name, reader=None):
    reader = reader or vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(path(name))
    reader.Update()
    grid, key, out = reader.GetOutput(), vtk.vtkDataArray.UNITS_LABEL(), {}
    for data in grid.GetPointData(), grid.GetCellData():
        for array in (data.GetArray(a) for a in range(data.GetNumberOfArrays())):
            if array.HasInformation() and array.GetInformation().Has(key):
                out[array.GetName()] = array.GetInformation().Get(key)
    return out


def vtk_reads_case(name, reader, kinds):
    """VTK's own reader of a format finds the units that we write."""
    grid, units = labelled()
    save(vtk.vtkXMLUnstructuredGridWriter(), grid, 'in.vtu')
    must('convert', 'in.vtu', '-o', name)
    wanted = {n: u for n, u in units.items() if n in kinds}
    return None if units_of(name, reader) == wanted else units_of(name, reader)


def extracted_case():
    grid, units = labelled()
    save(vtk.vtkXMLUnstructuredGridWriter(), grid, 'in.vtu')
    must('build', 'in.vtu', '-o', 'out.tetlod')
    must('extract', 'out.tetlod', '-o', 'level.vtk', '--level', '0')
    return None if units_of('level.vtk', vtk.vtkUnstructuredGridReader()) == units else units_of('level.vtk')


def stream_case():
    """A stream that is itself the input."""
    grid, units = labelled()
    save(vtk.vtkXMLUnstructuredGridWriter(), grid, 'in.vtu')
    must('build', 'in.vtu', '-o', 'in.tetlod')
    must('convert', 'in.tetlod', '-o', 'back.vtu')
    return differs('in.tetlod', units) if units_of('back.vtu') == units else units_of('back.vtu')


def foam_case():
    write_case(False, True, False)
    return differs('case/case.foam', {'p': 'm^2 s^-2', 'U': 'm^2 s^-2', 'T': 'K'})


def xdmf_case():
    """Of an attribute of the element, of an element in it, and none."""
    item = lambda size, kind, text: '<DataItem Dimensions="%s" NumberType="%s" Format="XML">%s</DataItem>' % (
        size, kind, text)
    attribute = lambda name, more, inside: '<Attribute Name="%s" Center="Node"%s>%s%s</Attribute>' % (
        name, more, inside, item(4, 'Float', '1 2 3 4'))
    write(
        'in.xdmf',
        '<Xdmf><Domain><Grid><Topology TopologyType="Tetrahedron" NumberOfElements="1">%s</Topology><Geometry '
        'GeometryType="XYZ">'
        '%s</Geometry>%s%s%s</Grid></Domain></Xdmf>' %
        (item('1 4', 'Int', '0 1 2 3'), item('4 3', 'Float', '0 0 0 1 0 0 0 1 0 0 0 1'),
         attribute('a', ' Units="Pa"', ''), attribute('b', '', '<Information Name="Unit" Value=" kg "/>'),
         attribute('c', '', '<Information Name="Note" Value="x"/>')))
    return differs('in.xdmf', {'a': 'Pa', 'b': 'kg'})


def cgns_case():
    """The base says kilograms and millimetres, the field which powers of them."""
    points, tets, fields, _ = tet_mesh(40)
    file = cgns_file.File(path('in.cgns'))
    file.zone('Zone', points, len(tets))
    file.section('Volume', 'tetra', tets)
    file.solution('S', cgns_file.VERTEX, {'heat': fields['heat'], 'mass': fields['mass']})
    file.do('cg_goto', file.fn, file.base, b'end')
    file.do('cg_units_write', 2, 4, 2, 2, 2)
    file.do('cg_goto', file.fn, file.base, b'Zone_t', 1, b'FlowSolution_t', 1, b'DataArray_t', 1, b'end')
    file.do('cg_exponents_write', cgns_file.TYPES['float32'], (ctypes.c_float * 5)(1, -1, -2, 0, 0))
    file.close()
    return differs('in.cgns', {'heat': 'kg mm^-1 s^-2'})


def main():
    if vtk is None:
        report('units', True, skip='python3-vtk9 is missing')
        return finish()
    built = [
        line.split()[0] for line in tetlod('formats').stdout.decode().splitlines() if line.split()[1:2] == ['read']
    ]
    for mode in 'Ascii', 'Binary', 'Appended':
        case('VTK XML, ' + mode, vtk_xml_case, mode)
    for binary in False, True:
        case('legacy VTK, binary %d' % binary, vtk_legacy_case, binary)
    for extension in '.vtu', '.vtk', '.vtkhdf', '.xdmf', '.e':
        if extension[1:] in built or extension == '.e' and 'exodus' in built:
            case('written to %s and back' % extension, written_case, extension)
    case('VTK reads those of legacy VTK', vtk_reads_case, 'out.vtk', vtk.vtkUnstructuredGridReader(),
         ('wind', 'heat', 'load'))
    case('VTK reads those of a surface', vtk_reads_case, 'out.vtp', vtk.vtkXMLPolyDataReader(), ('wind', 'heat'))
    case('extract writes them', extracted_case)
    case('a stream as input', stream_case)
    case('OpenFOAM', foam_case)
    shown = tetlod('info', 'out.tetlod').stdout.decode()
    report('info says them', 'field         T, 1 x ' in shown and ' 300 K' in shown, shown[:800])
    for name, function in (('xdmf', xdmf_case), ('cgns', cgns_case)):
        if name in built:
            case(name, function)
    return finish()


main()
