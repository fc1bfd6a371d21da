#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Rules that are not kept everywhere yet: files that include each other, lines above 120 columns, phrases that are no
plain English. For each there is the number of places that break it. A number may only go down: who mends a place lowers
it."""
import os
import re
import subprocess

from lint_report import ROOT, finish, report

COLUMNS = 120
PHRASES = ('that are none', 'none such', 'so many that', 'is done without', 'for who', 'at hand', 'says of')
ENDINGS = ('.c', '.h', '.py', '.js', '.mjs', '.sh', '.md', 'Makefile', '.css', '.html')
ALLOWED = {'in circles': 0, 'long lines': 65, 'phrases': 0}


def circles(sources):
    """Files that reach each other through #include; a source and its header are one."""
    uses = {}
    for path, text in sources.items():
        if path.endswith(('.c', '.h')):
            names = {name[:-2] for name in re.findall(r'^\s*#\s*include\s*"([^"]+)"', text, re.M)}
            uses.setdefault(path[:-2], set()).update(names - {path[:-2]})
    reach = {}
    for start in uses:
        todo, seen = list(uses[start]), set()
        while todo:
            one = todo.pop()
            if one not in seen:
                seen.add(one)
                todo += uses.get(one, ())
        reach[start] = seen
    return sorted('%s includes itself by way of %s' %
                  (one, ', '.join(sorted(other
                                         for other in reach[one] if one in reach.get(other, ()) and other != one)))
                  for one in uses if one in reach[one])


def long_lines(sources):
    """Rows of tables in documents cannot be wrapped."""
    return ['%s:%d has %d columns' % (path, number, len(line)) for path, text in sorted(sources.items())
            for number, line in enumerate(text.split('\n'), 1)
            if len(line) > COLUMNS and not (path.endswith('.md') and line.startswith('|'))]


def phrases(sources):
    """In comments, messages and documents: this file, which lists them, is left out."""
    pattern = re.compile(r'\b(%s)\b' % '|'.join(PHRASES))
    return ['%s:%d says "%s"' % (path, number, found[1])
            for path, text in sorted(sources.items()) if path != 'tests/lint/test_ratchets.py'
            for number, line in enumerate(text.split('\n'), 1) for found in pattern.finditer(line)]


def tracked():
    if not os.path.exists(os.path.join(ROOT, '.git')):
        return {}
    names = subprocess.run(['git', 'ls-files', '-z'], cwd=ROOT, check=True, stdout=subprocess.PIPE,
                           text=True).stdout.split('\0')
    sources = {}
    for name in names:
        if name.endswith(ENDINGS) and os.path.exists(os.path.join(ROOT, name)):
            with open(os.path.join(ROOT, name), encoding='utf-8') as file:
                sources[name] = file.read()
    return sources


def held(what, found):
    """Where there are more than before, all are shown, the last ones last: new files and lines are among them."""
    report('%d %s, of %d' % (len(found), what, ALLOWED[what]), found[-90:] if len(found) > ALLOWED[what] else [])


def check_the_lint():
    """Each rule finds what is planted."""
    planted = {'a.c': '#include "a.h"\n', 'a.h': '#include "b.h"\n', 'b.h': '#include "c.h"\n',
               'c.c': '#include "c.h"\n#include "a.h"\n', 'c.h': '', 'd.c': '#include "a.h"\n'}
    report('a planted circle is found',
           [] if [one.split()[0] for one in circles(planted)] == ['a', 'b', 'c'] else circles(planted))
    found = long_lines({'x.py': 'y' * 120 + '\n' + 'y' * 121, 'x.md': '|' + 'y' * 121})
    report('a planted long line is found', [] if found == ['x.py:2 has 121 columns'] else found)
    found = phrases({'x.c': '/* the mark at hand */\n// a list that are none\n// beforehand and at handles'})
    report('a planted phrase is found', [] if len(found) == 2 and found[0].startswith('x.c:1') else found)


def main():
    sources = tracked()
    check_the_lint()
    if sources:
        held('in circles', circles(sources))
        held('long lines', long_lines(sources))
        held('phrases', phrases(sources))
    finish()


main()
