/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: what is left, and its partition. Out: cells, each contracted, in memory or where they wait (cell_store.h).
 * Threads take cells, and so do programs that share them.
 */
#include "src/cells/cell_help.h"
#include "src/cells/cell_run.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/simplify/ladder.h"
#include "src/simplify/rounds/rounds.h"
#include "src/util/array.h"

/* What a cell leaves at least, whatever the limit: more at once would leave scars at the seams that no later cell
 * removes. */
static const double LEFT_AT_LEAST = 0.25;

/* What a cell's logs have come to is in so many of its first bytes, unless many fields are controlled. */
enum { HEAD_BYTES = 1 << 12 };

/* What a phase takes away of the vertices, about: for the progress. */
static const double TAKEN = 0.07;

enum tetlod_status cells_no_memory(const struct cell_run *run)
{
    return tetlodi_fail_nomem(run->error, "the cells", 100 * (uint64_t)run->state.mesh.tet_count);
}

enum tetlod_status cells_make_scratch(struct cell_run *run)
{
    for (unsigned w = 0; w < pool_size(run->pool) + work_has_helpers(run->share); w++) {
        free(run->numbers[w]);
        run->numbers[w] = array_new(run->state.mesh.vertex_count, sizeof **run->numbers);
        if (!run->numbers[w])
            return cells_no_memory(run);
        memset(run->numbers[w], 0xff, run->state.mesh.vertex_count * sizeof **run->numbers);
    }
    return TETLOD_OK;
}

/* ---- one cell */

void cells_free(struct cell_run *run)
{
    for (uint32_t i = 0; i < run->cell_count && run->cells; i++)
        cell_fini(&run->cells[i]);
    free(run->cells);
    run->cells = NULL;
    run->cell_count = 0;
}

/* The options of a cell's contraction: levels within it are of no use. */
static struct simplify_options options_of(const struct cell_run *run, const struct cell *cell,
                                          const struct tetlodi_box *box)
{
    struct simplify_options options = *run->options;
    options.threads = 1;
    options.progress = NULL;
    options.growth = INFINITY;
    options.box = box;
    options.min_tets = (uint32_t)(LEFT_AT_LEAST * cell->tets) + 1;
    return options;
}

/* What the catch-up's vertices are, for those of the next stage. */
static enum tetlod_status keep_nodes(struct cell *cell)
{
    cell->nodes = array_new(cell->piece.mesh.vertex_count, sizeof *cell->nodes);
    if (!cell->nodes)
        return tetlodi_fail_nomem(&cell->error, "a cell", 4 * (uint64_t)cell->piece.mesh.vertex_count);
    memcpy(cell->nodes, cell->piece.nodes, cell->piece.mesh.vertex_count * sizeof *cell->nodes);
    return TETLOD_OK;
}

/* Cuts the cell of that number out of what is left. */
static enum tetlod_status cut_cell(const struct cell_run *run, struct cell *cell, uint32_t number, uint32_t *numbers)
{
    const struct partition *partition = &run->partition;
    uint32_t begin = partition->begins[number];
    cell->tets = partition->begins[number + 1] - begin;
    return piece_part(&cell->piece, &run->state, partition->tets + begin, cell->tets, partition->seams, numbers,
                      &cell->vertices, &cell->error);
}

/* The number of a part's cell: parts are cells, or places among those tried. */
static uint32_t number_of(const struct cell_run *run, uint32_t part)
{
    return run->tries ? run->order[part] : part;
}

enum tetlod_status cells_contract_rest(const struct cell_run *run, struct cell *root, struct piece *rest,
                                       const struct simplify_options *options, struct tetlod_error *error)
{
    double from = run->from > 0 ? run->from : FIRST_LIMIT;
    return rounds_contract(&root->logs[CELL_GO_ON], rest, from, options, error);
}

static enum tetlod_status contract_cell(const struct cell_run *run, struct cell *cell, uint32_t number)
{
    bool named;
    if (run->root)
        return cells_contract_rest(run, cell, &cell->piece, run->options, &cell->error);
    struct simplify_options options = options_of(run, cell, &run->partition.boxes[number]);
    double from = run->from > 0 ? run->from : FIRST_LIMIT;
    if (run->tries)
        return rounds_contract(&cell->logs[CELL_GO_ON], &cell->piece, from, &options, &cell->error);
    if (run->from > 0) {
        options.max_error = run->from;
        TETLOD_TRY(rounds_contract(&cell->logs[CELL_CATCH_UP], &cell->piece, from, &options, &cell->error));
        TETLOD_TRY(keep_nodes(cell));
        from = next_limit(run->from, run->to, STEPS_FROM, &named);
    }
    options.max_error = run->to;
    return rounds_contract(&cell->logs[CELL_GO_ON], &cell->piece, from, &options, &cell->error);
}

