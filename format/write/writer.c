/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The writer holds the same mesh as a cursor and walks it from the base mesh up, telling the recorder what the
 * contraction forest says. A tetrahedron comes back with the split of the last of the nodes in which its corners meet.
 */
#include "format/write/writer.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/coding/base.h"
#include "format/coding/index.h"
#include "format/coding/order.h"
#include "format/coding/record_fields.h"
#include "format/coding/tail.h"
#include "format/common/allowance.h"
#include "format/fail.h"
#include "format/write/cells_write.h"
#include "format/write/container.h"
#include "format/write/lineage.h"
#include "format/write/page_encode.h"
#include "format/write/page_write.h"
#include "format/write/record_write.h"
#include "format/write/stack_write.h"
#include "format/write/write_check.h"

/* The rate of learning that makes the smallest streams from some 1,000 vertices on, or within 1/1000 of them. */
enum { USUAL_SLOWEST = 6 };

struct writer {
    const struct tetlodi_write_input *in;
    struct tetlod_error *error;
    struct lineage lineage;
    struct tetlodi_column *columns; /* positions, then the fields */
    struct tetlodi_memory memory;
    struct tetlodi_replay replay;
    struct tetlodi_record_writer records; /* of the whole mesh */
    struct tetlodi_helpers *helpers;
    struct tetlodi_buffer *stored; /* [level * (1 + field_count)] */
    uint64_t *labels;              /* [level] of the recorder, up to its end */
    uint32_t levels_stored;
    struct tetlodi_buffer order;
    struct tetlodi_cell_parts cells;
    struct tetlodi_page_writer pages;
    struct tetlodi_stacks stacks; /* if pages are shared out */
    struct tetlodi_index index;
    bool writes;          /* there is a sink */
    double begun, share; /* of all the work: what was done before this pass, and what this pass is */
    uint32_t until_asked; /* records that are coded before the caller is asked again */
};

enum { RECORDS_UNASKED = 256 };

static enum tetlod_status out_of_memory(struct writer *w)
{
    return tetlodi_fail_nomem(w->error, "the stream", (uint64_t)w->in->tets * 64);
}

/* ---- numbers */

/* What says the numbers of all nodes: those of records are of the root alone if pages are shared out. */
static struct tetlodi_record_writer numbers(struct writer *w)
{
    return (struct tetlodi_record_writer){.in = w->in, .replay = &w->replay};
}

/* Has every number of a column a code? */
static enum tetlod_status check_column(struct writer *w, uint32_t c)
{
    const struct tetlodi_record_writer whole = numbers(w);
    const char *name = c ? w->in->fields[c - 1].name : "positions";
    for (uint32_t node = 0; node < w->in->vertices + w->in->contractions; node++)
        for (size_t k = 0; k < w->columns[c].components; k++) {
            double value = tetlodi_node_value(&whole, c, node, k);
            double back = scale_value(&w->columns[c].scale, c ? 0 : (unsigned)k, tetlodi_node_code(&whole, c, node, k));
            bool same = memcmp(&back, &value, sizeof value) == 0;
            if (!isfinite(value) || (!tetlodi_node_is_rounded(&whole, c, node) && !same))
                return tetlodi_fail(w->error, TETLOD_ERR_ARGUMENT, "%s: %.17g is not a number of its type", name,
                                    value);
        }
    return TETLOD_OK;
}

/* ---- base mesh */

struct base {
    struct tetlodi_base_guide guide;
    uint32_t *corners, *roots, *tets, *vertex_order, *tet_order, *arrival;
};

