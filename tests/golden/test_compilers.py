#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""`make amalgamation`: tetlod.c compiles as a stranger would compile it, as C and as C++, by other compilers and for
another machine, without the tree and the project's flags. Golden streams decode to the same arrays, or it refuses; the
example in tetlod.h is true."""
import glob
import os
import platform
import re
import shutil
import subprocess

from tap import finish, report

ROOT, SCRATCH = os.environ['ROOT'], os.environ['SCRATCH']
HERE = os.path.join(SCRATCH, 'alone')
STREAMS = sorted(glob.glob(os.path.join(ROOT, 'tests', 'golden', '*.tetlod')))
GOLDEN = os.path.join(ROOT, 'tests', 'unit', 'test_golden.c')
LIBRARIES = ['-pthread', '-lm']
EXAMPLE = '''#include "tetlod.h"
#include <fcntl.h>
#include <stdio.h>

int main(int argc, char **argv)
{
    const char *path = argv[argc - 1];
%s
    printf("%%u %%u %%s\\n", mesh.vertices, mesh.tets, error.message);
    tetlod_cursor_free(cursor);
    tetlod_close(file);
    return status != TETLOD_OK;
}
'''


def run(*command, **more):
    return subprocess.run(command, cwd=HERE, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          text=True, **more)


def ran(what, *command, **more):
    done = run(*command, **more)
    report(what, done.returncode == 0 and 'warning:' not in done.stdout, done.stdout)
    return done.stdout


def decodes(what, compiler, flags, emulator=()):
    """The test of golden streams, with tetlod.c by a compiler."""
    if not shutil.which(compiler) or emulator and not shutil.which(emulator[0]):
        return report(what, True, skip='%s is not there (make deps-check)' % compiler)
    done = run(compiler, *flags, '-I', ROOT, GOLDEN, 'tetlod.c', *LIBRARIES, '-o', 'decode')
    if done.returncode == 0:
        done = run(*emulator, './decode')
    return report(what, done.returncode == 0 and 'ok 1' in done.stdout, done.stdout or 'no output')


def other_compilers():
    decodes('clang -O3 -march=native', 'clang', ['-O3', '-march=native'])
    if platform.machine() == 'x86_64' and shutil.which('gcc'):
        # what -march=native means on newer machines: FLT_EVAL_METHOD is 16 (only compiled: older ones do not run it)
        ran('gcc -mavx512fp16', 'gcc', '-mavx512fp16', '-fsyntax-only', 'tetlod.c')
    else:
        report('gcc -mavx512fp16', True, skip='no gcc, or not an x86-64 machine')
    decodes('32 bits, big-endian (PowerPC)', 'powerpc-linux-gnu-gcc', ['-O1', '-static'], ['qemu-ppc'])
    for flag in ('-ffast-math', '-fassociative-math -fno-signed-zeros -fno-trapping-math'):
        for compiler in ('gcc', 'clang'):
            if shutil.which(compiler) and (compiler == 'gcc' or flag == '-ffast-math'):
                done = run(compiler, *flag.split(), '-fsyntax-only', 'tetlod.c')
                report('%s %s is refused' % (compiler, flag), done.returncode and
                       'tetlod must not be compiled' in done.stdout, done.stdout)
    if not shutil.which('clang') or 'fma' not in open('/proc/cpuinfo').read():
        return report('clang -ffp-contract=fast', True, skip='no clang, or no fused multiply-add here')
    # this option overrides what the sources ask for: the probe finds it when a stream is opened
    fused = ['-O1', '-mfma', '-ffp-contract=fast']
    built = run('clang', *fused, '-I', ROOT, GOLDEN, 'tetlod.c', *LIBRARIES, '-o', 'fused')
    done = run('./fused')
    return report('clang -ffp-contract=fast: right, or refused', built.returncode == 0 and 'hashes' not in done.stdout,
                  built.stdout + done.stdout)


def main():
    environment = {name: value for name, value in os.environ.items() if not name.startswith(('MAKE', 'MFLAGS'))}
    done = subprocess.run(['make', '-s', '-C', ROOT, 'amalgamation'], env=environment, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True)
    report('make amalgamation', done.returncode == 0, done.stdout)
    shutil.copytree(os.path.join(ROOT, 'build', 'amalgamation'), HERE)
    with open(os.path.join(HERE, 'tetlod.h'), encoding='utf-8') as file:
        lines = re.search(r'An example:.*?\n \*\n(.*?)\n \*\n', file.read(), re.S)[1].splitlines()
    with open(os.path.join(HERE, 'example.c'), 'w') as file:
        file.write(EXAMPLE % '\n'.join(line[3:] for line in lines))
    other_compilers()
    strict = ['-Wall', '-Wextra', '-Werror']
    ran('cc -O3 -march=native -Wall -Wextra', 'cc', '-O3', '-march=native', *strict, '-c', 'tetlod.c', '-o', 'c.o')
    ran('no file of the tree is needed', 'grep', '-c', '#include "tetlod.h"', 'tetlod.c')
    ran('the test of golden streams links with it alone', 'cc', '-I', ROOT, GOLDEN, 'c.o', *LIBRARIES, '-o', 'golden')
    said = run('./golden')
    report('golden streams decode to the same arrays', said.returncode == 0 and 'ok 1' in said.stdout, said.stdout)
    ran('the example of tetlod.h compiles', 'cc', *strict, 'example.c', 'c.o', *LIBRARIES, '-o', 'example')
    level = os.path.join(ROOT, 'client-examples', 'c', 'level.c')
    ran('an example of a program, too', 'cc', '-I.', level, 'c.o', *LIBRARIES, '-o', 'level')
    answers = {name: (run('./example', name).stdout, run('./level', name, '0.01').stdout) for name in STREAMS}
    good = [name for name, said in answers.items() if re.match(r'[1-9]\d* [1-9]\d* \n', said[0])]
    report('and the example reads %d of %d golden streams' % (len(good), len(STREAMS)), len(good) > 5, answers)
    if not shutil.which('c++'):
        report('as C++', True, skip='there is no C++ compiler')
        return finish()
    ran('c++ -std=gnu++11', 'c++', '-std=gnu++11', '-x', 'c++', '-fsyntax-only', 'tetlod.c')
    ran('c++ -std=gnu++20', 'c++', '-O1', '-std=gnu++20', '-x', 'c++', '-c', 'tetlod.c', '-o', 'cpp.o')
    ran('the example with it', 'c++', 'example.c', '-x', 'none', 'cpp.o', '-pthread', '-o', 'example_cpp')
    ran('and the program', 'cc', '-I.', level, 'cpp.o', *LIBRARIES, '-lstdc++', '-o', 'level_cpp')
    again = {name: (run('./example_cpp', name).stdout, run('./level_cpp', name, '0.01').stdout) for name in STREAMS}
    report('what C++ made says the same', again == answers, (again, answers))
    return finish()


main()
