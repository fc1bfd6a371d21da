#!/usr/bin/python3
# SPDX-License-Identifier: 0BSD
"""A reader as README.md defines it: the Python package over libtetlod, the decoder in C."""
import json
import os
import sys
import warnings

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, '..', '..', 'client-examples', 'python')]
import answers  # noqa: E402
import tetlod  # noqa: E402


def of_step(decoder, band, step):
    points, _, values = decoder.seek_step(band, step)  # views: the next step has other values there
    return answers.digest([*values.values(), *([points] if decoder._moves else [])])


def of_mesh(mesh):
    return answers.level(mesh.points, mesh.tets, list(mesh.fields.values()))


def of_stream(stream):
    """Levels both ways: what undoes records gives the same."""
    decoder, numbers = stream._decoder, range(len(stream.levels))
    rows = [of_mesh(stream.seek(level).mesh) for level in numbers]
    if rows != [of_mesh(stream.seek(level).mesh) for level in numbers[::-1]][::-1]:
        raise ValueError('a level is another one on the way back')
    answer = {'levels': rows, 'cells': [answers.digest([decoder.cells(name)]) for name in stream.info.cells]}
    steps = decoder.steps
    if steps:
        answer['steps'] = [of_step(decoder, band, step) for band in range(len(steps.bands))
                           for step in range(len(steps.times))]
        answer['cell_steps'] = [[answers.digest([decoder.step_cells(name, step)]) for step in range(len(steps.times))]
                                for name in stream.info.cells if decoder.has_step_cells(name, 1)]
    return answer


def answer(path):
    stream = tetlod.open(path, decoder='library')
    own = of_stream(stream)
    if stream.info.paged:
        low, high = stream.info.bounds
        box = [*low, *((a + b) / 2 for a, b in zip(low, high))]
        first, last = stream.info.paged[0], stream.info.paged[-1]
        own['region'] = of_mesh(stream._decoder.region([box], first - 1, last))
        own['partly'] = of_mesh(stream._decoder.region([box], first, (first + last) // 2))
    groups = [of_stream(stream._topology(number)) for number in range(1, len(stream.info.topologies))]
    return {**own, 'groups': groups} if groups else own


if __name__ == '__main__':
    warnings.simplefilter('error')
    try:
        print(json.dumps(answer(sys.argv[1])))
    except (ValueError, Warning) as problem:  # a file that is cut off is a warning
        sys.exit('%s: %r' % (sys.argv[1], problem))
