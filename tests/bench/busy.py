#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""usage: busy.py PROGRAM [MESH]...

Prints what two threads gain where other programs want the processor, too: wall seconds of a build on one and on two
threads, in turn, alone and beside BUSY=n endless loops (1), as one piece and in pages of PAGE=n tetrahedra (40000).
MESH is a sample as NAME:SIZE. REPEAT=n takes medians (5).
"""
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, contextmanager

PROGRAM = os.path.abspath(sys.argv[1])
MESHES = sys.argv[2:] or ['cube:60']
REPEAT = int(os.environ.get('REPEAT', '5'))
BUSY = int(os.environ.get('BUSY', '1'))
PAGE = os.environ.get('PAGE', '40000')


def run(*command):
    done = subprocess.run([PROGRAM, *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        sys.exit('tetlod %s: %s' % (' '.join(command), done.stderr.strip()))
    return done.stdout


@contextmanager
def endless_loop():
    loop = subprocess.Popen([sys.executable, '-c', 'while True: pass'])
    try:
        yield
    finally:
        loop.kill()
        loop.wait()


def build(path, threads, out, options):
    """Wall seconds of the whole and of contracting."""
    start = time.perf_counter()
    told = json.loads(run('build', path, '-o', out, '--json', '--quiet', '--threads', str(threads), *options))
    return time.perf_counter() - start, told['seconds']['contract']


def bench(path, kind, options, loops, folder):
    seconds = {1: [], 2: []}
    with ExitStack() as others:
        for _ in range(loops):
            others.enter_context(endless_loop())
        for _ in range(REPEAT):
            for threads, all_times in seconds.items():
                all_times.append(build(path, threads, os.path.join(folder, 'out.tetlod'), options))
    whole, contract = ({threads: statistics.median(times[k] for times in all_times)
                        for threads, all_times in seconds.items()} for k in (0, 1))
    gains = sorted(one[0] / two[0] for one, two in zip(seconds[1], seconds[2]))
    print('  %s, %-14s one thread %.2f s, two %.2f s: %.2f x (%.2f - %.2f); contracting %.2f x' % (
        kind, 'alone' if not loops else 'beside %d busy' % loops, whole[1], whole[2], statistics.median(gains),
        gains[0], gains[-1], contract[1] / contract[2]), flush=True)


def main():
    with tempfile.TemporaryDirectory() as folder:
        for mesh in MESHES:
            name, _, size = mesh.partition(':')
            path = os.path.join(folder, name + '.vtu')
            run('sample', name, *(['--size', size] if size else []), '-o', path)
            print(mesh)
            for kind, options in ('one piece', []), ('in pages ', ['--paged=' + PAGE]):
                for loops in 0, BUSY:
                    bench(path, kind, options, loops, folder)


main()
