#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""usage: mesh_files.py BENCH_IO PROGRAM [SIZE]

Prints what reading and writing VTU take beside VTK's own reader and writer (python3-vtk9), in turns in one run: medians
of REPEAT (5) times, and their ratios, of the sample cube with 6 SIZE^3 tetrahedra (119: ten million) as VTK writes it,
raw and with zlib. Files are in the system's cache, and tetlod's writer, as always, waits for the disk: VTK's does not.
"""
import json
import os
import statistics
import subprocess
import sys
import tempfile

BENCH, PROGRAM = (os.path.abspath(path) for path in sys.argv[1:3])
SIZE = sys.argv[3] if len(sys.argv) > 3 else '119'
REPEAT = int(os.environ.get('REPEAT', '5'))
KINDS = {'raw': 'w.SetCompressorTypeToNone()', 'zlib': 'w.SetCompressorTypeToZLib()'}

VTK = '''
import json, sys, time
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader, vtkXMLUnstructuredGridWriter
start = time.perf_counter()
r = vtkXMLUnstructuredGridReader()
r.SetFileName(sys.argv[1])
r.Update()
read = time.perf_counter()
if len(sys.argv) > 2:
    w = vtkXMLUnstructuredGridWriter()
    w.SetInputData(r.GetOutput())
    w.SetFileName(sys.argv[2])
    w.EncodeAppendedDataOff()
    w.SetHeaderTypeToUInt64()
    %s
    w.Write()
print(json.dumps({'read': read - start, 'write': time.perf_counter() - read}))
'''


def run(*command):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        sys.exit('%s: %s' % (command[0], done.stderr.strip()))
    return done.stdout


def time_one(program, kind, source, out):
    """Seconds of reading, and of writing if `out` is a name."""
    files = [source] + [out] * bool(out)
    text = run(BENCH, *files) if program == 'tetlod' else run('/usr/bin/python3', '-c', VTK % KINDS[kind], *files)
    return json.loads(text)


def main():
    with tempfile.TemporaryDirectory() as folder:
        sample, out = os.path.join(folder, 'sample.vtu'), os.path.join(folder, 'out.vtu')
        run(PROGRAM, 'sample', 'cube', '--size', SIZE, '-o', sample)
        print('%d tetrahedra, medians of %d, in seconds' % (6 * int(SIZE) ** 3, REPEAT))
        print('%-6s %-8s %8s %8s %8s' % ('file', '', 'VTK', 'tetlod', 'ratio'))
        for kind in KINDS:
            source = os.path.join(folder, kind + '.vtu')
            run('/usr/bin/python3', '-c', VTK % KINDS[kind], sample, source)
            writes = kind == 'zlib'  # tetlod's always compresses
            taken = {'VTK': [], 'tetlod': []}
            for _ in range(REPEAT):
                for program in taken:
                    taken[program].append(time_one(program, kind, source, out if writes else None))
            for what in ['read'] + ['write'] * writes:
                vtk, ours = (statistics.median(times[what] for times in taken[program]) for program in taken)
                print('%-6s %-8s %8.3f %8.3f %7.2f×' % (kind, what, vtk, ours, ours / vtk))


main()
