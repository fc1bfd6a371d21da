#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""client-examples/curl.md and the C programs with libcurl: each command runs, and gives the level that it names."""
import os
import re
import subprocess
import sys

ROOT = os.environ['ROOT']
sys.path.insert(0, os.path.join(ROOT, 'tests', 'http'))
from served import SCRATCH, TETLOD, Server, run  # noqa: E402

FIN = os.path.join(SCRATCH, 'fin.tetlod')
EXAMPLES = os.path.join(ROOT, 'client-examples', 'c')


def shell(command, **more):
    done = subprocess.run(['bash', '-c', command], cwd=SCRATCH, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE,
                          text=True, **more)
    assert done.returncode == 0, (command, done)
    return done.stdout


def test_curl():
    with open(os.path.join(ROOT, 'client-examples', 'curl.md')) as page:
        commands = re.findall(r'^    (curl .*)$', page.read(), re.M)
    assert len(commands) > 10
    with Server(FIN) as server:
        said = [shell(c.replace('curl ', 'curl -sS --fail ', 1).replace('http://127.0.0.1:8080/',
                                                                        server.url)) for c in commands]
    assert '"Pressure"' in said[1] and any('Tetlod-Level: ' in text for text in said)
    for name in ('coarse.vtu', 'sampled.vtu', 'units.vtu', 'small.vtu', 'small.vtk', 'part.tetlod'):
        assert os.path.getsize(os.path.join(SCRATCH, name)) > 2000, name
    wanted = shell("'%s' extract fin.tetlod --error 1%% -o wanted.vtu 2>&1" % TETLOD)
    level = re.search(r'level (\d+) ', wanted)[1]
    assert 'levels 0 to %s of' % level in shell("'%s' info part.tetlod" % TETLOD)
    assert int(re.search(r'(\d+) tetrahedra',
                         shell("'%s' extract fin.tetlod --tets 3000 -o t.vtu 2>&1" % TETLOD))[1]) <= 3000


def test_c_programs():
    if subprocess.run(['pkg-config', '--exists', 'libcurl']).returncode:
        return 'libcurl is not installed'
    for name in ('fetch', 'refine', 'callback'):
        shell(
            "cc -std=c11 -Wall -Wextra -Werror -I'%s/format' '%s/%s.c' '%s' $(pkg-config --cflags --libs libcurl) -lm "
            "-o %s"
            % (ROOT, EXAMPLES, name, os.path.join(os.path.dirname(TETLOD), 'libtetlod.a'), name))
    said = shell("'%s' extract fin.tetlod --error 1%% -o wanted.vtu 2>&1" % TETLOD)
    level, vertices, tets = re.search(r'level (\d+) of \S+ (\d+) vertices, (\d+) tetrahedra', said).groups()
    wanted = 'level %s: %s vertices, %s tetrahedra' % (level, vertices, tets)
    with Server(FIN) as server:
        url = server.url + 'v1/meshes/fin'
        cid = server.json('/v1/meshes/fin')['cid']
        fetched, refined = shell('./fetch %s 0.01' % url), shell('./refine %s 0.01' % url)
        called = shell('./callback %s/%s/stream 0.01' % (url, cid))
        failed = subprocess.run(['./fetch', server.url + 'v1/meshes/none', '0.01'], cwd=SCRATCH,
                                stderr=subprocess.PIPE, text=True)
    assert fetched.startswith(wanted) and 'Pressure is at most' in fetched, fetched
    assert called.startswith(wanted), called
    levels = re.findall(r'^level (\d+): (\d+) tetrahedra', refined, re.M)
    assert [int(k) for k, _ in levels] == list(range(1, int(level) + 1)) and levels[-1][1] == tets, refined
    assert failed.returncode == 1 and 'response code' in failed.stderr, failed
    return None


subprocess.run([TETLOD, 'sample', 'fin', '--size', '14', '-o', 'fin.vtu'], cwd=SCRATCH, check=True)
subprocess.run([TETLOD, 'build', 'fin.vtu', '--field', 'Pressure', '-o', 'fin.tetlod', '--quiet'], cwd=SCRATCH,
               check=True)
run([test_curl, test_c_programs])
