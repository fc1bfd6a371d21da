/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: a mesh. Out: one contraction log of the whole mesh, and which part of it each page has (PROOF.md, 11 and 13).
 *
 *   while more tetrahedra are left than the root is to have:
 *     cut what is left into cells (partition.h); vertices at seams are frozen in their cells
 *     choose the next limit: the next named one; the first by a trial in a few cells
 *     in each cell: catch up to the last limit, where the last seams have waited; then go on to the next one. A cell
 *     that is contracted waits in memory or in a file (cell_store.h)
 *     append what all cells did to the log: first what caught up, which is a level at the last limit, then the rest
 *   the root: what is left as one piece, from the last limit on
 */
#include "src/cells/cell_phases.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/cells/border_help.h"
#include "src/cells/cell_run.h"
#include "src/simplify/ladder.h"
#include "src/util/array.h"

/* The root has at most so many cells' tetrahedra. */
enum { ROOT_CELLS = 5 };

/* From so many tetrahedra on bands are coarse where nothing else is asked for. */
enum { LARGE_TETS = 1 << 22 };

/* In coarse bands, of so many cells' tetrahedra any part of the mesh needs nearly all pages: then cells of LAST_CELL
 * times as many, with fewer seams, and a phase for each named error, leave fewer tetrahedra for the same bytes. */
enum { LAST_CELLS = 20 };
static const double LAST_CELL = 2.2;

/* The first limit is the first named one that leaves no more than LEFT of the tetrahedra of TRIED cells. */
static const double LEFT = 0.93;
enum { TRIED = 3 };

/* A limit that leaves more than this of the tetrahedra makes the next one rise by two names. */
static const double NO_PROGRESS = 0.9;

const char *cells_wrong(const struct simplify_options *options)
{
    return simplify_in_rounds(options)
               ? NULL
               : "it is of the default contraction: without --certify exact, --metric and --contract";
}

void cell_groups_fini(struct cell_groups *groups)
{
    for (uint32_t g = 0; g < groups->count; g++) {
        free(groups->groups[g].tree);
        free(groups->groups[g].ends);
    }
    free(groups->groups);
    *groups = (struct cell_groups){0};
}

/* What cells are ordered by: their size; or, where they are cut out of files, how near the front they begin: what is
 * read for one is there for its neighbours. */
static uint32_t rank_of(const struct cell_run *run, uint32_t cell)
{
    const struct partition *partition = &run->partition;
    uint32_t begin = partition->begins[cell];
    return run->spools ? UINT32_MAX - partition->tets[begin] : partition->begins[cell + 1] - begin;
}

/* The largest first: what is begun last ends soon. */
static uint32_t *order_cells(const struct cell_run *run)
{
    uint32_t cells = run->partition.cells, *order = array_new(cells, sizeof *order);
    for (uint32_t i = 0; i < cells && order; i++) {
        uint32_t at = i;
        for (; at > 0 && rank_of(run, order[at - 1]) < rank_of(run, i); at--)
            order[at] = order[at - 1];
        order[at] = i;
    }
    return order;
}

/* ---- the next limit */

/* The limit that a mark has come to. */
static double limit_of_mark(const struct cell_run *run, const struct contraction_log *log, uint32_t mark)
{
    double limit = 0;
    for (uint32_t c = 0; c < log->component_count; c++) {
        double weight = 1;
        for (uint32_t i = 0; i < run->whole.controlled_count && run->whole.limits; i++)
            weight = run->whole.controlled[i] == log->components[c].field ? run->whole.limits[i] : weight;
        limit = fmax(limit, log->certified[(size_t)mark * log->component_count + c] / weight);
    }
    return limit;
}

/* What the cells that were tried leave at a limit, of all that they had. */
static double left_at(const struct cell_run *run, double limit)
{
    double before = 0, left = 0;
    for (uint32_t i = 0; i < run->cell_count; i++) {
        const struct contraction_log *log = &run->cells[i].logs[CELL_GO_ON];
        uint32_t mark = 0;
        while (mark + 1 < log->mark_count && limit_of_mark(run, log, mark + 1) <= limit * (1 + 1e-6))
            mark++;
        before += run->cells[i].tets;
        left += log->marks[mark].tets;
    }
    return left / before;
}

static double limit_after(const struct cell_run *run, double limit)
{
    bool named;
    return next_limit(limit, run->options->max_error, run->fine ? 0 : INFINITY, &named);
}

