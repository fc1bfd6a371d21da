#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Sizes and speeds of the format, beside what else the same mesh takes. Usage: bench_format.py TETLOD
FOLDER-OF-PROGRAMS SIZES.csv CACHE

The fin sample, finite element results (fe_results.py) and the cube of 60^3 * 6 tetrahedra always; PLOT3D's blunt fin
(the usual grid and solution) if BLUNT names its folder. The cube's stream takes minutes to contract: it is kept in the
folder CACHE, and only coded anew (remove it after a change of the builder). The sizes are compared with the committed
table, and written to it with UPDATE=1.
"""
import gzip
import json
import os
import subprocess
import sys
import tempfile

tetlod, bench, table, cache = sys.argv[1:5]
HEADER = 'stream,bits/tet,geometry,fields,header and index'
COLUMNS = 'which split,labels,tetrahedra,base mesh,positions,field values'


def run(*command):
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout


def others(folder, source, fields, tets):
    """Bits a tetrahedron of gzip'd VTU, and of zstd -19 on the input's arrays in their own order, their bytes shuffled.
    """
    mesh = os.path.join(folder, 'mesh.vtu')
    run(tetlod, 'convert', *source, '-o', mesh)
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(mesh)
    reader.Update()
    grid = reader.GetOutput()
    arrays = [vtk_to_numpy(grid.GetPoints().GetData()),
              vtk_to_numpy(grid.GetCells().GetConnectivityArray()).astype('<u4')]
    arrays += [vtk_to_numpy(grid.GetPointData().GetArray(name)) for name in fields]
    raw = os.path.join(folder, 'raw')
    with open(raw, 'wb') as file:
        for array in arrays:
            file.write(array.reshape(-1).view('u1').reshape(-1, array.itemsize).T.tobytes())
    for name in [grid.GetPointData().GetArrayName(i) for i in range(grid.GetPointData().GetNumberOfArrays())]:
        if name not in fields:
            grid.GetPointData().RemoveArray(name)
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetFileName(mesh)
    writer.SetEncodeAppendedData(False)
    writer.Write()
    packed = gzip.compress(open(mesh, 'rb').read(), 9)
    return 8 * len(packed) / tets, 8 * len(run('zstd', '-19', '-c', '-q', raw)) / tets


def build(folder, name, options):
    stream = os.path.join(folder, name + '.tetlod')
    if not os.path.exists(stream):
        run(tetlod, 'build', *options, '-o', stream, '--quiet')
    return stream


def streams(folder):
    """Names, what to convert, and streams of what is measured."""
    fin, cube = os.path.join(folder, 'fin.vtu'), os.path.join(folder, 'cube.vtu')
    run(tetlod, 'sample', 'fin', '-o', fin)
    yield 'fin', [fin], build(folder, 'fin', [fin])
    blunt = os.environ.get('BLUNT', '')
    if os.path.exists(os.path.join(blunt, 'bluntfinxyz.bin')):
        source = [os.path.join(blunt, 'bluntfinxyz.bin'), '--q', os.path.join(blunt, 'bluntfinq.bin')]
        yield 'blunt', source, build(folder, 'blunt', source + ['--field', 'Pressure', '--carry', 'Pressure'])
    for kind, points in (('elastic', '9000'), ('block', '12000')):
        mesh = os.path.join(folder, kind + '.vtu')
        run('/usr/bin/python3', os.path.join(os.path.dirname(__file__), 'fe_results.py'), mesh, points, kind)
        yield kind, [mesh], build(folder, kind, [mesh, '--field', 'Temperature'])
    run(tetlod, 'sample', 'cube', '--size', '60', '-o', cube)
    os.makedirs(cache, exist_ok=True)
    yield 'cube60', [cube], build(cache, 'cube60', [cube])


def measure(folder, stream, bits):
    """A row's values: sizes, sizes of columns, speeds."""
    again = os.path.join(folder, 'again.tetlod')
    values = run(os.path.join(bench, 'bench_format'), stream, again, *bits).decode().strip().split(',')
    values[5:5] = run(os.path.join(bench, 'bench_columns'), again).decode().strip().split(',')
    return values


def main():
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        print(HEADER + ',' + COLUMNS + ',Mtets/s decoded,undone,redone,ms a level near 50000,bytes/tet', flush=True)
        for name, source, stream in streams(folder):
            for bits in ([], ['16', '16']):
                values = measure(folder, stream, bits)
                rows.append(','.join(values[:11]))
                print(','.join(values), flush=True)
            info = json.loads(run(tetlod, 'info', stream, '--json'))
            packed, plain = others(folder, source, [field['name'] for field in info['fields']], info['tets'])
            for what, size in (('gzip -9 of VTU', packed), ('zstd -19 of its arrays', plain)):
                rows.append('%s %s,%.2f' % (name, what, size) + 9 * ',')
                print(rows[-1], flush=True)
    if os.environ.get('UPDATE'):
        open(table, 'w').write('\n'.join([HEADER + ',' + COLUMNS] + rows) + '\n')
    known = dict(line.split(',', 1) for line in open(table).read().splitlines())
    for row in rows:
        name, now = row.split(',', 1)
        if known.get(name) != now:
            print('# %s was %s, is %s (UPDATE=1 takes it over)' % (name, known.get(name, 'not there'), now))


main()
