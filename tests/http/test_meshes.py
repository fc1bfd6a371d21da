# SPDX-License-Identifier: BSD-3-Clause
"""Streams over HTTP: the catalogue, the mesh of an error, levels, records, stored bytes, surfaces; VTK reads what is
sent."""
import concurrent.futures
import contextlib
import itertools
import json
import math
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.parse
import zlib

import numpy
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkDataArray
from vtkmodules.vtkFiltersCore import vtkContourFilter, vtkMassProperties, vtkTriangleFilter
from vtkmodules.vtkIOGeometry import vtkGLTFReader, vtkSTLReader
from vtkmodules.vtkIOLegacy import vtkUnstructuredGridReader
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLUnstructuredGridReader, vtkXMLUnstructuredGridWriter

from served import PATIENCE, ROOT, SCRATCH, SLOW, TETLOD, Server, eventually, open_files, run
from tap import SANITIZED

FOLDER = os.path.join(SCRATCH, 'streams')
FIN = os.path.join(FOLDER, 'fin.tetlod')
FIELDS = {'fin': 'Pressure', 'cube': 'xyz'}
server = info = base = None


def tetlod(*arguments):
    return subprocess.run([TETLOD, *map(str, arguments)], check=True, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE).stdout


def make_stream(name, path, size):
    mesh = os.path.join(SCRATCH, os.path.basename(path) + '.vtu')
    tetlod('sample', name, '--size', size, '-o', mesh)
    tetlod('build', mesh, '--field', FIELDS[name], '-o', path, '--quiet')


def save(name, data):
    path = os.path.join(SCRATCH, name)
    with open(path, 'wb') as file:
        file.write(data)
    return path


def read(reader, data, name):
    reader.SetFileName(save(name, data))
    reader.Update()
    return reader.GetOutput()


def arrays(grid):
    point_data = grid.GetPointData()
    named = {
        point_data.GetArrayName(i): vtk_to_numpy(point_data.GetArray(i)) for i in range(point_data.GetNumberOfArrays())
    }
    return vtk_to_numpy(grid.GetPoints().GetData()), vtk_to_numpy(grid.GetCells().GetConnectivityArray()), named


def same(a, b):
    (points, cells, fields), (other_points, other_cells, other_fields) = arrays(a), arrays(b)
    assert points.dtype == other_points.dtype and (points == other_points).all()
    assert (cells == other_cells).all()
    assert fields.keys() == other_fields.keys()
    for name in fields:
        assert fields[name].dtype == other_fields[name].dtype and (fields[name] == other_fields[name]).all(), name


def problem(path, status, **headers):
    got, head, body = server.get(path, **headers)
    assert got == status and head['content-type'] == 'application/problem+json', (path, got, body)
    value = json.loads(body)
    assert (value['status'] == status and value['detail']
            and urllib.parse.urljoin(path, value['instance']).rstrip('?') == path.rstrip('?')), value
    return value


def level_of(query):
    status, head, _ = server.get('/v1/meshes/fin/mesh?' + query)
    assert status == 303, (query, status, _)
    found = re.match(r'(.*)/levels/(\d+)/mesh\.(\w+)$', urllib.parse.urljoin('/v1/meshes/fin/mesh', head['location']))
    assert found and found[1] == base, head
    level = info['levels'][int(found[2])]
    assert int(head['tetlod-level']) == level['level'] and int(head['tetlod-tets']) == level['tets']
    return level['level'], found[3]


def error_of(level, field, measure):
    return info['levels'][level]['errors'][field].get(measure)


def test_catalogue():
    meshes = server.json('/v1/meshes')['meshes']
    assert [m['id'] for m in meshes] == ['fin', 'two words']
    assert (meshes[0]['cid'] == info['cid'] and meshes[0]['tets'] == info['tets']
            and meshes[0]['levels'] == len(info['levels']))
    for mesh in meshes:
        assert server.json(urllib.parse.urljoin('/v1/meshes', mesh['links']['self']))['id'] == mesh['id']


def test_pages_of_the_catalogue():
    whole = server.json('/v1/meshes')
    assert whole['count'] == 2 and 'next' not in whole and not whole['meshes'][0]['series']
    seen, path = [], '/v1/meshes?limit=1'
    while path:
        page = server.json(path)
        assert page['count'] == 2 and len(page['meshes']) == 1
        seen += page['meshes']
        path = page.get('next') and urllib.parse.urljoin('/v1/meshes', page['next'])
    assert seen == whole['meshes']
    assert server.json('/v1/meshes?after=fin')['meshes'] == whole['meshes'][1:]
    assert server.json('/v1/meshes?after=zzz')['meshes'] == []
    for query in ('limit=-1', 'limit=x', 'limit=10001', 'limit=1&limit=2', 'after=%00', 'page=2'):
        assert server.get('/v1/meshes?' + query)[0] == 400, query


def test_description():
    shown = json.loads(tetlod('info', '--json', FIN))
    for key in shown:
        if key != 'levels':
            assert info[key] == shown[key], key
    for ours, theirs in zip(info['levels'], shown['levels']):
        assert {k: v for k, v in ours.items() if k != 'offset'} == {k: v for k, v in theirs.items() if k != 'offset'}
    end = info['levels'][0]['bytes']
    for level in info['levels'][1:]:
        assert level['offset'] == end
        end = level['bytes']
    assert urllib.parse.urljoin('/v1/meshes/fin', info['links']['stream']) == base + '/stream'


def test_level_for_error():
    last = len(info['levels']) - 1
    for measure in ('max', 'sampled', 'rms'):
        for error in (1e9, 1, 0.2, 0.05, 0.01, 0.001, 0):
            level, form = level_of('error=%r&measure=%s' % (error, measure))
            assert form == 'vtu'
            assert error_of(level, 'Pressure', measure) <= error
            assert level == 0 or error_of(level - 1, 'Pressure', measure) > error
    assert level_of('error=0')[0] <= last
    assert level_of('error=1%25') == level_of('error=0.01') == level_of('error=1e-2')
    assert level_of('error=0.01&format=vtk')[1] == 'vtk'
    low, high = next(f['range'] for f in info['fields'] if f['name'] == 'Pressure')
    assert level_of('abs_error=%r' % (0.1 * (high - low))) == level_of('error=0.1')
    assert level_of('abs_error=%r&field=Pressure' % (0.1 * (high - low))) == level_of('error=0.1&field=Pressure')


