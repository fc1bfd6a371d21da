#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""tetlod-mpi: the ranks of an MPI job build one stream, whose bytes are those of build --paged."""
import os
import re
import signal
import subprocess
import time

import numpy as np

import cell_meshes
from common import ROOT, SCRATCH, case, finish, info, must, path, report
from mpi_job import PROGRAM, job, missing, mpi, own_lines, read, same, start


def says_once():
    """Rank 0 says what build says."""
    done = mpi(2, 'build', 'fin.vtu', '-o', 'many.tetlod', '--paged=2000', '--json')
    lines = done.stdout.decode().strip()
    return None if done.returncode == 0 and lines.count('"levels"') == 1 else done


def says_version():
    """The version is that of tetlod, and is said once; so is the help."""
    version, said = must('--version').stdout.decode(), mpi(2, '--version').stdout.decode()
    helped = mpi(2, '-h').stdout.decode()
    return None if said == version.replace('tetlod', 'tetlod-mpi') and helped.count('usage: ') == 1 else (said, helped)


def fails_once(code, words, *arguments):
    """What all ranks fail with is said once."""
    done = mpi(3, *arguments)
    lines = own_lines(done)
    good = done.returncode == code and len(lines) == 1 and all(word in lines[0] for word in words)
    return None if good and not os.path.exists(path('no.tetlod')) else done


def no_folder():
    """Without a folder for temporary files that is said once, as all that ranks fail with."""
    done = job(3, 'env', 'TMPDIR=nowhere', PROGRAM, 'build', 'fin.vtu', '-o', 'no.tetlod')
    lines = own_lines(done)
    return None if done.returncode == 1 and len(lines) == 1 and ' nowhere: ' in lines[0] else done


def one_fails():
    """A rank that fails alone ends the job with a line that names it, and there is no stream."""
    script = 'if [ "$OMPI_COMM_WORLD_RANK" = 1 ]; then exec "$0" build fin.vtu --threads=x -o no.tetlod; ' \
             'else exec "$0" build fin.vtu --paged=4000 -o no.tetlod; fi'
    done = job(3, 'sh', '-c', script, PROGRAM)
    lines = [line for line in own_lines(done) if 'example: ' not in line]
    good = done.returncode and len(lines) == 1 and 'rank 1' in lines[0] and '--threads' in lines[0]
    return None if good and not os.path.exists(path('no.tetlod')) else done


def is_ready(process):
    """Has rank 0 begun, so that it says what ends it?"""
    with open('/proc/%d/status' % process) as file:
        caught = re.search('SigCgt:\t([0-9a-f]+)', file.read()).group(1)
    return int(caught, 16) >> (signal.SIGTERM - 1) & 1


def processes(mpirun):
    """Of the job's ranks."""
    with open('/proc/%d/task/%d/children' % (mpirun, mpirun)) as file:
        children = [int(word) for word in file.read().split()]
    ranks = {}
    for child in children:
        with open('/proc/%d/environ' % child, 'rb') as file:
            about = dict(entry.split(b'=', 1) for entry in file.read().split(b'\0') if b'=' in entry)
        if b'OMPI_COMM_WORLD_RANK' in about:
            ranks[int(about[b'OMPI_COMM_WORLD_RANK'])] = child
    return ranks


def kill_rank(mpirun, number):
    """Kills it once rank 0 has begun. False: the job was over before."""
    while mpirun.poll() is None:
        try:
            ranks = processes(mpirun.pid)
            if len(ranks) == 3 and is_ready(ranks[0]):
                os.kill(ranks[number], signal.SIGKILL)
                return True
        except OSError:
            pass # it has ended meanwhile
        time.sleep(0.002)
    return False


def dies():
    """A rank that is killed ends the job with one line of rank 0, and no file is left."""
    must('sample', 'cube', '--size', '24', '-o', 'cube.vtu')
    before = set(os.listdir(SCRATCH))
    for _ in range(5): # on a busy machine the job may be faster than this, or mpirun too impatient for rank 0's line
        process = start(3, '--quiet', PROGRAM, 'build', 'cube.vtu', '--paged=2000', '-o', 'no.tetlod', '--quiet')
        killed = kill_rank(process, 1)
        said = process.communicate()[1].decode().splitlines()
        if killed and process.returncode and said:
            good = len(said) == 1 and 'a rank has died' in said[0] and set(os.listdir(SCRATCH)) == before
            return None if good else said
        if os.path.exists(path('no.tetlod')):
            os.unlink(path('no.tetlod'))
    return 'no rank could be killed in time'


