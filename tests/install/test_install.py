#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""make install into a scratch DESTDIR; the examples build against it by pkg-config, read and build streams; make uninstall. The Debian packages
have the same, and the program in them works."""
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
    return subprocess.run(command, env=environment, cwd=SCRATCH, input=input, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def make(target, stage):
    return run('make', '-s', '-C', ROOT, target, 'DESTDIR=' + stage, 'PREFIX=/usr')


def read(stage, path):
    with open(os.path.join(stage, path), encoding='utf-8') as file:
        return file.read()


def check_example(stage, tools, module, name, arguments):
    """The C example builds as its first comment says, against the shared and the static libraries, and gives the same with both."""
    said = []
    for kind, more in (('shared', []), ('static', ['--static'])):
        flags = shlex.split(run('pkg-config', '--cflags', '--libs', *more, module, **tools).stdout)
        if more:  # the archives by their names, as the linker prefers shared libraries
            flags = [os.path.join(stage, 'usr/lib/lib%s.a' % f[2:]) if f.startswith('-ltetlod') else f for f in flags]
        binary = os.path.join(SCRATCH, '%s_%s' % (name, kind))
        built = run('cc', '-std=gnu11', '-Wall', '-Wextra', '-Werror', '-o', binary, os.path.join(ROOT, 'client-examples', 'c', name + '.c'), *flags, '-lm')
        report('%s.c builds against the %s library' % (name, kind), built.returncode == 0, built.stderr)
        done = run(binary, *arguments, **(tools if not more else {}))
        made = [open(path, 'rb').read() for path in sorted(glob.glob(os.path.join(SCRATCH, 'step*.tetlod')))]
        said.append((done.returncode, done.stdout, made))
    report('%s gives the same with both' % name, said[0] == said[1] and said[0][0] == 0 and (said[0][1] or said[0][2]), said[0][:2])


def files(stage):
    return sorted(os.path.relpath(os.path.join(folder, name), stage) for folder, _, names in os.walk(stage) for name in names)


def main():
    stage = os.path.join(SCRATCH, 'stage')
    done = make('install', stage)
    report('make install', done.returncode == 0, done.stderr)
    there = files(stage)
    wanted = ['usr/bin/tetlod', 'usr/include/tetlod.h', 'usr/include/tetlod_build.h', 'usr/lib/libtetlod.a', 'usr/lib/libtetlod.so', 'usr/lib/libtetlod.so.0',
              'usr/lib/libtetlod-build.a', 'usr/lib/libtetlod-build.so', 'usr/lib/libtetlod-build.so.0', 'usr/lib/pkgconfig/tetlod.pc',
              'usr/lib/pkgconfig/tetlod-build.pc', 'usr/lib/systemd/system/tetlod.service', 'usr/lib/systemd/system/tetlod.socket',
              'usr/share/bash-completion/completions/tetlod', 'usr/share/man/man1/tetlod.1']
    report('what it installs', all(name in there for name in wanted), there)
    unit = read(stage, 'usr/lib/systemd/system/tetlod.service')
    report('the unit starts the installed program', 'ExecStart=/usr/bin/tetlod serve' in unit, unit)
    tools = {'PKG_CONFIG_PATH': os.path.join(stage, 'usr/lib/pkgconfig'), 'PKG_CONFIG_SYSROOT_DIR': stage,
             'PKG_CONFIG_ALLOW_SYSTEM_CFLAGS': '1', 'PKG_CONFIG_ALLOW_SYSTEM_LIBS': '1', 'LD_LIBRARY_PATH': os.path.join(stage, 'usr/lib')}
    version = run('pkg-config', '--modversion', 'tetlod', **tools).stdout.strip()
    report('the version is that of the header', version and '"%s"' % version in read(stage, 'usr/include/tetlod.h'), version)
    for module, name, arguments in (('tetlod', 'level', (os.path.join(ROOT, 'tests/golden/grid_float32.tetlod'), '0')), ('tetlod-build', 'insitu', ('.',))):
        check_example(stage, tools, module, name, arguments)
    done = run(os.path.join(stage, 'usr/bin/tetlod'), 'verify', 'step20.tetlod')
    report('what the example built is a valid stream', done.returncode == 0, done.stderr)
    if shutil.which('c++'):
        done = run('c++', '-x', 'c++', '-fsyntax-only', '-I' + os.path.join(stage, 'usr/include'), '-', input='#include <tetlod_build.h>\n')
        report('the headers are C++, too', done.returncode == 0, done.stderr)
    else:
        print('ok - the headers are C++, too # SKIP there is no C++ compiler')
    done = make('uninstall', stage)
    report('make uninstall leaves nothing', done.returncode == 0 and not files(stage), done.stderr + str(files(stage)))
    finish()


if __name__ == '__main__':
    main()