/* The tetrahedra that are always there and the roots of the forest, in any numbering. */
static enum tetlod_status gather_base(struct writer *w, struct base *base)
{
    const struct tetlodi_write_input *in = w->records.in;
    uint32_t vertices = 0, tets = 0;
    for (uint32_t t = 0; t < in->tets; t++)
        tets += w->lineage.waiting[t] == 0;
    for (uint32_t node = 0; node < w->lineage.nodes; node++)
        vertices += w->lineage.parent[node] == TETLOD_NONE;
    base->corners = malloc((4 * (size_t)tets + 1) * sizeof *base->corners);
    base->tets = malloc((tets + (size_t)1) * sizeof *base->tets);
    base->tet_order = malloc((tets + (size_t)1) * sizeof *base->tet_order);
    base->roots = malloc(vertices * sizeof *base->roots);
    base->vertex_order = malloc(vertices * sizeof *base->vertex_order);
    base->arrival = malloc(vertices * sizeof *base->arrival);
    if (!base->corners || !base->tets || !base->tet_order || !base->roots || !base->vertex_order || !base->arrival)
        return out_of_memory(w);
    vertices = tets = 0;
    for (uint32_t v = 0; v < in->vertices; v++)
        w->records.slot_at[v] = TETLOD_NONE;
    for (uint32_t v = 0; v < in->vertices; v++)
        if (w->records.slot_at[w->lineage.position[v]] == TETLOD_NONE) {
            base->roots[vertices] = lineage_root(&w->lineage, v);
            tetlodi_settle_node(&w->records, base->roots[vertices], vertices);
            vertices++;
        }
    for (uint32_t t = 0; t < in->tets; t++) {
        if (w->lineage.waiting[t])
            continue;
        for (int c = 0; c < 4; c++)
            base->corners[4 * (size_t)tets + (size_t)c] = tetlodi_slot_of(&w->records, t, c);
        base->tets[tets++] = t;
    }
    base->guide = (struct tetlodi_base_guide){vertices, tets, base->corners, base->vertex_order, base->tet_order,
                                              base->arrival};
    return TETLOD_OK;
}

/* Components whose codes are those of an earlier one in all nodes. */
static void find_copies(struct writer *w, uint32_t column, uint8_t *copied)
{
    const struct tetlodi_record_writer whole = numbers(w);
    const uint32_t nodes = w->in->vertices + w->in->contractions;
    size_t n = w->columns[column].components;
    for (size_t c = 1; c < n; c++)
        for (size_t source = 0; source < c && copied[c] == c; source++) {
            uint32_t node = 0;
            while (node < nodes && tetlodi_node_code(&whole, column, node, c) ==
                                       tetlodi_node_code(&whole, column, node, source))
                node++;
            copied[c] = (uint8_t)(node == nodes ? source : c);
        }
}

/* Room for all that is to come. Values of fields predict those of the base mesh alone. */
static bool make_room(struct writer *w, size_t base_vertices)
{
    const struct tetlodi_write_input *in = w->records.in;
    bool room = tetlodi_replay_room(&w->replay, in->vertices, in->tets);
    for (uint32_t c = 0; c < w->replay.column_count && room; c++) {
        struct tetlodi_column *column = &w->columns[c];
        room = tetlodi_column_room(column, &w->memory, c ? base_vertices : in->vertices, 1) &&
               TETLODI_ROOM(&w->memory, column->codes, column->codes_capacity,
                            (size_t)in->vertices * column->components);
    }
    return room;
}

static enum tetlod_status code_base(struct writer *w, struct base *base)
{
    struct tetlodi_recorder *recorder = &w->records.recorder;
    TETLOD_TRY(gather_base(w, base));
    if (!make_room(w, base->guide.vertices))
        return tetlodi_no_room(&w->memory, w->error);
    TETLOD_TRY(tetlodi_base_connectivity(recorder, base->guide.vertices, base->guide.tets, &base->guide, w->error));
    for (uint32_t v = 0; v < base->guide.vertices; v++) {
        uint32_t root = base->roots[base->vertex_order[v]];
        tetlodi_settle_node(&w->records, root, v);
        tetlodi_set_codes(&w->records, v, root);
    }
    for (uint32_t t = 0; t < base->guide.tets; t++)
        tetlodi_settle_tet(&w->records, t, base->tets[base->tet_order[t]], w->replay.corners + 4 * (size_t)t);
    TETLOD_TRY(tetlodi_base_column(&w->replay, w->columns, recorder->coders, recorder->models->corner, NULL, w->error));
    for (uint32_t c = 1; c < w->replay.column_count; c++) {
        struct tetlodi_field_models *models = &recorder->field_models[c - 1];
        find_copies(w, c, models->copied);
        tetlodi_copies_code(&recorder->coders[c], models, w->columns[c].components);
        TETLOD_TRY(tetlodi_base_column(&w->replay, &w->columns[c], &recorder->coders[c], &models->corner,
                                       models->copied,
                                       w->error));
        TETLODI_FREE(&w->memory, w->columns[c].values, w->columns[c].values_capacity);
    }
    return tetlodi_replay_base(&w->replay) ? TETLOD_OK : tetlodi_no_room(&w->memory, w->error);
}

/* ---- levels */

