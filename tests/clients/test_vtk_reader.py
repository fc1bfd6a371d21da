#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""vtkTetlodReader, built against the VTK that is installed: the numbers of `extract`, steps, boxes, arrays, URLs,
how it stops, its errors, and pictures where there is a display."""
import contextlib
import glob
import json
import os
import re
import shutil
import subprocess
import sys
import time

ROOT = os.environ['ROOT']
sys.path.insert(0, os.path.join(ROOT, 'tests', 'http'))
from served import SCRATCH, TETLOD, Server, run  # noqa: E402
import tetlod as package  # noqa: E402

MODULE = os.path.join(ROOT, 'build', 'vtk', 'lib', 'python3', 'dist-packages')
GOLDEN = os.path.join(ROOT, 'tests', 'golden')
STREAMS = ('cells_float32', 'grid_12_bit', 'grid_float64', 'holes_float32', 'kept_order', 'local_bound',
           'paged_float32', 'parents_float32', 'soup_30_bit', 'soup_float64', 'tail_float32')
SERIES = ('series_float32', 'series_moving', 'series_parents', 'topologies')


def missing():
    """Why it cannot be built here; None: it can."""
    if not all(map(shutil.which, ('cmake', 'c++'))) or not glob.glob('/usr/lib/*/cmake/vtk-9*/vtk-config.cmake'):
        return 'cmake, a C++ compiler or libvtk9-dev is not installed (make deps-vtk)'
    return None


def make(target):
    environment = {k: v for k, v in os.environ.items() if k not in ('MAKEFLAGS', 'MAKELEVEL', 'MFLAGS')}
    done = subprocess.run(['make', '-s', '-C', ROOT, target], env=environment, stdin=subprocess.DEVNULL,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    log = os.path.join(ROOT, 'build', target + '.log')
    return done.returncode == 0, done.stdout + (open(log).read()[-3000:] if os.path.exists(log) else '')


def tetlod(*arguments):
    return subprocess.run([TETLOD, *map(str, arguments)], check=True, cwd=SCRATCH, stdout=subprocess.PIPE,
                          text=True).stdout


def golden(name):
    return os.path.join(GOLDEN, name + '.tetlod')


def reader(path, **settings):
    from tetlod_vtk import vtkTetlodReader
    made = vtkTetlodReader()
    made.SetFileName(path)
    made.said = []
    for event in ('ErrorEvent', 'WarningEvent'):
        made.AddObserver(event, said(made, event))
    for name, value in settings.items():
        getattr(made, 'Set' + name)(*(value if isinstance(value, tuple) else (value,)))
    return made


def said(made, event):
    def observe(caller, name, text):
        made.said.append(text)
    observe.CallDataType = 'string0'
    return observe


def level(path, **settings):
    made = reader(path, **settings)
    made.Update()
    assert not made.said, (path, settings, made.said)
    return made.GetOutput()


def arrays(grid):
    """Every array by its name, with its type, and the corners."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    found = {'points': vtk_to_numpy(grid.GetPoints().GetData()) if grid.GetPoints() else None,
             'corners': vtk_to_numpy(grid.GetCells().GetConnectivityArray()).astype(int)}
    for kind in 'Point', 'Cell', 'Field':
        data = getattr(grid, 'Get%sData' % kind)()
        for i in range(data.GetNumberOfArrays()):
            array = data.GetArray(i)
            if array is not None:
                found[kind, array.GetName()] = vtk_to_numpy(array)
    return found


def extracted(path, *choice):
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader
    out = os.path.join(SCRATCH, 'extracted.vtu')
    tetlod('extract', path, *choice, '-o', out, '--quiet')
    file = vtkXMLUnstructuredGridReader()
    file.SetFileName(out)
    file.Update()
    return file.GetOutput()


def same(one, other, about):
    """All arrays are the same, those of points with their types; field data has the numbers of the other one, which has
    none where it is the original."""
    import numpy as np
    a, b = arrays(one), arrays(other)
    assert set(b) <= set(a) and all(name[0] == 'Field' for name in set(a) - set(b)), (about, set(a) ^ set(b))
    for name in b:
        values = a[name]
        assert name[0] in ('Field', 'Cell') or values.dtype == b[name].dtype, (about, name, values.dtype, b[name].dtype)
        assert values.shape == b[name].shape and np.array_equal(values, b[name], equal_nan=True), (about, name)


