/* SPDX-License-Identifier: BSD-3-Clause */
/* Skilling's transposed form of the curve (Programming the Hilbert curve, 2004), then a stable radix sort of the
 * keys. */
#include "src/mesh/hilbert.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

enum { BITS = 16, DIGIT = 12 }; /* of a coordinate; of a pass of the sort */

struct keyed {
    uint64_t key;
    uint32_t index;
};

/* The distance along the curve of a cell of the 2^BITS grid. */
static uint64_t curve_key(uint32_t cell[3])
{
    for (uint32_t high = UINT32_C(1) << (BITS - 1); high > 1; high >>= 1)
        for (int i = 0; i < 3; i++) {
            uint32_t swap = (cell[0] ^ cell[i]) & (high - 1);
            if (cell[i] & high)
                cell[0] ^= high - 1;
            else {
                cell[0] ^= swap;
                cell[i] ^= swap;
            }
        }
    cell[1] ^= cell[0];
    cell[2] ^= cell[1];
    uint32_t flips = 0;
    for (uint32_t high = UINT32_C(1) << (BITS - 1); high > 1; high >>= 1)
        flips ^= cell[2] & high ? high - 1 : 0;
    uint64_t key = 0;
    for (int bit = BITS - 1; bit >= 0; bit--)
        for (int i = 0; i < 3; i++)
            key = key << 1 | ((cell[i] ^ flips) >> bit & 1);
    return key;
}

static void fill_keys(const double *positions, uint32_t count, struct keyed *out)
{
    double low[3] = {positions[0], positions[1], positions[2]}, width = 0;
    for (int i = 0; i < 3; i++) {
        double high = low[i];
        for (size_t v = 1; v < count; v++) {
            low[i] = smaller(low[i], positions[3 * v + (size_t)i]);
            high = larger(high, positions[3 * v + (size_t)i]);
        }
        width = larger(width, high - low[i]);
    }
    double scale = width > 0 ? ((UINT32_C(1) << BITS) - 1) / width : 0;
    for (size_t v = 0; v < count; v++) {
        uint32_t cell[3];
        for (int i = 0; i < 3; i++)
            cell[i] = (uint32_t)smaller((positions[3 * v + (size_t)i] - low[i]) * scale, (UINT32_C(1) << BITS) - 1);
        out[v] = (struct keyed){curve_key(cell), (uint32_t)v};
    }
}

static void sort_digit(const struct keyed *from, struct keyed *to, uint32_t count, int shift, uint32_t *starts)
{
    uint32_t mask = (UINT32_C(1) << DIGIT) - 1, sum = 0;
    memset(starts, 0, sizeof *starts << DIGIT);
    for (size_t i = 0; i < count; i++)
        starts[from[i].key >> shift & mask]++;
    for (uint32_t d = 0; d <= mask; d++) {
        uint32_t here = starts[d];
        starts[d] = sum;
        sum += here;
    }
    for (size_t i = 0; i < count; i++)
        to[starts[from[i].key >> shift & mask]++] = from[i];
}

enum tetlod_status hilbert_order(const double *positions, uint32_t count, uint32_t *order, struct tetlod_error *error)
{
    struct keyed *keys = array_new(count, sizeof *keys), *other = array_new(count, sizeof *other);
    uint32_t *starts = array_new((size_t)1 << DIGIT, sizeof *starts);
    bool room = keys && other && starts;
    if (room) {
        if (count)
            fill_keys(positions, count, keys);
        for (int shift = 0; shift < 3 * BITS; shift += DIGIT) {
            struct keyed *swap = keys;
            sort_digit(keys, other, count, shift, starts);
            keys = other;
            other = swap;
        }
        for (size_t i = 0; i < count; i++)
            order[i] = keys[i].index;
    }
    free(keys);
    free(other);
    free(starts);
    return room ? TETLOD_OK : tetlodi_fail_nomem(error, "the order of the vertices",
                                                 (uint64_t)count * 2 * sizeof *keys);
}
