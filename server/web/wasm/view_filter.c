/* SPDX-License-Identifier: BSD-3-Clause */
/* Which tetrahedra pictures are of: all, those with values in a range, those of some regions, what is in a box. */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "server/web/wasm/view.h"
#include "src/util/array.h"

static void forget_kept(struct view *view)
{
    view->has_kept = view->has_boundary = view->has_lines = view->has_rays = false;
    view->grid_size = 0;
}

void view_threshold(struct view *view, bool of_cells, uint32_t field, int32_t component, double low, double high)
{
    const struct view_range *last = &view->range;
    if (view->has_range && last->of_cells == of_cells && last->field == field && last->component == component &&
        last->low == low && last->high == high)
        return;
    view->has_range = true;
    view->range = (struct view_range){of_cells, field, component, low, high};
    forget_kept(view);
}

void view_unthreshold(struct view *view)
{
    if (view->has_range)
        forget_kept(view);
    view->has_range = false;
}

static int by_number(const void *a, const void *b)
{
    const double p = *(const double *)a, q = *(const double *)b;
    return p < q ? -1 : p > q;
}

uint32_t view_hide(struct view *view, uint32_t field, const double *numbers, uint32_t count)
{
    struct view_hidden *hidden = &view->hidden;
    if (field == hidden->field && count == hidden->count &&
        (!count || memcmp(numbers, hidden->numbers, count * sizeof *numbers) == 0))
        return TETLOD_OK;
    double *room = array_resize(hidden->numbers, count ? count : 1, sizeof *room);
    if (!room)
        return tetlodi_fail_nomem(&view->error, "regions", count * sizeof *numbers);
    for (uint32_t i = 0; i < count; i++)
        room[i] = numbers[i];
    *hidden = (struct view_hidden){field, count, room};
    forget_kept(view);
    return TETLOD_OK;
}

void view_box(struct view *view, bool has, double x0, double y0, double z0, double x1, double y1, double z1)
{
    const double box[6] = {x0, y0, z0, x1, y1, z1};
    if (has == view->has_box && (!has || memcmp(box, view->box, sizeof box) == 0))
        return;
    view->has_box = has;
    memcpy(view->box, box, sizeof box);
    forget_kept(view);
}

static bool is_in_range(const struct view *view, uint32_t tet)
{
    const struct view_range *range = &view->range;
    const uint32_t *corners = view->shown.corners + 4 * (size_t)tet;
    bool in = true;
    for (int i = 0; i < (range->of_cells ? 1 : 4); i++) {
        double value = range->of_cells ? view_cell_value(view, range->field, range->component,
                                                         view_number(view, tet)) : view->function[corners[i]];
        in = in && value >= range->low && value <= range->high;
    }
    return in;
}

static bool is_hidden(const struct view *view, uint32_t tet)
{
    const struct view_hidden *hidden = &view->hidden;
    return bsearch(&view->cells[hidden->field][view_number(view, tet)], hidden->numbers, hidden->count,
                   sizeof *hidden->numbers,
                   by_number) != NULL;
}

void view_pick(struct view *view, uint32_t part)
{
    if (part != view->picked)
        forget_kept(view);
    view->picked = part;
}

static bool picks(const struct view *view)
{
    return view->adopted.is_shown && view->picked != TETLOD_NONE;
}

static bool keep(struct view *view)
{
    const struct tetmesh *shown = &view->shown;
    size_t room = shown->tet_count ? shown->tet_count : 1;
    uint32_t *corners = array_resize(view->kept.corners, room, 4 * sizeof *corners);
    if (corners)
        view->kept.corners = corners;
    uint32_t *tets = array_resize(view->kept_tets, room, sizeof *tets);
    if (tets)
        view->kept_tets = tets;
    if (!corners || !tets)
        return false;
    uint32_t count = 0;
    for (uint32_t t = 0; t < shown->tet_count; t++) {
        const uint32_t *tet = shown->corners + 4 * (size_t)t;
        if ((view->has_range && !is_in_range(view, t)) || (view->hidden.count && is_hidden(view, t)) ||
            (picks(view) && view->adopted.parts[t] != view->picked))
            continue;
        tets[count] = t;
        memcpy(corners + 4 * (size_t)count++, tet, 4 * sizeof *tet);
    }
    view->kept.tet_count = count;
    return true;
}

/* All but the corners of what is kept. */
static void take_shown(struct view *view)
{
    uint32_t *corners = view->kept.corners, count = view->kept.tet_count;
    view->kept = view->shown;
    view->kept.corners = corners;
    view->kept.tet_count = count;
    if (!view->solid.is_used)
        return;
    view->kept.vertex_count += view->solid.cut.new_count;
    view->kept.positions = view->solid.positions;
    view->kept.fields = view->solid.fields;
}

enum tetlod_status view_filter_for(struct view *view, bool cuts_plane)
{
    if (cuts_plane || view->cuts_plane) // the plane may be another one
        forget_kept(view);
    view->cuts_plane = cuts_plane;
    const struct view_range *range = &view->range;
    const bool cuts = view->has_box || view->cuts_plane;
    if (view->has_kept || (!view->has_range && !view->hidden.count && !cuts && !picks(view)))
        return TETLOD_OK;
    if (view->has_range && !range->of_cells)
        view_take_values(view, view->moving ? &view->to : &view->shown, view->shown.vertex_count, range->field,
                         range->component, view->function);
    if (!keep(view))
        return tetlodi_fail_nomem(&view->error, "some of the tetrahedra", 20 * (uint64_t)view->shown.tet_count);
    view->solid.is_used = cuts;
    if (cuts)
        TETLOD_TRY(view_cut_solid(view));
    view->has_kept = true;
    take_shown(view);
    return TETLOD_OK;
}

uint32_t view_filter(struct view *view)
{
    return view_filter_for(view, false);
}

void view_follow_shown(struct view *view)
{
    if (view->has_kept && view->solid.is_used)
        forget_kept(view); // it is cut elsewhere
    else if (view->has_kept)
        take_shown(view);
}

const struct tetmesh *view_drawn(const struct view *view)
{
    return view->has_kept ? &view->kept : &view->shown;
}
