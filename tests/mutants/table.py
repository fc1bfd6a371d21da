# SPDX-License-Identifier: BSD-3-Clause
"""Lines that the promise hangs on: each is taken out in turn, and a test must go red (run_mutants.py).

`old` is text that is once in the file; `why` says what the line is for. Where several lines ask the same, each alone
may go without harm:
`more` are the others, (file, old, new), and all go at once.
"""

MUTANTS = []


def mutant(name, file, old, new, why, *killers, more=()):
    MUTANTS.append({'name': name, 'edits': ((file, old, new), *more), 'why': why, 'killers': killers})


PROOF = 'proof 1 300'  # the certificate itself, in one process
ATTACK = 'attack 1 60'  # the program, its streams, and verify
REGIONS = 'attack 3000001 60'  # levels that are finer in boxes

# ---- the envelope (PROOF.md, 2 to 4), in rounds

mutant('star without a tetrahedron', 'src/simplify/mesh/kernels.c',
       'rounding = wide_all(32 * DBL_EPSILON);\n    for (uint32_t i = 0; i < weighing->count; i++) {',
       'rounding = wide_all(32 * DBL_EPSILON);\n    for (uint32_t i = 1; i < weighing->count; i++) {',
       'all tetrahedra of the star are continued to the new vertex', PROOF)
mutant('rounding slack', 'src/simplify/mesh/kernels.c', 'wide slack = wide_mul(rounding, size);',
       'wide slack = wide_mul(wide_sub(rounding, rounding), size);', 'an upper value is widened by its rounding',
       'unit/test_rounds')
mutant('upper is the value', 'src/simplify/rounds/merge.c', 'row[ROW_FIELDS + 2 * c] = upper[c];',
       'row[ROW_FIELDS + 2 * c] = (upper[c] + lower[c]) / 2;', 'errors accumulate', PROOF)
mutant('one side of the error', 'src/simplify/rounds/outcome.c',
       'worst = larger(worst, larger(upper[c] - value, value - lower[c]) * component->factor);',
       'worst = larger(worst, (upper[c] - value) * component->factor);', 'the error counts both ways', PROOF)
mutant('certified is one side', 'src/simplify/rounds/merge.c',
       'answer->errors[c] : larger(upper[c] - values[c], values[c] - lower[c]);',
       'answer->errors[c] : upper[c] - values[c];', 'what is stored counts both ways', PROOF)
mutant('mean beyond the error', 'src/simplify/rounds/merge.c',
       'double value = field_round(field, component, smaller(larger(mean, middle - most), middle + most));\n    '
       'return value >= least && value <= greatest ? value : middle;',
       'return field_round(field, component, most >= 0 ? mean : middle);',
       'a better value keeps to the error that is stated', PROOF)
mutant('values are not rounded', 'src/simplify/rounds/outcome.c',
       'double value =\n            field_round(&run->working->fields[component->field], component->component, '
       '(upper[c] + lower[c]) / 2);', 'double value = (upper[c] + lower[c]) / 2;',
       'the error is that of the value as stored', PROOF)
mutant('flips', 'src/simplify/mesh/kernels.c', 'fits &= !(small >> j & 1 && weighing->moves[i + j]);',
       'fits &= !(small >> j & 1 && weighing->moves[i + j] > 1);', 'C1: no tetrahedron flips or degenerates', PROOF,
       more=(('src/simplify/rounds/evaluate.c', 'working_row(working, data->slots[c])) <= 0)', 'working_row(working, data->slots[c])) < -1)'),
             ('src/simplify/rounds/evaluate.c', '!answer.half_turned, answer.followed', 'true, answer.followed'),
             ('src/simplify/rounds/evaluate.c', 'answer.turned <= data->shared[n], answer.followed', 'true, answer.followed')))
mutant('link condition', 'src/simplify/rounds/evaluate.c',
       'if (!links_hold(&worker->links, data, working, candidate->neighbour, &room)) {',
       'if (!links_hold(&worker->links, data, working, candidate->neighbour, &room) && !room) {', 'C4 is asked',
       'unit/test_links')
mutant('link triangles', 'src/simplify/mesh/links.c', 'if (of_ring > 1 && !has_a', 'if (of_ring > 4 && !has_a',
       'C4: a common edge or triangle', 'unit/test_links')
mutant('link vertices', 'src/simplify/mesh/links.c', 'if (!met)\n            return false;', '',
       'C4: a common vertex', 'unit/test_links')
