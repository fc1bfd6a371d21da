#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""format/ built by other compilers, without the project's flags: all golden streams decode to the same arrays, or it refuses."""
import glob
import os
import platform
import shutil
import subprocess

from tap import finish, report

ROOT = os.environ.get('ROOT', '.')
SOURCES = sorted(glob.glob(os.path.join(ROOT, 'format', '**', '*.c'), recursive=True))
SOURCES.append(os.path.join(ROOT, 'tests', 'unit', 'test_golden.c'))


def build(name, compiler, *flags):
    """Compiles and links; None: the compiler says no."""
    done = subprocess.run([compiler, *flags, '-I', ROOT, '-o', name, *SOURCES, '-lm'], stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True)
    return done.stdout if done.returncode else ''


def decodes(what, compiler, flags, emulator=()):
    if not shutil.which(compiler) or emulator and not shutil.which(emulator[0]):
        return report(what, True, skip='%s is not there (make deps-check)' % compiler)
    said = build('decode', compiler, *flags)
    if not said:
        done = subprocess.run([*emulator, './decode'], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        said = '' if done.returncode == 0 and 'ok 1' in done.stdout else done.stdout or 'no output'
    return report(what, not said, said)


decodes('gcc -O3 -march=native', 'gcc', ['-O3', '-march=native'])
decodes('clang -O3 -march=native', 'clang', ['-O3', '-march=native'])
if platform.machine() == 'x86_64' and shutil.which('gcc'):
    # what -march=native means on newer machines: FLT_EVAL_METHOD is 16 (compiled only: it does not run on older ones)
    said = build('half', 'gcc', '-mavx512fp16', '-fsyntax-only')
    report('gcc -mavx512fp16', not said, said)
else:
    report('gcc -mavx512fp16', True, skip='no gcc, or not an x86-64 machine')
decodes('32 bits, big-endian (PowerPC)', 'powerpc-linux-gnu-gcc', ['-O1', '-static'], ['qemu-ppc'])
for flag in ('-ffast-math', '-fassociative-math -fno-signed-zeros -fno-trapping-math'):
    for compiler in ('gcc', 'clang'):
        if shutil.which(compiler) and (compiler == 'gcc' or flag == '-ffast-math'):
            said = subprocess.run([compiler, *flag.split(), '-I', ROOT, '-fsyntax-only',
                                   os.path.join(ROOT, 'format', 'coding', 'record.c')],
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            report('%s %s is refused' % (compiler, flag), said.returncode and
                   'tetlod must not be compiled' in said.stdout, said.stdout)
if shutil.which('clang') and 'fma' in open('/proc/cpuinfo').read():
    # this option overrides what the sources ask for: the probe finds it when a stream is opened
    said = build('fused', 'clang', '-O2', '-mfma', '-ffp-contract=fast')
    done = subprocess.run(['./fused'], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    report('clang -ffp-contract=fast: right, or refused', not said and 'hashes' not in done.stdout, said + done.stdout)
else:
    report('clang -ffp-contract=fast', True, skip='no clang, or no fused multiply-add here')
finish()
