/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/coding/topologies.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/coding/time_table.h"
#include "format/fail.h"

enum { TOPOLOGY_ENTRY = 32 }; /* bytes of the table for one, without its times */

void tetlodi_topologies_encode(const struct tetlod_topology *topologies, uint32_t count,
                               const uint8_t (*cids)[DIGEST_SIZE],
                               struct tetlodi_buffer *out)
{
    static const uint8_t none[DIGEST_SIZE] = {0};
    tetlodi_put(out, count, 4);
    for (uint32_t t = 0; t < count; t++) {
        tetlodi_put(out, topologies[t].step_count, 4);
        tetlodi_put(out, 0, 4);
        // the first one's is that of the stream, which nobody knows yet
        tetlodi_put(out, t ? topologies[t].size : 0, 8);
        tetlodi_put_block(out, t ? cids[t] : none, DIGEST_SIZE);
    }
    for (uint32_t t = 0; t < count; t++)
        for (uint32_t s = 0; s < topologies[t].step_count; s++)
            tetlodi_put_f64(out, topologies[t].times[s]);
}

/* One row; *at is where its stream begins. */
static bool decode_topology(struct tetlod_topology *topology, bool first, const char *own_cid,
                            struct tetlodi_bytes *in, uint64_t *at)
{
    topology->step_count = (uint32_t)tetlodi_get(in, 4);
    uint64_t reserved = tetlodi_get(in, 4);
    topology->size = tetlodi_get(in, 8);
    const uint8_t *cid = tetlodi_get_block(in, DIGEST_SIZE);
    bool zero = true;
    for (int i = 0; i < DIGEST_SIZE && cid; i++) {
        static const char digits[] = "0123456789abcdef";
        zero &= cid[i] == 0;
        topology->cid[2 * i] = digits[cid[i] >> 4];
        topology->cid[2 * i + 1] = digits[cid[i] & 15];
    }
    if (!cid || reserved || !topology->step_count || topology->step_count > MAX_STEPS)
        return false;
    if (first) {
        memcpy(topology->cid, own_cid, sizeof topology->cid);
        return zero && topology->size == 0;
    }
    topology->offset = *at;
    *at += topology->size;
    return topology->size >= HEADER_SIZE && topology->size <= INT64_MAX;
}

/* The rows; *out_steps is how many steps they have. False: they are damaged. */
static bool decode_rows(struct tetlodi_index *index, uint32_t count, const struct tetlodi_section *next,
                        struct tetlodi_bytes *in,
                        uint64_t *out_steps)
{
    uint64_t at = next->frame.offset;
    *out_steps = 0;
    for (uint32_t t = 0; t < count; t++) {
        if (!decode_topology(&index->topologies[t], t == 0, index->info.cid, in, &at) ||
            at - next->frame.offset > next->frame.size)
            return false;
        *out_steps += index->topologies[t].step_count;
    }
    return at - next->frame.offset == next->frame.size && *out_steps <= MAX_STEPS && in->left == *out_steps * 8;
}

static bool decode_times(struct tetlodi_index *index, uint32_t count, uint64_t steps, struct tetlodi_bytes *in)
{
    double *times = index->times;
    for (uint64_t s = 0; s < steps; s++) {
        times[s] = tetlodi_get_f64(in);
        if (!isfinite(times[s]) || (s && times[s] < times[s - 1]))
            return false;
    }
    for (uint32_t t = 0; t < count; times += index->topologies[t++].step_count)
        index->topologies[t].times = times;
    return true;
}

enum tetlod_status tetlodi_topologies_decode(struct tetlodi_index *index, const uint8_t *bytes, size_t size,
                                             struct tetlod_error *error)
{
    struct tetlodi_bytes in = {bytes, size, false};
    struct tetlod_info *info = &index->info;
    const struct tetlodi_section *next = tetlodi_section_find(index->sections, info->section_count, TAG_NEXT);
    uint32_t count = (uint32_t)tetlodi_get(&in, 4);
    uint64_t steps = 0;
    bool good = next && !(next->flags & SECTION_PACKED) && tetlodi_section_find(index->sections, info->section_count,
                                                                                TAG_TIME) && count > 1 &&
                (size - 4) / TOPOLOGY_ENTRY >= count;
    if (good && !(index->topologies = calloc(count, sizeof *index->topologies)))
        return tetlodi_fail_nomem(error, "the topology groups", count * sizeof *index->topologies);
    good = good && decode_rows(index, count, next, &in, &steps);
    if (good && !(index->times = malloc((size_t)steps * sizeof *index->times)))
        return tetlodi_fail_nomem(error, "the times of the steps", steps * sizeof *index->times);
    if (!good || !decode_times(index, count, steps, &in))
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "the table of topology groups is damaged");
    index->topologies[0].size = info->bytes;
    info->topology_count = count;
    info->topologies = index->topologies;
    return TETLOD_OK;
}

uint32_t tetlod_topology_of_step(const struct tetlod_info *info, uint32_t step, uint32_t *out_step)
{
    for (uint32_t t = 0; t < info->topology_count; t++) {
        if (step < info->topologies[t].step_count) {
            if (out_step)
                *out_step = step;
            return t;
        }
        step -= info->topologies[t].step_count;
    }
    return TETLOD_NONE;
}

uint32_t tetlod_topology_for_time(const struct tetlod_info *info, double time)
{
    uint32_t best = TETLOD_NONE;
    double least = INFINITY;
    for (uint32_t t = 0; t < info->topology_count; t++)
        for (uint32_t s = 0; s < info->topologies[t].step_count; s++) {
            double away = fabs(info->topologies[t].times[s] - time);
            if (away < least) {
                least = away;
                best = t;
            }
        }
    return best;
}