mutant('link condition across the inside', 'src/simplify/mesh/links.c',
       'if (open && !data->along[neighbour])\n        return false;', '',
       'an edge through the inside with both ends on the boundary', 'unit/test_links')
mutant("link condition's boundary", 'src/simplify/mesh/links.c',
       'if (faces >> corner_of(corners, slot_a) & 1 && faces >> corner_of(corners, slot_b) & 1)\n            return '
       'false;', '', 'a tetrahedron with boundary faces at both ends', 'unit/test_links')

# ---- local bounds (2)

mutant('local bound of one side', 'src/simplify/rounds/merge.c', 'bounds[record] = worst;',
       'bounds[record] = upper[c] - values[c];', 'a local bound counts both ways', PROOF)
mutant('local bound stays behind', 'src/simplify/rounds/rounds.c',
       'log->components[c].bounds[to] = log->components[c].bounds[from];', ';',
       'a record that closes a gap takes its bounds along', 'cli/test_local_bound')
mutant('local bound is rounded down', 'src/pipeline/local_bound.c',
       'larger(ceil((bound - grid->origin) / grid->step * (1 - TIE)), 0)',
       'larger(floor((bound - grid->origin) / grid->step), 0)', 'what is stored is no less than the bound',
       'cli/test_local_bound')
mutant('local bound without rounding', 'src/pipeline/local_bound.c', 'origin = ceil(rounding / step) * step;',
       'origin = 0;', "the original's vertices are off by their rounding", 'cli/test_local_bound')
mutant('local bound above max', 'src/pipeline/local_bound.c',
       '*certified = larger(*certified, most * log->components[c].scale * (1 - TIE / 2));', '(void)certified;',
       'max is the largest of the bounds that are stored', 'cli/test_local_bound')
mutant('verify believes local bounds', 'src/cli/against.c',
       'if (status == TETLOD_OK && larger(found[0], found[1]) > floor)',
       'if (status == TETLOD_OK && larger(found[0], found[1]) > 2 * floor)',
       'a local bound that is too small is refused', ATTACK)

# ---- the transition of a region (2)

mutant('local bound of a transition as it is', 'src/measure/region_error.c', 'if (lack[v] > 0)\n',
       'if (lack[v] > INFINITY)\n',
       'where vertices of several levels meet, a local bound is raised', REGIONS)
mutant('local bound of a transition from below', 'src/measure/region_error.c', 'out[count + i] = s->values[i] - by;',
       'out[count + i] = s->values[i] + by;', 'it is raised for what is below and above the original',
       'cli/test_region.py')
mutant('transition beside another body', 'src/measure/region_error.c',
       '.threads = m->threads, .bodies = {far.bodies, t->bodies}, .wanted', '.threads = m->threads, .wanted',
       'each body is compared with itself', 'cli/test_region.py')

# ---- steps in time (10)

mutant('L and U are cut to the range', 'src/pipeline/encode_series.c',
       'series->component_count + row->first + component, out);\n',
       'series->component_count + row->first + component, out);\n    out[0] = larger(out[0], range[0]);\n    out[1] = '
       'smaller(out[1], range[1]);\n', 'between the vertices U that is cut at one of them does not hold the original',
       'cli/test_series')

mutant('moved points are not rounded', 'src/pipeline/encode_series.c',
       'worst += series_rounding(series, row->control, row->band);', 'worst += 0;',
       'a point that moves is rounded twice', 'cli/test_series.py')
mutant('no room for moved points to be rounded', 'src/pipeline/build_series.c',
       'return series_is_displacement(series, control) &&\n           units_in_last_place',
       'return series->input->bands[band] <= 0 && units_in_last_place',
       'a band that is narrower than rounding is bit for bit', 'cli/test_series.py')
mutant('a step says more than its own range', 'src/pipeline/encode_series.c',
       'fminf(error, most_said(series, step, row->control, row->band))', 'error',
       "with --range step no error is above the band's in the step's own range", 'cli/test_series.py')

# ---- the boundary (5)

mutant('no demands of the map, above', 'src/simplify/rounds/outcome.c',
       'upper[c] = larger(upper[c], boundary_map_least(&worker->map, values, working->stride, 0));', '',
       'what the boundary map demands of the upper value', 'unit/test_rounds')
mutant('no demands of the map, below', 'src/simplify/rounds/outcome.c',
       'lower[c] = smaller(lower[c], boundary_map_greatest(&worker->map, values + 1, working->stride));', '',
       'what the boundary map demands of the lower value', 'unit/test_rounds')
