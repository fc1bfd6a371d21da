#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The hexadecimal examples of format/SPEC.md are the bytes of the files that they name."""
import os
import re

ROOT = os.environ.get('ROOT', '.')
text = open(os.path.join(ROOT, 'format', 'SPEC.md')).read()
examples = re.findall(r'<!-- example: (\S+) (\d+) (\d+) -->\n```hex\n(.*?)```', text, re.S)
for number, (path, offset, size, wanted) in enumerate(examples, 1):
    with open(os.path.join(ROOT, path), 'rb') as file:
        file.seek(int(offset))
        same = file.read(int(size)) == bytes.fromhex(wanted)
    print('%s %d - example of %s at byte %s' % ('ok' if same else 'not ok', number, path, offset))
print('%s %d - there are two examples' % ('ok' if len(examples) == 2 else 'not ok', len(examples) + 1))
