#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""A sample of `make attack`: some seeds of random adversarial meshes and options, held against the oracle; and of the
certificate itself in one process (proof.c)."""
import os
import subprocess
import sys

from tap import finish, note, report

ROOT, TETLOD, SCRATCH = os.environ['ROOT'], os.environ['TETLOD'], os.environ['SCRATCH']
ATTACK = os.path.join(os.path.dirname(TETLOD), 'tests', 'attack', 'attack')
RANGES = [(1, 6), (131, 6), (188, 8), (3000001, 8)]  # first seed, how many
MENDED = (20, 45, 91, 121, 251, 313, 320, 357, 406, 504, 617, 650, 715, 796, 809, 847, 1206, 1210, 1424, 1467, 1911,
          1938, 31314, 90223, 1000502, 2000173, 2000473, 2000542, 3000149)  # each was a finding once
RANGES += [(seed, 1) for seed in MENDED]


def run(name, *command):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    said = done.stdout.decode(errors='replace')
    report(name, done.returncode == 0, said)
    return said


for first, count in RANGES:
    run('seeds %d to %d' % (first, first + count - 1),
        sys.executable, os.path.join(ROOT,
                                     'tests/attack/run_attack.py'), ATTACK, TETLOD, SCRATCH, str(count), str(first))
run('inputs that were changed, and files that are cut off, seeds 1 to 8', sys.executable,
    os.path.join(ROOT, 'tests/attack/doors.py'), TETLOD, SCRATCH, '8')
run('selections of pages', '/usr/bin/python3', os.path.join(ROOT, 'tests/attack/selections.py'), '1', '12', 'parts',
    'bent')
run('changed pages', '/usr/bin/python3', os.path.join(ROOT, 'tests/attack/mutations.py'), '1', '60', 'fin')
note(run('the certificate, seeds 1 to 40', os.path.join(os.path.dirname(ATTACK), 'proof'), '1', '40'))
finish()
