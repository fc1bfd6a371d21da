# SPDX-License-Identifier: BSD-3-Clause
"""Runs in pvpython: plugin, stream, URL, folder for pictures. Prints tetrahedra and points at three errors, of the file and of the server;
pictures where there is a display."""
import inspect
import os
import sys

if not hasattr(inspect, 'getargspec'):  # ParaView 5.11.0 with Python 3.11 cannot load any Python plugin without it
    inspect.getargspec = inspect.getfullargspec

from paraview.simple import ColorBy, GetActiveViewOrCreate, LoadPlugin, Render, SaveScreenshot, Show  # noqa: E402

plugin, stream, url, folder = sys.argv[1:]
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
