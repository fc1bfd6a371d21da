/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: a log, and parts of the samples that no other program has taken. A sweep carries the mesh from level to level and
 * measures some parts at each. Out, for each part: what its samples have come to at each level. The domain error is a
 * part of its own: what finds it is then made once.
 */
#include "src/measure/measure_shared.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/measure/measure_levels.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"
#include "src/util/channel.h"
#include "src/util/clock.h"

/* The parts of a stage: the domain error first, as it takes longest: about as long as so many others. The border has
 * taken as long as so many. */
enum { PART_BOUNDS, PART_SAMPLES, STAGE_PARTS = MEASURE_PARTS + PART_SAMPLES, BOUNDS_TAKE = 2, BORDER_TAKE = 2 };

struct sweep {
    const struct shared_levels *levels;
    struct coarsening coarsening;
    struct measure_levels *measure;
    struct buffer *parts; /* [STAGE_PARTS] what is put */
    bool mine[STAGE_PARTS];
    double alone; /* processor seconds of what every program does */
    struct measured *scratch; /* [field] */
    struct tetlod_error *error;
};

static void end_sweep(struct sweep *sweep)
{
    measure_levels_free(sweep->measure);
    sweep->measure = NULL;
    coarsening_fini(&sweep->coarsening);
    sweep->coarsening = (struct coarsening){0};
}

static enum tetlod_status begin_sweep(struct sweep *sweep)
{
    const struct shared_levels *levels = sweep->levels;
    end_sweep(sweep);
    TETLOD_TRY(coarsening_init(&sweep->coarsening, levels->mesh, levels->log, sweep->error));
    return measure_levels_new(&sweep->measure, levels->original, &sweep->coarsening, levels->threads, sweep->error);
}

/* Parts for a sweep: this member's share of those that are open. Who has found the border takes less. */
static bool take_parts(struct sweep *sweep)
{
    const struct work_share *share = sweep->levels->share;
    const struct kept_mesh *kept = &sweep->levels->kept;
    const uint32_t all = MEASURE_PARTS + BOUNDS_TAKE + (kept->mesh.tet_count ? BORDER_TAKE : 0);
    const uint32_t most = (all + share->members - 1) / share->members - (kept->bordered ? BORDER_TAKE : 0);
    uint32_t part, count = 0;
    memset(sweep->mine, 0, sizeof sweep->mine);
    for (; count < most && share->take(share->opaque, &part, NULL); count += part == PART_BOUNDS ? BOUNDS_TAKE : 1)
        sweep->mine[part] = true;
    return count > 0;
}

static enum tetlod_status keep_level(struct sweep *sweep, double domain)
{
    enum tetlod_status status = TETLOD_OK;
    if (sweep->mine[PART_BOUNDS])
        status = buffer_append(&sweep->parts[PART_BOUNDS], &domain, sizeof domain);
    for (uint32_t part = PART_SAMPLES; part < STAGE_PARTS && status == TETLOD_OK; part++)
        if (sweep->mine[part])
            status = measure_levels_pack(sweep->measure, part - PART_SAMPLES, &sweep->parts[part]);
    return status == TETLOD_OK ? status : tetlodi_fail_nomem(sweep->error, "the levels", sweep->parts[0].size);
}

/* The next level, at which every program has to come by itself. */
static enum tetlod_status advance(struct sweep *sweep, uint32_t mark)
{
    const struct shared_levels *levels = sweep->levels;
    enum tetlod_status status = TETLOD_OK;
    double begun = thread_seconds();
    if (mark)
        status = coarsening_advance(&sweep->coarsening, levels->log, levels->log->marks[mark].contractions,
                                    levels->threads, sweep->error);
    sweep->alone += thread_seconds() - begun;
    return status;
}

