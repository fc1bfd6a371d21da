# SPDX-License-Identifier: BSD-3-Clause
"""What goes wrong around the server: full disks, descriptors that run out, folders and files that cannot be read, files
that change."""
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import time

from served import ROOT, SCRATCH, TETLOD, Server, answers, eventually, preloaded, run

MADE = os.path.join(SCRATCH, 'fin.tetlod')


def folder_of(name, *streams):
    folder = os.path.join(SCRATCH, name)
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    for stream in streams:
        shutil.copy(MADE, os.path.join(folder, stream + '.tetlod'))
    return folder


def test_explode_on_a_full_disk():
    folder, out = folder_of('source', 'fin'), os.path.join(SCRATCH, 'exploded')

    def small_files():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # then writing beyond the limit fails as on a full disk
        resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000))

    done = subprocess.run([TETLOD, 'explode', folder, '-o', out, '--meshes'], stderr=subprocess.PIPE,
                          preexec_fn=small_files)
    message = done.stderr.decode()
    assert done.returncode == 1 and out in message and 'File too large' in message and 'done' not in message, done
    done = subprocess.run([TETLOD, 'explode', folder, '-o', out, '--meshes'])
    assert done.returncode == 0


def test_what_is_no_stream_is_named_once():
    folder = folder_of('strange', 'good')
    os.mkfifo(os.path.join(folder, 'pipe.tetlod'))
    os.mkdir(os.path.join(folder, 'folder.tetlod'))
    os.symlink('/dev/zero', os.path.join(folder, 'device.tetlod'))
    os.symlink('loop.tetlod', os.path.join(folder, 'loop.tetlod'))
    os.symlink('nowhere', os.path.join(folder, 'dangling.tetlod'))
    shutil.copy(MADE, os.fsencode(folder) + b'/caf\xe9.tetlod')
    shutil.copy(MADE, os.path.join(folder, 'two\nlines.tetlod'))
    with Server(folder, '--scan', '0.05') as server:
        assert [m['id'] for m in server.json('/v1/meshes')['meshes']] == ['good']
        time.sleep(0.5)  # several scans
        lines = server.messages().splitlines()
        for name in ('pipe', 'folder', 'device', 'loop', 'dangling', 'caf', 'two'):
            assert len([line for line in lines if name in line]) == 1, (name, lines)
        assert all(line.startswith('tetlod: ') for line in lines), lines
        assert server.json('/readyz')['unreadable'] == 1  # the loop
    done = subprocess.run([os.fsencode(TETLOD), b'serve', b'--listen', b'127.0.0.1:0',
                           os.fsencode(folder) + b'/caf\xe9.tetlod'], stderr=subprocess.PIPE)
    assert done.returncode == 1 and b'not UTF-8' in done.stderr, done


def test_folder_that_goes_away_for_a_while():
    """Anything but "no such file" leaves what is served; /readyz and the log tell."""
    folder = folder_of('away', 'fin')
    with Server(folder, '--scan', '0.05', '--keep-replaced', '0.1') as server:
        cid = server.json('/v1/meshes/fin')['cid']
        aside = folder + '-aside'
        os.rename(folder, aside)
        os.symlink('away', folder)  # a loop: ELOOP
        eventually(lambda: server.json('/readyz')['unreadable'] == 1)
        time.sleep(0.5)
        assert server.json('/v1/meshes/fin')['cid'] == cid
        assert len([line for line in server.messages().splitlines()
                    if 'symbolic links' in line]) == 1, server.messages()
        os.unlink(folder)
        os.rename(aside, folder)
        eventually(lambda: server.json('/readyz')['unreadable'] == 0)
        os.unlink(os.path.join(folder, 'fin.tetlod'))
        eventually(lambda: server.get('/v1/meshes/fin')[0] == 404)  # that is no error
        assert server.json('/readyz')['unreadable'] == 0
        os.rename(folder, aside)  # what was named is gone: that is said
        eventually(lambda: server.json('/readyz')['unreadable'] == 1 and 'it is gone' in server.messages())
        os.rename(aside, folder)
        shutil.copy(MADE, os.path.join(folder, 'fin.tetlod'))
        eventually(lambda: server.get('/v1/meshes/fin')[0] == 200)


def lost(body):
    return int(re.search(rb'^tetlod_answers_lost_total (\d+)$', body, re.M)[1])


