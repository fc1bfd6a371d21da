#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The ParaView plugin in pvpython ($PVPYTHON, or one that is installed): file and URL at three errors, fields, and pictures where there
is a display."""
import os
import re
import shlex
import shutil
import subprocess
import sys

ROOT = os.environ['ROOT']
sys.path.insert(0, os.path.join(ROOT, 'tests', 'http'))
from served import SCRATCH, TETLOD, Server, run  # noqa: E402

sys.path.insert(0, os.path.join(ROOT, 'client-examples', 'python'))
import tetlod  # noqa: E402

PVPYTHON = shlex.split(os.environ.get('PVPYTHON') or shutil.which('pvpython') or '')


def test_plugin():
    if not PVPYTHON:
        return 'pvpython is not there: Debian cannot install python3-paraview beside python3-vtk9; $PVPYTHON may name one'
    stream = os.path.join(SCRATCH, 'fin.tetlod')
    subprocess.run([TETLOD, 'sample', 'fin', '--size', '14', '-o', 'fin.vtu'], cwd=SCRATCH, check=True)
    subprocess.run([TETLOD, 'build', 'fin.vtu', '-o', 'fin.tetlod', '--quiet'], cwd=SCRATCH, check=True)
    with Server(stream) as server:
        done = subprocess.run([*PVPYTHON, '--force-offscreen-rendering', os.path.join(ROOT, 'tests', 'clients', 'paraview_script.py'),
                               os.path.join(ROOT, 'client-examples', 'paraview', 'tetlod_paraview.py'), stream, server.url + 'v1/meshes/fin', SCRATCH],
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    found = re.findall(r'^level (\S+) (\d+) (\d+) (.*)$', done.stdout, re.M)
    assert done.returncode == 0 and len(found) == 6, done.stdout
    for percent, cells, points, fields in found:
        mesh = tetlod.read(stream, error=percent + '%')
        assert (int(cells), int(points)) == (len(mesh.tets), len(mesh.points)) and fields == str(sorted(mesh.fields)), (percent, cells, points, fields)
    assert "fields ['Pressure']" in done.stdout, done.stdout
    if not os.environ.get('DISPLAY'):
        return None  # Debian's ParaView draws by X alone
    sizes = [os.path.getsize(os.path.join(SCRATCH, 'paraview_%s.png' % percent)) for percent in ('5', '1', '0.2')]
    assert 2000 < sizes[0] < sizes[1] < sizes[2], sizes  # finer edges, more bytes
    return None


run([test_plugin])
