#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The hexadecimal examples of format/SPEC.md are the bytes of the files that they name, and the steps those that a decoder does."""
import os
import re
import sys

ROOT = os.environ.get('ROOT', '.')
text = open(os.path.join(ROOT, 'format', 'SPEC.md')).read()
examples = re.findall(r'<!-- example: (\S+) (\d+) (\d+) -->\n```hex\n(.*?)```', text, re.S)
for number, (path, offset, size, wanted) in enumerate(examples, 1):
    with open(os.path.join(ROOT, path), 'rb') as file:
        file.seek(int(offset))
        same = file.read(int(size)) == bytes.fromhex(wanted)
    print('%s %d - example of %s at byte %s' % ('ok' if same else 'not ok', number, path, offset))
print('%s %d - there are two examples' % ('ok' if len(examples) == 2 else 'not ok', len(examples) + 1))

sys.path.insert(0, os.path.join(ROOT, 'client-examples', 'python'))
import tetlod.reference as tetlod  # noqa: E402

path, steps = re.search(r'<!-- example: steps of (\S+) -->\n```steps\n(.*?)```', text, re.S).groups()
stream = tetlod.open(os.path.join(ROOT, path))
coder, models, wrong = tetlod.Coder(stream.seen_most), {}, 0
for line in steps.splitlines():
    what, name, number, wanted, state = re.fullmatch(r'(\w+)(?:\(([a-z]\w*(?:\[\d+\])?)?(?:, )?(\d*)\))? +(\d*) +(\w{8} \w{8})', line).groups()
    if what == 'start':
        coder.start(stream.frame(0, 0))
    elif what == 'bit':
        wrong += coder.bit(models.setdefault(name, tetlod.bits(128)), int(number or 0)) != int(wanted)
    else:
        wrong += coder.plain(int(number)) != int(wanted)
    wrong += '%08x %08x' % (coder.range, coder.code) != state
print('%s %d - the steps are those of a decoder' % ('not ok' if wrong else 'ok', len(examples) + 2))
code = tetlod.open(os.path.join(ROOT, path)).cursor().columns[0].codes[0][0]
print('%s %d - they lead to the code that is told' % ('ok' if '= %d, the float32 0.27' % code in text else 'not ok', len(examples) + 3))

sys.path.insert(0, os.path.join(ROOT, 'tests', 'golden'))
import record_trace  # noqa: E402

level, path, wanted = re.search(r'<!-- example: row (\d+) of (\S+) -->\n```hex\n(.*?)\n```', text, re.S).groups()
same = record_trace.row(os.path.join(ROOT, path), int(level)) == wanted
print('%s %d - the row of the index is the one of the stream' % ('ok' if same else 'not ok', len(examples) + 4))
path, wanted = re.search(r'<!-- example: record of (\S+) -->\n```record\n(.*?)\n```', text, re.S).groups()
lines = record_trace.first_record(os.path.join(ROOT, path))
print('%s %d - the record is read as it is told' % ('ok' if lines == wanted.split('\n') and len(lines) > 20 else 'not ok', len(examples) + 5))