NO_MEMORY = r'''
#include <stdlib.h>
#include <unistd.h>
static int full(const char *what) { return access(getenv(what), F_OK) == 0; }
int MHD_add_connection(void *daemon, int fd, const void *address, unsigned size)
{
    int (*real)(void *, int, const void *, unsigned) = dlsym(RTLD_NEXT, "MHD_add_connection");
    return full("NO_CONNECTION") ? close(fd) : real(daemon, fd, address, size);
}
void *MHD_create_response_from_buffer(size_t size, void *bytes, int mode)
{
    void *(*real)(size_t, void *, int) = dlsym(RTLD_NEXT, "MHD_create_response_from_buffer");
    return full("NO_BODY") ? NULL : real(size, bytes, mode);
}
void *MHD_create_response_from_buffer_with_free_callback_cls(size_t size, void *bytes, void *free, void *of)
{
    void *(*real)(size_t, void *, void *, void *) =
        dlsym(RTLD_NEXT, "MHD_create_response_from_buffer_with_free_callback_cls");
    return full("NO_BODY") ? NULL : real(size, bytes, free, of);
}
'''


def test_no_memory_for_an_answer():
    """The client gets a refusal that was made when there was memory; what cannot be answered is counted and said."""
    if os.environ.get('CONFIG') != 'release':
        return 'sanitizers want to be loaded first'
    folder = folder_of('lost', 'fin')
    flags = {name: os.path.join(SCRATCH, name) for name in ('NO_CONNECTION', 'NO_BODY')}
    with Server(folder, environment=dict(flags, LD_PRELOAD=preloaded('no_memory', NO_MEMORY))) as server:
        ask = b'GET /v1/meshes/fin HTTP/1.1\r\nHost: localhost\r\n\r\n'
        last = ask.replace(b'\r\n\r\n', b'\r\nConnection: close\r\n\r\n')
        with open(flags['NO_BODY'], 'w'):
            refusals = answers(server.raw(ask + ask.replace(b'GET', b'HEAD') + last))
        os.unlink(flags['NO_BODY'])
        assert [status for status, _, _ in refusals] == [503] * 3, refusals
        assert all(headers['retry-after'] == '1' for _, headers, _ in refusals), refusals
        with open(flags['NO_CONNECTION'], 'w'):
            assert [server.raw(last) for _ in range(20)] == [b''] * 20
        os.unlink(flags['NO_CONNECTION'])
        assert server.get('/v1/meshes/fin')[0] == 200
        metrics = server.get('/metrics')[2]
        assert lost(metrics) == 23 and b'status="503"} 3' in metrics, metrics
        assert 0 < server.messages().count('there is no memory for') < 12, server.messages()


def test_descriptors_run_out():
    """What is served stays when a scan finds no descriptor; new files are taken up later."""
    folder = folder_of('scarce', 'a', 'b')
    with Server(folder, '--scan', '0.05', '--threads', '1') as server:
        before = len(os.listdir('/proc/%d/fd' % server.process.pid))
        soft, hard = resource.prlimit(server.process.pid, resource.RLIMIT_NOFILE)
        resource.prlimit(server.process.pid, resource.RLIMIT_NOFILE, (before - 1, hard))
        eventually(lambda: 'Too many open files' in server.messages())
        waiting = server.connect()
        waiting.sendall(b'GET /metrics HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n')
        eventually(lambda: 'a connection waits' in server.messages())
        resource.prlimit(server.process.pid, resource.RLIMIT_NOFILE, (soft, hard))
        with waiting, waiting.makefile('rb') as answer:  # it was not refused, and the wait was counted
            assert answers(body := answer.read())[0][0] == 200 and lost(body) > 0, body
        for name in 'ab':
            assert server.get('/v1/meshes/' + name)[0] == 200
        shutil.copy(MADE, os.path.join(folder, 'c.tetlod'))
        eventually(lambda: server.get('/v1/meshes/c')[0] == 200)


