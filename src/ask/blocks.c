/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/ask/blocks.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/hilbert.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* Tetrahedra near each other follow each other. */
static enum tetlod_status find_order(const double *positions, const uint32_t *corners, uint32_t tets, uint32_t *order,
                                     struct tetlod_error *error)
{
    double *middles = array_new(tets, 3 * sizeof *middles);
    if (!middles)
        return tetlodi_fail_nomem(error, "the blocks of a level", tets * (uint64_t)24);
    for (size_t t = 0; t < tets; t++)
        for (size_t i = 0; i < 3; i++) {
            const uint32_t *v = corners + 4 * t;
            middles[3 * t + i] = (positions[3 * (size_t)v[0] + i] + positions[3 * (size_t)v[1] + i] +
                                  positions[3 * (size_t)v[2] + i] + positions[3 * (size_t)v[3] + i]) / 4;
        }
    enum tetlod_status status = hilbert_order(middles, tets, order, error);
    free(middles);
    return status;
}

static void add_tet(struct ask_block *out, const double *const p[4], double *volume)
{
    *volume = fabs(tet_volume6(p[0], p[1], p[2], p[3])) / 6;
    out->volume += *volume;
    for (int c = 0; c < 4; c++)
        for (int i = 0; i < 3; i++) {
            out->box[i] = smaller(out->box[i], p[c][i]);
            out->box[i + 3] = larger(out->box[i + 3], p[c][i]);
        }
}

static void add_values(struct ask_block_values *out, const double *values, const uint32_t corners[4],
                       uint32_t components, double volume)
{
    for (uint32_t k = 0; k < components; k++)
        for (int c = 0; c < 4; c++) {
            double value = values[(size_t)components * corners[c] + k];
            out[k].least = smaller(out[k].least, value);
            out[k].most = larger(out[k].most, value);
            out[k].integral += volume * value / 4;
            out[k].absolute += volume * fabs(value) / 4;
        }
}

static void fill(struct blocked *out, const double *positions, uint32_t tets, const double *values,
                 uint32_t components)
{
    for (uint32_t b = 0; b < blocks_of(tets); b++) {
        struct ask_block_values *own = out->values + (size_t)components * b;
        out->own[b] = (struct ask_block){.box = {INFINITY, INFINITY, INFINITY, -INFINITY, -INFINITY, -INFINITY}};
        for (uint32_t k = 0; k < components; k++)
            own[k] = (struct ask_block_values){.least = INFINITY, .most = -INFINITY};
        for (uint32_t t = b * BLOCK_TETS; t < (b + 1) * BLOCK_TETS && t < tets; t++) {
            const uint32_t *v = out->corners + 4 * (size_t)t;
            const double *p[4];
            double volume;
            for (int c = 0; c < 4; c++)
                p[c] = positions + 3 * (size_t)v[c];
            add_tet(&out->own[b], p, &volume);
            add_values(own, values, v, components, volume);
        }
    }
}

enum tetlod_status blocked_make(struct blocked *out, const double *positions, const uint32_t *corners, uint32_t tets,
                                const double *values, uint32_t components, struct tetlod_error *error)
{
    uint32_t count = blocks_of(tets);
    components = values ? components : 0;
    *out = (struct blocked){.order = array_new(tets, sizeof(uint32_t)),
                            .corners = array_new(tets, 4 * sizeof(uint32_t)),
                            .own = array_new(count, sizeof(struct ask_block)),
                            .values = array_new(count, (components + 1) * sizeof(struct ask_block_values))};
    if (!out->order || !out->corners || !out->own || !out->values)
        return tetlodi_fail_nomem(error, "the blocks of a level", tets * (uint64_t)24);
    TETLOD_TRY(find_order(positions, corners, tets, out->order, error));
    for (size_t t = 0; t < tets; t++)
        memcpy(out->corners + 4 * t, corners + 4 * (size_t)out->order[t], 4 * sizeof *corners);
    fill(out, positions, tets, values, components);
    out->blocks = (struct ask_blocks){count, out->own, out->values};
    return TETLOD_OK;
}

void blocked_fini(struct blocked *blocked)
{
    free(blocked->order);
    free(blocked->corners);
    free(blocked->own);
    free(blocked->values);
    *blocked = (struct blocked){0};
}
