# SPDX-License-Identifier: BSD-3-Clause
"""Where a stream's bytes come from: memory, a file, a tetlod server, or any web host."""
from __future__ import annotations

import concurrent.futures
import contextlib
import http.client
import json
import math
import os
import re
import struct
import threading
import urllib.error
import urllib.parse
import urllib.request
import warnings
from typing import Any, BinaryIO, Callable, Dict, List, Mapping, Optional, Sequence, Tuple, Union

from ._model import Choice
from .reference import POINTER_MAGIC, StreamError, pointer_of

HEADER = 64           # bytes; the stream's whole size is at 32
FIRST = 1 << 16       # bytes of the first Range request: header and index of most streams, and their first levels
CHUNK = 1 << 16
AT_ONCE = 8           # requests
MAX_TETS = 1 << 30   # of the format
TIMEOUT = 60          # seconds without a byte

Progress = Callable[[int, int], None]
Fetch = Callable[[int, int], bytes]
Location = Union[str, 'os.PathLike[str]', bytes, bytearray, memoryview, Fetch, BinaryIO]
Headers = Mapping[str, str]


class Source:
    """`read` gives bytes of the stream, as many as are there. `size`: how many can be had."""
    name = 'bytes'
    size = 0
    late: float = math.inf  # where the levels end, once that is known: sections lie behind them
    server: Optional[str] = None  # that has a viewer, too
    page: Optional[str] = None    # where that shows it
    headers: Headers = {}         # of requests for it
    location: Optional[Location] = None  # what opens the same stream again; None: a part of another source

    def read(self, offset: int, size: int) -> bytes:
        raise NotImplementedError

    def expect(self, end: int) -> None:
        """A hint: bytes up to `end` will be read."""

    def hold(self, spans: Sequence[Tuple[int, int]]) -> None:
        """Ranges (offset, size) that will be read in parts: what is far away has them fetched, each by one request."""

    def close(self) -> None:
        pass


class Memory(Source):
    def __init__(self, data: Union[bytes, bytearray, memoryview]) -> None:
        self.data = memoryview(data).cast('B')
        self.size = len(self.data)

    def read(self, offset: int, size: int) -> bytes:
        return bytes(self.data[offset:offset + size])


class File(Source):
    def __init__(self, path: str) -> None:
        self.name, self.file = path, open(path, 'rb', buffering=0)
        self.size = os.fstat(self.file.fileno()).st_size

    def read(self, offset: int, size: int) -> bytes:
        parts = []
        while size and (part := os.pread(self.file.fileno(), size, offset)):
            parts.append(part)
            offset, size = offset + len(part), size - len(part)
        return b''.join(parts)


class Fetched(Source):
    """Bytes that a function of the caller's gives: fetch(offset, size), fewer where the stream ends."""

    def __init__(self, fetch: Fetch) -> None:
        self.name, self.fetch = getattr(fetch, '__name__', 'fetch'), fetch
        self.head = fetch(0, FIRST)
        self.size = struct.unpack_from('<Q', self.head, 32)[0] if len(self.head) >= HEADER else len(self.head)
        if self.head[:8] == POINTER_MAGIC:
            self.size = sum(pointer_of(self.head[:HEADER]) or ())

    def read(self, offset: int, size: int) -> bytes:
        end = offset + size
        return self.head[offset:end] if end <= len(self.head) else bytes(self.fetch(offset, size))


class Part(Source):
    """Bytes of a larger source. What a level needs is read at once."""

    def __init__(self, whole: Source, offset: int, size: int) -> None:
        self.name, self.whole, self.offset = whole.name, whole, offset
        self.size = max(0, min(size, whole.size - offset))
        self.data, self.wanted = b'', FIRST

    def read(self, offset: int, size: int) -> bytes:
        have, end = len(self.data), min(offset + size, self.size)
        if have < end and offset <= max(have, self.wanted):
            self.data += self.whole.read(self.offset + have, min(max(end, self.wanted), self.size) - have)
        return self.data[offset:end] if end <= len(self.data) else self.whole.read(self.offset + offset, end - offset)

    def expect(self, end: int) -> None:
        self.wanted = max(self.wanted, end)

    def hold(self, spans: Sequence[Tuple[int, int]]) -> None:
        self.whole.hold([(self.offset + offset, size) for offset, size in spans])


