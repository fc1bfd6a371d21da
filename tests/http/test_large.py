# SPDX-License-Identifier: BSD-3-Clause
"""Answers that are larger than the cache are written while they are sent: the same bytes, ranges of them, 5 GB, and
files that change meanwhile."""
import hashlib
import http.client
import os
import random
import socket
import struct
import subprocess
import sys
import threading
import time

from served import PATIENCE, ROOT, SCRATCH, TETLOD, Server, eventually, run

sys.path.insert(0, os.path.join(ROOT, 'tests'))
from streams import crafted, plain, sealed, tetlod  # noqa: E402

MADE = os.path.join(SCRATCH, 'fin.tetlod')
CROSSES = 1 << 32  # where 32 bits end


def make_stream(path, size):
    mesh = path.replace('.tetlod', '.vtu')
    os.makedirs(os.path.dirname(path), exist_ok=True)
    subprocess.run([TETLOD, 'sample', 'fin', '--size', str(size), '-o', mesh], check=True)
    subprocess.run([TETLOD, 'build', mesh, '--field', 'Pressure', '-o', path, '--quiet'], check=True)
    return path


def levels_of(server):
    described = server.json('/v1/meshes/fin')
    return described, ['/v1/meshes/fin/%s/levels/%d/mesh.' % (described['cid'],
                                                              k) for k in range(len(described['levels']))]


def test_streamed_files_are_the_cached_ones():
    with Server(MADE) as whole, Server(MADE, '--cache', '1M') as small:
        described, paths = levels_of(whole)
        for path in paths[::7] + paths[-2:]:
            for form in ('vtu', 'vtk'):
                status, head, body = whole.get(path + form)
                assert status == 200 and 'cache;desc=none' not in head['server-timing']
                status, other, same = small.get(path + form)
                assert status == 200 and same == body, (path, form, len(same), len(body))
                assert (other['etag'] == head['etag'] and other['content-length'] == str(len(body))
                        and other['tetlod-tets'] == head['tetlod-tets'])
        streamed = ['none' in small.get(path + 'vtu')[1]['server-timing'] for path in paths]
        # some of its levels find room in the cache
        assert streamed[-1] and not streamed[0] and sum(streamed) > 5, streamed


def test_the_finest_level_is_what_extract_writes():
    with Server(MADE, '--cache', '1M') as server:
        body = server.get(levels_of(server)[1][-1] + 'vtu')[2]
    with open(os.path.join(SCRATCH, 'served.vtu'), 'wb') as out:
        out.write(body)
    subprocess.run([TETLOD, 'extract', MADE, '-o', 'extracted.vtk', '--quiet'], cwd=SCRATCH, check=True)
    subprocess.run([TETLOD, 'convert', 'served.vtu', '-o', 'served.vtk'], cwd=SCRATCH, check=True)
    with open(os.path.join(SCRATCH, 'extracted.vtk'), 'rb') as one, open(os.path.join(SCRATCH, 'served.vtk'),
                                                                         'rb') as other:
        assert one.read() == other.read()


def test_conditions_and_ranges():
    with Server(MADE, '--cache', '1M') as server:
        for form in ('vtu', 'vtk'):
            path = levels_of(server)[1][-1] + form
            _, head, body = server.get(path)
            assert server.get(path, If_None_Match=head['etag'])[0] == 304
            status, other, none = server.get(path, method='HEAD')
            assert status == 200 and other['content-length'] == str(len(body)) and not none
            random.seed(form)
            for _ in range(40):
                first = random.randrange(len(body))
                last = min(len(body) - 1, first + random.choice((0, 3, 100, 20000, 200000)))
                status, other, part = server.get(path, Range='bytes=%d-%d' % (first, last))
                assert status == 206 and part == body[first:last + 1], (form, first, last)
                assert other['content-range'] == 'bytes %d-%d/%d' % (first, last, len(body))


