#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The table of CONTRIBUTING.md held against every #include, and rules that a compiler does not know."""
import glob
import os
import re
import sys

from lint_report import ROOT, finish, report

# folder: what it may include beside itself and libc; a name that ends in / is a folder. CONTRIBUTING.md says why.
API = ['format/tetlod.h', 'format/fail.h']
FORMAT = API + ['format/common/cuts.h', 'format/common/sink.h', 'format/common/utf8.h', 'format/common/round.h']
ARRAYS = FORMAT + ['src/util/']
MESHES = ARRAYS + ['src/mesh/']
LAYERS = {
    'format': [],
    'format/common': API,
    'format/coding': API + ['format/common/'],
    'format/read': API + ['format/common/', 'format/coding/'],
    'format/write': API + ['format/common/', 'format/coding/', 'format/read/'],
    'src/util': FORMAT,
    'src/mesh': ARRAYS,
    'src/io': MESHES + ['src/io/readers/', 'src/io/writers/', 'src/io/services/'],
    'src/io/readers': MESHES + ['src/stream/level_mesh.h', 'src/stream/metadata.h', 'src/io/services/'],
    'src/io/writers': MESHES + [
        'src/stream/level_mesh.h', 'src/stream/metadata.h', 'src/cut/cut.h', 'src/io/services/h5.h',
        'format/coding/pointer.h'
    ],
    'src/io/services': MESHES,
    'src/sample': MESHES,
    'src/cut': MESHES,
    'src/ask': MESHES + ['src/cut/line.h', 'src/stream/', 'format/read/summary.h', 'format/read/box_sums.h'],
    'src/diff': MESHES + ['src/ask/', 'src/measure/same.h', 'src/measure/weights_map.h'],
    'src/simplify': MESHES + ['src/simplify/', 'src/log/contraction_log.h'],
    'src/simplify/mesh': MESHES + ['src/log/contraction_log.h'],
    'src/simplify/rounds': MESHES + ['src/simplify/', 'src/log/contraction_log.h'],
    'src/simplify/exact': MESHES + ['src/simplify/limit.h', 'src/simplify/ladder.h', 'src/simplify/mesh/'],
    'src/cells': MESHES + [
        'format/write/write_input.h', 'src/simplify/piece.h', 'src/simplify/rounds/rounds.h', 'src/simplify/ladder.h',
        'src/simplify/simplify.h', 'src/simplify/simplify_options.h', 'src/log/contraction_log.h'
    ],
    'src/log': MESHES,
    'src/stream': MESHES + ['format/read/exact_values.h'],
    'src/measure': MESHES + ['src/log/', 'src/stream/'],
    'src/pipeline': MESHES + [
        'format/common/', 'format/coding/', 'format/read/summary.h', 'format/read/box_sums.h', 'format/write/',
        'src/ask/clip.h', 'src/ask/features.h', 'src/simplify/simplify.h', 'src/simplify/further.h',
        'src/simplify/retrace.h', 'src/simplify/ladder.h', 'src/cells/cell_phases.h', 'src/cells/cell_help.h',
        'src/cells/border_help.h', 'src/log/', 'src/measure/'
    ],
    'src/library': MESHES + [
        'src/pipeline/build.h', 'src/pipeline/build_helper.h', 'src/pipeline/build_warnings.h',
        'src/pipeline/build_series.h', 'src/pipeline/field_choice.h', 'src/pipeline/series_spool.h'
    ],
    'src/many': ARRAYS,
    'src/mpi': ARRAYS + ['src/cli/cli.h', 'src/cli/build_request.h', 'src/library/'],
    'src/report': MESHES + ['src/stream/', 'src/ask/', 'src/diff/decide.h'],
    'server': MESHES + ['server/net/', 'server/routes/', 'server/jobs/', 'server/http/', 'server/store/'],
    'server/net': ARRAYS + ['server/http/message.h'],
    'server/routes': MESHES + [
        'src/cut/', 'src/io/io.h', 'src/report/', 'src/stream/', 'src/measure/region_error.h', 'format/read/reader.h',
        'server/jobs/', 'server/http/', 'server/store/'
    ],
    'server/jobs': MESHES +
    ['src/ask/ask.h', 'src/io/io.h', 'src/report/info_json.h', 'src/stream/', 'server/http/', 'server/store/'],
    'server/http': MESHES + ['server/store/'],
    'server/store': MESHES + ['src/report/', 'src/stream/metadata.h', 'src/stream/level_mesh.h', 'format/read/parts.h'],
    'server/web/refine': MESHES + ['src/stream/', 'src/ask/'],
    'server/web/wasm': MESHES + ['format/common/bytes.h', 'src/cut/'],
    'src/cli': ['format/common/bytes.h', 'format/read/grids.h', 'format/write/page_check.h', 'format/write/prefix.h'] +
    MESHES + [
        'src/io/io.h', 'src/report/', 'src/sample/sample.h', 'src/pipeline/', 'src/simplify/', 'src/log/',
        'src/measure/', 'src/many/', 'src/stream/', 'src/ask/', 'src/diff/decide.h', 'server/server.h',
        'server/routes/assets.h', 'server/routes/stream_json.h', 'server/store/catalogue.h'
    ],
}
LIBC = set(
    '''assert ctype dirent errno fcntl float fnmatch getopt immintrin inttypes limits malloc math pthread sched signal stdarg stdatomic stdbool stddef
    stdint stdio stdlib string strings time unistd sys/ioctl sys/mman sys/resource sys/stat sys/syscall
    sys/time sys/vfs sys/types linux/userfaultfd'''.split())
