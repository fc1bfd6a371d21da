/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cells/cell_help.h"

#include <stdlib.h>

#include "format/fail.h"
#include "src/cells/cell_run.h"
#include "src/mesh/mesh_channel.h"
#include "src/util/array.h"
#include "src/util/channel.h"

/* What a helper has of a phase. */
struct help {
    struct cell_run run;
    struct simplify_options options;
    struct contraction_log log; /* empty */
    uint32_t *order, count;
    enum tetlod_status status;
};

static void pass_options(struct channel *channel, struct simplify_options *options)
{
    CHANNEL_VALUE(channel, *options);
    options->regions = NULL; // these two are in the vertices' flags
    options->fixed = NULL;
    options->progress = NULL;
    double *rungs = (double *)(uintptr_t)options->rungs; // read only, where they are sent
    options->rungs = options->rung_count ? CHANNEL_ARRAY(channel, rungs, options->rung_count) : NULL;
}

static void pass_whole(struct channel *channel, struct piece_whole *whole, uint32_t values)
{
    struct piece_whole about = *whole;
    uint8_t limited = about.limits != NULL;
    CHANNEL_VALUE(channel, about);
    CHANNEL_VALUE(channel, limited);
    if (!channel->share->leads) {
        *whole = about;
        whole->ranges.field_ranges = NULL;
        whole->ranges.component_ranges = NULL;
        whole->controlled = NULL;
        whole->limits = NULL;
    }
    CHANNEL_ARRAY(channel, whole->ranges.field_ranges, about.controlled_count);
    CHANNEL_ARRAY(channel, whole->ranges.component_ranges, values);
    CHANNEL_ARRAY(channel, whole->controlled, about.controlled_count);
    if (limited)
        CHANNEL_ARRAY(channel, whole->limits, about.controlled_count);
}

/* What all cells are like: the fields, and how far contracting has come. The cells come one by one. */
static void pass_like(struct channel *channel, struct piece *piece, uint32_t components)
{
    struct tetmesh none = piece->mesh, *like = channel->share->leads ? &none : &piece->mesh;
    none.vertex_count = none.tet_count = 0;
    mesh_pass(channel, like, NULL);
    CHANNEL_ARRAY(channel, piece->state.certified, components);
    CHANNEL_ARRAY(channel, piece->state.predicted, components);
    CHANNEL_VALUE(channel, piece->state.moved);
}

/* What contracting any cell of a stage takes. */
static void pass_stage(struct channel *channel, struct cell_run *run, struct simplify_options *options,
                       uint32_t **order, uint32_t *count)
{
    uint32_t values = 0;
    for (uint32_t f = 0; f < run->state.mesh.field_count; f++)
        values += run->state.mesh.fields[f].components;
    pass_options(channel, options);
    CHANNEL_VALUE(channel, values);
    pass_whole(channel, &run->whole, values);
    pass_like(channel, &run->state, run->whole.component_count);
    CHANNEL_VALUE(channel, run->partition.cells);
    CHANNEL_ARRAY(channel, run->partition.boxes, run->partition.cells);
    CHANNEL_VALUE(channel, *count);
    CHANNEL_ARRAY(channel, *order, *count);
    CHANNEL_VALUE(channel, run->from);
    CHANNEL_VALUE(channel, run->to);
    CHANNEL_VALUE(channel, run->root);
    CHANNEL_VALUE(channel, run->tries);
}

enum tetlod_status cells_pass(struct cell_run *run)
{
    enum work_call call = run->root ? CALL_ROOT : CALL_CELLS;
    struct simplify_options options = *run->options;
    uint32_t *order = (uint32_t *)(uintptr_t)run->order, count = run->cell_count; // read only, where they are sent
    TETLOD_TRY(run->share->call(run->share, &call, &run->crew, run->error));
    struct channel channel = {run->crew, TETLOD_OK};
    pass_stage(&channel, run, &options, &order, &count);
    return TETLOD_OK;
}

/* ---- a helper */

static enum tetlod_status prepare(struct help *help)
{
    struct cell_run *run = &help->run;
    if (help->status != TETLOD_OK)
        return help->status;
    run->mesh = &run->state.mesh;
    run->state.whole = &run->whole;
    run->log = &help->log;
    run->order = help->order;
    run->cell_count = help->count;
    run->options = &help->options;
    run->pool = pool_new(help->options.threads ? help->options.threads : parallel_cores());
    run->numbers = run->pool ? array_zero(pool_size(run->pool), sizeof *run->numbers) : NULL;
    run->cells = array_zero(help->count, sizeof *run->cells);
    return run->numbers && run->cells ? TETLOD_OK : TETLOD_ERR_NOMEM;
}

/* Also a helper that has no room takes part in the stage: it says so at the end. */
static enum tetlod_status take_if_ready(void *opaque)
{
    struct help *help = opaque;
    return help->status == TETLOD_OK ? cells_take(&help->run) : cells_no_memory(&help->run);
}

static void release(struct help *help)
{
    struct cell_run *run = &help->run;
    free(run->numbers);
    cells_free(run);
    partition_fini(&run->partition);
    piece_fini(&run->state);
    piece_whole_fini(&run->whole);
    pool_free(run->pool);
    free((void *)(uintptr_t)help->options.rungs);
    free(help->order);
}

enum tetlod_status cells_help(const struct work_share *share, unsigned threads, struct tetlod_error *error)
{
    struct help help = {.run = {.share = share, .crew = share, .error = error}};
    struct channel channel = {share, TETLOD_OK};
    pass_stage(&channel, &help.run, &help.options, &help.order, &help.count);
    help.options.threads = threads;
    help.status = channel.status;
    help.status = prepare(&help);
    help.run.store = (struct cell_store){share->put, share->get, share->opaque};
    enum tetlod_status status = work_share_run(share, help.count, help.run.tries ? NULL : help.order, NULL,
                                               take_if_ready, &help, error);
    cells_leave_store(&help.run);
    release(&help);
    return status;
}
