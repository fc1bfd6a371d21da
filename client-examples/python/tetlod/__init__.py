# SPDX-License-Identifier: BSD-3-Clause
"""Reads tetlod streams: levels of detail of tetrahedral meshes with fields.

    >>> import tetlod
    >>> mesh = tetlod.read('fin.tetlod', error=0.01)     # or '1%'; a path, bytes or an http(s) URL
    >>> mesh.points.shape[1], mesh.tets.shape[1], list(mesh.fields)
    (3, 4, ['Pressure', 'Density', 'Velocity'])
    >>> mesh.error <= 0.01                               # certified, of every controlled field
    True

`open` gives a stream that moves from level to level, also while its bytes arrive:

    >>> with tetlod.open('fin.tetlod', error='5%') as stream:
    ...     for mesh in stream:                          # from the coarsest level to 5 %
    ...         pass
    >>> mesh.level == stream.level, stream.coarsen(), stream.level == mesh.level - 1
    (True, True, True)

Where libtetlod is installed it decodes (TETLOD_LIBRARY names another one); elsewhere a decoder in Python does, with the
same results and about a hundred times slower.
"""
import os

from ._answers import Answer
from ._build import build
from ._library import library_path
from ._mesh import Mesh
from ._model import Field, FieldError, Level
from ._sequences import FieldSequence, LevelSequence
from ._series import StepSequence
from ._stream import Stream, open, read
from ._widget import widget
from .adapters import register_meshio
from .reference import StreamError

__version__ = '0.1.0'
__all__ = ['Answer', 'Field', 'FieldError', 'FieldSequence', 'Level', 'LevelSequence', 'Mesh', 'StepSequence', 'Stream',
           'StreamError', 'build', 'library_path', 'open', 'paraview_plugin', 'read', 'register_meshio', 'widget']


def paraview_plugin() -> str:
    """The path of the plugin that ParaView loads: Tools > Manage Plugins > Load New."""
    return os.path.join(os.path.dirname(os.path.abspath(__file__)), 'tetlod_paraview.py')
