#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""plan, run and merge: several tasks build one stream, whose bytes are those of build --paged, whatever becomes of the
tasks."""
import json
import os
import random
import resource
import shutil
import signal
import struct
import subprocess
import time

from common import CONFIG, SCRATCH, TETLOD, case, fails, finish, must, path, report, tetlod, write


def read(name):
    with open(path(name), 'rb') as file:
        return file.read()


def plan(*arguments):
    shutil.rmtree(path('work'), ignore_errors=True)
    must('plan', 'work', *arguments)


def begin(*arguments):
    return subprocess.Popen([TETLOD, 'run', 'work', *arguments], cwd=SCRATCH, stdout=subprocess.DEVNULL,
                            stderr=subprocess.PIPE)


def end(tasks):
    said = [task.communicate()[1].decode() for task in tasks]
    return None if all(task.returncode == 0 for task in tasks) and not any(said) else said


def parts():
    """Paths of the parts that are done."""
    return [os.path.join(folder, file) for folder, _, files in os.walk(path('work')) for file in files
            if file.isdigit()]


def same(inputs, *options, counts=(3,)):
    """So many tasks at once, or none at all; then the merge, which says nothing where it is quiet."""
    must('build', *inputs, '-o', 'alone.tetlod', *options)
    for count in counts:
        plan(*inputs, *options)
        wrong = end([begin('--task', '%d/%d' % (i + 1, count), '--threads', '1') for i in range(count)])
        if wrong:
            return wrong
        done = len(parts())
        said = must('merge', 'work', '-o', 'many.tetlod', '--quiet')
        if said.stderr or read('many.tetlod') != read('alone.tetlod'):
            return count, said.stderr
        if count and len(parts()) != done:
            return 'the tasks have left work to the last one'
    return None


def killed():
    """Two tasks, in an order by chance, are killed while they are at it; others do what they have left."""
    must('build', 'fin.vtu', '-o', 'alone.tetlod', '--paged=1500')
    plan('fin.vtu', '--paged=1500')
    for number in random.Random(3).sample(range(1, 4), 2):
        before, task = len(parts()), begin('--task', '%d/3' % number, '--threads', '1')
        while len(parts()) <= before and task.poll() is None:
            time.sleep(0.01)
        task.kill()
        task.communicate()
        if task.returncode == 0:
            return 'a task was too fast to be killed'
    leases = [file for _, _, files in os.walk(path('work')) for file in files if file.endswith('.lease')]
    wrong = end([begin('--task', '3/3'), begin('--task', '2/3')])
    must('merge', 'work', '-o', 'many.tetlod')
    kept = read('many.tetlod')
    must('run', 'work')
    must('merge', 'work', '-o', 'many.tetlod')
    return wrong or (None if leases and kept == read('many.tetlod') == read('alone.tetlod') else leases)


def leader_dies():
    """Of three tasks the one that leads is killed: another one leads."""
    must('build', 'fin.vtu', '-o', 'alone.tetlod', '--paged=1500')
    plan('fin.vtu', '--paged=1500')
    tasks = [begin('--task', '%d/3' % number, '--threads', '1') for number in (1, 2, 3)]
    while not parts():
        time.sleep(0.01)
    leader = int(read('work/leader.lease').split()[-1])
    os.kill(leader, signal.SIGKILL)
    for task in tasks: # until it is waited for, it is a process of this machine still
        if task.pid == leader:
            task.communicate()
    wrong = end([task for task in tasks if task.pid != leader])
    done = len(parts())
    must('merge', 'work', '-o', 'many.tetlod')
    good = leader in [task.pid for task in tasks] and done == len(parts())
    return wrong or (None if good and read('many.tetlod') == read('alone.tetlod') else (leader, done, len(parts())))


def open_parts():
    """Stages that a helper has been called for, with what their open parts are made of."""
    return [os.path.join(folder, file) for folder, _, files in os.walk(path('work')) for file in files
            if file.endswith('.in') and 'call' in files]


def reads_no_mesh():
    """While the task that leads rests, another one does its cells: without the input, which is something else now."""
    shutil.copy(path('fin.vtu'), path('gone.vtu'))
    must('build', 'gone.vtu', '-o', 'wanted.tetlod', '--paged=1500')
    plan('gone.vtu', '--paged=1500')
    about = os.stat(path('gone.vtu'))
    leader = begin('--task', '1/2', '--threads', '1')
    while len(open_parts()) < 3 and leader.poll() is None:
        time.sleep(0.002)
    leader.send_signal(signal.SIGSTOP)
    mesh, opened, before = read('gone.vtu'), len(open_parts()), len(parts())
    with open(path('gone.vtu'), 'wb') as file:
        file.write(bytes(len(mesh)))
    os.utime(path('gone.vtu'), ns=(about.st_atime_ns, about.st_mtime_ns))
    helper = begin('--task', '2/2', '--threads', '1')
    while len(open_parts()) > 1 and helper.poll() is None:
        time.sleep(0.01)
    helped = len(parts()) - before
    with open(path('gone.vtu'), 'wb') as file:
        file.write(mesh)
    os.utime(path('gone.vtu'), ns=(about.st_atime_ns, about.st_mtime_ns))
    leader.send_signal(signal.SIGCONT)
    wrong = end([leader, helper])
    must('merge', 'work', '-o', 'many.tetlod')
    same = read('many.tetlod') == read('wanted.tetlod')
    return wrong or (None if same and helped >= opened - 1 > 1 else (same, helped, opened))


def stops():
    """SIGTERM ends a task at once, and leaves no half part."""
    plan('fin.vtu', '--paged=1500')
    task = begin()
    while not parts() and task.poll() is None:
        time.sleep(0.01)
    sent = time.monotonic()
    task.terminate()
    task.communicate()
    late = time.monotonic() - sent
    must('merge', 'work', '-o', 'many.tetlod')
    return None if late < 5 and read('many.tetlod') == read('alone.tetlod') else late


def refused():
    plan('fin.vtu', '--paged=1500')
    fails('a folder has one plan', 1, ['plan.json', 'is there already'], 'plan', 'work', 'fin.vtu')
    fails('a folder without one', 1, ['there is no plan', 'tetlod plan'], 'run', '.')
    fails('the output is named when it is written', 2, ['merge'], 'plan', 'other', 'fin.vtu', '-o', 'x.tetlod')
    fails('an input that is missing', 1, ['missing.vtu'], 'plan', 'other', 'missing.vtu')
    fails('options that there are not', 2, ['--nonsense'], 'plan', 'other', 'fin.vtu', '--nonsense')
    fails('a task that is none', 2, ['--task', '9/4'], 'run', 'work', '--task', '9/4')
    fails('no output', 2, ['-o'], 'merge', 'work')
    fails('two folders', 2, ['too many'], 'run', 'work', 'work')
    with open(path('work/plan.json')) as file:
        text = file.read()
    with open(path('work/plan.json'), 'w') as file:
        file.write(text.replace('"tetlod ', '"tetlod 99.'))
    fails('another version', 1, ['plan.json', 'one version'], 'run', 'work')
    with open(path('work/plan.json'), 'w') as file:
        file.write(text[:-9])
    fails('a plan that is cut off', 1, ['plan.json', 'is not a plan'], 'run', 'work')
    fails('what cannot be shared', 2, ['--certify exact'], 'plan', 'other', 'fin.vtu', '--certify', 'exact')
    must('sample', 'fin', '--size', '12', '-o', 'changes.vtu')
    plan('changes.vtu')
    must('sample', 'fin', '--size', '13', '-o', 'changes.vtu')
    fails('an input that has changed', 1, ['changes.vtu', 'has changed'], 'merge', 'work', '-o', 'x.tetlod')


def other_work():
    """A folder whose parts are of something else."""
    plan('fin.vtu', '--paged=1500')
    must('run', 'work')
    with open(path('work/plan.json')) as file:
        content = json.load(file)
    content['arguments'].append('--paged=2100')
    with open(path('work/plan.json'), 'w') as file:
        json.dump(content, file)
    done = tetlod('merge', 'work', '-o', 'many.tetlod')
    return None if done.returncode == 1 and b'is of other work' in done.stderr else done


def piece_changes():
    """A file that the input names is another one when the stream is written."""
    write('one.pvtu', '<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid><Piece Source="piece.vtu"/>'
                      '</PUnstructuredGrid></VTKFile>')
    shutil.copy(path('fin.vtu'), path('piece.vtu'))
    plan('one.pvtu', '--paged=1500')
    must('run', 'work')
    must('sample', 'fin', '--size', '17', '-o', 'piece.vtu')
    done = tetlod('merge', 'work', '-o', 'many.tetlod')
    return None if done.returncode == 1 and b'work/mesh: is of other work' in done.stderr else done


def step_changes():
    """So it is with the last step of a series: the task that led had other values of it."""
    plan('wake.pvd')
    must('run', 'work')
    shutil.copy(path('wake_6.vtu'), path('wake_7.vtu'))
    done = tetlod('merge', 'work', '-o', 'many.tetlod')
    must('sample', 'wake', '--steps', '8', '--size', '10', '-o', 'wake.pvd')
    return None if done.returncode == 1 and b'work/mesh: is of other work' in done.stderr else done


def damaged():
    """Parts that a disk has changed are named; without them they are made again."""
    plan('fin.vtu', '--paged=1500')
    must('run', 'work')
    named = 0
    one_of_each = sorted({os.path.dirname(part): part for part in parts()}.values())
    for number, part in enumerate(one_of_each[::3]):
        kept = read(part)
        write(part, (kept[:-1], bytes([kept[0] ^ 1]) + kept[1:], b'')[number % 3])
        done = tetlod('merge', 'work', '-o', 'many.tetlod')
        if done.returncode and (done.stderr.count(b'\n') != 1 or part.encode() not in done.stderr):
            return done
        named += done.returncode == 1
        os.unlink(part)
    must('merge', 'work', '-o', 'many.tetlod')
    return None if named > 1 and read('many.tetlod') == read('alone.tetlod') else named


def hash_of(data):
    """As parts have it behind them (src/util/hash.h)."""
    value, prime, mask = len(data), 0x100000001b3, 2 ** 64 - 1
    for word, in struct.iter_unpack('<Q', data[:len(data) // 8 * 8]):
        value = (value ^ word) * prime & mask
        value ^= value >> 32
    for byte in data[len(data) // 8 * 8:]:
        value = (value ^ byte) * prime & mask
    return struct.pack('<Q', value)


def forged():
    """Parts of which some bytes are others, with a hash that fits: they are taken or refused."""
    plan('fin.vtu', '--paged=1500')
    must('run', 'work')
    chance, seen = random.Random(7), set()
    stages = {}
    for part in parts():
        if len(read(part)) > 8:
            stages.setdefault(os.path.dirname(part), []).append(part)
    for turn in range(24):
        part = chance.choice(sorted(stages[sorted(stages)[turn % len(stages)]]))
        kept = read(part)
        if hash_of(kept[:-8]) != kept[-8:]:
            return 'another hash'
        data = bytearray(kept[:-8])
        for _ in range(chance.choice((1, 4))): # numbers stand at the begin
            data[chance.randrange(min(len(data), chance.choice((400, len(data)))))] = chance.choice((0, 1, 128, 255))
        write(part, bytes(data) + hash_of(data))
        done = tetlod('merge', 'work', '-o', 'many.tetlod', '--quiet')
        if done.returncode not in (0, 1, 2) or b'Sanitizer' in done.stderr.replace(b'Sanitizer failed to alloc', b''):
            return part, done
        seen.add(done.returncode)
        write(part, kept)
    return None if {0, 1} <= seen else seen


def full():
    """The folder has no room."""
    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (2048, 2048))
    plan('fin.vtu', '--paged=1500')
    done = tetlod('run', 'work', preexec_fn=limit)
    message = done.stderr.decode()
    good = done.returncode == 1 and message.count('\n') == 1 and 'work/stage-1' in message
    return None if good and not parts() and not end([begin()]) else done


must('sample', 'fin', '--size', '16', '-o', 'fin.vtu')
case('a flow', lambda: same(['fin.vtu'], '--paged=1500', counts=(3, 0)))
if CONFIG == 'release':
    must('sample', 'torus', '--size', '6', '-o', 'torus.vtu')
    case('a boundary that moves, local bounds', same, ['torus.vtu'], '--paged=2000', '--domain-error', '0.001',
         '--local-bound')
    case('rounded, in the order of the input', same, ['fin.vtu'], '--paged=1500', '--field-bits', '14',
         '--position-bits', '16', '--keep-order') # rounded positions: what writes measures all levels by itself
    must('sample', 'wake', '--steps', '8', '--size', '10', '-o', 'wake.pvd')
    case('a series', same, ['wake.pvd'])
    must('sample', 'wake', '--steps', '4', '--remesh', '2', '--size', '10', '-o', 'remeshed.pvd')
    case('a series over several meshes', same, ['remeshed.pvd'])
    case('a mesh of less than five cells', same, ['fin.vtu'])
    case('tasks are killed', killed)
    case('the task that leads is killed', leader_dies)
    case('the other tasks do not read the mesh', reads_no_mesh)
    case('a task is told to stop', stops)
    case('a folder of other work', other_work)
    case('a piece of the input changes', piece_changes)
    case('the last step of a series changes', step_changes)
    case('parts that are damaged', damaged)
    case('a folder that is full', full)
    refused()
case('parts that are forged', forged)
report('no part is left half written', not [file for file in os.listdir(SCRATCH) if 'tmp' in file.lower()])
finish()