mutant('no crossings', 'src/simplify/mesh/boundary_map.c',
       'return graphs(map, cosine) && map_vertices(map) && map_crossings(map);',
       'return graphs(map, cosine) && map_vertices(map);', 'edges of the old and the new patch cross',
       'unit/test_boundary_map')
mutant('no result in the old patch', 'src/simplify/mesh/boundary_map.c', 'return !result || map_result(map);',
       'return true;', 'the result between the ends', 'unit/test_boundary_map')
mutant('distance is not counted', 'src/simplify/mesh/boundary_map.c',
       'double all = larger(boundary_map_least(map, moved, stride, 1), 0), rim = 0;',
       'double all = larger(boundary_map_least(map, moved, stride, 0), 0), rim = 0;', 'how far the boundary moved',
       PROOF)
mutant('distance does not add up', 'src/simplify/rounds/merge.c', 'row[row_moved(working)] = moved;',
       'row[row_moved(working)] = 0;', 'how far the boundary moved in all', PROOF)

# ---- frozen vertices (6)

mutant('inverted are not frozen', 'src/simplify/rounds/evaluate.c', 'if (working->flags[slot] & VERTEX_FROZEN)\n',
       'if (working->flags[slot] & 0)\n', 'no star that moves has a degenerate or inverted tetrahedron', PROOF)
mutant('folds are not frozen', 'src/simplify/mesh/border.c', 'working->flags[working->corners[t][c]] |= VERTEX_FROZEN;',
       '(void)c;', 'no star that moves has a folded tetrahedron', PROOF)

# ---- faces and tetrahedra

mutant('simplices: flips', 'src/simplify/mesh/star.c', 'if (tet_orientation(q[0], q[1], q[2], q[3]) <= 0)',
       'if (tet_orientation(q[0], q[1], q[2], q[3]) > 2)', 'C1', 'unit/test_working')
mutant('simplices: link triangles', 'src/simplify/mesh/links.c',
       'return !(count == 3 && mask == IN_B && table_find(&links->pairs, triangle_key(v)));', 'return true;',
       'C4: a common triangle', 'unit/test_links')
mutant("simplices: link condition's boundary", 'src/simplify/mesh/links.c',
       'if (working->boundary_faces[star->tets[i]] >> f & 1) {', 'if (f > 3) {', 'C4: the boundary is coned',
       'unit/test_links')
mutant('simplices: faces behind those that vanish', 'src/simplify/mesh/working.c', 'opened &= count > 2;',
       'opened = false;',
       'a face behind several tetrahedra that vanish is on the boundary', 'unit/test_working')
mutant('simplices: a vertex is forgotten', 'src/simplify/rounds/outcome.c',
       'for (uint32_t s = 0; s < join->count && room; s++)\n        list_star(',
       'for (uint32_t s = 0; s < 2 && room; s++)\n        list_star(', 'the star is of all vertices of the simplex',
       'unit/test_outcome', PROOF)

# ---- new numbers without gaps

mutant('numbers: boundary faces keep theirs', 'src/simplify/mesh/working.c',
       'working->boundary_faces = renumber_tets(out, working->boundary_faces, 1);', '',
       'what belongs to a tetrahedron moves with it', 'unit/test_working')
mutant('numbers: stars keep theirs', 'src/simplify/mesh/working.c', 'star[i] = numbers->tets[star[i]];',
       '(void)star[i];', 'the same', 'unit/test_working')
mutant('numbers: points that refused keep theirs', 'src/simplify/exact/overlaps.c',
       'overlaps->sentinels = renumber_tets(numbers, overlaps->sentinels, sizeof *overlaps->sentinels);', '',
       'the same', 'unit/test_overlaps')
mutant('numbers: lists of originals keep theirs', 'src/simplify/exact/overlaps.c',
       'overlaps->lists = renumber_tets(numbers, overlaps->lists, sizeof *overlaps->lists);', '', 'the same',
       'unit/test_overlaps')
mutant('numbers: hosts keep theirs', 'src/simplify/exact/overlaps.c',
       'overlaps->host[v] = numbers->tets[overlaps->host[v]];', '(void)numbers;', 'the same', 'unit/test_exact')

# ---- the exact limit (8)

mutant('exact: no original vertices', 'src/simplify/exact/examiner.c', 'if (!at_vertex(e, v))',
       'if (v > UINT32_MAX - 1 && !at_vertex(e, v))', 'critical points of kind 1', 'unit/test_exact')
