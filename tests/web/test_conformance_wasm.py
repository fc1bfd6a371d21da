#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The decoder of the browser as a reader of format/conformance/run; test_validate.mjs holds it against every stream."""
import os
import subprocess
import sys

from tap import finish, report

ROOT = os.environ['ROOT']
KIT = os.path.join(ROOT, 'format', 'conformance')
if not os.path.exists(os.path.join(ROOT, 'build', 'client', 'tetlod.wasm')):
    report('the decoder of the browser', True, skip='it was not built')
    sys.exit(finish())
reader = "node '%s' %%s" % os.path.join(KIT, 'wasm_reader.mjs')
for part in ('valid/profile_0', 'golden/topologies', 'invalid/magic'):
    done = subprocess.run([os.path.join(KIT, 'run'), '--reader', reader, '--only', part], stdout=subprocess.PIPE,
                          text=True)
    report('streams ' + part, done.returncode == 0, done.stdout)
sys.exit(finish())
