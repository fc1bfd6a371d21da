# SPDX-License-Identifier: BSD-3-Clause
"""Runs in pvpython: plugin in C++, stream, its URL, series, stream in pages, stream in a VTKHDF file, folder for
pictures. Prints what the reader gives, as lines
of JSON."""
import json
import os
import sys

from paraview.servermanager import Fetch
from paraview.simple import ColorBy, GetActiveViewOrCreate, Hide, LoadPlugin, OpenDataFile, Render, SaveScreenshot, Show

plugin, stream, url, series, paged, inside, folder = sys.argv[1:]
LoadPlugin(plugin, remote=False, ns=globals())


def tell(what, source, port=0):
    data = source[port].GetDataInformation()
    arrays = source[port].PointData
    print(json.dumps([what, data.GetNumberOfCells(), data.GetNumberOfPoints(), sorted(arrays.keys()),
                      list(arrays['Pressure'].GetRange()) if 'Pressure' in arrays.keys() else None]))


file = OpenDataFile(stream)
print(json.dumps(['proxy', file.GetXMLName(), file.GetXMLLabel()]))
server = TetlodStreamURL(URL=url)  # noqa: F821  LoadPlugin defines it
for percent in 5, 1:
    for name, source in ('file', file), ('url', server):
        source.ErrorPercent = percent
        source.UpdatePipeline()
        tell('%s %g' % (name, percent), source)
file.PointArrays = ['Pressure']
file.MaxTets = 2000
file.UpdatePipeline()
tell('chosen', file)
file.MaxTets = 0
file.Box, file.BoxBounds, file.BoxErrorPercent = 1, [-1, 0.5, 0.2, 1, 0.1, 0.9], 0.2
file.UpdatePipeline()
tell('box', file, 1)
for name, path in ('region', paged), ('inside', inside):
    other = TetlodStreamReader(FileName=path, ErrorPercent=5 if name == 'region' else 1)  # noqa: F821
    if name == 'region':
        other.Box, other.BoxBounds, other.BoxErrorPercent = 1, [0, 0.5, 0.2, 1, 0.1, 0.9], 0.2
        region = other
    other.UpdatePipeline()
    tell(name, other)
print(json.dumps(['cells', list(region.CellData.keys())]))

file.Box, file.CoarseFirst, file.CoarseTets, file.ErrorPercent = 0, 1, 1000, 0.2
file.UpdatePipeline()
pictures = bool(os.environ.get('DISPLAY'))
view = GetActiveViewOrCreate('RenderView') if pictures else None
coarse = TetlodStreamReader(FileName=stream, CoarseFirst=1, CoarseTets=1000, ErrorPercent=0.2)  # noqa: F821
if pictures:
    view.ViewSize = [400, 300]
    shown = Show(coarse, view)
    shown.SetRepresentationType('Surface With Edges')
    ColorBy(shown, ('POINTS', 'Pressure'))
    view.ResetCamera()
for name in 'first', 'second', 'third':
    coarse.UpdatePipeline()
    tell(name, coarse)
    if pictures:
        Render(view)
        SaveScreenshot('%s/reader_%s.png' % (folder, name), view)
    coarse.UpdatePropertyInformation()
    if coarse.SMProxy.GetProperty('NeedsUpdate').GetElement(0):  # what the client does by its timer
        coarse.MarkModified(coarse.SMProxy)

if pictures:
    Hide(coarse, view)
    ColorBy(Show(region, view), ('CELLS', 'Region'))
    SaveScreenshot('%s/reader_region.png' % folder, view)
steps = TetlodStreamReader(FileName=series, ErrorPercent=5)  # noqa: F821
steps.UpdatePipelineInformation()
times = list(steps.TimestepValues)
print(json.dumps(['times', times]))
for time in times[0], times[3], times[-1]:
    steps.UpdatePipeline(time)
    tell('step %r' % time, steps)
    fetched = Fetch(steps)
    assert fetched.GetInformation().Get(fetched.DATA_TIME_STEP()) == time
