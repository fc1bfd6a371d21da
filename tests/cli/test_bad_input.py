#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Input that is no good: exit status 3 (or 1, where the system refuses the file), one clear line, and no file left."""
import os
import re
import signal
import struct
import subprocess
import zlib

from common import SANITIZED, SCRATCH, TETLOD, finish, must, path, report_problem, write

COMMANDS = {'convert': '.vtu', 'build': '.tetlod'}


def run(command, arguments, as_user=None):
    """Exit status, what is wrong with the message (or None), message. The output must not be there afterwards."""
    output = path('output' + COMMANDS[command])
    before = sorted(os.listdir(SCRATCH))
    change = (lambda: os.setuid(as_user)) if as_user is not None else None
    done = subprocess.run([TETLOD, command, *arguments, '-o', output], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, preexec_fn=change)
    message = done.stderr.decode(errors='replace')
    after = sorted(os.listdir(SCRATCH))
    problem = None
    if done.returncode == 0:
        if os.path.exists(output):
            os.remove(output)
    elif before != after:
        problem = 'left behind: %s' % sorted(set(after) - set(before))
    elif done.stdout:
        problem = 'wrote to standard output'
    elif not re.fullmatch(r'tetlod: [^\n]{10,400}\n', message):
        problem = 'not one clear line: %r' % message
    return done.returncode, problem, message


def check(name, wanted, arguments, mentions='', commands=None, as_user=None):
    for command in commands or COMMANDS:
        code, problem, message = run(command, arguments, as_user)
        if code != wanted:
            problem = 'exit status %d, not %d: %r' % (code, wanted, message)
        elif not problem and code and os.path.basename(arguments[0]) not in message:
            problem = 'the message does not name the file: %r' % message
        elif not problem and code and mentions not in message:
            problem = 'the message does not say %r: %r' % (mentions, message)
        report_problem('%s: %s' % (command, name), problem)


VTU = '''<VTKFile type="{kind}" version="1.0" byte_order="LittleEndian"{attributes}>
<{kind}><Piece NumberOfPoints="{points}" NumberOfCells="{cells}">
<PointData><DataArray type="Float32" Name="{name}" format="ascii">{field}</DataArray></PointData>
<Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">{positions}</DataArray></Points>
<Cells><DataArray type="Int64" Name="connectivity" format="ascii">{connectivity}</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">{offsets}</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">{types}</DataArray></Cells>
</Piece></{kind}></VTKFile>
'''
GOOD = dict(kind='UnstructuredGrid', attributes='', points=4, cells=1, name='s', field='1 2 3 4',
            positions='0 0 0 1 0 0 0 1 0 0 0 1', connectivity='0 1 2 3', offsets='4', types='10')

VTK = '''# vtk DataFile Version {version}
title
ASCII
DATASET {dataset}
POINTS {points} {type}
{positions}
CELLS {cells}
CELL_TYPES {types}
POINT_DATA {points}
SCALARS s float 1
LOOKUP_TABLE default
{field}
'''
GOOD_VTK = dict(version='3.0', dataset='UNSTRUCTURED_GRID', points=4, type='float', field='1 2 3 4',
                positions='0 0 0 1 0 0 0 1 0 0 0 1', cells='1 5\n4 0 1 2 3', types='1\n10')


def vtu(file, **changes):
    return write(file, VTU.format(**dict(GOOD, **changes)))


def vtk(file, **changes):
    return write(file, VTK.format(**dict(GOOD_VTK, **changes)))