def test_fields_that_are_not_controlled():
    """Every answer about a level says how far off the fields may be that nothing holds down."""
    others = [f['name'] for f in info['fields'] if not f['controlled']]
    assert others
    for k in (0, len(info['levels']) - 1):
        _, head, _ = server.get('/v1/meshes/fin/mesh?level=%d' % k)
        fields, sampled = re.fullmatch(r'fields=(\d+), sampled=(\S+)', head['tetlod-uncontrolled']).groups()
        assert int(fields) == len(others)
        assert float(sampled) == float('%.9g' % max(error_of(k, name, 'sampled') for name in others))


def test_level_for_budget():
    assert level_of('level=3')[0] == 3
    for tets in (0, 300, 700, 10 ** 9):
        level = level_of('tets=%d' % tets)[0]
        assert level == 0 or info['levels'][level]['tets'] <= tets
        assert level + 1 == len(info['levels']) or info['levels'][level + 1]['tets'] > tets
    level = level_of('bytes=4K')[0]
    assert level == 0 or info['levels'][level]['bytes'] <= 4096


def test_bad_questions():
    mesh = '/v1/meshes/fin/mesh'
    assert 'error' in problem(mesh, 400)['parameters']
    for value in ('nan', 'inf', '-1', '', 'x', '1e999', '0x1', '1%20', '%', '1%25%25'):
        problem(mesh + '?error=' + value, 400)
    problem(mesh + '?error=1&tets=2', 400)
    problem(mesh + '?error=1&error=1', 400)
    assert 'error' in problem(mesh + '?eror=1', 400)['parameters']
    assert 'error=1%25' in problem(mesh + '?error=1%', 400)['detail']  # what everybody writes at first
    assert 'once' in problem(mesh + '?error=1&error=2', 400)['detail']
    assert 'Pressure' in problem(mesh + '?error=1&field=pressure', 400)['fields']
    assert 'sampled' in problem(mesh + '?error=1&measure=best', 400)['measures']
    assert 'tetlod' in problem(mesh + '?error=1&format=obj', 400)['formats']
    for level in ('-1', 'x', '99999', '4294967296', '1.0', ''):
        problem(mesh + '?level=' + level, 400)
    problem('/v1/meshes/nothing/mesh?error=1', 404)
    assert problem('/v1/meshes/nothing', 404)['meshes'] == ['fin', 'two words']
    assert problem('/v1/meshes/fin/%s/stream' % ('0' * 32), 404)['cid'] == [info['cid']]
    problem(base + '/levels/99999/mesh.vtu', 400)
    problem(base + '/levels/0/mesh.obj', 400)
    problem(base + '/levels/0/mesh.vtu?x=1', 400)
    problem(base + '/records/3-3', 400)
    problem(base + '/records/4-3', 400)
    problem(base + '/records/0-99999', 400)


def test_every_level_is_the_cursors():
    for level in range(0, len(info['levels']), 1 if SLOW == 1 else 9):
        status, head, body = server.get('%s/levels/%d/mesh.vtu' % (base, level))
        assert status == 200 and int(head['tetlod-level']) == level, body
        assert 'immutable' in head['cache-control'] and head['etag'] and 'make;dur=' in head['server-timing']
        path = os.path.join(SCRATCH, 'extracted.vtu')
        tetlod('extract', FIN, '--level', level, '-o', path, '--quiet')
        with open(path, 'rb') as file:
            extracted = read(vtkXMLUnstructuredGridReader(), file.read(), 'e.vtu')
        ours = read(vtkXMLUnstructuredGridReader(), body, 'o.vtu')
        assert ours.GetNumberOfCells() == info['levels'][level]['tets'] == int(head['tetlod-tets'])
        assert ours.GetNumberOfPoints() == info['levels'][level]['vertices'] == int(head['tetlod-vertices'])
        same(ours, extracted)


def test_formats_agree():
    vtu = read(vtkXMLUnstructuredGridReader(), server.get(base + '/levels/9/mesh.vtu')[2], 'a.vtu')
    vtk = read(vtkUnstructuredGridReader(), server.get(base + '/levels/9/mesh.vtk')[2], 'a.vtk')
    assert vtk.GetNumberOfCells() == vtu.GetNumberOfCells()
    assert (arrays(vtu)[0] == arrays(vtk)[0]).all() and (arrays(vtu)[1] == arrays(vtk)[1]).all()
    prefix = save('prefix.tetlod', server.get(base + '/levels/9/mesh.tetlod')[2])
    out = os.path.join(SCRATCH, 'from-prefix.vtu')
    tetlod('extract', prefix, '--level', 9, '-o', out, '--quiet')
    with open(out, 'rb') as file:
        same(vtu, read(vtkXMLUnstructuredGridReader(), file.read(), 'b.vtu'))


def test_redirection_is_followed():
    out = os.path.join(SCRATCH, 'curl.vtu')
    done = subprocess.run(['curl', '-sSfL', server.url + 'v1/meshes/fin/mesh?error=0.01&measure=sampled', '-o', out],
                          check=False)
    if done.returncode == 127:
        return 'no curl'
    assert done.returncode == 0
    with open(out, 'rb') as file:
        assert read(vtkXMLUnstructuredGridReader(), file.read(), 'c.vtu').GetNumberOfCells() > 0


def test_coded_meshes():
    plain = server.get(base + '/levels/5/mesh.vtu')
    coded = server.get(base + '/levels/5/mesh.vtu', Accept_Encoding='gzip')
    assert coded[1]['content-encoding'] == 'gzip' and zlib.decompress(coded[2], 31) == plain[2]
    assert coded[1]['etag'] != plain[1]['etag'] and 'Accept-Encoding' in coded[1]['vary']
    zstd = server.get(base + '/levels/5/mesh.vtu', Accept_Encoding='zstd')
    assert zstd[1]['content-encoding'] == 'zstd' and zstd[2][:4] == b'\x28\xb5\x2f\xfd'
    assert 'content-encoding' not in server.get(base + '/stream', Accept_Encoding='gzip, zstd')[1]
    described = server.get('/v1/meshes/fin', Accept_Encoding='gzip')
    assert json.loads(zlib.decompress(described[2], 31)) == info


def test_stored_bytes():
    with open(FIN, 'rb') as file:
        stream = file.read()
    status, head, body = server.get(base + '/stream')
    assert status == 200 and body == stream and head['content-type'] == 'application/vnd.tetlod'
    assert (head['accept-ranges'] == 'bytes' and 'immutable' in head['cache-control']
            and 'no-transform' in head['cache-control'])
    # stored bytes have no other coding: from the cache or the file, caches keep one of them for all clients
    assert not any('vary' in server.get(base + '/stream', **more)[1] for more in ({}, {'Range': 'bytes=0-9'},
                                                                                  {'If_None_Match': head['etag']}))
    last = len(info['levels']) - 1
    for first, second in ((0, 1), (0, last), (3, 7), (last - 1, last)):
        status, head, body = server.get('%s/records/%d-%d' % (base, first, second))
        assert status == 200 and body == stream[info['levels'][first]['bytes']:info['levels'][second]['bytes']]
    for level in (0, 4, last):
        assert server.get('%s/levels/%d/mesh.tetlod' % (base, level))[2] == stream[:info['levels'][level]['bytes']]


