#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Which way of building leaves the fewest tetrahedra: percent left at an error of 0.1, 1 and 5 %, for every metric and
mesh.

usage: builder.py TETLOD [MESH...]. The error is the one that the way holds: `max`, but `sampled` for measured and
`predicted` for sva. Behind it the seconds of contracting.
"""
import sys

from builds import SAMPLES, build, left, mesh

WAYS = [('envelope (default)', 'max', []), ('field-quadric', 'max', ['--metric', 'field-quadric']),
        ('quadric', 'max', ['--metric', 'quadric']),
        ('exact', 'max', ['--certify', 'exact']), ('measured', 'sampled', ['--metric', 'measured']),
        ('sva', 'predicted', ['--metric', 'sva'])]
ERRORS = .001, .01, .05


def main():
    names = [name for name in sys.argv[2:] or ['blunt fin', *SAMPLES] if mesh(name)]
    print('| way | held | ' + ' | '.join(names) + ' |\n|---|---|' + '---|' * len(names))
    for way, measure, options in WAYS:
        print('| %s | `%s` |' % (way, measure), end='', flush=True)
        for name in names:
            index = build(name, '--max-error', '10%', *options)
            shown = ' / '.join('%.1f' % left(index, measure, error) for error in ERRORS)
            print(' %s (%.0f s) |' % (shown, index['seconds']['contract']), end='', flush=True)
        print(flush=True)


main()