/* ---- many */

/* A cell that is contracted becomes bytes elsewhere, but for what its logs have come to. */
static enum tetlod_status put_away(const struct cell_run *run, struct cell *cell, uint32_t number)
{
    struct buffer bytes = {0};
    enum tetlod_status status = cell_pack(cell, &bytes, &cell->error);
    cell_drop(cell);
    if (status == TETLOD_OK)
        status = run->store.put(run->store.opaque, number, bytes.bytes, bytes.size, &cell->error);
    buffer_fini(&bytes);
    return status;
}

enum tetlod_status cells_check(const struct cell_run *run, bool same)
{
    return same ? TETLOD_OK
                : tetlodi_fail(run->error, TETLOD_ERR_IO, "a cell is of other options, or of another version");
}

static enum tetlod_status check_head(const struct cell_run *run, const struct cell *cell)
{
    const bool catches_up = run->from > 0 && !run->root && !run->tries;
    bool same = true;
    for (int stage = catches_up ? CELL_CATCH_UP : CELL_GO_ON; stage < CELL_STAGES; stage++)
        same &= cell->logs[stage].mark_count && cell->logs[stage].component_count == run->whole.component_count;
    return cells_check(run, same);
}

/* Is it the cell that the head was of? What is known of it places what comes. */
static bool is_same(const struct cell *head, const struct cell *cell)
{
    const struct contraction_log *log = &cell->logs[CELL_GO_ON];
    bool same = log->mark_count && cell->piece.mesh.tet_count == log->marks[log->mark_count - 1].tets;
    for (int stage = 0; stage < CELL_STAGES; stage++)
        same &= cell->logs[stage].count == head->logs[stage].count &&
                cell->logs[stage].mark_count == head->logs[stage].mark_count;
    const struct contraction_log *known = &head->logs[CELL_GO_ON];
    return same && known->marks[known->mark_count - 1].tets == cell->piece.mesh.tet_count;
}

static enum tetlod_status check_bounds(const struct cell_run *run, const struct cell *cell)
{
    const struct contraction_log *log = &cell->logs[CELL_GO_ON];
    return cells_check(run, !log->count || run->options->local_bound == (log->components[0].bounds != NULL));
}

enum tetlod_status cells_bring_back(const struct cell_run *run, struct cell *cell, uint32_t number)
{
    unsigned char *bytes;
    size_t size;
    if (!run->store.get)
        return TETLOD_OK;
    TETLOD_TRY(run->store.get(run->store.opaque, number, SIZE_MAX, &bytes, &size, run->error));
    struct cell back;
    enum tetlod_status status = cell_unpack(&back, &run->state, bytes, size, run->error);
    memcpy(back.firsts, cell->firsts, sizeof back.firsts);
    if (status == TETLOD_OK && cell->logs[CELL_GO_ON].mark_count)
        status = cells_check(run, is_same(cell, &back));
    cell_fini(cell);
    *cell = back;
    free(bytes);
    if (status == TETLOD_OK)
        status = cells_check(run, (run->root || cell->vertices) && cell_fits(cell, run->state.mesh.vertex_count));
    if (status == TETLOD_OK)
        status = check_head(run, cell);
    return status == TETLOD_OK ? check_bounds(run, cell) : status;
}

/* Contracts a cell, which comes as bytes (NULL: it is to be cut), and puts it away where it is to wait elsewhere. */
static void do_cell(struct cell_run *run, unsigned worker, uint32_t part, const struct buffer *input)
{
    struct cell *cell = &run->cells[part];
    uint32_t number = number_of(run, part);
    cell->status = input ? cell_unpack_start(cell, &run->state, input->bytes, input->size, &cell->error)
                         : cut_cell(run, cell, number, run->numbers[worker]);
    if (cell->status == TETLOD_OK)
        cell->status = contract_cell(run, cell, number);
    if (run->store.put && cell->status == TETLOD_OK)
        cell->status = put_away(run, cell, part);
    double done = (double)(atomic_fetch_add(&run->done, 1) + 1) / run->cell_count;
    if (!run->options->progress)
        return;
    done = (run->log->count + TAKEN * done * run->state.mesh.vertex_count) / run->mesh->vertex_count;
    if (worker == 0 && !run->options->progress(run->options->progress_opaque, done))
        atomic_store(&run->cancelled, true);
}