mutant('exact: no walls', 'src/simplify/exact/examiner.c', 'return at_edges(e) && goes_on(e) && at_spokes(e);',
       'return (1 || at_edges(e)) && goes_on(e) && at_spokes(e);', 'critical points of kind 2', 'unit/test_exact')
mutant('exact: an edge crosses one wall at most', 'src/simplify/exact/examiner.c',
       'if (w == ARRIVED)\n            return true;', 'if (w == ARRIVED || steps)\n            return true;',
       'an edge is followed to its end', 'unit/test_exact')
mutant('exact: an edge ends where it begins', 'src/simplify/exact/examiner.c',
       'if (f != TETLOD_NONE && cover->homes[edge[1]] == f)', 'if (f != TETLOD_NONE)', 'the same', 'unit/test_exact')
mutant('exact: an edge is told by one end', 'src/simplify/exact/cover.c',
       'if (edge[0] == least && edge[1] == greatest)', 'if (edge[1] == greatest)', 'all edges are asked',
       'unit/test_exact')
mutant('exact: slots keep their numbers', 'src/simplify/exact/cover.c',
       'cover->slot_numbers[cover->link[l]] = TETLOD_NONE;', '(void)cover->slot_numbers[cover->link[l]];',
       "the next star's link has numbers of its own", 'unit/test_exact')
mutant('exact: the oldest point stays', 'src/simplify/exact/overlaps.c',
       'uint32_t last = same < count ? same : count - 1;', 'uint32_t last = same < count ? same : 0;',
       'the last two points that refused are kept', 'unit/test_overlaps')
mutant('exact: no spokes', 'src/simplify/exact/examiner.c', 'return at_edges(e) && goes_on(e) && at_spokes(e);',
       'return at_edges(e) && goes_on(e) && (1 || at_spokes(e));', 'critical points of kind 3', 'unit/test_exact')
mutant('exact: not the new vertex', 'src/simplify/exact/examiner.c', 'if (!is_original(e) && !at_apex(e))',
       'if (0 && !is_original(e) && !at_apex(e))', 'critical points of kind 4', 'unit/test_exact')
mutant('exact: originals are lost', 'src/simplify/exact/cover.c', 'if (!pair_original(cover, working, t))',
       'if (t % 8 != 7 && !pair_original(cover, working, t))', 'a cone lists all originals that overlap it',
       'unit/test_exact')
mutant('exact: planes turned outwards', 'src/simplify/exact/cover.c', 'bool turned = !(dot(plane->normal, r) > 0);',
       'bool turned = dot(plane->normal, r) > 0;', 'the same', 'unit/test_exact')
mutant('exact: walls of the wrong side', 'src/simplify/exact/cover.c', 'cover->masks[(2 * f + !positive) * words',
       'cover->masks[(2 * f + positive) * words', 'the same', 'unit/test_exact')
mutant('exact: a refusal is forgotten', 'src/simplify/rounds/simplices.c', 'known->bound = nextafterf(',
       'known->bound = 0 * nextafterf(', 'what was refused is not asked again', 'unit/test_asked_once')
mutant('exact: what the bounds say is stored', 'src/simplify/rounds/merge.c',
       'answer && run->asked->certifies ? answer->errors[c]', 'answer && run->asked->certifies ? 0 * answer->errors[c]',
       'what is stored is what the limit has answered', PROOF)
mutant('exact: originals stay marked', 'src/simplify/exact/cover.c', 'cover->listed[cover->tets[t] / 64] = 0;', '',
       'the next star has all of its originals', 'unit/test_exact')
mutant('exact: the star stays marked', 'src/simplify/exact/cover.c', 'cover->covered[star->tets[i] / 64] = 0;',
       '(void)star;', 'vertices in the next star are its own', 'unit/test_exact')
mutant('exact: distances of another order', 'src/simplify/exact/cover.h',
       'return n[0] * r[0] + n[cover->stride] * r[1] + n[2 * (size_t)cover->stride] * r[2];',
       'return n[0] * r[0] + (n[cover->stride] * r[1] + n[2 * (size_t)cover->stride] * r[2]);',
       'all decisions are taken from the same numbers', 'unit/test_exact')

# ---- differences of two results (14)

DIFF = 'cli/test_diff.py'
mutant('diff: no bound above', 'src/diff/overlap.c',
       'larger(cell->upper, fabs(d) + worker->errors[v]);',
       'larger(cell->upper, fabs(d));',
       'what the levels are off widens the upper end', DIFF)
mutant('diff: no bound below', 'src/diff/overlap.c',
       '- (own + t * (error - own));',
       ';',
       'and the lower one', DIFF)
