#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The Python decoder chooses levels by the table of tests/choices, as the library and the web client do."""
import json
import os

import tetlod.reference as tetlod
from tap import finish, report

table = json.load(open(os.path.join(os.environ['ROOT'], 'tests/choices/choices.json')))
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
report('levels by the table of choices', not wrong, '\n'.join(wrong))
finish()