static void contract_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct cell_run *run = context;
    for (size_t i = begin; i < end && !atomic_load(&run->cancelled); i++)
        do_cell(run, worker, run->tries ? (uint32_t)i : run->order[i], NULL);
}

/* The same of the cells that other programs have not taken. */
static void contract_taken(void *context, unsigned worker, size_t begin, size_t end)
{
    struct cell_run *run = context;
    const struct work_share *share = run->crew;
    bool helps = work_helps(share);
    struct buffer input = {0};
    uint32_t part;
    (void)begin;
    (void)end;
    while (!atomic_load(&run->cancelled) && share->take(share->opaque, &part, helps ? &input : NULL)) {
        do_cell(run, worker, part, helps ? &input : NULL);
        buffer_fini(&input);
    }
}

/* A cell as a helper gets it. */
static enum tetlod_status pack_input(void *opaque, uint32_t part, struct buffer *out, struct tetlod_error *error)
{
    const struct cell_run *run = opaque;
    struct cell cell = {0};
    if (run->root)
        return cell_pack_start(&(struct cell){.piece = run->state, .tets = run->state.mesh.tet_count}, out, error);
    enum tetlod_status status = cut_cell(run, &cell, number_of(run, part), run->numbers[pool_size(run->pool)]);
    if (status == TETLOD_OK)
        status = cell_pack_start(&cell, out, error);
    else
        tetlodi_fail(error, status, "%s", cell.error.message);
    cell_fini(&cell);
    return status;
}

/* What the cells of this program have come to. */
static enum tetlod_status first_failure(const struct cell_run *run)
{
    if (atomic_load(&run->cancelled))
        return tetlodi_fail(run->error, TETLOD_ERR_CANCELLED, "cancelled");
    for (uint32_t i = 0; i < run->cell_count; i++)
        if (run->cells[i].status != TETLOD_OK) {
            if (run->error)
                *run->error = run->cells[i].error;
            return run->cells[i].status;
        }
    return TETLOD_OK;
}

/* What the logs of a cell that another program has contracted have come to. */
static enum tetlod_status fetch_head(const struct cell_run *run, struct cell *cell, uint32_t number)
{
    enum tetlod_status status = TETLOD_ERR_IO;
    bool more = true;
    for (size_t enough = HEAD_BYTES, size; status == TETLOD_ERR_IO && more; enough *= 16) {
        unsigned char *bytes;
        cell_fini(cell);
        TETLOD_TRY(run->store.get(run->store.opaque, number, enough, &bytes, &size, run->error));
        status = cell_unpack_head(cell, bytes, size, run->error);
        more = size >= enough;
        free(bytes);
    }
    return status == TETLOD_OK ? check_head(run, cell) : status;
}

static enum tetlod_status fetch_heads(struct cell_run *run)
{
    for (uint32_t i = 0; i < run->cell_count; i++)
        if (!run->cells[i].logs[CELL_GO_ON].mark_count)
            TETLOD_TRY(fetch_head(run, &run->cells[i], i));
    return TETLOD_OK;
}

enum tetlod_status cells_take(void *opaque)
{
    struct cell_run *run = opaque;
    pool_run(run->pool, pool_size(run->pool), 1, contract_taken, run);
    return first_failure(run);
}

static enum tetlod_status share_cells(struct cell_run *run)
{
    run->crew = run->share;
    if (work_has_helpers(run->share))
        TETLOD_TRY(cells_pass(run));
    run->store = (struct cell_store){run->crew->put, run->crew->get, run->crew->opaque}; // also if it fails to begin
    const struct work_input input = {pack_input, run};
    TETLOD_TRY(work_share_run(run->crew, run->cell_count, run->tries ? NULL : run->order, &input, cells_take, run,
                              run->error));
    return fetch_heads(run);
}

void cells_leave_store(struct cell_run *run)
{
    if (run->share && run->store.put)
        run->crew->end(run->crew->opaque);
    else
        cell_spool_free(&run->store);
    run->store = (struct cell_store){0};
}

enum tetlod_status cells_contract(struct cell_run *run, const uint32_t *order, uint32_t count)
{
    run->cells = array_zero(count, sizeof *run->cells);
    if (!run->cells)
        return cells_no_memory(run);
    run->cell_count = count;
    run->order = order;
    atomic_store(&run->done, 0);
    if (run->share)
        return share_cells(run);
    pool_run(run->pool, count, 1, contract_range, run);
    return first_failure(run);
}
