#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The Python package installs into a clean environment without a network, from the tree, from its sdist and as a wheel.
"""
import glob
import os
import shutil
import subprocess
import tarfile
import zipfile

from tap import finish, report

ROOT, SCRATCH = os.environ['ROOT'], os.environ['SCRATCH']
OFFLINE = ['--no-index', '--no-build-isolation', '--no-deps', '--disable-pip-version-check', '-q']
# Every warning about pip's cache or its user is noise here
ENVIRONMENT = {k: v for k, v in os.environ.items() if not k.startswith(('PYTHON', 'PIP_', 'VIRTUAL_ENV', 'TETLOD'))}
ENVIRONMENT.update(PIP_NO_CACHE_DIR='1', PIP_ROOT_USER_ACTION='ignore', TETLOD_LIBRARY='')


def run(*command, **more):
    return subprocess.run(command, env=ENVIRONMENT, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, **more)


def step(name, done, good=True):
    """What follows needs it: the test ends where it is bad."""
    good = good and done.returncode == 0
    report(name, good, done.stdout)
    if not good:
        finish()


def main():
    source = shutil.copytree(os.path.join(ROOT, 'client-examples', 'python'), os.path.join(SCRATCH, 'source'),
                             ignore=shutil.ignore_patterns('build', '*.egg-info', '__pycache__', '.mypy_cache'))
    python = os.path.join(SCRATCH, 'environment', 'bin', 'python')
    pip = ['/usr/bin/python3', '-m', 'pip', '--python', python, 'install']
    step('a virtual environment',
         run('/usr/bin/python3', '-m', 'venv', '--without-pip', '--system-site-packages',
             os.path.join(SCRATCH, 'environment')))
    step('pip install .', run(*pip, *OFFLINE, '.', cwd=source))
    code = 'import tetlod; print(tetlod.__file__); print(len(tetlod.read(%r).tets)); import importlib.metadata as m; ' \
        'e, = [e for e in m.entry_points(group="pyvista.readers") if e.name == ".tetlod"]; print(e.load().__name__)' % \
        os.path.join(ROOT, 'tests', 'golden', 'grid_float32.tetlod')
    done = run(python, '-c', code, cwd=SCRATCH)
    step('it reads a stream, and PyVista finds it', done, 'environment' in done.stdout and
         'read_pyvista' in done.stdout)
    backend = 'import setuptools.build_meta as b; print(b.build_sdist("dist")); print(b.build_wheel("dist"))'
    step('sdist and wheel', run('/usr/bin/python3', '-c', backend, cwd=source))
    wheel, = glob.glob(os.path.join(source, 'dist', 'tetlod-*-py3-none-any.whl'))
    sdist, = glob.glob(os.path.join(source, 'dist', 'tetlod-*.tar.gz'))
    names = zipfile.ZipFile(wheel).namelist()
    modules = {'tetlod/' + name for name in os.listdir(os.path.join(source,
                                                                    'tetlod')) if not name.startswith('__pycache__')}
    step('the wheel has every module and the mark of its types', done, modules <= set(names) and
         'tetlod/py.typed' in names)
    with tarfile.open(sdist) as archive:
        archive.extractall(SCRATCH)
    unpacked = sdist[:-len('.tar.gz')].replace(os.path.join(source, 'dist'), SCRATCH)
    step('the sdist installs', run(*pip, '--force-reinstall', *OFFLINE, '.', cwd=unpacked))
    step('and so does the wheel', run(*pip, '--force-reinstall', *OFFLINE, wheel))
    with open(os.path.join(ROOT, 'format', 'tetlod.h')) as header:
        version = header.read().split('TETLOD_VERSION_STRING "')[1].split('"')[0]
    done = run(
        python, '-c',
        'import tetlod, importlib.metadata as m; assert tetlod.__version__ == m.version("tetlod") == %r' % version,
        cwd=SCRATCH)
    step('its version is that of the library', done)
    finish()


main()