/* The first limit, by a trial: what is below it leaves nearly all. */
static enum tetlod_status try_limits(struct cell_run *run)
{
    uint32_t cells = run->partition.cells, count = cells < TRIED ? cells : TRIED, tried[TRIED];
    for (uint32_t i = 0; i < count; i++)
        tried[i] = (uint32_t)((2 * (uint64_t)i + 1) * cells / (2 * (uint64_t)count));
    run->tries = true;
    enum tetlod_status status = cells_contract(run, tried, count);
    run->tries = false;
    cells_leave_store(run);
    run->to = FIRST_LIMIT;
    while (status == TETLOD_OK && run->to < run->options->max_error && left_at(run, run->to) > LEFT)
        run->to = limit_after(run, run->to);
    cells_free(run);
    return status;
}

/* Is so little left that any part of the mesh needs nearly all pages? */
static bool is_last(const struct cell_run *run)
{
    return run->coarse && run->from > 0 && run->state.mesh.tet_count <= (uint64_t)run->cell_tets * LAST_CELLS;
}

/* Every error that a band may end at becomes a level. Where few tetrahedra go from one to the next, one is left out. */
static enum tetlod_status choose_limit(struct cell_run *run)
{
    if (!(run->from > 0))
        TETLOD_TRY(try_limits(run));
    else
        run->to = limit_after(run, run->from);
    if (run->from > 0 && run->coarse && !is_last(run))
        run->to = limit_after(run, run->to);
    if (run->from > 0 && run->left > NO_PROGRESS)
        run->to = limit_after(run, run->to);
    run->to = fmin(run->to, run->options->max_error);
    return TETLOD_OK;
}

/* ---- the log */

/* A cell's node of a stage as a node of the whole log. */
static uint32_t node_of(const struct cell_run *run, const struct cell *cell, enum cell_stage stage, uint32_t node)
{
    uint32_t vertices = cell->logs[stage].vertex_count;
    if (node >= vertices)
        return run->mesh->vertex_count + cell->firsts[stage] + (node - vertices);
    if (stage == CELL_GO_ON && cell->nodes)
        return node_of(run, cell, CELL_CATCH_UP, cell->nodes[node]);
    return run->nodes[cell->vertices ? cell->vertices[node] : node];
}

/* Copies records of a cell's stage into the whole log, from its record `first` on. */
static void copy_records(const struct cell_run *run, const struct cell *cell, enum cell_stage stage, uint32_t begin,
                         uint32_t end, size_t first)
{
    const struct contraction_log *from = &cell->logs[stage];
    struct contraction_log *log = run->log;
    size_t count = end - begin;
    if (!count) // then the log may have no arrays
        return;
    for (size_t i = 0; i < 4 * count; i++) {
        uint32_t child = from->children[4 * (size_t)begin + i];
        log->children[4 * first + i] = child == TETLOD_NONE ? child : node_of(run, cell, stage, child);
    }
    memcpy(log->positions + 3 * first, from->positions + 3 * (size_t)begin, 3 * count * sizeof(double));
    for (uint32_t f = 0; f < log->field_count; f++) {
        size_t k = log->fields[f].components;
        memcpy(log->fields[f].values + first * k, from->fields[f].values + begin * k, count * k * sizeof(double));
    }
    for (uint32_t c = 0; c < log->component_count && log->components[c].bounds; c++)
        memcpy(log->components[c].bounds + first, from->components[c].bounds + begin, count * sizeof(double));
}

static void add_refusals(const struct cell_run *run, const struct contraction_log *from)
{
    for (int r = 0; r < LOG_REFUSALS; r++)
        run->log->refused[r] += from->refused[r];
}

/* The greatest errors of all cells at the end of a stage. */
static void raise_state(struct piece_state *state, const struct contraction_log *log)
{
    size_t last = log->mark_count - (size_t)1, k = log->component_count;
    for (size_t c = 0; c < k; c++) {
        state->certified[c] = fmax(state->certified[c], log->certified[last * k + c]);
        state->predicted[c] = fmax(state->predicted[c], log->predicted[last * k + c]);
    }
    state->moved = fmax(state->moved, log->marks[last].moved);
}

