#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Debian packages, the source archive, a build without the server, and what a build says that something is missing."""
import glob
import os
import re
import shutil
import subprocess
import sys
import tarfile

ROOT, SCRATCH = os.environ['ROOT'], os.environ['SCRATCH']
sys.path.insert(0, os.path.join(ROOT, 'tests', 'http'))
from served import run  # noqa: E402


# Of a make that runs the tests nothing is left for those that they run
ALONE = {k: v for k, v in os.environ.items() if k not in ('MAKEFLAGS', 'MAKELEVEL', 'MFLAGS')}


def call(*command, cwd=SCRATCH, **more):
    return subprocess.run(command, cwd=cwd, env=dict(ALONE, **more), stdin=subprocess.DEVNULL,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          text=True)


def make(*arguments, **more):
    return call('make', '-s', '-C', ROOT, *arguments, **more)


def test_deb():
    """The packages unpack into a clean root; the program there passes the tests of everyday use. lintian has nothing to
    say."""
    if not shutil.which('dh'):
        return 'debhelper is not installed'
    done = make('deb', DEB_PACKING='-Zgzip -z1')
    assert done.returncode == 0, done.stdout
    packages = {
        os.path.basename(path).split('_')[0]: path for path in glob.glob(os.path.join(ROOT, 'build', 'deb', '*.deb'))
    }
    plugin = ['tetlod-paraview'] if glob.glob('/usr/lib/*/cmake/paraview-*') else []
    ranks = ['tetlod-mpi', 'libtetlod-mpi-dev'] if shutil.which('mpicc') else []
    wanted = ['libtetlod-dev', 'libtetlod0', 'python3-tetlod', 'tetlod', 'tetlod-doc', *ranks, *plugin]
    assert sorted(packages) == sorted(wanted), packages
    root = os.path.join(SCRATCH, 'root')
    for path in packages.values():
        assert call('dpkg-deb', '-x', path, root).returncode == 0
    control = call('dpkg-deb', '-f', packages['tetlod'], 'Depends').stdout
    assert 'libmicrohttpd' in control and 'libzstd' in control, control
    there = {os.path.relpath(os.path.join(folder, name), root) for folder, _, names in os.walk(root) for name in names}
    wanted = [
        r'usr/bin/tetlod', r'usr/share/doc/tetlod/notices\.txt(\.gz)?', r'lib/systemd/system/tetlod\.(service|socket)',
        r'usr/share/man/man1/tetlod\.1\.gz', r'usr/share/bash-completion/completions/tetlod',
        r'usr/lib/\S+/libtetlod(-build)?\.so\.0', r'usr/include/tetlod(_build)?\.h',
        r'usr/lib/\S+/pkgconfig/tetlod(-build)?\.pc', r'usr/lib/\S+/cmake/tetlod/tetlod-config\.cmake',
        r'usr/lib/python3/dist-packages/tetlod/tetlod_paraview\.py', r'usr/share/doc/tetlod/format/SPEC\.md',
        r'usr/share/doc/tetlod/examples/c/insitu_series\.c'
    ]
    wanted += [r'usr/bin/tetlod-mpi', r'usr/share/man/man1/tetlod-mpi\.1\.gz', r'usr/include/tetlod_mpi\.h',
               r'usr/lib/\S+/libtetlod-mpi\.a', r'usr/lib/\S+/pkgconfig/tetlod-mpi\.pc'] if ranks else []
    wanted += [r'usr/lib/\S+/paraview-\S+/plugins/TetlodReader/(TetlodReader|libvtkIOTetlod)\.so'] if plugin else []
    assert all(any(re.fullmatch(pattern, name) for name in there) for pattern in wanted), sorted(there)
    code = 'import tetlod, importlib.metadata as m; assert tetlod.__file__.startswith(%r); ' \
        'assert m.version("tetlod") == tetlod.__version__' % root
    done = call('/usr/bin/python3', '-c', code, PYTHONPATH=os.path.join(root, 'usr/lib/python3/dist-packages'))
    assert done.returncode == 0, done.stdout
    os.mkdir(os.path.join(SCRATCH, 'everyday'))
    done = call('/usr/bin/python3', os.path.join(ROOT, 'tests', 'cli', 'test_everyday.py'),
                TETLOD=os.path.join(root, 'usr', 'bin', 'tetlod'),
                SCRATCH=os.path.join(SCRATCH, 'everyday'))
    assert done.returncode == 0 and done.stdout.count('\nok ') > 5, done.stdout
    if ranks:
        done = call('/usr/bin/python3', os.path.join(ROOT, 'tests', 'cli', 'test_mpi.py'), ONLY='rank 0 speaks',
                    TETLOD=os.path.join(root, 'usr', 'bin', 'tetlod'), SCRATCH=os.path.join(SCRATCH, 'everyday'))
        good = 'ok 1 - rank 0 speaks\n' in done.stdout or 'mpirun runs nothing here' in done.stdout
        assert done.returncode == 0 and good, done.stdout
    if not shutil.which('lintian'):
        return 'lintian is not installed'
    done = call('lintian', '--allow-root', '--tag-display-limit', '0', *packages.values())
    assert done.returncode == 0 and not re.search(r'^[EWX]: ', done.stdout, re.M), done.stdout
    return None


def contents(folder):
    return {name: open(os.path.join(folder, name),
                       'rb').read() for name in os.listdir(folder) if name != 'embedded.c'}  # which has paths


