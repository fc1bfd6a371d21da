#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A sample of `make attack`: some seeds of random adversarial meshes and options, held against the oracle."""
import os
import subprocess
import sys

ROOT, TETLOD, SCRATCH = os.environ['ROOT'], os.environ['TETLOD'], os.environ['SCRATCH']
ATTACK = os.path.join(os.path.dirname(TETLOD), 'tests', 'attack', 'attack')
RANGES = (1, 19), (131, 22), (188, 29)  # first seed, how many

bad = 0
for number, (first, count) in enumerate(RANGES, 1):
    done = subprocess.run([sys.executable, os.path.join(ROOT, 'tests/attack/run.py'), ATTACK, TETLOD, SCRATCH, str(count), str(first)],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    bad += done.returncode != 0
    print('%s %d - seeds %d to %d' % ('not ok' if done.returncode else 'ok', number, first, first + count - 1))
    if done.returncode:
        print(''.join('# %s\n' % line for line in done.stdout.decode(errors='replace').splitlines()))
    sys.stdout.flush()
print('1..%d' % len(RANGES))
sys.exit(bool(bad))
