#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The recipes of server/deploy/many-machines.md are run as they stand there: each gives the stream of build --paged."""
import os
import re
import shutil
import socket
import subprocess
import sys
import time

from common import CONFIG, ROOT, SCRATCH, TETLOD, case, finish, must, note, path, report

with open(os.path.join(ROOT, 'server/deploy/many-machines.md')) as page:
    PAGE = page.read()


def recipe(title):
    """The first block of a section."""
    return re.search(r'### %s\n\n```\w+\n(.*?)```' % title, PAGE, re.DOTALL).group(1)


def environment(**more):
    folder = path('bin')
    os.makedirs(folder, exist_ok=True)
    if not os.path.exists(os.path.join(folder, 'tetlod')):
        os.symlink(TETLOD, os.path.join(folder, 'tetlod'))
    return {**os.environ, 'PATH': folder + ':' + os.environ['PATH'], 'HOME': SCRATCH, **more}


def gives_the_stream(command, **more):
    shutil.rmtree(path('work'), ignore_errors=True)
    done = subprocess.run(command, cwd=SCRATCH, env=environment(**more), stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          stdin=subprocess.DEVNULL, timeout=300)
    if done.returncode or not os.path.exists(path('mesh.tetlod')):
        return done
    with open(path('mesh.tetlod'), 'rb') as made, open(path('alone.tetlod'), 'rb') as alone:
        same = made.read() == alone.read()
    os.unlink(path('mesh.tetlod'))
    return None if same else 'other bytes'


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    for each in sockets:
        each.bind(('127.0.0.1', 0))
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return ports


class Slurm:
    """A cluster of this machine, in the scratch folder."""
    def __enter__(self):
        self.folder = path('slurm')
        os.makedirs(self.folder)
        name, ports = socket.gethostname(), free_ports(2)
        self.configuration = os.path.join(self.folder, 'slurm.conf')
        settings = {'ClusterName': 'local', 'SlurmctldHost': name + '(127.0.0.1)', 'AuthType': 'auth/none',
                    'CredType': 'cred/none', 'ProctrackType': 'proctrack/linuxproc', 'TaskPlugin': 'task/none',
                    'SelectType': 'select/cons_tres', 'SelectTypeParameters': 'CR_Core', 'MpiDefault': 'none',
                    'ReturnToService': '2', 'SlurmUser': 'root', 'SlurmdUser': 'root', 'SlurmctldPort': ports[0],
                    'SlurmdPort': ports[1], 'StateSaveLocation': self.folder, 'SlurmdSpoolDir': self.folder + '/spool',
                    'SlurmctldPidFile': self.folder + '/controller.pid', 'SlurmdPidFile': self.folder + '/node.pid',
                    'SchedulerParameters': 'batch_sched_delay=0,sched_interval=1',
                    'NodeName': name + ' NodeAddr=127.0.0.1 CPUs=%d State=UNKNOWN' % len(os.sched_getaffinity(0)),
                    'PartitionName': 'all Nodes=ALL Default=YES MaxTime=INFINITE State=UP'}
        with open(self.configuration, 'w') as file:
            file.writelines('%s=%s\n' % item for item in settings.items())
        self.processes = [self.start('slurmctld', '-D'), self.start('slurmd', '-D', '-N', name)]
        self.is_up = False
        for _ in range(600):
            state = subprocess.run(['sinfo', '-h', '-o', '%t'], env={**os.environ, 'SLURM_CONF': self.configuration},
                                   stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout
            self.is_up = b'idle' in state
            if self.is_up:
                break
            time.sleep(0.1)
        return self

    def start(self, *command):
        with open(os.path.join(self.folder, command[0] + '.log'), 'wb') as log:
            return subprocess.Popen(command, env=environment(SLURM_CONF=self.configuration), stdout=log, stderr=log)

    def __exit__(self, *raised):
        for process in reversed(self.processes):
            process.terminate()
        for process in self.processes:
            process.wait(30)


def slurm():
    with Slurm() as cluster:
        if not cluster.is_up:
            with open(os.path.join(cluster.folder, 'slurmd.log')) as log:
                note('Slurm does not start here: %s' % log.read()[-300:])
            return None
        return gives_the_stream(['sh', '-e', '-c', recipe('Slurm')], SLURM_CONF=cluster.configuration)


def dask():
    with open(path('recipe.py'), 'w') as file:
        file.write(recipe('Dask'))
    return gives_the_stream([sys.executable, 'recipe.py'])


def has_dask():
    return subprocess.run([sys.executable, '-c', 'import distributed'], stderr=subprocess.DEVNULL).returncode == 0


RECIPES = {
    'GNU parallel': (lambda: shutil.which('parallel'),
                     lambda: gives_the_stream(['sh', '-e', '-c', recipe('GNU parallel')])),
    'Slurm': (lambda: shutil.which('slurmctld') and shutil.which('slurmd') and os.getuid() == 0, slurm),
    'Dask': (has_dask, dask)}
if CONFIG == 'release':
    must('sample', 'fin', '--size', '24', '-o', 'mesh.vtu')
    must('build', 'mesh.vtu', '--paged', '-o', 'alone.tetlod')
for name, (is_there, run) in RECIPES.items():
    if CONFIG == 'release' and is_there():
        case('a recipe: ' + name, run)
    else:
        report('a recipe: ' + name, True, skip='not here' if CONFIG == 'release' else 'of the release alone')
finish()
