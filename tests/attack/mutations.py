#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""usage: mutations.py FIRST COUNT [MESH...]

COUNT changed pages, shared by the eleven meshes of selections.py (or those named): of several fields, of a boundary
that moves, of regions with values of cells. tests/unit/test_page_mutation says what holds for each: it is refused, or
gives the same on several threads."""
import os
import subprocess
import sys
import tempfile

from features import TETLOD
from selections import MESHES, stream_of

TEST = os.path.join(os.path.dirname(TETLOD), 'tests', 'unit', 'test_page_mutation')


def mutate(stream, seed, count):
    """What the program says, and whether all is well."""
    done = subprocess.run([TEST], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          env=dict(os.environ, STREAM=stream, SEED=str(seed), MUTATIONS=str(count)))
    text = done.stdout.decode(errors='replace')
    return text, done.returncode == 0 and 'not ok' not in text


def main():
    first, count, names = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:] or list(MESHES)
    failures = 0
    for number, name in enumerate(names):
        share = count * (number + 1) // len(names) - count * number // len(names)
        with tempfile.TemporaryDirectory() as folder:
            stream = stream_of(name, folder, first)
            text, good = mutate(stream, first + number, share) if stream and share else ('# not there\n', True)
            print('%s: %s' % (name, text.splitlines()[0][2:] if good else text), flush=True)
            failures += not good
    print('%d changed pages, %d meshes with failures' % (count, failures))
    return 1 if failures else 0


if __name__ == '__main__':
    sys.exit(main())
