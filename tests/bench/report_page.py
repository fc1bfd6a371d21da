#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""usage: report_page.py PROGRAM BENCH_COLUMNS OUT.html [STREAM.tetlod | SAMPLE[:SIZE]]...

Writes one HTML page, without scripts: for each stream, or sample, the error against the bytes to send, beside VTK's
decimation and the mesh as compressed VTU; the bytes by column; the seconds of a build by phase. The error is the true
maximum by `tetlod compare` for VTK's, and the certified and the measured one for ours.
"""
import html
import json
import math
import os
import subprocess
import sys
import tempfile

from vtkmodules.vtkFiltersCore import vtkUnstructuredGridQuadricDecimation
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader, vtkXMLUnstructuredGridWriter

COLUMNS = ('which vertex splits', 'labels', 'tetrahedra', 'base mesh', 'positions', 'field values')
PHASES = ('read', 'contract', 'measure', 'encode', 'write')
REDUCTIONS = (.5, .8, .9, .95, .98)
COLOURS = ('#2a6fb0', '#d95f02', '#1b9e77', '#7570b3', '#a6761d', '#888888', '#c2c2c2')
WIDTH, HEIGHT, LEFT, BOTTOM = 660, 340, 70, 46
STYLE = '''body{font:15px/1.5 system-ui,sans-serif;max-width:1000px;margin:2em auto;padding:0 1em;color:#222}h2{margin-top:2.2em}
svg{max-width:100%}table{border-collapse:collapse}td,th{padding:2px 12px 2px 0;text-align:right}td:first-child,th:first-child{text-align:left}
svg text{font:12px system-ui,sans-serif;fill:#333}.note{color:#555}'''


def run(*command):
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        sys.exit('%s: %s' % (' '.join(command), done.stderr.strip()))
    return done.stdout


def original(program, what, folder):
    """The mesh as VTU, and the fields that the stream controls."""
    path = os.path.join(folder, 'original.vtu')
    if os.path.exists(what):
        run(program, 'extract', what, '-o', path)
        return path, [f['name'] for f in json.loads(run(program, 'info', what, '--json'))['fields'] if f['controlled']]
    name, _, size = what.partition(':')
    run(program, 'sample', name, *(['--size', size] if size else []), '-o', path)
    return path, []


def read(path):
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(path)
    reader.Update()
    return reader.GetOutput()


def write(grid, path):
    """As compressed VTU; gives its bytes."""
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetCompressorTypeToZLib()
    writer.SetFileName(path)
    writer.Write()
    return os.path.getsize(path)


def with_one_field(grid, field):
    """Only this field is compared: bytes of others count for nobody."""
    for name in [grid.GetPointData().GetArrayName(i) for i in range(grid.GetPointData().GetNumberOfArrays())]:
        if name != field:
            grid.GetPointData().RemoveArray(name)
    return grid


def decimations(program, path, field, folder):
    """Bytes, tetrahedra and true error of what VTK's decimation leaves."""
    for reduction in REDUCTIONS:
        decimation = vtkUnstructuredGridQuadricDecimation()
        decimation.SetInputData(with_one_field(read(path), field))
        decimation.SetScalarsName(field)
        decimation.SetTargetReduction(reduction)
        decimation.Update()
        grid, out = decimation.GetOutput(), os.path.join(folder, 'decimated.vtu')
        (grid.GetPointData().GetArray(field) or grid.GetPointData().GetArray(0)).SetName(field)
        size = write(grid, out)
        yield size, grid.GetNumberOfCells(), json.loads(run(program, 'compare', path, out, '--field', field,
                                                            '--json'))['errors']['max']


def plot(lines, marks):
    """A diagram with logarithmic axes. lines: (name, points); marks: vertical lines (name, bytes)."""
    xs = [x for _, points in lines for x, _ in points] + [x for _, x in marks]
    ys = [y for _, points in lines for _, y in points]
    x0, x1, y0, y1 = math.log10(min(xs)), math.log10(max(xs) * 1.1), math.floor(math.log10(min(ys))), math.ceil(
        math.log10(max(ys)))
    across = lambda x: LEFT + (math.log10(x) - x0) / (x1 - x0) * (WIDTH - LEFT - 10)  # noqa: E731
    down = lambda y: 10 + (y1 - math.log10(y)) / max(1, y1 - y0) * (HEIGHT - BOTTOM - 10)  # noqa: E731
    out = ['<svg viewBox="0 0 %d %d" role="img" aria-label="error against bytes">' % (WIDTH, HEIGHT)]
    for power in range(y0, y1 + 1):
        out.append('<path d="M%d %.1fH%d" stroke="#ddd"/><text x="%d" y="%.1f" text-anchor="end">%g %%</text>' % (
            LEFT, down(10 ** power), WIDTH - 10, LEFT - 6, down(10 ** power) + 4, 100 * 10 ** power))
    for power in range(math.ceil(x0), math.floor(x1) + 1):
        out.append('<path d="M%.1f 10V%d" stroke="#ddd"/><text x="%.1f" y="%d" text-anchor="middle">%s</text>' % (
            across(10 ** power), HEIGHT - BOTTOM, across(10 ** power), HEIGHT - BOTTOM + 16, size_text(10 ** power)))
    for i, (name, x) in enumerate(marks):
        out.append(
            '<path d="M%.1f 10V%d" stroke="%s" stroke-dasharray="4 3"/><text x="%.1f" y="%d" '
            'text-anchor="end">%s</text>'
            % (across(x), HEIGHT - BOTTOM, COLOURS[5], across(x) - 4, 22 + 15 * i, name))
    for i, (name, points) in enumerate(lines):
        path = ' '.join('%.1f,%.1f' % (across(x), down(y)) for x, y in points)
        out.append('<polyline points="%s" fill="none" stroke="%s" stroke-width="2"/>' % (path, COLOURS[i]))
        out += ['<circle cx="%.1f" cy="%.1f" r="2.5" fill="%s"/>' % (across(x), down(y), COLOURS[i]) for x, y in points]
        out.append('<rect x="%d" y="%d" width="12" height="4" fill="%s"/><text x="%d" y="%d">%s</text>' % (
            LEFT + 190 * i, HEIGHT - 12, COLOURS[i], LEFT + 190 * i + 17, HEIGHT - 6, name))
    return ''.join(out) + '</svg>'


