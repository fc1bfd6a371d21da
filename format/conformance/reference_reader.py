#!/usr/bin/python3
# SPDX-License-Identifier: 0BSD
"""A reader as README.md defines it: the reference decoder."""
import json
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.environ.get('TETLOD_PYTHON',
                                     os.path.join(HERE, '..', '..', 'client-examples', 'python'))]
import answers  # noqa: E402
import tetlod.reference as tetlod  # noqa: E402
from tetlod import reference_pages  # noqa: E402


def steps_of(series):
    """Band by band, step by step."""
    rows = []
    for band in range(len(series.bands)):
        for step in range(len(series.times)):
            values = list(series.seek(band, step)[1].values())
            rows.append(answers.digest(values + ([series.points()] if series.displacement else [])))
    return rows


def of_stream(stream):
    for section in stream.sections:
        stream.section(section['tag'])
    cursor, series = stream.cursor(), stream.series()
    names = [field['name'] for field in stream.fields]
    cells = [field['name'] for field in stream.cell_fields]
    answer = {'levels': [answers.level(found.positions, found.tets, [found.field(name) for name in names])
                         for found in map(cursor.seek, range(len(stream.levels)))],
              'cells': [answers.digest([stream.cells(name)]) for name in cells]}
    if series:
        answer['steps'] = steps_of(series)
        answer['cell_steps'] = [[answers.digest([series.cells(name, step)]) for step in range(len(series.times))]
                                for name in cells if series.has_cells(name, 1)]
    return answer


def region_of(stream, chosen):
    """Some of the pages, and all that these need (SPEC 7.6)."""
    found = stream.cursor().seek_pages(reference_pages.closure(stream, chosen))
    return answers.level(found.positions, found.tets, [found.field(field['name']) for field in stream.fields])


def pages_of(stream, chosen):
    """The same, with where each tetrahedron is from."""
    chosen, cursor = reference_pages.closure(stream, chosen), stream.cursor()
    cursor.seek_pages(chosen)
    return answers.of_pages(cursor.positions, cursor.tets, [cursor.field(field['name']) for field in stream.fields],
                            *reference_pages.rows_of(cursor, chosen))


def regions_of(stream):
    low, high = stream.bounds
    middle, first, last = [(a + b) / 2 for a, b in zip(low, high)], min(stream.groups), max(stream.groups)
    whole = {first: set(range(stream.groups[first].count))}
    box, ball = [*low, *middle], answers.ball(low, high)
    thirds = {level: set(range(level % 3, group.count, 3)) for level, group in stream.groups.items()}
    return {'region': region_of(stream, reference_pages.meeting(stream, box)),
            'partly': region_of(stream, {**reference_pages.meeting(stream, box, (first + last) // 2), **whole}),
            'ball': pages_of(stream, reference_pages.meeting(stream, ball)), 'pages': pages_of(stream, thirds)}


def answer(path):
    stream = tetlod.open(path)
    own = of_stream(stream)
    if stream.groups:
        own.update(regions_of(stream))
    groups = [of_stream(stream.topology(number)) for number in range(1, len(stream.topologies))]
    return {**own, 'groups': groups} if groups else own


if __name__ == '__main__':
    try:
        print(json.dumps(answer(sys.argv[1])))
    except (tetlod.StreamError, IndexError, KeyError) as problem:
        sys.exit('%s: %r' % (sys.argv[1], problem))
