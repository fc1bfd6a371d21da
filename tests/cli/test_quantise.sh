#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Quantised builds: smaller, never better than they say, and refused where they cannot keep what is asked.
number=0
check() { number=$((number + 1)); if eval "$2"; then echo "ok $number - $1"; else echo "not ok $number - $1"; fi; }
size() { stat -c %s "$1"; }
finest() { "$TETLOD" info "$1" --json | /usr/bin/python3 -c "import json,sys; i = json.load(sys.stdin)
print(i['lossless'], i['levels'][-1]['errors']['xyz']['$2'])"; }
"$TETLOD" sample cube --size 6 -o cube.vtu >/dev/null 2>&1
"$TETLOD" build cube.vtu -o lossless.tetlod --quiet
"$TETLOD" build cube.vtu -o bits.tetlod --position-bits 14 --field-bits 12 --quiet
"$TETLOD" build cube.vtu -o error.tetlod --field-error 0.001 --quiet
check "12 bits are smaller than 64" "[ $(size bits.tetlod) -lt $(size lossless.tetlod) ]"
tail() { "$TETLOD" info "$1" --json | /usr/bin/python3 -c "import json,sys; a, b = json.load(sys.stdin)['levels'][-2:]
sys.exit((a['tets'], a['vertices']) != (b['tets'], b['vertices']))"; }
check "values on a grid of the builder's choice are exact in a tail" "tail lossless.tetlod"
check "values rounded as asked have no tail" "! tail bits.tetlod && ! tail error.tetlod"
check "the lossless one says so and has no error" "[ '$(finest lossless.tetlod max)' = 'True 0.0' ]"
check "the finest level of the others has one" "finest bits.tetlod max | grep -q '^False 0.0[0-9]*[1-9]'"
check "a field error asked for is certified" \
    "finest error.tetlod max | /usr/bin/python3 -c \
    'import sys; e = float(sys.stdin.read().split()[1]); sys.exit(not 0 < e <= 0.001)'"
for stream in lossless bits error; do
    "$TETLOD" verify $stream.tetlod --against cube.vtu --quiet >$stream.txt 2>&1
    check "the errors of $stream are true" "grep -q ok $stream.txt"
done
"$TETLOD" build cube.vtu -o none.tetlod --field-error 1e-12 --quiet 2>message.txt
check "more than 30 bits are refused" "[ $? = 2 ] && grep -q '30 bits' message.txt && [ ! -e none.tetlod ]"
"$TETLOD" build cube.vtu -o none.tetlod --position-bits 31 --quiet 2>message.txt
check "31 bits are not an option" "[ $? = 2 ] && grep -q position-bits message.txt"
"$TETLOD" build cube.vtu -o fast.tetlod --compress 1 --quiet
check "effort: no larger, and the same mesh" "[ $(size lossless.tetlod) -le $(size fast.tetlod) ] &&
    \"$TETLOD\" extract fast.tetlod -o fast.vtu --quiet &&
    \"$TETLOD\" extract lossless.tetlod -o small.vtu --quiet && cmp -s fast.vtu small.vtu"
if [ "$CONFIG" != release ]; then # larger meshes take a sanitizer minutes, and nothing is new in them for it
    echo "1..$number"
    exit
fi
"$TETLOD" sample fin -o fin.vtu >/dev/null 2>&1
"$TETLOD" build fin.vtu -o fin.tetlod --field Pressure --carry Pressure --position-bits 12 --min-tets 30000 --quiet
within() { "$TETLOD" info "$1" --json | /usr/bin/python3 -c "import json,sys; e = json.load(sys.stdin)['levels'][-1]['errors']['Pressure']
sys.exit(not e['sampled'] <= e['max'] <= $2)"; }
check "rounded positions: certified by the overlay, not by the steepest place" "within fin.tetlod 0.002"
"$TETLOD" verify fin.tetlod --against fin.vtu --quiet >fin.txt 2>&1
check "the errors of fin are true" "grep -q ok fin.txt"
data=$ROOT/../shared/data
if [ -e "$data/bluntfinxyz.bin" ]; then
    "$TETLOD" build "$data/bluntfinxyz.bin" --q "$data/bluntfinq.bin" --field Pressure --carry Pressure \
        --position-bits 16 --field-bits 16 --min-tets 187000 -o blunt.tetlod --quiet
    check "the blunt fin's thin tetrahedra: at most 2 %" "within blunt.tetlod 0.02"
else
    check "the blunt fin's thin tetrahedra # SKIP no $data" true
fi
echo "1..$number"
