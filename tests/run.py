#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Runs all tests of the given build configurations, five at a time, and ends with `N passed, N failed`.

A test is a program that speaks TAP: unit tests and fuzz replays built into build/CONFIG/tests, and tests/*/test_*
of .sh, .py and .mjs (for node), which find what they test in the environment (TETLOD the program, CONFIG, ROOT the
tree, SCRATCH an empty folder that is removed after success). A program without TAP output counts as one test by its
exit status.
"""
import argparse
import concurrent.futures
import glob
import os
import re
import shutil
import subprocess
import sys
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
PYTHONPATH = os.pathsep.join(os.path.join(ROOT, folder) for folder in ('tests', 'client-examples/python'))
LINE = re.compile(r'^(not ok|ok)\b(?: \d+)?(?: - )?(.*?)(?:\s+# (SKIP)\s*(.*))?$')
TIMING = re.compile(r'# [\d.]+ s$')


# What runs in several threads; the thread sanitizer stretches time so that it gets no more unless --every is given
THREADED = ('unit/test_cache', 'unit/test_forest', 'unit/test_site', 'http/test_large.py', 'http/test_faults.py')


def tests_of(config, configs, every):
    tests = all_tests_of(config, configs)
    return tests if config != 'tsan' or every else [path for path in tests if path.endswith(THREADED)]


FOLDERS = ('attack', 'oom', 'install', 'golden', 'web', 'clients', 'http', 'cli', 'unit', 'lint', 'fuzz')
ONCE = ('web', 'golden', 'attack', 'oom', 'lint', 'install', 'clients')  # the sanitizers would find nothing more
# Nor here: numbers of many meshes, of code that other tests run under them on a few
NUMBERS = ('unit/test_certificate', 'unit/test_promise', 'unit/test_thesis_example', 'cli/test_blunt_fin.py',
           'cli/test_build_memory.py', 'cli/test_io_memory.py', 'cli/test_sizes.py', 'cli/test_box_sums.py',
           'cli/test_promise.py', 'http/test_deploy.py')
# What comes of files, and what is refused: where the sanitizers look at it too, a second time tells nothing more
READS = ('cli/test_forged.py', 'cli/test_nan_fill.py', 'cli/test_topologies.py', 'cli/test_first_files.py',
         'cli/test_original_cells.py', 'cli/test_io_cells.py', 'cli/test_io_exodus.py', 'cli/test_io_lagrange.py',
         'cli/test_io_meshio.py', 'cli/test_io_round_trip.py', 'cli/test_io_units.py', 'cli/test_io_vtk.py',
         'cli/test_io_vtkxml.py')


def all_tests_of(config, configs):
    elsewhere = NUMBERS if config != 'release' else READS if 'asan' in configs else ()
    for folder in FOLDERS:
        if folder in ONCE and config != 'release':
            continue
        built = os.path.join(ROOT, 'build', config, 'tests', folder, 'fuzz_*' if folder == 'fuzz' else 'test_*')
        found = [path for path in sorted(glob.glob(built)) if not path.endswith(('.o', '.d'))]
        found += [path for path in sorted(glob.glob(os.path.join(ROOT, 'tests', folder, 'test_*')))
                  if path.endswith(('.sh', '.py', '.mjs'))]
        yield from (path for path in found if not path.endswith(elsewhere))


def in_turns(todo):
    """Every folder is spread over the whole: what waits for browsers and clocks runs beside what computes."""
    folders = {}
    for config, path in todo:
        folders.setdefault(os.path.basename(os.path.dirname(path)), []).append((config, path))
    placed = [(i / len(tests), test) for tests in folders.values() for i, test in enumerate(tests)]
    return [test for _, test in sorted(placed, key=lambda place: place[0])]


def run(config, path, timeout):
    name = '%s:%s' % (config, os.path.relpath(path, ROOT).replace('build/%s/' % config, ''))
    scratch = os.path.join(ROOT, 'build', 'scratch', name.replace('/', '_').replace(':', '_'))
    shutil.rmtree(scratch, ignore_errors=True)
    os.makedirs(scratch)
    environment = dict(os.environ, TETLOD=os.path.join(ROOT, 'build', config, 'tetlod'), CONFIG=config, ROOT=ROOT,
                       SCRATCH=scratch, LC_ALL='C.UTF-8', PYTHONPATH=PYTHONPATH,
                       ASAN_OPTIONS='allocator_may_return_null=1:detect_leaks=1:quarantine_size_mb=16'
                       ':handle_sigill=1')
    command = [path]
    if path.endswith('.py'):
        command = ['/usr/bin/python3', path]
    elif path.endswith('.sh'):
        command = ['bash', path]
    elif path.endswith('.mjs'):
        command = ['node', path]
    elif 'fuzz/fuzz_' in path:
        command.append(os.path.join(ROOT, 'tests/fuzz/corpus', os.path.basename(path)[len('fuzz_'):]))
    start = time.time()
    try:
        done = subprocess.run(command, cwd=scratch, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, timeout=timeout)
        output, code = done.stdout.decode(errors='replace'), done.returncode
    except subprocess.TimeoutExpired as stopped:
        output, code = (stopped.stdout or b'').decode(errors='replace') + '\nnot ok - finished in %d s' % timeout, 0
    found = [m.groups() for m in map(LINE.match, output.splitlines()) if m]
    if not found:
        found = [('ok' if code == 0 else 'not ok', os.path.basename(path), None, None)]
    elif code != 0 and all(f[0] == 'ok' for f in found):
        found.append(('not ok', 'exit status %d after its tests' % code, None, None))
    failed = sum(f[0] != 'ok' for f in found)
    if not failed:
        shutil.rmtree(scratch, ignore_errors=True)
    return name, found, failed, output, time.time() - start


def of_interest(lines):
    """Without times, without the good results that stand above the last lines, and without the ends of long ones."""
    lines = [line[:600] for line in lines if not TIMING.match(line)]
    above = [line for line in lines[:-20] if not re.match(r'ok\b', line)]
    return above[:60] + lines[-20:]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('configs', nargs='+')
    parser.add_argument('--only', help='run tests whose name has this in it')
    parser.add_argument('--every', action='store_true', help='with tsan: all tests, not only those of what has threads')
    parser.add_argument('--timeout', type=int, default=3000,
                        help='seconds; what takes minutes takes many on a busy machine')
    parser.add_argument('--jobs', type=int, default=5,
                        help='some more than cores, as some wait for a browser or a clock; many keep no caches warm')
    options = parser.parse_args()
    todo = [(c, p) for c in options.configs for p in tests_of(c, options.configs, options.every)
            if not options.only or options.only in c + ':' + p]
    todo = in_turns(todo)
    passed = skipped = 0
    failures = []
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        for name, found, failed, output, seconds in pool.map(lambda t: run(*t, options.timeout), todo):
            skips = [f for f in found if f[2]]
            print('%-4s %-50s %4d tests %7.1f s' % ('FAIL' if failed else 'ok', name, len(found), seconds))
            for f in skips:
                print('     skipped: %s (%s)' % (f[1], f[3]))
            if failed:
                print(''.join('     | %s\n' % line for line in of_interest(output.splitlines())), end='')
            sys.stdout.flush()
            failures += ['%s: %s' % (name, f[1]) for f in found if f[0] != 'ok']
            skipped += len(skips)
            passed += len(found) - failed - len(skips)
    for failure in failures:
        print('failed: ' + failure)
    print('%d passed, %d failed%s' % (passed, len(failures), ', %d skipped' % skipped if skipped else ''))
    return 1 if failures or not passed else 0


if __name__ == '__main__':
    sys.exit(main())
