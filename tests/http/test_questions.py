#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Questions over HTTP: the same answers as `tetlod ask`, statuses, conditions."""
import json
import os
import re
import subprocess
import urllib.parse
from concurrent.futures import ThreadPoolExecutor

try:
    import numpy as np
    import vtk_box
    from vtk.util.numpy_support import vtk_to_numpy
except ImportError:
    vtk_box = None
from served import SCRATCH, TETLOD, Server, run

FOLDER = os.path.join(SCRATCH, 'streams')
STREAM = os.path.join(FOLDER, 'fin.tetlod')
SERIES = os.path.join(FOLDER, 'wake.tetlod')
QUESTIONS = ('mean(Pressure)', 'volume(Pressure > 3)', 'quantile(Pressure, 0.9)', 'max(|Velocity|)', 'volume()',
             'max(Pressure) < 3', 'mean(Pressure) in box(-1,0,0, 1,1,1)', 'Pressure at (1,1,1)')


def path(question, form=urllib.parse.quote, **more):
    return '/v1/meshes/fin/ask?' + '&'.join('%s=%s' % (name, form(text))
                                            for name, text in {'q': question, **more}.items())


def answer(text):
    """Without the question, in which a form's '+' may stand for a blank."""
    return {name: value for name, value in json.loads(text).items() if name != 'question'}


def test_answers():
    with Server(FOLDER) as server:
        for question in QUESTIONS:
            said = subprocess.run([TETLOD, 'ask', STREAM, question, '--within', '2%', '--json'],
                                  stdout=subprocess.PIPE).stdout
            for form in (urllib.parse.quote_plus, urllib.parse.quote):
                status, head, body = server.get(path(question, form, within='2%'))
                assert status == 200 and answer(body) == answer(said), (question, status, body, said)
            assert server.get(path(question, within='2%'), If_None_Match=head['etag'])[0] == 304
        tags = {server.get(path(question))[1]['etag'] for question in QUESTIONS}
        assert len(tags) == len(QUESTIONS), tags


def test_kept_levels():
    """Levels that one question decoded answer the next ones, also several at a time, with and without a field."""
    with Server(FOLDER) as server, ThreadPoolExecutor(4) as threads:
        asked = [(question, '2.%06d%%' % n) for n in range(4) for question in QUESTIONS]
        given = list(threads.map(lambda one: server.get(path(one[0], within=one[1])), asked))
        assert all(status == 200 for status, _, _ in given), given
        first = {question: answer(body) for (question, _), (_, _, body) in zip(asked, given[:len(QUESTIONS)])}
        for (question, _), (_, _, body) in zip(asked, given):
            assert answer(body) == first[question], (question, body)
        # a field that has the same place in the level, and other values
        for component in range(3):
            question = 'mean(Velocity:%d) in box(-1,0,0, 1,1,1)' % component
            said = subprocess.run([TETLOD, 'ask', STREAM, question, '--within', '1e-9', '--json'],
                                  stdout=subprocess.PIPE)
            assert answer(server.get(path(question, within='1e-9'))[2]) == answer(said.stdout), question


def test_exact():
    """Exact answers look into few blocks of the original: held against its tetrahedra, cut by VTK."""
    box = ' in box(2.5,3,1, 9,7.25,10)'
    asked = [kind % ('xyz', where) for kind in ('mean(%s)%s', 'min(%s)%s', 'max(%s)%s', 'integral(%s)%s')
             for where in (box, ' in box(3,3,3, 4,4,4)')]
    asked += ['volume(xyz > %d)%s' % (limit, where) for limit in (50, 400) for where in ('', box)]
    asked += ['quantile(xyz, 0.7)', 'quantile(xyz, 0.2)' + box, 'xyz at (3.3,4.4,5.5)', 'xyz along line(1,1,1, 9,8,7)',
              'volume()' + box]
    with Server(FOLDER) as server:
        for question in asked:
            body = server.get('/v1/meshes/cube/ask?within=0&q=' + urllib.parse.quote(question))[2]
            found = json.loads(body)
            said = subprocess.run([TETLOD, 'ask', os.path.join(FOLDER, 'cube.tetlod'), question, '--within', '0',
                                   '--json'], stdout=subprocess.PIPE).stdout
            assert answer(body) == answer(said), (question, body, said)
            truth = truth_of(question)
            if truth is not None:
                slack = 1e-5 * max(abs(value) for value in truth)
                off = abs(found['lower'] - truth[0]), abs(found['upper'] - truth[1])
                assert max(off) <= slack, (found, truth)


