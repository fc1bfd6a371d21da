# SPDX-License-Identifier: BSD-3-Clause
"""Messages of the library and of the program in the words of this package: options are keyword arguments."""
from __future__ import annotations

import re

# What the library and the program advise, and what does the same here
ADVICE = (
    (re.compile(r'; tetlod_build_defaults sets what is usual'), ''),
    (re.compile(r'--nan-fill of build or convert gives such points one'), 'numpy.nan_to_num gives such points one'),
    (re.compile(r" \(--json, --all and --quiet take no value\)"), ''),
    (re.compile(r"; 'tetlod [a-z ]+' lists [^;]*"), ''),
)
OPTION = re.compile(r'(?<![\w-])--([a-z][a-z-]*)(?![\w-])(?:[ =]([A-Z]+|[0-9][0-9.%]*)(?![\w]))?')
PROGRAM = re.compile(r'^tetlod(?: [a-z]+)?: ')


def speak(message: str) -> str:
    """The message without the program's name, C functions and options with dashes."""
    message = PROGRAM.sub('', message.strip())
    for words, here in ADVICE:
        message = words.sub(here, message)
    return OPTION.sub(lambda found: found[1].replace('-', '_') + '=' + (found[2] or ''), message)
