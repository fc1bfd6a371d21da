/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/web/refine/finer.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

struct refine {
    struct tetlod_feed *feed;
    struct forest *forest;
    uint32_t level; /* the finest that the forest has */
    struct tetmesh mesh;
    uint32_t *numbers; /* [mesh.tet_count] */
    struct refine_mesh made;
    struct tetlod_error error;
};

void *refine_allocate(uint32_t size)
{
    return malloc(size ? size : 1);
}

void refine_release(void *block)
{
    free(block);
}

enum tetlod_status refine_feed_new(struct tetlod_feed **out, struct tetlod_error *error)
{
    const struct tetlod_options options = {.struct_size = sizeof options, .max_bytes = (uint64_t)3 << 30};
    return tetlod_feed_new(out, &options, error);
}

struct refine *refine_new(void)
{
    struct refine *refine = array_zero(1, sizeof *refine);
    if (refine && refine_feed_new(&refine->feed, &refine->error) == TETLOD_OK)
        return refine;
    free(refine);
    return NULL;
}

const char *refine_message(const struct refine *refine)
{
    return refine->error.message;
}

enum tetlod_status refine_select_names(struct tetlod_feed *feed, const char *names, uint32_t count,
                                       struct tetlod_error *error)
{
    const char **list = array_new(count, sizeof *list);
    if (!list)
        return tetlodi_fail_nomem(error, "a selection of fields", count);
    for (uint32_t i = 0; i < count; i++, names += strlen(names) + 1)
        list[i] = names;
    enum tetlod_status status = tetlod_feed_select(feed, list, count, error);
    free(list);
    return status;
}

uint32_t refine_select(struct refine *refine, const char *names, uint32_t count)
{
    return refine_select_names(refine->feed, names, count, &refine->error);
}

uint32_t refine_add(struct refine *refine, const void *bytes, uint32_t size)
{
    return tetlod_feed_add(refine->feed, bytes, size, &refine->error);
}

uint32_t refine_begin(struct refine *refine, uint32_t level, const uint32_t *fields, uint32_t count)
{
    forest_free(refine->forest);
    refine->forest = NULL;
    refine->level = level;
    return forest_new_of(&refine->forest, tetlod_feed_file(refine->feed), level,
                         count != TETLOD_NONE ? fields : NULL, count, &refine->error);
}

uint32_t refine_grow(struct refine *refine)
{
    if (forest_levels(refine->forest) > refine->level)
        return TETLOD_OK;
    TETLOD_TRY(forest_grow(refine->forest, &refine->error));
    return forest_levels(refine->forest) > refine->level ? TETLOD_OK : TETLOD_MORE;
}

static void drop_mesh(struct refine *refine)
{
    tetmesh_fini(&refine->mesh);
    free(refine->numbers);
    refine->numbers = NULL;
    refine->made = (struct refine_mesh){0};
}

uint32_t refine_make(struct refine *refine, uint32_t coarse, uint32_t fine, const double *boxes, uint32_t count)
{
    struct region_box *list = array_new(count, sizeof *list);
    struct region_counts counts;
    drop_mesh(refine);
    if (!list)
        return tetlodi_fail_nomem(&refine->error, "boxes", count * sizeof *list);
    for (uint32_t b = 0; b < count; b++)
        for (uint32_t i = 0; i < 3; i++) {
            list[b].low[i] = boxes[6 * (size_t)b + i];
            list[b].high[i] = boxes[6 * (size_t)b + 3 + i];
        }
    const struct region region = {coarse, fine, list, count};
    enum tetlod_status status = region_mesh(refine->forest, &region, NULL, &refine->mesh, &refine->numbers, &counts,
                                            &refine->error);
    free(list);
    if (status != TETLOD_OK)
        return status;
    const struct tetmesh *mesh = &refine->mesh;
    refine->made = (struct refine_mesh){mesh->vertex_count, mesh->tet_count, mesh->positions, mesh->corners,
                                        refine->numbers, mesh->cell_fields[0].values, {0}};
    memcpy(refine->made.counts, counts.tets, sizeof counts.tets);
    return TETLOD_OK;
}

const struct refine_mesh *refine_mesh(const struct refine *refine)
{
    return &refine->made;
}

uint32_t refine_field_count(const struct refine *refine)
{
    return refine->mesh.field_count;
}

const double *refine_values(const struct refine *refine, uint32_t field)
{
    return refine->mesh.fields[field].values;
}

uint32_t refine_components(const struct refine *refine, uint32_t field)
{
    return refine->mesh.fields[field].components;
}
