#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""usage: answer_times.py TETLOD FOLDER

What answers cost: `ask` on a server of a million tetrahedra, the first time and when its levels are kept; `diff` beside
the two extracts that it replaces; how many features levels prove, beside those of the original's merge tree."""
import http.client
import json
import os
import subprocess
import sys
import time
import urllib.parse

TETLOD, FOLDER = sys.argv[1:3]
QUESTIONS = ('mean(xyz)', 'max(xyz)', 'volume(xyz > 40000)', 'quantile(xyz, 0.5)', 'max(xyz) < 1e6',
             'mean(xyz) in box(5,5,5, 40,40,40)', 'max(xyz) in box(5,5,5, 40,40,40)',
             'volume(xyz > 40000) in box(5,5,5, 40,40,40)', 'quantile(xyz, 0.3) in box(5,5,5, 40,40,40)',
             'xyz at (20.5,20.3,20.1)', 'xyz along line(1,1,1, 50,50,49)')
MILLISECONDS, TIMES = 10, 7


def run(*given):
    return subprocess.run([TETLOD, *given], check=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE).stdout


def path(name):
    return os.path.join(FOLDER, name)


def sample(name, size, *options):
    run('sample', name, '--size', str(size), '-o', path(name + '.vtu'))
    run('build', path(name + '.vtu'), '-o', path(name + '.tetlod'), '--quiet', *options)


def serve():
    server = subprocess.Popen([TETLOD, 'serve', path('cube.tetlod'), '--listen', '127.0.0.1:0'],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    for line in server.stdout:
        if line.startswith('http://'):
            return server, http.client.HTTPConnection(line.strip()[7:].rstrip('/'))
    raise SystemExit('the server has not started')


def times_of(connection, question, width='1.%07d%%'):
    """Each time with another width, so that no answer is there: milliseconds, and the last answer."""
    taken = []
    for n in range(TIMES):
        target = '/v1/meshes/cube/ask?' + urllib.parse.urlencode({'q': question, 'within': width % n})
        began = time.perf_counter()
        connection.request('GET', target)
        answer = json.loads(connection.getresponse().read())
        taken.append(1000 * (time.perf_counter() - began))
    return taken, answer


def ask_a_server():
    sample('cube', 55, '--summary')
    server, connection = serve()
    times_of(connection, 'volume()')  # the file is read and checked
    slow = 0
    for said, width in (('within 1 %', '1.%07d%%'), ('exact', '%de-30')):
        print('| question, %s, of 998,250 tetrahedra | first | then, median | level |\n|---|---|---|---|' % said)
        for question in QUESTIONS:
            (first, *rest), answer = times_of(connection, question, width)
            median = sorted(rest)[len(rest) // 2]
            slow += median > MILLISECONDS
            print('| `%s` | %.1f ms | %.1f ms | %s |' % (question, first, median, answer.get('level', 'none')),
                  flush=True)
    server.terminate()
    print('%d of %d take more than %d ms' % (slow, 2 * len(QUESTIONS), MILLISECONDS))


def seconds(*given):
    best = []
    for _ in range(3):
        began = time.perf_counter()
        subprocess.run([TETLOD, *given], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        best.append(time.perf_counter() - began)
    return min(best)


def diff_and_extracts():
    """Results of one case on meshes that have nothing in common but the domain."""
    print('\n| diff of | diff | two extracts | |\n|---|---|---|---|')
    for name, sizes, field in (('cube', (40, 44), 'xyz'), ('fin', (20, 24), 'Pressure'),
                               ('torus', (10, 12), 'temperature'), ('post', (14, 16), 'Pressure')):
        files = []
        for size in sizes:
            sample(name, size)
            files.append(path('%s%d.tetlod' % (name, size)))
            os.replace(path(name + '.tetlod'), files[-1])
        extracts = sum(seconds('extract', file, '-o', path('level.vtu')) for file in files)
        for limit in ('1%', '5%'):
            diff = seconds('diff', *files, '--field', field, '--limit', limit)
            print('| `%s`, %s, limit %s | %.2f s | %.2f s | %.2f |'
                  % (name, field, limit, diff, extracts, diff / extracts),
                  flush=True)


def counts(file, field, *options):
    # it ends with 5 where the level leaves something open
    done = subprocess.run([TETLOD, 'features', file, '--field', field, '--persistence', '2%', *options, '--json'],
                          stdout=subprocess.PIPE, check=False)
    found = json.loads(done.stdout)
    return ['%d – %s' % (of['proven'], of.get('at_most', '?')) for of in found['counts'].values()]


def features():
    print('\n| maxima, minima above 2 % | original | level of 2 % | 1 % | 0.5 % | 0.1 % |\n|---|---|---|---|---|---|')
    for name, size, field in (('fin', 24, 'Pressure'), ('fin', 24, 'Density'), ('post', 24, 'Pressure'),
                              ('torus', 8, 'temperature')):
        sample(name, size, '--domain-error', '0', '--field', field)
        file = path(name + '.tetlod')
        row = [', '.join(counts(path(name + '.vtu'), field))]
        row += [', '.join(counts(file, field, '--error', error)) for error in ('2%', '1%', '0.5%', '0.1%')]
        print('| `%s`, %s | %s |' % (name, field, ' | '.join(row)), flush=True)


for part in (ask_a_server, diff_and_extracts, features):
    part()
