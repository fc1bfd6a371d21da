# SPDX-License-Identifier: BSD-3-Clause
"""A day of a folder in seconds: streams are replaced, cut, copied in pieces and written over while clients read them.
Every complete answer under a content id has the bytes of the stream with that content id.

CHANGES=2000 makes so many changes (make bench-day)."""
import hashlib
import http.client
import json
import multiprocessing
import os
import random
import shutil
import struct
import subprocess
import sys
import time

from served import SCRATCH, TETLOD, Server, eventually, preloaded, run

CHANGES = int(os.environ.get('CHANGES', '80'))
CLIENTS = 3
FOLDER = os.path.join(SCRATCH, 'changing')
GOOD = {}  # of each content id: the stream's bytes, its levels, and digests of what is made from it
MADE = ('levels/0/mesh.vtu', 'levels/2/mesh.vtk', 'levels/3/surface.stl', 'levels/1/region.vtu?box=0,0,0,1,1,1&level=3')


def write(path, data):
    with open(path, 'wb') as file:
        file.write(data)
    return path


def make_stream(name, sample, size, field=None):
    mesh, stream = (os.path.join(SCRATCH, name + ending) for ending in ('.vtu', '.tetlod'))
    subprocess.run([TETLOD, 'sample', sample, '--size', str(size), '-o', mesh], check=True)
    subprocess.run([TETLOD, 'build', mesh, *(['--field', field] if field else []), '-o', stream, '--quiet'], check=True)
    with open(stream, 'rb') as file:
        return file.read()


def make_streams():
    """Two streams of the same length that differ, another one, and a series whose mesh changes."""
    streams = {'fin': make_stream('fin', 'fin', 10 if CHANGES < 500 else 24, 'Pressure'),
               'cube': make_stream('cube', 'cube', 8, 'xyz')}
    subprocess.run([TETLOD, 'sample', 'wake', '--size', '6', '--steps', '6', '--remesh', '2', '-o', 'run.pvd'],
                   cwd=SCRATCH, check=True)
    subprocess.run([TETLOD, 'build', 'run.pvd', '--field', 'Pressure', '-o', 'run.tetlod', '--quiet'], cwd=SCRATCH,
                   check=True)
    with open(os.path.join(SCRATCH, 'run.tetlod'), 'rb') as file:
        streams['run'] = file.read()
    streams['nif'] = resealed(streams['fin'])
    write(os.path.join(SCRATCH, 'nif.tetlod'), streams['nif'])
    return streams


def resealed(data):
    """The same stream with a private optional feature: only the header differs, and the content id."""
    data = bytearray(data)
    data[16] ^= 0x80
    index = data[64:64 + int.from_bytes(data[20:24], 'little')]
    data[40:56] = hashlib.sha256(bytes(data[:40] + index)).digest()[:16]
    data[60:64] = hashlib.sha256(bytes(data[:60])).digest()[:4]
    return bytes(data)


def learn(streams):
    """What a server of files that nobody changes says."""
    with Server(*(os.path.join(SCRATCH, name + '.tetlod') for name in streams)) as still:
        for name, data in streams.items():
            about = still.json('/v1/meshes/' + name)
            made = {path: still.get('/v1/meshes/%s/%s/%s' % (name, about['cid'], path)) for path in MADE}
            assert made[MADE[0]][0] == 200, made[MADE[0]]
            GOOD[about['cid']] = {'data': data, 'ends': [level['bytes'] for level in about['levels']],
                                  'made': {path: hashlib.sha256(body).digest()
                                           for path, (status, _, body) in made.items() if status == 200}}


def expected(cid, seed):
    """A path under a content id, a range or None, and what the body has to be."""
    good = GOOD[cid]
    data, ends, kind = good['data'], good['ends'], seed.randrange(5)
    if kind == 0:
        return 'stream', None, lambda body: body == data
    if kind == 1:
        first = seed.randrange(len(data))
        last = min(len(data) - 1, first + seed.choice((10, 5000, 100000)))
        return 'stream', (first, last), lambda body: body in (data, data[first:last + 1])
    if kind == 2:
        a, b = sorted(seed.sample(range(len(ends)), 2))
        return 'records/%d-%d' % (a, b), None, lambda body: body == data[ends[a]:ends[b]]
    if kind == 3:
        level = seed.randrange(len(ends))
        return 'levels/%d/mesh.tetlod' % level, None, lambda body: body == data[:ends[level]]
    path = seed.choice(sorted(good['made']))
    return path, None, lambda body: hashlib.sha256(body).digest() == good['made'][path]


