#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Values of tetrahedra over HTTP: what `cells` asks for, and nothing else, in each format and at every level."""
import os
import sys

import numpy
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOLegacy import vtkUnstructuredGridReader
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

from served import ROOT, SCRATCH, Server, run

sys.path.insert(0, os.path.join(ROOT, 'tests'))
from streams import tetlod  # noqa: E402

STREAM = os.path.join(ROOT, 'tests', 'golden', 'cells_float32.tetlod')
stream = tetlod.open(STREAM)
server = base = None


def cells_of(data, kind):
    path = os.path.join(SCRATCH, 'mesh.' + kind)
    with open(path, 'wb') as file:
        file.write(data)
    reader = vtkXMLUnstructuredGridReader() if kind == 'vtu' else vtkUnstructuredGridReader()
    reader.SetFileName(path)
    if kind == 'vtk':
        reader.ReadAllFieldsOn()
    reader.Update()
    cell_data = reader.GetOutput().GetCellData()
    return {cell_data.GetArrayName(i): vtk_to_numpy(cell_data.GetArray(i)) for i in range(cell_data.GetNumberOfArrays())}


def get(path):
    status, _, body = server.get(path)
    assert status == 200, (path, status, body)
    return body


def test_levels():
    for level in range(len(stream.levels)):
        tets = stream.levels[level]['tets']
        for kind in ('vtu', 'vtk'):
            for query, names in (('', []), ('?cells=', []), ('?cells=material', ['material']), ('?cells=part,strain', ['strain', 'part']),
                                 ('?cells=all', ['strain', 'energy', 'material', 'part', 'element', 'time µs'])):
                found = cells_of(get('%s/levels/%d/mesh.%s%s' % (base, level, kind, query)), kind)
                assert list(found) == names, (level, query, list(found))
                for name in names:
                    assert numpy.array_equal(found[name], stream.cells(name)[:tets]), (level, kind, name)


def test_redirection():
    for query, tail in (('level=3&cells=material,part', '?cells=material%2Cpart'), ('level=3&cells=time%20%C2%B5s', '?cells=time%20%C2%B5s'), ('level=3', '')):
        status, head, _ = server.get('/v1/meshes/cells_float32/mesh?' + query)
        assert status == 303 and head['location'] == stream.cid + '/levels/3/mesh.vtu' + tail, (status, head)
        get('/v1/meshes/cells_float32/' + head['location'])


def test_refusals():
    for path in (base + '/levels/1/mesh.vtu?cells=nothing', base + '/levels/1/mesh.vtu?cells=material&cells=part', base + '/levels/1/mesh.tetlod?cells=part',
                 '/v1/meshes/cells_float32/mesh?level=1&cells=nothing'):
        status, _, body = server.get(path)
        assert status == 400 and b'cells' in body, (path, status, body)


def test_tags_differ():
    tags = {server.get('%s/levels/2/mesh.vtu%s' % (base, query))[1]['etag'] for query in ('', '?cells=material', '?cells=part', '?cells=all')}
    assert len(tags) == 4, tags


def test_description():
    info = server.json('/v1/meshes/cells_float32')
    assert [(f['name'], f['type'], f['region']) for f in info['cell_fields']] == [(f['name'], f['type'], f['region']) for f in stream.cell_fields]


with Server(STREAM) as server:
    base = '/v1/meshes/cells_float32/' + stream.cid
    run([test_levels, test_redirection, test_refusals, test_tags_differ, test_description])
