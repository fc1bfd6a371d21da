#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The ParaView plugin in pvpython ($PVPYTHON, or one that is installed): file and URL at three errors, fields, steps in time, and pictures
where there is a display."""
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
    stream, series = (os.path.join(SCRATCH, name) for name in ('fin.tetlod', 'wake.tetlod'))
    for arguments in (('sample', 'fin', '--size', '14', '-o', 'fin.vtu'), ('build', 'fin.vtu', '-o', stream, '--quiet'),
                      ('sample', 'wake', '--size', '8', '--steps', '9', '-o', 'wake.pvd'),
                      ('build', 'wake.pvd', '--field', 'Pressure', '-o', series, '--quiet')):
        subprocess.run([TETLOD, *arguments], cwd=SCRATCH, check=True)
    with Server(stream, series) as server:
        done = subprocess.run([*PVPYTHON, '--force-offscreen-rendering', os.path.join(ROOT, 'tests', 'clients', 'paraview_script.py'),
                               os.path.join(ROOT, 'client-examples', 'paraview', 'tetlod_paraview.py'), stream, server.url + 'v1/meshes/fin',
                               series, server.url + 'v1/meshes/wake', SCRATCH],
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    found = re.findall(r'^level (\S+) (\d+) (\d+) (.*)$', done.stdout, re.M)
    assert done.returncode == 0 and len(found) == 6, done.stdout
    for percent, cells, points, fields in found:
        mesh = tetlod.read(stream, error=percent + '%')
        assert (int(cells), int(points)) == (len(mesh.tets), len(mesh.points)) and fields == str(sorted(mesh.fields)), (percent, cells, points, fields)
    assert "fields ['Pressure']" in done.stdout, done.stdout
    check_steps(tetlod.open(series), done.stdout)
    if not os.environ.get('DISPLAY'):
        return None  # Debian's ParaView draws by X alone
    sizes = [os.path.getsize(os.path.join(SCRATCH, 'paraview_%s.png' % percent)) for percent in ('5', '1', '0.2')]
    assert 2000 < sizes[0] < sizes[1] < sizes[2], sizes  # finer edges, more bytes
    first, last = (open(os.path.join(SCRATCH, 'paraview_%s.png' % name), 'rb').read() for name in ('first', 'last'))
    assert len(first) > 2000 and len(last) > 2000 and first != last
    return None


def check_steps(series, printed):
    assert 'times %s' % list(series.times) in printed, printed
    found = re.findall(r'^step (\S+) (\S+) (\d+) (\S+) (\S+) (\S+)$', printed, re.M)
    assert len(found) == 12, printed
    for percent, time, cells, low, high, shown in found:
        mesh = series.at(float(time), percent + '%')
        values = mesh.fields['Pressure']
        assert (int(cells), float(low), float(high), float(shown)) == (len(mesh.tets), values.min(), values.max(), mesh.time), (percent, time, printed)


run([test_plugin])
