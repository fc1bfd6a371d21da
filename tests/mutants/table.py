# SPDX-License-Identifier: BSD-3-Clause
"""Lines that the promise hangs on: each is taken out in turn, and a test must go red (run.py).

`old` is text that is once in the file; `why` says what the line is for.
"""

MUTANTS = []


def mutant(name, file, old, new, why, *killers):
    MUTANTS.append({'name': name, 'file': file, 'old': old, 'new': new, 'why': why, 'killers': killers})


ATTACK = 'attack 1 60'

# ---- the envelope (PROOF.md, 2 to 4), in rounds

mutant('star without a tetrahedron', 'src/simplify/merge.c',
       'double extreme = -INFINITY;\n    for (uint32_t i = 0; i < weighing->count; i++) {', 'double extreme = -INFINITY;\n    for (uint32_t i = 1; i < weighing->count; i++) {',
       'all tetrahedra of the star are continued to the new vertex', ATTACK)
mutant('rounding slack', 'src/simplify/merge.c', 'double slack = 32 * DBL_EPSILON * (weighing->spread[i] * spread + fabs(first) + fabs(value));',
       'double slack = 0 * spread;', 'an upper value is widened by its rounding', ATTACK)
mutant('upper is the value', 'src/simplify/merge.c', 'row[ROW_FIELDS + 2 * c] = upper[c];', 'row[ROW_FIELDS + 2 * c] = (upper[c] + lower[c]) / 2;',
       'errors accumulate', ATTACK)
mutant('one side of the error', 'src/simplify/evaluate.c', 'worst = larger(worst, larger(upper[c] - value, value - lower[c]) * component->factor);',
       'worst = larger(worst, (upper[c] - value) * component->factor);', 'the error counts both ways', ATTACK)
mutant('certified is one side', 'src/simplify/merge.c', 'double worst = larger(upper[c] - values[c], values[c] - lower[c]);',
       'double worst = upper[c] - values[c];', 'what is stored counts both ways', ATTACK)
mutant('values are not rounded', 'src/simplify/evaluate.c',
       'double value = field_round(&run->working->fields[component->field], component->component, (upper[c] + lower[c]) / 2);',
       'double value = (upper[c] + lower[c]) / 2;', 'the error is that of the value as stored', ATTACK)
mutant('flips', 'src/simplify/kernels.c', 'fits &= !(small >> j & 1 && weighing->moves[i + j]);', 'fits &= !(small >> j & 1 && weighing->moves[i + j] > 1);',
       'C1: no tetrahedron flips or degenerates (the last test of it)', ATTACK)
mutant('link condition', 'src/simplify/evaluate.c',
       'if (!links_hold(&worker->links, hood, working, candidate->neighbour, &room)) {', 'if (!links_hold(&worker->links, hood, working, candidate->neighbour, &room) && !room) {',
       'C4', ATTACK)
mutant("link condition's boundary", 'src/simplify/links.c',
       'if (faces >> corner_of(corners, slot_a) & 1 && faces >> corner_of(corners, slot_b) & 1)\n            return false;', '',
       'a tetrahedron with boundary faces at both ends', ATTACK, 'unit/test_complex')

# ---- the boundary (5), in rounds

mutant('no demands of the map, above', 'src/simplify/evaluate.c', 'upper[c] = larger(upper[c], boundary_map_least(&worker->map, ROW_FIELDS + 2 * c, 0));', '',
       'what the boundary map demands of the upper value', ATTACK)
mutant('no demands of the map, below', 'src/simplify/evaluate.c', 'lower[c] = smaller(lower[c], boundary_map_greatest(&worker->map, ROW_FIELDS + 2 * c + 1));', '',
       'what the boundary map demands of the lower value', ATTACK)
mutant('no crossings', 'src/simplify/boundary_map.c', 'return status == MAP_FOUND ? map_crossings(map) : status;', 'return status;',
       'edges of the old and the new patch cross', ATTACK)
