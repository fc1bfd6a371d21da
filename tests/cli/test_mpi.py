#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""tetlod-mpi: the ranks of an MPI job build one stream, whose bytes are those of build --paged."""
import os
import shutil
import subprocess

from common import CONFIG, SCRATCH, TETLOD, case, finish, must, path, report

PROGRAM = os.path.join(os.path.dirname(TETLOD), 'tetlod-mpi')
MPIRUN = shutil.which('mpirun')


def mpi(ranks, *arguments):
    environment = {**os.environ, 'OMPI_ALLOW_RUN_AS_ROOT': '1', 'OMPI_ALLOW_RUN_AS_ROOT_CONFIRM': '1',
                   'OMPI_MCA_rmaps_base_oversubscribe': '1', 'OMPI_MCA_btl_vader_single_copy_mechanism': 'none'}
    return subprocess.run([MPIRUN, '-n', str(ranks), PROGRAM, *arguments], cwd=SCRATCH, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, env=environment, timeout=120)


def own_lines(done):
    """What the program says, without what mpirun adds when a job fails."""
    return [line for line in done.stderr.decode().splitlines() if line.startswith('tetlod')]


def read(name):
    with open(path(name), 'rb') as file:
        return file.read()


def same(ranks, inputs, *options):
    must('build', *inputs, '-o', 'alone.tetlod', *options)
    for count in ranks:
        done = mpi(count, 'build', *inputs, '-o', 'many.tetlod', '--quiet', *options)
        if done.returncode or done.stderr or read('many.tetlod') != read('alone.tetlod'):
            return count, done
        os.unlink(path('many.tetlod'))
    return None


def says_once():
    """Rank 0 says what build says."""
    done = mpi(2, 'build', 'fin.vtu', '-o', 'many.tetlod', '--paged=4000', '--json')
    lines = done.stdout.decode().strip()
    return None if done.returncode == 0 and lines.count('"levels"') == 1 else done


def fails_once(code, words, *arguments):
    """What all ranks fail with is said once."""
    done = mpi(3, *arguments)
    lines = own_lines(done)
    good = done.returncode == code and len(lines) == 1 and all(word in lines[0] for word in words)
    return None if good and not os.path.exists(path('no.tetlod')) else done


def one_fails():
    """A rank that cannot read what the others can ends the job with a line that names it, and there is no stream."""
    script = 'if [ "$OMPI_COMM_WORLD_RANK" = 1 ]; then exec "$0" build missing.vtu -o no.tetlod; ' \
             'else exec "$0" build fin.vtu --paged=4000 -o no.tetlod; fi'
    environment = {**os.environ, 'OMPI_ALLOW_RUN_AS_ROOT': '1', 'OMPI_ALLOW_RUN_AS_ROOT_CONFIRM': '1',
                   'OMPI_MCA_rmaps_base_oversubscribe': '1'}
    done = subprocess.run([MPIRUN, '-n', '3', 'sh', '-c', script, PROGRAM], cwd=SCRATCH, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, env=environment, timeout=120)
    lines = [line for line in own_lines(done) if 'rank 1' in line and 'missing.vtu' in line]
    return None if done.returncode and len(lines) == 1 and not os.path.exists(path('no.tetlod')) else done


if CONFIG != 'release' or not MPIRUN or not os.path.exists(PROGRAM):
    report('an MPI job', True, skip='no MPI' if CONFIG == 'release' else 'MPI itself leaks')
    finish()
must('sample', 'fin', '--size', '20', '-o', 'fin.vtu')
case('rank 0 speaks', says_once)
if os.environ.get('ONLY') == 'rank 0 speaks': # of an installed program
    finish()
case('two and three ranks', same, (2, 3), ['fin.vtu'], '--paged=2000')
must('sample', 'wake', '--steps', '8', '-o', 'wake.pvd')
case('a series', same, (2,), ['wake.pvd'])
must('sample', 'wake', '--steps', '4', '--remesh', '2', '-o', 'remeshed.pvd')
case('a series over several meshes', same, (2,), ['remeshed.pvd'])
case('a file that is not there', fails_once, 1, ['missing.vtu', 'cannot open'], 'build', 'missing.vtu', '-o',
     'no.tetlod')
case('what cannot be shared', fails_once, 2, ['--certify exact'], 'build', 'fin.vtu', '--certify', 'exact', '-o',
     'no.tetlod')
case('a folder that is not there', fails_once, 1, ['nowhere/no.tetlod'], 'build', 'fin.vtu', '--paged=2000', '-o',
     'nowhere/no.tetlod')
case('one rank fails', one_fails)
finish()
