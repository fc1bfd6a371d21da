#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A stream in a VTKHDF file (SPEC 3.10): h5py and VTK see a level, or the steps of a series; every command and client
of ours the stream, by as few ranges as of the bare one."""
import glob
import hashlib
import json
import os
import shutil
import struct
import sys

import numpy as np

from common import ROOT, SANITIZED, Host, case, fails, finish, must, path, report, tetlod, write

sys.path[:0] = [os.path.join(ROOT, 'tests', 'http'), os.path.join(ROOT, 'client-examples', 'python')]

if b'VTKHDF' not in tetlod('formats').stdout:
    report('streams in VTKHDF files', True, skip='this program is built without libhdf5')
    sys.exit(finish())

import h5py  # noqa: E402
import vtk  # noqa: E402
from vtk.util.numpy_support import vtk_to_numpy  # noqa: E402
# Python cannot load the library that the sanitizers have changed: the program is the one that they look at
os.environ['TETLOD_LIBRARY'] = glob.glob(os.path.join(ROOT, 'build', 'release', 'libtetlod.so.*'))[0]
import tetlod as client  # noqa: E402
from served import Server  # noqa: E402
from tetlod import reference  # noqa: E402


def bytes_of(name):
    with open(path(name), 'rb') as file:
        return file.read()


def make(name, *options):
    """NAME.tetlod, and the same in NAME.vtkhdf."""
    must('build', *options, '-o', name + '.tetlod', '--quiet')
    must('build', *options, '-o', name + '.vtkhdf', '--quiet', '--show', '2%')


def by_vtk(name):
    reader = vtk.vtkHDFReader()
    reader.SetFileName(path(name))
    reader.Update()
    grid = reader.GetOutput()
    data = grid.GetPointData()
    fields = {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}
    corners = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4)
    return vtk_to_numpy(grid.GetPoints().GetData()), corners, fields


def file_case():
    """The stream is one contiguous data set near the beginning; the bytes repeat."""
    with h5py.File(path('fin.vtkhdf')) as file:
        stream = file['tetlod/stream']
        at = stream.id.get_offset()
        kind = file['VTKHDF'].attrs.get_id('Type').get_type()
        assert kind.get_cset() == h5py.h5t.CSET_ASCII  # ParaView 5.11 refuses another
        assert stream.dtype == 'u1' and stream.chunks is None and stream.compression is None and 512 <= at < 4096, at
        assert stream[:].tobytes() == bytes_of('fin.tetlod')
    whole = bytes_of('fin.vtkhdf')
    assert whole[at:at + len(bytes_of('fin.tetlod'))] == bytes_of('fin.tetlod')
    must('convert', 'fin.tetlod', '--stream', '--show', '2%', '-o', 'again.vtkhdf')
    assert bytes_of('again.vtkhdf') == whole
    must('extract', 'fin.vtkhdf', '-o', 'out.tetlod', '--quiet')
    assert bytes_of('out.tetlod') == bytes_of('fin.tetlod')


def shown_case():
    """What VTK's reader shows is the level that extract gives; without --show, the finest of few tetrahedra."""
    wanted = client.read(path('fin.tetlod'), error='2%')
    points, tets, fields = by_vtk('fin.vtkhdf')
    assert np.array_equal(points, wanted.points) and np.array_equal(tets, wanted.tets)
    assert all(np.array_equal(fields[name], wanted.fields[name]) for name in wanted.fields)
    must('convert', 'fin.tetlod', '--stream', '-o', 'all.vtkhdf')
    assert len(by_vtk('all.vtkhdf')[1]) == client.open(path('fin.tetlod')).levels[-1].tets


