#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The table of server/HTTP.md that says what HTTP, JavaScript and Python call things, held against their sources."""
import glob
import os
import re

from lint_report import ROOT, finish, report

SOURCES = {'HTTP': ('server/api/*.py', 'server/routes/*.def', 'src/report/*.c'),
           'JavaScript': ('server/web/client/*.js', 'server/web/wasm/*.c'),
           'Python': ('client-examples/python/tetlod/*.py',)}


def texts(patterns):
    paths = [path for pattern in patterns for path in glob.glob(os.path.join(ROOT, pattern))]
    return '\n'.join(open(path, encoding='utf-8').read() for path in sorted(paths))


def rows(text):
    head = '| HTTP | JavaScript | Python | meaning |\n'
    table = text[text.index(head) + len(head):].split('\n\n')[0].split('\n')[1:]
    return [tuple(cell.strip().strip('`') for cell in row.split('|')[1:4]) for row in table]


def camel(name):
    return re.sub('_([a-z])', lambda letter: letter[1].upper(), name)


def broken(table, sources):
    found = ['%s: JavaScript says %s, not %s' % (http, camel(http), script) for http, script, _ in table
             if script != camel(http)]
    found += ['%s: Python says %s' % (http, python) for http, _, python in table if python != http]
    for column, language in enumerate(SOURCES):
        found += ['%s has no %s' % (language, row[column]) for row in table
                  if not re.search(r'\b%s\b' % row[column], sources[language])]
    return found


def main():
    with open(os.path.join(ROOT, 'server', 'HTTP.md'), encoding='utf-8') as file:
        table = rows(file.read())
    sources = {language: texts(patterns) for language, patterns in SOURCES.items()}
    report('%d words have one name in each language' % len(table),
           broken(table, sources) if len(table) > 10 else ['the table is gone'])
    planted = broken([('abs_error', 'absoluteError', 'abs_error'), ('box_size', 'boxSize', 'box_size')], sources)
    report('a planted second name, and a word that nobody has, are found', [] if len(planted) == 5 else planted)
    finish()


main()
