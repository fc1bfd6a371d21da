#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# bash completes commands, options and values.
number=0
check() { number=$((number + 1)); if eval "$2"; then echo "ok $number - $1"; else echo "not ok $number - $1";
    printf '# %s\n' "${COMPREPLY[@]}"; fi; }
source "$ROOT/src/cli/tetlod.bash"
try() { COMP_WORDS=("$TETLOD" "$@"); COMP_CWORD=$#; _tetlod; }
has() { printf '%s\n' "${COMPREPLY[@]}" | grep -qx -- "$1"; }
try ''
check "commands" "has build && has extract && has help"
try ext
check "one command" "[ \"\${COMPREPLY[*]}\" = extract ]"
try help se
check "after help" "[ \"\${COMPREPLY[*]}\" = serve ]"
try build --max
check "options" "[ \"\${COMPREPLY[*]}\" = --max-error ]"
try extract f.tetlod --measure s
check "values" "[ \"\${COMPREPLY[*]}\" = sampled ]"
"$TETLOD" sample fin --size 6 -o fin.vtu && "$TETLOD" build fin.vtu -o fin.tetlod --quiet
for file in fin.vtu fin.tetlod; do
    try build $file --field ''
    check "fields of $file" "has Pressure && has Velocity"
    try build $file -o x.tetlod --field Vel
    check "a field of $file" "[ \"\${COMPREPLY[*]}\" = Velocity ]"
done
try build nothing.vtu --field ''
check "no file, no fields" "[ \${#COMPREPLY[@]} = 0 ]"
touch mesh.vtu
try build me
check "files" "has mesh.vtu"
echo "1..$number"