/* Zero bytes change nothing: a reader wants so many of them as go with what it has to make room for, and to do. */
static bool goes_with(const struct writer *w, uint32_t level, uint32_t part, uint64_t bytes)
{
    return is_within(tetlodi_part_numbers(&w->index, level, part), NUMBERS_FREE, NUMBERS_PER_BYTE, bytes) &&
           tetlodi_labels_hold(&w->records.recorder, w->labels[level], part, bytes) &&
           (part || tetlodi_pages_hold(w->pages.table.page_count, bytes));
}

/* Where a level's frames go. */
static struct tetlodi_buffer *frames_of(const struct writer *w, uint32_t level)
{
    return w->stored + (size_t)level * (w->in->field_count + 1);
}

/* The group that a level is, or NULL. */
static const struct tetlodi_write_group *group_of(const struct writer *w, uint32_t level)
{
    uint32_t first = w->in->level_count - tetlodi_has_tail(w->in) - w->in->group_count;
    return level >= first && level - first < w->in->group_count ? &w->in->groups[level - first] : NULL;
}

/* Keeps what a level is that is planned. */
static void count_level(struct writer *w, uint32_t level)
{
    w->index.levels[level].vertices = w->replay.vertices;
    w->index.levels[level].tets = w->replay.tets;
    w->labels[level] = w->records.recorder.labels;
}

static enum tetlod_status store_level(struct writer *w, uint32_t level)
{
    uint32_t parts = w->in->field_count + 1;
    for (uint32_t part = 0; part < parts; part++) {
        struct tetlodi_buffer *stored = &frames_of(w, level)[part];
        while (!stored->failed && !goes_with(w, level, part, w->columns[part].frame_bytes + stored->size))
            tetlodi_put(stored, 0, 1);
        if (stored->failed)
            return out_of_memory(w);
        w->columns[part].frame_bytes += stored->size;
        w->index.frames[(size_t)level * parts + part] =
            group_of(w, level) ? (struct tetlodi_frame){.size = stored->size} // pages have digests of their own
                               : tetlodi_frame_of(stored->bytes, stored->size);
    }
    return TETLOD_OK;
}

/* Keeps the frames of all levels up to this one. */
static enum tetlod_status store_levels(struct writer *w, uint32_t level)
{
    TETLOD_TRY(tetlodi_write_rest(&w->records, w->error));
    while (w->levels_stored <= level)
        TETLOD_TRY(store_level(w, w->levels_stored++));
    return TETLOD_OK;
}

/* Asks the caller whether to go on. */
static enum tetlod_status ask(struct writer *w)
{
    const struct tetlodi_write_input *in = w->in;
    double done = w->begun + w->share * w->replay.vertices / in->vertices;
    w->until_asked = RECORDS_UNASKED;
    return !in->progress || in->progress(in->progress_opaque, done)
               ? TETLOD_OK
               : tetlodi_fail(w->error, TETLOD_ERR_CANCELLED, "cancelled");
}

/* The records of a level, up to so many vertices. */
static enum tetlod_status write_records(struct writer *w, uint32_t vertices, uint32_t contractions)
{
    while (w->replay.vertices < vertices) {
        uint32_t before = w->replay.vertices;
        TETLOD_TRY(tetlodi_write_vertex(&w->records, contractions, w->error));
        if (w->replay.vertices > before && !w->until_asked--)
            TETLOD_TRY(ask(w));
    }
    return TETLOD_OK;
}

static enum tetlod_status ask_behind_page(void *opaque)
{
    return ask(opaque);
}

/* A level in pages, each with models of its own. */
static enum tetlod_status write_group(struct writer *w, uint32_t level, const struct tetlodi_write_group *group)
{
    struct tetlodi_buffer *frames = frames_of(w, level);
    const struct tetlodi_page_encode encode = {.whole = &w->records,
                                               .pages = &w->pages,
                                               .group = group,
                                               .contractions = w->in->levels[level].contractions,
                                               .ends = !w->in->levels[level].contractions,
                                               .keeps_tets = w->in->cell_field_count || w->in->keep_order,
                                               .slowest = w->index.slowest,
                                               .frames = frames,
                                               .helpers = w->helpers,
                                               .ask = ask_behind_page,
                                               .opaque = w};
    TETLOD_TRY(store_levels(w, level - 1));
    if (!tetlodi_page_writer_begin(&w->pages, w->helpers, &w->replay, group, level))
        return out_of_memory(w);
    TETLODI_FREE(&w->memory, w->replay.pool, w->replay.pool_capacity); // the stars of pages are their own
    TETLOD_TRY(tetlodi_encode_pages(&encode, w->error));
    count_level(w, level);
    TETLOD_TRY(store_levels(w, level));
    tetlodi_page_writer_end(&w->pages, frames);
    return TETLOD_OK;
}

