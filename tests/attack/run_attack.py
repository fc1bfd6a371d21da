#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""usage: run_attack.py ATTACK PROGRAM FOLDER SEEDS [FIRST]

Runs the attack over SEEDS seeds, in chunks, one process a core. Prints every finding, and a summary by kind.
Exit status 1 if there is one, or if a process ends in another way than the attack does.
"""
import collections
import concurrent.futures
import os
import re
import subprocess
import sys

CHUNK = 10


def attack(command, program, folder, first, count):
    own = os.path.join(folder, 'seeds-%d' % first)
    os.makedirs(own, exist_ok=True)
    done = subprocess.run([command, program, own, str(first), str(count)], stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT)
    lines = done.stdout.decode(errors='replace').splitlines()
    if done.returncode not in (0, 1) or (done.returncode == 1) != bool(lines):
        lines.append('seed %d + %d: the attack: exit status %d' % (first, count, done.returncode))
    try:
        os.rmdir(own)
    except OSError:
        pass  # KEEP=1
    return lines


def main():
    command, program, folder, seeds = sys.argv[1:5]
    first = int(sys.argv[5]) if len(sys.argv) > 5 else 1
    starts = range(first, first + int(seeds), CHUNK)
    kinds = collections.Counter()
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        jobs = [pool.submit(attack, command, program, folder, s, min(CHUNK, first + int(seeds) - s)) for s in starts]
        for job in jobs:
            for line in job.result():
                found = re.match(r'seed (\d+) \(.*?\): ([a-z ]*):', line)
                kinds[found.group(2) if found else 'other'] += 1
                print(line, flush=True)
    for kind, count in sorted(kinds.items()):
        print('%6d %s' % (count, kind))
    print('%s seeds, %d findings' % (seeds, sum(kinds.values())))
    return 1 if kinds else 0


if __name__ == '__main__':
    sys.exit(main())
