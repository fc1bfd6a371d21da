/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: a stack. 1. Its forest and its mesh at the begin, as the writer of the whole has them. 2. Level by level one page
 * (page_encode.h); what was known to be at seams is. Out: the bytes of each page, and what the mesh is at the end.
 */
#include "format/write/page_stack.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/write/page_encode.h"

struct coding {
    const struct tetlodi_page_stack *stack;
    struct tetlodi_stack_result *out;
    struct tetlod_error *error;
    struct lineage lineage;
    struct tetlodi_memory memory;
    struct tetlodi_column *columns;
    struct tetlodi_replay replay;
    struct tetlodi_record_writer records;
    uint32_t *slot_at;
    struct tetlodi_cut page;            /* a tree of one */
    struct tetlodi_write_group *groups; /* each of it */
    struct tetlodi_page_writer pages;
};

static enum tetlod_status no_memory(const struct coding *coding)
{
    return tetlodi_fail_nomem(coding->error, "the pages", (uint64_t)coding->stack->in.tets * 64);
}

static enum tetlod_status allocate(struct coding *coding)
{
    const struct tetlodi_page_stack *stack = coding->stack;
    const struct tetlodi_write_input *in = &stack->in;
    uint32_t parts = 1 + in->field_count;
    struct tetlodi_stack_result *out = coding->out;
    *out = (struct tetlodi_stack_result){.level_count = stack->level_count,
                                         .parts = parts,
                                         .levels = calloc(stack->level_count, sizeof *out->levels),
                                         .frames = calloc((size_t)stack->level_count * parts, sizeof *out->frames)};
    coding->memory.most = UINT64_MAX;
    coding->page.axis = CUT_PAGE;
    coding->columns = calloc(parts, sizeof *coding->columns);
    coding->slot_at = malloc((in->vertices + (size_t)1) * sizeof *coding->slot_at);
    coding->groups = calloc(stack->level_count, sizeof *coding->groups);
    if (!out->levels || !out->frames || !coding->columns || !coding->slot_at || !coding->groups)
        return no_memory(coding);
    memset(coding->slot_at, 0xff, in->vertices * sizeof *coding->slot_at); // TETLOD_NONE
    tetlodi_set_columns(in, coding->columns);
    tetlodi_replay_init(&coding->replay, &coding->memory, coding->columns, parts);
    for (uint32_t level = 0; level < stack->level_count; level++)
        coding->groups[level] =
            (struct tetlodi_write_group){.tree = &coding->page, .nodes = 1, .pages = 1, .ends = &stack->ends[level]};
    tetlodi_page_writer_init(&coding->pages, &coding->memory, coding->groups, stack->level_count, in->field_count);
    coding->pages.seams = stack->seams;
    coding->pages.seams_known = stack->vertices;
    coding->records = (struct tetlodi_record_writer){
        .in = in, .lineage = &coding->lineage, .slot_at = coding->slot_at, .replay = &coding->replay};
    TETLOD_TRY(tetlodi_record_writer_init(&coding->records, in->vertices, in->tets, coding->error));
    bool room = tetlodi_replay_room(&coding->replay, in->vertices, in->tets);
    for (uint32_t c = 0; c < parts; c++) {
        struct tetlodi_column *column = &coding->columns[c];
        size_t count = (size_t)in->vertices * column->components;
        room = room && TETLODI_ROOM(&coding->memory, column->codes, column->codes_capacity, count) &&
               (c || TETLODI_ROOM(&coding->memory, column->values, column->values_capacity, count));
    }
    return room ? TETLOD_OK : no_memory(coding);
}

/* The mesh at the begin. */
static void set_mesh(struct coding *coding)
{
    const struct tetlodi_page_stack *stack = coding->stack;
    struct tetlodi_replay *replay = &coding->replay;
    for (uint32_t v = 0; v < stack->vertices; v++) {
        tetlodi_settle_node(&coding->records, stack->nodes[v], v);
        tetlodi_set_codes(&coding->records, v, stack->nodes[v]);
        for (unsigned axis = 0; axis < 3; axis++) {
            size_t at = 3 * (size_t)v + axis;
            replay->columns[0].values[at] =
                scale_value(&replay->columns[0].scale, axis, replay->columns[0].codes[at]);
        }
        replay->stars[v] = (struct tetlodi_star){.leaf = stack->leaves[v]};
        replay->parents[v] = v;
    }
    for (uint32_t t = 0; t < stack->tets; t++) {
        coding->records.original_of[t] = stack->numbers[t];
        coding->records.places[t] = stack->places[t];
        for (unsigned c = 0; c < 4; c++)
            replay->corners[4 * (size_t)t + c] =
                tetlodi_slot_of(&coding->records, stack->numbers[t], stack->places[t] >> 2 * c & 3);
    }
    replay->vertices = stack->vertices;
    replay->tets = stack->tets;
    for (uint32_t f = 0; f < stack->in.field_count; f++)
        memcpy(coding->records.recorder.field_models[f].copied, stack->copied + (size_t)f * MAX_COMPONENTS,
               MAX_COMPONENTS);
}