def test_records_of_some_fields():
    def records(query, first=2, last=3):
        status, _, body = server.get('%s/records/%d-%d%s' % (base, first, last, query))
        assert status == 200, body
        return body

    whole, geometry = records(''), records('?fields=')
    assert 0 < len(geometry) < len(whole)
    names = [field['name'] for field in info['fields']]
    each = [records('?fields=' + name) for name in names]
    assert all(one.startswith(geometry) for one in each)
    assert geometry + b''.join(one[len(geometry):] for one in each) == whole
    assert records('?fields=' + ','.join(reversed(names))) == whole
    assert records('?fields=Pressure', 2, 4) == records('?fields=Pressure') + records('?fields=Pressure', 3, 4)
    assert 'Pressure' in problem(base + '/records/0-1?fields=Pressure,x', 400)['fields']
    problem(base + '/records/0-1?fields=,', 400)


def test_prefix():
    """What mesh?format=tetlod redirects to, at once; some fields' frames alone where that is asked."""
    whole = server.get(base + '/stream')[2]
    for query in ('error=0.01&measure=sampled', 'level=0', 'tets=500', 'bytes=9000',
                  'abs_error=0.1&field=Pressure&measure=rms'):
        level, _ = level_of(query + '&format=tetlod')
        status, head, body = server.get('/v1/meshes/fin/prefix?' + query)
        assert status == 200 and body == whole[:info['levels'][level]['bytes']], (query, status)
        assert int(head['tetlod-level']) == level and head['cache-control'] == 'no-cache', head
        assert head['etag'] == server.get('%s/levels/%d/mesh.tetlod' % (base, level))[1]['etag']
        assert server.get('/v1/meshes/fin/prefix?' + query, If_None_Match=head['etag'])[0] == 304
    start = info['levels'][0]['offset']
    geometry = server.get('/v1/meshes/fin/prefix?level=3&fields=')[2]
    assert geometry.startswith(whole[:start])
    assert geometry.endswith(server.get(base +
                                        '/records/2-3?fields=')[2]) and len(geometry) < info['levels'][3]['bytes']
    names = ','.join(field['name'] for field in info['fields'])
    assert server.get('/v1/meshes/fin/prefix?level=3&fields=' + names)[2] == whole[:info['levels'][3]['bytes']]
    problem('/v1/meshes/fin/prefix', 400)
    problem('/v1/meshes/fin/prefix?level=0&format=vtu', 400)
    problem('/v1/meshes/fin/prefix?level=0&fields=x', 400)
    problem('/v1/meshes/nothing/prefix?level=0', 404)


def test_ranges():
    path = base + '/stream'
    _, head, whole = server.get(path)
    size, etag = len(whole), head['etag']
    for asked, first, end in (('0-99', 0, 100), ('100-', 100, size), ('-7', size - 7, size), ('0-0', 0, 1),
                              ('5-%d' % (10 * size), 5, size), ('-%d' % (10 * size), 0, size)):
        status, head, body = server.get(path, Range='bytes=' + asked)
        assert status == 206 and body == whole[first:end], asked
        assert head['content-range'] == 'bytes %d-%d/%d' % (first, end - 1, size)
        assert int(head['content-length']) == end - first and head['etag'] == etag
    for asked in ('%d-' % size, '-0', '%d-%d' % (size, size + 5)):
        status, head, body = server.get(path, Range='bytes=' + asked)
        assert status == 416 and head['content-range'] == 'bytes */%d' % size, asked
        assert head['content-type'] == 'application/problem+json'
    for asked in ('bytes=5-1', 'bytes=0-1,5-6', 'items=0-1', 'bytes', 'bytes=a-b', ''):
        status, _, body = server.get(path, Range=asked)
        assert status == 200 and body == whole, asked
    assert server.get(path, Range='bytes=0-9', If_Range=etag)[0] == 206
    for other in ('"x"', 'W/' + etag, 'Sat, 01 Jan 2000 00:00:00 GMT'):
        assert server.get(path, Range='bytes=0-9', If_Range=other)[0] == 200
    status, head, body = server.get(path, 'HEAD', Range='bytes=0-9')
    assert status == 200 and int(head['content-length']) == size and body == b''
    assert server.get(path, Range='bytes=0-9', If_None_Match=etag)[0] == 304
    assert server.get(base + '/levels/9/mesh.vtu', Range='bytes=0-4')[2] == b'<?xml'
    assert server.get(base + '/levels/9/mesh.vtu', Range='bytes=0-4', Accept_Encoding='gzip')[0] == 200


def test_not_modified():
    for path in ('/v1/meshes/fin', base + '/stream', base + '/records/0-4', base + '/levels/2/mesh.vtu',
                 base + '/levels/2/mesh.tetlod'):
        _, head, body = server.get(path)
        status, again, nothing = server.get(path, If_None_Match=head['etag'])
        assert status == 304 and nothing == b'' and again['etag'] == head['etag'], path
        assert again.get('content-length', str(len(body))) == str(len(body))
        assert server.get(path, If_None_Match='"x"')[0] == 200


def test_not_modified_without_making():
    """Tags follow from the address: a fresh server (after a restart, or another one behind a proxy) makes nothing for a
    304."""
    paths = [
        base + path for path in ('/levels/2/mesh.vtu', '/levels/2/mesh.vtk', '/levels/2/surface.stl', '/records/0-4',
                                 '/records/0-4?fields=Pressure', '/levels/2/isosurface.vtp?field=Pressure&value=2',
                                 '/levels/2/slice.glb?origin=0,0,1&normal=0,0,1')
    ]
    tags = {(path, coding): server.get(path, Accept_Encoding=coding)[1] for path in paths
            for coding in ('identity', 'gzip', 'zstd')}
    assert len({head['etag'] for (path, _), head in tags.items() if 'levels' in path}) == 15
    with Server(FOLDER) as fresh:
        for (path, coding), head in tags.items():
            for method in ('GET', 'HEAD'):
                status, again, nothing = fresh.get(path, method, Accept_Encoding=coding, If_None_Match=head['etag'])
                assert status == 304 and nothing == b'', (path, status)
                for name in ('etag', 'cache-control', 'vary'):
                    assert again.get(name) == head.get(name), (path, name)
                assert again.get('content-length', head['content-length']) == head['content-length'], (path, again)
        received = fresh.raw(b'GET %s HTTP/1.1\r\nHost: localhost\r\nIf-None-Match: *\r\n\r\n' % paths[0].encode())
        # no last chunk, and it ended
        assert received.endswith(b'\r\n\r\n') and received.count(b'\r\n\r\n') == 1, received
        assert fresh.get(base + '/levels/9/mesh.tetlod')[0] == fresh.get(base + '/records/3-9')[0] == fresh.get(
            base + '/stream')[0] == 200
        assert metric('tetlod_levels_made_total', fresh) == 0 and metric('tetlod_streams_decoded_total', fresh) == 0


