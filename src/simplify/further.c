/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/further.h"

#include <string.h>

#include "format/fail.h"
#include "src/simplify/rounds/rounds.h"

enum tetlod_status simplify_further(uint32_t *out_tets, const struct further *further, const uint32_t *controlled,
                                    uint32_t count, const struct simplify_options *options, struct tetlod_error *error)
{
    struct piece piece;
    struct piece_whole whole;
    struct contraction_log log = {0};
    TETLOD_TRY(piece_of_mesh(&piece, &whole, further->level, controlled, count, NULL, options, error));
    memcpy(whole.ranges.field_ranges, further->ranges, count * sizeof *further->ranges);
    for (size_t i = 0; i < (size_t)piece.mesh.vertex_count * whole.component_count; i++) {
        piece.bounds[2 * i] += further->bounds[i];
        piece.bounds[2 * i + 1] -= further->bounds[i];
    }
    enum tetlod_status status = rounds_contract(&log, &piece, further->from, options, error);
    *out_tets = piece.mesh.tet_count;
    log_fini(&log);
    piece_fini(&piece);
    piece_whole_fini(&whole);
    return status;
}
