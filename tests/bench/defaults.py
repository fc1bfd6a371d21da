#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What it costs that all fields but ids are controlled: results of six kinds (tests/cli/results.py), without an option
and with one field, as a table in Markdown; then a pipe whose wall shear stress is known on the wall only, with several
limits of that field.
usage: defaults.py TETLOD [N]"""
import json
import os
import subprocess
import sys
import tempfile
import time

import numpy as np

sys.path[:0] = [os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', *part) for part in (('cli',), ('.',))]
os.environ.update(TETLOD=sys.argv[1], SCRATCH=tempfile.gettempdir(), ROOT=os.getcwd())
import results  # noqa: E402

ONE = {'flow': 'p', 'solid': 'VonMises', 'wall': 'p', 'tensors': 'stress', 'ids': 'GlobalNodeId', 'cells': 'pressure'}
IDS = {'GlobalNodeId', 'originalIds', 'owner'}
LIMITS = {'p': 0.01, 'U': 0.01, 'wallShearStress': 9}


def build(mesh, *options):
    started = time.time()
    subprocess.run([sys.argv[1], 'build', mesh, '-o', mesh + '.tetlod', '--quiet', *options], check=True)
    seconds = time.time() - started
    done = subprocess.run([sys.argv[1], 'info', mesh + '.tetlod', '--json'], stdout=subprocess.PIPE, check=True)
    return json.loads(done.stdout), seconds


def level(index, limits):
    return next(one for one in index['levels'] if all(one['errors'][name]['max'] <= limit
                                                      for name, limit in limits.items()))


def controlled(index, error):
    return {field['name']: error for field in index['fields'] if field['controlled']}


def row(kind, mesh):
    one, before = build(mesh, '--field', ONE[kind], '--no-region')
    new, now = build(mesh)
    cells = [kind, '%+.0f %%' % (100 * new['bytes'] / one['bytes'] - 100), '%.1f' % (now / before)]
    for error in 0.05, 0.01, 0.001:
        old, own = level(one, controlled(one, error)), level(new, controlled(new, error))
        worst = max(errors['sampled'] for name, errors in old['errors'].items() if name not in IDS)
        cells.append('%s, %.2g %% → %s' % (format(old['tets'], ','), 100 * worst, format(own['tets'], ',')))
    print('| %s |' % ' | '.join(cells))


def pipe(mesh, name, limits, *options):
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy
    at = level(build(mesh, *options)[0], limits)
    subprocess.run([sys.argv[1], 'extract', mesh + '.tetlod', '--level', str(at['level']), '-o', mesh + '.level.vtu',
                    '--quiet'], check=True)
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(mesh + '.level.vtu')
    reader.Update()
    points = vtk_to_numpy(reader.GetOutput().GetPoints().GetData())
    centres = points[vtk_to_numpy(reader.GetOutput().GetCells().GetConnectivityArray()).reshape(-1, 4)].mean(axis=1)
    core = int((np.hypot(centres[:, 0], centres[:, 1]) < 0.7).sum())
    print('| %s | %s | %s | %s |' % (name, *(format(number, ',') for number in (at['tets'], core, at['bytes']))))


def main():
    with tempfile.TemporaryDirectory() as folder:
        results.make(folder, int(sys.argv[2]) if len(sys.argv) > 2 else 24)
        print('| result | stream | time | 5 % | 1 % | 0.1 % |\n|---|---|---|---|---|---|')
        for kind in ONE:
            row(kind, os.path.join(folder, kind + '.vtu'))
        mesh = os.path.join(folder, 'wall.vtu')
        print('\n| limit of wallShearStress | tetrahedra | of these in the core | bytes |\n|---|---|---|---|')
        pipe(mesh, '1 %, as of all', {**LIMITS, 'wallShearStress': 0.01})
        for limit in '2', '5', '10', '20':
            pipe(mesh, limit + ' %', LIMITS, '--field', 'p:1%,U:1%,wallShearStress:' + limit + '%', '--max-error',
                 limit + '%')
        pipe(mesh, 'none', {'p': 0.01, 'U': 0.01}, '--no-field', 'wallShearStress')


main()