static enum tetlod_status measure_parts(struct sweep *sweep)
{
    const struct shared_levels *levels = sweep->levels;
    const struct contraction_log *log = levels->log;
    measure_levels_restrict(sweep->measure, sweep->mine + PART_SAMPLES, sweep->mine[PART_BOUNDS]);
    for (uint32_t mark = 0; mark < log->mark_count; mark++) {
        double domain = levels->domains[mark];
        if (!levels->asked[mark])
            continue;
        TETLOD_TRY(advance(sweep, mark));
        TETLOD_TRY(measure_levels_next(sweep->measure, sweep->scratch, &domain, sweep->error));
        TETLOD_TRY(keep_level(sweep, domain));
        if (levels->progress && !levels->progress(levels->progress_opaque, (mark + 1.0) / log->mark_count))
            return tetlodi_fail(sweep->error, TETLOD_ERR_CANCELLED, "cancelled");
    }
    return TETLOD_OK;
}

static enum tetlod_status put_parts(struct sweep *sweep)
{
    const struct work_share *share = sweep->levels->share;
    if (sweep->mine[PART_BOUNDS] &&
        measure_levels_pack_sums(sweep->measure, &sweep->parts[PART_BOUNDS]) != TETLOD_OK)
        return tetlodi_fail_nomem(sweep->error, "the levels", sweep->parts[PART_BOUNDS].size);
    for (uint32_t part = 0; part < STAGE_PARTS; part++) {
        if (sweep->mine[part])
            TETLOD_TRY(share->put(share->opaque, part, sweep->parts[part].bytes, sweep->parts[part].size,
                                  sweep->error));
        buffer_fini(&sweep->parts[part]);
        sweep->parts[part] = (struct buffer){0};
    }
    return TETLOD_OK;
}

/* Sweeps until no part is open. */
static enum tetlod_status do_parts(void *opaque)
{
    struct sweep *sweep = opaque;
    const struct work_share *share = sweep->levels->share;
    enum tetlod_status status = TETLOD_OK;
    while (status == TETLOD_OK && take_parts(sweep)) {
        double begun = thread_seconds();
        status = begin_sweep(sweep);
        sweep->alone += thread_seconds() - begun;
        if (status == TETLOD_OK)
            status = measure_parts(sweep);
        if (status == TETLOD_OK)
            status = put_parts(sweep);
    }
    if (share->spent_alone)
        share->spent_alone(share->opaque, sweep->alone);
    sweep->alone = 0;
    return status;
}

/* ---- what they have come to */

static uint32_t asked_count(const struct shared_levels *levels)
{
    uint32_t count = 0;
    for (uint32_t mark = 0; mark < levels->log->mark_count; mark++)
        count += levels->asked[mark];
    return count;
}

/* A part of so many bytes a level and some behind them. */
static enum tetlod_status get_part(struct sweep *sweep, uint32_t part, size_t level, size_t behind)
{
    const struct work_share *share = sweep->levels->share;
    struct buffer *at = &sweep->parts[part];
    TETLOD_TRY(share->get(share->opaque, part, SIZE_MAX, &at->bytes, &at->size, sweep->error));
    return at->size == level * asked_count(sweep->levels) + behind
               ? TETLOD_OK
               : tetlodi_fail(sweep->error, TETLOD_ERR_IO, "a part of the measuring is not as it was written");
}

static enum tetlod_status get_parts(struct sweep *sweep)
{
    const struct tetmesh *original = sweep->levels->original;
    const size_t sums = measure_levels_sums_size(original->field_count);
    const struct buffer *bounds = &sweep->parts[PART_BOUNDS];
    TETLOD_TRY(get_part(sweep, PART_BOUNDS, sizeof(double), sums));
    TETLOD_TRY(measure_levels_of_sums(&sweep->measure, original, bounds->bytes + bounds->size - sums, sweep->error));
    for (uint32_t part = 0; part < MEASURE_PARTS; part++)
        TETLOD_TRY(get_part(sweep, part + PART_SAMPLES, measure_levels_part_size(sweep->measure, part), 0));
    return TETLOD_OK;
}

