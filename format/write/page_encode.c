/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: a mesh, and what its pages have (format/coding/page_part.h). 1. Each page, on any thread: a mesh of its own, its
 * records, its frames. 2. In the order of pages, on the caller's thread: the page is put back, behind what those before
 * it have added. So few pages are held at a time, and the bytes are those of one thread.
 */
#include "format/write/page_encode.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"

struct job {
    struct tetlodi_page_part part;
    struct tetlodi_record_writer records;
    struct tetlodi_buffer *frames;   /* [column] */
    uint32_t vertices, first_vertex; /* that it adds */
    enum tetlod_status status;
    struct tetlod_error error;
};

struct level {
    const struct tetlodi_page_encode *in;
    uint32_t most_tets; /* that pages may add */
    struct job *jobs;   /* [page] */
    enum tetlod_status status;
    struct tetlod_error *error;
};

static enum tetlod_status no_memory(const struct job *job, struct tetlod_error *error)
{
    return tetlodi_fail_nomem(error, "a page", (uint64_t)job->part.tet_count * 64);
}

/* What the whole mesh's vertices and tetrahedra come from. */
static void gather_nodes(const struct level *level, struct job *job)
{
    const struct tetlodi_record_writer *whole = level->in->whole;
    for (uint32_t v = 0; v < job->part.listed_count; v++)
        job->records.node_at[v] = whole->node_at[job->part.listed[v]];
    for (uint32_t t = 0; t < job->part.tet_count; t++)
        tetlodi_settle_tet(&job->records, t, whole->original_of[job->part.tets[t]],
                           job->part.replay.corners + 4 * (size_t)t);
}

static void extend_box(const struct level *level, const struct job *job)
{
    for (uint32_t t = 0; t < job->part.replay.tets; t++)
        tetlodi_page_writer_box(level->in->pages, job->part.page, &job->part.replay, t);
}

static enum tetlod_status encode_records(const struct level *level, struct job *job)
{
    const struct tetlodi_page_encode *in = level->in;
    struct tetlodi_page_part *part = &job->part;
    size_t vertices = part->listed_count + (size_t)job->vertices;
    job->records = (struct tetlodi_record_writer){.in = in->whole->in,
                                                  .lineage = in->whole->lineage,
                                                  .slot_at = in->whole->slot_at,
                                                  .part = part,
                                                  .replay = &part->replay};
    TETLOD_TRY(tetlodi_record_writer_init(&job->records, vertices, part->tet_count, &job->error));
    gather_nodes(level, job);
    for (uint32_t c = 0; c < part->replay.column_count; c++)
        if (!TETLODI_ROOM(&part->memory, part->columns[c].before, part->columns[c].before_capacity,
                          part->columns[c].components))
            return no_memory(job, &job->error);
    tetlodi_start_coders(&job->records, in->slowest);
    extend_box(level, job);
    tetlodi_page_part_begin(part, &job->records.recorder, &in->whole->recorder, job->vertices, level->most_tets);
    while (part->replay.vertices < vertices)
        TETLOD_TRY(tetlodi_write_vertex(&job->records, in->contractions, &job->error));
    extend_box(level, job);
    TETLOD_TRY(tetlodi_write_batch(&job->records, job->frames, &job->error));
    return tetlodi_write_rest(&job->records, &job->error);
}

/* Of a page that adds nothing the box is that of what it has. */
static void box_as_it_is(const struct level *level, uint32_t number)
{
    const struct tetlodi_page_shares *shares = &level->in->pages->shares;
    for (uint32_t i = shares->tet_begins[number]; i < shares->tet_begins[number + 1]; i++)
        tetlodi_page_writer_box(level->in->pages, number, shares->whole, shares->tet_list[i]);
}

static int encode_page(void *opaque, uint32_t number)
{
    const struct level *level = opaque;
    const struct tetlodi_page_shares *shares = &level->in->pages->shares;
    struct job *job = &level->jobs[number];
    if (!job->vertices) {
        box_as_it_is(level, number);
        return 1;
    }
    tetlodi_page_part_set(&job->part, shares, number);
    job->part.runs->first_vertex = job->first_vertex;
    job->frames = calloc(level->in->whole->replay->column_count, sizeof *job->frames);
    job->status = job->frames && tetlodi_page_part_gather(&job->part, shares, job->vertices, 0, UINT64_MAX)
                      ? encode_records(level, job)
                      : no_memory(job, &job->error);
    return job->status == TETLOD_OK;
}