def commands_case():
    """Every command gives of it what it gives of the bare stream."""
    for arguments in (('info', '--all'), ('info', '--json'), ('verify',), ('features', '--field', 'Pressure'),
                      ('ask', 'integral(Pressure)'), ('formats', '--fields')):
        command, *rest = arguments
        if command == 'formats':
            arguments = (command, *rest)
            bare, inside = (must(command, *rest, name) for name in ('fin.tetlod', 'fin.vtkhdf'))
        else:
            bare, inside = (must(command, name, *rest) for name in ('fin.tetlod', 'fin.vtkhdf'))
        assert inside.stdout.replace(b'fin.vtkhdf', b'fin.tetlod') == bare.stdout, (arguments, inside)
    for options in (('--error', '1%'), ('--error', '5%', '--box', '0,0,0,1,1,1', '--box-error', '1%')):
        must('extract', 'fin.tetlod', *options, '-o', 'bare.vtu')
        must('extract', 'fin.vtkhdf', *options, '-o', 'inside.vtu')
        assert bytes_of('bare.vtu') == bytes_of('inside.vtu'), options
    must('verify', 'fin.vtkhdf', '--against', 'fin.vtu')
    must('convert', 'fin.vtkhdf', '-o', 'finest.vtk')  # as an input it is the stream: the original
    must('convert', 'fin.tetlod', '-o', 'original.vtk')
    assert bytes_of('finest.vtk') == bytes_of('original.vtk')


def tree(folder):
    return {os.path.relpath(os.path.join(at, name), folder): open(os.path.join(at, name), 'rb').read()
            for at, _, names in os.walk(folder) for name in names}


def explode_case():
    for name in ('topologies.tetlod', 'topologies.vtkhdf'):
        os.makedirs(path('tree'), exist_ok=True)
        must('explode', name, '-o', 'tree')
        os.rename(path('tree'), path('tree-' + name))
    assert tree(path('tree-topologies.tetlod')) == tree(path('tree-topologies.vtkhdf'))


def server_case():
    """Served as the bare stream is: levels, steps of every topology group, the stream itself."""
    import urllib.request

    def get(url):
        with urllib.request.urlopen(url) as answer:
            return answer.read()

    answers = []
    for name in ('topologies.tetlod', 'topologies.vtkhdf'):
        with Server(path(name)) as server:
            mesh = server.url + 'v1/meshes/topologies'
            cid = json.loads(get(mesh))['cid']
            answers.append([get(mesh), get(mesh + '/mesh?error=0.05'), get('%s/%s/stream' % (mesh, cid))] +
                           [get('%s/mesh?step=%d&error=0.01' % (mesh, step)) for step in (0, 3, 4)])
    assert answers[0] == answers[1]


def folder_case():
    """A folder's VTKHDF files with a stream in them are served, others are passed without a word."""
    import urllib.request
    os.makedirs(path('folder'), exist_ok=True)
    for name, of in (('a.vtkhdf', 'fin.vtkhdf'), ('b.tetlod', 'fin.tetlod'), ('b.vtkhdf', 'bare.vtkhdf'),
                     ('c.vtkhdf', 'bare.vtkhdf')):
        shutil.copy(path(of), path(os.path.join('folder', name)))
    write('folder/short.vtkhdf', b'1')
    with Server(path('folder')) as server:
        with urllib.request.urlopen(server.url + 'v1/meshes') as answer:
            found = [mesh['id'] for mesh in json.load(answer)['meshes']]
        said = server.messages()
    assert found == ['a', 'b'] and 'not served' not in said, (found, said)


def steps_of(name):
    """Points, tetrahedra and values of each step, as the documentation of VTKHDF says where they are."""
    with h5py.File(path(name)) as file:
        root = file['VTKHDF']
        assert tuple(root.attrs['Version']) == (2, 0) and root['Steps'].attrs['NSteps'] == len(root['Steps/Values'])
        for step, time in enumerate(root['Steps/Values']):
            steps, at = root['Steps'], {}
            for key in ('PartOffsets', 'PointOffsets', 'CellOffsets', 'ConnectivityIdOffsets', 'NumberOfParts'):
                at[key] = int(np.ravel(steps[key])[step])
            part = at['PartOffsets']
            points, cells = int(root['NumberOfPoints'][part]), int(root['NumberOfCells'][part])
            assert at['NumberOfParts'] == 1 and root['NumberOfConnectivityIds'][part] == 4 * cells
            first = at['CellOffsets'] + part
            assert np.array_equal(root['Offsets'][first:first + cells + 1], 4 * np.arange(cells + 1))
            corners = root['Connectivity'][at['ConnectivityIdOffsets']:][:4 * cells].reshape(-1, 4)
            values = {field: root['PointData'][field][int(steps['PointDataOffsets'][field][step]):][:points]
                      for field in root['PointData']}
            yield time, root['Points'][at['PointOffsets']:][:points], corners, values


