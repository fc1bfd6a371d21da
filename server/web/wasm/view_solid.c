/* SPDX-License-Identifier: BSD-3-Clause */
/* What is in a box, and what is drawn as a mesh for other programs: tetrahedra that a plane passes through are divided
 * there, so that all that is drawn of them, the faces of the cut too, is exact. */
#include <string.h>

#include "format/fail.h"
#include "server/web/wasm/view.h"
#include "src/util/array.h"

static bool grow(double **values, size_t *cap, size_t count)
{
    return array_reserve(values, cap, count, sizeof **values);
}

/* Arrays of the mesh that is shown, with the new vertices behind. */
static bool extend(const struct cut_solid *cut, const double *from, uint32_t components, double **to, size_t *cap)
{
    size_t old = (size_t)cut->old_count * components, count = (size_t)cut->new_count * components;
    if (!grow(to, cap, old + count + 1))
        return false;
    memcpy(*to, from, old * sizeof *from);
    cut_solid_extend(cut, *to, components);
    return true;
}

static bool extend_all(struct view *view)
{
    struct view_solid *solid = &view->solid;
    const struct tetmesh *shown = &view->shown;
    size_t count = (size_t)solid->cut.old_count + solid->cut.new_count;
    if (!solid->fields) {
        solid->fields = array_zero(shown->field_count + 1, sizeof *solid->fields);
        solid->field_caps = array_zero(shown->field_count + 1, sizeof *solid->field_caps);
    }
    bool made = solid->fields && solid->field_caps;
    for (uint32_t f = 0; made && f < shown->field_count; f++) {
        double *values = solid->fields[f].values;
        const struct point_field *from = &shown->fields[f];
        made = !from->values || extend(&solid->cut, from->values, from->components, &values, &solid->field_caps[f]);
        solid->fields[f] = *from;
        solid->fields[f].values = values;
    }
    double *shade = made ? array_resize(view->shade, count + 1, sizeof *shade) : NULL;
    view->shade = shade ? shade : view->shade;
    double *function = made ? array_resize(view->function, count + 1, sizeof *function) : NULL;
    view->function = function ? function : view->function;
    if (shade)
        cut_solid_extend(&solid->cut, shade, 1);
    return shade && function;
}

/* Where the side of a plane that is left has negative values. */
static enum tetlod_status cut_by(struct view *view, const double normal[3], double offset)
{
    struct view_solid *solid = &view->solid;
    size_t count = (size_t)solid->cut.old_count + solid->cut.new_count;
    double *values = array_resize(view->function, count + 1, sizeof *values);
    if (!values)
        return tetlodi_fail_nomem(&view->error, "a part of the mesh", 8 * (uint64_t)count);
    view->function = values;
    for (size_t v = 0; v < count; v++) {
        const double *p = solid->positions + 3 * v;
        values[v] = normal[0] * p[0] + normal[1] * p[1] + normal[2] * p[2] - offset;
    }
    TETLOD_TRY(cut_solid_below(&solid->cut, values, &view->error));
    if (!grow(&solid->positions, &solid->position_cap, 3 * ((size_t)solid->cut.old_count + solid->cut.new_count + 1)))
        return tetlodi_fail_nomem(&view->error, "a part of the mesh", 24 * (uint64_t)solid->cut.new_count);
    cut_solid_extend(&solid->cut, solid->positions, 3);
    return TETLOD_OK;
}

static enum tetlod_status cut_all(struct view *view)
{
    for (int side = 0; view->has_box && side < 6; side++) {
        double normal[3] = {0, 0, 0}, sign = side < 3 ? -1 : 1;
        normal[side % 3] = sign;
        TETLOD_TRY(cut_by(view, normal, sign * view->box[side]));
    }
    const double *n = view->clip.normal, *o = view->clip.origin;
    return view->cuts_plane ? cut_by(view, n, n[0] * o[0] + n[1] * o[1] + n[2] * o[2]) : TETLOD_OK;
}

enum tetlod_status view_cut_solid(struct view *view)
{
    struct view_solid *solid = &view->solid;
    struct tetmesh *kept = &view->kept;
    const struct tetmesh *shown = &view->shown;
    TETLOD_TRY(cut_solid_begin(shown->vertex_count, kept->corners, view->kept_tets, kept->tet_count, &solid->cut,
                               &view->error));
    if (!extend(&solid->cut, shown->positions, 3, &solid->positions, &solid->position_cap))
        return tetlodi_fail_nomem(&view->error, "a part of the mesh", 24 * (uint64_t)shown->vertex_count);
    TETLOD_TRY(cut_all(view));
    uint32_t count = solid->cut.tet_count, room = count ? count : 1;
    uint32_t *corners = array_resize(kept->corners, room, 4 * sizeof *corners);
    kept->corners = corners ? corners : kept->corners;
    uint32_t *tets = array_resize(view->kept_tets, room, sizeof *tets);
    view->kept_tets = tets ? tets : view->kept_tets;
    if (!corners || !tets || !extend_all(view))
        return tetlodi_fail_nomem(&view->error, "a part of the mesh", 20 * (uint64_t)count);
    if (count) {
        memcpy(corners, solid->cut.corners, 4 * sizeof *corners * count);
        memcpy(tets, solid->cut.tets, sizeof *tets * count);
    }
    kept->tet_count = count;
    return TETLOD_OK;
}

/* ---- lines ---- */

void view_drop_lines(const struct view *view, struct cut *cut, const double *values)
{
    uint32_t left = 0;
    for (size_t l = 0; view->has_kept && view->solid.is_used && l < cut->line_count; l++) {
        bool in_zero_set = values != NULL;
        uint32_t ends[4];
        for (size_t i = 0; i < 2; i++) {
            const uint32_t *own = cut->ends + 2 * (size_t)cut->lines[2 * l + i];
            in_zero_set = in_zero_set && (own[0] != own[1] || values[own[0]] == 0);
            memcpy(ends + 2 * i, own, 2 * sizeof *own);
        }
        if (!cut_solid_is_edge(&view->solid.cut, ends, 4, in_zero_set))
            continue;
        memmove(cut->lines + 2 * (size_t)left++, cut->lines + 2 * l, 2 * sizeof *cut->lines);
    }
    cut->line_count = view->has_kept && view->solid.is_used ? left : cut->line_count;
}

/* ---- what is drawn, as a mesh ---- */

const struct view_collected *view_collect(struct view *view)
{
    struct view_collected *out = &view->collected;
    enum tetlod_status status = view_filter_for(view, view->clips);
    const struct tetmesh *drawn = view_drawn(view);
    if (status == TETLOD_OK && !ARRAY_RESERVE(out->room, out->room_cap, (size_t)drawn->tet_count + 1))
        status = tetlodi_fail_nomem(&view->error, "a mesh", 4 * (uint64_t)drawn->tet_count);
    for (uint32_t t = 0; status == TETLOD_OK && t < drawn->tet_count; t++)
        out->room[t] = view_number(view, view->has_kept ? view->kept_tets[t] : t);
    *out = (struct view_collected){drawn->vertex_count, drawn->tet_count, drawn->positions,
                                   drawn->corners, out->room, out->room, out->room_cap};
    return status == TETLOD_OK ? out : NULL;
}
