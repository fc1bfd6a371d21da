#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The plugin in C++ of ParaView, built against the one that is installed (or that of $ParaView_DIR, as for CMake), in
pvpython ($PVPYTHON, or one that is installed)."""
import glob
import json
import os
import shlex
import shutil
import subprocess
import sys

ROOT = os.environ['ROOT']
sys.path.insert(0, os.path.join(ROOT, 'tests', 'http'))
from served import SCRATCH, TETLOD, Server, run  # noqa: E402
import tetlod  # noqa: E402

PVPYTHON = shlex.split(os.environ.get('PVPYTHON') or shutil.which('pvpython') or '')
PLUGIN = os.path.join(ROOT, 'build', 'paraview', 'lib', 'paraview-*', 'plugins', 'TetlodReader', 'TetlodReader.so')


def build():
    environment = {k: v for k, v in os.environ.items() if k not in ('MAKEFLAGS', 'MAKELEVEL', 'MFLAGS')}
    done = subprocess.run(['make', '-s', '-C', ROOT, 'paraview'], env=environment, stdin=subprocess.DEVNULL,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    with open(os.path.join(ROOT, 'build', 'paraview.log')) as log:
        assert done.returncode == 0, done.stdout + log.read()[-3000:]
    return glob.glob(PLUGIN)[0]


def expected(mesh):
    values = mesh.fields['Pressure'].astype('float32')
    return [len(mesh.tets), len(mesh.points), sorted(mesh.fields), [float(values.min()), float(values.max())]]


def test_plugin():
    found = os.environ.get('ParaView_DIR') or glob.glob('/usr/lib/*/cmake/paraview-5*')
    if not found or not all(map(shutil.which, ('cmake', 'c++'))):
        return 'cmake, a C++ compiler or paraview-dev is not installed (make deps-vtk)'
    plugin = build()
    if not PVPYTHON:
        return 'built; pvpython is not there: Debian cannot install python3-paraview beside python3-vtk9'
    names = ('fin.tetlod', 'wake.tetlod', 'pages.tetlod', 'fin.vtkhdf')
    stream, series, paged, inside = (os.path.join(SCRATCH, name) for name in names)
    for arguments in (('sample', 'fin', '--size', '14', '-o', 'fin.vtu'), ('build', 'fin.vtu', '-o', stream, '--quiet'),
                      ('convert', stream, '--stream', '-o', inside),
                      ('build', 'fin.vtu', '--paged=1000', '-o', paged, '--quiet'),
                      ('sample', 'wake', '--size', '8', '--steps', '9', '-o', 'wake.pvd'),
                      ('build', 'wake.pvd', '--field', 'Pressure', '-o', series, '--quiet')):
        subprocess.run([TETLOD, *arguments], cwd=SCRATCH, check=True)
    display = [] if os.environ.get('DISPLAY') or not shutil.which('xvfb-run') else ['xvfb-run', '-w', '60', '-a']
    with Server(stream) as server:
        done = subprocess.run([*display, *PVPYTHON, '--force-offscreen-rendering',
                               os.path.join(ROOT, 'tests', 'clients', 'paraview_reader_script.py'), plugin, stream,
                               server.url + 'v1/meshes/fin', series, paged, inside, SCRATCH],
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    lines = [json.loads(line) for line in done.stdout.splitlines() if line.startswith('["')]
    said = {line[0]: line[1:] for line in lines}
    assert done.returncode == 0, done.stdout
    assert said['proxy'] == ['TetlodStreamReader', 'Tetlod Stream Reader'], done.stdout
    for percent in '5', '1':
        mesh = expected(tetlod.read(stream, error=percent + '%'))
        assert said['file ' + percent] == said['url ' + percent] == mesh, (percent, mesh, done.stdout)
    chosen = tetlod.read(stream, tets=2000, fields='Pressure')
    assert said['chosen'] == expected(chosen), done.stdout
    assert 0 < said['box'][0] < said['third'][0] / 4, done.stdout
    region = tetlod.open(paged).region((0, 0.2, 0.1, 0.5, 1, 0.9), error='5%', box_error='0.2%')
    assert said['region'] == expected(region) and 'Region' in said['cells'][0], done.stdout
    assert said['inside'] == said['file 1'], done.stdout
    fine = expected(tetlod.read(stream, error='0.2%'))
    assert said['first'][0] <= 1000 < said['second'][0] and said['second'] == said['third'] == fine, done.stdout
    found = tetlod.open(series)
    assert said['times'] == [list(found.times)], done.stdout
    for time in found.times[0], found.times[3], found.times[-1]:
        assert said['step %r' % time] == expected(found.at(time, '5%')), done.stdout
    if not display and not os.environ.get('DISPLAY'):
        return None
    names = ['reader_%s.png' % name for name in ('first', 'second', 'third', 'region')]
    pictures = [open(os.path.join(SCRATCH, name), 'rb').read() for name in names]
    assert 2000 < len(pictures[0]) < len(pictures[1]) and pictures[1] == pictures[2] != pictures[3]
    return None


run([test_plugin])