def test_chosen_fields():
    """Frames of chosen fields, gathered: the same from the cache, from the file, and in ranges."""
    with Server(MADE) as server:
        described = server.json('/v1/meshes/fin')
        last, name = len(described['levels']) - 1, described['fields'][0]['name']
        for path in ('/v1/meshes/fin/%s/records/1-%d?fields=%s' % (described['cid'], last, name),
                     '/v1/meshes/fin/prefix?level=%d&fields=%s' % (last, name)):
            status, head, body = server.get(path)
            assert status == 200 and head['content-length'] == str(len(body))
            for first, last in ((0, len(body) - 1), (1000, 30000)):
                status, head, part = server.get(path, Range='bytes=%d-%d' % (first, last))
                assert status == 206 and part == body[first:last + 1]


def test_readers_that_wait_take_no_memory():
    """A hundred readers of the finest level who do not read: what is sent to them is not kept. A connection takes some
    150 kB by itself, which is little beside this file."""
    if os.environ.get('CONFIG') != 'release':
        return 'sanitizers take memory of their own'
    large = make_stream(os.path.join(SCRATCH, 'large', 'fin.tetlod'), 24)
    with Server(large, '--cache', '1M', '--memory', '32M') as server:
        path = levels_of(server)[1][-1] + 'vtu'
        size = len(server.get(path)[2])
        before = server.memory()
        readers = []
        for _ in range(100):
            reader = server.connect()
            reader.sendall(b'GET %s HTTP/1.1\r\nHost: localhost\r\n\r\n' % path.encode())
            readers.append(reader)
        for reader in readers:
            assert reader.recv(1000).startswith(b'HTTP/1.1 200')
        grown = server.memory() - before
        assert size > 800000 and grown < 100 * size / 3, (grown, size)
        assert server.get('/v1/meshes/fin')[0] == 200
        for reader in readers:
            reader.close()


def test_the_kernel_holds_little():
    """Whole answers in the kernel's buffers would fill them where many read at once: one that is not read leaves most
    of it in the server."""
    with Server(MADE, '--cache', '64M') as server:
        path = levels_of(server)[1][-1] + 'vtk'
        size, held = len(server.get(path)[2]), 0
        assert size > 1 << 18, size
        with socket.socket() as reader:
            reader.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            reader.connect(server.address)
            reader.sendall(b'GET %s HTTP/1.1\r\nHost: localhost\r\n\r\n' % path.encode())
            reader.recv(1)
            end = ':%04X' % server.address[1], ':%04X' % reader.getsockname()[1]

            def in_kernel():
                with open('/proc/net/tcp') as table:
                    rows = [line.split() for line in table]
                return max([0] + [int(row[4].split(':')[0], 16) for row in rows if (row[1][8:], row[2][8:]) == end])

            eventually(in_kernel)
            for _ in range(20):
                held = max(held, in_kernel())
                time.sleep(0.02)
        assert 0 < held < size / 2, (held, size)


def sparse_stream(path):
    """The stream whose last levels have large frames of fields that are holes of the file: five gigabytes in all.
    They are checked one by one when they are read. A mark lies on each side of 4 GiB."""
    hole, mark = 1 << 27, b'0123456789'
    zeros = hashlib.sha256(bytes(hole)).digest()[:16]
    with open(MADE, 'rb') as file:
        data = plain(file.read())
    stream = tetlod.open(data)
    fields, levels = len(stream.fields), len(stream.levels)
    row, index_end = 48 + 56 * fields, 64 + int.from_bytes(data[20:24], 'little')
    first = index_end - 48 * len(stream.sections) - 4 - row * levels
    begin = levels - (5 << 30) // (hole * fields) - 1  # of the levels that have holes
    index, places = bytearray(data[:index_end]), []
    at = stream.frames[begin][0][0]
    for level in range(begin, levels):
        for part in range(1 + fields):
            place = first + row * level + 24 + 32 * fields + 24 * part
            offset, old, _ = stream.frames[level][part]
            assert int.from_bytes(data[place:place + 8], 'little') == old
            size = hole if part else old
            if part:
                digest = zeros
                if at < CROSSES - 5 and at + size > CROSSES + 5:
                    here = CROSSES - 5 - at
                    digest = hashlib.sha256(bytes(here) + mark + bytes(hole - here - len(mark))).digest()[:16]
                index[place:place + 24] = struct.pack('<Q', size) + digest
            else:
                places.append((at, data[offset:offset + old]))
            at += size
    front = sealed(bytes(index[:32]) + struct.pack('<Q',
                                                   at) + bytes(index[40:]) + data[index_end:stream.frames[begin][0][0]])
    with open(path, 'wb') as out:
        out.write(front)
        out.truncate(at)
        for place, some in places + [(CROSSES - 5, mark)]:
            out.seek(place)
            out.write(some)
    return front, at