def series_case(name):
    """Each step's mesh is that of extract; our own reader takes it, too."""
    stream = client.open(path(name + '.vtkhdf'))
    shown = list(steps_of(name + '.vtkhdf'))
    assert len(shown) == len(stream.times) > 2
    with h5py.File(path(name + '.vtkhdf')) as file, h5py.File(path('bare.vtkhdf'), 'w') as bare:
        file.copy('VTKHDF', bare)
    for step, (time, points, corners, values) in enumerate(shown):
        wanted = stream.at(time, error='2%')
        assert time == stream.times[step] and np.array_equal(points, wanted.points), step
        assert np.array_equal(corners, wanted.tets) and values.keys() == wanted.fields.keys()
        assert all(np.array_equal(values[field], wanted.fields[field]) for field in values)
        if step in (0, len(shown) // 2, len(shown) - 1):
            must('convert', 'bare.vtkhdf', '--time', str(step), '-o', 'step.vtk')
            must('build', 'step.vtk', '-o', 'step.tetlod', '--quiet', '--keep-order', '--max-error', '0')
            read = client.read(path('step.tetlod'))
            assert sorted(map(tuple, read.points)) == sorted(map(tuple, points))
            assert all(np.array_equal(np.sort(read.fields[field], axis=None), np.sort(values[field], axis=None))
                       for field in values), step
    if name != 'topologies':  # VTK 9.1 knows no steps: it shows all parts, here the first step
        assert len(by_vtk(name + '.vtkhdf')[1]) == len(shown[0][2])


def read_within(url, decoder):
    """Something that a reader gives of a stream on a host, to be compared."""
    if decoder == 'ask':
        return must('ask', url, 'mean(Pressure)', '--within', '10%').stdout.replace(url.encode(), b'')
    if decoder == 'reference':
        stream = reference.open(url)
        points = stream.cursor()
        points.seek(stream.level_for_error(0.05))
        return hashlib.sha256(points.positions.tobytes()).digest()
    return hashlib.sha256(client.read(url, error='1%', decoder=decoder).points.tobytes()).digest()


def ranges_case(decoder):
    """1 % over HTTP: the same mesh, at most one request and 4 KiB more than of the bare stream."""
    found = []
    for name in ('large.tetlod', 'large.vtkhdf'):
        with Host() as host:
            result = read_within(host.url + name, decoder)
        found.append((result, [size for _, size in host.asked]))
    (bare, few), (inside, more) = found
    assert bare == inside, found
    assert len(more) <= len(few) + 1 and sum(more) <= sum(few) + (4096 if decoder != 'ask' else 65536), (few, more)


def sealed(pointer):
    return pointer[:60] + hashlib.sha256(pointer[:60]).digest()[:4]


def damaged_cases():
    whole = bytes_of('fin.vtkhdf')
    offset, size = struct.unpack('<QQ', whole[8:24])

    def pointer(at, length, rest=bytes(36)):
        return sealed(whole[:8] + struct.pack('<QQ', at, length) + rest) + whole[64:]

    for name, data, words in (
            ('check', whole[:9] + b'\xff' + whole[10:], ['pointer', 'checksum']),
            ('reserved', pointer(offset, size, bytes(35) + b'\1'), ['pointer', 'damaged']),
            ('offset in itself', pointer(63, size), ['pointer', 'damaged']),
            ('size of nothing', pointer(offset, 63), ['pointer', 'damaged']),
            ('beyond 2^63', pointer(offset, 2**63 - 1), ['pointer', 'damaged']),
            ('offset behind the end', pointer(len(whole) + 9, size), ['less than']),
            ('offset of something else', pointer(offset + 1, size), ['not a tetlod stream']),
            ('to itself', pointer(64, size)[:64] + pointer(64, size), ['not a tetlod stream']),
            ('size too large', pointer(offset, size + 1), ['follow the end']),
            ('size too small', pointer(offset, size - 1), ['says'])):
        write('damaged.tetlod', data)
        fails('pointer: ' + name, 3, ['damaged.tetlod', *words], 'info', 'damaged.tetlod')

        def python(data=data):
            for read in (lambda: client.open(data, decoder='python'), lambda: reference.open(data),
                         lambda: client.open(data, decoder='library')):
                try:
                    read()
                except ValueError:
                    continue
                return 'it is taken'
            return None

        case('pointer: %s, in Python' % name, python)


def cut_case():
    """A file that is cut off behind the stream is whole; one that is cut off in it has the levels that it holds."""
    whole = bytes_of('fin.vtkhdf')
    offset, size = struct.unpack('<QQ', whole[8:24])
    write('cut.vtkhdf', whole[:offset + size])
    must('verify', 'cut.vtkhdf')
    for data, name in ((bytes_of('fin.tetlod'), 'half.tetlod'), (whole, 'half.vtkhdf')):
        write(name, data[:size // 2 + (offset if name.endswith('f') else 0)])
        must('extract', name, '-o', name + '.vtu')
    assert bytes_of('half.tetlod.vtu') == bytes_of('half.vtkhdf.vtu')
    fails('a stream that is cut off is not put into a file', 3, ['cut off'], 'convert', 'half.tetlod', '--stream', '-o',
          'no.vtkhdf')


def main():
    must('sample', 'fin', '--size', '14', '-o', 'fin.vtu')
    make('fin', 'fin.vtu', '--field', 'Pressure', '--summary')
    must('sample', 'fin', '--size', '20' if SANITIZED else '26', '-o', 'large.vtu')
    make('large', 'large.vtu', '--field', 'Pressure', '--no-region')
    must('sample', 'wake', '--size', '6', '--steps', '9', '-o', 'wake.pvd')
    make('wake', 'wake.pvd', '--field', 'Pressure')
    for name in ('series_moving', 'topologies'):
        shutil.copy(os.path.join(ROOT, 'tests', 'golden', name + '.tetlod'), path(name + '.tetlod'))
        must('convert', name + '.tetlod', '--stream', '--show', '2%', '-o', name + '.vtkhdf')
    must('convert', 'fin.vtu', '-o', 'bare.vtkhdf')
    for test in (file_case, shown_case, commands_case, explode_case, server_case, cut_case, folder_case):
        case(test.__doc__ or test.__name__, test)
    for name in ('wake', 'series_moving', 'topologies'):
        case('steps of %s' % name, series_case, name)
    for decoder in ('library', 'python', 'reference', 'ask'):
        case('ranges: ' + decoder, ranges_case, decoder)
    damaged_cases()
    fails('--show without such a file', 2, ['--show', 'vtkhdf'], 'build', 'fin.vtu', '--show', '1%', '-o', 'x.tetlod')
    fails('--stream into another format', 2, ['--stream', 'vtkhdf'], 'convert', 'fin.tetlod', '--stream', '-o', 'x.vtu')
    fails('--show alone', 2, ['--show', '--stream'], 'convert', 'fin.tetlod', '--show', '1%', '-o', 'x.vtkhdf')
    fails('of a mesh', 3, ['is a mesh'], 'convert', 'fin.vtu', '--stream', '-o', 'x.vtkhdf')
    return finish()


if __name__ == '__main__':
    sys.exit(main())
