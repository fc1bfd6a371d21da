#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""usage: run_mutants.py [NAME...]

Takes one line of the proof, or of what guards the server, out at a time, in a copy of the tree under build/mutants, and
expects a test to go red. A mutant that no test sees is a hole in the tests; a line that is no longer there is a fault
of the tables (table.py, door_table.py).

A killer is a test (`unit/test_exact`, `cli/test_promise.py`), maybe with one of its tests (`http/test_jobs.py
test_grace`, for tests of the server and of the page), or `attack FIRST COUNT`, `proof FIRST COUNT` or `doors FIRST
COUNT`: seeds of these programs of tests/attack, of which one must find what it does not find without the mutant.
"""
import os
import re
import shutil
import signal
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
TREE = os.path.join(ROOT, 'build', 'mutants', 'tree')
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import door_table  # noqa: E402, F401, which adds to the table
from table import MUTANTS  # noqa: E402

KEPT = ('format', 'src', 'server', 'tests', 'samples', 'client-examples', 'Makefile', 'LICENSE', 'build/release',
        'build/web', 'build/web.stamp', 'build/wasm', 'build/client', 'build/embedded')
MODULES = 'server/web/node_modules'


def copy_tree():
    """With the times of files, so that make only builds what a mutant changes."""
    shutil.rmtree(TREE, ignore_errors=True)
    for name in KEPT:
        source, target = os.path.join(ROOT, name), os.path.join(TREE, name)
        os.makedirs(os.path.dirname(target), exist_ok=True)
        if os.path.isdir(source):
            made = ('attack-*', '*.tetlod') if name.startswith('build') else ()
            shutil.copytree(source, target, symlinks=True, ignore=shutil.ignore_patterns('node_modules', *made))
        else:
            shutil.copy2(source, target)
    os.symlink(os.path.join(ROOT, MODULES), os.path.join(TREE, MODULES))


def make(targets):
    done = subprocess.run(['make', '-s', '-j%d' % os.cpu_count(), *targets], cwd=TREE, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT)
    return done.returncode == 0, done.stdout.decode(errors='replace')[-1500:]


def is_seeds(killer):
    return killer.split()[0] in ('attack', 'proof', 'doors')


def is_built(killer):
    return killer.startswith(('attack ', 'proof ', 'unit/'))


def targets_of(killers):
    targets = {'build/release/tetlod'}
    for killer in killers:
        if killer.startswith(('web/', 'clients/')):
            targets.add('all')
        elif is_built(killer):
            targets.add('build/release/tests/attack/' + killer.split()[0] if is_seeds(killer) else 'build/release/tests/' + killer)
    return sorted(targets)


def environment(**more):
    return dict(os.environ, **more, ROOT=TREE, TETLOD=os.path.join(TREE, 'build/release/tetlod'))


def red_tests(killer):
    """Names of the tests of a program that fail."""
    name, _, only = killer.partition(' ')
    command = [os.path.join(TREE, 'build/release/tests', killer)]
    if not killer.startswith('unit/'):
        command = ['python3', 'tests/run.py', '--only', name, 'release']
    try:
        done = subprocess.run(command, cwd=TREE, env=environment(ONLY=only, PATIENCE='90'), stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, timeout=600)
    except subprocess.TimeoutExpired:
        return {'it does not end'}
    return set(re.findall(r'^\W*not ok \d+ - (.*)', done.stdout.decode(errors='replace'), re.M)) or \
        ({'exit status %d' % done.returncode} if done.returncode else set())


def attack(killer, known):
    """Findings of the attack that are not known: the first one is enough, unless nothing is known yet."""
    kind, first, count = killer.split()
    command = ['build/release/tests/attack/proof', first, count]
    if kind == 'attack':
        command = ['python3', 'tests/attack/run_attack.py', 'build/release/tests/attack/attack', 'build/release/tetlod',
                   'build/attack', count, first]
    if kind == 'doors':
        command = ['/usr/bin/python3', 'tests/attack/doors.py', 'build/release/tetlod', 'build/attack', count, first]
    found = set()
    with subprocess.Popen(command, cwd=TREE, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          errors='replace', start_new_session=True) as process:
        for line in process.stdout:
            match = re.match(r'(seed \d+) .*?\): ([a-z ]*)', line)
            if match and match[1] + ': ' + match[2] not in (known or ()):
                found.add(match[1] + ': ' + match[2])
                if known is not None:
                    os.killpg(process.pid, signal.SIGTERM)
                    break
    return found


def findings(killer, known=None):
    """What a killer complains of, apart from what is known."""
    return attack(killer, known) if is_seeds(killer) else red_tests(killer) - (known or set())


class Lines:
    """Lines of the copy that are replaced, and put back."""

    def __init__(self, mutant):
        self.before, self.after = {}, {}
        for file, old, new in mutant['edits']:
            path = os.path.join(TREE, file)
            text = self.after.get(path) or open(path).read()
            self.before.setdefault(path, text)
            if text.count(old) != 1:
                raise LookupError('%s is %d times in %s: %s' % (mutant['name'], text.count(old), file, old))
            self.after[path] = text.replace(old, new)

    @staticmethod
    def write(texts):
        for path, text in texts.items():
            with open(path, 'w') as file:
                file.write(text)

    def __enter__(self):
        self.write(self.after)

    def __exit__(self, *_):
        self.write(self.before)


def try_mutant(mutant, before):
    with Lines(mutant):
        built, said = make(targets_of(mutant['killers']))
        if not built:
            return 'DOES NOT BUILD', said
        for killer in mutant['killers']:
            new = findings(killer, before[killer])
            if new:
                return 'caught', '%s: %s' % (killer, ', '.join(sorted(new))[:100])
    return 'SURVIVES', mutant['why']


def main():
    chosen = [m for m in MUTANTS if not sys.argv[1:] or m['name'] in sys.argv[1:]]
    if not chosen:
        sys.exit('mutants: there is none of that name')
    copy_tree()
    for mutant in chosen:
        Lines(mutant)  # all lines are there, before anything is tried
    killers = sorted({k for m in chosen for k in m['killers']})
    built, said = make(targets_of(killers))
    if not built:
        sys.exit('mutants: the tree does not build\n' + said)
    before = {killer: findings(killer) for killer in killers}
    bad = 0
    for mutant in chosen:
        verdict, text = try_mutant(mutant, before)
        bad += verdict != 'caught'
        print('%-14s %-34s %s' % (verdict, mutant['name'], text), flush=True)
    print('%d of %d mutants caught' % (len(chosen) - bad, len(chosen)))
    return 1 if bad else 0


if __name__ == '__main__':
    try:
        sys.exit(main())
    except LookupError as lost:
        sys.exit('mutants: %s' % lost)
