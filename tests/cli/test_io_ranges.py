#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""One file of many cells, of which ranks read a range each: the stream is that of the program that reads it alone."""
import re
import struct

import numpy as np

import mpi_job
from common import case, finish, must, path, report
from kuhn_grid import kuhn

FLAT = 33000 # triangles, which have no volume, on each side: so that there are several ranges and little to build
KINDS = {'f': 'Float64', 'i': 'Int64', 'u': 'UInt8'}


def mixed():
    """A block of tetrahedra and hexahedra amid triangles; a layer of tetrahedra that are ghosts."""
    points, tets = kuhn(8, np.random.default_rng(4))
    hexahedra = np.array([[0, 1, 3, 2, 4, 5, 7, 6]]) + len(points) + 8 * np.arange(40)[:, None]
    corner = np.array(np.meshgrid([0, 1], [0, 1], [0, 1], indexing='ij')).T.reshape(-1, 3) / 8
    points = np.concatenate([points, *(corner + [2 + i / 4, 0, 0] for i in range(40))])
    ghosts = tets[:50]
    cells = [np.zeros((FLAT, 3), int), tets, hexahedra, ghosts, np.ones((FLAT, 3), int)]
    kinds = [5, 10, 12, 10, 5]
    count = sum(map(len, cells))
    hidden = np.zeros(count, np.uint8)
    hidden[FLAT + len(tets) + len(hexahedra):][:len(ghosts)] = 1
    return {'Points': points, 'heat': np.sin(3 * points).sum(axis=1), 'load': np.arange(count) % 97 / 8.0,
            'vtkGhostType': hidden, 'connectivity': np.concatenate([c.ravel() for c in cells]).astype('i8'),
            'offsets': np.cumsum(np.concatenate([np.full(len(c), c.shape[1]) for c in cells])).astype('i8'),
            'types': np.concatenate([np.full(len(c), k, np.uint8) for c, k in zip(cells, kinds)])}


def save(name, arrays):
    """Raw appended data, not compressed."""
    places, data = {}, b''
    for key, values in arrays.items():
        places[key] = '<DataArray type="%s" Name="%s" NumberOfComponents="%d" format="appended" offset="%d"/>' % (
            KINDS[values.dtype.kind], key, 3 if key == 'Points' else 1, len(data))
        data += struct.pack('<Q', values.nbytes) + values.tobytes()
    head = '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">' \
           '<UnstructuredGrid><Piece NumberOfPoints="%d" NumberOfCells="%d"><Points>%s</Points><PointData>%s' \
           '</PointData><CellData>%s</CellData><Cells>%s</Cells></Piece></UnstructuredGrid>' \
           '<AppendedData encoding="raw">_'
    head %= (len(arrays['Points']), len(arrays['types']), places['Points'], places['heat'],
             places['load'] + places['vtkGhostType'], ''.join(places[k] for k in ('connectivity', 'offsets', 'types')))
    with open(path(name), 'wb') as file:
        file.write(head.encode() + data + b'</AppendedData></VTKFile>')


def ranges_of(name, *options):
    """How many ranges three ranks read; what they build is what one program does."""
    differs = mpi_job.same((2,), [name], *options)
    if differs:
        return differs
    done = mpi_job.mpi(3, 'build', name, '-o', 'three.tetlod', '--quiet', '--model', '3', *options)
    if done.returncode or mpi_job.read('three.tetlod') != mpi_job.read('alone.tetlod'):
        return done
    return int(re.search(r'\n1 +(\d+) ', done.stdout.decode()).group(1))


def cells_case(name, ranges):
    found = ranges_of(name, '--field', 'heat', '--paged=400')
    return None if found == ranges else found


def tets_case(name):
    """Nothing but tetrahedra, whose kinds and offsets no rank keeps."""
    found = ranges_of(name, '--paged=10000', '--max-error', '0.001')
    return None if found == 2 else found


def refused_case(key, change, words):
    """What is wrong in the range of another rank is said once, as the program that reads the file alone says it."""
    arrays = {**mixed()}
    arrays[key] = change(arrays[key].copy())
    save('wrong.vtu', arrays)
    done = mpi_job.mpi(2, 'build', 'wrong.vtu', '-o', 'no.tetlod', '--field', 'heat')
    said = mpi_job.own_lines(done)
    return None if done.returncode and len(said) == 1 and all(word in said[0] for word in words) else done


def with_value(at, value):
    def change(values):
        values[at] = value
        return values
    return change


why = mpi_job.missing()
if why:
    report('ranges of a file', True, skip=why)
    finish()
save('mixed.vtu', mixed())
case('VTU: cells of several kinds, ghosts, values of cells', cells_case, 'mixed.vtu', 2)
must('sample', 'cube', '--size', '23', '-o', 'tets.vtu')
case('VTU: tetrahedra, compressed', tets_case, 'tets.vtu')
must('convert', 'tets.vtu', '-o', 'tets.vtkhdf')
case('VTKHDF: tetrahedra', tets_case, 'tets.vtkhdf')
case('a corner that is not there, in the last range', refused_case, 'connectivity', with_value(-1, 10 ** 9), ['point'])
case('offsets that fall between two ranges', refused_case, 'offsets', with_value(-FLAT - 60, 5), ['offsets'])
case('offsets that end too early', refused_case, 'offsets', with_value(-1, 8), ['offsets'])
finish()
