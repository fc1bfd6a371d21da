#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Makes tetlod.c and tetlod.h of the reader, to be copied into another program: amalgamate.py OUT SOURCE...

In: the sources of format/ that read. Out: one file in which each header stands once, before what needs it, and tetlod.h
as it is. Names that several sources keep to themselves get the source's name in front. Casts are added for C++.
"""
import collections
import glob
import os
import re
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]+"format/([\w./]+)"[^\n]*\n', re.M)
TEXT = re.compile(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'', re.S)
POINTER = re.compile(r'^(\s+)((?:const )?(?:struct )?\w+ (?:const )?\*+(?:const )?)(\w+ = )(\w+;)', re.M)
STATIC = re.compile(r'^(?:static|TETLODI_INLINE) [^;={(]*?\b(\w+)(?:\[[^\]]*\])*(?=\s*[(=;])', re.M)
TAG = re.compile(r'^((?:struct|union|enum) \w+) \{', re.M)
ENUM = re.compile(r'^enum(?: \w+)? \{([^}]*)\}', re.M)
MACRO = re.compile(r'^#define (\w+)', re.M)
TYPEDEF = re.compile(r'^typedef [^;]*?(\w+);', re.M)
HEAD = """/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * tetlod %s, the reader, in one file: made by `make amalgamation`. Compile it with your program, as C11 or as C++, and
 * include tetlod.h. Link with -pthread, and with -lm where the C library has that apart. Change the sources that it was
 * made of instead.
 */
#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif
#ifndef _FILE_OFFSET_BITS
#define _FILE_OFFSET_BITS 64
#endif
#include <stdlib.h>
#include "tetlod.h"

#ifdef __cplusplus
/* Memory without a type becomes a pointer to any, as in C. */
struct tetlodi_memory_of {
    void *at;
    template <class type> operator type *() const { return (type *)at; }
};
#define malloc(size) (tetlodi_memory_of{(malloc)(size)})
#define calloc(count, size) (tetlodi_memory_of{(calloc)(count, size)})
#define realloc(old, size) (tetlodi_memory_of{(realloc)(old, size)})
#define TETLODI_ZEROS {}
#else
#define TETLODI_ZEROS {0}
#endif

"""


def read(name):
    with open(os.path.join(HERE, name), encoding='utf-8') as file:
        return file.read()


def bare(text):
    """The text without comments and strings, of the same length."""
    return TEXT.sub(lambda found: re.sub(r'[^\n]', ' ', found[0]), text)


def own_names(text):
    """Names of file scope that a source keeps to itself: functions, tables, tags, constants, macros."""
    text = bare(text)
    names = STATIC.findall(text) + TAG.findall(text) + MACRO.findall(text) + TYPEDEF.findall(text)
    for body in ENUM.findall(text):
        names += re.findall(r'\b([A-Za-z_]\w*)\s*(?:=[^,]*)?(?:,|$)', body.strip())
    return set(names)


def renamed(text, names, prefix):
    """The text with these names under a prefix, where they are not members."""
    if not names:
        return text
    words = '|'.join(sorted({name.split()[-1] for name in names}))
    word = re.compile(r'(?<![\w.])(?<!->)(struct |union |enum )?\b(%s)\b' % words)

    def put(found):
        whole = (found[1] or '') + found[2]
        return (found[1] or '') + prefix + found[2] if whole in names else found[0]
    return outside_comments(text, lambda part: word.sub(put, part))


def outside_comments(text, change):
    """The text, changed where it is neither comment nor string."""
    out, at = [], 0
    for found in TEXT.finditer(text):
        out += [change(text[at:found.start()]), found[0]]
        at = found.end()
    return ''.join(out + [change(text[at:])])


def both_languages(text):
    """What C++ wants, and C takes: a cast where a pointer gets a bare one, zeros without a first member."""
    text = outside_comments(text, lambda part: POINTER.sub(r'\1\2\3(\2)\4', part))
    return text.replace(' = {0};', ' = TETLODI_ZEROS;')


def emit(name, text, done):
    """The text, with headers in place of their includes where they come first."""
    def header(found):
        if found[1] in done or found[1] == 'tetlod.h':
            return ''
        done.add(found[1])
        return emit(found[1], read(found[1]), done)
    text = INCLUDE.sub(header, text)
    text = re.sub(r'^/\* SPDX[^\n]*\n', '', text)
    return '\n/* ---- %s */\n%s' % (name, text)


def main():
    out, sources = sys.argv[1], [os.path.relpath(path, HERE) for path in sys.argv[2:]]
    texts = {name: read(name) for name in sources}
    headers = glob.glob(os.path.join(HERE, '**', '*.h'), recursive=True)
    shared = own_names(''.join(read(name) for name in headers))
    counts = collections.Counter(name for text in texts.values() for name in own_names(text))
    version = re.search(r'TETLOD_VERSION_STRING "(.*?)"', read('tetlod.h'))[1]
    done, parts = set(), [HEAD % version]
    for name, text in texts.items():
        clash = {own for own in own_names(text) if counts[own] > 1 or own in shared}
        parts.append(emit(name, both_languages(renamed(text, clash, os.path.basename(name)[:-2] + '_')), done))
    os.makedirs(out, exist_ok=True)
    for name, text in (('tetlod.c', ''.join(parts)), ('tetlod.h', read('tetlod.h'))):
        with open(os.path.join(out, name), 'w', encoding='utf-8') as file:
            file.write(text)


main()
