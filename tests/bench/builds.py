# SPDX-License-Identifier: BSD-3-Clause
"""What the benchmarks of the builder share: the meshes, and one build."""
import json
import os
import subprocess
import sys
import tempfile

TETLOD = os.path.abspath(sys.argv[1])
BLUNT = os.environ.get('BLUNT') or os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..', '..', 'shared',
                                                'data')
SAMPLES = {'cube': 'xyz', 'delta': 'potential', 'shell': 'temperature', 'torus': 'temperature', 'fin': 'Pressure'}
place = tempfile.TemporaryDirectory(prefix='tetlod-bench-')


def mesh(name):
    """Its arguments of `build`; None where the data is not there."""
    if name == 'blunt fin':
        grid, solution = os.path.join(BLUNT, 'bluntfinxyz.bin'), os.path.join(BLUNT, 'bluntfinq.bin')
        return [grid, '--q', solution, '--field', 'Pressure', '--carry', 'Pressure'] if os.path.exists(grid) else None
    path = os.path.join(place.name, name + '.vtu')
    if not os.path.exists(path):
        subprocess.run([TETLOD, 'sample', name, '-o', path], check=True)
    return [path, '--field', SAMPLES[name], '--carry', SAMPLES[name]]


def build(name, *options):
    """The stream's index, with times."""
    done = subprocess.run([TETLOD, 'build', *mesh(name), *options, '-o', os.path.join(place.name, 'bench.tetlod'),
                           '--json',
                           '--quiet'], stdout=subprocess.PIPE, check=True)
    return json.loads(done.stdout)


def left(index, measure, error):
    """Percent of the tetrahedra at the coarsest level with that error."""
    name = next(field['name'] for field in index['fields'] if field['controlled'])
    return 100 * next(l['tets'] for l in index['levels'] if l['errors'][name][measure] <= error) / index['tets']