static void join_levels(struct sweep *sweep, struct measured *measured, double *domains)
{
    size_t row = 0; // of the marks that are asked for
    for (uint32_t mark = 0; mark < sweep->levels->log->mark_count; mark++) {
        if (!sweep->levels->asked[mark])
            continue;
        memcpy(&domains[mark], sweep->parts[PART_BOUNDS].bytes + row * sizeof *domains, sizeof *domains);
        for (uint32_t part = 0; part < MEASURE_PARTS; part++)
            measure_levels_unpack(sweep->measure, part, sweep->parts[part + PART_SAMPLES].bytes +
                                                            row * measure_levels_part_size(sweep->measure, part));
        measure_levels_result(sweep->measure, measured + (size_t)mark * sweep->levels->original->field_count);
        row++;
    }
}

/* ---- helpers */

/* What replaying takes of a log. */
static void pass_log(struct channel *channel, struct contraction_log *log)
{
    uint32_t fields = log->field_count;
    CHANNEL_VALUE(channel, log->vertex_count);
    CHANNEL_VALUE(channel, log->count);
    CHANNEL_VALUE(channel, log->mark_count);
    CHANNEL_WORDS(channel, log->children, 4 * (size_t)log->count, 4);
    CHANNEL_WORDS(channel, log->positions, 3 * (size_t)log->count, 3);
    CHANNEL_ARRAY(channel, log->marks, log->mark_count);
    CHANNEL_VALUE(channel, fields);
    if (!channel->share->leads) {
        log->fields = array_zero(fields, sizeof *log->fields);
        log->field_count = log->fields ? fields : 0;
        channel->status = log->fields ? channel->status : TETLOD_ERR_NOMEM;
    }
    for (uint32_t f = 0; f < fields; f++) {
        struct log_field none = {0}, *field = log->fields ? &log->fields[f] : &none;
        CHANNEL_VALUE(channel, field->components);
        CHANNEL_WORDS(channel, field->values, (size_t)field->components * log->count, field->components);
    }
}

/* All that measuring some of the samples takes. */
static void pass_levels(struct channel *channel, const struct kept_mesh *kept, struct tetmesh *original,
                        struct tetmesh *mesh, struct contraction_log *log, bool **asked, double **domains)
{
    mesh_pass(channel, original, &kept->mesh);
    mesh_pass(channel, mesh, original);
    pass_log(channel, log);
    CHANNEL_ARRAY(channel, *asked, log->mark_count);
    CHANNEL_ARRAY(channel, *domains, log->mark_count);
}

/* Calls helpers, if there are any: they and this one then share. */
static enum tetlod_status call_helpers(struct shared_levels *levels, struct tetlod_error *error)
{
    enum work_call call = CALL_SAMPLES;
    struct tetmesh original = *levels->original, mesh = *levels->mesh; // what is sent is only read
    struct contraction_log log = *levels->log;
    bool *asked = (bool *)(uintptr_t)levels->asked;
    double *domains = (double *)(uintptr_t)levels->domains;
    if (!work_has_helpers(levels->share))
        return TETLOD_OK;
    TETLOD_TRY(levels->share->call(levels->share, &call, &levels->share, error));
    struct channel channel = {levels->share, TETLOD_OK};
    pass_levels(&channel, &levels->kept, &original, &mesh, &log, &asked, &domains);
    return TETLOD_OK;
}

/* Also a helper that has no room takes part in the stage: it says so at the end. */
static enum tetlod_status fail_parts(void *opaque)
{
    struct sweep *sweep = opaque;
    return tetlodi_fail_nomem(sweep->error, "the levels", measure_levels_bytes(sweep->levels->original));
}

static void free_parts(struct sweep *sweep)
{
    for (uint32_t part = 0; part < STAGE_PARTS && sweep->parts; part++)
        buffer_fini(&sweep->parts[part]);
    free(sweep->parts);
}

