#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Steps in time over HTTP: meshes and surfaces of every band are the reference decoder's, groups and prefixes are the
stream's bytes."""
import os
import subprocess
import sys

import numpy
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLUnstructuredGridReader

from served import ROOT, SCRATCH, TETLOD, Server, run

sys.path.insert(0, os.path.join(ROOT, 'tests'))
from streams import tetlod as reference  # noqa: E402

NAMES = ('series_float32', 'series_float64', 'series_moving')
PATHS = [os.path.join(ROOT, 'tests', 'golden', name + '.tetlod') for name in NAMES]
TOPOLOGIES = os.path.join(ROOT, 'tests', 'golden', 'topologies.tetlod')
server = None


def read(data, reader):
    path = os.path.join(SCRATCH, 'answer.xml')
    with open(path, 'wb') as file:
        file.write(data)
    reader.SetFileName(path)
    reader.Update()
    return reader.GetOutput()


def arrays(data):
    points = data.GetPointData()
    return {points.GetArrayName(i): vtk_to_numpy(points.GetArray(i)) for i in range(points.GetNumberOfArrays())}


def get(path):
    status, head, body = server.get(path)
    assert status == 200, (path, status, body)
    return head, body


def opened(name, path):
    with open(path, 'rb') as file:
        data = file.read()
    stream = reference.open(data)
    return data, stream, stream.series(), '/v1/meshes/%s' % name


