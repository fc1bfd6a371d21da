#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The Python decoder chooses levels by the table of tests/choices, as the library and the web client do."""
import json
import os
import sys

ROOT = os.environ.get('ROOT', '.')
sys.path.insert(0, os.path.join(ROOT, 'client-examples', 'python'))
import tetlod.reference as tetlod  # noqa: E402

table = json.load(open(os.path.join(ROOT, 'tests/choices/choices.json')))
stream = object.__new__(tetlod.Stream)
stream.fields, stream.levels = table['fields'], table['levels']
wrong = []
for question in table['questions']:
    absolute = 'abs_error' in question
    got = stream.level_for_error(question['abs_error' if absolute else 'error'], question.get('field'),
                                 question.get('measure', 'max'), absolute)
    if got != question['level']:
        wrong.append('%s: level %d' % (question, got))
for absolute in (False, True):
    try:
        wrong.append('carried has no max: level %d' % stream.level_for_error(1, 'carried', 'max', absolute))
    except ValueError:
        pass
print('%s 1 - levels by the table of choices\n1..1' % ('not ok' if wrong else 'ok'))
print(''.join('# %s\n' % w for w in wrong), end='')
sys.exit(bool(wrong))