mutant('diff: a square without its bound', 'src/diff/overlap.c',
       'high = own + by;',
       'high = own;',
       'the same of the mean square', DIFF)
mutant('diff: a square with all of it', 'src/diff/overlap.c',
       'low = larger(own - by, 0)',
       'low = own',
       'the same from below', DIFF)
mutant('diff: slivers count', 'src/diff/overlap.c',
       'if (volume < SLIVER *',
       'if (volume < 0 *',
       'rounding puts one sheet over another', DIFF)
mutant('diff: all bodies', 'src/diff/bodies.c',
       'return found && found->kept;',
       'return found;',
       'each body is compared with itself', DIFF)
mutant('diff: half a search', 'src/diff/difference.c',
       'cell->volumes[0] * (1 - COVERED)',
       'cell->volumes[0] * 0',
       'all that overlap are found', DIFF)
mutant('diff: moved boundaries decide', 'src/diff/difference.c',
       'out->max[1] = larger(out->inner, out->shell);',
       'out->max[1] = out->inner;',
       'places that a boundary has left are compared apart', DIFF)
mutant('diff: nothing has moved', 'src/diff/moved_boundary.c',
       '<= boundary->moved * boundary->moved)',
       '< 0)',
       'places that the original has not do not show a difference', DIFF)
mutant('diff: partners are one place', 'src/diff/boundary_shell.c',
       'comparing.reach = sides[0].boundary->moved + sides[1].boundary->moved;',
       'comparing.reach = 0;',
       'partners are apart', DIFF)
mutant('diff: only what is deep is left open', 'src/diff/open_parts.c',
       'found->cells[t].upper > limit)',
       'found->cells[t].upper > 2 * limit)',
       'what coarse levels leave open is compared again', DIFF)
mutant('diff: moved boundaries are left out', 'src/diff/open_parts.c',
       'm < 2 && found->shell > limit;',
       'm < 0;',
       'and what is near a boundary that has moved', DIFF)
mutant('diff: pairs without their bounds', 'src/diff/overlap.c',
       'largest + larger(clip_value(cell->errors, corners[v]), 0));',
       'largest);',
       'a pair is within the limit with its bounds', DIFF)
mutant('diff: the first stage is all', 'src/diff/difference.c',
       'measuring->stage == ASKED_FIRST && lower > measuring->open->limit',
       'measuring->stage == ASKED_FIRST',
       'the rest is compared if the first stage has not decided', DIFF)
mutant('diff: a mesh that ends', 'src/diff/difference.c',
       'if (across == TETLOD_NONE || !measuring->usable[1][across / 4])',
       'if (!measuring->usable[1][across / 4])',
       'beyond a boundary there may be others', DIFF)

# ---- the overlay, which checks it: what rules pairs out (8)

mutant('overlay: half of a box', 'src/measure/weights_map.h',
       'most[k] += reach->rows[i][k] * middle + reach->sizes[i][k] * half;', 'most[k] += reach->rows[i][k] * middle;',
       'a box reaches as far as its farthest corner', 'unit/test_overlay')
mutant('overlay: a box behind a face', 'src/measure/weights_map.h', 'behind |= most[k] <= THIN - noise;',
       'behind |= most[k] <= THIN;', 'a box is behind a face if rounding cannot have put it there', 'unit/test_overlay')
mutant('overlay: corners behind a face', 'src/measure/weights_map.h', 'if (!(most > THIN - map->noise * largest))',
       'if (!(most > THIN))', 'the same of corners', 'unit/test_overlay')
mutant('overlay: a vertex behind a face', 'src/measure/overlay.c', 'THIN - weights_in(reach, clusters',
       'THIN - 0 * weights_in(reach, clusters', 'the same of the vertices of a cluster', 'unit/test_overlay')
mutant('overlay: a vertex of another number', 'src/measure/clusters.c', 'clusters->corners[i][c] = (uint8_t)k;',
       'clusters->corners[i][c] = (uint8_t)(k & 7);', "a tetrahedron's corners are its own", 'unit/test_overlay')
mutant('overlay: no crossings of a face', 'src/measure/overlay.c', 'if ((from < 0) != (to < 0) &&',
       'if (from < 0 && to > INFINITY &&', 'the part before a face has corners of its own', 'unit/test_overlay')
mutant('overlay: no room before a face', 'src/measure/overlay.c',
       'exceeds_before(in[m], k, at, 2 * cell->slack, enough)', 'exceeds_before(in[m], k, at, 0, enough)',
       'a corner is before a face as far as rounding can tell', 'unit/test_overlay')
