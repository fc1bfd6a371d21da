#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""usage: build.py PROGRAM [MESH]...

Prints a table of what building costs, one and two threads, beside VTK's quadric decimation (python3-vtk9, one thread, no promise) in the same
run: tetrahedra removed a second, seconds by phase, peak memory a tetrahedron, and the true error of both at the same number of tetrahedra,
a tenth. MESH is cube:SIZE or another sample, or blunt for the blunt fin of BLUNT=folder. REPEAT=n takes medians.
"""
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

from vtkmodules.vtkFiltersCore import vtkUnstructuredGridQuadricDecimation
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader, vtkXMLUnstructuredGridWriter

PROGRAM = os.path.abspath(sys.argv[1])
MESHES = sys.argv[2:] or ['blunt', 'cube:60', 'fin:40']
REPEAT = int(os.environ.get('REPEAT', '3'))


def run(*command):
    done = subprocess.run([PROGRAM] + list(command), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        sys.exit('tetlod %s: %s' % (' '.join(command), done.stderr.strip()))
    return done.stdout


def make(mesh, folder):
    """The mesh as VTU, and the field that is controlled."""
    path = os.path.join(folder, mesh.replace(':', '-') + '.vtu')
    if mesh == 'blunt':
        blunt = os.environ.get('BLUNT', '../shared/data')
        if not os.path.exists(os.path.join(blunt, 'bluntfinxyz.bin')):
            return None, None
        run('convert', os.path.join(blunt, 'bluntfinxyz.bin'), '--q', os.path.join(blunt, 'bluntfinq.bin'), '-o', path)
        return path, 'Density'
    name, _, size = mesh.partition(':')
    run('sample', name, *(['--size', size] if size else []), '-o', path)
    return path, {'cube': 'xyz', 'fin': 'Pressure'}.get(name)


def decimate(path, field, out):
    """Seconds of reading and of decimating to a tenth; how many there were and are."""
    start = time.perf_counter()
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(path)
    reader.Update()
    read = time.perf_counter()
    grid = reader.GetOutput()
    field = field or grid.GetPointData().GetArrayName(0)
    decimation = vtkUnstructuredGridQuadricDecimation()
    decimation.SetInputData(grid)
    decimation.SetScalarsName(field)
    decimation.SetTargetReduction(0.9)
    decimation.Update()
    done = time.perf_counter()
    output = decimation.GetOutput()
    values = output.GetPointData().GetArray(field) or output.GetPointData().GetArray(0)
    values.SetName(field)
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(output)
    writer.SetFileName(out)
    writer.Write()
    return read - start, done - read, grid.GetNumberOfCells(), output.GetNumberOfCells()


def build(path, field, threads, least, out):
    options = ['--field', field] if field else []
    return json.loads(run('build', path, '-o', out, '--json', '--quiet', '--growth', '2', '--threads', str(threads), '--min-tets', str(least), *options))


def true_error(path, field, level):
    errors = json.loads(run('compare', path, level, '--json', *(['--field', field] if field else [])))['errors']
    return 'max %.3f %%, rms %.4f %%' % (100 * errors['max'], 100 * errors['rms'])


def rate(before, after, seconds):
    return (before - after) / seconds / 1000


def bench(mesh, folder):
    path, field = make(mesh, folder)
    if not path:
        print('%s: skipped: there is no blunt fin (BLUNT=folder)' % mesh)
        return
    peer, stream, peer_out = [], os.path.join(folder, 'out.tetlod'), os.path.join(folder, 'vtk.vtu')
    ours = {1: [], 2: []}
    for _ in range(REPEAT):  # in turn, so that a busy machine is busy for all of them
        peer.append(decimate(path, field, peer_out))
        for threads in ours:
            ours[threads].append(build(path, field, threads, peer[0][3], stream))
    tets, left = peer[0][2], peer[0][3]
    seconds = statistics.median(p[1] for p in peer)
    print('%s, %d tetrahedra' % (mesh, tets))
    print('  VTK               %7.0f K/s   read %.2f decimate %.2f s' % (rate(tets, left, seconds), statistics.median(p[0] for p in peer), seconds))
    for threads, results in ours.items():
        contract = statistics.median(r['seconds']['contract'] for r in results)
        phases = ' '.join('%s %.2f' % (phase, statistics.median(r['seconds'][phase] for r in results)) for phase in ('read', 'contract', 'measure', 'encode', 'write'))
        own = rate(tets, results[0]['levels'][0]['tets'], contract)
        print('  tetlod, %d thread%s %7.0f K/s   %.2f x   %s s   %.0f bytes a tetrahedron' % (
            threads, 's' if threads > 1 else ' ', own, own / rate(tets, left, seconds), phases, max(r['peak_memory'] for r in results) / tets))
    level = os.path.join(folder, 'level.vtu')
    run('extract', stream, '--level', '0', '-o', level)
    promised = max(e.get('max', 0) for e in ours[2][0]['levels'][0]['errors'].values())
    print('  true error at %.1f %% left: VTK %s; tetlod %s, promised %.3f %%' % (
        100 * left / tets, true_error(path, field, peer_out), true_error(path, field, level), 100 * promised), flush=True)


def main():
    with tempfile.TemporaryDirectory() as folder:
        for mesh in MESHES:
            bench(mesh, folder)


if __name__ == '__main__':
    main()