SOCKETS = set('arpa/inet netdb netinet/in netinet/tcp poll sys/eventfd sys/random sys/socket sys/un'.split())
# header: the folders that may know the library, or the files
PACKAGES = {
    'hdf5.h': ['src/io/'],
    'netcdf.h': ['src/io/'],
    'netcdf_mem.h': ['src/io/'],
    'cgnslib.h': ['src/io/'],
    'sys/wait.h': ['src/io/services/contain.c'],
    'expat.h': ['src/io/'],
    'lzma.h': ['src/io/'],
    'zlib.h': ['src/io/', 'server/http/'],
    'lz4.h': ['src/io/'],
    'zstd.h': ['server/http/'],
    'jansson.h': ['src/stream/', 'src/report/', 'src/cli/', 'server/'],
    'microhttpd.h': ['server/net/'],
    'curl/curl.h': ['src/cli/web_source.c'],
    'mpi.h': ['src/mpi/'],
}
BANNED = re.compile(r'(?<![\w.>])(strcpy|strcat|sprintf|vsprintf|sscanf|atoi|atol|atof|strtok|gets|alloca)\s*\(')
SPEAKS = re.compile(
    r'(?<![\w.>])(printf|vprintf|puts|putchar|perror|exit|_exit|abort|signal|sigaction|sigwait|dup2)\s*\(|\b(stdout|stderr)\b|'
    r'\b(STDOUT|STDERR)_FILENO\b')

CHILDREN = ['src/io/services/contain.c']  # a process of its own, which must end
SPEAKERS = CHILDREN + ['src/mpi/mpi_main.c', 'src/util/temporary.c']  # the last cleans up at a signal


def code_of(text):
    """Without comments and without what is in quotes, lines kept."""
    def blank(match):
        return '\n' * match.group().count('\n') if match.group()[0] == '/' else '""'
    return re.sub(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])+\'', blank, text, flags=re.S)


def allowed(name, rules):
    return any(name == rule or (rule.endswith('/') and name.startswith(rule)) for rule in rules)


def bad_include(path, folder, kind, name):
    if kind == '"':
        if not os.path.exists(os.path.join(ROOT, name)):
            return 'is not a path from the root'
        if os.path.dirname(name) != folder and not allowed(name, LAYERS[folder]):
            return 'is not for %s' % folder
    elif name in PACKAGES:
        if not allowed(path, PACKAGES[name]):
            return 'belongs to %s' % ', '.join(PACKAGES[name])
    elif name[:-2] in SOCKETS:
        if folder not in ('server', 'server/net', 'src/cli'):
            return 'is for the server'
    elif name[:-2] not in LIBC:
        return 'is neither libc nor a library that is known here'
    return None