mutant('overlay: no slack of a bound', 'src/measure/overlay.c',
       'double enough = worker->most[compared->field] - 8 * size * cell->slack;',
       'double enough = worker->most[compared->field] + 0 * size;', 'a bound is widened by its rounding',
       'unit/test_overlay')
mutant('overlay: no slack of the ends', 'src/measure/overlay.c', 'return most + 8 * size * cell->slack;',
       'return most + 0 * size;', 'what is left to 113 bits is what doubles cannot rule out', 'unit/test_overlay')
mutant('overlay: clipped as rounding has it', 'src/measure/overlay.c', 'double room = 2 * cell->slack;',
       'double room = 0;', 'the ends lie between those of what rounding allows', 'unit/test_overlay')
mutant('overlay: corners of the wrong mesh', 'src/measure/overlay.c', 'if (m != overlay->finer && !both)',
       'if (m == overlay->finer && !both)', 'before both are weighed only those of the finer mesh are known',
       'unit/test_overlay')
mutant('overlay: a finest level that moved', 'src/measure/overlay_levels.c',
       '!memcmp(finest->positions, original->positions, 3 * vertices * sizeof(double)) &&', '',
       'only what is the original is not compared with it', 'unit/test_overlay')
mutant('overlay: a finest level of other tetrahedra', 'src/measure/overlay_levels.c',
       '!memcmp(finest->corners, original->corners, 4 * finest->stored * sizeof(uint32_t))', 'true', 'the same',
       'unit/test_overlay')
mutant('overlay: a finest level of other values', 'src/measure/overlay_levels.c',
       'for (uint32_t f = 0; f < original->field_count && same; f++)',
       'for (uint32_t f = original->field_count; f < original->field_count && same; f++)', 'the same',
       'unit/test_overlay')

# ---- pieces (PROOF.md, 11)

mutant('piece: seams are contracted', 'src/simplify/piece.c', '(piece->frozen[v] ? VERTEX_SINGULAR : 0)', '0',
       'a star must be in the piece as a whole', 'unit/test_piece')
mutant('piece: U and L begin anew', 'src/simplify/piece.c',
       'memcpy(row + ROW_FIELDS, piece->bounds + 2 * (size_t)v * k, 2 * k * sizeof *row);', '',
       'errors accumulate from piece to piece', 'unit/test_piece')
mutant('piece: seams are boundary', 'src/simplify/piece.c',
       'working->boundary_faces[t] = whole->ranges.turned ? turn_faces(faces) : faces;', '(void)faces;',
       'only faces of the whole boundary are on it', 'unit/test_piece')

# ---- what is stored

mutant('max below sampled', 'src/pipeline/level_errors.c',
       'errors[TETLOD_MAX] = larger(errors[TETLOD_MAX], errors[TETLOD_SAMPLED]);', '',
       'max is never below what was measured', ATTACK)
mutant('finer levels may be worse', 'src/pipeline/level_errors.c',
       'errors[m] = isnan(errors[m]) || !than ? errors[m] : larger(errors[m], than[m]);',
       'errors[m] = than && than[m] < 0 ? 0 : errors[m];', 'a level promises for all finer ones', ATTACK)
mutant('domain error without rounding', 'src/pipeline/level_errors.c',
       'build->domains[mark] = at->moved + build->rounded_by;', 'build->domains[mark] = at->moved;',
       'rounding moves the boundary, too', 'attack 130 1', 'attack 313 1', 'attack 381 1')
mutant('no exact maximum', 'src/pipeline/level_errors.c',
       'errors[TETLOD_MAX] = fmax(errors[TETLOD_MAX], larger(exact, errors[TETLOD_SAMPLED]));', '(void)exact;',
       'where max is proved for a partner it is no less than the exact maximum', 'attack 1210 1', 'attack 1424 1')
mutant('rounding is outside the limit', 'src/pipeline/limits.c', '*limit -= lost;', '',
       'a limit holds with what rounding takes', 'cli/test_promise.py')
mutant('a vector without its share', 'src/pipeline/control.c',
       'return (own > 0 && whole > 0 ? smaller(own / whole, 1) : 1) / sqrt(mesh->fields[vector].components);',
       '(void)own;\n    (void)whole;\n    return 1;', "a magnitude's promise holds for the vector",
       'cli/test_promise.py')
