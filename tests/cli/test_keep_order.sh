#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# extract --original-order gives the input's own arrays, byte for byte.
number=0
check() { number=$((number + 1)); if eval "$2"; then echo "ok $number - $1"; else echo "not ok $number - $1"; fi; }
"$TETLOD" sample cube --size 5 -o cube.vtu --quiet 2>/dev/null || "$TETLOD" sample cube --size 5 -o cube.vtu
"$TETLOD" convert cube.vtu -o plain.vtu --quiet 2>/dev/null || "$TETLOD" convert cube.vtu -o plain.vtu
"$TETLOD" build cube.vtu -o kept.tetlod --keep-order --quiet
"$TETLOD" build cube.vtu -o other.tetlod --quiet
"$TETLOD" extract kept.tetlod --original-order -o back.vtu --quiet
check "the same file comes back" "cmp plain.vtu back.vtu"
"$TETLOD" extract kept.tetlod -o own.vtu --quiet
check "without the option it is the stream's numbering" "! cmp -s plain.vtu own.vtu"
"$TETLOD" verify kept.tetlod --against cube.vtu --quiet >verify.txt
check "the stream verifies" "grep -q ok verify.txt"
"$TETLOD" extract other.tetlod --original-order -o none.vtu 2>message.txt
check "a stream without it says how to get one" "[ $? = 2 ] && grep -q -- --keep-order message.txt && [ ! -e none.vtu ]"
refused() { # code, what the one line says, arguments
    "$TETLOD" extract -o none.vtu "${@:3}" 2>message.txt
    check "extract ${*:3}: $2" "[ $? = $1 ] && [ ! -e none.vtu ] && [ $(wc -l <message.txt) = 1 ] &&
        grep -q -- '$2' message.txt"
}
head -c 3000 kept.tetlod >cut.tetlod
refused 2 'leave out the choice' kept.tetlod --original-order --level 0
refused 2 'does not go with --box: it is for the finest' kept.tetlod --original-order --box 0,0,0,1,1,1
refused 2 'does not go with --box: it is for the finest' kept.tetlod --cells original --box 0,0,0,1,1,1
refused 2 'does not go with --points' kept.tetlod --original-order --points 0,0,0 -o none.csv
refused 2 'takes no value' kept.tetlod --original-order=yes
refused 2 'did you mean .--original-order.' kept.tetlod --keep-order
refused 3 'is cut off: levels 0 to .* and --original-order needs the finest' cut.tetlod --original-order
refused 3 'is cut off: levels 0 to .* and --cells original needs the finest' cut.tetlod --cells original
cat >order.py <<'END'
import os, sys
sys.path.insert(0, os.path.join(os.environ['ROOT'], 'client-examples/python'))
import numpy as np, tetlod.reference as tetlod, vtk
from vtk.util.numpy_support import vtk_to_numpy
reader = vtk.vtkXMLUnstructuredGridReader()
reader.SetFileName('cube.vtu')
reader.Update()
grid = reader.GetOutput()
stream = tetlod.open('kept.tetlod')
cursor = stream.cursor().seek(len(stream.levels) - 1)
vertices, tets, corners = stream.order()
positions, cells = np.empty_like(cursor.positions), np.empty_like(cursor.tets)
positions[vertices] = cursor.positions
cells[tets] = vertices[np.take_along_axis(cursor.tets, corners.astype(np.intp), 1)]
assert np.array_equal(positions, vtk_to_numpy(grid.GetPoints().GetData()))
assert np.array_equal(cells.ravel(), vtk_to_numpy(grid.GetCells().GetConnectivityArray()))
assert tetlod.open('other.tetlod').order() is None
print('same')
END
check "the Python decoder gives the input's arrays too" "/usr/bin/python3 order.py | grep -q same"
echo "1..$number"
