/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/web/refine/paging.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/adjacency.h"
#include "src/util/array.h"

struct paging {
    struct tetlod_feed *feed;
    struct tetlod_file *file; /* the feed's */
    struct tetlod_cursor *cursor;
    uint32_t *fields;         /* that are decoded; NULL: all */
    uint32_t field_count, wanted;
    struct tetlod_mesh mesh;
    struct paging_page page;
    struct refine_mesh made;
    uint32_t *numbers, *levels; /* [made.tets] */
    double *parts;
    size_t number_cap, level_cap, part_cap;
    struct paging_walls walls;
    uint32_t *wall_corners;
    struct tetlod_error error;
};

struct paging *paging_new(void)
{
    struct paging *paging = array_zero(1, sizeof *paging);
    if (paging && refine_feed_new(&paging->feed, &paging->error) == TETLOD_OK)
        return paging;
    free(paging);
    return NULL;
}

const char *paging_message(const struct paging *paging)
{
    return paging->error.message;
}

uint32_t paging_select(struct paging *paging, const char *names, uint32_t count)
{
    return refine_select_names(paging->feed, names, count, &paging->error);
}

uint32_t paging_add(struct paging *paging, const void *bytes, uint32_t size)
{
    return tetlod_feed_add(paging->feed, bytes, size, &paging->error);
}

static uint32_t root_of(const struct paging *paging)
{
    return tetlod_info(paging->file)->first_paged_level - 1;
}

uint32_t paging_open(struct paging *paging, const uint32_t *fields, uint32_t count)
{
    paging->file = tetlod_feed_file(paging->feed);
    if (!paging->file || !tetlod_info(paging->file)->page_count)
        return tetlodi_fail(&paging->error, TETLOD_ERR_ARGUMENT, "the stream has no levels in pages");
    if (count != TETLOD_NONE) {
        paging->fields = array_new(count, sizeof *fields);
        if (!paging->fields)
            return tetlodi_fail_nomem(&paging->error, "a selection of fields", count * sizeof *fields);
        if (count)
            memcpy(paging->fields, fields, count * sizeof *fields);
        paging->field_count = count;
    }
    paging->wanted = root_of(paging);
    TETLOD_TRY(tetlod_cursor_new(&paging->cursor, paging->file, paging->fields, paging->field_count, &paging->error));
    return tetlod_cursor_seek(paging->cursor, paging->wanted, &paging->error);
}

uint32_t paging_count(const struct paging *paging)
{
    return tetlod_info(paging->file)->page_count;
}

/* The level of a page, and its number there; TETLOD_NONE: there is none. */
static uint32_t place_of(const struct paging *paging, uint32_t page, uint32_t *number)
{
    uint32_t level = root_of(paging) + 1, pages;
    for (; (pages = tetlod_page_count(paging->file, level)) > 0; page -= pages, level++)
        if (page < pages) {
            *number = page;
            return level;
        }
    return TETLOD_NONE;
}

const struct paging_page *paging_page(struct paging *paging, uint32_t page)
{
    struct paging_page *out = &paging->page;
    struct tetlod_page row;
    struct tetlod_span spans[MAX_PAGE_FRAMES];
    uint32_t number, level = place_of(paging, page, &number);
    if (level == TETLOD_NONE || tetlod_page(paging->file, level, number, &row, &paging->error) != TETLOD_OK)
        return NULL;
    memcpy(out->low, row.low, sizeof out->low);
    memcpy(out->high, row.high, sizeof out->high);
    out->frame_count = (uint32_t)tetlod_page_spans(paging->file, level, number, paging->fields, paging->field_count,
                                                   spans, MAX_PAGE_FRAMES);
    for (uint32_t i = 0; i < out->frame_count; i++) {
        out->frames[i][0] = (double)spans[i].offset;
        out->frames[i][1] = (double)spans[i].size;
    }
    out->level = level;
    out->vertices = row.vertices;
    out->tets = row.tets;
    out->needed_count = row.needed_count;
    out->needed = row.needed;
    return out;
}

