/* SPDX-License-Identifier: BSD-3-Clause */
/* Steps in time: bytes from behind the levels, and a mesh whose values are those of a step. */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "server/web/wasm/view.h"
#include "src/util/array.h"

uint32_t view_put(struct view *view, double offset, const void *bytes, uint32_t size)
{
    return tetlod_feed_put(view->feed, (uint64_t)offset, bytes, size, &view->error);
}

void view_forget(struct view *view)
{
    tetlod_feed_forget(view->feed);
}

void view_leave_step(struct view *view)
{
    free(view->step_values);
    free(view->step_points);
    view->adopted.is_shown = false;
    view->step_values = NULL;
    view->step_points = NULL;
}

/* Another series in place of the view's. The values of a step that is shown are the old one's: the level's own are
 * shown
 * until the next step. */
static enum tetlod_status replace_series(struct view *view)
{
    const bool at_step = view->step_values;
    struct tetlod_series *series;
    TETLOD_TRY(tetlod_series_new(&series, tetlod_feed_file(view->feed), &view->error));
    view_leave_step(view);
    tetlod_series_free(view->series);
    view->series = series;
    view->moving = view->moving && !at_step;
    return at_step ? view_arrive(view) : TETLOD_OK;
}

uint32_t view_series(struct view *view, const uint32_t *fields, uint32_t count)
{
    TETLOD_TRY(replace_series(view));
    if (count == TETLOD_NONE)
        return TETLOD_OK;
    const struct tetlod_series_info *info = tetlod_series_info(view->series);
    uint32_t *chosen = array_new(info->field_count, sizeof *chosen), chosen_count = 0;
    if (!chosen)
        return tetlodi_fail_nomem(&view->error, "a selection of fields", info->field_count * sizeof *chosen);
    for (uint32_t f = 0; f < info->field_count; f++)
        for (uint32_t i = 0; i < count; i++)
            if (info->fields[f] == fields[i])
                chosen[chosen_count++] = f;
    tetlod_series_select(view->series, chosen, chosen_count);
    free(chosen);
    return TETLOD_OK;
}

const double *view_span(struct view *view, uint32_t field, uint32_t band, uint32_t step)
{
    struct tetlod_span span = tetlod_step_span(view->series, field, band, step);
    view->span[0] = (double)span.offset;
    view->span[1] = (double)span.size;
    return view->span;
}

double view_step_error(const struct view *view, uint32_t field, uint32_t band, uint32_t step)
{
    return tetlod_step_error(view->series, field, band, step);
}

/* Where the points are at the step, if they move. The cursor has its mesh. */
static enum tetlod_status take_points(struct view *view)
{
    size_t count = 3 * (size_t)view->mesh.vertices;
    if (tetlod_series_info(view->series)->displacement == TETLOD_NONE)
        return TETLOD_OK;
    view->step_points = array_new(count, sizeof *view->step_points);
    if (!view->step_points)
        return tetlodi_fail_nomem(&view->error, "the points", count * sizeof *view->step_points);
    memcpy(view->step_points, view->mesh.positions, count * sizeof *view->step_points);
    return tetlod_step_move(view->series, view->step_points, &view->error);
}

/* Fields without steps keep the values of the first one. */
static enum tetlod_status take_values(struct view *view)
{
    const struct tetlod_series_info *info = tetlod_series_info(view->series);
    uint32_t count = view->shown.field_count;
    const double **values = array_new(count, sizeof *values);
    if (!values)
        return tetlodi_fail_nomem(&view->error, "the fields", count * sizeof *values);
    tetlod_cursor_mesh(view->cursor, &view->mesh);
    for (uint32_t f = 0; f < count; f++)
        values[f] = view->mesh.fields[f];
    for (uint32_t f = 0; f < info->field_count; f++)
        // where points move, they are decoded without being asked for
        if (tetlod_step_values(view->series, f) && values[info->fields[f]])
            values[info->fields[f]] = tetlod_step_values(view->series, f);
    view_leave_step(view);
    view->step_values = values;
    return take_points(view);
}

/* What is connected to what, in the boundary and for rays. */
struct connections {
    bool boundary, lines, rays;
    uint32_t level;
};

/* Of the step that is shown; none, where values say which tetrahedra are drawn. */
static struct connections connections_of(const struct view *view)
{
    bool hold = view->step_values && !view->has_kept;
    return (struct connections){hold && view->has_boundary, hold && view->has_lines, hold && view->has_rays,
                                view->mesh.level};
}

/* They are those of another step of the same level, too. */
static void keep_connections(struct view *view, const struct connections *before)
{
    if (view->mesh.level != before->level)
        return;
    view->has_boundary = before->boundary;
    view->has_lines = before->lines;
    view->has_rays = before->rays;
}

static uint32_t go_to_step(struct view *view, uint32_t band, uint32_t step)
{
    enum tetlod_status status = tetlod_seek_step(view->series, view->cursor, band, step, &view->error);
    if (status == TETLOD_OK)
        status = take_values(view);
    if (status != TETLOD_OK)
        view_leave_step(view);
    view->moving = false;
    enum tetlod_status arrived = view_arrive(view);
    return status == TETLOD_OK ? arrived : status;
}

uint32_t view_step(struct view *view, uint32_t band, uint32_t step)
{
    const struct connections before = connections_of(view);
    TETLOD_TRY(go_to_step(view, band, step));
    keep_connections(view, &before);
    return TETLOD_OK;
}

uint32_t view_step_move(struct view *view, uint32_t band, uint32_t step)
{
    const struct connections before = connections_of(view);
    TETLOD_TRY(view_rest(view));
    TETLOD_TRY(view_make_room(view));
    view_copy(view, &view->from);
    TETLOD_TRY(go_to_step(view, band, step));
    view_start_move(view);
    keep_connections(view, &before);
    return TETLOD_OK;
}
