#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What the documents say is there is there: commands, options, targets, paths, and the other way round."""
import glob
import os
import re

from lint_report import ROOT, finish, output, report

TETLOD = os.environ['TETLOD']
DOCUMENTS = ('README.md', 'CONTRIBUTING.md', 'samples/SOURCES.md', 'samples/MEASURED.md', 'src/README.md',
             'client-examples/ERRORS.md',
             'client-examples/SERIES.md')
OPTION = re.compile(r'(?<![\w-])--[a-z][a-z0-9-]*')


def read(path):
    with open(os.path.join(ROOT, path), encoding='utf-8') as file:
        return file.read()


def accepted_options(command):
    """The long options in the getopt table of a command's sources."""
    stem = command.replace('-', '_')
    paths = [os.path.join('src/cli', name % stem) for name in ('cmd_%s.c', '%s_request.c')]
    source = ''.join(read(path) for path in paths if os.path.exists(os.path.join(ROOT, path)))
    if 'READING_OPTIONS' in source:
        source += read('src/cli/reading.h')
    return {'--' + name for name in re.findall(r'\{"([a-z0-9-]+)",\s*(?:no|required|optional)_argument', source)}


def check_help(help_of):
    missing, made_up = [], []
    for command, text in help_of.items():
        said = set(OPTION.findall(text))
        other = set()
        for also in re.findall(r'\btetlod (\w+) --', text):  # another command's option, named as such
            other |= accepted_options(also) if also in help_of else set()
        missing += ['%s takes %s' % (command, option) for option in sorted(accepted_options(command) - said)]
        made_up += ['%s does not take %s' % (command,
                                             option) for option in sorted(said - accepted_options(command) - other)]
    report('--help names every option of every command', missing)
    report('and no other', made_up)
    report('every help has its usage line',
           [command for command, text in help_of.items() if not text.startswith('usage: tetlod %s' % command)])
    sources = {
        os.path.basename(path)[4:-2].replace('_', '-') for path in glob.glob(os.path.join(ROOT, 'src/cli/cmd_*.c'))
    }
    report('every command is listed', sorted(sources.symmetric_difference(help_of)))


def check_manual(help_of):
    manual = output('/usr/bin/python3', os.path.join(ROOT, 'src/cli/man.py'), TETLOD)
    plain = re.sub(r'\\([-e&])', lambda m: {'-': '-', 'e': '\\', '&': ''}[m.group(1)], manual)
    report('the manual has every line of every help',
           ['%s: %s' % (command, line)
            for command, text in help_of.items() for line in text.splitlines() if line not in plain])
    report('the manual names no option that no help has',
           sorted(set(OPTION.findall(plain)) - set(OPTION.findall(' '.join(help_of.values()))) - {'--version'}))


def check_targets():
    makefile = read('Makefile')
    targets = set(' '.join(re.findall(r'^\.PHONY:(.*)$', makefile, re.M)).split()) - {'FORCE'}
    listed = output('make', '-s', '-C', ROOT, 'help')
    words = set(re.findall(r'[\w-]+', listed))
    report('make help lists every target', sorted(targets - words))
    named = []
    for path in DOCUMENTS:
        named += [(path, name) for name in re.findall(r'(?:`|^    )make (?:-\S+ )*([a-z][\w-]*)', read(path), re.M)]
    report('make targets of the documents exist',
           ['%s: make %s' % n for n in named if n[1] not in targets] if named else ['none is named'])


def check_commands(help_of):
    wrong = []
    for path in DOCUMENTS:
        for command, rest in re.findall(r'(?:`|^ {4})tetlod ([a-z]+(?:-[a-z]+)?)([^`\n]*)', read(path), re.M):
            if command == 'help':
                continue
            if command not in help_of:
                wrong.append('%s: there is no tetlod %s' % (path, command))
                continue
            for option in OPTION.findall(rest.split('#')[0]):
                if option not in accepted_options(command):
                    wrong.append('%s: tetlod %s does not take %s' % (path, command, option))
    report('commands of the documents exist, with their options', wrong)


def check_paths():
    wrong = []
    for path in DOCUMENTS:
        text = read(path)
        here = os.path.dirname(os.path.join(ROOT, path))
        for name in re.findall(r'\]\(([^):#]+)\)', text):
            if not os.path.exists(os.path.join(here, name)):
                wrong.append('%s: %s' % (path, name))
        for name in re.findall(r'`((?:format|src|server|client-examples|tests|samples)/[\w./-]*)`', text):
            if not os.path.exists(os.path.join(ROOT, name)):
                wrong.append('%s: %s' % (path, name))
    report('files and pictures of the documents exist', wrong)
    version = output(TETLOD, '--version').split()[1]
    report('the changelog has this version', [] if '\n## %s' % version in read('CHANGELOG.md') else [version])


def check_front_page():
    lines = read('README.md').splitlines()
    long = ['line %d' % (i + 1) for i, line in enumerate(lines) if len(line) > 100]
    report('the README is a page of 150 lines of 100 columns',
           long + (['%d lines' % len(lines)] if len(lines) > 150 else []))


def main():
    names = re.findall(r'^  ([\w-]+) +\S', output(TETLOD, 'help'), re.M)
    help_of = {name: output(TETLOD, 'help', name) for name in names}
    check_help(help_of)
    check_manual(help_of)
    check_targets()
    check_commands(help_of)
    check_paths()
    check_front_page()
    finish()


main()