/* The records of what is in memory are no more those of the root. */
static enum tetlod_status end_root(struct writer *w)
{
    TETLOD_TRY(tetlodi_stacks_begin(&w->stacks, &w->records));
    tetlodi_lineage_fini(&w->lineage);
    tetlodi_replay_drop(&w->replay);
    w->records.in = w->in;
    return TETLOD_OK;
}

/* What the levels have come to, as if they had been coded here: as far as anybody asks for it. */
static enum tetlod_status take_order(struct writer *w)
{
    const struct tetlodi_record_writer whole = numbers(w);
    tetlodi_stacks_order(&w->stacks, &w->records);
    for (uint32_t c = 1; c < w->replay.column_count; c++) {
        struct tetlodi_column *column = &w->columns[c];
        size_t n = column->components, count = w->in->vertices * n;
        if (!w->in->fields[c - 1].exact)
            continue;
        if (!TETLODI_ROOM(&w->memory, column->codes, column->codes_capacity, count))
            return out_of_memory(w);
        for (size_t i = 0; i < count; i++)
            column->codes[i] = tetlodi_node_code(&whole, c, w->records.node_at[i / n], i % n);
    }
    return TETLOD_OK;
}

/* A level in pages that others code as well. */
static enum tetlod_status share_group(struct writer *w, uint32_t level)
{
    struct tetlodi_buffer *frames = frames_of(w, level);
    TETLOD_TRY(store_levels(w, level - 1));
    if (!w->stacks.node_at)
        TETLOD_TRY(end_root(w));
    TETLOD_TRY(tetlodi_stacks_level(&w->stacks, level, frames, &w->records.recorder.labels));
    w->replay.vertices = w->stacks.vertices;
    w->replay.tets = w->stacks.tets;
    count_level(w, level);
    TETLOD_TRY(store_levels(w, level));
    tetlodi_page_writer_end(&w->pages, frames);
    TETLOD_TRY(ask(w));
    return w->in->levels[level].contractions || !tetlodi_stacks_keep_order(&w->stacks) ? TETLOD_OK : take_order(w);
}

static enum tetlod_status write_level(struct writer *w, uint32_t level)
{
    const struct tetlodi_write_input *in = w->records.in;
    if (group_of(w, level) && w->in->share)
        return share_group(w, level);
    uint32_t contractions = in->levels[level].contractions;
    uint32_t vertices = w->replay.vertices;
    for (uint32_t c = contractions; c < in->levels[level - 1].contractions; c++)
        vertices += lineage_child_count(&w->lineage, in->vertices + c) - 1;
    tetlodi_lineage_trim(&w->lineage, in->levels[level - 1].contractions);
    tetlodi_level_begin(&w->records.recorder, vertices, in->tets);
    if (group_of(w, level))
        return write_group(w, level, group_of(w, level));
    TETLOD_TRY(write_records(w, vertices, contractions));
    count_level(w, level);
    return tetlodi_write_batch(&w->records, frames_of(w, level), w->error);
}

/* The exact values of a field, in the finest level's order. */
static enum tetlod_status code_tail(struct writer *w, uint32_t field)
{
    const struct tetlodi_write_field *in = &w->in->fields[field];
    size_t n = in->components;
    double *exact = malloc((size_t)w->in->vertices * n * sizeof *exact);
    if (!exact)
        return out_of_memory(w);
    for (uint32_t v = 0; v < w->in->vertices; v++)
        memcpy(exact + v * n, in->exact + w->records.node_at[v] * n, n * sizeof *exact);
    enum tetlod_status status = tetlodi_tail_code(&w->records.recorder.coders[1 + field], &w->columns[1 + field],
                                                  w->in->vertices, exact, w->error);
    free(exact);
    return status;
}

