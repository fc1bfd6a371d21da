#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The page in a browser: serves a sample, page.mjs looks at it."""
import os
import subprocess
import sys

ROOT = os.environ['ROOT']
sys.path.insert(0, os.path.join(ROOT, 'tests', 'http'))
from served import SCRATCH, TETLOD, Server  # noqa: E402

mesh, folder = os.path.join(SCRATCH, 'fin.vtu'), os.path.join(SCRATCH, 'streams')
os.mkdir(folder)
subprocess.run([TETLOD, 'sample', 'fin', '-o', mesh], check=True, stdout=subprocess.DEVNULL)
subprocess.run([TETLOD, 'build', mesh, '--quiet', '-o', os.path.join(folder, 'fin.tetlod')], check=True)
sys.path.insert(0, os.path.join(ROOT, 'client-examples', 'python'))
import tetlod  # noqa: E402

with Server(folder) as server:
    with tetlod.open(server.url + 'v1/meshes/fin', error='20%') as stream, open(os.path.join(SCRATCH, 'cell.html'), 'w') as cell:
        assert tetlod.open(os.path.join(folder, 'fin.tetlod'))._repr_html_() is None
        cell.write('<!doctype html><title>A cell</title>' + stream._repr_html_())  # as notebooks do
    sys.exit(subprocess.run(['node', os.path.join(ROOT, 'tests', 'web', 'page.mjs'), server.url, cell.name]).returncode)
