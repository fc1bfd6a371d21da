/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/base.h"

#include <math.h>

#include "format/fail.h"

/* Corners are counted back from the next vertex that has not been seen: 0 is that one. */
static enum tetlod_status code_corners(struct tetlodi_codec *codec, uint32_t vertices, uint32_t tets,
                                       struct tetlod_error *error)
{
    struct tetlodi_coder *coder = &codec->geometry;
    uint32_t *corners = codec->state->corners, next = 0;
    for (uint32_t t = 0; t < tets; t++, corners += 4)
        for (int c = 0; c < 4; c++) {
            uint64_t back = tetlodi_code_number(coder, &codec->geometry_model.exception_vertex,
                                                coder->encodes ? next - corners[c] : 0);
            bool valid = back <= next && (back || next < vertices) && !coder->in.failed;
            for (int d = 0; d < c && valid; d++)
                valid = corners[d] != next - (uint32_t)back;
            if (!valid)
                return tetlodi_fail(error, TETLOD_ERR_STREAM, "tetrahedron %u of the base mesh is none", t);
            corners[c] = next - (uint32_t)back;
            next += back == 0;
        }
    return TETLOD_OK;
}

enum tetlod_status tetlodi_base_code(struct tetlodi_codec *codec, uint32_t vertices, uint32_t tets,
                                     struct tetlod_error *error)
{
    struct tetlodi_state *state = codec->state;
    bool finite = true;
    TETLOD_TRY(code_corners(codec, vertices, tets, error));
    for (size_t i = 0; i < 3 * (size_t)vertices; i++) {
        double *x = &state->positions[i];
        *x = tetlodi_code_float(&codec->geometry, &codec->geometry_model.position[POSITION_CONTEXTS - 1], *x,
                                i < 3 ? 0 : x[-3], codec->wide_positions);
        finite &= isfinite(*x) != 0;
    }
    bool failed = codec->geometry.in.failed;
    for (uint32_t f = 0; f < state->field_count; f++) {
        size_t width = state->components[f];
        for (size_t i = 0; i < width * vertices; i++) {
            double *s = &state->fields[f][i];
            *s = tetlodi_code_float(&codec->fields[f], &codec->field_models[f].residual[1], *s,
                                    i < width ? 0 : *(s - width), codec->wide_fields[f]);
            finite &= isfinite(*s) != 0;
        }
        failed |= width && codec->fields[f].in.failed;
    }
    if (failed || !finite)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "the base mesh is damaged");
    return TETLOD_OK;
}