def contents():
    code, problem, message = run('convert', [vtu('good.vtu')])
    report_problem('the mesh that the others spoil is good', problem or (message if code else None))
    code, problem, message = run('convert', [vtk('good.vtk')])
    report_problem('the legacy mesh that the others spoil is good', problem or (message if code else None))
    check('NaN coordinate', 3, [vtu('nan.vtu', positions='0 0 0 1 0 0 0 nan 0 0 0 1')], 'point 2')
    check('infinite coordinate', 3, [vtu('inf.vtu', positions='0 0 0 1 0 0 0 1 0 0 0 inf')], 'point 3')
    check('NaN value', 3, [vtu('nanvalue.vtu', field='1 nan 3 4')], 'field s')
    check('index out of range', 3, [vtu('range.vtu', connectivity='0 1 2 4')], 'point 4')
    check('negative index', 3, [vtu('negative.vtu', connectivity='0 1 2 -1')], 'point -1')
    check('a point named twice', 3, [vtu('twice.vtu', connectivity='0 1 2 2')], 'twice')
    check('no tetrahedra', 3, [vtu('surface.vtu', connectivity='0 1 2', offsets='3', types='5')], 'no tetrahedron')
    check('no cells', 3, [vtu('cells.vtu', cells=0, connectivity='', offsets='', types='')], 'no tetrahedron')
    check('no points', 3, [vtu('points.vtu', points=0, cells=0, connectivity='', offsets='', types='', field='',
                               positions='')], 'no point')
    check('too few corners', 3, [vtu('corners.vtu', connectivity='0 1 2', offsets='3')], 'cell 0')
    check('offsets beyond the end', 3, [vtu('offsets.vtu', offsets='400000000000')], 'connectivity')
    check('negative offset', 3, [vtu('offset.vtu', offsets='-4')], 'offsets')
    check('a cell that cannot be split', 3, [vtu('polyhedron.vtu', types='42')], 'faceoffsets')
    check('unknown cell type', 3, [vtu('type.vtu', types='200')], 'type 200')
    check('not a number', 3, [vtu('word.vtu', field='1 2 x 4')], 'value 2')
    check('too few values', 3, [vtu('few.vtu', field='1 2 3')], "'s'")
    check('too many values', 3, [vtu('many.vtu', field='1 2 3 4 5')], "'s'")
    check('count beyond the file', 3, [vtu('count.vtu', points=10**18)], 'truncated')
    check('negative count', 3, [vtu('minus.vtu', points=-4)], 'count')
    check('another VTK file', 3, [vtu('poly.vtu', kind='PolyData')], 'PolyData')
    check('unknown compressor', 3, [vtu('lzma.vtu', attributes=' compressor="vtkBestDataCompressor"')], 'zlib')
    check('a name with a line end', 3, [vtu('line.vtu', name='a&#10;b', field='1 2')], 'a?b')
    check('XML that is not VTK', 3, [write('page.vtu', '<?xml version="1.0"?><html/>')], 'html')
    check('XML that is not well-formed', 3,
          [write('tag.vtu', '<?xml version="1.0"?><VTKFile type="UnstructuredGrid"><a></b>')],
          'line 1')
    check('garbage', 3, [write('garbage.vtu', bytes(range(256)) * 9)])
    check('text', 3, [write('readme.txt', 'This is not a mesh.\n')], 'not a mesh')
    check('empty file', 3, [write('empty.vtu', '')], 'empty')
    check('legacy: version', 3, [vtk('version.vtk', version='9.0')], 'version')
    check('legacy: surface', 3, [vtk('poly.vtk', dataset='POLYDATA')], 'line 4')
    check('legacy: data type', 3, [vtk('type.vtk', type='quad')], 'quad')
    check('legacy: NaN', 3, [vtk('nan.vtk', positions='0 0 0 1 0 0 0 1 0 0 0 nan')], 'point 3')
    check('legacy: index', 3, [vtk('index.vtk', cells='1 5\n4 0 1 2 9')], 'point 9')
    check('legacy: cell beyond its size', 3, [vtk('size.vtk', cells='1 5\n9 0 1 2 3')], 'cell 0')
    check('legacy: number of types', 3, [vtk('types.vtk', types='2\n10 10')], 'CELL_TYPES')
    check('legacy: count beyond the file', 3, [vtk('count.vtk', points=10**15)], 'truncated')
    check('legacy: keyword', 3, [vtk('word.vtk', types='1\n10\nNONSENSE')], 'NONSENSE')


def outputs():
    """What only a reader has an extension for is no name for an output."""
    good = vtu('in.vtu')
    for extension in 'pvtu', 'vts', 'vti', 'vtm', 'pvd', 'foam', 'case':
        done = subprocess.run([TETLOD, 'convert', good, '-o', path('out.' + extension)], stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE)
        message = done.stderr.decode()
        problem = (None if done.returncode == 2 and 'use one of .vtu' in message and 'out.' + extension in message else
                   message)
        report_problem('-o out.%s' % extension, 'left behind' if os.path.exists(path('out.' + extension)) else problem)
    early()


