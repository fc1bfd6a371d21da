#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""`tetlod plot` and `tetlod compare` as a user meets them."""
import json
import os
import xml.etree.ElementTree as ET

import common
from common import finish, path, report

SVG = '{http://www.w3.org/2000/svg}'


def tetlod(*arguments):
    return common.tetlod(*arguments, text=True)


def curves(root):
    found = {}
    for line in root.iter(SVG + 'polyline'):
        points = [tuple(map(float, pair.split(','))) for pair in line.get('points').split()]
        found.setdefault(line.get('class'), []).append(points)
    return found


def plots(info):
    done = tetlod('plot', path('a & <b>.tetlod'), '-o', path('out.svg'))
    report('a picture is drawn', done.returncode == 0 and done.stderr == '', done)
    root = ET.parse(path('out.svg')).getroot()
    report('it is SVG with a title that names stream and field', root.tag == SVG + 'svg' and
           root.find(SVG + 'title').text == 'a & <b>: error of xyz, % of its range', root.find(SVG + 'title').text)
    errors = [level['errors']['xyz'] for level in info['levels']]
    drawn = curves(root)
    wanted = {m: sum(e.get(m, 0) > 0 for e in errors) for m in ('max', 'sampled', 'rms', 'predicted')}
    report('both panels have a line for each measure, a point for each level that has an error',
           {m: [len(p) for p in lines] for m, lines in drawn.items()} == {m: [n, n] for m, n in wanted.items()},
           (wanted, {m: [len(p) for p in lines] for m, lines in drawn.items()}))
    falls = all(b[0] >= a[0] and b[1] >= a[1] for lines in drawn.values() for p in lines for a, b in zip(p, p[1:]))
    report('finer levels are to the right and not higher', falls)
    inside = all(80 <= x <= 1030 and 50 <= y <= 390 for lines in drawn.values() for p in lines for x, y in p)
    report('lines are inside the picture', inside)
    report('certified is not below sampled', all(
        a[1] <= b[1] + 0.011 for side in (0, 1) for a, b in zip(drawn['max'][side],
                                                                drawn['sampled'][side]) if a[0] == b[0]))
    labels = [t.text for t in root.iter(SVG + 'text')]
    report('axes and legend are labelled', all(t in labels for t in (
        'tetrahedra', 'bytes', 'max (certified)', 'sampled', 'rms', 'predicted', '1 %')), labels)
    first = open(path('out.svg'), 'rb').read()
    tetlod('plot', path('a & <b>.tetlod'), '-o', path('out.svg'), '--field', 'xyz')
    report('the same again is the same bytes', open(path('out.svg'), 'rb').read() == first)


def plot_refusals():
    for name, code, said, arguments in (
            ('an unknown field', 3, "no field 'nope'", ('-o', path('no.svg'), '--field', 'nope')),
            ('no output', 2, '-o OUT.svg', ()), ('an output that cannot be', 1, 'nowhere',
                                                 ('-o', path('nowhere/no.svg')))):
        done = tetlod('plot', path('a & <b>.tetlod'), *arguments)
        report('plot: ' + name + ' is refused', done.returncode == code and said in done.stderr, done)
    report('nothing is left of it', not os.path.exists(path('no.svg')))


def compares(info):
    sound, above, levels = [], 0, info['levels']
    for level in range(0, len(levels), 3):
        tetlod('extract', path('a & <b>.tetlod'), '--level', str(level), '-o', path('level.vtu'))
        done = tetlod('compare', path('in.vtu'), path('level.vtu'), '--field', 'xyz', '--json')
        got, stored = json.loads(done.stdout)['errors'], levels[level]['errors']['xyz']
        sound.append(got['rms'] <= got['sampled'] <= got['max'] <= stored['max'] * (1 + 1e-9) + 1e-12)
        above += got['max'] > got['sampled']
    report('rms <= sampled <= max <= what is certified, at every level', all(sound), sound)
    report('the true maximum is above the sampled one somewhere', above > 0)
    one, two = (tetlod('compare', path('in.vtu'), path('level.vtu'), '--json', '--threads', n).stdout for n in '13')
    report('the threads do not matter', one == two and one != '', (one, two))
    same = json.loads(tetlod('compare', path('in.vtu'), path('in.vtu'), '--json').stdout)
    report('a mesh is itself', max(same['errors'].values()) < 1e-14, same)
    text = tetlod('compare', path('in.vtu'), path('level.vtu')).stdout
    report('the text has the maximum, too', 'max  ' in text and 'sampled' in text, text)


def ranges():
    """A range that is no number would hide every error: such a field cannot be controlled."""
    for name, value, code in (('wide', 1.5e308, 3), ('narrow', 1e-310, 3), ('large', 1e300, 0), ('small', 1e-300, 0)):
        with open(path('range.vtk'), 'w') as out:
            out.write('# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 double\n'
                      '0 0 0 1 0 0 0 1 0 0 0 1 1 1 1\nCELLS 2 10\n4 0 1 2 3\n4 1 2 3 4\nCELL_TYPES 2\n10\n10\n'
                      'POINT_DATA 5\nSCALARS f double 1\nLOOKUP_TABLE default\n%r %r 0 0 0\n' % (value, -value))
        done = tetlod('build', path('range.vtk'), '-o', path('range.tetlod'), '--quiet')
        report('build: a field of a %s range is %s' % (name, 'refused by name' if code else 'taken'),
               done.returncode == code and (not code or "field 'f'" in done.stderr and name in done.stderr), done)


def main():
    tetlod('sample', 'cube', '--size', '6', '-o', path('in.vtu'))
    done = tetlod('build', path('in.vtu'), '-o', path('a & <b>.tetlod'), '--quiet')
    if done.returncode:
        report('a stream is built', False, done)
        finish()
    info = json.loads(tetlod('info', path('a & <b>.tetlod'), '--json').stdout)
    plots(info)
    plot_refusals()
    compares(info)
    ranges()
    finish()


main()
