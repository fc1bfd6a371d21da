#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# An installed library is found through pkg-config, static and shared, and the C example runs with both.
number=0
check() { number=$((number + 1)); if eval "$2"; then echo "ok $number - $1"; else echo "not ok $number - $1"; fi; }
there="$PWD/there"
make -C "$ROOT" --no-print-directory install DESTDIR="$there" PREFIX=/usr >install.txt 2>&1
check "make install" "[ $? = 0 ]"
export PKG_CONFIG_PATH="$there/usr/lib/pkgconfig" PKG_CONFIG_SYSROOT_DIR="$there"
check "the version is the header's" "grep -q \"\\\"\$(pkg-config --modversion tetlod)\\\"\" '$there/usr/include/tetlod.h'"
cc -std=c11 -D_POSIX_C_SOURCE=200809L -Wall -Wextra -Werror "$ROOT/client-examples/c/level.c" $(pkg-config --cflags --libs tetlod) -lm -o shared 2>compile.txt
check "the example builds against the shared library" "[ -x shared ]"
cc -std=c11 -D_POSIX_C_SOURCE=200809L $(pkg-config --cflags tetlod) "$ROOT/client-examples/c/level.c" "$there/usr/lib/libtetlod.a" -lm -o static 2>>compile.txt
check "and against the static one, with nothing but libm" "[ -x static ]"
LD_LIBRARY_PATH="$there/usr/lib" ./shared "$ROOT/tests/golden/grid_float32.tetlod" 0 >shared.txt 2>&1
./static "$ROOT/tests/golden/grid_float32.tetlod" 0 >static.txt 2>&1
check "both give the same level" "grep -q 'level [0-9]*: ' shared.txt && cmp shared.txt static.txt"
check "the fed stream ends at the finest level" "tail -1 static.txt | grep -q 'level 8 is there'"
if command -v c++ >/dev/null; then
    check "the header is C++ as well" "echo '#include <tetlod.h>' | c++ -x c++ -fsyntax-only \$(pkg-config --cflags tetlod) -"
else
    echo "ok $((number += 1)) - the header is C++ as well # SKIP there is no C++ compiler"
fi
make -C "$ROOT" --no-print-directory uninstall DESTDIR="$there" PREFIX=/usr >/dev/null 2>&1
check "make uninstall leaves no file" "[ -z \"\$(find '$there' -type f -o -type l)\" ]"
echo "1..$number"