static bool add_group(const struct cell_run *run, uint32_t *ends)
{
    struct cell_groups *groups = run->groups;
    struct tetlodi_write_group *grown = array_resize(groups->groups, groups->count + (size_t)1, sizeof *grown);
    groups->groups = grown ? grown : groups->groups;
    struct tetlodi_cut *tree = array_new(run->partition.nodes, sizeof *tree);
    if (!grown || !tree) {
        free(tree);
        free(ends);
        return false;
    }
    memcpy(tree, run->partition.tree, run->partition.nodes * sizeof *tree);
    grown[groups->count++] = (struct tetlodi_write_group){
        .tree = tree, .nodes = run->partition.nodes, .pages = run->partition.cells, .ends = ends};
    return true;
}

/* Room in the log for what all cells did in a stage: a group of pages. */
static enum tetlod_status append_stage(struct cell_run *run, enum cell_stage stage)
{
    struct contraction_log *log = run->log;
    uint32_t before = log->count, tets = 0;
    uint32_t *ends = array_new(run->cell_count, sizeof *ends);
    if (!ends)
        return cells_no_memory(run);
    for (uint32_t i = 0; i < run->cell_count; i++) {
        struct cell *cell = &run->cells[i];
        const struct contraction_log *from = &cell->logs[stage];
        if (from->count > log->vertex_count - log->count) {
            free(ends);
            return cells_check(run, false);
        }
        cell->firsts[stage] = log_extend(log, from->count);
        add_refusals(run, from);
        raise_state(&run->state.state, from);
        tets += from->marks[from->mark_count - 1].tets;
        ends[i] = log->count;
    }
    if (log->count == before) {
        free(ends);
        return TETLOD_OK;
    }
    const struct piece_state *state = &run->state.state;
    if (!add_group(run, ends))
        return cells_no_memory(run);
    return log_mark(log, run->mesh->vertex_count - log->count, tets, state->moved, state->certified, state->predicted,
                    run->error);
}

/* ---- what is left */

/* A vertex of the state that a cell's piece was cut from, which is still there: of a frozen one. */
static uint32_t vertex_of(const struct cell *cell, uint32_t node)
{
    return cell->vertices[cell->nodes ? cell->nodes[node] : node];
}

/* Joins the vertices of a cell: those at seams once. numbers[vertex of the piece] are set, joined[vertex of the state]
 * known. False: they are more than there is room for. */
static bool join_vertices(struct cell_run *run, const struct cell *cell, struct piece *out, uint32_t *joined,
                          uint32_t *numbers, uint32_t *io_count, uint32_t *nodes, uint8_t *was_seam)
{
    for (uint32_t v = 0; v < cell->piece.mesh.vertex_count; v++) {
        uint32_t frozen = cell->piece.frozen[v],
                 *known = frozen ? &joined[vertex_of(cell, cell->piece.nodes[v])] : NULL;
        const bool there = known && *known != TETLOD_NONE;
        if (!there && *io_count == out->mesh.vertex_count)
            return false;
        numbers[v] = there ? *known : (*io_count)++;
        if (there)
            continue;
        if (known)
            *known = numbers[v];
        piece_copy_vertex(out, numbers[v], &cell->piece, v);
        out->frozen[numbers[v]] = 0;
        nodes[numbers[v]] = node_of(run, cell, CELL_GO_ON, cell->piece.nodes[v]);
        was_seam[numbers[v]] = frozen != 0;
    }
    return true;
}

static void join_tets(const struct cell *cell, struct piece *out, const uint32_t *numbers, uint32_t *io_count)
{
    for (uint32_t t = 0; t < cell->piece.mesh.tet_count; t++, ++*io_count) {
        for (size_t c = 0; c < 4; c++)
            out->mesh.corners[4 * (size_t)*io_count + c] = numbers[cell->piece.mesh.corners[4 * (size_t)t + c]];
        out->boundary_faces[*io_count] = cell->piece.boundary_faces[t];
    }
}

/* What is left of all cells, as it is joined. */
struct joining {
    struct piece piece;
    uint32_t vertices, tets;     /* so far */
    uint32_t *joined, *numbers;  /* (join_vertices) */
    uint32_t *nodes;             /* [vertex] in the whole log */
    uint8_t *was_seam;
};