def read(address, good, number, stop, out):
    """One client: counts complete answers, refusals and broken answers, and keeps what is wrong."""
    GOOD.update(good)
    seed, counts, wrong = random.Random(number), {'complete': 0, 'refused': 0, 'broken': 0}, []
    connection = http.client.HTTPConnection(*address, timeout=60)
    cids = sorted(GOOD)
    while not stop.is_set():
        cid = seed.choice(cids)
        path, span, right = expected(cid, seed)
        try:
            headers = {'Range': 'bytes=%d-%d' % span} if span else {}
            connection.request('GET', '/v1/meshes/%s/%s/%s' % (seed.choice('abc'), cid, path), headers=headers)
            answer = connection.getresponse()
            body = answer.read()
        except (OSError, http.client.HTTPException):
            connection.close()
            counts['broken'] += 1
            continue
        if answer.status in (200, 206):
            counts['complete'] += 1
            if not right(body):
                wrong.append((cid, path, span, answer.status, len(body)))
        elif answer.status in (404, 503):
            counts['refused'] += 1
        else:
            wrong.append((cid, path, span, answer.status, body[:300]))
    out.put((counts, wrong))


def change(seed, streams):
    """One of the ways in which files change, good and bad."""
    path, data = os.path.join(FOLDER, seed.choice('abc') + '.tetlod'), seed.choice(sorted(streams.values()))
    kind = seed.randrange(8)
    new = os.path.join(SCRATCH, 'new')
    damaged = bytearray(data)
    damaged[seed.randrange(len(data) // 2, len(data))] ^= 1 << seed.randrange(8)
    if kind in (0, 1, 2):  # replaced, by a good file or a damaged one, or replaced and written over at once
        with open(new, 'wb') as file:
            file.write(damaged if kind == 1 else data)
        os.replace(new, path)
        if kind == 2:
            time.sleep(seed.choice((0, 0.001, 0.004, 0.01, 0.019)))
            with open(path, 'r+b') as file:
                file.write(damaged)
    elif kind == 3 and os.path.exists(path):  # cut, and some of it written again
        os.truncate(path, seed.randrange(len(data)))
        with open(path, 'r+b') as file:
            file.write(data[:seed.randrange(len(data))])
    elif kind in (4, 5):  # a copy in pieces into a file that has its size already
        with open(path, 'r+b' if kind == 4 and os.path.exists(path) else 'wb') as file:
            file.truncate(len(data))
            for at in range(0, len(data), 1 << 14):
                file.write(data[at:at + (1 << 14)])
                file.flush()
                time.sleep(seed.choice((0, 0, 0.002)))
    elif kind == 6 and os.path.exists(path):  # a byte, with size and time as before, and a second name
        about = os.stat(path)
        with open(path, 'r+b') as file:
            file.seek(seed.randrange(64, max(65, about.st_size - 1)))
            file.write(b'?')
        os.utime(path, ns=(about.st_atime_ns, about.st_mtime_ns))
        if os.path.exists(new):
            os.unlink(new)
        os.link(path, new)
    else:  # a link to a good file, or to a damaged one
        target = os.path.join(SCRATCH, 'target')
        with open(target, 'wb') as file:
            file.write(seed.choice((data, bytes(damaged))))
        if os.path.lexists(new):
            os.unlink(new)
        os.symlink(target, new)
        os.replace(new, path)


# The time of day, and that of files, which tell it to 16 ms: all of it goes by SLOWER times as slowly
SLOWER, GRAIN = 50, 16000000
SLOW_TIME = r'''
#include <sys/stat.h>
#include <time.h>
static void slow(struct timespec *time, long long grain)
{
    long long ns = ((long long)time->tv_sec * 1000000000 + time->tv_nsec) / %d;
    ns -= ns %% grain;
    *time = (struct timespec){ns / 1000000000, ns %% 1000000000};
}
static int cut(int result, struct stat *about)
{
    slow(&about->st_mtim, %d);
    slow(&about->st_ctim, %d);
    return result;
}
int fstat(int fd, struct stat *out)
{
    int (*next)(int, struct stat *) = dlsym(RTLD_NEXT, "fstat");
    return cut(next(fd, out), out);
}
int fstatat(int folder, const char *path, struct stat *out, int flags)
{
    int (*next)(int, const char *, struct stat *, int) = dlsym(RTLD_NEXT, "fstatat");
    return cut(next(folder, path, out, flags), out);
}
int clock_gettime(clockid_t clock, struct timespec *out)
{
    int (*next)(clockid_t, struct timespec *) = dlsym(RTLD_NEXT, "clock_gettime");
    int result = next(clock, out);
    if (clock == CLOCK_REALTIME)
        slow(out, 1);
    return result;
}
''' % (SLOWER, GRAIN, GRAIN)


def test_written_over_in_the_tick_of_a_rename():
    """A file's times need not tell a rename from what is written soon after it: no file is looked at so soon."""
    if os.environ.get('CONFIG') != 'release':
        return 'sanitizers want to be loaded first'
    folder, good, other = os.path.join(SCRATCH, 'tick'), make_stream('cube', 'cube', 4), make_stream('fin', 'fin', 6)
    path, new = os.path.join(folder, 'm.tetlod'), os.path.join(SCRATCH, 'new')

    def grains():
        return time.time_ns() / SLOWER / GRAIN

    os.makedirs(folder)
    write(path, other)
    with Server(folder, '--scan', '0.01', environment={'LD_PRELOAD': preloaded('slow_time', SLOW_TIME)}) as server:
        eventually(lambda: server.get('/v1/meshes/m')[0] == 200)
        with Server(write(new, good)) as still:
            cid = still.json('/v1/meshes/new')['cid']
        eventually(lambda: grains() % 1 < 0.2)
        tick = int(grains())
        os.replace(new, path)
        while grains() < tick + 0.7 and server.json('/v1/meshes/m')['cid'] != cid:
            pass
        with open(path, 'r+b') as file:
            file.write(good[:-100] + bytes(100))
        while 'not served' not in server.messages():
            status, _, body = server.get('/v1/meshes/m/%s/stream' % cid)
            assert status in (404, 503) or body == good, status


def test_a_day():
    streams = make_streams()
    learn(streams)
    shutil.rmtree(FOLDER, ignore_errors=True)
    os.makedirs(FOLDER)
    for name in 'abc':
        shutil.copy(os.path.join(SCRATCH, 'fin.tetlod'), os.path.join(FOLDER, name + '.tetlod'))
    context = multiprocessing.get_context('fork')
    stop, out, seed = context.Event(), context.Queue(), random.Random(1)
    with Server(FOLDER, '--scan', '0.02', '--keep-replaced', '1', '--cache', '16M') as server:
        clients = [context.Process(target=read, args=(server.address, GOOD, i, stop, out)) for i in range(CLIENTS)]
        for client in clients:
            client.start()
        for _ in range(CHANGES):
            change(seed, streams)
            time.sleep(seed.choice((0, 0.005, 0.03, 0.06)))
        stop.set()
        results = [out.get() for _ in clients]
        for client in clients:
            client.join()
        counts = {name: sum(counts[name] for counts, _ in results) for name in results[0][0]}
        wrong = [one for _, some in results for one in some]
        print('# %d changes, %s, %d wrong' % (CHANGES,
                                              ', '.join('%d %s' % (count, name)
                                                        for name, count in counts.items()), len(wrong)))
        assert not wrong, wrong[:5]
        assert counts['complete'] > CHANGES and counts['refused'], counts
        for name in 'abc':  # all is well again with good files
            new = os.path.join(SCRATCH, 'new')
            if os.path.lexists(new):
                os.unlink(new)
            shutil.copy(os.path.join(SCRATCH, 'cube.tetlod'), new)
            os.replace(new, os.path.join(FOLDER, name + '.tetlod'))
            eventually(lambda: server.get('/v1/meshes/' + name)[0] == 200)
            cid = next(cid for cid, good in GOOD.items() if good['data'] == streams['cube'])
            eventually(lambda: server.get('/v1/meshes/%s/%s/stream' % (name, cid))[2] == streams['cube'])


run([test_a_day, test_written_over_in_the_tick_of_a_rename])