mutant('no result in the old patch', 'src/simplify/boundary_map.c', 'return map->moves[0] && map->moves[1] ? map_result(map) : MAP_FOUND;', 'return MAP_FOUND;',
       'the result between the ends', ATTACK)
mutant('distance is not counted', 'src/simplify/evaluate.c', 'double moved = larger(boundary_map_least(&worker->map, column, 1), 0);',
       'double moved = larger(boundary_map_least(&worker->map, column, 0), 0);', 'how far the boundary moved', ATTACK)
mutant('distance does not add up', 'src/simplify/merge.c', 'row[row_moved(working)] = moved;', 'row[row_moved(working)] = 0;',
       'how far the boundary moved in all', ATTACK)
mutant('interior joins the boundary', 'src/simplify/evaluate.c', 'if (working->flags[other] & (VERTEX_FROZEN | VERTEX_SINGULAR) || (own_open && !open))',
       'if (working->flags[other] & (VERTEX_FROZEN | VERTEX_SINGULAR))', 'the boundary is not pulled inside', ATTACK)

# ---- frozen vertices (6)

mutant('inverted are not frozen', 'src/simplify/evaluate.c', 'if (working->flags[slot] & VERTEX_FROZEN)\n', 'if (working->flags[slot] & 0)\n',
       'no star that moves has a degenerate or inverted tetrahedron', ATTACK)
mutant('folds are not frozen', 'src/simplify/border.c', 'working->flags[working->corners[t][c]] |= VERTEX_FROZEN;', '(void)c;',
       'no star that moves has a folded tetrahedron', ATTACK)

# ---- the same for other metrics, faces and tetrahedra

mutant('serial: star without a tetrahedron', 'src/simplify/fields.c',
       'for (uint32_t i = 0; i < star->tet_count && !star->still; i++) {\n        struct tet_affine affine;',
       'for (uint32_t i = 1; i < star->tet_count && !star->still; i++) {\n        struct tet_affine affine;',
       'all tetrahedra of the star are continued to the new vertex', ATTACK)
mutant('serial: upper is the value', 'src/simplify/fields.c', 'driver->upper[v] = outcome[d].upper;', 'driver->upper[v] = outcome[d].value;',
       'errors accumulate', ATTACK)
mutant('serial: no demands of the map', 'src/simplify/fields.c', 'double most = larger(envelope[1][1], shift_least(shift, driver->upper, 0));',
       'double most = envelope[1][1];', 'what the boundary map demands of the upper value', ATTACK)
mutant('serial: no crossings', 'src/simplify/shift.c', 'return graphs(&work, cosine) && map_vertices(shift, &work) && map_crossings(shift, &work);',
       'return graphs(&work, cosine) && map_vertices(shift, &work);', 'edges of the old and the new patch cross', 'unit/test_shift', ATTACK)
mutant('serial: flips', 'src/simplify/star.c', 'if (tet_orientation(q[0], q[1], q[2], q[3]) != complex->orientation)', 'if (tet_orientation(q[0], q[1], q[2], q[3]) > 2)',
       'C1', ATTACK, 'unit/test_complex')
mutant('serial: link triangles', 'src/simplify/star.c', 'return !(count == 3 && mask == IN_B && table_find(filed, triangle_key(v)));',
       'return true;', 'C4: a common triangle', 'unit/test_complex', ATTACK)
mutant("serial: link condition's boundary", 'src/simplify/star.c', 'if (complex_boundary_face(complex, star->tets[i], f)) {', 'if (f > 3) {',
       'C4: the boundary is coned', 'unit/test_complex', ATTACK)
mutant('serial: distance does not add up', 'src/simplify/boundary.c', 'boundary->moved[vertex] = moved;', 'boundary->moved[vertex] = 0;',
       'how far the boundary moved in all', ATTACK)

# ---- the exact limit (8)

