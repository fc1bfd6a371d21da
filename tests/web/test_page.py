#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The page in a browser: serves a sample, page.mjs looks at it, and at a notebook with streams of two servers, as
nbconvert shows it."""
import os
import subprocess
import sys

ROOT = os.environ['ROOT']
sys.path.insert(0, os.path.join(ROOT, 'tests', 'http'))
from served import SCRATCH, TETLOD, Server  # noqa: E402

mesh, folder = os.path.join(SCRATCH, 'fin.vtu'), os.path.join(SCRATCH, 'streams')
os.mkdir(folder)
subprocess.run([TETLOD, 'sample', 'fin', '-o', mesh], check=True, stdout=subprocess.DEVNULL)
subprocess.run([TETLOD, 'build', mesh, '--field', 'Pressure', '--quiet', '-o', os.path.join(folder, 'fin.tetlod')],
               check=True)
sys.path.insert(0, os.path.join(ROOT, 'client-examples', 'python'))
import tetlod  # noqa: E402
from nbconvert import HTMLExporter  # noqa: E402
from nbformat import v4  # noqa: E402


def cell(server):
    with tetlod.open(server.url + 'v1/meshes/fin', error='20%') as stream:
        return v4.new_code_cell('stream',
                                outputs=[v4.new_output('execute_result', {'text/html': stream._repr_html_()})])


assert tetlod.open(os.path.join(folder, 'fin.tetlod'))._repr_html_() is None
with Server(folder) as server, Server(folder, '--cors', '*') as open_server:
    notebook = v4.new_notebook(cells=[cell(server), cell(open_server)],
                               metadata={'language_info': {'name': 'python', 'pygments_lexer': 'python3'}})
    path = os.path.join(SCRATCH, 'cells.html')
    with open(path, 'w') as page:
        page.write(HTMLExporter(template_name='lab').from_notebook_node(notebook)[0])
    sys.exit(subprocess.run(['node', os.path.join(ROOT, 'tests', 'web', 'page.mjs'), server.url, path]).returncode)
