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


def of_region(region):
    return answers.of_pages(region.points, region.tets, list(region.fields.values()), region.levels, region.numbers)


def of_thirds(decoder, levels):
    """Of each level some pages, by their numbers, and what these need."""
    library, pages = decoder._library, decoder.page_set([], levels[0] - 1, levels[0] - 1)
    for level in levels:
        for number in range(level % 3, library.tetlod_page_count(decoder._file, level), 3):
            library.tetlod_page_set_add(pages, level, number, None)
    return of_region(decoder.region_of(pages))


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
        own['ball'] = of_region(stream._decoder.region([answers.ball(low, high)], first - 1, last))
        own['pages'] = of_thirds(stream._decoder, stream.info.paged)
        own['partly'] = of_mesh(stream._decoder.region([box], first, (first + last) // 2))
    groups = [of_stream(stream._topology(number)) for number in range(1, len(stream.info.topologies))]
    return {**own, 'groups': groups} if groups else own


if __name__ == '__main__':
    warnings.simplefilter('error')
    try:
        print(json.dumps(answer(sys.argv[1])))
    except (ValueError, Warning) as problem:  # a file that is cut off is a warning
        sys.exit('%s: %r' % (sys.argv[1], problem))