class Inside(Part):
    """The stream in an HDF5 file (SPEC 3.10)."""

    def __init__(self, whole: Source, offset: int, size: int) -> None:
        super().__init__(whole, offset, size)
        self.headers = whole.headers
        header = whole.read(offset, HEADER)
        if len(header) == HEADER and struct.unpack_from('<Q', header, 32)[0] != size:
            raise StreamError('%s: the pointer to the stream gives another length' % self.name)
        self.wanted = max(HEADER, FIRST - offset)  # a first request has as many

    def close(self) -> None:
        self.whole.close()


class Remote(Source):
    """Bytes that arrive in order. Only those that a level needs are asked for, in one request; reading waits for them.
    """

    def __init__(self, url: str, headers: Headers, progress: Optional[Progress]) -> None:
        self.name, self.url, self.headers, self.progress = url, url, dict(headers), progress
        self.data, self.wanted, self.requests, self.counting = bytearray(), 0, 0, threading.Lock()
        self.held: List[Tuple[int, bytes]] = []
        self.answer: Optional[http.client.HTTPResponse] = None
        self.tag: Optional[str] = None

    def start(self) -> None:
        """Reads the header, which says how long the stream is."""
        header = self.read(0, HEADER)
        self.size = struct.unpack_from('<Q', header, 32)[0] if len(header) == HEADER else len(header)
        if header[:8] == POINTER_MAGIC:
            self.size = sum(pointer_of(header) or ())

    def read(self, offset: int, size: int) -> bytes:
        end = offset + size
        for at, data in self.held:
            if at <= offset and end <= at + len(data):
                return data[offset - at:end - at]
        if len(self.data) < end and (offset >= self.late or
                                     offset > max(len(self.data),
                                                  self.wanted)) and (apart := self._apart(offset, size)) is not None:
            return apart
        while len(self.data) < end:
            if self.answer is None and not self._ask(max(end, self.wanted)):
                break
            self._receive()
        return bytes(self.data[offset:end])

    def expect(self, end: int) -> None:
        self.wanted = max(self.wanted, end)

    def hold(self, spans: Sequence[Tuple[int, int]]) -> None:
        """At once, with those from the begin on that somebody wants."""
        missing = [(offset, size) for offset, size in spans if offset + size > len(self.data)]
        with concurrent.futures.ThreadPoolExecutor(AT_ONCE) as pool:
            parts = pool.map(lambda span: self._apart(*span), missing)
            self.read(0, self.wanted)
            self.held = [(span[0], part) for span, part in zip(missing, parts) if part is not None]

    def close(self) -> None:
        if self.answer is not None:
            self.answer.close()
            self.answer = None

    def _apart(self, offset: int, size: int) -> Optional[bytes]:
        """A section behind the levels, or behind those that somebody wants, by a request of its own. None: the host
        does not answer Range requests."""
        with contextlib.closing(self._open(self.url, {'Range': 'bytes=%d-%d' % (offset, offset + size - 1)})) as answer:
            return answer.read() if answer.status == 206 else None

    def _receive(self) -> None:
        assert self.answer is not None
        before = len(self.data)
        try:
            self.data += self.answer.read1(CHUNK)
        except (http.client.HTTPException, OSError) as problem:
            raise StreamError('%s: the connection was lost after %d bytes (%s)' % (self.name, before,
                                                                                   problem)) from problem
        if len(self.data) == before:
            missing = self.answer.length
            self.close()
            if missing:
                raise StreamError('%s: the connection was lost after %d bytes' % (self.name, before))
        elif self.progress:
            self.progress(len(self.data), max(self.wanted, len(self.data)))

    def _ask(self, end: int) -> bool:
        """Opens an answer with the bytes from those that are there up to `end`. False if there are no more."""
        have = len(self.data)
        if self.size and have >= self.size:
            return False
        headers = {'Range': 'bytes=%d-%d' % (have, end - 1)}
        if self.tag:
            # the file may be replaced between two requests: then the answer is all of the new one
            headers['If-Range'] = self.tag
        answer = self._open(self.url, headers)
        if answer.status == 200:
            if have:
                answer.close()
                raise StreamError('%s: the file was replaced meanwhile; open it again' % self.name)
            if int(answer.headers.get('Content-Length') or FIRST + 1) > FIRST:
                warnings.warn(
                    '%s: this host does not answer Range requests: the whole stream is downloaded, once' % self.name,
                    stacklevel=2)
        self.tag = answer.headers.get('ETag') or self.tag
        self.tag = None if self.tag and self.tag.startswith('W/') else self.tag
        self.answer = answer
        return True

    def _open(self, url: str, headers: Dict[str, str]) -> http.client.HTTPResponse:
        with self.counting:
            self.requests += 1
        try:
            request = urllib.request.Request(url, headers={**self.headers, **headers})
            answer: http.client.HTTPResponse = urllib.request.urlopen(request, timeout=TIMEOUT)
            return answer
        except urllib.error.HTTPError as refused:
            raise OSError('%s: %s' % (url, explanation(refused))) from None
        except urllib.error.URLError as problem:
            raise OSError('%s: %s' % (url, problem.reason)) from None