enum tetlod_status measure_help(const struct work_share *share, unsigned threads, struct kept_mesh *kept,
                                void (*settle)(bool measures), struct tetlod_error *error)
{
    struct tetmesh original = {0}, mesh = {0};
    struct contraction_log log = {0};
    bool *asked = NULL;
    double *domains = NULL;
    struct channel channel = {share, TETLOD_OK};
    pass_levels(&channel, kept, &original, &mesh, &log, &asked, &domains);
    if (settle)
        settle(true);
    const struct shared_levels levels = {&original, &mesh, &log, asked, domains, threads, share, *kept, NULL, NULL};
    struct sweep sweep = {.levels = &levels,
                          .parts = array_zero(STAGE_PARTS, sizeof *sweep.parts),
                          .scratch = array_zero(original.field_count, sizeof *sweep.scratch),
                          .error = error};
    bool ready = channel.status == TETLOD_OK && sweep.parts && sweep.scratch;
    enum tetlod_status status =
        work_share_run(share, STAGE_PARTS, NULL, NULL, ready ? do_parts : fail_parts, &sweep, error);
    share->end(share->opaque);
    end_sweep(&sweep);
    free_parts(&sweep);
    free(sweep.scratch);
    free(asked);
    free(domains);
    log_fini(&log);
    mesh_return_borrowed(&mesh, &original);
    tetmesh_fini(&mesh);
    mesh_return_borrowed(&original, &kept->mesh);
    tetmesh_fini(&original);
    kept_mesh_fini(kept);
    if (settle)
        settle(false);
    return status;
}

/* ---- the whole */

struct shared_measuring {
    struct shared_levels levels;
    struct sweep sweep;
    bool open; /* the stage is not ended; where the share is apart, nor settled */
};

/* Parts come out of the stage, of which others that follow may have the share. */
static enum tetlod_status end_stage(struct shared_measuring *measuring)
{
    const struct work_share *share = measuring->levels.share;
    end_sweep(&measuring->sweep);
    enum tetlod_status status = share->writes ? get_parts(&measuring->sweep) : TETLOD_OK;
    share->end(share->opaque);
    measuring->open = false;
    return status;
}

static enum tetlod_status begin_stage(struct shared_measuring *measuring, struct tetlod_error *error)
{
    const struct work_share *share = measuring->levels.share;
    measuring->open = true;
    if (share->apart)
        return share->begin(share->opaque, STAGE_PARTS, NULL, NULL, error);
    TETLOD_TRY(work_share_run(share, STAGE_PARTS, NULL, NULL, do_parts, &measuring->sweep, error));
    return end_stage(measuring);
}

enum tetlod_status measure_shared_begin(struct shared_measuring **out, const struct shared_levels *levels,
                                        struct tetlod_error *error)
{
    const uint32_t fields = levels->original->field_count;
    struct shared_measuring *measuring = *out = array_zero(1, sizeof *measuring);
    if (!measuring)
        return tetlodi_fail_nomem(error, "the levels", sizeof *measuring);
    measuring->levels = *levels;
    measuring->sweep = (struct sweep){.levels = &measuring->levels,
                                      .parts = array_zero(STAGE_PARTS, sizeof *measuring->sweep.parts),
                                      .scratch = array_zero(fields, sizeof *measuring->sweep.scratch),
                                      .error = error};
    if (!measuring->sweep.parts || !measuring->sweep.scratch)
        return tetlodi_fail_nomem(error, "the levels", STAGE_PARTS * sizeof *measuring->sweep.parts);
    TETLOD_TRY(call_helpers(&measuring->levels, error));
    return begin_stage(measuring, error);
}

enum tetlod_status measure_shared_end(struct shared_measuring *measuring, struct measured *measured, double *domains,
                                      struct tetlod_error *error)
{
    const struct work_share *share = measuring->levels.share;
    bool again;
    measuring->sweep.error = error;
    if (share->apart) {
        TETLOD_TRY(share->settle(share->opaque, TETLOD_OK, &again, error));
        TETLOD_TRY(end_stage(measuring));
    }
    join_levels(&measuring->sweep, measured, domains);
    return TETLOD_OK;
}

void measure_shared_free(struct shared_measuring *measuring)
{
    if (!measuring)
        return;
    if (measuring->open)
        measuring->levels.share->end(measuring->levels.share->opaque);
    end_sweep(&measuring->sweep);
    free_parts(&measuring->sweep);
    free(measuring->sweep.scratch);
    free(measuring);
}
