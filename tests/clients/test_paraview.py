#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The ParaView plugin in pvpython ($PVPYTHON, or one that is installed): file and URL at three errors, fields, steps in
time, and pictures where there is a display; VTKHDF files with a stream in them; and the plugin's messages, also
without ParaView."""
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
    for arguments in (('sample', 'fin', '--size', '14', '-o', 'fin.vtu'),
                      ('build', 'fin.vtu', '--field', 'Pressure', '-o', stream, '--quiet'),
                      ('sample', 'wake', '--size', '8', '--steps', '9', '-o', 'wake.pvd'),
                      ('build', 'wake.pvd', '--field', 'Pressure', '-o', series, '--quiet')):
        subprocess.run([TETLOD, *arguments], cwd=SCRATCH, check=True)
    with Server(stream, series) as server:
        done = subprocess.run([*PVPYTHON, '--force-offscreen-rendering',
                               os.path.join(ROOT, 'tests', 'clients', 'paraview_script.py'),
                               tetlod.paraview_plugin(), stream, server.url + 'v1/meshes/fin',
                               series, server.url + 'v1/meshes/wake', SCRATCH],
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    found = re.findall(r'^level (\S+) (\d+) (\d+) (.*)$', done.stdout, re.M)
    assert done.returncode == 0 and len(found) == 6, done.stdout
    for percent, cells, points, fields in found:
        mesh = tetlod.read(stream, error=percent + '%')
        assert ((int(cells), int(points)) == (len(mesh.tets), len(mesh.points))
                and fields == str(sorted(mesh.fields))), (percent, cells, points, fields)
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
        mesh = series.at(min(float(time), series.times[-1]), percent + '%')
        values = mesh.fields['Pressure']
        assert (int(cells), float(low), float(high), float(shown)) == (len(mesh.tets), values.min(), values.max(),
                                                                       mesh.time), (percent, time, printed)


VTKHDF = """
import os, sys
from paraview.simple import OpenDataFile, VTKHDFReader, Show, ColorBy, CreateView, SaveScreenshot
for name in sys.argv[1:]:
    reader = OpenDataFile(name) if name.endswith('.hdf') else VTKHDFReader(FileName=[name])
    reader.UpdatePipeline()
    data = reader.GetDataInformation()
    print('shown', data.GetNumberOfCells(), data.GetNumberOfPoints(), sorted(reader.PointData.keys()))
    if os.environ.get('DISPLAY'):
        view = CreateView('RenderView')
        view.ViewSize = [400, 300]
        ColorBy(Show(reader, view), ('POINTS', 'Pressure'))
        view.ResetCamera()
        SaveScreenshot(name + '.png', view)
"""


def test_vtkhdf():
    """ParaView opens a file with a stream in it as it is: by the ending .hdf, and as a VTKHDF file."""
    if not PVPYTHON:
        return 'pvpython is not there'
    for arguments in (('sample', 'fin', '--size', '14', '-o', 'bare.vtu'),
                      ('build', 'bare.vtu', '-o', 'bare.tetlod', '--quiet'),
                      *(('convert', 'bare.tetlod', '--stream', '--show', '1%', '-o', name)
                        for name in ('shown.hdf', 'shown.vtkhdf'))):
        subprocess.run([TETLOD, *arguments], cwd=SCRATCH, check=True)
    names = [os.path.join(SCRATCH, name) for name in ('shown.hdf', 'shown.vtkhdf')]
    done = subprocess.run([*PVPYTHON, '--force-offscreen-rendering', '-', *names], input=VTKHDF, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True)
    mesh = tetlod.read(os.path.join(SCRATCH, 'bare.tetlod'), error='1%')
    wanted = 'shown %d %d %s' % (len(mesh.tets), len(mesh.points), sorted(mesh.fields))
    assert done.returncode == 0 and done.stdout.splitlines() == [wanted] * 2, (done.stdout, wanted)
    for name in names if os.environ.get('DISPLAY') else ():
        assert os.path.getsize(name + '.png') > 2000
    return None


STUB = """
import sys, types
from vtkmodules.util import vtkAlgorithm
for name in 'paraview', 'paraview.util', 'paraview.util.vtkAlgorithm':
    sys.modules[name] = types.ModuleType(name)