def early():
    """An output that cannot be written is said before any work: before an input that is not there."""
    for command, extension, *options in (
            ('build', 'tetlod'), ('convert', 'vtu'), ('convert', 'vtkhdf', '--stream'), ('extract', 'vtu'),
            ('extract', 'tetlod'), ('diff', 'vtu', 'other.vtu', '--field', 'p'), ('plot', 'svg'),
            ('features', 'csv', '--field', 'p'), ('sample-points', 'npz', '--count', '9')):
        for where, wanted in (('no', 'make the folder first'), ('in.vtu', 'Not a directory')):
            name = path('%s/out.%s' % (where, extension))
            done = subprocess.run([TETLOD, command, path('nowhere.vtu'), *options, '-o', name], stdout=subprocess.PIPE,
                                  stderr=subprocess.PIPE)
            message = done.stderr.decode()
            good = done.returncode == 1 and message.startswith('tetlod: %s: cannot create: ' % name)
            report_problem('early: %s to %s' % (command, name), None if good and wanted in message else message)
    done = subprocess.run([TETLOD, 'extract', path('nowhere.tetlod'), '--points', path('none.csv'), '-o',
                           path('p.csv')], stderr=subprocess.PIPE)
    report_problem('early: points that are not there', None if done.returncode == 1 and
                   done.stderr.startswith(b'tetlod: %s: ' % path('none.csv').encode()) else done.stderr)


def system():
    os.mkdir(path('folder.vtu'))
    check('directory', 1, [path('folder.vtu')], 'directory')
    check('missing file', 1, [path('nowhere.vtu')], 'No such file')
    check('device', 1, ['/dev/null'], 'regular file')
    os.mkfifo(path('pipe.vtu'))
    check('pipe that nobody writes', 1, [path('pipe.vtu')], 'regular file')
    unreadable = vtu('locked.vtu')
    os.chmod(unreadable, 0)
    if os.getuid() != 0:
        check('unreadable file', 1, [unreadable], 'Permission denied')
        return
    nobody = 65534
    os.chmod(SCRATCH, 0o777)
    try:
        subprocess.run([TETLOD, '--version'], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True,
                       preexec_fn=lambda: os.setuid(nobody))
    except (PermissionError, subprocess.CalledProcessError):
        print('ok - unreadable file # SKIP another user cannot run the program here')
    else:
        check('unreadable file', 1, [unreadable], 'Permission denied', as_user=nobody)