def test_request_ids():
    """Each answer has its own, whether it comes from the cache or is made for several at once."""
    path = base + '/levels/3/mesh.vtu'
    with concurrent.futures.ThreadPoolExecutor(8) as pool:
        ids = [head['x-request-id'] for _, head, _ in pool.map(lambda _: server.get(path), range(40))]
    assert len(set(ids)) == 40, ids
    assert server.get(path, X_Request_Id='mine')[1]['x-request-id'] == 'mine'
    assert server.get(path, If_None_Match='*', X_Request_Id='unchanged')[1]['x-request-id'] == 'unchanged'


def test_id_with_a_space():
    described = server.json('/v1/meshes/two%20words')
    assert described['id'] == 'two words' and described['links']['self'] == 'two%20words'
    status, head, _ = server.get('/v1/meshes/two%20words/mesh?level=0')
    assert status == 303 and server.get(urllib.parse.urljoin('/v1/meshes/two%20words/mesh', head['location']))[0] == 200


def test_names_with_plus():
    """In a query '+' is itself, or a space where no field has that name."""
    given, folder = os.path.join(SCRATCH, 'plus.vtu'), os.path.join(SCRATCH, 'plus')
    os.makedirs(folder, exist_ok=True)
    with open(os.path.join(SCRATCH, 'fin.tetlod.vtu'), 'rb') as file:
        text = file.read()
    assert b'"Pressure"' in text and b'"Velocity"' in text
    with open(given, 'wb') as file:
        file.write(text.replace(b'"Pressure"', b'"a+b c"').replace(b'"Velocity"', b'"a b c"'))
    subprocess.run([TETLOD, 'build', given, '--field', 'a+b c', '-o', os.path.join(folder, 'p.tetlod'), '--quiet'],
                   check=True)
    with Server(folder, '--access-log') as plus:
        cid = plus.json('/v1/meshes/p')['cid']
        iso = '/v1/meshes/p/%s/levels/0/isosurface.vtp?value=2&field=' % cid
        for name, scalar in (('a+b%20c', True), ('a%2Bb+c', True), ('a%2bb%20c', True), ('a%2Bb%2Bc', False),
                             ('a%20b%20c:0', True), ('a+b+c:0', True),
                             ('a+b+c', False), ('a%20b%2Bc', False)):
            assert plus.get(iso + name)[0] == (200 if scalar else 400), name
        for path, status in (('prefix?level=1&fields=', 200), ('mesh?error=0.1&field=', 303)):
            for name in ('a+b%20c', 'a%2Bb+c'):
                assert plus.get('/v1/meshes/p/' + path + name)[0] == status, (path, name)
        both = [
            plus.get('/v1/meshes/p/%s/records/0-1?fields=%s' % (cid, names))
            for names in ('a%2Bb%20c,a%20b%20c', 'a%2Bb+c,a+b+c', 'a+b+c,a+b%20c')
        ]
        assert both[0][0] == 200 and both[0][2] == both[1][2] == both[2][2]
        client = "import tetlod; print(tetlod.read('http://%s:%d/v1/meshes/p', error='5%%', field='a+b c').error <= 0.05)" % plus.address
        done = subprocess.run([sys.executable, '-c', client],
                              env=dict(os.environ,
                                       PYTHONPATH=os.path.join(ROOT, 'client-examples',
                                                               'python')), stdout=subprocess.PIPE)
        assert done.stdout == b'True\n' and 'field=a%2Bb%20c' in plus.messages(), done


def area(triangles):
    properties = vtkMassProperties()
    properties.SetInputData(triangles)
    return properties.GetSurfaceArea()


def test_isosurface():
    level = base + '/levels/%d/' % (len(info['levels']) - 1)
    grid = read(vtkXMLUnstructuredGridReader(), server.get(level + 'mesh.vtu')[2], 'full.vtu')
    grid.GetPointData().SetActiveScalars('Pressure')
    contour = vtkContourFilter()
    contour.SetInputData(grid)
    contour.SetValue(0, 2.5)
    contour.Update()
    status, head, body = server.get(level + 'isosurface.vtp?field=Pressure&value=2.5')
    assert status == 200 and 'immutable' in head['cache-control']
    ours = read(vtkXMLPolyDataReader(), body, 'iso.vtp')
    assert ours.GetNumberOfCells() > 10
    assert abs(area(ours) - area(contour.GetOutput())) < 1e-5 * area(ours)
    pressure = vtk_to_numpy(ours.GetPointData().GetArray('Pressure'))
    assert abs(pressure - 2.5).max() < 1e-6
    assert ours.GetPointData().GetArray('Velocity').GetNumberOfComponents() == 3
    stl = read(vtkSTLReader(), server.get(level + 'isosurface.stl?field=Pressure&value=25e-1')[2], 'iso.stl')
    assert stl.GetNumberOfCells() == ours.GetNumberOfCells()
    component = server.get(level + 'isosurface.vtp?field=Velocity:0&value=1')
    assert component[0] == 200
    speed = vtk_to_numpy(read(vtkXMLPolyDataReader(), component[2], 'v.vtp').GetPointData().GetArray('Velocity'))
    assert abs(speed[:, 0] - 1).max() < 1e-6
    empty = read(vtkXMLPolyDataReader(), server.get(level + 'isosurface.vtp?field=Pressure&value=1e6')[2], 'empty.vtp')
    assert empty.GetNumberOfCells() == 0
    for query in ('', 'field=Pressure', 'value=1', 'field=Velocity&value=1', 'field=Velocity:3&value=1',
                  'field=x&value=1',
                  'field=Pressure&value=nan', 'field=Pressure&value=1&x=1'):
        problem(level + 'isosurface.vtp?' + query, 400)
    problem(level + 'isosurface.obj?field=Pressure&value=1', 400)


