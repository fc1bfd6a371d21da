# SPDX-License-Identifier: BSD-3-Clause
"""A widget of notebooks whose bytes come through the kernel's own connection: no server has to be reached."""
from __future__ import annotations

import functools
import os
from typing import Any, Dict, List, Optional

from ._model import Fraction
from ._sources import Headers, Location
from ._stream import Stream, open as open_stream

MAX_SIZE = 1 << 20  # bytes of one answer


def module() -> str:
    """The widget's JavaScript: beside this file where make has installed the package, else what was built."""
    here = os.path.dirname(os.path.abspath(__file__))
    for path in (os.path.join(here, 'widget.js'), os.path.join(here, '..', '..', '..', 'build', 'widget.js')):
        if os.path.exists(path):
            with open(path, encoding='utf-8') as file:
                return file.read()
    raise FileNotFoundError('the widget is not built: `make` and `make install-python` install it with the package')


@functools.lru_cache(maxsize=None)
def widget_class() -> Any:
    import anywidget
    import traitlets

    class StreamWidget(anywidget.AnyWidget):
        """The picture follows error ('1%'), field, state (as in the viewer's link) and height (pixels)."""
        _esm = module()
        error = traitlets.Unicode('').tag(sync=True)
        field = traitlets.Unicode('').tag(sync=True)
        state = traitlets.Unicode('').tag(sync=True)
        height = traitlets.Int(480).tag(sync=True)

        def __init__(self, stream: Stream, **attributes: Any) -> None:
            super().__init__(**attributes)
            self.stream = stream
            self.on_msg(self._answer)

        def _answer(self, _: Any, content: Dict[str, Any], __: Any) -> None:
            reply, buffers = answer(self.stream, content)
            self.send(reply, buffers=buffers)

    return StreamWidget


def answer(stream: Stream, content: Dict[str, Any]) -> 'tuple[Dict[str, Any], List[bytes]]':
    """What the kernel sends for a question of a view: bytes of the stream, fewer where it ends, or what went wrong."""
    question = content.get('question')
    try:
        offset, size = int(content['offset']), min(int(content['size']), MAX_SIZE)
        if offset < 0 or size < 0:
            raise ValueError('no bytes from %d, %d of them' % (offset, size))
        size = min(size, max(0, stream.info.bytes - offset))
        return {'answer': question}, [stream._source.read(offset, size) if size else b'']
    except (OSError, ValueError, LookupError) as problem:
        return {'answer': question, 'error': str(problem)}, []


def widget(source: Location, error: Optional[Fraction] = None, *, field: Optional[str] = None, state: str = '',
           height: int = 480, headers: Optional[Headers] = None) -> Any:
    """A picture of a stream in a notebook, as the viewer's page shows it. Needs anywidget.

    source, headers: as in `open`, or a Stream: the kernel reads it, the browser asks the kernel. error, field: what is
    shown; state: what the viewer's page has behind the # of its link. They are attributes of the widget, too: w.error =
    '1%'.
    """
    stream = source if isinstance(source, Stream) else open_stream(source, level=0, headers=headers)
    asked = '' if error is None else error if isinstance(error, str) else '%.6g' % error
    return widget_class()(stream, error=asked, field=field or '', state=state, height=height)