/* Corners of the faces without a neighbour, the opposite one last; how many faces. `out` NULL: only that. */
static uint32_t list_walls(const struct tetlod_mesh *mesh, const uint32_t *neighbours, uint32_t *out)
{
    uint32_t count = 0;
    for (size_t face = 0; face < 4 * (size_t)mesh->tets; face++) {
        if (neighbours[face] != TETLOD_NONE)
            continue;
        for (size_t i = 1; out && i <= 4; i++)
            *out++ = mesh->corners[(face & ~(size_t)3) + ((face + i) & 3)];
        count++;
    }
    return count;
}

const struct paging_walls *paging_walls(struct paging *paging)
{
    struct tetlod_mesh *mesh = &paging->mesh;
    tetlod_cursor_mesh(paging->cursor, mesh);
    uint32_t *neighbours = array_new(mesh->tets, 4 * sizeof *neighbours);
    free(paging->wall_corners);
    paging->wall_corners = NULL;
    if (neighbours && adjacency_build(mesh->corners, mesh->tets, mesh->vertices, neighbours, NULL, &paging->error) ==
                          TETLOD_OK) {
        uint32_t count = list_walls(mesh, neighbours, NULL);
        paging->wall_corners = array_new(count, 4 * sizeof *paging->wall_corners);
        paging->walls = (struct paging_walls){count, paging->wall_corners};
    }
    if (paging->wall_corners)
        list_walls(mesh, neighbours, paging->wall_corners);
    free(neighbours);
    return paging->wall_corners ? &paging->walls : NULL;
}

uint32_t paging_put(struct paging *paging, double offset, const void *bytes, uint32_t size)
{
    return tetlod_feed_put(paging->feed, (uint64_t)offset, bytes, size, &paging->error);
}

void paging_forget(struct paging *paging)
{
    tetlod_feed_forget(paging->feed);
}

static enum tetlod_status fill(struct paging *paging, struct tetlod_page_set *set, const uint32_t *pages,
                               uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        uint32_t number, level = place_of(paging, pages[i], &number);
        if (level == TETLOD_NONE)
            return tetlodi_fail(&paging->error, TETLOD_ERR_ARGUMENT, "the stream has no page %u", pages[i]);
        TETLOD_TRY(tetlod_page_set_add(set, level, number, &paging->error));
    }
    return TETLOD_OK;
}

uint32_t paging_choose(struct paging *paging, const uint32_t *pages, uint32_t count)
{
    struct tetlod_page_set *set;
    struct tetlod_page_set_info info;
    TETLOD_TRY(tetlod_page_set_new(&set, paging->file, 0, NULL, 0, &paging->error));
    enum tetlod_status status = fill(paging, set, pages, count);
    if (status == TETLOD_OK)
        status = tetlod_cursor_select(paging->cursor, set, &paging->error);
    tetlod_page_set_info(set, &info);
    if (status == TETLOD_OK)
        paging->wanted = info.level;
    tetlod_page_set_free(set);
    return status;
}

uint32_t paging_step(struct paging *paging, uint32_t vertices)
{
    return tetlod_cursor_step(paging->cursor, paging->wanted, vertices, &paging->error);
}

const struct refine_mesh *paging_mesh(struct paging *paging)
{
    struct tetlod_mesh *mesh = &paging->mesh;
    tetlod_cursor_mesh(paging->cursor, mesh);
    if (!ARRAY_RESERVE(paging->numbers, paging->number_cap, mesh->tets) ||
        !ARRAY_RESERVE(paging->levels, paging->level_cap, mesh->tets) ||
        !ARRAY_RESERVE(paging->parts, paging->part_cap, mesh->tets))
        return NULL;
    tetlod_cursor_numbers(paging->cursor, NULL, paging->numbers);
    tetlod_cursor_tet_levels(paging->cursor, paging->levels);
    for (uint32_t t = 0; t < mesh->tets; t++)
        paging->parts[t] = paging->levels[t];
    paging->made = (struct refine_mesh){mesh->vertices, mesh->tets,     mesh->positions, mesh->corners,
                                        paging->numbers, paging->parts, {0}};
    return &paging->made;
}

const uint32_t *paging_parents(const struct paging *paging)
{
    return paging->mesh.parents;
}

const double *paging_values(const struct paging *paging, uint32_t field)
{
    return paging->mesh.fields[field];
}
