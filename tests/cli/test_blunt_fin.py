#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The blunt fin, where its data are: as few tetrahedra as the thesis says, and errors held against the mesh."""
import json
import os

from common import CONFIG, DATA, finish, report, tetlod


def blunt_fin():
    name = 'the blunt fin'
    grid, solution = os.path.join(DATA, 'bluntfinxyz.bin'), os.path.join(DATA, 'bluntfinq.bin')
    if CONFIG != 'release' or not os.path.exists(grid):
        return report(name, True, skip='release only' if os.path.exists(grid) else 'no blunt fin data')
    done = tetlod('build', grid, '--q', solution, '--field', 'Pressure', '--carry', 'Pressure', '--metric', 'sva',
                  '--growth', '1.3', '-o', 'blunt.tetlod', '--json')
    report(name + ': build', done.returncode == 0 and b'77 degenerate' in done.stderr, done)
    shown = json.loads(done.stdout)
    report(name + ': counts', (shown['vertices'], shown['tets'], shown['degenerate_tets']) == (40960, 187395, 77),
           shown['tets'])
    for error, most in (.001, 74.05), (.002, 64.48), (.003, 58.13), (.005, 50.21), (.01, 39.54):
        left = next(l['tets']
                    for l in shown['levels'] if l['errors']['Pressure']['predicted'] <= error) / shown['tets'] * 100
        report(
            '%s: predicted %g %%: at most %.2f %% of the tetrahedra, as in the thesis (Table 4.2)' %
            (name, 100 * error, most), left <= most, left)
    report(name + ': a certified error is at most the range', shown['levels'][0]['errors']['Pressure']['max'] <= 1)
    checked = tetlod('verify', 'blunt.tetlod', '--against', grid, '--q', solution)
    report(name + ': verify --against, the exact maximum at six levels', checked.returncode == 0 and
           checked.stdout.decode().split('levels')[-1].count(',') == 5, checked)
    certified = tetlod('build', grid, '--q', solution, '--field', 'Pressure', '--carry', 'Pressure', '-o',
                       'certified.tetlod',
                       '--json', '--quiet')
    shown = json.loads(certified.stdout)
    for error, most in (.001, 56), (.01, 18.5), (.05, 6.5):
        left = next(l['tets'] for l in shown['levels'] if l['errors']['Pressure']['max'] <= error) / shown['tets'] * 100
        report('%s: certified %g %%: at most %g %% of the tetrahedra' % (name, 100 * error, most), left <= most, left)


blunt_fin()
finish()
