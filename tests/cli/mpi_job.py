# SPDX-License-Identifier: BSD-3-Clause
"""Jobs of MPI: tetlod-mpi, held against tetlod build."""
import os
import shutil
import subprocess

from common import CONFIG, SCRATCH, TETLOD, must, path

PROGRAM = os.path.join(os.path.dirname(TETLOD), 'tetlod-mpi')
MPIRUN = shutil.which('mpirun')


def start(ranks, *command):
    environment = {**os.environ, 'OMPI_ALLOW_RUN_AS_ROOT': '1', 'OMPI_ALLOW_RUN_AS_ROOT_CONFIRM': '1',
                   'OMPI_MCA_rmaps_base_oversubscribe': '1', 'OMPI_MCA_btl_vader_single_copy_mechanism': 'none',
                   'OMPI_MCA_plm_rsh_agent': 'sh'}  # asked for even where all ranks are here
    return subprocess.Popen([MPIRUN, '-n', str(ranks), *command], cwd=SCRATCH, stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, env=environment)


def job(ranks, *command):
    process = start(ranks, *command)
    out, err = process.communicate(timeout=120)
    return subprocess.CompletedProcess(command, process.returncode, out, err)


def mpi(ranks, *arguments):
    return job(ranks, PROGRAM, *arguments)


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


def missing():
    """Why there are no jobs here, or None."""
    if CONFIG != 'release' or not MPIRUN or not os.path.exists(PROGRAM):
        return 'no MPI' if CONFIG == 'release' else 'MPI itself leaks'
    works = job(2, 'true')
    return 'mpirun runs nothing here: %r' % works.stderr[:200] if works.returncode else None