/* One cell after the other: its records go into the log, what is left of it to the rest. */
static enum tetlod_status join_cells(struct cell_run *run, struct joining *to)
{
    for (uint32_t i = 0; i < run->cell_count; i++) {
        struct cell *cell = &run->cells[i];
        TETLOD_TRY(cells_bring_back(run, cell, i));
        for (int stage = 0; stage < CELL_STAGES; stage++)
            copy_records(run, cell, stage, 0, cell->logs[stage].count, cell->firsts[stage]);
        TETLOD_TRY(cells_check(run, join_vertices(run, cell, &to->piece, to->joined, to->numbers, &to->vertices,
                                                  to->nodes, to->was_seam)));
        join_tets(cell, &to->piece, to->numbers, &to->tets);
        cell_drop(cell);
    }
    return cells_check(run, to->vertices == to->piece.mesh.vertex_count && to->tets == to->piece.mesh.tet_count);
}

/* The state becomes what is left of all cells. */
static enum tetlod_status join(struct cell_run *run)
{
    uint32_t vertices = run->mesh->vertex_count - run->log->count, before = run->state.mesh.vertex_count;
    uint64_t tets = 0;
    struct joining to = {.joined = array_new(before, sizeof *to.joined),
                         .numbers = array_new(before, sizeof *to.numbers),
                         .nodes = array_new(vertices, sizeof *to.nodes),
                         .was_seam = array_new(vertices, 1)};
    enum tetlod_status status = to.joined && to.numbers && to.nodes && to.was_seam ? TETLOD_OK : cells_no_memory(run);
    for (uint32_t i = 0; i < run->cell_count; i++) {
        const struct contraction_log *log = &run->cells[i].logs[CELL_GO_ON];
        tets += log->marks[log->mark_count - 1].tets;
    }
    if (status == TETLOD_OK)
        status = cells_check(run, tets <= run->state.mesh.tet_count);
    if (status == TETLOD_OK)
        status = piece_new(&to.piece, &run->state, vertices, (uint32_t)tets, run->error);
    if (status == TETLOD_OK) {
        memset(to.joined, 0xff, before * sizeof *to.joined);
        status = join_cells(run, &to);
    }
    free(to.joined);
    free(to.numbers);
    if (status != TETLOD_OK) {
        piece_fini(&to.piece);
        free(to.nodes);
        free(to.was_seam);
        return status;
    }
    piece_fini(&run->state);
    free(run->nodes);
    free(run->was_seam);
    run->state = to.piece;
    run->nodes = to.nodes;
    run->was_seam = to.was_seam;
    return TETLOD_OK;
}

/* ---- phases */

/* The whole log's components are those of any cell's, and its first mark is the mesh as it was. */
static enum tetlod_status take_components(const struct cell_run *run, const struct contraction_log *from)
{
    if (run->log->component_count)
        return TETLOD_OK;
    TETLOD_TRY(log_control(run->log, from->components, from->component_count, run->error));
    for (uint32_t c = 0; c < run->log->component_count; c++)
        run->log->components[c].bounds = NULL;
    if (run->options->local_bound)
        TETLOD_TRY(log_keep_bounds(run->log, run->error));
    return log_mark(run->log, run->mesh->vertex_count, run->mesh->tet_count, 0, from->certified, from->predicted,
                    run->error);
}

/* Cells of what is left. */
static enum tetlod_status cut_state(struct cell_run *run)
{
    const uint32_t cell_tets = is_last(run) ? (uint32_t)(LAST_CELL * run->cell_tets) : run->cell_tets;
    return partition_make(&run->partition, &run->state.mesh, cell_tets, run->was_seam, run->pool, run->error);
}

static enum tetlod_status run_phase(struct cell_run *run)
{
    uint32_t *order = NULL;
    enum tetlod_status status;
    TETLOD_TRY_DONE(cells_make_scratch(run));
    if (!run->partition.cells)
        TETLOD_TRY_DONE(cut_state(run));
    TETLOD_TRY_DONE(choose_limit(run));
    order = order_cells(run);
    if (!order)
        TETLOD_TRY_DONE(cells_no_memory(run));
    if (run->spools && !run->share)
        TETLOD_TRY_DONE(cell_spool_new(&run->store, run->partition.cells, run->error));
    TETLOD_TRY_DONE(cells_contract(run, order, run->partition.cells));
    TETLOD_TRY_DONE(take_components(run, &run->cells[0].logs[CELL_GO_ON]));
    if (run->from > 0)
        TETLOD_TRY_DONE(append_stage(run, CELL_CATCH_UP));
    TETLOD_TRY_DONE(append_stage(run, CELL_GO_ON));
    TETLOD_TRY_DONE(join(run));
    run->from = run->to;
done:
    free(order);
    cells_free(run);
    cells_leave_store(run);
    partition_fini(&run->partition);
    return status;
}