def test_meshes():
    for name, path in zip(NAMES, PATHS):
        _, stream, series, base = opened(name, path)
        cid = server.json(base)['cid']
        for band in range(len(series.bands)):
            for step in (0, len(series.times) - 1, len(series.times) // 2):
                cursor, values = series.seek(band, step)
                head, body = get('%s/%s/bands/%d/steps/%d/mesh.vtu' % (base, cid, band, step))
                answer = read(body, vtkXMLUnstructuredGridReader())
                found = arrays(answer)
                assert numpy.array_equal(vtk_to_numpy(answer.GetPoints().GetData()),
                                         series.points()), (name, band, step)
                assert list(found) == list(values) and float(head['tetlod-time']) == series.times[step], list(found)
                for field, wanted in values.items():
                    assert numpy.array_equal(found[field].reshape(len(wanted), -1),
                                             numpy.asarray(wanted).reshape(len(wanted), -1)), (name, band, step, field)


def test_choice():
    for name, path in zip(NAMES, PATHS):
        _, stream, series, base = opened(name, path)
        for band, known in enumerate(series.bands):
            for choice in ('step=1', 'time=%r' % series.times[1]):
                status, head, _ = server.get('%s/mesh?error=%r&%s' % (base, known['error'], choice))
                assert status == 303 and head['location'].endswith('/bands/%d/steps/1/mesh.vtu' % band), (status, head)
                assert (int(head['tetlod-level']) == known['level']
                        and float(head['tetlod-error'].split('=')[1]) <= known['error'] * (1 + 1e-9)), head
        units = max(known['range'][1] - known['range'][0] for known in series.fields) * series.bands[0]['error']
        assert '/bands/0/' in server.get('%s/mesh?abs_error=%r&step=0' % (base, units * 1.001))[1]['location']
        described = server.json(base)['series']
        assert (described['times'] == list(series.times)
                and [b['error'] for b in described['bands']] == [b['error'] for b in series.bands])


def test_surfaces():
    _, stream, series, base = opened(NAMES[0], PATHS[0])
    cid = server.json(base)['cid']
    cursor, values = series.seek(0, 2)
    fields = {field['name']: field['components'] for field in stream.fields}
    for name, known in values.items():
        component = '' if fields[name] == 1 else ':%d' % (fields[name] - 1)
        column = numpy.asarray(known).reshape(len(known), -1)[:, -1]
        value = (column.min() + column.max()) / 2
        _, body = get('%s/%s/bands/0/steps/2/isosurface.vtp?field=%s&value=%r' % (base, cid, name + component,
                                                                                  float(value)))
        surface = read(body, vtkXMLPolyDataReader())
        if column.min() < column.max():
            on = arrays(surface)[name].reshape(surface.GetNumberOfPoints(), -1)[:, -1]
            assert surface.GetNumberOfPoints() and numpy.abs(on - value).max() <= 1e-5 * (column.max() -
                                                                                          column.min()), name
    without = [field for field in fields if field not in values]
    for field in without:
        assert server.get('%s/%s/bands/0/steps/2/isosurface.vtp?field=%s&value=0' % (base, cid, field))[0] == 400
    _, body = get('%s/%s/bands/0/steps/2/surface.vtp' % (base, cid))
    assert list(arrays(read(body, vtkXMLPolyDataReader()))) == list(values)


def group_of(data, series, field, band, group):
    row = field * len(series.bands) + band
    sizes = [size for size, _ in series._entries[row]]
    at = series._sections[row]['offset'] + sum(sizes[:8 * group])
    return data[at:at + sum(sizes[8 * group:8 * group + 8])]


def front_of(data, stream, level):
    """Header and index, the geometry of the levels up to one, the table of steps."""
    table = next(section for section in stream.sections if section['tag'] == 'TIME')
    geometry = b''.join(data[frames[0][0]:frames[0][0] + frames[0][1]] for frames in stream.frames[:level + 1])
    return data[:stream.levels[0]['offset']] + geometry + data[table['offset']:table['offset'] + table['stored']]


def test_bytes():
    for name, path in zip(NAMES, PATHS):
        data, stream, series, base = opened(name, path)
        cid = server.json(base)['cid']
        names = [known['name'] for known in series.fields]
        for band, known in enumerate(series.bands):
            for group in range((len(series.times) + 7) // 8):
                for chosen in (range(len(names)), [len(names) - 1]):
                    wanted = b''.join(group_of(data, series, field, band, group) for field in chosen)
                    query = 'fields=' + ','.join(names[field] for field in chosen)
                    head, body = get('%s/%s/bands/%d/groups/%d?%s' % (base, cid, band, group, query))
                    assert body == wanted and 'immutable' in head['cache-control'], (name, band, group, query)
                    _, prefix = get('%s/prefix?error=%r&step=%d&%s' % (base, known['error'], group * 8, query))
                    assert prefix == front_of(data, stream, known['level']) + wanted, (name, band, group, query)
                if series.displacement:  # comes with any field
                    _, prefix = get('%s/prefix?error=%r&step=%d&fields=%s' % (base, known['error'], group * 8,
                                                                              names[0]))
                    assert prefix.endswith(b''.join(group_of(data, series, field, band,
                                                             group) for field in range(2))), (band, group)
                assert get('%s/%s/bands/%d/groups/%d' % (base, cid, band, group))[1] == b''.join(
                    group_of(data, series, field, band, group) for field in range(len(names)))


def same_mesh(body, path):
    """An answer and a file of `tetlod extract`: points, corners and the fields that have steps."""
    with open(path, 'rb') as file:
        wanted = read(file.read(), vtkXMLUnstructuredGridReader())
    points, cells, fields = vtk_to_numpy(wanted.GetPoints().GetData()), vtk_to_numpy(
        wanted.GetCells().GetConnectivityArray()), arrays(wanted)
    found = read(body, vtkXMLUnstructuredGridReader())
    assert numpy.array_equal(vtk_to_numpy(found.GetPoints().GetData()), points)
    assert numpy.array_equal(vtk_to_numpy(found.GetCells().GetConnectivityArray()), cells)
    found = arrays(found)
    assert found and all(numpy.array_equal(values, fields[name]) for name, values in found.items()), list(found)


def test_topologies():
    """Every step of every topology group is answered: as `tetlod extract` makes it, under the content id of the group's
    stream."""
    base = '/v1/meshes/topologies'
    groups = server.json(base)['topologies']
    assert ([group['steps'] for group in groups] == [2, 2, 1] and sum(
        (group['times'] for group in groups), []) == [0, .25, .5, .75, 1])
    for step, (number, own, time) in enumerate(((0, 0, .1), (0, 1, .3), (1, 0, .6), (1, 1, .8), (2, 0, 1.1))):
        described = server.json('%s?topology=%d' % (base, number))
        assert (described['cid'] == groups[number]['cid']
                and described['series']['times'] == groups[number]['times']), described
        assert described['links']['self'] == 'topologies' + ('?topology=%d' % number if number else '')
        for band, known in enumerate(described['series']['bands']):
            path = os.path.join(SCRATCH, 'extracted.vtu')
            subprocess.run([TETLOD, 'extract', TOPOLOGIES, '--step', str(step), '--error', repr(known['error']), '-o',
                            path], check=True, stderr=subprocess.DEVNULL)
            for query in ('step=%d' % step, 'time=%g' % time):
                status, head, _ = server.get('%s/mesh?error=%r&%s' % (base, known['error'], query))
                assert (status == 303 and head['location'].endswith('%s/bands/%d/steps/%d/mesh.vtu' %
                                                                    (groups[number]['cid'], band, own))), (query, head)
                assert ((head['tetlod-step'], head['tetlod-topology']) == (str(step), str(number))
                        and float(head['tetlod-time']) == groups[number]['times'][own]), head
            address = base + '/' + head['location']
            head, body = get(address)
            assert ((head['tetlod-step'], head['tetlod-topology']) == (str(step), str(number))
                    and 'step%d-' % step in head['content-disposition']), head
            same_mesh(body, path)
            assert server.get(address, **{'If-None-Match': head['etag']})[0] == 304
    for query in ('step=5', 'step=-1', 'step=1&time=0.5'):
        assert server.get('%s/mesh?error=1&%s' % (base, query))[0] == 400, query
    for time in (-.2, 1.2, 99):
        status, _, body = server.get('%s/mesh?error=1&time=%g' % (base, time))
        assert status == 422 and b'times go from 0 to 1; the nearest is' in body, (time, status, body)
    for query in ('topology=3', 'topology=x', 'topology=', 'topologies=1'):
        assert server.get('%s?%s' % (base, query))[0] == 400, query
    assert (server.get('/v1/meshes/series_float32?topology=0')[0] == 200
            and server.get('/v1/meshes/series_float32?topology=1')[0] == 400)


def test_streams_of_topologies():
    """A group's content id names its own stream: the bytes, and what is made of them, are those of that stream served
    alone."""
    base = '/v1/meshes/topologies'
    groups, etags = server.json(base)['topologies'], set()
    with open(TOPOLOGIES, 'rb') as file:
        whole = file.read()
    paths = []
    for number, group in enumerate(groups[1:], 1):
        _, body = get('%s/%s/stream' % (base, group['cid']))
        assert body == whole[group['offset']:group['offset'] +
                             group['bytes']] and reference.open(body).cid == group['cid']
        assert server.get('%s/%s/stream' % (base, group['cid']), Range='bytes=7-90')[2] == body[7:91]
        paths.append(os.path.join(SCRATCH, 'alone%d.tetlod' % number))
        with open(paths[-1], 'wb') as file:
            file.write(body)
    with Server(*paths) as alone:
        for number, group in enumerate(groups[1:], 1):
            finest = len(server.json('%s?topology=%d' % (base, number))['levels']) - 1
            for path in ('levels/0/mesh.vtu', 'levels/%d/mesh.tetlod' % finest, 'levels/%d/surface.vtp' % finest,
                         'records/0-%d' % finest,
                         'bands/0/steps/0/surface.vtp', 'bands/1/groups/0'):
                head, body = get('%s/%s/%s' % (base, group['cid'], path))
                assert body == alone.get('/v1/meshes/alone%d/%s/%s' % (number, group['cid'], path))[2], path
                etags.add((path, head['etag']))
            first = sum(known['steps'] for known in groups[:number])
            assert get('%s/prefix?error=1&step=%d' % (base, first))[1] == alone.get(
                '/v1/meshes/alone%d/prefix?error=1&step=0' % number)[2]
    assert len({etag for _, etag in etags}) == len(etags), etags
    assert server.get('%s/%s/bands/0/steps/0/mesh.vtu' % ('/v1/meshes/series_float32', groups[1]['cid']))[0] == 404


with Server(*PATHS, TOPOLOGIES) as server:
    run([test_meshes, test_choice, test_surfaces, test_bytes, test_topologies, test_streams_of_topologies])
