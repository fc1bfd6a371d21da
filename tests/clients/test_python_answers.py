#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Stream.ask and tetlod.testing of the Python package, and the page about both."""
import json
import os
import re
import subprocess
import sys

import numpy as np

ROOT = os.environ['ROOT']
sys.path[:0] = [os.path.join(ROOT, 'tests', folder) for folder in ('http', 'cli', '')]
sys.path.insert(0, os.path.join(ROOT, 'client-examples', 'python'))
from raising import raises  # noqa: E402
from served import SCRATCH, TETLOD, Server, run  # noqa: E402

import tetlod  # noqa: E402
from tetlod.testing import assert_limits, assert_same, difference  # noqa: E402

FOLDER = os.path.join(SCRATCH, 'streams')
FIN = os.path.join(FOLDER, 'fin.tetlod')
QUESTIONS = ('mean(Pressure)', 'volume(Pressure > 3)', 'max(Pressure) < 3', 'max(Pressure) < 99', 'Pressure at (1,1,1)')


def said(question, *options):
    done = subprocess.run([TETLOD, 'ask', FIN, question, '--json', *options], stdout=subprocess.PIPE)
    return json.loads(done.stdout)


def same_words(answer, found):
    for name in ('question', 'lower', 'upper', 'unit', 'bound', 'level', 'bytes', 'answer', 'time'):
        assert getattr(answer, name) == found.get(name), (name, answer, found)


def test_ask():
    with open(FIN, 'rb') as file:
        data = file.read()
    with Server(FOLDER) as server:
        places = (FIN, data, 'http://%s:%d/v1/meshes/fin' % server.address)
        for place in places:
            with tetlod.open(place) as stream:
                for question in QUESTIONS:
                    same_words(stream.ask(question, within='2%'), said(question, '--within', '2%'))
                assert stream.ask('mean(Pressure)', within=0.5).upper > 0
                raises(ValueError, ("no field 'nope'",), stream.ask, 'mean(nope)')
                raises(ValueError, ('character 6',), stream.ask, 'mean(')


def test_ask_of_steps():
    with tetlod.open(os.path.join(FOLDER, 'wake.tetlod')) as stream:
        truth = stream.at(0.5).fields['Pressure'].max()
        for chosen in ({'time': 0.5}, {'step': 1}):
            answer = stream.ask('max(Pressure)', within='5%', **chosen)
            assert answer.lower - 1e-6 <= truth <= answer.upper + 1e-6 and answer.time == 0.5, (answer, truth)


def test_assert_same():
    mesh = tetlod.read(FIN)
    pressure = mesh.fields['Pressure'] + 0.01 * np.ptp(mesh.fields['Pressure']) * (mesh.points[:, 0] > 1)
    other = os.path.join(SCRATCH, 'other.tetlod')
    tetlod.build(mesh.points, mesh.tets, dict(mesh.fields, Pressure=pressure.astype(np.float32)), output=other)
    for b in (other, tetlod.read(other)):
        assert_same(FIN, b, 'Pressure', '1.1%')
        assert_same(FIN, b, 'Pressure', '1%', norm='rms')
        raises(AssertionError, ('Pressure', 'largest', 'beyond', 'near ('), assert_same, FIN, b, 'Pressure', '0.5%')
    found = difference(mesh, other, 'Pressure')
    wanted = 0.01 * np.ptp(mesh.fields['Pressure'])
    assert (found['verdict'] == 'measured'
            and found['max']['lower'] - 1e-6 < wanted < found['max']['upper'] + 1e-6), found
    raises(ValueError, ("no field 'nope'",), assert_same, FIN, other, 'nope', 1)
    limits = os.path.join(SCRATCH, 'limits')
    for line, fails in (('Density 0.1%', False), ('Velocity 0.1% rms', False), ('Pressure 0.5%', True)):
        with open(limits, 'a') as file:
            file.write(line + '\n')
        if fails:
            raises(AssertionError, ('Pressure',), assert_limits, FIN, other, limits)
        else:
            assert_limits(FIN, other, limits)


def test_page():
    """The commands of the page for answers, in Python and for the shell, do what it says."""
    with open(os.path.join(ROOT, 'client-examples', 'ANSWERS.md'), encoding='utf-8') as file:
        page = file.read()
    folder = os.path.join(SCRATCH, 'page')
    os.makedirs(folder)
    mesh = tetlod.read(FIN)
    fields = {'p': mesh.fields['Pressure'], 'T': mesh.fields['Density'], 'U': mesh.fields['Velocity']}
    tetlod.build(mesh.points, mesh.tets, fields, output=os.path.join(folder, 'reference.tetlod'))
    for script, text in (('tolerances.txt', re.search(r'    (# field .*?)\n\n', page, re.S)[1].replace('\n    ', '\n')),
                         ('run-case.sh', '#!/bin/sh\n"$TETLOD" extract reference.tetlod -o result.vtu --quiet\n')):
        with open(os.path.join(folder, script), 'w') as file:
            file.write(text + '\n')
    os.chmod(os.path.join(folder, 'run-case.sh'), 0o755)
    os.symlink(TETLOD, os.path.join(folder, 'tetlod'))
    environment = dict(os.environ, PATH=folder + os.pathsep + os.environ['PATH'])
    steps = re.findall(r'^ *-? *run: ([^#\n]*)', page, re.M)
    assert len(steps) == 3, steps
    scripts = [line.replace('https://data.example.org/', '') for line in re.findall(r'^    - (.*)', page, re.M)]
    assert len(scripts) == 3, scripts
    for step in steps + scripts:
        subprocess.run(step, shell=True, check=True, cwd=folder, env=environment, stdout=subprocess.DEVNULL)
    blocks = re.findall(r'```python\n(.*?)```', page, re.S)
    os.chdir(folder)
    for block in blocks:
        names = {}
        exec(block, names)
        for name, function in list(names.items()):
            if name.startswith('test_'):
                function()


os.makedirs(FOLDER, exist_ok=True)
for arguments in (('sample', 'fin', '--size', '10', '-o', os.path.join(SCRATCH, 'fin.vtu')),
                  ('build', os.path.join(SCRATCH, 'fin.vtu'), '-o', FIN, '--summary', '--quiet'),
                  ('sample', 'wake', '--steps', '3', '--size', '5', '-o', os.path.join(SCRATCH, 'wake.pvd')),
                  ('build', os.path.join(SCRATCH, 'wake.pvd'), '-o', os.path.join(FOLDER, 'wake.tetlod'), '--quiet')):
    subprocess.run([TETLOD, *arguments], check=True, stdout=subprocess.DEVNULL)
run([test_ask, test_ask_of_steps, test_assert_same, test_page])
