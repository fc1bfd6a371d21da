#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""usage: doors.py PROGRAM FOLDER SEEDS [FIRST]

Random meshes and series with values of cells: `verify --against` accepts the input, exact or rounded, and refuses each
changed one; every whole level comes out of files that are cut off. A line for each finding; exit status 1 if there is
one."""
import os
import random
import subprocess
import sys

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..', 'client-examples', 'python'))
import tetlod  # noqa: E402
from tetlod import reference  # noqa: E402

ROUNDINGS = ([], ['--keep-order'], ['--position-bits', '9'], ['--field-bits', '6'],
             ['--position-bits', '6', '--field-bits', '4'],
             ['--field-error', '1%', '--keep-order'])


def grid(dice, sizes):
    """A box of cubes of six tetrahedra each, with its points shaken."""
    counts = [size + 1 for size in sizes]
    points = [[x + dice.uniform(-0.2, 0.2) for x in (i, j, k)] for i in range(counts[0]) for j in range(counts[1])
              for k in range(counts[2])]
    steps, tets = (counts[1] * counts[2], counts[2], 1), []
    for i in range(sizes[0]):
        for j in range(sizes[1]):
            for k in range(sizes[2]):
                first = i * steps[0] + j * steps[1] + k
                for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)):
                    tet = [first, first + steps[a], first + steps[a] + steps[b], first + sum(steps)]
                    tets.append(tet if (b - a) % 3 == 1 else [tet[0], tet[2], tet[1], tet[3]])
    return points, tets


class Case:
    def __init__(self, seed, program, folder):
        self.dice, self.program, self.folder, self.seed, self.findings = random.Random(seed), program, folder, seed, 0
        dice = self.dice
        self.points, self.tets = grid(dice, [dice.randint(2, 4) for _ in range(3)])
        self.count = dice.choice((1, 1, 2, 5, 9))
        self.times = [0.5 * step + dice.uniform(0, 0.4) for step in range(self.count)]
        rough = dice.choice((0, 0.01, 1))
        self.steps = [[sum(p) % 3 + 0.3 * step + rough *
                       dice.random() for p in self.points] for step in range(self.count)]
        self.cells = {'whole': [dice.randint(-9, 9) for _ in self.tets], 'real': [dice.random() for _ in self.tets]}

    def found(self, text):
        print('seed %d (doors): %s' % (self.seed, text), flush=True)
        self.findings += 1

    def path(self, name):
        return os.path.join(self.folder, name)

    def run(self, *arguments):
        return subprocess.run([self.program, *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, timeout=300)

    def write(self, name, steps, times, cells):
        """A PVD file with its steps."""
        for number, values in enumerate(steps):
            arrays = ''.join('<DataArray type="%s" Name="%s" format="ascii">%s</DataArray>' %
                             ('Int32' if key == 'whole' else 'Float64', key, ' '.join(map(repr, data)))
                             for key, data in cells.items())
            with open(self.path('%s_%d.vtu' % (name, number)), 'w') as file:
                file.write(
                    '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian"><UnstructuredGrid>'
                    '<Piece NumberOfPoints="%d" NumberOfCells="%d">'
                    '<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">%s</DataArray></Points>' %
                    (len(self.points), len(self.tets), ' '.join(repr(x) for p in self.points for x in p)))
                file.write(
                    '<Cells><DataArray type="Int64" Name="connectivity" format="ascii">%s</DataArray><DataArray '
                    'type="Int64" Name="offsets" format="ascii">%s'
                    '</DataArray><DataArray type="UInt8" Name="types" format="ascii">%s</DataArray></Cells>' %
                    (' '.join(str(v) for tet in self.tets
                              for v in tet), ' '.join(str(4 * t + 4)
                                                      for t in range(len(self.tets))), '10 ' * len(self.tets)))
                file.write(
                    '<PointData><DataArray type="Float64" Name="heat" format="ascii">%s</DataArray></PointData>'
                    '<CellData>%s</CellData>'
                    '</Piece></UnstructuredGrid></VTKFile>' % (' '.join(map(repr, values)), arrays))
        sets = ''.join('<DataSet timestep="%r" file="%s_%d.vtu"/>' % (time, name, number)
                       for number, time in enumerate(times))
        with open(self.path(name + '.pvd'), 'w') as file:
            file.write('<VTKFile type="Collection"><Collection>%s</Collection></VTKFile>' % sets)

    def changed(self):
        """A word, and the input with one thing changed."""
        dice, steps, times, cells = self.dice, [list(values) for values in self.steps], list(
            self.times), {key: list(data) for key, data in self.cells.items()}
        what = dice.choice(['value', 'whole', 'real', 'missing'] + ['time'] * (self.count > 1))
        step, at = dice.randrange(self.count), dice.randrange(len(self.tets))
        if what == 'value':
            steps[step][dice.randrange(len(self.points))] += dice.choice((-1, 1)) * dice.uniform(1, 2)
        elif what == 'time':
            times[step] += 0.01
        elif what == 'missing':
            del cells[dice.choice(('whole', 'real'))]
        else:
            cells[what][at] += 1
        return what, steps, times, cells

    def check_verify(self):
        options = self.dice.choice(ROUNDINGS[:2] if self.count > 1 else ROUNDINGS)
        self.write('input', self.steps, self.times, self.cells)
        done = self.run('build', self.path('input.pvd'), '--field', 'heat', '--growth', '1.5', *options, '-o',
                        self.path('out.tetlod'), '--quiet')
        if done.returncode:
            self.found('build %s: %r' % (options, done.stderr))
            return False
        done = self.run('verify', self.path('out.tetlod'), '--against', self.path('input.pvd'), '--quiet')
        if done.returncode not in (0, 4):
            self.found('verify rejects %s: %d %r' % (options, done.returncode, done.stderr))
        what, steps, times, cells = self.changed()
        self.write('other', steps, times, cells)
        done = self.run('verify', self.path('out.tetlod'), '--against', self.path('other.pvd'), '--quiet')
        if done.returncode != 3 or done.stderr.count(b'\n') != 1:
            self.found('verify accepts %s, another %s: %d %r' % (options, what, done.returncode, done.stderr))
        return True

    def check_cut(self):
        with open(self.path('out.tetlod'), 'rb') as file:
            data = file.read()
        whole = reference.open(data)
        ends = [level['bytes'] for level in whole.levels]
        values = {field['name']: section['offset'] + section['stored']
                  for field, section in zip(whole.cell_fields,
                                            [part for part in whole.sections if part['tag'] in ('CVAL', 'PVAL')])}
        size = self.dice.randint(ends[0], len(data) - 1)
        level = max(number for number, end in enumerate(ends) if end <= size)
        here = [name for name, end in values.items() if end <= size]
        with open(self.path('cut.tetlod'), 'wb') as file:
            file.write(data[:size])
        wanted, found = (tetlod.read(bytes_, level=level, decoder='python') for bytes_ in (data, data[:size]))
        if (not np.array_equal(wanted.tets, found.tets)
                or not np.array_equal(wanted.fields['heat'], found.fields['heat']) or list(found.cells) != here):
            self.found('cut at %d: level %d with %s' % (size, level, list(found.cells)))
        for output in ('cut.vtu', 'saved.tetlod'):
            done = self.run('extract', self.path('cut.tetlod'), '-o', self.path(output))
            if done.returncode or b'level %d of' % level not in done.stderr:
                self.found('extract %s, cut at %d: %d %r' % (output, size, done.returncode, done.stderr))
        for command in (['info', self.path('cut.tetlod')], ['verify', self.path('saved.tetlod'), '--quiet']):
            done = self.run(*command)
            if done.returncode not in (0, 4):
                self.found('%s, cut at %d: %d %r' % (command[0], size, done.returncode, done.stderr))


def main():
    program, folder, seeds = sys.argv[1:4]
    first, findings = int(sys.argv[4]) if len(sys.argv) > 4 else 1, 0
    os.makedirs(folder, exist_ok=True)
    for seed in range(first, first + int(seeds)):
        case = Case(seed, program, folder)
        if case.check_verify():
            case.check_cut()
        findings += case.findings
    print('%s seeds of doors, %d findings' % (seeds, findings))
    return findings != 0


if __name__ == '__main__':
    sys.exit(main())
