#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""`make amalgamation`: tetlod.c compiles as a stranger would compile it, as C and as C++, without the tree; golden
streams decode to the same arrays; the example in tetlod.h is true."""
import glob
import os
import re
import shutil
import subprocess

from tap import finish, report

ROOT, SCRATCH = os.environ['ROOT'], os.environ['SCRATCH']
HERE = os.path.join(SCRATCH, 'alone')
STREAMS = sorted(glob.glob(os.path.join(ROOT, 'tests', 'golden', '*.tetlod')))
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
    strict = ['-Wall', '-Wextra', '-Werror']
    ran('cc -O3 -march=native -Wall -Wextra', 'cc', '-O3', '-march=native', *strict, '-c', 'tetlod.c', '-o', 'c.o')
    ran('no file of the tree is needed', 'grep', '-c', '#include "tetlod.h"', 'tetlod.c')
    golden = os.path.join(ROOT, 'tests', 'unit', 'test_golden.c')
    libraries = ['-pthread', '-lm']
    ran('the test of golden streams links with it alone', 'cc', '-I', ROOT, golden, 'c.o', *libraries, '-o', 'golden')
    said = subprocess.run([os.path.join(HERE, 'golden')], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          text=True)
    report('golden streams decode to the same arrays', said.returncode == 0 and 'ok 1' in said.stdout, said.stdout)
    ran('the example of tetlod.h compiles', 'cc', *strict, 'example.c', 'c.o', *libraries, '-o', 'example')
    level = os.path.join(ROOT, 'client-examples', 'c', 'level.c')
    ran('an example of a program, too', 'cc', '-I.', level, 'c.o', *libraries, '-o', 'level')
    answers = {name: (run('./example', name).stdout, run('./level', name, '0.01').stdout) for name in STREAMS}
    good = [name for name, said in answers.items() if re.match(r'[1-9]\d* [1-9]\d* \n', said[0])]
    report('and the example reads %d of %d golden streams' % (len(good), len(STREAMS)), len(good) > 5, answers)
    if not shutil.which('c++'):
        report('as C++', True, skip='there is no C++ compiler')
        return finish()
    ran('c++ -std=gnu++11', 'c++', '-std=gnu++11', '-x', 'c++', '-fsyntax-only', 'tetlod.c')
    ran('c++ -std=gnu++20', 'c++', '-O1', '-std=gnu++20', '-x', 'c++', '-c', 'tetlod.c', '-o', 'cpp.o')
    ran('the example with it', 'c++', 'example.c', '-x', 'none', 'cpp.o', '-pthread', '-o', 'example_cpp')
    ran('and the program', 'cc', '-I.', level, 'cpp.o', *libraries, '-lstdc++', '-o', 'level_cpp')
    again = {name: (run('./example_cpp', name).stdout, run('./level_cpp', name, '0.01').stdout) for name in STREAMS}
    report('what C++ made says the same', again == answers, (again, answers))
    return finish()


main()
