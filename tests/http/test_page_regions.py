#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Regions of streams in pages: what extract gives, with a certified transition, in the memory that their pages need.
Whole levels that do not fit into memory: decoded into a temporary file."""
import contextlib
import json
import os
import re
import subprocess

from served import SCRATCH, TETLOD, Server, run

BOX = '0.5,0.5,0.5,2,2,2'


def tetlod(*arguments):
    return subprocess.run([TETLOD, *map(str, arguments)], cwd=SCRATCH, check=True, capture_output=True).stdout


def content(name):
    with open(os.path.join(SCRATCH, name), 'rb') as file:
        return file.read()


def certified(stream, level):
    names = [field['name'] for field in stream['fields'] if field['controlled']]
    return max(stream['levels'][level]['errors'][name]['max'] for name in names)


def test_as_extract():
    """The server's file is that of the command line; its address names the level outside, the last before pages."""
    stream = json.loads(tetlod('info', '--json', 'cube.tetlod'))
    root = stream['first_paged_level'] - 1
    fine = certified(stream, root + 3)
    for parameters, options in (('&box_error=%r' % fine, ('--box-error', repr(fine))), ('', ())):
        status, head, _ = SERVER.get('/v1/meshes/cube/mesh?level=1&format=vtk&box=' + BOX + parameters)
        assert status == 303 and '/levels/%d/region' % root in head['location'], head
        status, head, body = SERVER.get('/v1/meshes/cube/' + head['location'])
        assert status == 200
        tetlod('extract', 'cube.tetlod', '--level', '1', '--box', BOX, *options, '-o', 'region.vtk')
        assert body == content('region.vtk')
        kind, error = head['tetlod-transition-error'].split('=')
        assert (kind == 'max'
                and certified(stream, int(head['tetlod-box-level'])) < float(error) <= certified(stream, root))
        assert int(head['tetlod-transition-tets']) > 0 and int(head['tetlod-level']) == root


def test_lower_level():
    """An address with a coarser level than pages can have gives the same."""
    cid = SERVER.json('/v1/meshes/cube')['cid']
    stream = json.loads(tetlod('info', '--json', 'cube.tetlod'))
    root = stream['first_paged_level'] - 1
    answers = [SERVER.get('/v1/meshes/cube/%s/levels/%d/region.vtu?box_level=%d&box=%s' % (cid, level, root + 2, BOX))
               for level in (0, root)]
    assert answers[0][2] == answers[1][2] and answers[0][1]['tetlod-level'] == str(root)


def test_exact():
    """The last level, which makes values exact and is not in pages, takes the whole stream, and is measured."""
    shown = SERVER.json('/v1/meshes/fin')
    last = len(shown['levels']) - 1
    assert shown['levels'][last]['tets'] == shown['levels'][last - 1]['tets']
    at = '/v1/meshes/fin/%s/levels/1/region.vtu?box=%s&box_level=' % (shown['cid'], BOX)
    for level, kind, outside in (last, 'measured', 1), (last - 1, 'max', shown['first_paged_level'] - 1):
        status, head, _ = SERVER.get(at + str(level))
        assert status == 200 and head['tetlod-transition-error'].startswith(kind + '=')
        assert head['tetlod-level'] == str(outside)


def test_no_stream_in_memory():
    """A region out of pages decodes nothing else; one that is measured decodes the stream."""
    def decoded():
        _, _, body = server.get('/metrics')
        return int(re.search(r'^tetlod_streams_decoded_total (\d+)', body.decode(), re.M)[1])

    with Server(os.path.join(SCRATCH, 'fin.tetlod')) as server:
        shown = server.json('/v1/meshes/fin')
        last = len(shown['levels']) - 1
        at = '/v1/meshes/fin/%s/levels/1/region.vtu?box=%s&box_level=' % (shown['cid'], BOX)
        for level, count in (last - 1, 0), (last, 1):
            status, _, _ = server.get(at + str(level))
            assert status == 200 and decoded() == count


LITTLE = '--cache', '1M', '--memory', '8M'  # less than the stream takes


def files_of(server):
    """Temporary files that it holds."""
    folder, count = '/proc/%d/fd' % server.process.pid, 0
    for name in os.listdir(folder):
        with contextlib.suppress(FileNotFoundError):  # it was closed meanwhile
            count += os.path.basename(SPOOLS) in os.readlink(os.path.join(folder, name))
    return count


def test_levels_in_files():
    """The same bytes, ranges of them, and levels before pages, which are in memory."""
    with Server(LARGE, *LITTLE, environment={'TMPDIR': SPOOLS}) as server:
        shown = server.json('/v1/meshes/large')
        last, root = len(shown['levels']) - 1, shown['first_paged_level'] - 1
        for level, in_file in (root, False), (last - 1, True), (last, True):
            for form in 'vtu', 'vtk':
                path = '/v1/meshes/large/%s/levels/%d/mesh.%s' % (shown['cid'], level, form)
                whole, (status, head, body) = SERVER.get(path), server.get(path)
                assert status == 200 and body == whole[2] and head['etag'] == whole[1]['etag'], (path, status)
                assert in_file == (files_of(server) > 0), (path, files_of(server))
                for first, end in (0, 99), (5000, 300000), (len(body) - 7, len(body) - 1):
                    assert server.get(path, Range='bytes=%d-%d' % (first, end))[2] == body[first:end + 1]


def test_no_temporary_folder():
    """One line that says so; the rest is served."""
    with Server(LARGE, *LITTLE, environment={'TMPDIR': SPOOLS + '/none'}) as server:
        shown = server.json('/v1/meshes/large')
        at = '/v1/meshes/large/%s/levels/%%d/mesh.vtu' % shown['cid']
        status, _, body = server.get(at % (len(shown['levels']) - 1))
        assert status == 503 and b'temporary file' in body and b'TMPDIR' in body, (status, body[:200])
        assert server.get(at % 0)[0] == 200


SPOOLS, LARGE = os.path.join(SCRATCH, 'spools'), os.path.join(SCRATCH, 'large.tetlod')
os.makedirs(SPOOLS, exist_ok=True)
tetlod('sample', 'cube', '--size', '8', '-o', 'cube.vtu')
tetlod('build', 'cube.vtu', '-o', 'cube.tetlod', '--paged=100', '--quiet')
tetlod('sample', 'fin', '--size', '8', '-o', 'fin.vtu')
tetlod('build', 'fin.vtu', '-o', 'fin.tetlod', '--paged=100', '--quiet')
tetlod('sample', 'fin', '--size', '28', '-o', 'large.vtu')
tetlod('build', 'large.vtu', '-o', 'large.tetlod', '--paged=2000', '--field', 'Pressure', '--quiet')
with Server(os.path.join(SCRATCH, 'cube.tetlod'), os.path.join(SCRATCH, 'fin.tetlod'), LARGE) as SERVER:
    run([test_as_extract, test_lower_level, test_exact, test_no_stream_in_memory, test_levels_in_files,
         test_no_temporary_folder])