static enum tetlod_status write_tail(struct writer *w, uint32_t level)
{
    TETLOD_TRY(store_levels(w, level - 1));
    w->index.tail = 1;
    tetlodi_lineage_fini(&w->lineage); // no record is left, and memory is at its peak here
    tetlodi_replay_drop(&w->replay);
    for (uint32_t f = 0; f < w->in->field_count; f++)
        if (w->in->fields[f].exact) {
            TETLOD_TRY(code_tail(w, f));
            TETLOD_TRY(ask(w));
        }
    count_level(w, level);
    return tetlodi_end_frames(&w->records, frames_of(w, level), w->error);
}

static enum tetlod_status write_levels(struct writer *w)
{
    struct base base = {0};
    tetlodi_start_coders(&w->records, w->index.slowest);
    enum tetlod_status status = code_base(w, &base);
    free(base.corners);
    free(base.roots);
    free(base.tets);
    free(base.vertex_order);
    free(base.tet_order);
    free(base.arrival);
    if (status == TETLOD_OK)
        status = tetlodi_end_frames(&w->records, frames_of(w, 0), w->error);
    count_level(w, 0);
    for (uint32_t level = 1; level < w->in->level_count && status == TETLOD_OK; level++)
        status = w->in->levels[level - 1].contractions ? write_level(w, level) : write_tail(w, level);
    return status == TETLOD_OK ? store_levels(w, w->in->level_count - 1) : status;
}

/* ---- order */

static void order_of_corners(const struct writer *w, uint32_t tet, uint8_t out[4])
{
    for (uint8_t k = 0; k < 4; k++)
        out[w->records.places[tet] >> 2 * k & 3] = k;
}

static enum tetlod_status write_order(struct writer *w)
{
    struct tetlodi_order order = {w->in->vertices, w->in->tets, w->records.node_at, w->records.original_of,
                                  malloc(4 * (size_t)w->in->tets)};
    struct tetlodi_coder coder;
    struct tetlodi_encoder encoder = {0};
    if (!order.corners)
        return out_of_memory(w);
    for (uint32_t t = 0; t < order.tet_count; t++)
        order_of_corners(w, t, order.corners + 4 * (size_t)t);
    tetlodi_encode_start(&coder, w->index.slowest, &encoder, &w->memory);
    tetlodi_order_code(&coder, &order);
    tetlodi_encode_finish(&coder);
    tetlodi_put_block(&w->order, encoder.bytes, encoder.size);
    int failed = encoder.failed || w->order.failed;
    TETLODI_FREE(&w->memory, encoder.bytes, encoder.capacity);
    free(order.corners);
    return failed ? out_of_memory(w) : TETLOD_OK;
}

/* ---- the file */

static void fill_info(struct writer *w)
{
    struct tetlod_info *info = &w->index.info;
    const struct tetlodi_write_input *in = w->in;
    info->vertices = in->vertices;
    info->tets = in->tets;
    info->position_type = w->columns[0].scale.original;
    info->lossless = in->position_bits == 0;
    info->degenerate_tets = in->degenerate_tets;
    info->inverted_tets = in->inverted_tets;
    info->unused_points = in->unused_points;
    for (int d = 0; d < 3; d++) {
        info->bounds[0][d] = info->bounds[1][d] = in->positions[d];
        for (size_t v = 1; v < in->vertices; v++) {
            info->bounds[0][d] = fmin(info->bounds[0][d], in->positions[3 * v + (size_t)d]);
            info->bounds[1][d] = fmax(info->bounds[1][d], in->positions[3 * v + (size_t)d]);
        }
    }
    for (uint32_t f = 0; f < in->field_count; f++)
        w->index.fields[f] = (struct tetlod_field){.name = in->fields[f].name,
                                                   .components = in->fields[f].components,
                                                   .type = w->columns[1 + f].scale.original,
                                                   .range = {in->fields[f].range[0], in->fields[f].range[1]},
                                                   .controlled = in->fields[f].controlled,
                                                   // a flag in the index
                                                   .bounds = in->fields[f].local_bound ? f : TETLOD_NONE};
    for (uint32_t f = 0; f < in->field_count; f++)
        info->lossless &= in->fields[f].bits == 0 || in->fields[f].exact;
}

/* Frames ask for no errors. */
static enum tetlod_status fill_errors(struct writer *w)
{
    const struct tetlodi_write_input *in = w->in;
    const size_t row = (size_t)in->field_count * TETLOD_MEASURES;
    if (in->measured)
        TETLOD_TRY(in->measured(in->measured_opaque, w->error));
    for (uint32_t level = 0; level < in->level_count; level++) {
        w->index.levels[level].domain_error = in->levels[level].domain_error;
        memcpy(w->index.errors + level * row, in->levels[level].errors, row * sizeof(double));
    }
    return TETLOD_OK;
}