struct root_progress {
    const struct cell_run *run;
    double begun;
};

static bool report_root(void *opaque, double done)
{
    const struct root_progress *progress = opaque;
    const struct simplify_options *options = progress->run->options;
    return options->progress(options->progress_opaque, progress->begun + (1 - progress->begun) * done);
}

/* The root's log for the others, with what is left, which is not much. */
static enum tetlod_status give_root(const struct cell_run *run, const struct cell *root)
{
    struct cell whole = *root;
    struct buffer bytes = {0};
    whole.piece = run->state;
    enum tetlod_status status = cell_pack(&whole, &bytes, run->error);
    if (status == TETLOD_OK)
        status = run->share->put(run->share->opaque, 0, bytes.bytes, bytes.size, run->error);
    buffer_fini(&bytes);
    return status;
}

/* What one of the programs does for all. */
struct root_work {
    struct cell_run *run;
    struct cell *root;
    const struct simplify_options *options;
};

static enum tetlod_status take_root(void *opaque)
{
    const struct root_work *work = opaque;
    const struct work_share *share = work->run->share;
    uint32_t part;
    if (!share->take(share->opaque, &part, NULL))
        return TETLOD_OK;
    TETLOD_TRY(cells_contract_rest(work->run, work->root, &work->run->state, work->options, work->run->error));
    return give_root(work->run, work->root);
}

/* One of the programs contracts the root, and the others get what it has done. */
static enum tetlod_status share_root(struct cell_run *run, struct cell *root, const struct simplify_options *options)
{
    const struct work_share *share = run->share;
    struct root_work work = {run, root, options};
    run->store = (struct cell_store){share->put, share->get, share->opaque};
    enum tetlod_status status = work_share_run(share, 1, NULL, NULL, take_root, &work, run->error);
    if (status == TETLOD_OK && !root->logs[CELL_GO_ON].mark_count)
        status = cells_bring_back(run, root, 0);
    cells_leave_store(run);
    return status;
}

/* A helper contracts the root, where the one that leads has enough to do. */
static enum tetlod_status pass_root(struct cell_run *run, struct cell *root)
{
    const uint32_t order = 0;
    enum tetlod_status status = cells_contract(run, &order, 1);
    if (status == TETLOD_OK)
        status = cells_bring_back(run, root, 0);
    cells_leave_store(run);
    cells_free(run);
    return status;
}

static enum tetlod_status contract_as_one(struct cell_run *run, struct cell *root,
                                          const struct simplify_options *options)
{
    if (run->share && run->share->keeps_parts)
        return share_root(run, root, options);
    if (run->share && run->share->serves)
        return pass_root(run, root);
    return cells_contract_rest(run, root, &run->state, options, run->error);
}

/* What is left, as one piece: its levels are those of a stream without pages. */
static enum tetlod_status contract_root(struct cell_run *run)
{
    struct simplify_options options = *run->options;
    struct root_progress progress = {run, (double)run->log->count / run->mesh->vertex_count};
    struct cell root = {.firsts = {run->log->count, run->log->count}};
    struct contraction_log *log = &root.logs[CELL_GO_ON];
    if (options.progress) {
        options.progress = report_root;
        options.progress_opaque = &progress;
    }
    if (run->state.fresh)
        TETLOD_TRY(piece_own(&run->state, run->error));
    run->root = true;
    enum tetlod_status status = contract_as_one(run, &root, &options);
    if (status == TETLOD_OK)
        status = take_components(run, log);
    for (uint32_t mark = 1; status == TETLOD_OK && mark < log->mark_count; mark++) {
        const struct log_mark *at = &log->marks[mark];
        size_t row = (size_t)mark * log->component_count;
        uint32_t count = at->contractions - at[-1].contractions;
        copy_records(run, &root, CELL_GO_ON, at[-1].contractions, at->contractions, log_extend(run->log, count));
        status = log_mark(run->log, at->vertices, at->tets, at->moved, log->certified + row, log->predicted + row,
                          run->error);
    }
    add_refusals(run, log);
    cell_fini(&root);
    return status;
}