static enum tetlod_status go_on(void *opaque)
{
    (void)opaque;
    return TETLOD_OK;
}

static enum tetlod_status encode_level(struct coding *coding, uint32_t level)
{
    const struct tetlodi_page_stack *stack = coding->stack;
    struct tetlodi_stack_level *out = &coding->out->levels[level];
    const uint64_t labels = coding->records.recorder.labels;
    const struct tetlodi_page_encode encode = {
        .whole = &coding->records,
        .pages = &coding->pages,
        .group = &coding->groups[level],
        .contractions = level + 1 < stack->level_count ? stack->ends[level + 1] : 0,
        .ends = level + 1 == stack->level_count && !stack->keeps_mesh,
        .slowest = stack->slowest,
        .frames = coding->out->frames + (size_t)level * coding->out->parts,
        .ask = go_on};
    if (!tetlodi_page_writer_begin(&coding->pages, NULL, &coding->replay, encode.group, level))
        return no_memory(coding);
    TETLOD_TRY(tetlodi_encode_pages(&encode, coding->error));
    out->vertices = coding->pages.table.pages[level].vertices;
    out->tets = coding->pages.table.pages[level].tets;
    out->labels = coding->records.recorder.labels - labels;
    memcpy(out->box, coding->pages.boxes[level], sizeof out->box);
    return TETLOD_OK;
}

/* What the mesh is at the end. */
static enum tetlod_status keep_mesh(struct coding *coding)
{
    const struct tetlodi_replay *replay = &coding->replay;
    struct tetlodi_stack_result *out = coding->out;
    if (replay->vertices != coding->stack->in.vertices || replay->tets != coding->stack->in.tets)
        return tetlodi_fail(coding->error, TETLOD_ERR_ARGUMENT,
                            "the sequence cannot be written: a contraction is in the wrong page");
    if (!coding->stack->keeps_mesh)
        return TETLOD_OK;
    out->vertices = replay->vertices;
    out->tets = replay->tets - coding->stack->tets;
    out->leaves = malloc(out->vertices + (size_t)1);
    if (!out->leaves)
        return no_memory(coding);
    for (uint32_t v = 0; v < out->vertices; v++)
        out->leaves[v] = (uint8_t)replay->stars[v].leaf;
    out->nodes = coding->records.node_at;
    out->numbers = coding->records.original_of;
    out->places = coding->records.places;
    memmove(out->numbers, out->numbers + coding->stack->tets, out->tets * sizeof *out->numbers);
    memmove(out->places, out->places + coding->stack->tets, out->tets);
    coding->records.node_at = coding->records.original_of = NULL;
    coding->records.places = NULL;
    return TETLOD_OK;
}

enum tetlod_status tetlodi_stack_encode(const struct tetlodi_page_stack *stack, struct tetlodi_stack_result *out,
                                        struct tetlod_error *error)
{
    struct coding coding = {.stack = stack, .out = out, .error = error};
    enum tetlod_status status;
    TETLOD_TRY_DONE(allocate(&coding));
    TETLOD_TRY_DONE(tetlodi_lineage_init(&coding.lineage, &stack->in, NULL, error));
    set_mesh(&coding);
    for (uint32_t level = 0; level < stack->level_count; level++)
        TETLOD_TRY_DONE(encode_level(&coding, level));
    status = keep_mesh(&coding);
done:
    tetlodi_page_writer_fini(&coding.pages);
    tetlodi_record_writer_fini(&coding.records);
    if (coding.replay.memory)
        tetlodi_replay_fini(&coding.replay);
    tetlodi_lineage_fini(&coding.lineage);
    free(coding.slot_at);
    free(coding.groups);
    free(coding.columns);
    return status;
}

void tetlodi_stack_fini(struct tetlodi_page_stack *stack)
{
    const struct tetlodi_write_input *in = &stack->in;
    for (uint32_t f = 0; f < in->field_count && stack->fields; f++) {
        free((void *)(uintptr_t)stack->fields[f].values);
        free((void *)(uintptr_t)stack->fields[f].node_values);
    }
    const void *const owned[] = {in->positions, in->corners, in->children, in->node_positions, in->later, in->levels,
                                 stack->fields, stack->copied, stack->ends, stack->nodes, stack->numbers, stack->seams,
                                 stack->leaves, stack->places};
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free((void *)(uintptr_t)owned[i]);
    *stack = (struct tetlodi_page_stack){0};
}

void tetlodi_stack_result_fini(struct tetlodi_stack_result *result)
{
    for (size_t i = 0; i < (size_t)result->level_count * result->parts && result->frames; i++)
        tetlodi_buffer_fini(&result->frames[i]);
    free(result->levels);
    free(result->frames);
    free(result->nodes);
    free(result->numbers);
    free(result->leaves);
    free(result->places);
    *result = (struct tetlodi_stack_result){0};
}
