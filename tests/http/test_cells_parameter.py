#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Values of tetrahedra over HTTP: what `cells` asks for, and nothing else, in each format and at every level."""
import os
import subprocess
import sys
import urllib.parse

import numpy
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkIOLegacy import vtkUnstructuredGridReader
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader, vtkXMLUnstructuredGridWriter

from served import ROOT, SCRATCH, TETLOD, Server, run

sys.path.insert(0, os.path.join(ROOT, 'tests'))
from streams import tetlod  # noqa: E402

STREAM = os.path.join(ROOT, 'tests', 'golden', 'cells_float32.tetlod')
stream = tetlod.open(STREAM)
server = base = None


def read(data, kind):
    path = os.path.join(SCRATCH, 'mesh.' + kind)
    with open(path, 'wb') as file:
        file.write(data)
    reader = vtkXMLUnstructuredGridReader() if kind == 'vtu' else vtkUnstructuredGridReader()
    reader.SetFileName(path)
    if kind == 'vtk':
        reader.ReadAllFieldsOn()
    reader.Update()
    return reader.GetOutput()


def cells_of(data, kind):
    cell_data = read(data, kind).GetCellData()
    return {
        cell_data.GetArrayName(i): vtk_to_numpy(cell_data.GetArray(i)) for i in range(cell_data.GetNumberOfArrays())
    }


def get(path):
    status, _, body = server.get(path)
    assert status == 200, (path, status, body)
    return body


def test_levels():
    for level in range(len(stream.levels)):
        tets = stream.levels[level]['tets']
        for kind in ('vtu', 'vtk'):
            for query, names in (('', []), ('?cells=', []), ('?cells=material', ['material']),
                                 ('?cells=part,strain', ['strain', 'part']),
                                 ('?cells=all', ['strain', 'energy', 'material', 'part', 'element', 'time µs'])):
                found = cells_of(get('%s/levels/%d/mesh.%s%s' % (base, level, kind, query)), kind)
                assert list(found) == names, (level, query, list(found))
                for name in names:
                    assert numpy.array_equal(found[name], stream.cells(name)[:tets]), (level, kind, name)


def test_long_lists():
    """However long the list of names is, the redirection says where to; and '+' is a space in names that have one."""
    names = ','.join(['time µs'] * 100)
    for box in ('', '&box=0,0,0,1e6,1e+6,1e-6&box_error=0'):
        for spelled in (urllib.parse.quote(names), urllib.parse.quote_plus(names),
                        urllib.parse.quote_plus('material,' + names)):
            status, head, body = server.get('/v1/meshes/cells_float32/mesh?level=1&cells=' + spelled + box)
            assert status == 303, (status, body)
            assert '+' not in head['location'] and len(head['location']) > 1024, head
            status, _, body = server.get(urllib.parse.urljoin('/v1/meshes/cells_float32/mesh', head['location']))
            assert status == 200 and b'time \xc2\xb5s' in body and (b'material' in body) == ('material' in spelled)
    assert server.get(base + '/levels/1/mesh.vtu?cells=time+%C2%B5s')[2] == server.get(
        base + '/levels/1/mesh.vtu?cells=time%20%C2%B5s')[2]
    assert server.get(base + '/levels/1/mesh.vtu?cells=time%2B%C2%B5s')[0] == 400  # that is a plus


def build_larger():
    """A stream whose finest level fills half of the least cache: with values of cells that are floats, small and large
    integers."""
    made, given, built = (os.path.join(SCRATCH, name) for name in ('fin.vtu', 'cells.vtu', 'larger.tetlod'))
    subprocess.run([TETLOD, 'sample', 'fin', '--size', '14', '-o', made], check=True)
    reader, writer = vtkXMLUnstructuredGridReader(), vtkXMLUnstructuredGridWriter()
    reader.SetFileName(made)
    reader.Update()
    mesh = reader.GetOutput()
    numbers = numpy.arange(mesh.GetNumberOfCells())
    for name, values in (('part', (numbers % 7).astype(numpy.int32)), ('far', numbers * 10 ** 10),
                         ('pair', numpy.stack([numbers / 3, -numbers], 1).astype(numpy.float32)),
                         ('energy', numpy.sqrt(numbers))):
        array = numpy_to_vtk(values, deep=True)
        array.SetName(name)
        mesh.GetCellData().AddArray(array)
    writer.SetFileName(given)
    writer.SetInputData(mesh)
    writer.Write()
    subprocess.run([TETLOD, 'build', given, '-o', built, '--quiet'], check=True)
    return built