def mutual(sources):
    """Pairs of files under server/ that include each other; a source and its header are one."""
    uses = {}
    for path, text in sources.items():
        uses.setdefault(path[:-2],
                        set()).update(name[:-2] for name in re.findall(r'^\s*#\s*include\s*"([^"]+)"', text, re.M))
    return ['%s and %s' % (a, b) for a in uses for b in sorted(uses[a]) if a < b and a in uses.get(b, ()) and
            a.startswith('server/')]


def twins():
    """Source files of one name: a reader who is sent to one of them should not find two."""
    places = {}
    for top in ('src', 'format', 'server', 'tests', 'client-examples'):
        for path in glob.glob(os.path.join(ROOT, top, '**', '*'), recursive=True):
            if path.endswith(('.c', '.h', '.py', '.js', '.mjs',
                              '.sh')) and not os.path.basename(path).startswith('__') and 'node_modules' not in path:
                places.setdefault(os.path.basename(path), []).append(os.path.relpath(path, ROOT))
    return ['%s is %s' % (name, ' and '.join(sorted(paths)))
            for name, paths in sorted(places.items()) if len(paths) > 1]


def stale_mutants():
    """Lines of the proof that tests/mutants takes out, and that the code no longer has, or has twice."""
    sys.path.insert(0, os.path.join(ROOT, 'tests', 'mutants'))
    from table import MUTANTS
    return ['%s: %s' % (mutant['name'], file) for mutant in MUTANTS for file, old, _ in mutant['edits']
            if open(os.path.join(ROOT, file), encoding='utf-8').read().count(old) != 1]


def main():
    sources = {}
    for folder in LAYERS:
        for path in sorted(glob.glob(os.path.join(ROOT, folder, '*.[ch]'))):
            with open(path, encoding='utf-8') as file:
                sources[os.path.relpath(path, ROOT)] = file.read()
    includes, banned, speaking, long_files, licence = [], [], [], [], []
    for path, text in sources.items():
        folder = os.path.dirname(path)
        for kind, name in re.findall(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', text, re.M):
            why = bad_include(path, folder, kind, name)
            if why:
                includes.append('%s includes %s, which %s' % (path, name, why))
        for number, line in enumerate(code_of(text).splitlines(), 1):
            place = '%s:%d: %s' % (path, number, line.strip())
            if BANNED.search(line):
                banned.append(place)
            if folder != 'src/cli' and path not in SPEAKERS and SPEAKS.search(line):
                speaking.append(place)
        if text.count('\n') > 850:
            long_files.append('%s has %d lines' % (path, text.count('\n')))
        if not text.startswith('/* SPDX-License-Identifier: BSD-3-Clause */\n'):
            licence.append(path)
    planted = ['write(STDERR_FILENO, text, size);', 'dup2(from, to);', 'sigwait(&set, &number);', 'puts(text);']
    report('what is planted speaks', [line for line in planted if not SPEAKS.search(line)])
    report('%d files were found' % len(sources), [] if len(sources) > 100 else ['too few: is ROOT the tree?'])
    report('every folder of sources has its layer',
           sorted({os.path.dirname(os.path.relpath(path, ROOT)) for top in ('format', 'src', 'server')
                   for path in glob.glob(os.path.join(ROOT, top, '**', '*.[ch]'), recursive=True)
                   if 'node_modules' not in path} - set(LAYERS)))
    report('every #include is within the layers', includes)
    report('no two files of the server include each other', mutual(sources))
    report('no two files have one name', twins())
    report('no call that knows no bounds', banned)
    report('nothing outside src/cli prints, exits or takes signals', speaking)
    report('no file is too long to read', long_files)
    report('every source names its licence first', licence)
    report('every line that a mutant takes out is in its file, once', stale_mutants())
    finish()


main()
