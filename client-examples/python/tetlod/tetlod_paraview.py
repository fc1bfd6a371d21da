# SPDX-License-Identifier: BSD-3-Clause
"""ParaView plugin: opens tetlod streams, of files and of URLs, at the error that a slider sets; a series has time
steps.

Tools > Manage Plugins > Load New, choose this file. Then File > Open knows .tetlod, and Sources has "Tetlod URL".
The plugin needs the Python package tetlod: installed for ParaView's Python, or the one that this file lies in. What
goes wrong is a line in View > Output Messages.
"""
import functools
import os
import sys
import warnings

from paraview import print_error, print_warning
from paraview.util.vtkAlgorithm import VTKPythonAlgorithmBase, smdomain, smhint, smproperty, smproxy
from vtkmodules.vtkCommonCore import vtkDataArraySelection
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkUnstructuredGrid
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline

try:
    import tetlod
except ImportError:
    sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    import tetlod

TIME_STEPS, TIME_RANGE, UPDATE_TIME = Pipeline.TIME_STEPS(), Pipeline.TIME_RANGE(), Pipeline.UPDATE_TIME_STEP()


def says(request):
    """A request whose failure is a message, not a trace of Python."""
    @functools.wraps(request)
    def guarded(self, *arguments):
        try:
            with warnings.catch_warnings(record=True) as raised:
                warnings.simplefilter('always')
                done = request(self, *arguments)
            self.tell(print_warning, '; '.join(str(warning.message) for warning in raised))
            return done
        except (OSError, ValueError, LookupError, MemoryError) as problem:
            self.tell(print_error, '%s: %s' % (type(problem).__name__, problem)
                      if isinstance(problem, MemoryError) else str(problem))
            return 1  # 0 would have VTK print its own lines about the pipeline
    return guarded


def open_stream(location, error):
    """A server sends what the error needs at once; a file that is cut off has not all levels."""
    try:
        return tetlod.open(location, error=error)
    except tetlod.StreamError:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')  # the mesh that is shown says it
            return tetlod.open(location)


class StreamSource(VTKPythonAlgorithmBase):
    """A stream that stays open: a change of the error refines or coarsens the mesh that is there."""

    def __init__(self):
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType='vtkUnstructuredGrid')
        self._location, self._stream, self._percent, self._told = '', None, 1.0, ''
        self._selection = vtkDataArraySelection()
        self._selection.AddObserver('ModifiedEvent', lambda *_: self.Modified())

    def set_location(self, location):
        if location != self._location:
            self._location, self._stream, self._told = location or '', None, ''
            self.Modified()

    def tell(self, channel, message):
        """Once, though ParaView asks several times."""
        if message and message != self._told:
            channel('tetlod: ' + message)
            self._told = message

    def stream(self):
        if self._stream is None and self._location not in ('', 'None'):
            self._stream = open_stream(self._location, self._percent / 100)
            for field in self._stream.fields:
                self._selection.AddArray(field.name)
        return self._stream

    def times(self):
        stream = self.stream()
        return stream.times if stream else ()

    @says
    def RequestInformation(self, request, inputs, outputs):
        times, information = self.times(), outputs.GetInformationObject(0)
        for key in (TIME_STEPS, TIME_RANGE):
            information.Remove(key)
        for time in times:
            information.Append(TIME_STEPS, time)
        for time in times[:1] + times[-1:]:
            information.Append(TIME_RANGE, time)
        return 1

    @says
    def RequestData(self, request, inputs, outputs):
        stream = self.stream()
        if stream is None:
            return 1
        mesh = self._mesh(stream, outputs.GetInformationObject(0))
        grid = mesh.to_vtk()
        for field in stream.fields:
            if not self._selection.ArrayIsEnabled(field.name):
                grid.GetPointData().RemoveArray(field.name)
        if mesh.time is not None:
            grid.GetInformation().Set(vtkDataObject.DATA_TIME_STEP(), mesh.time)
        vtkUnstructuredGrid.GetData(outputs).ShallowCopy(grid)
        return 1

    def _mesh(self, stream, information):
        error = self._percent / 100
        if stream.times:  # the step that is nearest to the time that is asked for: other sources may go on for longer
            first, last = stream.times[0], stream.times[-1]
            time = information.Get(UPDATE_TIME) if information.Has(UPDATE_TIME) else first
            return stream.at(min(max(time, first), last), error)
        wanted = stream.level_for(error=error if stream.info.lossless or error > 0 else None)
        if wanted > stream.available:
            warnings.warn('the file is cut off: it holds levels 0 to %d of %d, and level %d is asked for' % (
                stream.available, len(stream.levels) - 1, wanted))
        return stream.seek(min(wanted, stream.available)).mesh

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

    @smproperty.doublevector(name='TimestepValues', information_only='1', si_class='vtkSITimeStepsProperty')
    def GetTimestepValues(self):
        return self.times()


@smproxy.reader(name='TetlodReader', label='Tetlod Reader', extensions='tetlod', file_description='tetlod streams')
class TetlodReader(StreamSource):
    @smproperty.stringvector(name='FileName')
    @smdomain.filelist()
    @smhint.filechooser(extensions='tetlod', file_description='tetlod streams')
    def SetFileName(self, name):
        self.set_location(name)

    SetError, GetDataArraySelection = StreamSource.SetError, StreamSource.GetDataArraySelection
    GetTimestepValues = StreamSource.GetTimestepValues


@smproxy.source(name='TetlodURL', label='Tetlod URL')
class TetlodURL(StreamSource):
    @smproperty.stringvector(name='URL', default_values='')
    def SetURL(self, url):
        self.set_location(url)

    SetError, GetDataArraySelection = StreamSource.SetError, StreamSource.GetDataArraySelection
    GetTimestepValues = StreamSource.GetTimestepValues
