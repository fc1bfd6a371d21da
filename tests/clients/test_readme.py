#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The commands and the Python of README.md run as they stand, on a sample in the place of the reader's mesh."""
import glob
import os
import re
import subprocess
import sys

ROOT = os.environ['ROOT']
sys.path.insert(0, os.path.join(ROOT, 'tests', 'http'))
from served import SCRATCH, TETLOD, run  # noqa: E402

with open(os.path.join(ROOT, 'README.md')) as page:
    README = page.read()


def commands(section):
    text = README.split('\n## ' + section + '\n')[1].split('\n## ')[0]
    return re.findall(r'^    (tetlod [^#\n]*)', text, re.M)


def test_your_own_mesh():
    found = [c for c in commands('Your own mesh') if ' serve ' not in c]
    assert len(found) == 7, found
    for command in ['tetlod sample fin --size 14 -o mesh.vtu'] + found:
        done = subprocess.run(['bash', '-c', command.replace('tetlod ', "'%s' " % TETLOD, 1)], cwd=SCRATCH, stdin=subprocess.DEVNULL,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert done.returncode == 0, (command, done)
    assert os.path.getsize(os.path.join(SCRATCH, 'mail.tetlod')) < os.path.getsize(os.path.join(SCRATCH, 'part.tetlod'))


def test_python():
    code = re.search(r'```python\n(.*?)```', README, re.S)[1]
    library = glob.glob(os.path.join(os.path.dirname(TETLOD), 'libtetlod.so.*'))[0]
    done = subprocess.run(['/usr/bin/python3', '-c', code + '\nassert mesh.error <= 0.01 and len(mesh.tets) > 100\n'], cwd=SCRATCH,
                          env=dict(os.environ, TETLOD_LIBRARY=library, PYTHONPATH=os.path.join(ROOT, 'client-examples', 'python')),
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 0, done.stdout


run([test_your_own_mesh, test_python])