def models():
    """--model says what a job costs on other numbers of ranks: less on more, and never less than its longest part; all
    ranks together spend more. The bytes that it expects to move are about those that do."""
    done = mpi(5, 'build', 'fin.vtu', '-o', 'many.tetlod', '--paged=1500', '--quiet', '--model', '8')
    table, behind = done.stdout.decode().split('MB moved\n')[1].split('\n\n')
    rows = [[float(word) for word in line.split()] for line in table.splitlines()]
    good = [row[0] for row in rows] == [1, 2, 4, 8] and rows[0][2] == 1 and rows[0][1] > rows[3][1] > 0
    good &= rows[0][1] == rows[0][3] < rows[3][3] and rows[0][4] == 0 < rows[1][4] < rows[2][4] < rows[3][4]
    moved = float(re.search('([0-9.]+) MB moved in all', behind).group(1))
    good &= rows[1][4] / 2 < moved < 1.1 * rows[3][4] # by chance rank 0 does less than its share, or more
    bad = mpi(2, 'build', 'fin.vtu', '--model', 'x', '-o', 'no.tetlod')
    return None if done.returncode == 0 and good and bad.returncode == 2 and len(own_lines(bad)) == 1 else (done, bad)


def stages(ranks):
    """Every part comes to all ranks; a failure at any moment does, too; from eight ranks on also of two crews."""
    done = job(ranks, os.path.join(os.path.dirname(PROGRAM), 'tests/mpi/test_stages'))
    return None if done.returncode == 0 and done.stdout == b'good\n' and not done.stderr else done


def gathers(ranks):
    """Pieces of ranks are joined by owners of their points: rank 0 gets one mesh, and what does not fit all refuse."""
    done = job(ranks, os.path.join(os.path.dirname(PROGRAM), 'tests/mpi/test_gather'))
    return None if done.returncode == 0 and done.stdout == b'good\n' and not done.stderr else done