def plot3d():
    n = 2 * 3 * 4
    grid = struct.pack('>3i', 2, 3, 4) + b''.join(
        struct.pack('>%df' % n, *[(p % 2, p // 2 % 3, p // 6)[axis] for p in range(n)]) for axis in range(3))
    solution = struct.pack('>3i4f', 2, 3, 4, 1, 0, 0, 0) + struct.pack('>%df' % (5 * n), *[1.0] * (5 * n))
    flat = struct.pack('>3i', 1, 3, 4) + bytes(12 * 12)
    check('PLOT3D: truncated grid', 3, [write('short.xyz', grid[:-4])], 'PLOT3D')
    check('PLOT3D: grid without volume', 3, [write('flat.xyz', flat)], 'no volume')
    good = write('good.xyz', grid)
    check('PLOT3D: truncated solution', 3, [good, '--q', write('short.q', solution[:-4])], 'short.q')
    check('PLOT3D: solution of another grid', 3,
          [good, '--q', write('other.q', struct.pack('>3i', 4, 3, 2) + solution[12:])],
          'other.q')
    check('PLOT3D: solution without density', 3,
          [good, '--q', write('zero.q', solution[:28] + bytes(4) + solution[32:])],
          'Pressure')
    check('PLOT3D: empty solution', 3, [good, '--q', write('empty.q', '')], 'empty.q')
    check('PLOT3D: solution of a VTU', 3, [vtu('good.vtu'), '--q', write('good.q', solution)], 'only PLOT3D')
    missing = path('nowhere.q')
    code, problem, message = run('convert', [good, '--q', missing])
    report_problem('convert: PLOT3D: missing solution', problem or
                   (None if code == 1 and missing in message else message))
    code, problem, message = run('convert', [good, '--q', path('good.q')])
    report_problem('the PLOT3D files that the others spoil are good', problem or (message if code else None))


GMSH = '''$MeshFormat
{version} 0 8
$EndMeshFormat
$Nodes
4
1 0 0 0
2 1 0 0
3 0 1 0
{last} 0 0 1
$EndNodes
$Elements
1
1 {type} 2 0 1 1 2 3 4
$EndElements
$NodeData
1
"s"
1
0
3
0
1
{values}
$EndNodeData
'''
GOOD_GMSH = dict(version='2.2', last='4', type='4', values='4\n1 5\n2 6\n3 7\n4 8')
MEDIT = 'MeshVersionFormatted 2\nDimension {dimension}\nVertices\n4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n' \
        'Tetrahedra\n{tets}\nEnd\n'
SOL = 'MeshVersionFormatted 2\nDimension 3\nSolAtVertices\n{count}\n1 {type}\n1\n2\n3\n4\nEnd\n'


def other_formats():
    def gmsh(file, **changes):
        return write(file, GMSH.format(**dict(GOOD_GMSH, **changes)))
    code, problem, message = run('convert', [gmsh('good.msh')])
    report_problem('the Gmsh file that the others spoil is good', problem or (message if code else None))
    check('Gmsh: version', 3, [gmsh('version.msh', version='3.0')], '4.0 and 4.1')
    check('Gmsh: a point twice', 3, [gmsh('twice.msh', last='3')], 'point 3')
    check('Gmsh: a point that is not there', 3, [gmsh('missing.msh', last='5')], 'point 4')
    check('Gmsh: element type', 3, [gmsh('type.msh', type='77')], 'type 77')
    check('Gmsh: values missing', 3, [gmsh('values.msh', values='3\n1 5\n2 6\n3 7')], '3 of 4')
    check('Gmsh: section without end', 3, [write('end.msh', '$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Other\n')],
          '$Other')
    mesh = write('good.mesh', MEDIT.format(dimension=3, tets='1\n1 2 3 4 0'))
    solution = write('good.sol', SOL.format(count=4, type=1))
    code, problem, message = run('convert', [mesh, '--q', solution])
    report_problem('the Medit files that the others spoil are good', problem or (message if code else None))
    check('Medit: dimension', 3, [write('flat.mesh', MEDIT.format(dimension=2, tets='1\n1 2 3 4 0'))], 'line 2')
    check('Medit: index', 3, [write('index.mesh', MEDIT.format(dimension=3, tets='1\n1 2 3 5 0'))], 'line 11')
    check('Medit: count', 3, [write('count.mesh', MEDIT.format(dimension=3, tets='900'))], 'truncated')
    check('Medit: solution of another mesh', 3, [mesh, '--q', write('count.sol', SOL.format(count=5, type=1))],
          'count.sol')
    check('Medit: type of a field', 3, [mesh, '--q', write('type.sol', SOL.format(count=4, type=9))], 'type.sol')
    node = '4 3 0 0\n0 0 0 0\n1 1 0 0\n2 0 1 0\n3 0 0 {z}\n'
    write('good.node', node.format(z=1))
    code, problem, message = run('convert', [write('good.ele', '1 4 0\n0 0 1 2 3\n')])
    report_problem('the TetGen files that the others spoil are good', problem or (message if code else None))
    write('bad.node', node.format(z='x'))
    write('bad.ele', '1 4 0\n0 0 1 2 3\n')
    check('TetGen: not a number', 3, [path('bad.node')], 'line 5')
    write('good.ele', '1 4 0\n0 0 1 2 9\n')
    check('TetGen: index', 3, [path('good.node')], 'point 9')
    write('alone.node', node.format(z=1))
    code, problem, message = run('convert', [path('alone.node')])
    report_problem('TetGen: one file of the two', problem or
                   (None if code == 1 and 'alone.ele' in message else message))


def truncated():
    """Cut at many lengths. What may be cut off without harm is the end of the XML, or digits of the last number."""
    must('sample', 'cube', '--size', '3', '-o', path('whole.vtu'))
    must('convert', path('whole.vtu'), '-o', path('whole.vtk'))
    cases = {'appended VTU': (open(path('whole.vtu'), 'rb').read(), '.vtu', b'\n  </AppendedData>'),
             'binary legacy VTK': (open(path('whole.vtk'), 'rb').read(), '.vtk', b'\n'),
             'ascii VTU': (VTU.format(**GOOD).encode(), '.vtu', b'\n'),
             'ascii legacy VTK': (VTK.format(**GOOD_VTK).encode(), '.vtk', b'4\n')}
    for name, (content, extension, tail) in cases.items():
        complete, problem, tried = content.rindex(tail), None, 0
        # cut right before or after the line that announces the point data, a legacy file is whole, but has no field
        fields = content.find(b'POINT_DATA') if extension == '.vtk' else -2
        line = content.find(b'\n', fields) if fields >= 0 else -2
        for length in sorted(set(range(0, complete, max(1, complete // (37 if SANITIZED else 97))))):
            if fields >= 0 and (fields - 2 <= length <= fields or line <= length <= line + 1):
                continue
            code, problem, message = run('convert', [write('cut' + extension, content[:length])])
            tried += 1
            problem = problem or (None if code == 3 else 'cut at %d of %d: exit %d %r' % (length, len(content), code,
                                                                                          message))
            if problem:
                break
        report_problem('%s cut at %d lengths' % (name, tried), problem)


def no_field():
    """A mesh without a field can be converted; there is nothing to build levels for."""
    text = VTU.format(**GOOD)
    bare = text[:text.index('<PointData>')] + text[text.index('<Points>'):]
    cells = bare.replace('<Points>',
                         '<CellData><DataArray type="Float32" Name="c" format="ascii">1</DataArray></CellData>'
                         '<Points>')
    legacy = VTK.format(**GOOD_VTK)
    legacy_cells = legacy[:legacy.index('POINT_DATA')] + 'CELL_DATA 1\nSCALARS c float\nLOOKUP_TABLE default\n7\n'
    check('no point field', 0, [write('bare.vtu', bare)], commands=['convert'])
    check('no point field', 0, [path('bare.vtu')], commands=['build'])
    image = '# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 3 3 3\n%s'
    for name, content in (('cell data only', write('celldata.vtu', cells)),
                          ('legacy: cell data only', write('celldata.vtk', legacy_cells)),
                          ('legacy grid: cell data only', write('image.vtk', image % (
                              'CELL_DATA 8\nSCALARS c float\nLOOKUP_TABLE default\n1 2 3 4 5 6 7 8\n')))):
        check(name, 0, [content])
    check('legacy grid: no data', 3, [write('image.vtk', image % '')], 'CELL_DATA')
    check('legacy grid: too few cells', 3, [write('image.vtk', image % (
        'CELL_DATA 7\nSCALARS c float\nLOOKUP_TABLE default\n1 2 3 4 5 6 7\n'))], 'there are 8')
    check('an unknown field', 3, [vtu('good.vtu'), '--field', 'heat'], 'heat', commands=['build'])


def shrink_while_read(name):
    """What is said of a file that is cut; None: it was read before it could be, as on a busy machine."""
    write(name, b'# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 500000 float\n'
          + 1500000 * (b'%d\n' % 10 ** 9))
    child = subprocess.Popen([TETLOD, 'convert', path(name), '-o', path('out.vtu')], stderr=subprocess.PIPE)
    with open('/proc/%d/maps' % child.pid) as maps:
        while path(name) not in maps.read():
            if child.poll() is not None:
                child.communicate()
                return None
            maps.seek(0)
    os.kill(child.pid, signal.SIGSTOP)
    os.truncate(path(name), 4096)
    os.kill(child.pid, signal.SIGCONT)
    message = child.communicate()[1].decode(errors='replace')
    return (child.returncode, message) if child.returncode else None


def shrinks():
    """A file that becomes shorter while it is mapped: the message names it."""
    tries = (shrink_while_read('shrinks.vtk') for _ in range(50))
    code, message = next(filter(None, tries), (0, 'none of 50 was cut in time'))
    report_problem('a file that shrinks', None if code == 1 and path('shrinks.vtk') in message and
                   'became shorter' in message else message)


def choices_of_nothing():
    """A block or a step of a file that has none is not passed over in silence."""
    check('--block without blocks', 3, [vtu('good.vtu'), '--block', 'a'], 'no blocks')
    check('--time without steps', 3, [vtu('good.vtu'), '--time', '3'], 'no steps')
    check('--time 0 without steps', 0, [vtu('good.vtu'), '--time', '0'])


contents()
choices_of_nothing()
outputs()
system()
shrinks()
plot3d()
other_formats()
no_field()
truncated()
finish()
