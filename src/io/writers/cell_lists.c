/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/writers/cell_lists.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/mixed_cells.h"
#include "src/util/array.h"

/* The points of one cell, each once. */
struct points {
    uint32_t *at;
    size_t count;
};

static void add_point(void *opaque, uint32_t *point)
{
    struct points *points = opaque;
    for (size_t i = 0; i < points->count; i++)
        if (points->at[i] == *point)
            return;
    points->at[points->count++] = *point;
}

static void add_polyhedron(struct cell_lists *out, const struct cells *cells, size_t c)
{
    struct points points = {out->connectivity + out->connectivity_count, 0};
    size_t size = (size_t)(cells->offsets[c + 1] - cells->offsets[c]);
    cells_visit_points(cells, c, add_point, &points);
    out->connectivity_count += points.count;
    memcpy(out->faces + out->face_count, cells->connectivity + cells->offsets[c], size * sizeof *out->faces);
    out->face_count += size;
    out->face_ends[c] = (uint32_t)out->face_count;
}

static void add_cell(struct cell_lists *out, const struct cells *cells, size_t c)
{
    size_t size = (size_t)(cells->offsets[c + 1] - cells->offsets[c]);
    out->types[c] = cells->types[c];
    out->face_ends[c] = UINT32_MAX;
    if (cells->types[c] == VTK_TYPE_POLYHEDRON) {
        add_polyhedron(out, cells, c);
    } else {
        memcpy(out->connectivity + out->connectivity_count, cells->connectivity + cells->offsets[c],
               size * sizeof *out->connectivity);
        out->connectivity_count += size;
    }
    out->ends[c] = (uint32_t)out->connectivity_count;
}

enum tetlod_status cell_lists_make(struct cell_lists *out, const struct cells *cells, struct tetlod_error *error)
{
    size_t count = (size_t)cells->count, size = (size_t)cells->connectivity_count;
    *out = (struct cell_lists){.cell_count = count};
    if (cells->connectivity_count > INT32_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "the cells have more corners than files are written with");
    out->connectivity = array_new(size, sizeof *out->connectivity);
    out->faces = array_new(size, sizeof *out->faces);
    out->ends = array_new(count, sizeof *out->ends);
    out->types = array_new(count, sizeof *out->types);
    out->face_ends = array_new(count, sizeof *out->face_ends);
    if (!out->connectivity || !out->faces || !out->ends || !out->types || !out->face_ends)
        return tetlodi_fail_nomem(error, "the original cells", 8 * (uint64_t)size + 12 * (uint64_t)count);
    for (size_t c = 0; c < count; c++)
        add_cell(out, cells, c);
    return TETLOD_OK;
}

void cell_lists_fini(struct cell_lists *lists)
{
    free(lists->connectivity);
    free(lists->faces);
    free(lists->ends);
    free(lists->types);
    free(lists->face_ends);
    *lists = (struct cell_lists){0};
}
