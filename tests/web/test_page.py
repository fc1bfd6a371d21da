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
with Server(folder) as server:
    sys.exit(subprocess.run(['node', os.path.join(ROOT, 'tests', 'web', 'page.mjs'), server.url]).returncode)