def test_larger_than_the_cache():
    """What is written while it is sent is the same file."""
    larger = build_larger()
    with Server(larger, '--cache', '1M') as small, Server(larger) as ample:
        shown = ample.json('/v1/meshes/larger')
        finest = '/v1/meshes/larger/%s/levels/%d/mesh.' % (shown['cid'], len(shown['levels']) - 1)
        for query in ('vtu?cells=far', 'vtk?cells=far,part', 'vtu?cells=all', 'vtk?cells=all', 'vtu'):
            (_, whole, expected), (status, head, body) = ample.get(finest + query), small.get(finest + query)
            assert (status == 200 and body == expected
                    and head['server-timing'] == 'cache;desc=none'), (query, status, head)
            assert (head['etag'] == whole['etag'] and head['content-length'] == str(len(body))
                    and 'desc=none' not in whole['server-timing'])
            status, _, part = small.get(finest + query, Range='bytes=300-%d' % (len(body) - 100))
            assert status == 206 and part == body[300:-99], query


def test_redirection():
    for query, tail in (('level=3&cells=material,part', '?cells=material%2Cpart'),
                        ('level=3&cells=time%20%C2%B5s', '?cells=time%20%C2%B5s'), ('level=3', '')):
        status, head, _ = server.get('/v1/meshes/cells_float32/mesh?' + query)
        assert status == 303 and head['location'] == stream.cid + '/levels/3/mesh.vtu' + tail, (status, head)
        get('/v1/meshes/cells_float32/' + head['location'])


def by_corners(data):
    """Values of the tetrahedra, by their corners' coordinates."""
    mesh = read(data, 'vtk')
    points, rows = vtk_to_numpy(mesh.GetPoints().GetData()), vtk_to_numpy(mesh.GetCells().GetData()).reshape(-1, 5)[:,
                                                                                                                    1:]
    cell_data = mesh.GetCellData()
    columns = {
        cell_data.GetArrayName(i): vtk_to_numpy(cell_data.GetArray(i)) for i in range(cell_data.GetNumberOfArrays())
    }
    return {points[row].tobytes(): {name: values[i].tolist() for name, values in columns.items()}
            for i, row in enumerate(rows)}


def test_in_boxes():
    """Tetrahedra of the coarse and of the fine level have the values that they have there."""
    last, middle = len(stream.levels) - 1, numpy.array(stream.bounds).mean(0)
    coarse, fine = (by_corners(get('%s/levels/%d/mesh.vtk?cells=all' % (base, level))) for level in (2, last))
    checked = []
    for low, high in ((middle - 9, middle + 9), (middle - 9, stream.bounds[0]), (middle + 8, middle + 9),
                      (middle, middle)):
        box = ','.join('%.9g' % x for x in (*low, *high))
        for corners, values in by_corners(
                get('%s/levels/2/region.vtk?box_level=%d&box=%s&cells=all' % (base, last, box))).items():
            part = values.pop('Region')
            checked.append(part)
            assert list(values) == ['strain', 'energy', 'material', 'part', 'element', 'time µs'], list(values)
            assert part == 2 or values == (coarse, fine)[part][corners], (part, values)
    assert {0, 1} <= set(checked), set(checked)


def test_refusals():
    for path in (base + '/levels/1/mesh.vtu?cells=nothing', base + '/levels/1/mesh.vtu?cells=material&cells=part',
                 base + '/levels/1/mesh.tetlod?cells=part',
                 '/v1/meshes/cells_float32/mesh?level=1&cells=nothing'):
        status, _, body = server.get(path)
        assert status == 400 and b'cells' in body, (path, status, body)


def test_tags_differ():
    tags = {server.get('%s/levels/2/mesh.vtu%s' % (base, query))[1]['etag'] for query in ('', '?cells=material',
                                                                                          '?cells=part', '?cells=all')}
    assert len(tags) == 4, tags


def test_description():
    info = server.json('/v1/meshes/cells_float32')
    assert [(f['name'], f['type'], f['region']) for f in info['cell_fields']] == [(f['name'], f['type'], f['region'])
                                                                                  for f in stream.cell_fields]


with Server(STREAM) as server:
    base = '/v1/meshes/cells_float32/' + stream.cid
    run([test_levels, test_larger_than_the_cache, test_redirection, test_in_boxes, test_long_lists, test_refusals,
         test_tags_differ, test_description])
