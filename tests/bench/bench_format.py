#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Sizes and speeds of the format, beside what else the same mesh takes. Usage: bench_format.py TETLOD FOLDER-OF-PROGRAMS SIZES.csv

The fin sample always; PLOT3D's blunt fin (the usual grid and solution) if BLUNT names its folder. The sizes are compared with the committed
table, and written to it with UPDATE=1.
"""
import gzip
import os
import subprocess
import sys
import tempfile

tetlod, bench, table = sys.argv[1:4]
HEADER = 'stream,bits/tet,geometry,fields,header and index'
COLUMNS = 'which split,labels,tetrahedra,base mesh,positions,field values'


def run(*command):
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout


def others(folder, stream, tets):
    """Bits a tetrahedron of gzip'd VTU, and of zstd -19 on the arrays of VTU as they are."""
    mesh = os.path.join(folder, 'mesh.vtu')
    run(tetlod, 'extract', stream, '-o', mesh, '--quiet')
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(mesh)
    reader.Update()
    grid = reader.GetOutput()
    arrays = [vtk_to_numpy(grid.GetPoints().GetData()), vtk_to_numpy(grid.GetCells().GetConnectivityArray()).astype('<u4')]
    arrays += [vtk_to_numpy(grid.GetPointData().GetArray(i)) for i in range(grid.GetPointData().GetNumberOfArrays())]
    raw = os.path.join(folder, 'raw')
    with open(raw, 'wb') as file:
        for array in arrays:
            file.write(array.tobytes())
    packed = gzip.compress(open(mesh, 'rb').read(), 9)
    return 8 * len(packed) / tets, 8 * len(run('zstd', '-19', '-c', '-q', raw)) / tets, grid.GetNumberOfCells()


def main():
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        inputs = []
        fin = os.path.join(folder, 'fin.vtu')
        run(tetlod, 'sample', 'fin', '-o', fin)
        inputs.append(('fin', [fin]))
        blunt = os.environ.get('BLUNT', '')
        if os.path.exists(os.path.join(blunt, 'bluntfinxyz.bin')):
            inputs.append(('blunt', [os.path.join(blunt, 'bluntfinxyz.bin'), '--q', os.path.join(blunt, 'bluntfinq.bin'),
                                     '--field', 'Pressure', '--carry', 'Pressure']))
        print(HEADER + ',' + COLUMNS + ',Mtets/s decoded,undone,redone,ms a level near 50000,bytes/tet')
        for name, options in inputs:
            stream = os.path.join(folder, name + '.tetlod')
            run(tetlod, 'build', *options, '-o', stream, '--quiet')
            for bits in ([], ['16', '16']):
                again = os.path.join(folder, 'again.tetlod')
                values = run(os.path.join(bench, 'bench_format'), stream, again, *bits).decode().strip().split(',')
                values[5:5] = run(os.path.join(bench, 'bench_columns'), again).decode().strip().split(',')
                rows.append(','.join(values))
                print(rows[-1])
            import json
            info = json.loads(run(tetlod, 'info', stream, '--json'))
            packed, plain, _ = others(folder, stream, info['tets'])
            print('# %s: gzip -9 of VTU %.1f, zstd -19 of its arrays %.1f bits/tet' % (name, packed, plain))
    sizes = [','.join(row.split(',')[:11]) for row in rows]
    if os.environ.get('UPDATE'):
        open(table, 'w').write('\n'.join([HEADER + ',' + COLUMNS] + sizes) + '\n')
    known = dict(line.split(',', 1) for line in open(table).read().splitlines())
    for row in sizes:
        name, now = row.split(',', 1)
        if known.get(name) != now:
            print('# %s was %s, is %s (UPDATE=1 takes it over)' % (name, known.get(name, 'not there'), now))


main()
