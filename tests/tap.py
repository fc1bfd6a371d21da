# SPDX-License-Identifier: BSD-3-Clause
"""Results of a Python test in TAP (run.py)."""
import os
import sys

# Sanitizers are many times slower, and each path is wanted once: numbers of many meshes are held in release
SANITIZED = os.environ.get('CONFIG') in ('asan', 'tsan')
results = []


def report(name, good, said='', skip=None):
    """One result; `said` is printed below a bad one."""
    results.append(bool(good))
    print('%s %d - %s%s' % ('ok' if good else 'not ok', len(results), name, ' # SKIP ' + skip if skip else ''))
    if not good:
        note(said)
    sys.stdout.flush()


def note(said):
    """Text beside the results, at most its first lines."""
    for line in str(said)[:4000].splitlines()[:40]:
        print('# ' + line)


def finish():
    print('1..%d' % len(results))
    sys.exit(not all(results))