/* The codes of vertices that have split or are new. */
static void put_codes(const struct tetlodi_page_part *part, struct tetlodi_column *to, uint32_t column)
{
    const size_t n = to->components, size = n * sizeof *to->codes;
    const int64_t *codes = part->columns[column].codes;
    for (uint32_t v = part->listed_count; v < part->replay.vertices; v++) {
        const uint32_t parent = part->replay.parents[v];
        memcpy(to->codes + n * page_part_outside(part, v), codes + n * v, size);
        if (parent < part->listed_count)
            memcpy(to->codes + n * page_part_outside(part, parent), codes + n * parent, size);
    }
}

/* Puts a page that is encoded behind those before it. */
static enum tetlod_status put_back(const struct level *level, struct job *job)
{
    const struct tetlodi_page_encode *in = level->in;
    struct tetlodi_record_writer *whole = in->whole;
    struct tetlodi_page_part *part = &job->part;
    const uint32_t added = part->replay.tets - part->tet_count;
    if (added > whole->in->tets - whole->replay->tets)
        return tetlodi_fail(&job->error, TETLOD_ERR_ARGUMENT, "the sequence cannot be written: a page has too much");
    part->runs->first_tet = whole->replay->tets;
    if (!in->ends)
        tetlodi_page_part_scatter(part, &in->pages->shares);
    for (uint32_t c = 1; c < part->replay.column_count && in->ends; c++)
        if (whole->in->fields[c - 1].exact)
            put_codes(part, &whole->replay->columns[c], c);
    for (uint32_t v = 0; v < part->replay.vertices; v++)
        if (v >= part->listed_count || !part->seams[v])
            whole->node_at[page_part_outside(part, v)] = job->records.node_at[v];
    if (!in->ends || in->keeps_tets) {
        memcpy(whole->original_of + part->runs->first_tet, job->records.original_of + part->tet_count,
               added * sizeof *whole->original_of);
        memcpy(whole->places + part->runs->first_tet, job->records.places + part->tet_count, added);
    }
    whole->recorder.labels += job->records.recorder.labels;
    whole->replay->vertices += job->vertices;
    whole->replay->tets += added;
    for (uint32_t c = 0; c < part->replay.column_count; c++) {
        tetlodi_put_block(&in->frames[c], job->frames[c].bytes, job->frames[c].size);
        if (in->frames[c].failed)
            return no_memory(job, &job->error);
    }
    return TETLOD_OK;
}

static void drop(struct job *job)
{
    for (uint32_t c = 0; job->frames && c < job->part.replay.column_count; c++)
        tetlodi_buffer_fini(&job->frames[c]);
    free(job->frames);
    job->frames = NULL;
    tetlodi_record_writer_fini(&job->records);
    tetlodi_page_part_fini(&job->part);
}

static int commit_page(void *opaque, uint32_t number)
{
    struct level *level = opaque;
    const struct tetlodi_page_encode *in = level->in;
    struct job *job = &level->jobs[number];
    const struct tetlodi_replay *whole = in->whole->replay;
    if (job->status == TETLOD_OK && job->vertices)
        job->status = put_back(level, job);
    drop(job);
    level->status = job->status;
    if (level->status != TETLOD_OK && level->error)
        *level->error = job->error;
    if (level->status == TETLOD_OK &&
        !tetlodi_page_writer_page(in->pages, whole->vertices, whole->tets, in->frames))
        level->status = no_memory(job, level->error);
    if (level->status == TETLOD_OK && job->vertices)
        level->status = in->ask(in->opaque);
    return level->status == TETLOD_OK;
}

/* How many vertices each page adds, and where. */
static void count_vertices(const struct level *level)
{
    const struct tetlodi_page_encode *in = level->in;
    const uint32_t first = in->whole->in->vertices;
    uint32_t vertex = in->whole->replay->vertices, c = in->contractions;
    for (uint32_t page = 0; page < in->group->pages; page++) {
        struct job *job = &level->jobs[page];
        job->first_vertex = vertex;
        for (; c < in->group->ends[page]; c++)
            job->vertices += lineage_child_count(in->whole->lineage, first + c) - 1;
        vertex += job->vertices;
    }
}

enum tetlod_status tetlodi_encode_pages(const struct tetlodi_page_encode *encode, struct tetlod_error *error)
{
    const struct tetlodi_record_writer *whole = encode->whole;
    struct level level = {.in = encode,
                          .most_tets = whole->in->tets - whole->replay->tets,
                          .jobs = calloc(encode->group->pages, sizeof *level.jobs),
                          .error = error};
    if (!level.jobs)
        return tetlodi_fail_nomem(error, "the pages", encode->group->pages * (uint64_t)sizeof *level.jobs);
    count_vertices(&level);
    tetlodi_helpers_in_order(encode->helpers, encode_page, commit_page, &level, encode->group->pages);
    for (uint32_t page = 0; page < encode->group->pages; page++)
        drop(&level.jobs[page]);
    free(level.jobs);
    return level.status;
}
