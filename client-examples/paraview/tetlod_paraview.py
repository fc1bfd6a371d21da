# SPDX-License-Identifier: BSD-3-Clause
"""ParaView plugin: opens tetlod streams, of files and of URLs, at the error that a slider sets.

Tools > Manage Plugins > Load New, choose this file. Then File > Open knows .tetlod, and Sources has "Tetlod URL".
The plugin needs the Python package tetlod: installed for ParaView's Python, or at ../python beside this folder.
"""
import os
import sys

from paraview.util.vtkAlgorithm import VTKPythonAlgorithmBase, smdomain, smhint, smproperty, smproxy
from vtkmodules.vtkCommonCore import vtkDataArraySelection
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

try:
    import tetlod
except ImportError:
    sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', 'python'))
    import tetlod


class StreamSource(VTKPythonAlgorithmBase):
    """A stream that stays open: a change of the error refines or coarsens the mesh that is there."""

    def __init__(self):
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType='vtkUnstructuredGrid')
        self._location, self._stream, self._percent = '', None, 1.0
        self._selection = vtkDataArraySelection()
        self._selection.AddObserver('ModifiedEvent', lambda *_: self.Modified())

    def set_location(self, location):
        if location != self._location:
            self._location, self._stream = location or '', None
            self.Modified()

    def stream(self):
        if self._stream is None and self._location not in ('', 'None'):
            self._stream = tetlod.open(self._location, error=self._percent / 100)
            for field in self._stream.fields:
                self._selection.AddArray(field.name)
        return self._stream

    def RequestInformation(self, request, inputs, outputs):
        self.stream()
        return 1

    def RequestData(self, request, inputs, outputs):
        stream = self.stream()
        if stream is None:
            return 1
        if stream.info.lossless or self._percent > 0:
            grid = stream.seek(error=self._percent / 100).mesh.to_vtk()
        else:
            grid = stream.seek().mesh.to_vtk()
        for field in stream.fields:
            if not self._selection.ArrayIsEnabled(field.name):
                grid.GetPointData().RemoveArray(field.name)
        vtkUnstructuredGrid.GetData(outputs).ShallowCopy(grid)
        return 1

    # Properties of both proxies. ParaView looks for them in the class itself: each names them again

    @smproperty.doublevector(name='ErrorPercent', default_values=[1.0])
    @smdomain.doublerange(min=0, max=100)
    def SetError(self, percent):
        if percent != self._percent:
            self._percent = percent
            self.Modified()

    @smproperty.dataarrayselection(name='Fields')
    def GetDataArraySelection(self):
        return self._selection


@smproxy.reader(name='TetlodReader', label='Tetlod Reader', extensions='tetlod', file_description='tetlod streams')
class TetlodReader(StreamSource):
    @smproperty.stringvector(name='FileName')
    @smdomain.filelist()
    @smhint.filechooser(extensions='tetlod', file_description='tetlod streams')
    def SetFileName(self, name):
        self.set_location(name)

    SetError, GetDataArraySelection = StreamSource.SetError, StreamSource.GetDataArraySelection


@smproxy.source(name='TetlodURL', label='Tetlod URL')
class TetlodURL(StreamSource):
    @smproperty.stringvector(name='URL', default_values='')
    def SetURL(self, url):
        self.set_location(url)

    SetError, GetDataArraySelection = StreamSource.SetError, StreamSource.GetDataArraySelection
