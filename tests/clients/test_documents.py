#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The commands and the Python of the documents run as they stand, in order; the references name what there is, all of
it."""
import ast
import glob
import json
import os
import re
import subprocess
import sys

ROOT = os.environ['ROOT']
sys.path.insert(0, os.path.join(ROOT, 'tests', 'http'))
import described
from served import SCRATCH, TETLOD, Server, run  # noqa: E402

BUILT = os.path.dirname(TETLOD)
ENVIRONMENT = dict(os.environ, PATH=BUILT + ':' + os.environ['PATH'],
                   PYTHONPATH=os.path.join(ROOT, 'client-examples', 'python'),
                   TETLOD_LIBRARY=glob.glob(os.path.join(BUILT, 'libtetlod.so.*'))[0],
                   TETLOD_BUILD_LIBRARY=glob.glob(os.path.join(BUILT, 'libtetlod-build.so.*'))[0])
HERE = 'http://127.0.0.1:8080/'


def text(path):
    with open(os.path.join(ROOT, path), encoding='utf-8') as page:
        return page.read()


def place(name):
    folder = os.path.join(SCRATCH, name)
    os.mkdir(folder)
    return folder


def shell(command, folder):
    done = subprocess.run(['bash', '-c', command], cwd=folder, env=ENVIRONMENT, stdin=subprocess.DEVNULL,
                          stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, text=True)
    assert done.returncode == 0, (command, done)
    return done.stdout + done.stderr


def commands(page):
    """The indented lines, without what a comment says."""
    return [re.sub(r'\s+# .*', '', line) for line in re.findall(r'^    ((?:tetlod|curl) .*)$', page, re.M)]


def follow(page, folder, address=None):
    """Runs the commands in order; one that serves goes on until the end. Gives what they printed."""
    said, servers = [], []
    try:
        for command in commands(page):
            if command.startswith('tetlod serve '):
                servers.append(Server(*(os.path.join(folder, name) for name in command.split()[2:])))
                continue
            said.append(shell(command.replace(HERE, address or HERE).replace(HERE[:-1], (address or HERE)[:-1]),
                              folder))
    finally:
        for server in servers:
            server.stop()
    return said


def test_readme():
    page = text('README.md')
    section = page.split('\n## Your own mesh\n')[1].split('\n## ')[0]
    folder = place('readme')
    shell('tetlod sample fin --size 8 -o mesh.vtu', folder)
    assert len(follow(section, folder)) == 8
    series = text('client-examples/SERIES.md')
    assert len(follow(series.replace('--steps 32', '--size 5 --steps 8'), folder)) == 5
    assert os.path.getsize(os.path.join(folder, 'mail.tetlod')) < os.path.getsize(os.path.join(folder, 'part.tetlod'))
    code = re.search(r'```python\n(.*?)```', page, re.S)[1] + '\nassert mesh.error <= 0.01 and len(mesh.tets) > 100\n'
    done = subprocess.run(['/usr/bin/python3', '-c', code], cwd=folder, env=ENVIRONMENT, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 0, done.stdout


def test_tutorial():
    folder = place('tutorial')
    said = follow(text('client-examples/TUTORIAL.md').replace('--size 20', '--size 8'), folder)
    assert len(said) == 9 and os.path.exists(os.path.join(folder, 'site', 'index.html')), said
    maximum = re.search(r'max\D*([\d.e-]+) ?%', said[6])
    assert maximum and float(maximum[1]) <= 1, said[6]


def test_faq():
    folder = place('faq')
    shell('tetlod sample fin --size 6 -o mesh.vtu', folder)
    assert len(follow(text('client-examples/FAQ.md'), folder)) == 17


def test_http_guide():
    page, folder = text('server/HTTP.md'), place('http')
    shell('tetlod sample fin --size 12 -o fin.vtu && tetlod build fin.vtu --field Pressure -o fin.tetlod --quiet',
          folder)
    shell(
        'tetlod sample wake --size 6 --steps 3 -o run.pvd && tetlod build run.pvd --field Pressure -o run.tetlod '
        '--quiet',
        folder)
    with Server(os.path.join(folder, 'fin.tetlod'), os.path.join(folder, 'run.tetlod')) as server:
        said = follow(page, folder, server.url)
    names, heads = set(re.findall(r'`(Tetlod-[A-Za-z]+)`', page)), [text for text in said if text.startswith('HTTP/')]
    assert len(names) == 8 and len(heads) == 2 and all('303 See Other' in head for head in heads), heads
    assert (all(name in heads[1] for name in names)
            and all(name in heads[0]
                    for name in names - {'Tetlod-Band', 'Tetlod-Step', 'Tetlod-Topology', 'Tetlod-Time'})), heads
    assert (os.path.getsize(os.path.join(folder, 'step.vtu')) > 1000
            and os.path.getsize(os.path.join(folder, 'step.part')) > 1000)
    assert 'levels 0 to' in shell('tetlod info part.tetlod',
                                  folder) and os.path.getsize(os.path.join(folder, 'begin.tetlod')) == 20001
    assert json.loads(said[-1])['status'] == 400 and os.path.getsize(os.path.join(folder, 'near.vtu')) > 10000
    api = described.DOCUMENT
    assert not [path for path in api['paths'] if '`%s' % path.split('?')[0] not in page], 'a path is not in the guide'
    parameters = {p['name'] for p in api['components']['parameters'].values()}
    assert set(re.findall(r'[?&`](\w+)=', page)) <= parameters


def test_c_reference():
    named = set(re.findall(r'`(tetlod_\w+)`', text('client-examples/c/REFERENCE.md'))) - {
        'tetlod_status', 'tetlod_error', 'tetlod_build.h'
    }
    declared = set(re.findall(r'TETLOD_API [^;{]*?\b(tetlod_\w+)\s*\(',
                              text('format/tetlod.h') + text('src/library/tetlod_build.h')))
    assert named == declared, named ^ declared


def test_python_reference():
    page = text('client-examples/python/REFERENCE.md')
    package = os.path.join(ROOT, 'client-examples', 'python', 'tetlod')
    exported = ast.literal_eval(re.search(r'__all__ = (\[.*?\])', text('client-examples/python/tetlod/__init__.py'),
                                          re.S)[1])
    assert not [name for name in exported if '`%s' % name not in page and 'tetlod.%s' % name not in page]
    public = set()
    for name, module in (('Stream', '_stream'), ('Mesh', '_mesh')):
        tree = ast.parse(text(os.path.join(package, module + '.py')))
        body = next(node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == name).body
        public |= {n.name for n in body if isinstance(n, ast.FunctionDef)
                   } | {n.target.id for n in body if isinstance(n, ast.AnnAssign)}
    missing = [name for name in public if not name.startswith('_') and not re.search(r'`[^`]*\b%s\b' % name, page)]
    assert not missing, missing
    code = ''.join(re.findall(r'```python\n(.*?)```', page, re.S))
    made = 'import numpy as np\npoints = np.random.default_rng(1).random((4, 3))\ntets = [[0, 1, 2, 3]]\ntemperature = np.arange(4.0)\n'
    done = subprocess.run(['/usr/bin/python3', '-c', made + code + '\nassert len(mesh.tets) == 1\n'], env=ENVIRONMENT,
                          stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 0, done.stdout


def test_lines():
    """Documents can be read in a terminal: lines of text end at 300 characters, lines of the pages for users at 200 or
    so."""
    pages = [
        path for path in glob.glob(os.path.join(ROOT, '**/*.md'), recursive=True)
        if 'node_modules' not in path and '/build/' not in path[len(ROOT):]
    ]
    long = ['%s:%d' % (os.path.relpath(path, ROOT), number) for path in pages
            for number, line in enumerate(open(path, encoding='utf-8'), 1)
            if len(line) > 300 and not line.startswith('|') and not path.endswith('PROOF.md')]
    assert len(pages) > 15 and not long, long


run([test_readme, test_tutorial, test_faq, test_http_guide, test_c_reference, test_python_reference, test_lines])
