#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""make install into a scratch DESTDIR; the examples build against it by pkg-config, read and build streams; make
uninstall. The Debian packages have the same, and the program in them works."""
import glob
import os
import shlex
import shutil
import subprocess

from tap import finish, report

ROOT, SCRATCH = os.environ['ROOT'], os.environ['SCRATCH']


def run(*command, input=None, **more):
    environment = dict(os.environ, **more)
    for name in ('MAKEFLAGS', 'MAKELEVEL', 'MFLAGS'):
        environment.pop(name, None)
    return subprocess.run(command, env=environment, cwd=SCRATCH, input=input, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, text=True)


def make(target, stage):
    return run('make', '-s', '-C', ROOT, target, 'DESTDIR=' + stage, 'PREFIX=/usr')


def read(stage, path):
    with open(os.path.join(stage, path), encoding='utf-8') as file:
        return file.read()


def check_example(stage, tools, module, name, arguments):
    """The C example builds as its first comment says, against the shared and the static libraries, and gives the same
    with both."""
    said = []
    for kind, more in (('shared', []), ('static', ['--static'])):
        flags = shlex.split(run('pkg-config', '--cflags', '--libs', *more, module, **tools).stdout)
        if more:  # the archives by their names, as the linker prefers shared libraries
            flags = [os.path.join(stage, 'usr/lib/lib%s.a' % f[2:]) if f.startswith('-ltetlod') else f for f in flags]
        binary = os.path.join(SCRATCH, '%s_%s' % (name, kind))
        built = run('cc', '-std=gnu11', '-Wall', '-Wextra', '-Werror', '-o', binary,
                    os.path.join(ROOT, 'client-examples', 'c', name + '.c'), *flags, '-lm')
        report('%s.c builds against the %s library' % (name, kind), built.returncode == 0, built.stderr)
        done = run(binary, *arguments, **(tools if not more else {}))
        made = [open(path, 'rb').read() for path in sorted(glob.glob(os.path.join(SCRATCH, 'step*.tetlod')))]
        said.append((done.returncode, done.stdout, made))
    report('%s gives the same with both' % name, said[0] == said[1] and said[0][0] == 0 and (said[0][1] or said[0][2]),
           said[0][:2])


CMAKE = '''cmake_minimum_required(VERSION 3.13)
project(user C)
find_package(tetlod %s REQUIRED)
foreach(kind "" "_static")
  add_executable(level${kind} %s/client-examples/c/level.c)
  target_link_libraries(level${kind} tetlod::tetlod${kind})
  add_executable(insitu${kind} %s/client-examples/c/insitu.c)
  target_link_libraries(insitu${kind} tetlod::build${kind} m)
endforeach()
'''


def check_cmake(stage):
    """find_package finds the stage wherever it lies; a version that is not there is refused."""
    if not shutil.which('cmake'):
        print('ok - find_package(tetlod) # SKIP cmake is not installed')
        return
    version = read(stage, 'usr/include/tetlod.h').split('TETLOD_VERSION_STRING "')[1].split('"')[0]
    for asked, good in (version, True), ('0.1', True), ('0.2', False), ('', True):
        folder = os.path.join(SCRATCH, 'cmake' + asked)
        os.mkdir(folder)
        with open(os.path.join(folder, 'CMakeLists.txt'), 'w') as file:
            file.write(CMAKE % (asked, ROOT, ROOT))
        done = run('cmake', '-S', folder, '-B', folder + '/build', '-DCMAKE_PREFIX_PATH=' + os.path.join(stage, 'usr'))
        report('find_package(tetlod %s) %s' % (asked, 'finds it' if good else 'does not'),
               (done.returncode == 0) == good,
               done.stderr)
    done = run('cmake', '--build', folder + '/build')
    report('its targets build the examples', done.returncode == 0, done.stdout + done.stderr)
    for kind in '', '_static':
        done = run(folder + '/build/level' + kind, os.path.join(ROOT, 'tests/golden/grid_float32.tetlod'), '0')
        report('level%s, which CMake built, reads a stream' % kind, done.returncode == 0 and done.stdout, done.stderr)


def files(stage):
    return sorted(os.path.relpath(os.path.join(folder, name), stage)
                  for folder, _, names in os.walk(stage) for name in names)


def main():
    stage = os.path.join(SCRATCH, 'stage')
    done = make('install', stage)
    report('make install', done.returncode == 0, done.stderr)
    there = files(stage)
    wanted = [
        'usr/bin/tetlod', 'usr/include/tetlod.h', 'usr/include/tetlod_build.h', 'usr/lib/libtetlod.a',
        'usr/lib/libtetlod.so', 'usr/lib/libtetlod.so.0', 'usr/lib/libtetlod-build.a', 'usr/lib/libtetlod-build.so',
        'usr/lib/libtetlod-build.so.0', 'usr/lib/pkgconfig/tetlod.pc', 'usr/lib/pkgconfig/tetlod-build.pc',
        'usr/lib/systemd/system/tetlod.service', 'usr/lib/systemd/system/tetlod.socket',
        'usr/lib/cmake/tetlod/tetlod-config.cmake', 'usr/share/bash-completion/completions/tetlod',
        'usr/share/man/man1/tetlod.1'
    ]
    report('what it installs', all(name in there for name in wanted), there)
    unit = read(stage, 'usr/lib/systemd/system/tetlod.service')
    report('the unit starts the installed program', 'ExecStart=/usr/bin/tetlod serve' in unit, unit)
    tools = {
        'PKG_CONFIG_PATH': os.path.join(stage, 'usr/lib/pkgconfig'), 'PKG_CONFIG_SYSROOT_DIR': stage,
        'PKG_CONFIG_ALLOW_SYSTEM_CFLAGS': '1', 'PKG_CONFIG_ALLOW_SYSTEM_LIBS': '1',
        'LD_LIBRARY_PATH': os.path.join(stage, 'usr/lib')
    }
    version = run('pkg-config', '--modversion', 'tetlod', **tools).stdout.strip()
    report('the version is that of the header', version and '"%s"' % version in read(stage, 'usr/include/tetlod.h'),
           version)
    golden = os.path.join(ROOT, 'tests/golden/grid_float32.tetlod')
    for module, name, arguments in (('tetlod', 'level', (golden, '0')), ('tetlod-build', 'insitu', ('.',)),
                                    ('tetlod-build', 'insitu_series', ('steps.tetlod',))):
        check_example(stage, tools, module, name, arguments)
    check_cmake(stage)
    for made in 'step20.tetlod', 'steps.tetlod':
        done = run(os.path.join(stage, 'usr/bin/tetlod'), 'verify', made)
        report('%s, which an example built, is a valid stream' % made, done.returncode == 0, done.stderr)
    report('it has its steps', ' 21 steps' in done.stdout, done.stdout)
    if shutil.which('c++'):
        done = run('c++', '-x', 'c++', '-fsyntax-only', '-I' + os.path.join(stage, 'usr/include'), '-',
                   input='#include <tetlod_build.h>\n')
        report('the headers are C++, too', done.returncode == 0, done.stderr)
    else:
        print('ok - the headers are C++, too # SKIP there is no C++ compiler')
    done = make('uninstall', stage)
    report('make uninstall leaves nothing', done.returncode == 0 and not files(stage), done.stderr + str(files(stage)))
    finish()


if __name__ == '__main__':
    main()