mutant('exact: no original vertices', 'src/simplify/exact/exact.c', 'if (!at_vertex(e, v))', 'if (v > UINT32_MAX - 1 && !at_vertex(e, v))',
       'critical points of kind 1', 'unit/test_exact', ATTACK)
mutant('exact: no walls', 'src/simplify/exact/exact.c', 'return at_edges(e) && goes_on(e) && at_spokes(e);', 'return (1 || at_edges(e)) && goes_on(e) && at_spokes(e);',
       'critical points of kind 2', 'unit/test_exact', ATTACK)
mutant('exact: no spokes', 'src/simplify/exact/exact.c', 'return at_edges(e) && goes_on(e) && at_spokes(e);', 'return at_edges(e) && goes_on(e) && (1 || at_spokes(e));',
       'critical points of kind 3', 'unit/test_exact', ATTACK)
mutant('exact: not the new vertex', 'src/simplify/exact/exact.c', 'if (!is_original(e) && !at_apex(e))', 'if (0 && !is_original(e) && !at_apex(e))',
       'critical points of kind 4', 'unit/test_exact', ATTACK)
mutant('exact: originals are lost', 'src/simplify/exact/patch.c', 'if (!outside_walls(patch, patch->sides + 2 * t * patch->words, f) && !behind(patch, overlaps, complex, t, cone) &&',
       'if (t % 8 != 7 && !outside_walls(patch, patch->sides + 2 * t * patch->words, f) && !behind(patch, overlaps, complex, t, cone) &&',
       'a cone lists all originals that overlap it', 'unit/test_exact', ATTACK)

# ---- what is stored

mutant('max below sampled', 'src/pipeline/build.c', 'errors[TETLOD_MAX] = larger(errors[TETLOD_MAX], errors[TETLOD_SAMPLED]);', '',
       'max is never below what was measured', ATTACK)
mutant('finer levels may be worse', 'src/pipeline/build.c', 'errors[m] = isnan(errors[m]) ? errors[m] : larger(errors[m], finer[m]);', 'errors[m] = finer[m] < 0 ? 0 : errors[m];',
       'a level promises for all finer ones', ATTACK)
mutant('domain error of this level only', 'src/pipeline/build.c', '*domain = finer = larger(*domain, finer);', 'finer = *domain;',
       'a level promises for all finer ones', 'unit/test_simplify', ATTACK)
mutant('rounding is outside the limit', 'src/pipeline/limits.c', '*limit -= lost;', '', 'a limit holds with what rounding takes', 'cli/test_promise.py')
mutant('a vector without its share', 'src/pipeline/control.c', 'return (own > 0 && whole > 0 ? smaller(own / whole, 1) : 1) / sqrt(mesh->fields[vector].components);',
       '(void)own;\n    (void)whole;\n    return 8;', "a magnitude's promise holds for the vector", 'cli/test_promise.py')
mutant('one range for all fields', 'format/reader.c', 'info->fields[f].range[1] - info->fields[f].range[0] : 1;', 'info->fields[0].range[1] - info->fields[0].range[0] : 1;',
       'an absolute error is of every field in its own range', 'unit/test_choices')

# ---- verify

mutant('verify: no exact maximum', 'src/cli/against.c', 'if (!isnan(certified) && !honest(info, certified, now, TETLOD_MAX))', 'if (now > 1e9 && !isnan(certified))',
       'max is held against the overlay', ATTACK)
mutant('verify: samples are believed', 'src/cli/against.c', 'if (!honest(info, errors[TETLOD_SAMPLED + i], now[i], (enum tetlod_measure)(TETLOD_SAMPLED + i)))',
       'if (now[i] > 1e9)', 'sampled and rms are measured again', ATTACK)
mutant('verify: domain error is believed', 'src/cli/against.c', 'if (!honest(info, info->levels[k].domain_error, domain, TETLOD_MAX))', 'if (domain > 1e9)',
       'the domain error is measured again', ATTACK)