/* Is there another phase? Until few tetrahedra are left, or the greatest error leaves them. */
static bool goes_on(const struct cell_run *run)
{
    uint32_t root = run->cell_tets * ROOT_CELLS, min = run->options->min_tets;
    root = min > root / 4 ? (min < UINT32_MAX / 4 ? 4 * min : UINT32_MAX) : root;
    return run->state.mesh.tet_count > root && (run->from < run->options->max_error || run->left < NO_PROGRESS);
}

static enum tetlod_status run_phases(struct cell_run *run)
{
    while (goes_on(run)) {
        double before = run->state.mesh.tet_count;
        TETLOD_TRY(run_phase(run));
        run->left = run->state.mesh.tet_count / before;
    }
    return contract_root(run);
}

static enum tetlod_status cut_first(void *opaque)
{
    return goes_on(opaque) ? cut_state(opaque) : TETLOD_OK;
}

/* The border; where a helper finds it the first cells are cut meanwhile. */
static enum tetlod_status find_border(struct cell_run *run)
{
    const struct tetmesh *mesh = &run->state.mesh;
    const struct border_meanwhile meanwhile = {cut_first, run};
    const bool turned = run->whole.ranges.turned;
    struct piece_border border = {0};
    enum tetlod_status status =
        work_has_lasting_helpers(run->share)
            ? border_share(run->share, &border, mesh, turned, run->options, &meanwhile, run->error)
            : piece_border_find(&border, mesh, turned, run->options, run->error);
    if (status == TETLOD_OK)
        status = piece_take_border(&run->state, &run->whole, &border, run->options, run->error);
    piece_border_fini(&border);
    return status;
}

static enum tetlod_status begin(struct cell_run *run, const uint32_t *controlled, uint32_t controlled_count,
                                const double *limits)
{
    const struct simplify_options *options = run->options;
    run->pool = pool_new(options->threads ? options->threads : parallel_cores());
    run->numbers = run->pool ? array_zero(pool_size(run->pool) + (size_t)1, sizeof *run->numbers) : NULL;
    run->nodes = array_new(run->mesh->vertex_count, sizeof *run->nodes);
    if (!run->pool || !run->numbers || !run->nodes)
        return cells_no_memory(run);
    for (uint32_t v = 0; v < run->mesh->vertex_count; v++)
        run->nodes[v] = v;
    TETLOD_TRY(log_init(run->log, run->mesh, run->error));
    TETLOD_TRY(piece_begin(&run->state, &run->whole, run->mesh, controlled, controlled_count, limits, run->error));
    TETLOD_TRY(find_border(run));
    run->log->degenerate_tets = run->whole.degenerate_tets;
    run->log->inverted_tets = run->whole.inverted_tets;
    run->log->folded_tets = run->whole.folded_tets;
    return TETLOD_OK;
}

enum tetlod_status cells_simplify(struct contraction_log *out, struct cell_groups *groups, const struct tetmesh *mesh,
                                  const uint32_t *controlled, uint32_t controlled_count, const double *limits,
                                  const struct cell_choice *choice, const struct simplify_options *options,
                                  struct tetlod_error *error)
{
    uint32_t cell_tets = choice->tets;
    struct cell_run run = {.mesh = mesh,
                      .options = options,
                      .cell_tets = cell_tets,
                      .fine = choice->bands == BANDS_FINE,
                      .coarse = choice->bands == BANDS_COARSE ||
                                (choice->bands == BANDS_BY_SIZE && mesh->tet_count >= LARGE_TETS),
                      .spools = choice->spools,
                      .share = choice->share,
                      .crew = choice->share,
                      .log = out,
                      .groups = groups,
                      .error = error};
    enum tetlod_status status;
    *out = (struct contraction_log){0};
    *groups = (struct cell_groups){0};
    if (mesh->tet_count <= (uint64_t)cell_tets * ROOT_CELLS)
        return simplify(out, mesh, controlled, controlled_count, limits, options, error);
    TETLOD_TRY_DONE(begin(&run, controlled, controlled_count, limits));
    TETLOD_TRY_DONE(run_phases(&run));
    log_finish(out);
done:
    for (unsigned w = 0; run.numbers && w <= pool_size(run.pool); w++)
        free(run.numbers[w]);
    free(run.numbers);
    free(run.nodes);
    free(run.was_seam);
    partition_fini(&run.partition);
    piece_fini(&run.state);
    piece_whole_fini(&run.whole);
    pool_free(run.pool);
    if (status != TETLOD_OK) {
        log_fini(out);
        cell_groups_fini(groups);
    }
    return status;
}