static enum tetlod_status write_file(struct writer *w, const struct tetlodi_sink *sink)
{
    const struct tetlodi_write_input *in = w->in;
    const struct tetlodi_write_section *late = NULL;
    uint32_t count = 0, late_count = 0;
    const struct tetlodi_late_rows rows = {w->cells.row_count, w->cells.tet_of, w->cells.in_parents};
    TETLOD_TRY(fill_errors(w));
    if (in->late)
        TETLOD_TRY(in->late(in->late_opaque, w->records.node_at, &rows, &late, &late_count, w->error));
    struct tetlodi_write_section *sections =
        calloc(in->section_count + (size_t)late_count + in->cell_field_count + MAX_OWN_SECTIONS, sizeof *sections);
    if (!sections)
        return out_of_memory(w);
    if (*in->metadata)
        sections[count++] = (struct tetlodi_write_section){.tag = TAG_METADATA, .early = 1, .bytes = in->metadata,
                                                           .size = strlen(in->metadata)};
    if (in->keep_order)
        sections[count++] = (struct tetlodi_write_section){.tag = TAG_ORDER, .bytes = w->order.bytes,
                                                           .size = w->order.size};
    count += tetlodi_cells_list(&w->cells, in->cells, sections + count);
    const struct tetlodi_buffer *pages = tetlodi_page_writer_section(&w->pages,
                                                                     (const double(*)[3])w->index.info.bounds);
    w->index.pages = w->pages.table;
    w->pages.table = (struct tetlodi_page_table){0};
    if (pages)
        sections[count++] =
            (struct tetlodi_write_section){TAG_PAGES, .early = 1, .row = tetlodi_page_row(in->field_count),
                                           .bytes = pages->bytes, .size = pages->size};
    for (uint32_t i = 0; i < in->section_count; i++)
        sections[count++] = in->sections[i];
    for (uint32_t i = 0; i < late_count; i++)
        sections[count++] = late[i];
    enum tetlod_status status = pages && pages->failed ? out_of_memory(w) : TETLOD_OK;
    if (status == TETLOD_OK)
        status = tetlodi_container_write(&w->index, w->stored, sections, count, sink, w->error);
    free(sections);
    return status;
}

static enum tetlod_status check_input(const struct writer *w)
{
    const char *wrong = tetlodi_input_wrong(w->in);
    return wrong ? tetlodi_fail(w->error, TETLOD_ERR_ARGUMENT, "the sequence cannot be written: %s", wrong) : TETLOD_OK;
}

static void set_columns(struct writer *w)
{
    tetlodi_set_columns(w->in, w->columns);
    for (uint32_t f = 0; f < w->in->field_count; f++) {
        w->index.fields[f].components = w->columns[1 + f].components;
        w->index.exact_later[f] = w->in->fields[f].exact != NULL;
    }
    for (uint32_t c = 0; c <= w->in->field_count; c++)
        w->index.scales[c] = w->columns[c].scale;
}

/* Records are those of the root. */
static enum tetlod_status cut_root(struct writer *w)
{
    w->stacks = (struct tetlodi_stacks){.whole = numbers(w),
                                        .pages = &w->pages,
                                        .helpers = w->helpers,
                                        .recorder = &w->records.recorder,
                                        .error = w->error,
                                        .slowest = w->index.slowest};
    TETLOD_TRY(tetlodi_stacks_init(&w->stacks));
    w->records.in = &w->stacks.root.in;
    return TETLOD_OK;
}

static enum tetlod_status allocate(struct writer *w, unsigned slowest)
{
    const struct tetlodi_write_input *in = w->in;
    size_t parts = in->field_count + (size_t)1;
    w->memory.most = UINT64_MAX;
    w->records.in = in;
    w->records.lineage = &w->lineage;
    w->records.replay = &w->replay;
    w->columns = calloc(parts, sizeof *w->columns);
    w->helpers = w->records.helpers = tetlodi_helpers_new(in->threads > 1 ? in->threads - 1 : 0);
    w->labels = calloc(in->level_count, sizeof *w->labels);
    w->stored = calloc(parts * in->level_count, sizeof *w->stored);
    w->index.info.field_count = in->field_count;
    w->index.info.level_count = in->level_count;
    w->index.slowest = slowest;
    if (!w->columns || !w->stored || !w->labels || !tetlodi_index_allocate(&w->index))
        return out_of_memory(w);
    set_columns(w);
    tetlodi_replay_init(&w->replay, &w->memory, w->columns, (uint32_t)parts);
    tetlodi_page_writer_init(&w->pages, &w->memory, in->groups, in->group_count, in->field_count);
    if (in->share && in->group_count)
        TETLOD_TRY(cut_root(w));
    w->records.slot_at = malloc(w->records.in->vertices * sizeof *w->records.slot_at);
    return w->records.slot_at ? tetlodi_record_writer_init(&w->records, w->records.in->vertices, w->records.in->tets,
                                                           w->error)
                              : out_of_memory(w);
}