place = sys.modules['paraview.util.vtkAlgorithm']
place.VTKPythonAlgorithmBase = vtkAlgorithm.VTKPythonAlgorithmBase
place.smdomain = place.smhint = place.smproperty = place.smproxy = type('Marks', (), {
    '__getattr__': lambda self, name: lambda *a, **k: (lambda thing: thing)})()
told = []
sys.modules['paraview'].print_error = lambda text: told.append('error ' + text)
sys.modules['paraview'].print_warning = lambda text: told.append('warning ' + text)
import importlib.util
spec = importlib.util.spec_from_file_location('plugin', sys.argv[1])
plugin = importlib.util.module_from_spec(spec)
spec.loader.exec_module(plugin)
for path, percent in zip(sys.argv[2::2], sys.argv[3::2]):
    reader = plugin.TetlodReader()
    reader.SetFileName(path)
    reader.SetError(float(percent))
    reader.Update()
    print(reader.GetOutputDataObject(0).GetNumberOfCells(), told)
    told.clear()
series = plugin.TetlodReader()
series.SetFileName('series.tetlod')
for time in -9.0, 1e9:
    series.UpdateTimeStep(time)
    print(series.GetOutputDataObject(0).GetInformation().Get(plugin.vtkDataObject.DATA_TIME_STEP()))
"""


def test_messages():
    """The plugin's own code over VTK, without ParaView: a message for what goes wrong; a cut file by its levels; of
    a time outside of the series the nearest step."""
    whole, cut, other = (os.path.join(SCRATCH, name) for name in ('whole.tetlod', 'cut.tetlod', 'other.tetlod'))
    for arguments in ('sample', 'fin', '--size', '10', '-o', 'whole.vtu'), ('build', 'whole.vtu', '-o', whole,
                                                                            '--quiet'):
        subprocess.run([TETLOD, *arguments], cwd=SCRATCH, check=True)
    levels, data = tetlod.open(whole).levels, open(whole, 'rb').read()
    here = next(level for level in levels if level.errors['Pressure']['max'] <= 0.05)
    open(cut, 'wb').write(data[:here.bytes + 1])
    open(other, 'wb').write(b'something else')
    shutil.copy(os.path.join(ROOT, 'tests', 'golden', 'series_float32.tetlod'), os.path.join(SCRATCH, 'series.tetlod'))
    done = subprocess.run(['/usr/bin/python3', '-c', STUB, tetlod.paraview_plugin(), whole, '5', cut, '5', cut, '0.1',
                           other, '1', 'none.tetlod', '1'],
                          stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                          cwd=SCRATCH)
    *lines, before, behind = done.stdout.splitlines()
    assert done.returncode == 0 and len(lines) == 5 and not done.stderr, (lines, done.stderr)
    assert lines[0] == '%d []' % here.tets and lines[1] == lines[0], lines
    said = 'warning tetlod: the file is cut off: it holds levels 0 to %d' % here.level
    assert lines[2].startswith('%d [' % here.tets) and said in lines[2], lines
    assert lines[3].startswith("0 [") and "error tetlod: " in lines[3] and 'not a tetlod stream' in lines[3], lines
    assert lines[4].startswith("0 [") and "error tetlod: " in lines[4] and 'none.tetlod' in lines[4], lines
    times = tetlod.open(os.path.join(SCRATCH, 'series.tetlod')).times
    assert (before, behind) == (repr(times[0]), repr(times[-1])), (before, behind, times)
    return None


run([test_plugin, test_vtkhdf, test_messages])
