#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What `tetlod build --memory` counts is what a build takes."""
import json

from common import CONFIG, finish, report, tetlod


def peak_of(options):
    build = tetlod('build', 'm.vtu', '-o', 'm.tetlod', '--json', '--quiet', *options)
    return json.loads(build.stdout)['peak_memory'] / 2 ** 20


def memory():
    """What --memory counts is what a build takes at its peak."""
    if CONFIG != 'release':
        return report('--memory: right within 10 %', True, skip='release only')
    exact = ('--certify', 'exact', '--threads', '2')
    for sample, size, options in (('cube', 12, ()), ('cube', 24, ()), ('cube', 24, ('--metric', 'sva')),
                                  ('fin', 24, ()),
                                  ('fin', 24, ('--field', 'Pressure', '--field', 'Density', '--field', 'Velocity')),
                                  ('cube', 12, exact), ('fin', 12, exact), ('post', 12, exact), ('delta', 3, exact)):
        tetlod('sample', sample, '--size', str(size), '-o', 'm.vtu')
        refused = tetlod('build', 'm.vtu', '-o', 'm.tetlod', '--memory', '1', *options).stderr.decode()
        said = int(refused.split('needs about ')[1].split()[0])
        peaks = [peak_of(options)]
        while len(peaks) < 3 and said > 1.1 * max(peaks) + .5:  # on a busy machine threads may not run at once
            peaks.append(peak_of(options))
        peak = max(peaks)
        report('--memory: %s %d %s: right within 10 %%' % (sample, size, ' '.join(options)),
               abs(said - peak) <= .1 * peak + .5, (said, peaks))


memory()
finish()