def test_levels():
    """Levels by number, error and budget have the numbers of `extract`, and the stream goes from one to the next."""
    for name in STREAMS:
        made = reader(golden(name))
        made.UpdateInformation()
        last = len(package.open(golden(name)).levels) - 1
        for number in {0, last // 2, last}:
            made.SetLevel(number)
            made.Update()
            same(made.GetOutput(), extracted(golden(name), '--level', number), (name, number))
        assert not made.said and last > 0, (name, made.said, last)
    path = golden('grid_float64')
    for setting, choice in (({'Error': 0.05}, ('--error', 0.05)), ({'ErrorPercent': 2}, ('--error', '2%')),
                            ({'Error': 0, 'MaxBytes': 2000}, ('--bytes', 2000)),
                            ({'Error': 0, 'MaxTets': 100}, ('--tets', 100)), ({'AbsError': 0.1}, ('--abs-error', 0.1)),
                            ({'Error': 0.1, 'Measure': 1}, ('--error', 0.1, '--measure', 'sampled'))):
        same(level(path, **setting), extracted(path, *choice), setting)


def test_steps():
    """Steps of series, of those whose points move and whose meshes change, at two errors, forwards and back."""
    for name in SERIES:
        made = reader(golden(name))
        made.UpdateInformation()
        times = made.GetOutputInformation(0).Get(made.GetExecutive().TIME_STEPS())
        for error in 0.2, 0:
            for number in (0, len(times) - 1, 1):
                made.SetError(error)
                made.UpdateTimeStep(times[number])
                assert not made.said, (name, made.said)
                expected = extracted(golden(name), '--step', number, '--error', error)
                same(made.GetOutput(), expected, (name, number, error))
                assert made.GetOutput().GetInformation().Get(made.GetOutput().DATA_TIME_STEP()) == times[number]


def test_box():
    """Output 1 has those of the finer level that meet the box: the ones that `extract --box` marks and that meet it."""
    import numpy as np
    fin = os.path.join(SCRATCH, 'fin.tetlod')
    box = (-1.0, 0.5, 0.2, 1.0, 0.1, 0.9)
    made = reader(fin, Error=0.05, Box=True, BoxError=0.002, BoxBounds=box)
    made.Update(0)
    made.Update(1)
    same(made.GetOutput(0), extracted(fin, '--error', 0.05), 'outside')
    part, fine = arrays(made.GetOutput(1)), arrays(extracted(fin, '--error', 0.002))
    text = '%g,%g,%g,%g,%g,%g' % (*box[0::2], *box[1::2])
    mixed = arrays(extracted(fin, '--error', 0.05, '--box', text, '--box-error', 0.002))

    def tets(found, chosen=slice(None)):
        return {tuple(row) for row in found['points'][found['corners'].reshape(-1, 4)[chosen]].reshape(-1, 12)}
    ours, marked = tets(part), tets(mixed, mixed['Cell', 'Region'] == 1)
    low, high = np.array(box[0::2]), np.array(box[1::2])
    corners = fine['points'][fine['corners'].reshape(-1, 4)]
    inside = ((corners >= low) & (corners <= high)).all(2).any(1)
    beside = ((corners < low).all(1) | (corners > high).all(1)).any(1)
    assert tets(fine, inside) <= ours <= tets(fine, ~beside) and ours <= marked, (len(ours), len(marked))
    assert 100 < len(ours) < len(fine['corners']) / 8 and set(part) == set(fine), (len(ours), len(fine['corners']) / 4)
    made.BoxOff()
    made.Update(1)
    assert made.GetOutput(1).GetNumberOfCells() == 0


PAGED = {  # samples, options of build, box (x0, y0, z0, x1, y1, z1), outside, in the box; None: the finest
    'ring': (('torus', '--size', '5'), ('--paged=200',), (0, 0, -1, 1.2, 1.2, 1), 0.2, None),
    'cells': (('cube', '--size', '9'), ('--paged=200',), (0, 0, 0, .4, .4, .4), 0.1, 0.01),
    'tail': (('fin', '--size', '12'), ('--paged=300', '--position-bits', '12', '--field-bits', '10'),
             (-1, 0.2, 0.1, 0.5, 1, 0.9), 0.05, 0.005)}


def add_cells(name):
    """Values of cells: their numbers, and a vector."""
    import numpy as np
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader, vtkXMLUnstructuredGridWriter
    file, out = vtkXMLUnstructuredGridReader(), vtkXMLUnstructuredGridWriter()
    for at in file, out:
        at.SetFileName(os.path.join(SCRATCH, name))
    file.Update()
    count = file.GetOutput().GetNumberOfCells()
    numbers = np.arange(3 * count, dtype='i4')
    for label, values in ('part', numbers[:count] % 37), ('flow', np.sin(numbers).reshape(-1, 3)):
        array = numpy_to_vtk(values, deep=1)
        array.SetName(label)
        file.GetOutput().GetCellData().AddArray(array)
    out.SetInputData(file.GetOutput())
    out.Write()


def test_region():
    """Of a stream in pages a box gives one mesh, that of `extract --box`; the same reader goes on to another box, to a
    level and back, with other arrays."""
    for name, (sample, options, box, outside, inside) in PAGED.items():
        path = os.path.join(SCRATCH, name + '.tetlod')
        tetlod('sample', *sample, '-o', name + '.vtu')
        if name == 'cells':
            add_cells(name + '.vtu')
        tetlod('build', name + '.vtu', '-o', path, *options, '--quiet')
        made = reader(path, Error=outside, Box=True, BoxError=inside or 0)
        parts = set()
        for low, high in (box[:3], box[3:]), (box[:3], tuple(a + (b - a) / 3 for a, b in zip(box[:3], box[3:]))):
            made.SetBoxBounds(*(bound for pair in zip(low, high) for bound in pair))
            made.Update(0)
            made.Update(1)
            choice = ['--error', outside, '--box', '%.17g,%.17g,%.17g,%.17g,%.17g,%.17g' % (*low, *high)]
            wanted = extracted(path, *choice, *(['--box-error', inside] if inside else []))
            same(made.GetOutput(0), wanted, (name, low, high))
            assert not made.said and made.GetOutput(1).GetNumberOfCells() == 0, (name, made.said)
            parts |= set(arrays(made.GetOutput(0))['Cell', 'Region'])
        assert {1} < parts <= {0, 1, 2}, (name, parts)
        made.BoxOff()
        made.SetPointArrayStatus(made.GetPointArrayName(0), 0)
        made.Update()
        found, level = arrays(made.GetOutput()), arrays(extracted(path, '--error', outside))
        assert (found['points'] == level['points']).all() and (found['corners'] == level['corners']).all(), name
        made.BoxOn()
        made.SetPointArrayStatus(made.GetPointArrayName(0), 1)
        made.Update()
        same(made.GetOutput(), wanted, (name, 'again'))


def test_region_of_url():
    """Of a URL only the pages that the box needs are fetched."""
    path = os.path.join(SCRATCH, 'pages.tetlod')
    tetlod('sample', 'fin', '--size', 28, '-o', 'pages.vtu')
    tetlod('build', 'pages.vtu', '--field', 'Pressure', '--paged=1000', '-o', path, '--quiet')
    for box, share in ((3, 4, 7, 8, 3, 4), 0.9), ((5, 6, 7, 8, 3, 4), 0.25):  # a corner, which needs much; nothing
        before = len(asked())
        with host() as place:
            made = reader(place + 'pages.tetlod', Error=0.2, Box=True, BoxError=0, BoxBounds=box)
            made.Update()
        text = ','.join(map(str, (*box[0::2], *box[1::2])))
        same(made.GetOutput(0), extracted(path, '--error', 0.2, '--box', text), text)
        spans = [list(map(int, re.findall(r'\d+', span))) for _, span, _ in asked()[before:]]
        took, whole = sum(last + 1 - first for first, last in spans), os.path.getsize(path)
        assert took < share * whole and len(spans) < 9, (took, whole, spans)


def test_arrays():
    """Arrays come and go by their selection; nothing is decoded for those that are off."""
    made = reader(golden('cells_float32'), Level=1)
    made.UpdateInformation()
    points = [made.GetPointArrayName(i) for i in range(made.GetNumberOfPointArrays())]
    cells = [made.GetCellArrayName(i) for i in range(made.GetNumberOfCellArrays())]
    assert points and cells, (points, cells)
    made.SetPointArrayStatus(points[0], 0)
    made.SetCellArrayStatus(cells[0], 0)
    made.Update()
    grid = made.GetOutput()
    assert not grid.GetPointData().HasArray(points[0]) and not grid.GetCellData().HasArray(cells[0])
    made.SetPointArrayStatus(points[0], 1)
    made.SetCellArrayStatus(cells[0], 1)
    made.Update()
    same(made.GetOutput(), extracted(golden('cells_float32'), '--level', 1), 'on again')


HOST = """
import http.server, json, os, re, time
class Host(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        with open('asked', 'a') as log:
            log.write(json.dumps([self.path, self.headers.get('Range'), self.headers.get('X-Key')]) + '\\n')
        while self.path.startswith('/silent'):
            time.sleep(1)
        with open(os.path.basename(self.path.split('?')[0]), 'rb') as file:
            data = file.read()
        found = re.fullmatch(r'bytes=(\\d+)-(\\d+)', self.headers.get('Range') or '')
        if '/whole/' in self.path or not found:
            return self.answer(200, data, {})
        first, last = int(found[1]), min(int(found[2]), len(data) - 1)
        self.answer(206, data[first:last + 1], {'Content-Range': 'bytes %d-%d/%d' % (first, last, len(data))})
    def answer(self, status, body, headers):
        self.send_response(status)
        for name, value in {**headers, 'Content-Length': str(len(body))}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)
    def log_message(self, *arguments):
        pass
server = http.server.ThreadingHTTPServer(('127.0.0.1', 0), Host)
print(server.server_address[1], flush=True)
server.serve_forever()
"""


@contextlib.contextmanager
def host():
    """A host with Range requests, which writes down what it is asked; /silent never answers, /whole/ sends all. A
    process of its own: the reader does not let other threads of Python run."""
    process = subprocess.Popen(['/usr/bin/python3', '-c', HOST], cwd=SCRATCH, stdout=subprocess.PIPE, text=True)
    try:
        yield 'http://127.0.0.1:%d/' % int(process.stdout.readline())
    finally:
        process.kill()
        process.wait()


def asked():
    path = os.path.join(SCRATCH, 'asked')
    if not os.path.exists(path):
        return []
    with open(path) as file:
        return [json.loads(line) for line in file]


def test_urls():
    """A tetlod server and its page, any host, one without Range requests; headers and the query go along."""
    fin = os.path.join(SCRATCH, 'fin.tetlod')
    coarse, fine = extracted(fin, '--error', '5%'), extracted(fin)
    with Server(fin) as server:
        for url in server.url + 'v1/meshes/fin', server.url + 'view/fin#error=0.2':
            made = reader(url, Error=0.05)
            made.Update()
            same(made.GetOutput(), coarse, url)
            made.SetError(0)
            made.Update()
            same(made.GetOutput(), fine, url)
        made = reader(server.url + 'v1/meshes/none')
        made.Update()
        assert 'status 404' in ''.join(made.said), made.said
    with host() as place:
        check_host(place, coarse, fine)


def test_vtkhdf():
    """The stream in a VTKHDF file, as file and of a host: levels, and steps of every topology group."""
    for name in ('fin', 'topologies'):
        bare = golden(name) if name == 'topologies' else os.path.join(SCRATCH, name + '.tetlod')
        tetlod('convert', bare, '--stream', '-o', os.path.join(SCRATCH, name + '.vtkhdf'))
    fin, wake = (os.path.join(SCRATCH, name + '.vtkhdf') for name in ('fin', 'topologies'))
    assert reader(fin).CanReadFile(fin) and not reader(fin).CanReadFile(os.path.join(SCRATCH, 'fin.vtu'))
    with host() as place:
        for path in fin, place + 'fin.vtkhdf':
            same(level(path, Error=0.05), extracted(os.path.join(SCRATCH, 'fin.tetlod'), '--error', '5%'), path)
        for path in wake, place + 'topologies.vtkhdf':
            made = reader(path, Error=0.05)
            made.UpdateInformation()
            times = package.open(golden('topologies')).times
            for number in (0, len(times) // 2, len(times) - 1):
                made.UpdateTimeStep(times[number])
                wanted = extracted(golden('topologies'), '--step', number, '--error', '5%')
                same(made.GetOutput(), wanted, (path, number))
            assert not made.said, made.said


def check_host(place, coarse, fine):
    before = len(asked())
    made = reader(place + 'fin.tetlod?signature=a%2Fb', Headers='X-Other: 1\nX-Key: secret', Error=0.05)
    made.Update()
    same(made.GetOutput(), coarse, 'host')
    first = len(asked()) - before
    made.SetError(0)
    made.Update()
    same(made.GetOutput(), fine, 'host, all')
    requests = asked()[before:]
    assert all(path == '/fin.tetlod?signature=a%2Fb' and key == 'secret' for path, _, key in requests), requests
    assert first <= 3 and len(requests) - first <= 2, requests
    ranges = [tuple(map(int, re.findall(r'\d+', span))) for _, span, _ in requests]
    assert all(a[1] < b[0] for a, b in zip(ranges, ranges[1:])), ranges  # no byte twice
    same(level(place + 'whole/fin.tetlod', Error=0.05), coarse, 'a host that sends all')
    assert len(asked()) == before + len(requests) + 1


def test_stop():
    """Progress is told; AbortExecute ends decoding and waiting within half a second, and work goes on from there."""
    big = os.path.join(SCRATCH, 'big.tetlod')
    tetlod('sample', 'fin', '--size', 36, '-o', 'big.vtu')
    tetlod('build', 'big.vtu', '--field', 'Pressure', '-o', big, '--quiet')
    made = reader(big, Error=0.05)
    made.Update()
    shown, seen, since = made.GetOutput().GetNumberOfCells(), [], []

    def stop(*_):
        seen.append(made.GetProgress())
        if seen[-1] > 0 and not since:
            since.append(time.monotonic())
            made.AbortExecuteOn()
    watching = made.AddObserver('ProgressEvent', stop)
    made.SetError(0)
    made.Update()
    took = time.monotonic() - since[0]
    assert took < 0.5 and made.GetOutput().GetNumberOfCells() == shown and not made.said, (took, made.said)
    assert seen == sorted(seen), seen
    made.RemoveObserver(watching)
    made.AbortExecuteOff()
    made.Modified()
    made.Update()
    same(made.GetOutput(), extracted(big), 'after a stop')
    with host() as place:
        check_silent(place + 'silent/fin.tetlod')


def check_silent(url):
    made, since = reader(url), []

    def stop(*_):
        if not since and any(path.startswith('/silent') for path, _, _ in asked()):
            since.append(time.monotonic())
            made.AbortExecuteOn()
    made.AddObserver('ProgressEvent', stop)
    made.Update()
    assert time.monotonic() - since[0] < 0.5


def test_errors():
    """One line that names the file and what is wrong, as an error of VTK, with a code."""
    other, cut = os.path.join(SCRATCH, 'other.tetlod'), os.path.join(SCRATCH, 'cut.tetlod')
    with open(other, 'wb') as file:
        file.write(b'something else, and long enough to be a header of one: ' * 4)
    with open(golden('grid_float64'), 'rb') as file:
        data = file.read()
    with open(cut, 'wb') as file:
        file.write(data[:len(data) * 2 // 3])
    rounded = os.path.join(SCRATCH, 'rounded.tetlod')
    tetlod('build', 'fin.vtu', '--field-bits', 8, '-o', rounded, '--quiet')
    for path, settings, words in ((other, {}, 'not a tetlod stream'), ('none.tetlod', {}, 'No such file'),
                                  (rounded, {'Error': 1e-9}, 'no level has an error'),
                                  (golden('grid_float64'), {'Level': 999}, 'there is no level 999'),
                                  (golden('grid_float64'), {'ErrorField': 'x'}, 'no field "x"')):
        made = reader(path, **settings)
        made.Update()
        assert made.GetErrorCode() and words in made.said[0] and path in made.said[0], (path, made.said)
        assert made.GetOutput().GetNumberOfCells() == 0
    made = reader(cut, Error=0)
    made.Update()
    assert len(made.said) == 1 and 'is cut off' in made.said[0] and made.GetOutput().GetNumberOfCells(), made.said
    assert reader('').CanReadFile(cut) == 1 and reader('').CanReadFile(other) == 0
    assert reader('').CanReadFile('none') == 0


PICTURES = """
import sys
sys.path.insert(0, sys.argv[1])
from tetlod_vtk import vtkTetlodReader
import vtkmodules.vtkRenderingOpenGL2, vtkmodules.vtkRenderingFreeType
from vtkmodules.vtkRenderingCore import vtkActor, vtkDataSetMapper, vtkRenderWindow, vtkRenderer, vtkWindowToImageFilter
from vtkmodules.vtkIOImage import vtkPNGWriter
reader = vtkTetlodReader()
reader.SetFileName(sys.argv[2])
reader.SetError(0.002)
reader.CoarseFirstOn()
reader.SetCoarseTets(1000)
mapper, actor, renderer, window = vtkDataSetMapper(), vtkActor(), vtkRenderer(), vtkRenderWindow()
mapper.SetInputConnection(reader.GetOutputPort())
mapper.SetScalarModeToUsePointFieldData()
mapper.SelectColorArray('Pressure')
mapper.SetScalarRange(0.5, 2)
actor.SetMapper(mapper)
actor.GetProperty().EdgeVisibilityOn()
renderer.AddActor(actor)
window.AddRenderer(renderer)
window.SetSize(400, 300)
window.SetOffScreenRendering(1)
for name in 'first', 'second', 'third':
    reader.GetNeedsUpdate()
    window.Render()
    image, file = vtkWindowToImageFilter(), vtkPNGWriter()
    image.SetInput(window)
    file.SetFileName(name + '.png')
    file.SetInputConnection(image.GetOutputPort())
    file.Write()
    print(name, reader.GetOutput().GetNumberOfCells(), reader.GetNeedsUpdate())
"""


def test_pictures():
    """A coarse level at once, what was asked for with the next render, and then nothing more."""
    if not shutil.which('xvfb-run'):
        return 'there is no xvfb-run'
    fin = os.path.join(SCRATCH, 'fin.tetlod')
    done = subprocess.run(['xvfb-run', '-w', '60', '-a', '/usr/bin/python3', '-c', PICTURES, MODULE, fin], cwd=SCRATCH,
                          stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    found = re.findall(r'^(\w+) (\d+) (True|False)$', done.stdout, re.M)
    assert done.returncode == 0 and len(found) == 3, done.stdout
    (_, coarse, more), (_, fine, rest), (_, still, _) = found
    assert int(coarse) <= 1000 < int(fine) == int(still) and (more, rest) == ('True', 'False'), found
    assert int(fine) == extracted(fin, '--error', 0.002).GetNumberOfCells(), found
    names = ('first.png', 'second.png', 'third.png')
    first, second, third = (open(os.path.join(SCRATCH, name), 'rb').read() for name in names)
    assert 2000 < len(first) < len(second) and second == third, (len(first), len(second))
    return None


def main():
    why = missing()
    if why:
        print('ok - vtkTetlodReader # SKIP %s' % why)
        return
    good, text = make('vtk')
    print('%s - make vtk' % ('ok' if good else 'not ok'))
    if not good:
        print('# ' + text.replace('\n', '\n# '))
        return
    sys.path.insert(0, MODULE)
    tetlod('sample', 'fin', '--size', 14, '-o', 'fin.vtu')
    tetlod('build', 'fin.vtu', '-o', os.path.join(SCRATCH, 'fin.tetlod'), '--quiet')
    run([test_levels, test_steps, test_box, test_region, test_region_of_url, test_arrays, test_urls, test_vtkhdf,
         test_stop, test_errors, test_pictures])


main()