def test_five_gigabytes():
    if os.environ.get('CONFIG') != 'release':
        return 'it is about sizes, and nobody else writes there: the release alone'
    path = os.path.join(SCRATCH, 'huge.tetlod')
    front, total = sparse_stream(path)
    with Server(path, '--scan', '1000') as server:
        described = server.json('/v1/meshes/huge')
        base = '/v1/meshes/huge/%s/' % described['cid']
        last = len(described['levels']) - 1
        assert described['levels'][-1]['bytes'] == total > 5 << 30
        assert server.get(base + 'stream', method='HEAD')[1]['content-length'] == str(total)
        status, head, part = server.get(base + 'stream', Range='bytes=%d-%d' % (CROSSES - 6, CROSSES + 6))
        assert (status == 206 and part == b'\0' + b'0123456789' + b'\0\0'
                and head['content-range'].endswith('/%d' % total)), part
        assert server.get(base + 'stream', Range='bytes=-3')[2] == b'\0\0\0'
        # The gathered frames of all fields: everything behind level 0
        records = base + 'records/0-%d?fields=%s' % (last, ','.join(field['name'] for field in described['fields']))
        size = int(server.get(records, method='HEAD')[1]['content-length'])
        assert size > 5 << 30
        shift = total - size  # ends where the stream ends
        assert server.get(records, Range='bytes=%d-%d' % (CROSSES - shift - 5, CROSSES - shift + 4))[2] == b'0123456789'
        reader = server.connect()  # the whole, whose client stops reading after a while
        reader.sendall(b'GET %sstream HTTP/1.1\r\nHost: localhost\r\n\r\n' % base.encode())
        received = b''
        while len(received) < len(front) + 3000000:
            received += reader.recv(1 << 20)
        head, _, body = received.partition(b'\r\n\r\n')
        assert b'Content-Length: %d' % total in head and body[:len(front)] == front and body.endswith(bytes(1000))
        with open(path, 'r+b') as file:  # a file is checked as far as it is read, again once it was changed
            file.seek(CROSSES)
            file.write(b'6')
        status, head, body = server.get(base + 'stream', Range='bytes=%d-%d' % (CROSSES, CROSSES))
        assert status in (206, 503) and (status == 503 or body == b'5'), status
        status, head, body = server.get(base + 'stream',
                                        Range='bytes=%d-%d' % (CROSSES - (1 << 20), CROSSES - (1 << 20)))
        assert status == 503 and head['retry-after'] and b'damaged or is being written' in body, (status, body)
        os.truncate(path, len(front))
        with reader:
            while reader.recv(1 << 20):
                pass
        assert 'an answer broke off' in server.messages()
        assert b'\ntetlod_answers_lost_total 1\n' in server.get('/metrics')[2]
    os.unlink(path)


def test_what_was_read_once_comes_from_memory():
    """Ranges and whole bodies leave without reading the file again, however many pieces they leave in."""
    noise = random.Random(7).randbytes(6 << 20)
    data = crafted([(4, 1, 20, 8)], 1, [(b'MORE', 0, noise, len(noise))])
    with open(os.path.join(SCRATCH, 'more.tetlod'), 'wb') as file:
        file.write(data)
    with Server('more.tetlod') as server:
        path = '/v1/meshes/more/%s/stream' % server.json('/v1/meshes/more')['cid']
        ranges = [{}, {'Range': 'bytes=100000-1148575'}, {'Range': 'bytes=3000000-3065535'}]

        def ask():
            for headers in ranges * 3:
                status, _, body = server.get(path, **headers)
                assert (status, len(body)) in ((200, len(data)), (206, 1 << 20), (206, 65536)), (status, len(body))
        ask()
        before = server.counted()
        ask()
        reads, characters = (after - then for then, after in zip(before, server.counted()))
    assert characters < 65536, characters  # of 24 MB
    assert reads < 4 * 3 * len(ranges), reads  # wake-ups