def test_dist():
    """The archive has the page in it: what is embedded in the program is the same without npm, clang or a network."""
    if not os.path.exists(os.path.join(ROOT, '.git')):
        return 'this is no git checkout'
    done = make('dist')
    assert done.returncode == 0, done.stdout
    name = done.stdout.split()[-1]
    with tarfile.open(os.path.join(ROOT, name)) as archive:
        archive.extractall(SCRATCH)
    tree = os.path.join(SCRATCH, os.path.basename(name)[:-len('.tar.gz')])
    done = call('make', '-s', 'build/embedded/embedded.c', cwd=tree, WASM_CC='false',
                PATH=only('sh', 'make', 'python3', 'mkdir', 'sed', 'find', 'cc', 'zstd', 'pkg-config'))
    assert done.returncode == 0, done.stdout
    assert contents(os.path.join(tree, 'build', 'embedded')) == contents(os.path.join(ROOT, 'build', 'embedded'))
    asked = call('make', '-n', 'all', cwd=tree).stdout
    assert 'tetlod.1' not in asked and not re.search(r'npm|esbuild|wasm32', asked), asked[-3000:]
    return None


def test_without_server():
    done = make('SERVER=0', 'WEB=0', 'all')
    binary = os.path.join(ROOT, 'build', 'release', 'tetlod-alone')
    assert done.returncode == 0, done.stdout
    assert 'microhttpd' not in call('ldd', binary).stdout
    said = call(binary, 'help').stdout
    assert '  build ' in said and '  serve ' not in said and '  explode ' not in said, said
    assert call(binary, 'serve').returncode == 2


def only(*commands):
    """A folder for PATH that has these commands alone."""
    folder = os.path.join(SCRATCH, 'only-%d' % len(glob.glob(os.path.join(SCRATCH, 'only-*'))))
    os.mkdir(folder)
    for command in commands:
        os.symlink(shutil.which(command, path='/usr/bin:/bin'), os.path.join(folder, command))
    return folder


def test_needs():
    """Capabilities, not packages: without dpkg and apt a build knows what it has, and names what it lacks."""
    tools = ['sh', 'make', 'cc', 'ar', 'ld', 'objcopy', 'as', 'python3', 'sed', 'find', 'dirname', 'mkdir', 'cat',
             'id', 'zstd']
    done = make('needs', 'WEB=0', PATH=only(*tools, 'pkg-config'))
    assert done.returncode == 0, done.stdout
    done = make('needs', 'WEB=0', PATH=only(*tools))
    assert (done.returncode != 0 and 'pkg-config' in done.stdout and 'libmicrohttpd' in done.stdout
            and 'npm' not in done.stdout), done.stdout
    done = make('needs', 'WEB=0', 'SERVER=0', PATH=only(*tools))
    assert done.returncode != 0 and 'libmicrohttpd' not in done.stdout, done.stdout
    done = make('needs', PATH=only(*tools, 'pkg-config'))
    assert done.returncode != 0 and ' npm' in done.stdout, done.stdout


def test_a_bare_machine():
    """What is missing is said in one line, and before root installs it; nothing complains, not of a dry run either."""
    bare = ['sh', 'make', 'sed', 'find', 'dirname', 'mkdir', 'cat', 'id', 'python3', 'cmp']
    tree = os.path.join(SCRATCH, 'bare')
    shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns('build', '.git', 'node_modules'))
    for target in ('demo', 'check', 'all'):
        done = call('make', target, cwd=tree, PATH=only(*bare))
        said = done.stdout.splitlines()
        assert (done.returncode and said[0].startswith('make: this is missing: cc ')
                and len([line for line in said if '***' not in line]) == 1), done.stdout
        assert len(set(said[0].split())) == len(said[0].split()), said
    dry = subprocess.run(['make', '-n', 'all'], cwd=tree, env=dict(ALONE, PATH=only(*bare)),
                         stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    assert dry.stderr == b'', dry.stderr
    root = only(*bare)
    os.unlink(os.path.join(root, 'id'))
    for name, script in (('id', 'echo 0'), ('dpkg', 'exit 1'), ('grep', 'exit 1'),
                         ('apt-get', 'echo "$@" >> %s/installed; exit 1' % root)):
        with open(os.path.join(root, name), 'w') as file:
            file.write('#!/bin/sh\n%s\n' % script)
        os.chmod(os.path.join(root, name), 0o755)
    done = call('make', 'demo', cwd=tree, PATH=root)
    said = [line for line in done.stdout.splitlines() if '***' not in line]
    assert (len(said) == 1
            and said[0].startswith('make: installs as root, with apt-get, what is missing: gcc ')), done.stdout
    with open(os.path.join(root, 'installed')) as file:
        assert file.read() == 'update -qq\n'


def test_container():
    """The container file runs targets and copies paths that there are."""
    with open(os.path.join(ROOT, 'server', 'deploy', 'Containerfile')) as file:
        text = file.read()
    listed = call('make', '-s', '-C', ROOT, 'help').stdout
    targets = re.findall(r'(?:RUN|&&) make ([a-z][\w-]*)', text)
    assert targets and all(re.search(r'\b%s\b' % target, listed) for target in targets), targets
    assert 'build/deb' in text and 'ENTRYPOINT ["tetlod"' in text


run([test_deb, test_dist, test_without_server, test_needs, test_a_bare_machine, test_container])
