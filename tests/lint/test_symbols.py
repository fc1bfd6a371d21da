#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Headers stand alone; what the library exports is tetlod_*; no object has data that changes."""
import concurrent.futures
import glob
import os
import re
import shutil
import subprocess

from lint_report import ROOT, finish, output, report

BUILT = os.path.join(ROOT, 'build', os.environ['CONFIG'])

HDF5 = subprocess.run(['pkg-config', '--cflags', 'hdf5'], stdout=subprocess.PIPE,
                      text=True).stdout.split()  # not where headers are


def complaint(compiler, language, standard, header):
    """Complaints of a compiler about a file that includes nothing but the header, twice."""
    name = os.path.relpath(header, ROOT)
    done = subprocess.run([compiler, '-x', language, '-std=' + standard, '-fsyntax-only', '-Wall', '-Wextra',
                           '-I' + ROOT,
                           '-D_POSIX_C_SOURCE=200809L', *HDF5, '-'], input='#include "%s"\n' % name * 2, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    lines = [line for line in done.stdout.splitlines() if 'defined but not used' not in line]
    return ['%s: %s' % (name, line) for line in lines[:5]] if done.returncode or 'warning:' in ' '.join(lines) else []


def check_headers():
    headers = sorted(sum((glob.glob(os.path.join(ROOT, folder, '*.h')) for folder in (
        'format', 'format/*', 'src/*', 'src/*/*', 'server', 'server/*', 'server/web/wasm')), []))
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        found = sum(pool.map(lambda h: complaint('cc', 'c', 'c11', h), headers), [])
    report('each of %d headers compiles alone' % len(headers), found if headers else ['there are none'])
    public = os.path.join(ROOT, 'format/tetlod.h')
    compiler = next((c for c in ('c++', 'g++', 'clang++') if shutil.which(c)), None)
    if compiler:
        report('tetlod.h is C++, too', complaint(compiler, 'c++', 'c++11', public))
    else:
        print('ok - tetlod.h is C++, too # SKIP no C++ compiler')


def defined(*arguments):
    """Names of the external symbols defined in an object or a library."""
    return [line.split()[-1] for line in output('nm', *arguments).splitlines() if re.match(r'[0-9a-f]+ [A-Z] ', line)]


def check_exports():
    shared = [path for path in glob.glob(os.path.join(BUILT, 'libtetlod.so.*')) if not os.path.islink(path)]
    exported = defined('-D', '--defined-only', shared[0])
    report('the shared library exports tetlod_ alone', [name for name in exported if not name.startswith('tetlod_')])
    with open(os.path.join(ROOT, 'format/tetlod.h'), encoding='utf-8') as file:
        header = re.sub(r'/\*.*?\*/', '', file.read(), flags=re.S)
    declared = set(re.findall(r'TETLOD_API [^;{]*?\b(tetlod_\w+)\s*\(', header))
    report('and what tetlod.h declares, all of it', sorted(declared.symmetric_difference(exported)))
    series = {'tetlod_build_series_' + name for name in ('new', 'add', 'finish', 'free')}
    building = {'tetlod_build', 'tetlod_build_defaults', *series}
    for library in (['-D', shared[0].replace('libtetlod.so', 'libtetlod-build.so')],
                    [os.path.join(BUILT, 'libtetlod-build.a')]):
        report('%s exports what tetlod_build.h declares' % os.path.basename(library[-1]),
               sorted(building.symmetric_difference(defined(*library, '--defined-only'))))
    names = defined('--defined-only', os.path.join(BUILT, 'libtetlod.a'))
    report('the static library takes no other names', [name for name in names if not re.match('tetlodi?_', name)])


# malloc is called without a context
EXCEPT = {'src/cli/scratch_memory.o', 'src/cli/spare_files.o'}


def check_data():
    found = []
    for path in [path for top in ('format', 'src', 'server')
                 for path in glob.glob(os.path.join(BUILT, top, '**/*.o'), recursive=True)]:
        source = os.path.join(ROOT, os.path.relpath(path, BUILT)[:-2] + '.c')
        if not os.path.exists(source):
            continue
        for section, size in re.findall(r'^(\.(?:data|bss|tdata|tbss)(?:\.(?!rel\.ro)\S+)?)\s+(\d+)',
                                        output('size', '-A', path), re.M):
            if int(size) and os.path.relpath(path, BUILT) not in EXCEPT:
                found.append('%s has %s bytes of %s' % (os.path.relpath(path, BUILT), size, section))
    report('no object has data that changes', found)


check_headers()
check_exports()
check_data()
finish()