mutant('one range for all fields', 'format/read/reader.c', 'info->fields[f].range[1] - info->fields[f].range[0] : 1;',
       'info->fields[0].range[1] - info->fields[0].range[0] : 1;',
       'an absolute error is of every field in its own range', 'unit/test_choices')

# ---- verify

mutant('verify: no exact maximum', 'src/cli/against.c', 'if (a->exact[f] > a->floors[f])', 'if (a->exact[f] < 0)',
       'max is held against the overlay', ATTACK)
mutant('what rounding positions changes has no exact maximum', 'src/pipeline/quantise.c',
       'overlay_levels_next(overlay, &finest, INFINITY, io_most, error)', 'TETLOD_OK',
       'max has what rounded positions change, at the tail too', ATTACK)
mutant('overlay: of the level nothing is near the boundary', 'src/measure/overlay_levels.c',
       'levels->wanted[t] && is_within(&surface, level, t, reach)', 'false',
       'what is unproved near the boundary is looked at', 'unit/test_overlay')
mutant('overlay: of the original nothing is near the boundary', 'src/measure/overlay_levels.c',
       'find_near(levels, 2 * reach)', 'find_near(levels, 0 * reach)', 'the same', 'unit/test_overlay')
mutant('overlay: clusters that are asked about are passed over', 'src/measure/overlay.c',
       'overlay->asked[i / CLUSTER_TETS] |= looked_at', 'overlay->asked[i / CLUSTER_TETS] &= looked_at',
       'a cluster counts if any of it does', 'unit/test_overlay')
mutant('overlay: all is one body', 'src/measure/overlay.c',
       'return overlay->one_body || bodies', 'return true || bodies',
       'each body is compared with itself', 'unit/test_overlay')
mutant('verify: samples are believed', 'src/cli/against.c', 'if (stored >= low * (1 - TOO_SMALL) - NOISE && stored',
       'if (stored >= 0 && stored', 'sampled and rms are measured again', ATTACK)
mutant('verify: domain error is believed', 'src/cli/against.c',
       'if (found > 0)\n        return tetlodi_fail(a->error, TETLOD_ERR_MISMATCH,\n'
       '                            "level %u: its domain',
       'if (found > 1e300)\n        return tetlodi_fail(a->error, TETLOD_ERR_MISMATCH,\n'
       '                            "level %u: its domain',
       'the domain error is measured again', ATTACK)
mutant('verify: errors may be too large', 'src/cli/against.c', 'stored <= high * (1 + TOO_LARGE) + NOISE)',
       'stored <= 1e300)', 'what is measured is wrong in both directions', ATTACK)
mutant('verify: rounded streams are believed', 'src/cli/against.c', 'status = mesh_same(&rounded, &finest, a->error);',
       '(void)finest;', 'the finest level is the input, rounded', 'cli/test_cells')
mutant('verify: bands of steps are believed in place', 'src/cli/against_steps.c',
       'if (found[i] > floors[i])\n            status = too_large(check, b, batch->first + i / check->field_count, i '
       '% check->field_count,\n                               "the difference',
       'if (found[i] < 0)\n            status = too_large(check, b, batch->first + i / check->field_count, i % '
       'check->field_count,\n                               "the difference',
       'tetrahedra that are as they were are compared at their corners', 'cli/test_forged')

# ---- features (PROOF.md, 13)

FEATURES, FEATURE_SOURCE = 'cli/test_features', 'src/ask/features.c'
PROVEN_SWEEP = 'sweep(search, &proven, search->upper, search->lower, error);'
mutant('features: heights without the bound', FEATURE_SOURCE, PROVEN_SWEEP,
       'sweep(search, &proven, search->upper, search->middle, error);',
       'a certain maximum counts with what it has at least', FEATURES)
mutant('features: saddles without the bound', FEATURE_SOURCE, PROVEN_SWEEP,
       'sweep(search, &proven, search->middle, search->lower, error);', 'a saddle may be as high as its bound',
       FEATURES)
mutant('features: an upper end everywhere', FEATURE_SOURCE,
       'bounded = !exceeds(search->upper[v], search->lower[v], search->query->persistence);', 'bounded = true;',
       'between functions that are far apart any number of maxima fits', FEATURES)
mutant('features: the upper end of the level', FEATURE_SOURCE,
       'bounded ? sweep(search, &all, search->lower, search->upper, error)',
       'bounded ? sweep(search, &all, search->middle, search->middle, error)',
       'the original may have more than the level', FEATURES)
