#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What a level takes in Python: python_client.py TETLOD LIBRARY. The blunt fin, or the sample fin where that is not
there: the whole stream and the level at 1 %, of the file and of a server, by libtetlod and by the decoder in Python.
Seconds on the clock, the least of several: the machine should have nothing else to do."""
import os
import subprocess
import sys
import time

from builds import TETLOD, mesh, place
from served_process import Server

os.environ['TETLOD_LIBRARY'] = sys.argv[2]
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..', 'client-examples', 'python'))
import tetlod  # noqa: E402


def least(times, source, decoder, error):
    """The least time of several reads, and the last level."""
    found = []
    for _ in range(times):
        start = time.perf_counter()
        level = tetlod.read(source, error, decoder=decoder)
        found.append(time.perf_counter() - start)
    return min(found), level


def main():
    stream = os.path.join(place.name, 'fin.tetlod')
    subprocess.run([TETLOD, 'build', *(mesh('blunt fin') or mesh('fin')), '-o', stream, '--quiet'], check=True)
    with Server(TETLOD, stream) as server:
        url = 'http://127.0.0.1:%d/v1/meshes/fin' % server.port
        for decoder, times in (('library', 9), ('python', 2)):
            for error in (None, 0.01):
                for what, source in (('file', stream), ('server', url)):
                    seconds, level = least(times, source, decoder, error)
                    print('%-8s %-7s %-6s %7d tetrahedra %8.3f s' % (decoder, '1 %' if error else 'whole', what,
                                                                     len(level.tets), seconds))


main()
