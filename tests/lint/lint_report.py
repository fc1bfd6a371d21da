# SPDX-License-Identifier: BSD-3-Clause
"""What the lint tests share: the tree, what a command says, and results in TAP."""
import os
import subprocess

import tap

ROOT = os.environ['ROOT']
finish = tap.finish


def report(name, found):
    """Nothing found is good."""
    tap.report(name, not found, '\n'.join(found))


def output(*command):
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