static void release(struct writer *w)
{
    tetlodi_helpers_free(w->helpers); // they may be at work
    for (size_t i = 0; i < (w->in->field_count + (size_t)1) * w->in->level_count && w->stored; i++)
        tetlodi_buffer_fini(&w->stored[i]);
    tetlodi_record_writer_fini(&w->records);
    if (w->replay.memory)
        tetlodi_replay_fini(&w->replay);
    tetlodi_lineage_fini(&w->lineage);
    void *const owned[] = {w->records.slot_at, w->columns, w->stored, w->labels};
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
    tetlodi_cell_parts_fini(&w->cells);
    tetlodi_page_writer_fini(&w->pages);
    tetlodi_stacks_fini(&w->stacks);
    tetlodi_buffer_fini(&w->order);
    tetlodi_index_fini(&w->index);
}

/* All frames and the index, in memory. */
static enum tetlod_status encode(struct writer *w, unsigned slowest)
{
    TETLOD_TRY(check_input(w));
    TETLOD_TRY(allocate(w, slowest));
    TETLOD_TRY(tetlodi_lineage_init(&w->lineage, w->records.in, w->helpers, w->error));
    for (uint32_t c = 0; c <= w->in->field_count; c++)
        TETLOD_TRY(check_column(w, c));
    TETLOD_TRY(write_levels(w));
    TETLOD_TRY(ask(w));
    if (!w->writes)
        return TETLOD_OK;
    const struct tetlodi_cells_input cells = {w->in->cells, w->in->cell_field_count, w->in->tets,
                                              w->records.original_of, w->in->parents};
    if (!tetlodi_cells_encode(&w->cells, &cells))
        return out_of_memory(w);
    if (w->in->keep_order)
        TETLOD_TRY(write_order(w));
    fill_info(w);
    return TETLOD_OK;
}

/* The rate of learning that makes the smallest frames: all are tried. */
static enum tetlod_status choose_slowest(const struct tetlodi_write_input *input, unsigned *out,
                                         struct tetlod_error *error)
{
    uint64_t least = UINT64_MAX;
    for (unsigned slowest = MIN_SLOWEST; slowest <= MAX_SLOWEST; slowest++) {
        double share = 1.0 / (MAX_SLOWEST - MIN_SLOWEST + 2);
        struct writer w = {.in = input, .error = error, .begun = (slowest - MIN_SLOWEST) * share, .share = share};
        enum tetlod_status status = encode(&w, slowest);
        // digests pack to some bytes more or less
        uint64_t size = w.order.size + (slowest == USUAL_SLOWEST ? 0 : DIGEST_SIZE);
        for (size_t i = 0; i < (input->field_count + (size_t)1) * input->level_count && status == TETLOD_OK; i++)
            size += w.stored[i].size;
        release(&w);
        if (status != TETLOD_OK)
            return status;
        *out = size < least ? slowest : *out;
        least = size < least ? size : least;
    }
    return TETLOD_OK;
}

enum tetlod_status tetlodi_write(const struct tetlodi_write_input *input, const struct tetlodi_sink *sink,
                                 struct tetlod_error *error)
{
    struct writer w = {.in = input, .error = error, .writes = sink, .share = 1};
    unsigned slowest = USUAL_SLOWEST;
    if (input->compression >= EFFORT_ALL_RATES) {
        TETLOD_TRY(choose_slowest(input, &slowest, error));
        w.share = 1.0 / (MAX_SLOWEST - MIN_SLOWEST + 2);
        w.begun = 1 - w.share;
    }
    enum tetlod_status status = encode(&w, slowest);
    if (status == TETLOD_OK && sink)
        status = write_file(&w, sink);
    release(&w);
    return status;
}