def test_stop_in_the_middle():
    """Of streams being decoded, and answers that wait for room, are being made or sent, nothing is looked at once it is
    gone."""
    folder = os.path.join(SCRATCH, 'stopped')
    os.makedirs(folder, exist_ok=True)
    os.link(MADE, os.path.join(folder, 'fin.tetlod'))
    subprocess.run([TETLOD, 'sample', 'cube', '--size', '12', '-o', 'cube.vtu'], cwd=SCRATCH, check=True)
    subprocess.run([TETLOD, 'build', 'cube.vtu', '-o', os.path.join(folder, 'cube.tetlod'), '--quiet'], cwd=SCRATCH,
                   check=True)
    for pause in (0, 0.01, 0.05, 0.2):
        with Server(folder, '--drain', '0.01', '--timeout', '1000', '--scan', '0.01', '--cache', '1M', '--memory',
                    '4M', '--quiet') as ending:
            asking = []
            for name in ('fin', 'cube'):
                shown = ending.json('/v1/meshes/' + name)
                last = len(shown['levels']) - 1
                for level in range(last, last - 4, -1):
                    for what in ('mesh.vtu', 'mesh.vtk', 'surface.vtp', 'slice.vtp?normal=1,0,0&origin=0.5,0.5,0.5',
                                 'mesh.tetlod',
                                 'region.vtu?box=0,0,0,0.5,0.5,0.5&box_level=%d' % (level + 1)):
                        asking.append(ending.connect())
                        asking[-1].sendall(b'GET /v1/meshes/%s/%s/levels/%d/%s HTTP/1.1\r\nHost: localhost\r\n\r\n' %
                                           (name.encode(), shown['cid'].encode(), level, what.encode()))
            time.sleep(pause)
            ending.stop()
            for connection in asking:
                connection.close()


def test_written_over_while_it_is_read():
    """A complete answer is the stream's, whatever a writer does to the file in place."""
    path = os.path.join(SCRATCH, 'changing.tetlod')
    with open(MADE, 'rb') as file:
        good = file.read()
    stream = tetlod.open(good)
    bad = bytearray(good)
    for frames in stream.frames:
        for offset, size, _ in frames:
            if size:
                bad[offset + size // 2] ^= 1
    with open(path, 'wb') as file:
        file.write(good)
    stop, wrong, complete = threading.Event(), [], []

    def write():
        random.seed(5)
        with open(path, 'r+b', buffering=0) as file:
            while not stop.is_set():
                for data in (bytes(bad), good):
                    for at in range(0, len(data), 16384):
                        os.pwrite(file.fileno(), data[at:at + 16384], at)
                        if random.random() < 0.2:
                            time.sleep(0.001)
                    time.sleep(random.choice((0, 0.01, 0.1)))

    def read(server, base):
        while not stop.is_set():
            for headers in ({}, {'Range': 'bytes=0-'}):
                try:
                    status, _, body = server.get(base + 'stream', **headers)
                except (OSError, http.client.HTTPException):  # it ended too early: that is how a client knows
                    continue
                if status in (200, 206):
                    complete.append(status)
                    if body != good:
                        wrong.append((status, len(body)))

    with Server(path, '--scan', '0.02', '--cache', '1M') as server:
        base = '/v1/meshes/changing/%s/' % server.json('/v1/meshes/changing')['cid']
        threads = [threading.Thread(target=write)] + [threading.Thread(target=read,
                                                                       args=(server, base)) for _ in range(3)]
        for thread in threads:
            thread.start()
        end = time.monotonic() + PATIENCE
        time.sleep(3)
        while len(complete) < 20 and time.monotonic() < end:
            time.sleep(0.1)
        stop.set()
        for thread in threads:
            thread.join()
        assert not wrong and complete, (len(wrong), len(complete), wrong[:3])
        eventually(lambda: server.get(base + 'stream')[2] == good)  # the writer's last turn


def main():
    make_stream(MADE, 16)
    run([test_streamed_files_are_the_cached_ones, test_the_finest_level_is_what_extract_writes,
         test_conditions_and_ranges,
         test_chosen_fields, test_readers_that_wait_take_no_memory, test_the_kernel_holds_little,
         test_what_was_read_once_comes_from_memory, test_five_gigabytes, test_stop_in_the_middle,
         test_written_over_while_it_is_read])


main()
