# SPDX-License-Identifier: BSD-3-Clause
"""Runs in pvpython: plugin, stream, its URL, series, its URL, folder for pictures. Prints tetrahedra and points at
three errors, and what steps in time hold, of the file and of the server; pictures where there is a display."""
import inspect
import os
import sys

if not hasattr(inspect, 'getargspec'):  # ParaView 5.11.0 with Python 3.11 cannot load any Python plugin without it
    inspect.getargspec = inspect.getfullargspec

from paraview.servermanager import Fetch  # noqa: E402
from paraview.simple import ColorBy, GetActiveViewOrCreate, GetAnimationScene, Hide, LoadPlugin, Render, SaveScreenshot, Show  # noqa: E402

plugin, stream, url, series, series_url, folder = sys.argv[1:]
LoadPlugin(plugin, remote=False, ns=globals())
file = TetlodReader(FileName=stream, ErrorPercent=5)  # noqa: F821  LoadPlugin defines it
server = TetlodURL(URL=url, ErrorPercent=5)  # noqa: F821
pictures = bool(os.environ.get('DISPLAY'))
if pictures:
    view = GetActiveViewOrCreate('RenderView')
    view.ViewSize = [400, 300]
    shown = Show(file, view)
    shown.SetRepresentationType('Surface With Edges')
    ColorBy(shown, ('POINTS', 'Pressure'))
    view.ResetCamera()
for percent in (5, 1, 0.2):
    for source in (file, server):
        source.ErrorPercent = percent
        source.UpdatePipeline()
        data = source.GetDataInformation()
        print('level', percent, data.GetNumberOfCells(), data.GetNumberOfPoints(), sorted(source.PointData.keys()))
    if pictures:
        Render(view)
        SaveScreenshot('%s/paraview_%g.png' % (folder, percent), view)
file.Fields = ['Pressure']
file.UpdatePipeline()
print('fields', sorted(file.PointData.keys()))

steps = TetlodReader(FileName=series, ErrorPercent=5)  # noqa: F821
served = TetlodURL(URL=series_url, ErrorPercent=5)  # noqa: F821
for percent in (5, 1):
    for source in (steps, served):
        source.ErrorPercent = percent
        source.UpdatePipelineInformation()
        times = list(source.TimestepValues)
        for time in (times[0], times[3] + 1e-6, times[-1] + 1):
            source.UpdatePipeline(time)
            low, high = source.PointData['Pressure'].GetRange()
            print(
                'step', percent, repr(time),
                source.GetDataInformation().GetNumberOfCells(), repr(low), repr(high),
                Fetch(source).GetInformation().Get(
                    source.GetClientSideObject().GetOutputDataObject(0).DATA_TIME_STEP()))
print('times', times)
if pictures:
    Hide(file, view)
    shown = Show(steps, view)
    ColorBy(shown, ('POINTS', 'Pressure'))
    view.ResetCamera()
    scene = GetAnimationScene()
    scene.UpdateAnimationUsingDataTimeSteps()
    for name in ('first', 'last'):
        (scene.GoToFirst if name == 'first' else scene.GoToLast)()
        shown.RescaleTransferFunctionToDataRange(False, True)
        Render(view)
        SaveScreenshot('%s/paraview_%s.png' % (folder, name), view)
