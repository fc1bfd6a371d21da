#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The command line as a new user tries it: outputs over inputs, wrong extensions, prefixes as files, downloads that
stopped, mail."""
import os
import re
import shutil

from common import ROOT, case, fails, finish, info, must, path, report, succeeds, tetlod, write


def content(name):
    with open(path(name), 'rb') as file:
        return file.read()


def outputs_over_inputs():
    before = content('fin.vtu')
    os.link(path('fin.vtu'), path('linked.vtu'))
    os.symlink(path('fin.vtu'), path('soft.tetlod'))
    fails('build refuses to write onto its input', 2, ['fin.vtu', 'input'], 'build', 'fin.vtu', '-o', 'fin.vtu')
    fails('also through a symbolic link', 2, ['input'], 'build', 'fin.vtu', '-o', 'soft.tetlod')
    fails('convert refuses, also through a hard link', 2, ['linked.vtu', 'input'], 'convert', 'fin.vtu', '-o',
          'linked.vtu')
    fails('extract refuses', 2, ['input'], 'extract', 'fin.tetlod', '-o', './fin.tetlod')
    shutil.copy(path('fin.tetlod'), path('picture.svg'))
    fails('plot refuses', 2, ['input'], 'plot', 'picture.svg', '-o', 'picture.svg')
    write(
        'two.pvtu',
        '<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid><Piece Source="fin.vtu"/></PUnstructuredGrid></VTKFile>')
    fails('convert refuses to write onto a piece of its input', 2, ['two.pvtu', 'fin.vtu', 'output'], 'convert',
          'two.pvtu', '-o', 'linked.vtu')
    report('and the input is as it was', content('fin.vtu') == before)


def extensions():
    fails('build refuses an extension of another format', 2, ['w.vtu', 'w.tetlod'], 'build', 'fin.vtu', '-o', 'w.vtu')
    fails('plot refuses .png', 2, ['p.png', 'p.svg'], 'plot', 'fin.tetlod', '-o', 'p.png')
    succeeds('a name without a known extension is fine', 'build', 'fin.vtu', '-o', 'run.7', '--quiet')
    report('nothing else was written', not os.path.exists(path('w.vtu')) and not os.path.exists(path('p.png')))


def parts():
    whole = info('fin.tetlod')
    level = next(k['level'] for k in whole['levels'] if k['errors']['Pressure']['max'] <= 0.01)
    must('extract', 'fin.tetlod', '--error', '1%', '-o', 'part.tetlod')
    part = info('part.tetlod')
    keys = ('vertices', 'tets', 'errors', 'domain_error')
    if [[k[key] for key in keys] for k in part['levels']] != [[k[key] for key in keys]
                                                              for k in whole['levels'][:level + 1]]:
        return part['levels']
    if (part['lossless'] or not whole['lossless'] or part['bytes'] != os.path.getsize(path('part.tetlod'))
            or part['bytes'] > whole['levels'][level]['bytes']):
        return part
    must('verify', 'part.tetlod')
    for k in (0, level // 2, level):
        for name in ('fin', 'part'):
            must('extract', name + '.tetlod', '--level', str(k), '-o', name + '.vtk' if name == 'part' else 'whole.vtk')
        if content('part.vtk') != content('whole.vtk'):
            return 'level %d differs' % k
    must('extract', 'fin.tetlod', '-o', 'copy.tetlod')
    if content('copy.tetlod') != content('fin.tetlod'):
        return 'the finest level is not the stream itself'
    must('extract', 'part.tetlod', '--level', '0', '-o', 'base.tetlod')
    must('verify', 'base.tetlod')
    return (None if len(info('base.tetlod')['levels']) == 1 and whole['cid'].encode() in content('part.tetlod') else
            info('base.tetlod'))


def parts_with_cells():
    """Values of tetrahedra go with the levels."""
    stream = os.path.join(ROOT, 'tests', 'golden', 'cells_float32.tetlod')
    found = info(stream)
    level = len(found['levels']) // 2
    must('extract', stream, '--level', str(level), '-o', 'cells.tetlod')
    must('extract', stream, '--level', str(level), '-o', 'whole.vtk')
    must('extract', 'cells.tetlod', '-o', 'part.vtk')
    part = content('part.vtk')
    return None if content('whole.vtk') == part and b'CELL_DATA' in part else 'the levels differ'


def cut_off():
    levels = info('fin.tetlod')['levels']
    data = content('fin.tetlod')
    write('cut.tetlod', data[:levels[9]['bytes'] + 5])
    write('stub.tetlod', data[:levels[0]['bytes'] - 5])
    said = must('info', 'cut.tetlod').stdout.decode()
    if 'levels 0 to 9 of %d are here' % (len(levels) - 1) not in said:
        return said
    said = must('extract', 'cut.tetlod', '-o', 'cut.vtu').stderr.decode()
    must('extract', 'fin.tetlod', '--level', '9', '-o', 'nine.vtu')
    if 'cut off: levels 0 to 9' not in said or content('cut.vtu') != content('nine.vtu'):
        return said
    must('extract', 'cut.tetlod', '-o', 'saved.tetlod')
    must('verify', 'saved.tetlod')
    fails('a level that is not there is refused', 3, ['cut off', 'levels 0 to 9', 'level 10'], 'extract', 'cut.tetlod',
          '--level', '10', '-o', 'x.vtu')
    fails('and so is a file without level 0', 3, ['cut off'], 'extract', 'stub.tetlod', '-o', 'x.vtu')
    return None if len(info('saved.tetlod')['levels']) == 10 else info('saved.tetlod')


def mail():
    must('build', 'fin.vtu', '-o', 'default.tetlod', '--field', 'Pressure', '--carry', 'Pressure', '--quiet')
    said = must('build', 'fin.vtu', '--for', 'mail', '--error', '2%', '--field', 'Pressure', '-o',
                'mail.tetlod').stdout.decode()
    found, whole = info('mail.tetlod'), info('default.tetlod')
    bound = re.search(r'Pressure \u2264 ([\d.]+) % of the range', said)
    finest = found['levels'][-1]['errors']['Pressure']['max']
    if not bound or not 0 <= float(bound[1]) - 100 * finest < 0.01 * float(bound[1]) or not 0.01 < finest <= 0.02:
        return said, finest
    size = next(k['bytes'] for k in whole['levels'] if k['errors']['Pressure']['max'] <= 0.02)
    if found['lossless'] or [f['name'] for f in found['fields']] != ['Pressure'] or found['bytes'] > 1.2 * size:
        return found['bytes'], size
    must('verify', 'mail.tetlod')
    must('build', 'fin.vtu', '--for', 'mail', '--error', '2%', '--field', 'Pressure', '-o', 'again.tetlod',
         '--threads', '1', '--quiet')
    if content('again.tetlod') != content('mail.tetlod'):
        return 'the bytes depend on threads'
    measured = must('compare', 'fin.vtu', 'mail.tetlod', '--field', 'Pressure', '--json').stdout.decode()
    if float(re.search(r'"max": ([-.e\d]+)', measured)[1]) > finest * (1 + 1e-9) and 'domain' not in measured:
        return measured, finest
    fails('mail is the only purpose', 2, ['--for', 'mail'], 'build', 'fin.vtu', '--for', 'fax')
    fails('--error goes with --for', 2, ['--max-error'], 'build', 'fin.vtu', '--error', '1%')
    return None


def units():
    width = next(f['range'][1] - f['range'][0] for f in info('fin.tetlod')['fields'] if f['name'] == 'Pressure')
    must('build', 'fin.vtu', '--field', 'Pressure', '--abs-error', '0.1', '-o', 'units.tetlod', '--quiet')
    must('build', 'fin.vtu', '--field', 'Pressure:%.17g' % (0.1 / width), '-o', 'fraction.tetlod', '--quiet')
    levels = [info(name)['levels'] for name in ('units.tetlod', 'fraction.tetlod')]
    if (levels[0][0]['errors'] != levels[1][0]['errors']
            or not 0.05 / width < levels[0][0]['errors']['Pressure']['max'] <= 0.1 / width):
        return levels[0][0], levels[1][0]
    fails('a limit that looks like units says how to give it', 3, ['--abs-error 500', 'Pressure'], 'build', 'fin.vtu',
          '--field', 'Pressure:500')
    fails('--abs-error belongs to a field', 2, ['--field'], 'build', 'fin.vtu', '--abs-error', '500')
    fails('and to one that has no other limit', 2, ['--abs-error'], 'build', 'fin.vtu', '--field', 'Pressure:1%',
          '--abs-error', '500')
    return None


def compare_parts():
    must('extract', 'fin.tetlod', '--error', '5%', '-o', 'five.vtu')
    for name in ('Velocity:mag', 'Velocity:0'):
        said = must('compare', 'fin.vtu', 'five.vtu', '--field', name).stdout.decode()
        if not said.startswith('field         ' + name):
            return said
    fails('compare names what there is', 3, ['second mesh', 'Velocity'], 'compare', 'fin.vtu', 'mail.tetlod',
          '--field', 'Velocity:mag')
    return None


def tables():
    said = must('build', 'fin.vtu', '-o', 'table.tetlod').stdout.decode().splitlines()
    levels = info('table.tetlod')['levels']
    rows = [line for line in said if re.match(r' +\d+ +\d+ ', line)]
    if not 5 < len(rows) < 12 or rows[-1].split()[0] != str(len(levels) - 1) or 'predicted' in said[0]:
        return said
    every = must('info', 'table.tetlod', '--all').stdout.decode()
    rows = [line for line in every.splitlines() if re.match(r' +\d+ +\d+ ', line)]
    if len(rows) != len(levels) or 'predicted' not in every:
        return every
    return None if not must('build', 'fin.vtu', '-o', 'table.tetlod', '--quiet').stdout else 'not quiet'


def names():
    """Arrays that are left out are named."""
    text = re.sub(rb'(<PointData[^>]*>)', rb'\1<DataArray type="String" Name="label" format="ascii">65 0</DataArray>',
                  content('fin.vtu'), count=1)
    write('label.vtu', text)
    done = tetlod('convert', 'label.vtu', '-o', 'label.vtk')
    return None if done.returncode == 0 and b"left out: 'label'" in done.stderr else done


must('sample', 'fin', '--size', '14', '-o', 'fin.vtu')
must('build', 'fin.vtu', '-o', 'fin.tetlod', '--quiet')
outputs_over_inputs()
extensions()
case('extract writes the levels up to one as a stream', parts)
case('with values of tetrahedra', parts_with_cells)
case('a file that is cut off gives what it holds', cut_off)
case('build --for mail', mail)
case('limits in units', units)
case('compare takes parts of vectors', compare_parts)
for command in ('build', 'x.vtu', '-o', 'x.tetlod'), ('verify', 'x.tetlod'), ('compare', 'x.vtu', 'y.vtu'):
    fails('%s: more threads than there can be' % command[0], 2, ('from 0 to 64', "'65'"), *command, '--threads', '65')
case('build and info print about ten levels', tables)
case('arrays that are left out are named', names)
finish()
