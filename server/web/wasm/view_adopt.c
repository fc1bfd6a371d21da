/* SPDX-License-Identifier: BSD-3-Clause */
/* A mesh from elsewhere in place of the cursor's: a level that is finer in boxes, which another module makes of the
 * same bytes (server/web/refine/finer.h). */
#include <stdlib.h>

#include "format/fail.h"
#include "server/web/wasm/view.h"
#include "src/util/array.h"

const uint32_t *view_added(struct view *view)
{
    size_t size;
    view->added[0] = (uint32_t)(uintptr_t)tetlod_feed_added(view->feed, &size);
    view->added[1] = (uint32_t)size;
    return view->added;
}

static void drop(struct view *view)
{
    struct view_adopted *adopted = &view->adopted;
    for (uint32_t f = 0; adopted->fields && f < view->shown.field_count; f++)
        free(adopted->fields[f]);
    free(adopted->fields);
    free(adopted->positions);
    free(adopted->corners);
    free(adopted->numbers);
    free(adopted->parts);
    *adopted = (struct view_adopted){0};
}

const struct view_adopted *view_adopt(struct view *view, uint32_t vertices, uint32_t tets)
{
    struct view_adopted *adopted = &view->adopted;
    if (adopted->is_shown && view_show_adopted(view, 0) != TETLOD_OK)
        return NULL;
    drop(view);
    *adopted = (struct view_adopted){array_new(vertices, 3 * sizeof *adopted->positions),
                                     array_new(tets, 4 * sizeof *adopted->corners),
                                     array_new(tets, sizeof *adopted->numbers),
                                     array_new(tets, sizeof *adopted->parts),
                                     array_zero(view->shown.field_count + 1, sizeof *adopted->fields),
                                     vertices, tets, false};
    bool all = adopted->positions && adopted->corners && adopted->numbers && adopted->parts && adopted->fields;
    for (uint32_t f = 0; all && f < view->shown.field_count; f++) {
        size_t row = view->shown.fields[f].components * sizeof(double);
        if (view->mesh.fields[f])
            all = (adopted->fields[f] = array_new(vertices, row)) != NULL;
    }
    if (all)
        return adopted;
    drop(view);
    return NULL;
}

void view_take_adopted(struct view *view)
{
    const struct view_adopted *adopted = &view->adopted;
    if (!adopted->is_shown)
        return;
    view->mesh.vertices = adopted->vertices;
    view->mesh.tets = adopted->tets;
    view->mesh.positions = adopted->positions;
    view->mesh.corners = adopted->corners;
    view->mesh.fields = (const double *const *)adopted->fields;
    view->mesh.parents = NULL;
}

/* Numbers are those of tetrahedra that values of cells are known of. */
static bool fits(const struct view *view)
{
    const struct view_adopted *adopted = &view->adopted;
    const uint64_t originals = view_info(view)->tets;
    bool fit = tetmesh_find_outside(adopted->corners, 4 * (size_t)adopted->tets, adopted->vertices) ==
               4 * (size_t)adopted->tets;
    for (uint32_t t = 0; fit && t < adopted->tets; t++)
        fit = adopted->numbers[t] < originals;
    return fit;
}

uint32_t view_show_adopted(struct view *view, uint32_t shown)
{
    if (shown && !(view->adopted.positions && fits(view)))
        return tetlodi_fail(&view->error, TETLOD_ERR_ARGUMENT, "a mesh has corners that it has not");
    view->adopted.is_shown = shown;
    view->moving = false;
    return view_arrive(view);
}
