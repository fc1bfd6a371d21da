#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""usage: build.py PROGRAM [MESH]...

Prints a table of what building costs, one and two threads, beside VTK's quadric decimation (python3-vtk9, one thread,
no promise) in the same
run: tetrahedra removed a second, seconds by phase, peak memory a tetrahedron, and the true error of both at the same
number of tetrahedra, a tenth. MESH is cube:SIZE or another sample (post:64 has 490,000 stretched tetrahedra in thin
layers), or blunt for the blunt fin of BLUNT=folder. REPEAT=n takes medians; EXACT=1 adds a build with --certify exact;
README=1 writes the rates as a table in Markdown.
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
MESHES = sys.argv[2:] or ['blunt', 'post:64', 'cube:60']
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
    return path, {'cube': 'xyz', 'fin': 'Pressure', 'post': 'Pressure'}.get(name)


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


def build(path, field, threads, least, out, *more):
    options = (['--field', field] if field else []) + list(more)
    return json.loads(run('build', path, '-o', out, '--json', '--quiet', '--growth', '2', '--threads', str(threads),
                          '--min-tets', str(least), *options))


def true_error(path, field, level):
    errors = json.loads(run('compare', path, level, '--json', *(['--field', field] if field else [])))['errors']
    return errors['max'], errors['rms']


def report_error(name, ours, peer, promised):
    print('  %s: true max %.3f %% (%.2f of VTK), rms %.4f %% (%.2f of VTK), promised %.3f %%' % (
        name, 100 * ours[0], ours[0] / peer[0], 100 * ours[1], ours[1] / peer[1], 100 * promised), flush=True)


def rate(before, after, seconds):
    return (before - after) / seconds / 1000


def bench(mesh, folder):
    path, field = make(mesh, folder)
    if not path:
        print('%s: skipped: there is no blunt fin (BLUNT=folder)' % mesh)
        return None
    peer, stream, peer_out = [], os.path.join(folder, 'out.tetlod'), os.path.join(folder, 'vtk.vtu')
    ours = {1: [], 2: []}
    for _ in range(REPEAT):  # in turn, so that a busy machine is busy for all of them
        peer.append(decimate(path, field, peer_out))
        for threads in ours:
            ours[threads].append(build(path, field, threads, peer[0][3], stream))
    tets, left = peer[0][2], peer[0][3]
    seconds = statistics.median(p[1] for p in peer)
    print('%s, %d tetrahedra' % (mesh, tets))
    print('  VTK               %7.0f K/s   read %.2f decimate %.2f s' %
          (rate(tets, left, seconds), statistics.median(p[0] for p in peer), seconds))
    rates, bytes_each = [], 0
    for threads, results in ours.items():
        contract = statistics.median(r['seconds']['contract'] for r in results)
        phases = ' '.join('%s %.2f' % (phase, statistics.median(r['seconds'][phase] for r in results))
                          for phase in ('read', 'contract', 'measure', 'encode', 'write'))
        own = rate(tets, results[0]['levels'][0]['tets'], contract)
        rates.append(own)
        bytes_each = max(r['peak_memory'] for r in results) / tets
        print('  tetlod, %d thread%s %7.0f K/s   %.2f x   %s s   %.0f bytes a tetrahedron' % (
            threads, 's' if threads > 1 else ' ', own, own / rate(tets, left, seconds), phases, bytes_each))
    peer_error = true_error(path, field, peer_out)
    print('  at %.1f %% left: VTK: true max %.3f %%, rms %.4f %%' % (100 * left / tets, 100 * peer_error[0],
                                                                     100 * peer_error[1]))
    level, built = os.path.join(folder, 'level.vtu'), {'fast': ours[2][0]}
    for certify in ('fast', 'exact') if os.environ.get('EXACT') else ('fast',):
        if certify == 'exact':
            built[certify] = build(path, field, 2, left, stream, '--certify', 'exact')
            print('  --certify exact: contract %.1f s, %.0f bytes a tetrahedron' % (
                built[certify]['seconds']['contract'], built[certify]['peak_memory'] / tets))
        run('extract', stream, '--level', '0', '-o', level)
        report_error(certify, true_error(path, field, level), peer_error,
                     max(e.get('max', 0) for e in built[certify]['levels'][0]['errors'].values()))
    return [mesh, '{:,}'.format(tets),
            '%.0f K' % rate(tets, left,
                            seconds)] + ['%.0f K (%.1f x)' % (r, r / rate(tets, left, seconds)) for r in rates] + [
        '%.0f' % bytes_each]


def main():
    with tempfile.TemporaryDirectory() as folder:
        rows = [row for row in (bench(mesh, folder) for mesh in MESHES) if row]
    if os.environ.get('README'):
        print(
            '\n| mesh | tetrahedra | VTK | one thread | two threads | bytes a tetrahedron |\n|---|---|---|---|---|---|')
        for row in rows:
            print('| %s |' % ' | '.join(row))


if __name__ == '__main__':
    main()
