#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""format/conformance: expected.json is what the reference decoder gives, the Python package over the C library gives
the same, each planted fault is found, and the runner keeps its contract."""
import json
import os
import subprocess
import sys
import time
import types
import warnings

from tap import finish, report

ROOT = os.environ.get('ROOT', '.')
KIT = os.path.join(os.path.abspath(ROOT), 'format', 'conformance')
sys.path.insert(0, KIT)
os.environ.setdefault('TETLOD_LIBRARY', os.path.join(os.path.dirname(os.environ['TETLOD']), 'libtetlod.so.0.1.0'))
import make  # noqa: E402
import package_reader  # noqa: E402
import reference_reader  # noqa: E402

warnings.simplefilter('ignore')  # of a file that is cut off
REFERENCE, PAGES = reference_reader.tetlod, reference_reader.reference_pages
with open(make.EXPECTED, encoding='utf-8') as file:
    TEXT = file.read()
EXPECTED = json.loads(TEXT)

# What is written in the place of what; each is an error that somebody who reads SPEC.md may make
FAULTS = [
    ('code - (1 << width) if signed', 'code if signed'),
    ('self.step[axis] + 0.5)', 'self.step[axis])'),
    ('self.origin[axis] + self.step[axis] * float(code)', 'self.origin[axis] + self.step[axis] * float(code + 1)'),
    ('return bits if bits <= self.most else -1 - (bits & self.most)', 'return bits'),
    ('code if code >= 0 else ~code | self.most + 1', 'code if code >= 0 else -code | self.most + 1'),
    ('place = above if stride == 1 else i % stride % 8', 'place = above'),
    ('above = out[i - stride] if i >= stride else 0', 'above = out[i - 1] if i else 0'),
    ('bound = (self.range >> 12) * (p >> 4)', 'bound = (self.range >> 16) * p'),
    ('chances[i] = p + ((65536 - p) >> SHIFT[seen])', 'chances[i] = p + (65536 - p >> 4)'),
    ('top = min(left, 2)', 'top = min(left, 3)'),
    ('value = value << some | self.plain(some)', 'value = value << some | self.plain(some) ^ 1'),
    ('some = min(left, 16)\n            left', 'some = min(left, 8)\n            left'),
    ("return [32768] * count, [0] * count", "return [32767] * count, [0] * count"),
    ('out[first], out[second] = out[second], out[first]', 'pass'),
    ('own * len(codes) - sum(codes[1:])', 'own * 2 - sum(codes[1:])'),
    ('value - scale.value(code, axis)', 'value - scale.value(code, 0) * 0.5'),
    ('return component if self.part == 0 else 0', 'return 0'),
    ('float(code) / POWERS[self.digits]', 'float(code) * (1 / POWERS[self.digits])'),
    ("self.copied[c] = coder.tree(source, 6)", "self.copied[c] = coder.tree(source, 5)"),
    ("require(not any(self.rest), what", "require(True, what"),
    ("self.code < self.range, 'a frame", "self.code <= self.range, 'a frame"),
]
PAGE_FAULTS = [
    ('self.models, self.listed = Models(), lists[number]', 'self.listed = lists[number]'),
    ('leaf[vertex] or vertex in seams', 'leaf[vertex]'),
    ('self.models.splits[vertex >= self.start]', 'self.models.splits[0]'),
    ('self.page_at([(min(axis) + max(axis)) / 2 for', 'self.page_at([sum(axis) / 4 for'),
    ('middle[node[0]] < node[1]', 'middle[node[0]] <= node[1]'),
    ('setdefault(level - 1, set()).update(stream.groups[level].pages[number].needed)', 'setdefault(level - 1, set())'),
    ('low + (high - low) * (steps / BOX_STEPS)', 'low + (high - low) * (steps / (BOX_STEPS + 1) - 0.5)'),
    ('not gaps @ gaps >', 'not gaps.max() ** 2 >'),
    ('min(cursor.left_out.get(t, finest + 1) - 1, finest)', 'cursor.left_out.get(t, finest + 1)'),
    ('next_number += page.tets', 'next_number += page.tets * (number in chosen.get(level, ()))'),
    ('self.page_of[t] in group.pages[page].needed', 'True'),
    ('self._pages_now(group)[2] == self.page_of,', 'True,'),
    ('sorted(vertices) for vertices', 'list(vertices)[::-1] for vertices'),
]


TOOK = {}  # seconds that a stream takes the reference decoder


def timed(path, answer=reference_reader.answer):
    start = time.process_time()
    try:
        return answer(path)
    finally:
        TOOK[path] = time.process_time() - start


def answered(answer, entry):
    """Does a decoder give what it must?"""
    try:
        return json.loads(json.dumps(answer(os.path.join(KIT, entry['stream'])))) == entry['answer']
    except Exception:  # a fault may end in any
        return False


def refused(answer, entry):
    try:
        answer(os.path.join(KIT, entry['stream']))
        return False
    except Exception:
        return True


def faulty(right, old, new):
    with open(right.__file__, encoding='utf-8') as file:
        text = file.read()
    assert old in text, old
    module = types.ModuleType(right.__name__)
    module.__file__, module.__package__ = right.__file__, 'tetlod'
    exec(compile(text.replace(old, new), right.__file__, 'exec'), module.__dict__)
    return module


def plant(right, wrong):
    sys.modules[right.__name__] = wrong
    setattr(reference_reader, 'tetlod' if right is REFERENCE else 'reference_pages', wrong)


def found(old, new, entries):
    """Whether a vector shows the fault."""
    right = next(module for module in (REFERENCE, PAGES) if old in open(module.__file__, encoding='utf-8').read())
    plant(right, faulty(right, old, new))
    try:
        return any(not answered(reference_reader.answer, entry) if 'answer' in entry else
                   not refused(reference_reader.answer, entry) for entry in entries)
    finally:
        plant(right, right)


def run_kit(reader, only):
    done = subprocess.run([os.path.join(KIT, 'run'), '--reader', reader, '--only', only], stdout=subprocess.PIPE,
                          text=True)
    return done.returncode, done.stdout.splitlines()[-1]


small = [entry['stream'] for entry in EXPECTED['valid'] if os.path.getsize(os.path.join(KIT, entry['stream'])) < 20000]
report('at least 60 valid streams below 20 kB, and 60 invalid ones', min(len(small), len(EXPECTED['invalid'])) >= 60)
with open(os.path.join(ROOT, 'format', 'SPEC.md'), encoding='utf-8') as file:
    clauses = {line.split()[1].rstrip('.') for line in file if line.startswith('#') and line.split()[1][0].isdigit()}
named = {entry['clause'] for kind in ('valid', 'invalid') for entry in EXPECTED[kind]}
report('the clauses are in SPEC.md', named <= clauses, named - clauses)
listed = {entry['stream'] for entry in EXPECTED['valid']}
here = {'valid/' + name for name in os.listdir(os.path.join(KIT, 'valid'))}
report('every stream of valid/ is listed', here <= listed, here - listed)
reference_reader.answer = timed
report('expected.json is what the reference decoder gives: format/conformance/make.py writes it',
       make.expected(make.noted()) == TEXT)
for name, _, _, data in make.profile_0():
    with open(os.path.join(KIT, 'valid', name + '.tetlod'), 'rb') as stream:
        report('client-examples/python/profile0.py writes %s' % name, stream.read() == data)
wrong = [entry['stream'] for entry in EXPECTED['valid'] if not answered(package_reader.answer, entry)]
report('the package over the C library gives the same', not wrong, wrong)
for decoder, name in ((reference_reader, 'reference decoder'), (package_reader, 'package')):
    taken = [e['stream'] for e in EXPECTED['invalid'] if not e.get('validator') and not refused(decoder.answer, e)]
    report('the %s refuses the invalid streams' % name, not taken, taken)
certain = [entry for entry in EXPECTED['invalid'] if refused(reference_reader.answer, entry)]
took = dict(TOOK)
quick_first = sorted(EXPECTED['valid'] + certain, key=lambda entry: took[os.path.join(KIT, entry['stream'])])
in_pages = [entry for entry in quick_first if '/paged_' in entry['stream']]
for faults, entries, where in ((FAULTS, quick_first, ''), (PAGE_FAULTS, in_pages, ' in pages')):
    hidden = [old for old, new in faults if not found(old, new, entries)]
    report('each of %d planted faults%s is found' % (len(faults), where), not hidden, hidden)
reader = os.path.join(KIT, 'reference_reader.py')
report('the runner: a right reader', run_kit("/usr/bin/python3 '%s' %%s" % reader, 'shape_o')[0] == 0)
report('the runner: a reader that gives nothing', run_kit('true %s', 'shape_o')[0] == 1)
report('the runner: a reader that crashes is no refusal', run_kit("sh -c 'exit 2' %s", 'invalid/magic')[0] == 1)
folder = os.path.join(os.environ['SCRATCH'], 'kit')
make.copy_kit(folder)
with open(os.path.join(folder, 'expected.json'), encoding='utf-8') as file:
    copied = json.load(file)
report('a copy has all streams', all(os.path.exists(os.path.join(folder, entry['stream']))
                                     for kind in copied.values() for entry in kind) and len(copied['invalid']) >= 60)
done = subprocess.run([os.path.join(folder, 'run'), '--reader', "/usr/bin/python3 '%s' %%s" % reader, '--only',
                       'one_tet'])
report('a copy runs on its own', done.returncode == 0)
report('the runner: nothing to run is a failure', run_kit('true %s', 'no such stream')[0] == 1)
finish()