def bar(parts, unit):
    """One bar of parts (name, value), with a list under it."""
    total, at, out = sum(value for _, value in parts) or 1, 0.0, ['<svg viewBox="0 0 %d 26">' % WIDTH]
    for i, (_, value) in enumerate(parts):
        out.append('<rect x="%.1f" width="%.1f" height="22" fill="%s"/>' % (at, value / total * WIDTH, COLOURS[i]))
        at += value / total * WIDTH
    rows = ''.join('<tr><td><span style="color:%s">&#9632;</span> %s</td><td>%.2f %s</td><td>%.0f %%</td></tr>' % (
        COLOURS[i], name, value, unit, 100 * value / total) for i, (name, value) in enumerate(parts))
    return ''.join(out) + '</svg><table>%s</table>' % rows


def size_text(size):
    return '%.3g MB' % (size / 1e6) if size >= 999500 else '%.3g kB' % (size / 1e3) if size >= 1e3 else '%d B' % size


def section(program, columns, what, folder):
    path, controlled = original(program, what, folder)
    stream, field_options = os.path.join(folder, 'one.tetlod'), [o for name in controlled for o in ('--field', name)]
    index = json.loads(run(program, 'build', path, '-o', stream, '--json', '--quiet', *field_options))
    field = next(f['name'] for f in index['fields'] if f['controlled'])
    single = json.loads(run(program, 'build', path, '-o', os.path.join(folder, 'field.tetlod'), '--json', '--quiet',
                            '--field', field, '--carry', field))
    whole = write(with_one_field(read(path), field), os.path.join(folder, 'whole.vtu'))
    lines = [('tetlod, certified', [(k['bytes'], k['errors'][field]['max']) for k in single['levels']
                                    if k['errors'][field]['max'] > 1e-6]),
             ('tetlod, measured', [(k['bytes'], k['errors'][field]['sampled']) for k in single['levels']
                                   if k['errors'][field]['sampled'] > 1e-6])]
    found = list(decimations(program, path, field, folder)) if ':' not in field else []
    if found:
        lines.append(('VTK decimation, true maximum', [(size, error) for size, _, error in found if error > 0]))
    bits = [float(n) for n in run(columns, stream).strip().split(',')]
    parts = list(zip(COLUMNS, bits)) + [('values of the last level, index, header',
                                         max(0, 8 * index['bytes'] / index['tets'] - sum(bits)))]
    rows = ''
    for size, tets, error in found:
        same = next(k for k in single['levels'] if k['errors'][field]['max'] <= error)
        rows += '<tr><td>%.3g %%</td><td>%s</td><td>%d</td><td>%s</td><td>%d</td></tr>' % (
            100 * error, size_text(size), tets, size_text(same['bytes']), same['tets'])
    return '''<h2>%s</h2><p>%d vertices, %d tetrahedra, %d field%s; the whole stream takes %s (%.2f bits a tetrahedron). Threads: %d.</p>
<h3>Error against bytes, field %s</h3>%s<p class="note">Both axes are logarithmic. Every file holds this field alone. The dashed lines are whole meshes without an error.</p>
<table><tr><th>error of VTK's mesh</th><th>VTK, compressed VTU</th><th>tetrahedra</th><th>tetlod at that error, certified</th><th>tetrahedra</th></tr>%s</table>
<h3>Bytes by column, all fields</h3>%s<h3>Build time by phase</h3>%s''' % (
        html.escape(os.path.basename(what)), index['vertices'], index['tets'], len(
            index['fields']), 's'[:len(index['fields']) - 1], size_text(
                index['bytes']), 8 * index['bytes'] / index['tets'], index['threads'], html.escape(field),
        plot(lines, [('compressed VTU, ' + size_text(whole), whole),
                     ('whole stream, ' + size_text(single['bytes']), single['bytes'])]), rows, bar(
                         parts, 'bits/tet'), bar([(name, index['seconds'][name]) for name in PHASES], 's'))


def main():
    program, columns, out = sys.argv[1:4]
    sections = []
    for what in sys.argv[4:] or ['fin', 'cube', 'torus']:
        with tempfile.TemporaryDirectory(prefix='tetlod-report-') as folder:
            sections.append(section(os.path.abspath(program), os.path.abspath(columns), what, folder))
    with open(out, 'w', encoding='utf-8') as page:
        page.write(
            '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>tetlod: error, bytes, time</title>'
            '<style>%s</style></head>'
            '<body><h1>Error, bytes, time</h1><p class="note">%s, <code>make report</code></p>%s</body></html>\n' %
            (STYLE, html.escape(run(program, '--version').strip()), ''.join(sections)))
    print(out)


if __name__ == '__main__':
    main()
