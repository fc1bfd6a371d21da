# SPDX-License-Identifier: BSD-3-Clause
"""What the lint tests share: the tree, what a command says, and results in TAP."""
import os
import subprocess
import sys

ROOT = os.environ['ROOT']
failed = []


def report(name, found):
    """A line for each thing found; nothing found is good."""
    if found:
        failed.append(name)
    print('%s - %s' % ('not ok' if found else 'ok', name))
    for line in found:
        print('# ' + line)


def output(*command):
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def finish():
    sys.exit(bool(failed))
