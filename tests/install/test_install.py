#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""make install into a scratch DESTDIR; a program built against it by pkg-config reads a stream; make uninstall."""
import os
import shlex
import subprocess

from tap import finish, report

ROOT, SCRATCH = os.environ['ROOT'], os.environ['SCRATCH']
PROGRAM = r'''
#include <fcntl.h>
#include <stdio.h>
#include <tetlod.h>
int main(int argc, char **argv)
{
    struct tetlod_file *file;
    struct tetlod_cursor *cursor;
    struct tetlod_mesh mesh;
    struct tetlod_error error;
    int fd = argc == 2 ? open(argv[1], O_RDONLY) : -1;
    if (tetlod_open_fd(&file, fd, NULL, &error) != TETLOD_OK)
        return fprintf(stderr, "%s\n", error.message), 1;
    const struct tetlod_info *info = tetlod_info(file);
    if (tetlod_cursor_new(&cursor, file, NULL, 0, &error) != TETLOD_OK ||
        tetlod_cursor_seek(cursor, info->level_count - 1, &error) != TETLOD_OK)
        return fprintf(stderr, "%s\n", error.message), 1;
    tetlod_cursor_mesh(cursor, &mesh);
    printf("%u %u\n", mesh.vertices, mesh.tets);
    tetlod_cursor_free(cursor);
    tetlod_close(file);
    return 0;
}
'''


def run(*command, **more):
    environment = dict(os.environ, **more)
    for name in ('MAKEFLAGS', 'MAKELEVEL', 'MFLAGS'):
        environment.pop(name, None)
    return subprocess.run(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def make(target, stage):
    return run('make', '-s', '-C', ROOT, target, 'DESTDIR=' + stage, 'PREFIX=/usr')


def files(stage):
    return sorted(os.path.relpath(os.path.join(folder, name), stage) for folder, _, names in os.walk(stage) for name in names)


def main():
    stage = os.path.join(SCRATCH, 'stage')
    done = make('install', stage)
    report('make install', done.returncode == 0, done.stderr)
    there = files(stage)
    wanted = ['usr/bin/tetlod', 'usr/include/tetlod.h', 'usr/lib/libtetlod.a', 'usr/lib/libtetlod.so', 'usr/lib/libtetlod.so.0',
              'usr/lib/pkgconfig/tetlod.pc', 'usr/share/man/man1/tetlod.1']
    report('what it installs', all(name in there for name in wanted), there)
    tetlod = os.path.join(stage, 'usr/bin/tetlod')
    mesh, stream = os.path.join(SCRATCH, 'cube.vtu'), os.path.join(SCRATCH, 'cube.tetlod')
    run(tetlod, 'sample', 'cube', '--size', '4', '-o', mesh)
    done = run(tetlod, 'build', mesh, '-o', stream, '--quiet')
    report('the installed program builds a stream', done.returncode == 0, done.stderr)
    tools = {'PKG_CONFIG_PATH': os.path.join(stage, 'usr/lib/pkgconfig'), 'PKG_CONFIG_SYSROOT_DIR': stage,
             'PKG_CONFIG_ALLOW_SYSTEM_CFLAGS': '1', 'PKG_CONFIG_ALLOW_SYSTEM_LIBS': '1'}
    with open(os.path.join(SCRATCH, 'program.c'), 'w', encoding='utf-8') as file:
        file.write(PROGRAM)
    for name, more in (('shared', []), ('static', ['--static'])):
        flags = run('pkg-config', '--cflags', '--libs', *more, 'tetlod', **tools)
        binary = os.path.join(SCRATCH, name)
        arguments = shlex.split(flags.stdout)
        if more:  # the archive by its name, as the linker prefers the shared library
            arguments = [os.path.join(stage, 'usr/lib/libtetlod.a') if a == '-ltetlod' else a for a in arguments]
        done = run('cc', '-o', binary, os.path.join(SCRATCH, 'program.c'), *arguments)
        report('a program builds against the %s library' % name, flags.returncode == 0 and done.returncode == 0,
               flags.stderr + done.stderr)
        done = run(binary, stream, LD_LIBRARY_PATH=os.path.join(stage, 'usr/lib') if not more else '')
        report('and reads the stream with it', done.stdout == '125 384\n', done.stdout + done.stderr)
    done = make('uninstall', stage)
    report('make uninstall leaves nothing', done.returncode == 0 and not files(stage), done.stderr + str(files(stage)))
    finish()


if __name__ == '__main__':
    main()
