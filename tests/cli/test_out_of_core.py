#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""build --memory: meshes that do not fit are built by cells, with large arrays in temporary files. What can be built
so, and that it is the same stream, is also asked in test_pages.py. extract --memory."""
import json
import os
import resource
import signal

from common import SANITIZED, case, fails, finish, info, must, path, report, tetlod

CELLS = '--paged=2000'
LITTLE = '20M'  # less than the mesh takes in one piece


def read(name):
    with open(path(name), 'rb') as file:
        return file.read()


def built(name, *options):
    return json.loads(must('build', 'cube.vtu', '-o', name, '--json', *options).stdout)


def same_bytes():
    in_memory = built('memory.tetlod', CELLS)
    if in_memory['scratch_files']:
        return 'files without --memory'
    for threads in ('2',) if SANITIZED else ('1', '2', '3'):
        said = built('files.tetlod', CELLS, '--memory', LITTLE, '--threads', threads, '--scratch', 'scratch')
        if read('files.tetlod') != read('memory.tetlod'):
            return 'other bytes on %s threads' % threads
        if said['scratch_files'] < 1 << 20:
            return 'little in files: %d' % said['scratch_files']
        if os.listdir(path('scratch')):
            return 'files are left'
    return None


def extracted():
    """The files of the same bytes, and none that is left."""
    for name in 'level.vtu', 'level.vtkhdf', 'level.vtk':
        must('extract', 'memory.tetlod', '-o', name, '--quiet')
        must('extract', 'memory.tetlod', '-o', 'of-' + name, '--quiet', '--memory', '4M', '--scratch', 'scratch')
        if read(name) != read('of-' + name) or os.listdir(path('scratch')):
            return name
    return None


def chooses():
    """In one piece where that fits; else by cells, whose size need not be said."""
    roomy = built('one.tetlod', '--memory', '200M')
    if SANITIZED:
        return roomy['scratch_files'] or None
    built('plain.tetlod')
    if roomy['scratch_files'] or 'pages' in info('one.tetlod') or read('one.tetlod') != read('plain.tetlod'):
        return 'not in one piece'
    built('few.tetlod', CELLS, '--memory', '200M')
    return None if read('few.tetlod') == read('memory.tetlod') else 'other cells'


def full_folder(name, *command):
    """One line that says which folder; no output, and none that is half."""
    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 19, 1 << 19))
    done = tetlod(*command, '-o', name, '--scratch', 'scratch', preexec_fn=limit, restore_signals=False)
    said = done.stderr.decode()
    good = done.returncode == 1 and said.count('\n') == 1 and 'scratch' in said and '--scratch' in said
    left = [left for left in os.listdir(path('')) if left.startswith(name[:4])] + os.listdir(path('scratch'))
    return None if good and not left else (done.returncode, said, left)


def folder_in_memory():
    with open('/proc/mounts') as mounts:
        if not any(line.split()[1:3] == ['/dev/shm', 'tmpfs'] for line in mounts):
            return report('a folder in memory is named', True, skip='no /dev/shm')
    must('sample', 'cube', '--size', '10', '-o', 'small.vtu')
    build = 'build', 'small.vtu', '-o', 'small.tetlod', '--paged=300', '--memory', str((14 << 20) + 390000)
    said = [must(*build, '--threads', '2', '--scratch', folder).stderr.decode() for folder in ('/dev/shm', 'scratch')]
    return report('a folder in memory is named', '/dev/shm is in memory itself' in said[0] and
                  'in memory itself' not in said[1], said)


must('sample', 'cube', '--size', '24', '-o', 'cube.vtu')
os.makedirs(path('scratch'), exist_ok=True)
case('the same stream, on any number of threads; nothing is left in the folder', same_bytes)
case('in one piece where that fits', chooses)
case('a level as a file of the same bytes', extracted)
case('a folder that is full', full_folder, 'full.tetlod', 'build', 'cube.vtu', CELLS, '--memory', LITTLE)
case('the same of a level', full_folder, 'full.vtu', 'extract', 'memory.tetlod', '--memory', '4M')
folder_in_memory()
BUILD = 'build', 'cube.vtu', '-o', 'no.tetlod', '--memory'
fails('a folder that is not there', 1, ['nowhere', '--scratch'], *BUILD, LITTLE, '--scratch', 'nowhere')
fails('too little for any way', 1, ['needs about', 'by cells in files about', '--paged'], *BUILD, '10M')
fails('what cannot be built by cells', 1, ['more than --memory', 'by cells', '--metric'], *BUILD, LITTLE, '--metric',
      'quadric')
report('no output of what failed', not os.path.exists(path('no.tetlod')))
finish()