def in_situ():
    """A solver on several ranks: a step is seen while it runs; one rank and three write the same streams."""
    built = os.path.dirname(PROGRAM)
    done = subprocess.run(['mpicc', '-Wall', '-Werror', '-I', ROOT, '-I', os.path.join(ROOT, 'src/mpi'),
                           os.path.join(ROOT, 'client-examples/c/insitu_mpi.c'), os.path.join(built, 'libtetlod-mpi.a'),
                           os.path.join(built, 'libtetlod.a'), '-pthread', '-lm', '-o', 'insitu_mpi'], cwd=SCRATCH,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if done.returncode:
        return done.stdout
    os.mkdir(path('taken.tetlod'))
    refused = job(3, path('insitu_mpi'), 'taken.tetlod', 'last.tetlod') # rank 0 fails alone, and all ranks end
    if not refused.returncode or b'taken.tetlod: cannot be written' not in refused.stderr:
        return refused
    streams, seen, last = [], set(), None
    for ranks in (1, 3):
        solver = start(ranks, path('insitu_mpi'), 'series.tetlod', 'last.tetlod')
        while solver.poll() is None:
            time.sleep(0.01)
            now = os.stat(path('series.tetlod')).st_ino if os.path.exists(path('series.tetlod')) else last
            if now != last:
                seen.add(len(info('series.tetlod')['series']['times']))
            last = now
        said = solver.communicate()
        if solver.returncode or any(said):
            return said
        streams.append([read(name) for name in ('series.tetlod', 'last.tetlod')])
    for name in ('series.tetlod', 'last.tetlod'):
        must('verify', name)
    steps = len(info('series.tetlod')['series']['times'])
    if streams[0] != streams[1]:
        return 'other bytes on other ranks'
    return None if steps == 4 and min(seen) < 4 else (steps, seen)


def dolfinx():
    """A program of FEniCSx hands over what its ranks have: a series, and the last step by all ranks."""
    built = os.path.dirname(PROGRAM)
    library = path('libtetlod-mpi.so')
    subprocess.run(['mpicc', '-shared', '-o', library, '-Wl,--whole-archive', os.path.join(built, 'libtetlod-mpi.a'),
                    '-Wl,--no-whole-archive', os.path.join(built, 'libtetlod.a'), '-lm'], check=True)
    done = job(2, 'env', 'TETLOD_MPI_LIBRARY=' + library, '/usr/bin/python3',
               os.path.join(ROOT, 'client-examples/python/insitu_dolfinx.py'), 'series.tetlod', 'last.tetlod')
    if done.returncode:
        return done
    for name in 'series.tetlod', 'last.tetlod':
        must('verify', name)
    series, last = info('series.tetlod'), info('last.tetlod')
    return None if len(series['series']['times']) == 4 and series['tets'] == last['tets'] == 3072 else series


why = missing()
if why:
    report('an MPI job', True, skip=why)
    finish()


def defects():
    """What one rank finds of the border of a mesh with flat, inverted and folded tetrahedra, turned as a whole, is what
    one program finds."""
    points, tets = cell_meshes.block(9)
    inside = np.flatnonzero(((points > 0.15) & (points < 0.85)).all(1))
    points[inside[::40]] += 0.15
    for flat in tets[100:3000:700]:
        points[flat[3]] = points[flat[:3]].mean(0)
    cell_meshes.save('defects.vtu', points, tets[:, [0, 1, 3, 2]], {'p': np.sin(5 * points.sum(1))},
                     {'region': (points[tets].mean(1)[:, 0] > 0.4).astype(np.int32)})
    wrong = same((2, 3, 8), ['defects.vtu'], '--paged=300', '--region', 'region')
    found = info('alone.tetlod')
    return wrong or (None if found['degenerate_tets'] and found['inverted_tets'] > 20 else found)


must('sample', 'fin', '--size', '16', '-o', 'fin.vtu')
case('rank 0 speaks', says_once)
if os.environ.get('ONLY') == 'rank 0 speaks': # of an installed program
    finish()
case('its version and its help', says_version)
case('three and eight ranks', same, (3, 8), ['fin.vtu'], '--paged=1500')
case('large arrays in files', same, (2,), ['fin.vtu'], '--paged=1000', '--memory', '16M', '--scratch', SCRATCH)
must('sample', 'torus', '--size', '6', '-o', 'torus.vtu')
case('a boundary that moves, local bounds', same, (3,), ['torus.vtu'], '--paged=2000', '--domain-error', '0.001',
     '--local-bound')
case('a mesh with defects', defects)
case('rounded', same, (2,), ['fin.vtu'], '--paged=1500', '--field-bits', '14', '--position-bits', '16')
must('sample', 'wake', '--steps', '8', '--size', '10', '-o', 'wake.pvd')
case('a series', same, (2,), ['wake.pvd'])
must('sample', 'wake', '--steps', '4', '--remesh', '2', '--size', '10', '-o', 'remeshed.pvd')
case('a series over several meshes', same, (2,), ['remeshed.pvd'])
case('a file that is not there', fails_once, 1, ['missing.vtu', 'cannot open'], 'build', 'missing.vtu', '-o',
     'no.tetlod')
case('what cannot be shared', fails_once, 2, ['--certify exact'], 'build', 'fin.vtu', '--certify', 'exact', '-o',
     'no.tetlod')
case('a folder that is not there', fails_once, 1, ['nowhere/no.tetlod'], 'build', 'fin.vtu', '--paged=2000', '-o',
     'nowhere/no.tetlod')
case('no folder of temporary files', no_folder)
case('one rank fails', one_fails)
case('a rank is killed', dies)
case('stages', lambda: stages(3))
case('stages of two crews', lambda: stages(8))
case('a model', models)
for count in (2, 3):
    case('pieces of %d ranks become one mesh' % count, gathers, count)
case('a solver', in_situ)
has_dolfinx = ['/usr/bin/python3', '-c',
               'import importlib.util as u; raise SystemExit(u.find_spec("dolfinx") is None)']
if subprocess.run(has_dolfinx).returncode == 0:
    case('a program of FEniCSx', dolfinx)
else:
    report('a program of FEniCSx', True, skip='dolfinx is not installed: make deps-insitu')
finish()