mutant('features: the box of the persistence alone', FEATURE_SOURCE,
       'return search->has_floor || level < bar->death ? bar->death : level;',
       'return search->has_floor ? bar->death : nextafter(bar->peak, -INFINITY);',
       'the maximum of that persistence is in a larger component', FEATURES)
mutant('features: moved boundaries', 'src/ask/feature_levels.c',
       '!(info->levels[level].domain_error <= KEPT) || ', '', 'where the boundary moved nothing is proved', FEATURES)

BOX_SUMS, BOX_SOURCE = 'cli/test_box_sums', 'src/ask/box_answer.c'
mutant('boxes: parts of volumes as they are', BOX_SOURCE, 'half = 0.5 + 1e-6;', 'half = 0;',
       'the part of a volume is rounded', BOX_SUMS)
mutant('boxes: what sticks out is not there', BOX_SOURCE,
       '.open = inside ? volume[1] - volume[0] : volume[1]', '.open = 0', 'any part of a box may be in the question\'s',
       BOX_SUMS)
mutant('boxes: extremes of what sticks out', BOX_SOURCE, 'if (parts->list[i].inside)\n            out.lower',
       'if (true)\n            out.lower', 'the greatest value of a box may be in its part outside', BOX_SUMS)
mutant('boxes: bounds rounded inwards', 'src/pipeline/make_box_sums.c', 'BOX_PARTS) < value + slack)\n        part++;',
       'BOX_PARTS) < value - 0.02 * (range[1] - range[0]))\n        part++;',
       'bounds are outside of the values', BOX_SUMS)

# ---- pages (PROOF.md, 11 and 15)

mutant('a tetrahedron leaves its cell', 'src/simplify/rounds/merge.c',
       'if (weighing->moves[i] && !tetlodi_in_box(run->box, middle))',
       'if (weighing->moves[i] > 1 && !tetlodi_in_box(run->box, middle))',
       'a decoder finds the cells of a mesh that was cut before it was contracted', 'cli/test_pages')
mutant('seams are contracted', 'src/simplify/piece.c', 'out->frozen[v] |= shared[vertices[v]];',
       'out->frozen[v] |= shared[vertices[v]] > 1;',
       'a cell has not the whole star of a vertex at its seam', 'cli/test_pages')
mutant('errors of one cell', 'src/cells/cell_phases.c',
       'state->certified[c] = fmax(state->certified[c], log->certified[last * k + c]);',
       'state->certified[c] = fmin(1e-6, log->certified[last * k + c]);', 'a level has the errors of all cells',
       'cli/test_pages')
mutant('a set that is not closed', 'format/read/page_set.c',
       'set->has[group[-1].first_page + table->needed[table->pages[p].needed_begin + i]] = 1;', ';',
       'lemma 3: with a page all that it needs is there', 'unit/test_page_set')
mutant('left out and in a finer one', 'format/read/page_parts.c',
       'if (level->number == first_level ? last !=', 'if (level->number == 0 ? last !=',
       'tetrahedra of a page that is left out are in no finer page', 'unit/test_page_set')
mutant('the page before', 'format/read/page_choice.c', 'tetlodi_page_finder(is_first ? NULL : group[-1].tree)',
       'tetlodi_page_finder(is_first ? NULL : group->tree)', 'a tetrahedron of a page that goes is of the one before',
       'unit/test_page_set')
mutant('levels before one that is damaged', 'format/read/cursor.c',
       'if (status != TETLOD_OK && levels.count > 1) {', 'if (false) {',
       'of levels that are decoded together those before a damaged one are whole', 'unit/test_page_set')
mutant('who split may split again', 'format/read/page_choice.c',
       'replay->stars[split->vertex].leaf = 0; // it splits', ';',
       'what is known of vertices by a page goes with it', 'unit/test_page_set')
mutant('seams with what is left out', 'format/coding/page_part.c',
       'page = page == TETLOD_NONE ? PAGE_SEAM : page;', 'if (page == TETLOD_NONE) continue;',
       'a vertex of a page that is left out does not split', 'unit/test_page_set')
mutant('the level of what is left out', 'format/read/page_set.c',
       'out[t] = some && level < cursor->level ? level : cursor->level;',
       'out[t] = some && level < cursor->level ? level + 1 : cursor->level;',
       'where a page is left out the level before it is certified', 'unit/test_page_set')
mutant('pages beside a box', 'format/read/page_set.c', 'to < low[axis] ? low[axis] - to : 0;',
       'to < high[axis] ? low[axis] - to : 0;', 'all pages that meet a box are there', 'unit/test_page_set')