def truth_of(question):
    """From all tetrahedra of the mesh file, one by one; None: see tests/cli/test_ask.py."""
    match = re.match(r'(mean|min|max|integral)\(xyz\) in box\((.*)\)', question)
    if not match or not vtk_box:
        return None
    box = np.array([float(x) for x in match[2].split(',')]).reshape(2, 3)
    mesh = vtk_box.in_box(vtk_box.read(os.path.join(SCRATCH, 'cube.vtu')), *box)
    values = vtk_to_numpy(mesh.GetPointData().GetArray('xyz')).astype(float)
    corners, volumes = vtk_box.corners_of(mesh), vtk_box.volumes(mesh)
    integral = (volumes * values[corners].mean(axis=1)).sum()
    found = {'mean': integral / volumes.sum(), 'integral': integral, 'min': values[corners].min(),
             'max': values[corners].max()}[match[1]]
    return found, found


def test_steps():
    with Server(FOLDER) as server:
        for name, value in (('time', '0.5'), ('step', '1'), ('step', '2')):
            said = subprocess.run([TETLOD, 'ask', SERIES, 'max(Pressure)', '--%s' % name, value, '--json'],
                                  stdout=subprocess.PIPE).stdout
            status, _, body = server.get('/v1/meshes/wake/ask?q=max(Pressure)&%s=%s' % (name, value))
            assert status == 200 and json.loads(body) == json.loads(said), (name, value, status, body, said)
        assert json.loads(said)['time'] == 1
        for query, wanted, words in (('step=9', 400, 'steps go from 0 to 2'), ('time=7', 422, 'no time 7'),
                                     ('step=1&time=0', 400, 'once'), ('step=x', 400, 'step')):
            status, _, body = server.get('/v1/meshes/wake/ask?q=max(Pressure)&' + query)
            assert status == wanted and words in json.loads(body)['detail'], (query, status, body)
        status, _, body = server.get(path('max(Pressure)', step='1'))
        assert status == 404 and 'not a series' in json.loads(body)['detail'], (status, body)


def test_refusals():
    with Server(FOLDER) as server:
        for query, wanted, words in (
                ('', 400, 'ask a question'), ('?q=mean(', 400, 'character 6'), ('?q=mean(nope)', 400,
                                                                                "no field 'nope'"),
                ('?q=mean(Velocity)', 400, '3 components'), ('?q=volume()&within=x', 400,
                                                             'within'), ('?q=volume()&to=1', 400, "'to'"),
                ('?q=volume()&q=volume()', 400, 'ask a question'), ('?q=' + 600 * 'a', 400, 'ask a question'),
                ('?q=Pressure%20at%20(99,0,0)', 422, 'outside'), ('?q=mean(Pressure)%20over%20region%201', 422,
                                                                  '--region')):
            status, _, body = server.get('/v1/meshes/fin/ask' + query)
            assert status == wanted and words in json.loads(body)['detail'], (query, status, body)
        assert server.get('/v1/meshes/none/ask?q=volume()')[0] == 404


os.makedirs(FOLDER, exist_ok=True)
subprocess.run([TETLOD, 'sample', 'fin', '--size', '10', '-o', os.path.join(SCRATCH, 'fin.vtu')], check=True)
subprocess.run([TETLOD, 'build', os.path.join(SCRATCH, 'fin.vtu'), '-o', STREAM, '--summary', '--quiet'], check=True)
subprocess.run([TETLOD, 'sample', 'wake', '--steps', '3', '--size', '5', '-o',
                os.path.join(SCRATCH, 'wake.pvd')], check=True)
subprocess.run([TETLOD, 'build', os.path.join(SCRATCH, 'wake.pvd'), '-o', SERIES, '--quiet'], check=True)
subprocess.run([TETLOD, 'sample', 'cube', '--size', '12', '-o', os.path.join(SCRATCH, 'cube.vtu')], check=True)
subprocess.run([TETLOD, 'build', os.path.join(SCRATCH, 'cube.vtu'), '-o', os.path.join(FOLDER, 'cube.tetlod'),
                '--quiet'], check=True)
run([test_answers, test_kept_levels, test_exact, test_steps, test_refusals])
