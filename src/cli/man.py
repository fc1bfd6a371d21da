#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Writes the manual page of the program from what its commands say of themselves: man.py TETLOD > tetlod.1"""
import re
import subprocess
import sys


def text(*arguments):
    return subprocess.run([sys.argv[1], *arguments], check=True, stdout=subprocess.PIPE, text=True).stdout


def quoted(line):
    line = line.replace('\\', '\\e').replace('-', '\\-')
    return '\\&' + line if line[:1] in ".'" else line


def main():
    overview = text('help')
    version = text('--version').split()[1]
    commands = re.findall(r'^  ([\w-]+) +(.*)$', overview, re.M)
    print('.TH TETLOD 1 "" "tetlod %s" "User Commands"' % version)
    print('.SH NAME\ntetlod \\- levels of detail for tetrahedral volumes')
    print(
        '.SH SYNOPSIS\n.B tetlod\n.I COMMAND\n[OPTIONS] ...\n.br\n.B tetlod help\n[\\fICOMMAND\\fR]\n.br\n.B tetlod '
        '\\-\\-version'
    )
    print('.SH DESCRIPTION')
    print(
        'Simplifies a tetrahedral mesh with fields by contracting it, stores every contraction as an invertible '
        'record in one\n'
        'stream, and gives back any level of it: as a mesh file, over HTTP, or record by record.\n'
        'A level is a byte prefix of the stream, its error is certified over the whole domain, and the finest level '
        'is the\n'
        'original, bit for bit.')
    print('.SH COMMANDS')
    for name, summary in commands:
        print('.SS %s \\- %s\n.nf' % (name, quoted(summary)))
        for line in text('help', name).splitlines():
            print(quoted(line))
        print('.fi')
    print(
        '.SH EXIT STATUS\n0 done, 1 failed (input and output, memory), 2 usage, 3 invalid input (mesh or stream), 4 a '
        'valid stream whose levels are worse meshes\nthan its original (verify); 4 no (ask) or '
        'beyond the limit (diff), 5 undecided (ask, diff, features).'
    )
    print('.SH SEE ALSO\nThe stream is specified in format/SPEC.md of the sources.')


if __name__ == '__main__':
    main()