def test_slice_and_surface():
    level = base + '/levels/%d/' % (len(info['levels']) - 1)
    body = server.get(level + 'slice.vtp?origin=0,0,2.0625&normal=0,0,1')[2]
    ours = read(vtkXMLPolyDataReader(), body, 'slice.vtp')
    assert ours.GetNumberOfCells() > 10
    assert abs(vtk_to_numpy(ours.GetPoints().GetData())[:, 2] - 2.0625).max() < 1e-12
    boundary = read(vtkXMLPolyDataReader(), server.get(level + 'surface.vtp')[2], 'surface.vtp')
    low, high = numpy.array(info['bounds'])
    points = vtk_to_numpy(boundary.GetPoints().GetData())
    assert numpy.allclose(points.min(0), low) and numpy.allclose(points.max(0), high)
    glb = server.get(level + 'slice.glb?origin=0,0,2&normal=0,0,1')
    assert glb[0] == 200 and glb[1]['content-type'] == 'model/gltf-binary'
    reader = vtkGLTFReader()
    reader.SetFileName(save('slice.glb', glb[2]))
    reader.Update()
    assert reader.GetOutput().GetNumberOfPoints() > 10
    assert glb_scene(glb[2])[0]['asset']['version'] == '2.0'
    for query in ('', 'origin=0,0,0', 'origin=0,0,0&normal=0,0,0', 'origin=0,0&normal=0,0,1',
                  'origin=0,0,0&normal=0,0,nan'):
        problem(level + 'slice.vtp?' + query, 400)


def glb_scene(body):
    size = int.from_bytes(body[12:16], 'little')
    return json.loads(body[20:20 + size]), body[28 + size:]