def test_more_files_than_descriptors():
    """Files are opened when they are read: 10,000 of them with 1,024 descriptors, beside as many connections as there
    is room for."""
    files, limit = (10000, 1024) if os.environ.get('CONFIG') == 'release' else (500, 256)
    folder = folder_of('many', 'f0')
    names = ['f%d' % i for i in range(files)]
    for name in names[1:]:
        os.link(os.path.join(folder, 'f0.tetlod'), os.path.join(folder, name + '.tetlod'))
    with Server(folder, '--scan', '0.2', descriptors=limit) as server:
        assert 'connections: the process may have %d descriptors' % limit in server.messages()
        ready = server.json('/readyz')
        assert ready['meshes'] == files and ready['unreadable'] == 0 and 0 < ready['open_files'] <= limit / 4, ready
        with open(MADE, 'rb') as file:
            good = file.read()
        cid = server.json('/v1/meshes/f0')['cid']
        idle = [server.connect() for _ in range(limit // 4)]
        random.seed(1)
        for name in random.sample(names, 300) + names[:2] + names[-2:]:
            status, _, body = server.get('/v1/meshes/%s/%s/stream' % (name, cid), Range='bytes=0-')
            assert status == 206 and body == good, (name, status)
        assert server.get('/v1/meshes/f7/%s/levels/3/mesh.vtu' % cid)[0] == 200
        # One that is closed now is replaced, and what is opened is never the wrong one
        subprocess.run([TETLOD, 'sample', 'cube', '--size', '2', '-o', 'other.vtu'], cwd=SCRATCH, check=True)
        subprocess.run([TETLOD, 'build', 'other.vtu', '-o', os.path.join(SCRATCH, 'other.tetlod'), '--quiet'],
                       cwd=SCRATCH, check=True)
        os.rename(os.path.join(SCRATCH, 'other.tetlod'), os.path.join(folder, names[5] + '.tetlod'))
        assert server.get('/v1/meshes/%s/%s/stream' % (names[5], cid))[2] != b''
        eventually(lambda: server.json('/v1/meshes/' + names[5])['cid'] != cid)
        ready = server.json('/readyz')
        assert ready['open_files'] <= limit / 4 + 8 and ready['unreadable'] == 0, ready
        for connection in idle:
            connection.close()
        assert 'Too many' not in server.messages()


def written_over(stream, place):
    folder = folder_of('over')
    path = os.path.join(folder, 'fin.tetlod')
    shutil.copy(stream, path)
    with open(path, 'rb') as file:
        good = file.read()
    with Server(folder, '--scan', '0.05') as server:
        at = '/v1/meshes/fin/%s/stream' % server.json('/v1/meshes/fin')['cid']
        half = len(good) - place
        about = os.stat(path)
        with open(path, 'r+b') as file:
            file.seek(half)
            file.write(bytes([good[half] ^ 1]))
        os.utime(path, ns=(about.st_atime_ns, about.st_mtime_ns))
        for _ in range(20):
            status, head, body = server.get(at)
            assert status in (404, 503) or body == good, status
        eventually(lambda: 'not served' in server.messages())
        assert server.get(at)[0] == 404
        with open(path, 'r+b') as file:
            file.seek(half)
            file.write(bytes([good[half]]))
        eventually(lambda: server.get(at)[0] == 200)
        assert server.get(at)[2] == good
        os.chmod(path, 0o600)  # changes the change time and nothing else
        eventually(lambda: server.get(at)[2] == good)


def test_written_over_with_the_same_size_and_time():
    """The change time tells; a file whose index is as it was is read whole before it is trusted again: levels, values
    of cells, steps, and the original order."""
    for stream, place in (('', 40), ('cells_float32', 1), ('series_float32', 1), ('kept_order', 1)):
        written_over(os.path.join(ROOT, 'tests', 'golden', stream + '.tetlod') if stream else MADE, place)


WRITING_READ = r'''
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>
static void write_over(int fd, off64_t offset)
{
    char link[64], byte;
    ssize_t (*read_at)(int, void *, size_t, off64_t) = dlsym(RTLD_NEXT, "pread64");
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    int again = open(link, O_WRONLY);
    if (again >= 0 && read_at(fd, &byte, 1, offset) == 1) {
        byte ^= 1;
        if (pwrite(again, &byte, 1, offset) != 1)
            abort();
    }
    close(again);
}
ssize_t pread64(int fd, void *out, size_t size, off64_t offset)
{
    ssize_t (*next)(int, void *, size_t, off64_t) = dlsym(RTLD_NEXT, "pread64");
    if (unlink(getenv("WRITE")) == 0)
        write_over(fd, offset);
    return next(fd, out, size, offset);
}
ssize_t pread(int fd, void *out, size_t size, off_t offset)
{
    return pread64(fd, out, size, offset);
}
'''


def test_written_over_between_look_and_read():
    """Somebody writes into a checked file after the server has looked at it, and before it reads."""
    if os.environ.get('CONFIG') != 'release':
        return 'sanitizers want to be loaded first'
    flag, folder = os.path.join(SCRATCH, 'write'), folder_of('between', 'fin')
    with Server(folder, '--scan', '1000',
                environment={'LD_PRELOAD': preloaded('writing_read', WRITING_READ), 'WRITE': flag}) as server:
        at = '/v1/meshes/fin/' + server.json('/v1/meshes/fin')['cid']
        good = server.get(at + '/records/1-4')[2]
        with open(flag, 'w'):
            pass
        status, _, body = server.get(at + '/records/2-5')
        assert not os.path.exists(flag)
        assert status == 503 and b'damaged or is being written' in body, (status, body[:300])
        assert server.get(at + '/records/1-4')[2] == good


HANG = r'''
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>
struct dirent *readdir(DIR *folder)
{
    struct dirent *(*next)(DIR *) = (struct dirent *(*)(DIR *))dlsym(RTLD_NEXT, "readdir");
    int before = errno;
    while (access(getenv("HANG"), F_OK) == 0) {
        close(creat(getenv("HANGING"), 0600));
        usleep(10000);
    }
    errno = before;
    return next(folder);
}
'''


def test_a_folder_that_hangs():
    """As on a network file system whose server is away: all else goes on, and stopping is not held up."""
    if os.environ.get('CONFIG') != 'release':
        return 'sanitizers want to be loaded first'
    flag, hangs = (os.path.join(SCRATCH, name) for name in ('hang', 'hangs'))
    folder = folder_of('hanging', 'fin')

    def hang():
        with open(flag, 'w'):
            pass
        eventually(lambda: os.path.exists(hangs))

    with Server(folder, '--scan', '0.05', '--timeout', '1', '--drain', '0.1',
                environment={'LD_PRELOAD': preloaded('hang', HANG), 'HANG': flag, 'HANGING': hangs}) as server:
        hang()
        shutil.copy(MADE, os.path.join(folder, 'new.tetlod'))
        assert server.get('/v1/meshes/fin')[0] == 200 and server.get('/v1/meshes/fin/prefix?level=0')[0] == 200
        assert server.raw(b'') == b''  # who asks nothing is shut out in time
        assert server.get('/v1/meshes/new')[0] == 404
        os.unlink(flag)
        eventually(lambda: server.get('/v1/meshes/new')[0] == 200)
        os.unlink(hangs)
        hang()
    assert 'does not answer' in server.messages()
    os.unlink(flag)


HANGING_READ = r'''
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
static int hangs(int fd)
{
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t size = readlink(link, path, sizeof path - 1);
    path[size > 0 ? size : 0] = 0;
    return strstr(path, "hangs") != NULL && access(getenv("HANG"), F_OK) == 0;
}
ssize_t pread64(int fd, void *out, size_t size, off64_t offset)
{
    ssize_t (*next)(int, void *, size_t, off64_t) = dlsym(RTLD_NEXT, "pread64");
    while (hangs(fd))
        usleep(10000);
    return next(fd, out, size, offset);
}
ssize_t pread(int fd, void *out, size_t size, off_t offset)
{
    return pread64(fd, out, size, offset);
}
'''


def test_a_file_that_hangs():
    """Who asks for it waits, and is refused after some seconds. All others are answered: from memory at once, and from
    files by threads that take the place of those that hang. Stopping is not held up. When the file answers again, so
    does the server."""
    if os.environ.get('CONFIG') != 'release':
        return 'sanitizers want to be loaded first'
    flag, folder = os.path.join(SCRATCH, 'hang_read'), folder_of('reads', 'hangs')
    other = os.path.join(ROOT, 'tests', 'golden', 'cells_float32.tetlod')
    shutil.copy(other, os.path.join(folder, 'good.tetlod'))
    shutil.copy(MADE, os.path.join(folder, 'twin.tetlod'))
    with open(other, 'rb') as file:
        good = file.read()
    with Server(folder, '--threads', '1', '--scan', '1000', '--drain', '0.2',
                environment={'LD_PRELOAD': preloaded('hanging_read', HANGING_READ), 'HANG': flag}) as server:
        fine, cid = (server.json('/v1/meshes/' + name)['cid'] for name in ('good', 'hangs'))
        with open(flag, 'w'):
            pass
        waiting = [server.connect() for _ in range(8)]
        for i, connection in enumerate(waiting):
            path = 'stream' if i % 2 else 'levels/%d/mesh.vtu' % i
            connection.sendall(
                b'GET /v1/meshes/hangs/%s/%s HTTP/1.1\r\nHost: localhost\r\n\r\n' % (cid.encode(), path.encode()))
        time.sleep(0.3)
        begin = time.monotonic()
        assert all(server.get('/healthz')[0] == 200 for _ in range(24))
        assert server.get('/v1/meshes/hangs')[0] == 200  # from memory
        assert time.monotonic() - begin < 5, time.monotonic() - begin
        assert server.get('/v1/meshes/good/%s/stream' % fine)[2] == good
        assert server.get('/v1/meshes/good/%s/levels/0/mesh.vtu' % fine)[0] == 200
        assert server.get('/v1/meshes/twin/%s/stream' % cid)[0] == 200  # a copy of what hangs
        assert server.get('/v1/meshes/twin/%s/levels/0/mesh.vtu' % cid)[0] == 200
        for connection in waiting:
            assert b' 503 ' in connection.recv(65536)
            connection.close()
        begin = time.monotonic()
        status, _, body = server.get('/v1/meshes/hangs/%s/records/0-1' % cid)
        assert status == 503 and b'does not answer' in body and time.monotonic() - begin < 2, (status, body)
        os.unlink(flag)
        eventually(lambda: server.get('/v1/meshes/hangs/%s/stream' % cid)[0] == 200)
        eventually(lambda: server.get('/v1/meshes/hangs/%s/levels/5/mesh.vtu' % cid)[0] == 200)
        with open(flag, 'w'):
            pass
        with server.connect() as connection:
            connection.sendall(
                b'GET /v1/meshes/hangs/%s/records/2-9 HTTP/1.1\r\nHost: localhost\r\n\r\n' % cid.encode())
            time.sleep(0.3)
        begin = time.monotonic()
    assert time.monotonic() - begin < 5 and 'a file does not answer' in server.messages()
    os.unlink(flag)


AHEAD = r'''
#include <time.h>
int clock_gettime(clockid_t clock, struct timespec *out)
{
    int (*real)(clockid_t, struct timespec *) = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    int result = real(clock, out);
    if (clock == CLOCK_REALTIME)
        out->tv_sec += 3600;
    return result;
}
'''


def test_a_clock_that_was_set():
    """Where the time of day is an hour behind of what it was, scans and time-outs come as they did: they wait by
    another clock."""
    if os.environ.get('CONFIG') != 'release':
        return 'sanitizers want to be loaded first'
    folder = folder_of('ahead', 'fin')
    with Server(folder, '--scan', '0.05', '--timeout', '1',
                environment={'LD_PRELOAD': preloaded('ahead', AHEAD)}) as server:
        shutil.copy(MADE, os.path.join(folder, 'new.tetlod'))
        eventually(lambda: server.get('/v1/meshes/new')[0] == 200)
        assert server.raw(b'') == b''  # who asks nothing is shut out


def test_stop_while_scanning():
    """The thread that looks at the paths reads the catalogue and the caches to its last step."""
    folder = folder_of('scanned', 'fin')
    busy = {'TSAN_OPTIONS': 'report_thread_leaks=0'}  # where the machine has no time for it, the thread is left alone
    with Server(folder, '--scan', '1000', environment=busy) as ending:
        for i in range(100):
            os.link(MADE, os.path.join(folder, '%d.tetlod' % i))
        ending.process.send_signal(signal.SIGHUP)
        time.sleep(0.002)


subprocess.run([TETLOD, 'sample', 'fin', '--size', '6', '-o', 'fin.vtu'], cwd=SCRATCH, check=True)
subprocess.run([TETLOD, 'build', 'fin.vtu', '--field', 'Pressure', '-o', MADE, '--quiet'], cwd=SCRATCH, check=True)
run([test_explode_on_a_full_disk, test_what_is_no_stream_is_named_once, test_folder_that_goes_away_for_a_while,
     test_no_memory_for_an_answer, test_descriptors_run_out, test_more_files_than_descriptors,
     test_written_over_with_the_same_size_and_time, test_written_over_between_look_and_read,
     test_a_folder_that_hangs, test_a_file_that_hangs, test_a_clock_that_was_set, test_stop_while_scanning])
