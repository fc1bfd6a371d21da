#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The hexadecimal examples of format/SPEC.md are the bytes of the files that they name, and the steps those that a
decoder does."""
import os
import re

import tetlod.reference as tetlod
from tap import finish, report

import record_trace

ROOT = os.environ.get('ROOT', '.')
text = open(os.path.join(ROOT, 'format', 'SPEC.md')).read()
examples = re.findall(r'<!-- example: (\S+) (\d+) (\d+) -->\n```hex\n(.*?)```', text, re.S)
for path, offset, size, wanted in examples:
    with open(os.path.join(ROOT, path), 'rb') as file:
        file.seek(int(offset))
        same = file.read(int(size)) == bytes.fromhex(wanted)
    report('example of %s at byte %s' % (path, offset), same)
report('there are two examples', len(examples) == 2)

path, steps = re.search(r'<!-- example: steps of (\S+) -->\n```steps\n(.*?)```', text, re.S).groups()
stream = tetlod.open(os.path.join(ROOT, path))
coder, models, wrong = tetlod.Coder(stream.seen_most), {}, 0
for line in steps.splitlines():
    what, name, number, wanted, state = re.fullmatch(
        r'(\w+)(?:\(([a-z]\w*(?:\[\d+\])?)?(?:, )?(\d*)\))? +(\d*) +(\w{8} \w{8})', line).groups()
    if what == 'start':
        coder.start(stream.frame(0, 0))
    elif what == 'bit':
        wrong += coder.bit(models.setdefault(name, tetlod.bits(128)), int(number or 0)) != int(wanted)
    else:
        wrong += coder.plain(int(number)) != int(wanted)
    wrong += '%08x %08x' % (coder.range, coder.code) != state
report('the steps are those of a decoder', not wrong)
code = tetlod.open(os.path.join(ROOT, path)).cursor().columns[0].codes[0][0]
report('they lead to the code that the text gives', '= %d, the float32 0.27' % code in text)

level, path, wanted = re.search(r'<!-- example: row (\d+) of (\S+) -->\n```hex\n(.*?)\n```', text, re.S).groups()
same = record_trace.row(os.path.join(ROOT, path), int(level)) == wanted
report('the row of the index is the one of the stream', same)
path, wanted = re.search(r'<!-- example: record of (\S+) -->\n```record\n(.*?)\n```', text, re.S).groups()
lines = record_trace.first_record(os.path.join(ROOT, path))
report('the record is read as the text reads it', lines == wanted.split('\n') and len(lines) > 20)

path, table = re.search(r'<!-- every byte of (\S+) -->\n(.*?)\n\n', text, re.S).groups()
rows = re.findall(r'^\| (\d+) \| ((?:[0-9a-f]{2} ?)+) \| \S.* \|$', table, re.M)
with open(os.path.join(ROOT, path), 'rb') as file:
    data = file.read()
at = [0]
for _, row in rows:
    at.append(at[-1] + len(bytes.fromhex(row)))
report('the table has every byte of the stream, each in its place',
       bytes.fromhex(''.join(row for _, row in rows)) == data and [int(row) for row, _ in rows] == at[:-1] and
       len(rows) > 50)
path, wanted = re.search(r'<!-- frames of (\S+) -->\n```level\n(.*?)\n```', text, re.S).groups()
report('the frames hold what the text says', record_trace.whole_level(os.path.join(ROOT, path)) == wanted.split('\n'))

path, wanted = re.search(r'<!-- tail of (\S+) -->\n```tail\n(.*?)\n```', text, re.S).groups()
stream, lines = tetlod.open(os.path.join(ROOT, path)), record_trace.tail(os.path.join(ROOT, path))
report('the tail is read as the text reads it', lines == wanted.split('\n') and
       '`%s`' % stream.frame(len(stream.levels) - 1, 1).hex(' ') in text)
found = stream.cursor()
found.seek(len(stream.levels) - 1)
report('it gives the values that a decoder gives', [float(line.split()[-1]) for line in lines[1:]] ==
       [float('%.9g' % value) for value in found.field(stream.fields[0]['name'])])

path, wanted = re.search(r'<!-- group of (\S+) -->\n```group\n(.*?)\n```', text, re.S).groups()
report('the pages are where the text says', record_trace.group(os.path.join(ROOT, path)) == wanted.split('\n'))

path, table = re.search(r'<!-- TIME of (\S+) -->\n(.*?)\n\n', text, re.S).groups()
rows = re.findall(r'^\| (\d+) \| ((?:[0-9a-f]{2} ?)+) \| \S.* \|$', table, re.M)
stream, at = tetlod.open(os.path.join(ROOT, path)), [0]
for _, row in rows:
    at.append(at[-1] + len(bytes.fromhex(row)))
report('the table has every byte of TIME, each in its place', bytes.fromhex(''.join(row for _, row in rows)) ==
       bytes(stream.section('TIME')) and [int(row) for row, _ in rows] == at[:-1] and len(rows) > 20)
path, wanted = re.search(r'<!-- steps of (\S+) -->\n```band\n(.*?)\n```', text, re.S).groups()
lines, series = record_trace.steps(os.path.join(ROOT, path)), stream.series()
report('the steps are read as the text reads them', lines == wanted.split('\n'))
values = [float(line.split()[-1]) for line in lines if line.startswith('vertex')]
given = [series.seek(band, step)[1]['T'] for band in range(2) for step in range(3)]
report('they give the values that a decoder gives', values == [float('%.9g' % x) for row in given for x in row])
rows = re.findall(r'^\| (\w[\w, ]*) \|', text[text.index('## 17.'):], re.M)
vectors = {word for row in rows for word in row.split(', ')}
golden = {name[:-7] for name in os.listdir(os.path.join(ROOT, 'tests', 'golden')) if name.endswith('.tetlod')}
report('the table of test vectors has all of them', golden <= vectors, golden - vectors)
finish()