class Host(Remote):
    """A stream on any web host."""

    def __init__(self, url: str, headers: Headers, progress: Optional[Progress]) -> None:
        super().__init__(url, headers, progress)
        self.wanted = FIRST
        self.start()
        self.wanted = 0


class Server(Remote):
    """/v1/meshes/{id} of a tetlod server: the first request asks for the level itself, later ones for bytes of the
    stream. `own`: a query that goes with all of them, such as a signature."""

    def __init__(self, url: str, own: str, choice: Choice, headers: Headers, progress: Optional[Progress]) -> None:
        super().__init__(url, headers, progress)
        self.server, _, mesh = url.rpartition('/v1/meshes/')
        self.page = '%s/view/%s' % (self.server, mesh)
        query = choice.query()
        if set(query) <= {'field', 'measure'}:
            query['tets'] = str(MAX_TETS)  # the finest level
        asked = urllib.parse.urlencode(query, quote_via=urllib.parse.quote)
        self.answer = self._open(url + '/prefix?' + '&'.join(part for part in (asked, own) if part), {})
        self.wanted = int(self.answer.headers.get('Content-Length') or 0)
        self.start()
        if len(self.data) >= HEADER:
            self.url = '%s/%s/stream%s' % (url, self.data[40:56].hex(), '?' + own if own else '')


def explanation(refused: urllib.error.HTTPError) -> str:
    """What a refusal says: application/problem+json, or its status line."""
    try:
        problem: Dict[str, Any] = json.loads(refused.read(1 << 16))
        return '%d: %s' % (refused.code, problem.get('detail') or problem.get('title') or refused.reason)
    except (ValueError, AttributeError):
        return '%d %s' % (refused.code, refused.reason)


def is_url(path: str) -> bool:
    return re.match(r'https?://', path, re.I) is not None


def open_source(location: Location, choice: Choice, progress: Optional[Progress], headers: Optional[Headers]) -> Source:
    found = source_at(location, choice, progress, headers or {})
    if headers and not isinstance(found, Remote):
        found.close()
        raise ValueError('headers= go with requests: the source is no URL')
    pointer = pointer_of(found.read(0, HEADER))
    if pointer:
        found = Inside(found, *pointer)
    if isinstance(location, (bytes, bytearray, memoryview)):
        found.location = bytes(location)
    elif isinstance(location, (str, os.PathLike)):
        path = os.fspath(location)
        found.location = path if is_url(path) else os.path.abspath(path)
    else:
        found.location = location
    return found


def source_at(location: Location, choice: Choice, progress: Optional[Progress], headers: Headers) -> Source:
    if isinstance(location, (bytes, bytearray, memoryview)):
        return Memory(location)
    if callable(location):
        return kept(location)
    if not isinstance(location, (str, os.PathLike)):
        file = location

        def read(offset: int, size: int) -> bytes:
            file.seek(offset)
            return file.read(size)
        return kept(read)
    path = os.fspath(location)
    if not is_url(path):
        return File(path)
    address, _, query = path.partition('#')[0].partition('?')
    bare = re.sub(r'/view/([^/]+)$', r'/v1/meshes/\1', address)  # a link to the viewer names the mesh, too
    if re.search(r'/v1/meshes/[^/]+/?$', bare):
        return Server(bare.rstrip('/'), query if bare == address else '', choice, headers, progress)
    return Host(path, headers, progress)


def kept(fetch: Fetch) -> Source:
    """What a level needs is fetched at once, and no byte of the levels twice."""
    fetched = Fetched(fetch)
    return Part(fetched, 0, fetched.size)
