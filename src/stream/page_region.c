/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/stream/page_region.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/stream/level_mesh.h"
#include "src/util/array.h"

uint32_t page_region_finest(const struct tetlod_info *info)
{
    return info->page_count ? info->level_count - 1 - (info->exact_last ? 1 : 0) : TETLOD_NONE;
}

bool page_region_is(const struct tetlod_info *info, uint32_t fine)
{
    return info->page_count && fine >= info->first_paged_level && fine <= page_region_finest(info);
}

uint32_t page_region_outside(const struct tetlod_info *info, uint32_t coarse)
{
    return coarse < info->first_paged_level ? info->first_paged_level - 1 : coarse;
}

enum tetlod_status page_region_set(const struct tetlod_file *file, const struct region *region,
                                   struct tetlod_page_set **out, struct tetlod_error *error)
{
    struct tetlod_place *places = array_zero(region->box_count, sizeof *places);
    *out = NULL;
    if (!places)
        return tetlodi_fail_nomem(error, "boxes", region->box_count * sizeof *places);
    for (size_t i = 0; i < region->box_count; i++) {
        memcpy(places[i].low, region->boxes[i].low, sizeof places[i].low);
        memcpy(places[i].high, region->boxes[i].high, sizeof places[i].high);
        places[i].level = region->fine;
    }
    enum tetlod_status status = tetlod_page_set_new(out, file, region->coarse, places, region->box_count, error);
    free(places);
    return status;
}

/* Of a mesh with values, numbers and parts of its tetrahedra. */
static uint64_t mesh_bytes(const struct tetlod_info *info, const struct tetlod_page_set_info *pages)
{
    uint64_t components = 3;
    for (uint32_t f = 0; f < info->field_count; f++)
        components += info->fields[f].components;
    return pages->vertices * components * 8 + pages->tets * (uint64_t)(16 + 8 + 4);
}

uint64_t page_region_bytes(const struct tetlod_info *info, const struct tetlod_page_set_info *pages)
{
    return mesh_bytes(info, pages) + pages->memory + pages->tets * (uint64_t)8; // and levels of tetrahedra
}

/* Tells the parts by the levels of tetrahedra. */
static enum tetlod_status add_parts(struct tetmesh *mesh, const struct region *region, const uint32_t *levels,
                                    struct region_counts *counts, uint32_t *transition, struct tetlod_error *error)
{
    TETLOD_TRY(tetmesh_add_cell_field(mesh, REGION_FIELD, 1, TETLOD_FLOAT32, mesh->tet_count, error));
    struct point_field *parts = &mesh->cell_fields[mesh->cell_field_count - 1];
    parts->is_integer = true;
    *counts = (struct region_counts){0};
    *transition = TETLOD_NONE;
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        enum region_part part = levels[t] >= region->fine     ? REGION_FINE
                                : levels[t] <= region->coarse ? REGION_COARSE
                                                              : REGION_TRANSITION;
        parts->values[t] = part;
        counts->tets[part]++;
        if (part == REGION_TRANSITION && levels[t] < *transition)
            *transition = levels[t];
    }
    return TETLOD_OK;
}

/* `levels` and *tets have room for what the pages have. */
static enum tetlod_status decode(struct tetlod_file *file, const struct tetlod_page_set *set, uint32_t level,
                                 struct tetmesh *out, uint32_t *levels, uint32_t *tets, struct tetlod_error *error)
{
    struct tetlod_cursor *cursor;
    TETLOD_TRY(tetlod_cursor_new(&cursor, file, NULL, 0, error));
    enum tetlod_status status = tetlod_cursor_select(cursor, set, error);
    if (status == TETLOD_OK)
        status = tetlod_cursor_seek(cursor, level, error);
    if (status == TETLOD_OK) {
        tetlod_cursor_tet_levels(cursor, levels);
        tetlod_cursor_numbers(cursor, NULL, tets);
        status = level_mesh_take(tetlod_info(file), &cursor, out, error);
    }
    tetlod_cursor_free(cursor);
    return status;
}

enum tetlod_status page_region_mesh(struct tetlod_file *file, const struct tetlod_page_set *set,
                                    const struct region *region, struct room *room, struct tetmesh *out,
                                    uint32_t **tets, struct region_counts *counts, uint32_t *transition,
                                    struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    const uint64_t held = room_held(room);
    struct tetlod_page_set_info pages;
    uint32_t *levels = NULL;
    enum tetlod_status status;
    *out = (struct tetmesh){0};
    *tets = NULL;
    tetlod_page_set_info(set, &pages);
    TETLOD_TRY(room_take(room, page_region_bytes(info, &pages), error));
    levels = array_new(pages.tets, sizeof *levels);
    *tets = array_new(pages.tets, sizeof **tets);
    if (!levels || !*tets)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "a region", pages.tets * (uint64_t)8));
    TETLOD_TRY_DONE(decode(file, set, pages.level, out, levels, *tets, error));
    TETLOD_TRY_DONE(add_parts(out, region, levels, counts, transition, error));
    tetmesh_set_origin(out, info, region->coarse);
    room_back_to(room, held + mesh_bytes(info, &pages));
done:
    free(levels);
    if (status != TETLOD_OK) {
        tetmesh_fini(out);
        free(*tets);
        *tets = NULL;
    }
    return status;
}
