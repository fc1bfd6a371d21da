#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A sample of `make attack`: some seeds of random adversarial meshes and options, held against the oracle; and of the certificate
itself in one process (proof.c)."""
import os
import subprocess
import sys

ROOT, TETLOD, SCRATCH = os.environ['ROOT'], os.environ['TETLOD'], os.environ['SCRATCH']
ATTACK = os.path.join(os.path.dirname(TETLOD), 'tests', 'attack', 'attack')
RANGES = [(1, 10), (131, 12), (188, 20)]  # first seed, how many
MENDED = (20, 45, 91, 121, 251, 313, 320, 357, 406, 504, 617, 650, 715, 796, 809, 847, 1206, 1210, 1424, 1911, 1938)  # each was a finding once
RANGES += [(seed, 1) for seed in MENDED]

bad = 0
for number, (first, count) in enumerate(RANGES, 1):
    done = subprocess.run([sys.executable, os.path.join(ROOT, 'tests/attack/run_attack.py'), ATTACK, TETLOD, SCRATCH, str(count), str(first)],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    bad += done.returncode != 0
    print('%s %d - seeds %d to %d' % ('not ok' if done.returncode else 'ok', number, first, first + count - 1))
    if done.returncode:
        print(''.join('# %s\n' % line for line in done.stdout.decode(errors='replace').splitlines()))
    sys.stdout.flush()
done = subprocess.run([os.path.join(os.path.dirname(ATTACK), 'proof'), '1', '100'], stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
bad += done.returncode != 0
print('%s %d - the certificate, seeds 1 to 100' % ('not ok' if done.returncode else 'ok', len(RANGES) + 1))
print(''.join('# %s\n' % line for line in done.stdout.decode(errors='replace').splitlines()), end='')
print('1..%d' % (len(RANGES) + 1))
sys.exit(bool(bad))
