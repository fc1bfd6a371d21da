#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""`make report`: the page of a sample and of a stream is well-formed, and its figures are those of the program."""
import json
import os
import re
import subprocess
import xml.etree.ElementTree

from tap import finish, report

ROOT, SCRATCH, TETLOD = os.environ['ROOT'], os.environ['SCRATCH'], os.environ['TETLOD']
COLUMNS = os.path.join(os.path.dirname(TETLOD), 'tests', 'bench', 'bench_columns')


def run(*command, cwd=SCRATCH):
    done = subprocess.run(command, cwd=cwd, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          text=True)
    assert done.returncode == 0, done.stdout
    return done.stdout


run('make', '-s', '-C', ROOT, os.path.relpath(COLUMNS, ROOT))
run(TETLOD, 'sample', 'torus', '--size', '6', '-o', 'torus.vtu')
run(TETLOD, 'build', 'torus.vtu', '-o', 'torus.tetlod', '--quiet')
run('/usr/bin/python3', os.path.join(ROOT, 'tests', 'bench', 'report_page.py'), TETLOD, COLUMNS, 'report.html',
    'cube:5', 'torus.tetlod')
with open(os.path.join(SCRATCH, 'report.html'), encoding='utf-8') as file:
    page = file.read()
tree = xml.etree.ElementTree.fromstring(page.replace('<!DOCTYPE html>', '').replace('<meta charset="utf-8">', ''))
index = json.loads(run(TETLOD, 'info', 'torus.tetlod', '--json'))
report('the page is well-formed, with two meshes', len(tree.findall('.//h2')) == 2)
report('it has the counts of the stream', '%d vertices, %d tetrahedra' % (index['vertices'], index['tets']) in page)
report('three lines a diagram: certified, measured, VTK',
       [len(s.findall('polyline')) for s in tree.iter('svg') if s.get('role')] == [3, 3])
bits = [float(n) for n in re.findall(r'([0-9.]+) bits/tet', page)]
total = [float(n) for n in re.findall(r'([0-9.]+) bits a tetrahedron', page)]
report('the columns add up to the stream', len(bits) == 14 and abs(sum(bits) - sum(total)) < 0.2, (bits, total))
finish()