def glb_array(body, accessor):
    scene, binary = glb_scene(body)
    view = scene['bufferViews'][scene['accessors'][accessor]['bufferView']]
    return numpy.frombuffer(binary, '<f4', view['byteLength'] // 4, view['byteOffset'])


def make_labelled(folder):
    """A stream of fin's level 2, whose pressure has a unit and is there twice more, under names that glTF's letters do
    not tell apart."""
    grid = read(vtkXMLUnstructuredGridReader(), server.get(base + '/levels/2/mesh.vtu')[2], 'level.vtu')
    fields = grid.GetPointData()
    for name in 'p 1', 'p.1':
        twin = fields.GetArray('Pressure').NewInstance()
        twin.DeepCopy(fields.GetArray('Pressure'))
        twin.SetName(name)
        fields.AddArray(twin)
    fields.GetArray('Pressure').GetInformation().Set(vtkDataArray.UNITS_LABEL(), 'N/m² <&>')
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetFileName(os.path.join(SCRATCH, 'labelled.vtu'))
    writer.Write()
    os.makedirs(folder)
    tetlod('build', writer.GetFileName(), '-o', os.path.join(folder, 'labelled.tetlod'), '--field', 'Pressure',
           '--quiet')


def test_surface_files():
    """A level's surface is the file that extract writes of it; VTP says units, glTF keeps fields of like names apart.
    """
    folder = os.path.join(SCRATCH, 'labelled')
    make_labelled(folder)
    with Server(folder) as labelled:
        shown = labelled.json('/v1/meshes/labelled')
        level = '/v1/meshes/labelled/%s/levels/%d/' % (shown['cid'], len(shown['levels']) // 2)
        for form in 'vtp', 'stl', 'glb':
            written = os.path.join(SCRATCH, 'written.' + form)
            tetlod('extract', os.path.join(folder, 'labelled.tetlod'), '--level',
                   len(shown['levels']) // 2, '-o', written)
            with open(written, 'rb') as file:
                assert labelled.get(level + 'surface.' + form)[2] == file.read(), form
        query = '?field=Pressure&value=%r' % (sum(shown['fields'][0]['range']) / 2)
        surface = read(vtkXMLPolyDataReader(), labelled.get(level + 'isosurface.vtp' + query)[2],
                       'labelled.vtp').GetPointData()
        assert surface.GetArray('Pressure').GetInformation().Get(vtkDataArray.UNITS_LABEL()) == 'N/m² <&>'
        assert (not surface.GetArray('p 1').HasInformation()
                or not surface.GetArray('p 1').GetInformation().Has(vtkDataArray.UNITS_LABEL()))
        body = labelled.get(level + 'isosurface.glb' + query)[2]
        mesh = glb_scene(body)[0]['meshes'][0]
        attributes, names = mesh['primitives'][0]['attributes'], mesh['extras']['fields']
        assert (sorted(names.values()) == sorted(field['name'] for field in shown['fields'])
                and set(names) < set(attributes)), mesh
        for attribute, name in names.items():
            assert (glb_array(body, attributes[attribute]) == vtk_to_numpy(surface.GetArray(name)).ravel()).all(), name
        empty, binary = glb_scene(labelled.get(level + 'isosurface.glb?field=Pressure&value=1e30')[2])
        assert 'meshes' not in empty and 'buffers' not in empty and not binary, empty


def metric(name, of=None):
    found = re.search(r'^%s (\S+)$' % name, (of or server).get('/metrics')[2].decode(), re.M)
    return float(found[1])


def test_one_computation():
    """However many ask at once, a level is made once and all get the same."""
    with Server(FOLDER, '--threads', '2') as fresh:
        path = base + '/levels/%d/mesh.vtu' % (len(info['levels']) - 1)
        with concurrent.futures.ThreadPoolExecutor(32) as pool:
            answers = list(pool.map(lambda _: fresh.get(path), range(64)))
        assert {a[0] for a in answers} == {200} and len({a[2] for a in answers}) == 1
        assert metric('tetlod_levels_made_total', fresh) == 1
        eventually(lambda: metric('tetlod_streams_decoded_total', fresh) == 1)
        assert metric('tetlod_cache_hits_total', fresh) >= 63


def test_small_cache():
    """What is read is never dropped, what is not read makes room; what can never fit is refused, its stored bytes are
    not."""
    big = os.path.join(SCRATCH, 'big')
    os.makedirs(big, exist_ok=True)
    make_stream('cube', os.path.join(big, 'cube.tetlod'), 12)
    with Server(big, '--cache', '1M', '--memory', '1M') as small:
        described = small.json('/v1/meshes/cube')
        at = '/v1/meshes/cube/%s/levels/' % described['cid']
        fits = [level['level'] for level in described['levels'] if level['tets'] < 2000]
        for level in fits:
            status, _, body = small.get(at + '%d/mesh.vtu' % level)
            assert status == 200, (level, body)
            assert metric('tetlod_cache_bytes', small) <= 1 << 20
        last = len(described['levels']) - 1
        status, _, body = small.get(at + '%d/mesh.vtu' % last)
        assert status == 422 and b'tetlod build --paged' in body, (status, body)
        assert small.get(at + '%d/mesh.tetlod' % last)[0] == 200


def test_memory_of_regions():
    """A region that is small beside its stream needs little more memory than the stream. Several that are made at once
    and need all of it take turns."""
    stream = os.path.join(SCRATCH, 'roomy.tetlod')
    make_stream('fin', stream, 24)  # 39,000 tetrahedra
    with Server(stream, '--cache', '1M', '--memory', '10M', '--threads', '4') as small:
        shown = small.json('/v1/meshes/roomy')
        at = '/v1/meshes/roomy/%s/levels/0/region.vtu?box_level=%d&box=' % (shown['cid'], len(shown['levels']) - 1)
        assert small.get(at + '-4,1,1,-3.9,1.1,1.1')[0] == 200
        with concurrent.futures.ThreadPoolExecutor(12) as pool:
            at_once = range(4 if SANITIZED else 12)
            answers = list(pool.map(lambda i: small.get(at + '-3,0,0,0,2,%.3f' % (2 + i / 1000)), at_once))
        assert {a[0] for a in answers} == {200}, [a[2] for a in answers if a[0] != 200]
    with Server(stream, '--cache', '1M', '--memory', '6M') as small:
        status, _, body = small.get(at + '-9,-9,-9,9,9,9')
        assert status == 422 and b'needs' in body, (status, body)


def test_slow_readers():
    """Who reads slowly holds room, until the deadline of the answer; who needs the room waits for it and gets an
    answer."""
    stream, path = os.path.join(SCRATCH, 'held.tetlod'), os.path.join(SCRATCH, 'held.sock')
    make_stream('fin', stream, 16)  # its mesh is more than the buffers of a Unix socket hold
    with Server(stream, '--cache', '8M', '--memory', '64M', '--timeout', '2', '--quiet', '--listen',
                'unix:' + path) as small, contextlib.ExitStack() as stack:
        shown = small.json('/v1/meshes/held')
        at, last = '/v1/meshes/held/%s/' % shown['cid'], len(shown['levels']) - 1
        cached = at + 'levels/0/mesh.vtu'
        small.get(cached)
        held = []
        for level in range(last, last - 12, -1):
            slow = stack.enter_context(socket.socket(socket.AF_UNIX))
            slow.settimeout(PATIENCE)
            slow.connect(path)
            slow.sendall(b'GET %slevels/%d/mesh.vtk HTTP/1.1\r\nHost: localhost\r\n\r\n' % (at.encode(), level))
            held.append(slow)
        for level in range(last, last - 12, -1):  # some of it is held, some waits
            assert small.get(cached)[0] == 200
            status, _, body = small.get(at + 'levels/%d/surface.vtp' % level)
            assert status == 200, (status, body[:300])
        with open(stream, 'rb') as file:
            whole = file.read()
        assert small.get(at + 'stream')[2] == whole
        first, end = shown['levels'][0]['bytes'], shown['levels'][last]['bytes']
        assert small.get(at + 'records/0-%d' % last)[2] == whole[first:end]
        for slow in held:  # all lost their connection
            with contextlib.suppress(ConnectionResetError):
                while slow.recv(1 << 20):
                    pass


def test_memory_is_bounded():
    """Many streams in little memory: those that nobody uses leave, whoever asks gets an answer, and each once more the
    same."""
    folder = os.path.join(SCRATCH, 'many')
    os.makedirs(folder, exist_ok=True)
    streams = range(1 if SANITIZED else 0, 12, 2 if SANITIZED else 1)
    for i in streams:
        path = os.path.join(folder, 'm%d.tetlod' % i)
        shutil.copy(FIN, path) if i == 0 else make_stream('cube', path, 4 + i)
    with Server(folder, '--memory', '3M', '--cache', '1M') as small, Server(folder) as ample:
        for _ in range(2):
            for i in streams:
                shown = ample.json('/v1/meshes/m%d' % i)
                last = len(shown['levels']) - 1
                for level in (0, last // 2, last):
                    path = '/v1/meshes/m%d/%s/levels/%d/mesh.vtu' % (i, shown['cid'], level)
                    status, _, body = small.get(path)
                    assert status == 200 and body == ample.get(path)[2], (path, status, body[:300])
                    assert metric('tetlod_stream_memory_bytes', small) <= 3 << 20
        eventually(lambda: metric('tetlod_streams_decoded_total', small) > metric('tetlod_streams_decoded_total',
                                                                                  ample))  # some had to leave


def test_a_level_needs_its_stage():
    with Server(FIN) as fresh:
        coarse = [level for level in info['levels'] if 2 *
                  level['tets'] <= info['levels'][-1]['tets']][-1]['level']  # of half the tetrahedra
        fresh.get(base + '/levels/%d/mesh.vtu' % coarse)
        part = metric('tetlod_stream_memory_bytes', fresh)
        fresh.get(base + '/levels/%d/mesh.vtu' % (len(info['levels']) - 1))
        assert 0 < part < 0.7 * metric('tetlod_stream_memory_bytes', fresh)
        fresh.get(base + '/levels/0/mesh.vtk')  # from what is there
        eventually(lambda: metric('tetlod_streams_decoded_total', fresh) == 2)


def test_replaced_stream():
    folder = os.path.join(SCRATCH, 'changing')
    os.makedirs(folder, exist_ok=True)
    path, new = os.path.join(folder, 'm.tetlod'), os.path.join(SCRATCH, 'new.tetlod')
    shutil.copy(FIN, path)
    make_stream('cube', new, 3)
    with Server(folder, '--scan', '0.2', '--keep-replaced', '1000') as changing:
        old = changing.json('/v1/meshes/m')['cid']
        with changing.connect() as reader:  # somebody who reads slowly while it is replaced
            reader.sendall(
                b'GET /v1/meshes/m/%s/stream HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n' % old.encode())
            os.replace(new, path)
            eventually(lambda: changing.json('/v1/meshes/m')['cid'] != old)
            assert changing.get('/v1/meshes/m/%s/records/0-1' % old)[0] == 200
            received = b''
            while some := reader.recv(65536):
                received += some
            with open(FIN, 'rb') as file:
                whole = file.read()
            assert received.endswith(whole)
        shutil.copy(FIN, os.path.join(folder, 'another.tetlod'))
        eventually(lambda: changing.get('/v1/meshes/another')[0] == 200)
        os.remove(path)
        eventually(lambda: changing.get('/v1/meshes/m')[0] == 404)
        with open(os.path.join(folder, 'another.tetlod'), 'r+b') as file:  # written over in place: never mixed answers
            file.truncate(100)
        status, _, body = changing.get('/v1/meshes/another/%s/stream' % old)
        assert status in (404, 503) or body == whole  # it may have been read before
        status, _, body = changing.get('/v1/meshes/another/%s/stream' % old, Range='bytes=0-9')
        assert status in (404, 503) or body == whole[:10]
        eventually(lambda: changing.get('/v1/meshes/another')[0] == 404)


def test_forgotten_stream():
    """A replaced stream that nobody asks for any more is gone, and its memory is given back."""
    folder = os.path.join(SCRATCH, 'forgetting')
    os.makedirs(folder, exist_ok=True)
    path, new = os.path.join(folder, 'm.tetlod'), os.path.join(SCRATCH, 'newer.tetlod')
    shutil.copy(FIN, path)
    make_stream('cube', new, 3)
    with Server(folder, '--scan', '0.1', '--keep-replaced', '0.5') as forgetting:
        assert forgetting.get('/v1/meshes/m/%s/levels/0/mesh.vtk' % info['cid'])[0] == 200
        assert metric('tetlod_stream_memory_bytes', forgetting) > 0
        os.replace(new, path)
        eventually(lambda: metric('tetlod_stream_memory_bytes', forgetting) == 0)
        assert forgetting.get('/v1/meshes/m/%s/records/0-1' % info['cid'])[0] == 404


def test_reload_signal():
    folder = os.path.join(SCRATCH, 'signalled')
    os.makedirs(folder, exist_ok=True)
    with Server(folder, '--scan', '1000') as waiting:
        shutil.copy(FIN, os.path.join(folder, 'late.tetlod'))
        assert waiting.get('/v1/meshes/late')[0] == 404
        waiting.process.send_signal(signal.SIGHUP)
        eventually(lambda: waiting.get('/v1/meshes/late')[0] == 200)


def read_answer(connection):
    """The length of the body that was announced, and of what came until the end."""
    received = b''
    while some := connection.recv(65536):
        received += some
    head, _, body = received.partition(b'\r\n\r\n')
    assert head.startswith(b'HTTP/1.1 200'), head
    return int(re.search(rb'\r\nContent-Length: (\d+)', head)[1]), len(body)


def shuts_out(server):
    try:
        return not server.raw(b'GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n')
    except OSError:
        return True


def test_stop_during_answers():
    """Whoever has asked gets the whole answer, whether it is being sent or still being made; nobody else gets in."""
    stream, path = os.path.join(SCRATCH, 'larger.tetlod'), os.path.join(SCRATCH, 'stop.sock')
    make_stream('fin', stream, 16)  # its mesh is more than the buffers of a Unix socket hold
    with Server(stream, '--drain', '1000', '--timeout', '1000', '--quiet', '--listen',
                'unix:' + path) as ending, socket.socket(socket.AF_UNIX) as slow, ending.connect() as patient:
        shown = ending.json('/v1/meshes/larger')
        request = b'GET /v1/meshes/larger/%s/levels/%d/mesh.%%s HTTP/1.1\r\nHost: localhost\r\n\r\n' % (
            shown['cid'].encode(), len(shown['levels']) - 1)
        slow.settimeout(PATIENCE)
        slow.connect(path)
        slow.sendall(request % b'vtk')
        assert slow.recv(12, socket.MSG_PEEK) == b'HTTP/1.1 200'
        being_made = metric('tetlod_cache_misses_total', ending)
        patient.sendall(request % b'vtu')
        eventually(lambda: metric('tetlod_cache_misses_total', ending) > being_made)
        ending.process.send_signal(signal.SIGTERM)
        announced, got = read_answer(patient)
        assert got == announced
        assert ending.process.poll() is None  # for the slow one
        eventually(lambda: shuts_out(ending))  # the answer may have been there before the signal was
        announced, got = read_answer(slow)
        assert got == announced > 300000
        ending.stop()  # it would wait longer than our patience for anybody else


def ask_at_once(busy, paths):
    """The status of each, by number; a refused one says when to come again."""
    found = {200: [], 503: []}
    with contextlib.ExitStack() as stack:
        asking = [stack.enter_context(busy.connect()) for _ in paths]
        for connection, path in zip(asking, paths):
            connection.sendall(b'GET %s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n' % path.encode())
        for connection, path in zip(asking, paths):
            connection.settimeout(PATIENCE)
            received = b''
            while some := connection.recv(65536):
                received += some
            found[int(received[9:12])].append(path)
            assert (received[9:12] == b'200'
                    or b'\r\nRetry-After: 1\r\n' in received and b'application/problem+json' in received), received
    return found


def test_overload():
    """More to be made than can wait is refused for now, and answered later; nothing is lost."""
    stream = os.path.join(SCRATCH, 'larger.tetlod')  # of the test before
    with Server(stream, '--threads', '1', '--quiet', '--jobs', '1000') as busy:
        shown = busy.json('/v1/meshes/larger')
        base_path = '/v1/meshes/larger/%s/levels/' % shown['cid']
        slices = base_path + '%d/slice.vtp?normal=0,0,1&origin=%%d,0,%%d' % (len(shown['levels']) - 1)
        busy.get(base_path + '0/mesh.vtu')
        end = time.monotonic() + PATIENCE
        for attempt in itertools.count():  # where we ask more slowly than it makes, none is refused
            found = ask_at_once(busy, [slices % (attempt, number) for number in range(600)])
            if found[503] or time.monotonic() > end:
                break
        assert found[503] and len(found[200]) >= 256, {status: len(paths) for status, paths in found.items()}
        assert all(busy.get(path)[0] == 200 for path in found[503][:20])


def test_writes_nothing():
    """No file is open for writing, but what it was given for its messages; streams are open for reading."""
    process, streams = server.process.pid, 0
    for fd, path in open_files(process):
        if path.startswith('/') and fd > 2:
            with open('/proc/%d/fdinfo/%d' % (process, fd)) as about:
                assert int(re.search(r'flags:\s*([0-7]+)', about.read())[1], 8) & 3 == os.O_RDONLY, path
            streams += path.endswith('.tetlod')
    assert streams == 2


def test_server_timing():
    path = base + '/levels/5/mesh.vtk'
    pattern = r'cache;desc=(hit|miss), extract;dur=[\d.]+, make;dur=[\d.]+'
    with Server(FOLDER) as fresh:
        found = [re.fullmatch(pattern, fresh.get(path)[1]['server-timing'])[1] for _ in range(3)]
    assert found == ['miss', 'hit', 'hit']


def test_what_is_no_stream():
    folder = os.path.join(SCRATCH, 'mixed')
    os.makedirs(os.path.join(folder, 'folder.tetlod'), exist_ok=True)
    save(os.path.join('mixed', 'text.tetlod'), b'hello')
    save(os.path.join('mixed', 'empty.tetlod'), b'')
    os.mkfifo(os.path.join(folder, 'pipe.tetlod'))
    with open(FIN, 'rb') as file:
        save(os.path.join('mixed', 'cut.tetlod'), file.read()[:-10])
    shutil.copy(FIN, os.path.join(folder, 'good.tetlod'))
    with Server(folder) as mixed:
        assert [m['id'] for m in mixed.json('/v1/meshes')['meshes']] == ['good']
        assert 'text.tetlod: not served' in mixed.messages()
    for path in (os.path.join(folder, 'text.tetlod'), os.path.join(folder, 'missing.tetlod')):
        done = subprocess.run([TETLOD, 'serve', path, '--listen', '127.0.0.1:0'], stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE)
        assert (done.returncode in (1, 3) and done.stdout == b'' and done.stderr.count(b'\n') == 1
                and path.encode() in done.stderr), done
    busy = subprocess.run([TETLOD, 'serve', FOLDER, '--listen', '%s:%d' % server.address], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE)
    assert busy.returncode == 1 and b'in use' in busy.stderr, busy
    wrong = subprocess.run([TETLOD, 'serve', FOLDER, '--listen', 'nonsense'], stdout=subprocess.PIPE,
                           stderr=subprocess.PIPE)
    assert wrong.returncode == 2, wrong


def test_damaged_stream():
    """An index that is right over bytes that are not: the file is named and not served; all else goes on. The good file
    is taken up."""
    folder = os.path.join(SCRATCH, 'damaged')
    os.makedirs(folder, exist_ok=True)
    with open(FIN, 'rb') as file:
        stream = bytearray(file.read())
    stream[-5] ^= 0xff
    save(os.path.join('damaged', 'bad.tetlod'), bytes(stream))
    shutil.copy(FIN, os.path.join(folder, 'good.tetlod'))
    with Server(folder, '--scan', '0.1') as damaged:
        assert [m['id'] for m in damaged.json('/v1/meshes')['meshes']] == ['good']
        assert re.search(r'bad.tetlod: not served: bytes \d+ to %d do not match' % len(stream),
                         damaged.messages()), damaged.messages()
        for path in ('stream', 'levels/0/mesh.vtu'):
            assert damaged.get('/v1/meshes/bad/%s/%s' % (info['cid'], path))[0] == 404
        assert damaged.get('/v1/meshes/good/%s/levels/0/mesh.vtu' % info['cid'])[0] == 200
        shutil.copy(FIN, os.path.join(SCRATCH, 'whole.new'))
        os.replace(os.path.join(SCRATCH, 'whole.new'), os.path.join(folder, 'bad.tetlod'))
        eventually(lambda: damaged.get('/v1/meshes/bad')[0] == 200)


def test_levels_while_decoding():
    """All levels asked for at once of a stream that nobody has asked for before, by more clients than threads, are the
    same as one by one later; what a level is mapped from is decoded once."""
    paths = ['%s/levels/%d/mesh.vtk' % (base, level) for level in range(len(info['levels']))]
    with Server(FOLDER, '--threads', '3') as fresh:
        with concurrent.futures.ThreadPoolExecutor(12) as clients:
            found = list(clients.map(fresh.get, paths[::-1]))[::-1]
        eventually(lambda: 1 <= metric('tetlod_streams_decoded_total', fresh))
        assert metric('tetlod_streams_decoded_total', fresh) <= 1 + math.log2(info['tets'])
    for path, (status, _, body) in zip(paths, found):
        assert status == 200 and body == server.get(path)[2], (path, status)


def test_names_of_downloads():
    """What a browser saves has a name that says what it is."""
    name = 'Fl\u00fcgel 5%"x'
    shutil.copy(FIN, os.path.join(FOLDER, name + '.tetlod'))
    quoted = urllib.parse.quote(name)
    eventually(lambda: server.get('/v1/meshes/' + quoted)[0] == 200)
    for place, plain, whole in (('fin', 'fin', 'fin'), (quoted, 'Fl__gel 5__x', urllib.parse.quote(name, safe=''))):
        at = '/v1/meshes/%s/%s/' % (place, info['cid'])
        for path, rest in (('levels/2/mesh.vtu', '-2.vtu'), ('levels/2/mesh.tetlod', '-2.tetlod'),
                           ('stream', '.tetlod'), ('levels/1/surface.stl', '-1-surface.stl'),
                           ('levels/0/slice.vtp?origin=0,1,1&normal=1,0,0', '-0-slice.vtp')):
            head = server.get(at + path)[1]
            assert head['content-disposition'] == 'attachment; filename="%s%s"; filename*=UTF-8\'\'%s%s' % (
                plain, rest, whole, rest), head
    os.unlink(os.path.join(FOLDER, name + '.tetlod'))
    eventually(lambda: server.get('/v1/meshes/' + quoted)[0] == 404)


os.makedirs(FOLDER, exist_ok=True)
make_stream('fin', FIN, 8)
make_stream('cube', os.path.join(FOLDER, 'two words.tetlod'), 2)
with Server(FOLDER) as server:
    info = server.json('/v1/meshes/fin')
    base = '/v1/meshes/fin/' + info['cid']
    run([
        test_catalogue, test_pages_of_the_catalogue, test_names_of_downloads, test_description, test_level_for_error,
        test_fields_that_are_not_controlled, test_level_for_budget, test_bad_questions, test_every_level_is_the_cursors,
        test_levels_while_decoding, test_formats_agree, test_redirection_is_followed, test_coded_meshes,
        test_stored_bytes, test_records_of_some_fields, test_prefix, test_ranges, test_not_modified,
        test_not_modified_without_making, test_request_ids, test_id_with_a_space, test_names_with_plus, test_isosurface,
        test_slice_and_surface, test_surface_files, test_one_computation, test_small_cache, test_memory_of_regions,
        test_slow_readers, test_memory_is_bounded, test_a_level_needs_its_stage, test_replaced_stream,
        test_forgotten_stream, test_reload_signal, test_stop_during_answers, test_overload, test_writes_nothing,
        test_server_timing, test_what_is_no_stream, test_damaged_stream
    ])
