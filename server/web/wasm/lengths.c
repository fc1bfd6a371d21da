/* SPDX-License-Identifier: BSD-3-Clause */
/* The value that colours, along a segment and on a grid. Components are linear on each tetrahedron, their length is
 * not: it is taken of components that were interpolated. */
#include <math.h>
#include <string.h>

#include "format/fail.h"
#include "server/web/wasm/view.h"
#include "src/util/array.h"

/* ---- along a segment ---- */

/* A piece is divided until straight lines between its ends are as good as that, as a part of the longest vector
 * there. */
static const double ACCURACY = 2e-7;
enum { MAX_PARTS = 4096 }; /* of a piece */

static double function_at(const struct view_function *function, const double *a, const double *b, double t)
{
    double row[MAX_FUNCTION_INPUTS];
    for (uint32_t c = 0; c < function->field.components; c++)
        row[c] = a[c] + t * (b[c] - a[c]);
    return view_evaluate(function, row);
}

/* Twice as many until the middle of each part is on the straight line between its ends. */
static uint32_t parts_of_function(const struct view_function *function, const double *a, const double *b,
                                  double accuracy)
{
    uint32_t parts = 1;
    for (bool near = false; !near && parts < MAX_PARTS; parts *= near ? 1 : 2) {
        near = true;
        for (uint32_t i = 0; i < parts && near; i++) {
            double from = function_at(function, a, b, (double)i / parts);
            double to = function_at(function, a, b, (double)(i + 1) / parts);
            for (int k = 1; k < 4 && near; k++) {
                double between = function_at(function, a, b, (i + k / 4.0) / parts);
                near = !(fabs(between - (from + k / 4.0 * (to - from))) > accuracy);
            }
        }
    }
    return parts;
}

static double length_at(const double *a, const double *b, uint32_t components, double t)
{
    double squares = 0;
    for (uint32_t c = 0; c < components; c++) {
        double x = a[c] + t * (b[c] - a[c]);
        squares += x * x;
    }
    return sqrt(squares);
}

/* The length has the second derivative (|d|^2 - (d . u)^2) / |v|, which is largest where the vector is shortest. */
static uint32_t parts_of(const double *a, const double *b, uint32_t components, double accuracy)
{
    double squares = 0, along = 0, bend;
    for (uint32_t c = 0; c < components; c++) {
        squares += (b[c] - a[c]) * (b[c] - a[c]);
        along -= a[c] * (b[c] - a[c]);
    }
    if (!(squares > 0))
        return 1;
    double nearest = fmin(fmax(along / squares, 0), 1), shortest = length_at(a, b, components, nearest);
    double line = length_at(a, b, components, along / squares); // of the whole line's point that is nearest to zero
    bend = shortest > 0 ? squares * line * line / (shortest * shortest * shortest) : INFINITY;
    return (uint32_t)fmin(fmax(ceil(sqrt(bend / (8 * accuracy))), 1), MAX_PARTS);
}

/* `values`: [components * ends] the components at the ends of pieces. */
static bool divide_pieces(struct cut_line *line, const double *values, uint32_t components,
                          const struct view_function *function, struct cut_line *out)
{
    double longest = 0;
    for (size_t e = 0; e < 2 * (size_t)line->count; e++)
        longest = fmax(longest, function ? fabs(view_evaluate(function, values + e * components))
                                         : length_at(values + e * components, values + e * components, components, 0));
    out->count = 0;
    for (size_t k = 0; k < line->count; k++) {
        const double *a = values + 2 * k * components, *b = a + components;
        const struct cut_line_end *ends = line->ends + 2 * k;
        uint32_t parts = function ? parts_of_function(function, a, b, ACCURACY * longest)
                                  : parts_of(a, b, components, ACCURACY * longest);
        if (!ARRAY_RESERVE(out->ends, out->cap, 2 * ((size_t)out->count + parts)))
            return false;
        for (uint32_t i = 0; i < 2 * parts; i++) {
            double t = (double)((i + 1) / 2) / parts; // both ends of each part
            out->ends[2 * (size_t)out->count + i] =
                (struct cut_line_end){ends[0].at + t * (ends[1].at - ends[0].at),
                                      function ? function_at(function, a, b, t) : length_at(a, b, components, t)};
        }
        out->count += parts;
    }
    return true;
}

static void take_component(struct view *view, const struct point_field *field, uint32_t component)
{
    for (size_t v = 0; v < view_drawn(view)->vertex_count; v++)
        view->function[v] = field->values[v * field->components + component];
}

enum tetlod_status view_lengths_along(struct view *view, const double from[3], const double to[3])
{
    const struct point_field *field = view_length_field(view);
    if (!field)
        return cut_along(view_drawn(view), view->shade, view_of_drawn(view), from, to, &view->line, &view->error);
    struct cut_line *pieces = &view->pieces;
    for (uint32_t c = 0; c < field->components; c++) {
        take_component(view, field, c);
        TETLOD_TRY(cut_along(view_drawn(view), view->function, NULL, from, to, pieces, &view->error));
        size_t ends = 2 * (size_t)pieces->count;
        if (!ARRAY_RESERVE(view->at_ends, view->at_end_cap, ends * field->components))
            return tetlodi_fail_nomem(&view->error, "the values along a line", 8 * (uint64_t)ends * field->components);
        for (size_t e = 0; e < ends; e++)
            view->at_ends[e * field->components + c] = pieces->ends[e].value;
    }
    const struct view_function *function = field == &view->defined.field ? &view->defined : NULL;
    if (!divide_pieces(pieces, view->at_ends, field->components, function, &view->line))
        return tetlodi_fail_nomem(&view->error, "the values along a line", 32 * (uint64_t)pieces->count);
    return TETLOD_OK;
}

/* ---- on a grid ---- */

enum tetlod_status view_lengths_on_grid(struct view *view)
{
    const struct point_field *field = view_length_field(view);
    struct cut_grid *grid = &view->grid;
    if (!field || field == &view->defined.field) // a function is taken as linear between vertices here
        return cut_resample(view_drawn(view), view->shade, view_of_drawn(view), grid, &view->error);
    size_t count = (size_t)grid->dims[0] * grid->dims[1] * grid->dims[2];
    if (!ARRAY_RESERVE(view->squares, view->square_cap, count))
        return tetlodi_fail_nomem(&view->error, "a grid", 4 * (uint64_t)count);
    for (uint32_t c = 0; c < field->components; c++) {
        take_component(view, field, c);
        TETLOD_TRY(cut_resample(view_drawn(view), view->function, NULL, grid, &view->error));
        for (size_t i = 0; i < count; i++)
            view->squares[i] = (c ? view->squares[i] : 0) + grid->values[i] * grid->values[i];
    }
    for (size_t i = 0; i < count; i++)
        grid->values[i] = sqrtf(view->squares[i]);
    return TETLOD_OK;
}
