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


def of_stream(stream):
    decoder, rows = stream._decoder, []
    for level in range(len(stream.levels)):
        mesh = stream.seek(level).mesh
        rows.append(answers.level(mesh.points, mesh.tets, list(mesh.fields.values())))
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
        mesh = stream.region([*low, *((a + b) / 2 for a, b in zip(low, high))])
        own['region'] = answers.level(mesh.points, mesh.tets, list(mesh.fields.values()))
    groups = [of_stream(stream._topology(number)) for number in range(1, len(stream.info.topologies))]
    return {**own, 'groups': groups} if groups else own


if __name__ == '__main__':
    warnings.simplefilter('error')
    try:
        print(json.dumps(answer(sys.argv[1])))
    except (ValueError, Warning) as problem:  # a file that is cut off is a warning
        sys.exit('%s: %r' % (sys.argv[1], problem))
