/* SPDX-License-Identifier: BSD-3-Clause */
/* Structured pieces of a whole extent as one grid: points that several pieces have are the same points. */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/readers/vtkxml_document.h"
#include "src/util/array.h"

struct join {
    struct block whole;
    const int64_t *extent; /* of the whole */
    unsigned char *filled; /* [point] */
    struct io_report *report;
};

/* The whole's number of a piece's row (i from the first) of points or, with `cell` 1, of cells. */
static size_t row_at(const int64_t *whole, const int64_t *extent, int64_t j, int64_t k, int cell)
{
    size_t width = (size_t)(whole[1] - whole[0] + 1 - cell), height = (size_t)(whole[3] - whole[2] + 1 - cell);
    return (size_t)(extent[0] - whole[0]) + width * ((size_t)(j - whole[2]) + height * (size_t)(k - whole[4]));
}

static void copy_rows(const struct join *join, const int64_t *extent, const void *from, void *to, size_t size, int cell)
{
    size_t count = (size_t)(extent[1] - extent[0] + 1 - cell);
    const unsigned char *at = from;
    for (int64_t k = extent[4]; k <= extent[5] - cell; k++)
        for (int64_t j = extent[2]; j <= extent[3] - cell; j++, at += count * size)
            memcpy((unsigned char *)to + row_at(join->extent, extent, j, k, cell) * size, at, count * size);
}

static enum tetlod_status start_whole(struct join *join, const struct block *pieces, size_t count,
                                      struct tetlod_error *error)
{
    uint64_t points = 1;
    enum tetlod_type type = TETLOD_FLOAT32;
    for (size_t p = 0; p < count; p++)
        type = pieces[p].mesh.position_type == TETLOD_FLOAT64 ? TETLOD_FLOAT64 : type;
    for (int d = 0; d < 3; d++) {
        join->whole.dims[d] = (uint32_t)(join->extent[2 * d + 1] - join->extent[2 * d] + 1);
        points = points > TETLOD_NONE ? points : points * join->whole.dims[d];
    }
    TETLOD_TRY(assemble_points(&join->whole.mesh, points, type, error));
    join->filled = array_zero((size_t)points, 1);
    return join->filled ? TETLOD_OK : tetlodi_fail_nomem(error, "the joined grid", points);
}

static enum tetlod_status check_extent(const int64_t *whole, const int64_t *extent, size_t piece,
                                       struct tetlod_error *error)
{
    for (int d = 0; d < 6; d += 2)
        if (extent[d] < whole[d] || extent[d + 1] > whole[d + 1])
            return tetlodi_fail(error, TETLOD_ERR_MESH, "the extent of piece %zu is not within the whole extent",
                                piece);
    return TETLOD_OK;
}

/* The field `like` of the first piece; left out where a piece lacks it. */
static enum tetlod_status join_field(struct join *join, struct block *pieces, size_t count, const int64_t (*extents)[6],
                                     const struct point_field *like, bool cell, struct tetlod_error *error)
{
    struct tetmesh *mesh = &join->whole.mesh;
    enum tetlod_type type = TETLOD_FLOAT32;
    bool is_integer = true;
    for (size_t p = 0; p < count; p++) {
        const struct point_field *field = block_find_like(&pieces[p], cell, like);
        if (!field) {
            io_leave_out(join->report, &join->report->partial_arrays, like->name, strlen(like->name));
            return TETLOD_OK;
        }
        type = field->type == TETLOD_FLOAT64 ? TETLOD_FLOAT64 : type;
        is_integer &= field->is_integer;
    }
    if (cell)
        TETLOD_TRY(assemble_cell_field(mesh, like->name, like->components, type, block_cell_count(&join->whole),
                                       error));
    else
        TETLOD_TRY(assemble_field(mesh, like->name, like->components, type, error));
    struct point_field *field = cell ? &mesh->cell_fields[mesh->cell_field_count -
                                                          1] : &mesh->fields[mesh->field_count - 1];
    field->is_integer = is_integer;
    memcpy(field->unit, like->unit, sizeof field->unit);
    for (size_t p = 0; p < count; p++)
        copy_rows(join, extents[p], block_find_like(&pieces[p], cell, like)->values, field->values,
                  like->components * sizeof *field->values, cell);
    return TETLOD_OK;
}

/* All fields, at points or of cells. */
static enum tetlod_status join_fields(struct join *join, struct block *pieces, size_t count,
                                      const int64_t (*extents)[6], bool cell,
                                      struct tetlod_error *error)
{
    const struct tetmesh *first = &pieces[0].mesh;
    for (size_t p = 1; p < count; p++)
        block_note_others(&pieces[0], &pieces[p], cell, join->report);
    for (uint32_t f = 0; f < (cell ? first->cell_field_count : first->field_count); f++)
        TETLOD_TRY(join_field(join, pieces, count, extents, cell ? &first->cell_fields[f] : &first->fields[f], cell,
                              error));
    return TETLOD_OK;
}

static enum tetlod_status join_hidden(struct join *join, struct block *pieces, size_t count,
                                      const int64_t (*extents)[6],
                                      struct tetlod_error *error)
{
    uint64_t cells = block_cell_count(&join->whole);
    bool any = false;
    for (size_t p = 0; p < count; p++)
        any |= pieces[p].hidden != NULL;
    if (!any)
        return TETLOD_OK;
    join->whole.hidden = array_new((size_t)cells, 1);
    if (!join->whole.hidden)
        return tetlodi_fail_nomem(error, "the hidden cells", cells);
    memset(join->whole.hidden, 1, (size_t)cells);
    for (size_t p = 0; p < count; p++) { // a ghost of one piece is a cell of another
        size_t c = 0;
        for (int64_t k = extents[p][4]; k < extents[p][5]; k++)
            for (int64_t j = extents[p][2]; j < extents[p][3]; j++)
                for (int64_t i = 0; i < extents[p][1] - extents[p][0]; i++, c++)
                    if (!pieces[p].hidden || !pieces[p].hidden[c])
                        join->whole.hidden[row_at(join->extent, extents[p], j, k, 1) + (size_t)i] = 0;
    }
    return TETLOD_OK;
}

static enum tetlod_status join_points(struct join *join, struct block *pieces, size_t count,
                                      const int64_t (*extents)[6],
                                      struct tetlod_error *error)
{
    for (size_t p = 0; p < count; p++) {
        unsigned char *ones = array_new(pieces[p].mesh.vertex_count, 1);
        if (!ones)
            return tetlodi_fail_nomem(error, "the joined grid", pieces[p].mesh.vertex_count);
        memset(ones, 1, pieces[p].mesh.vertex_count);
        copy_rows(join, extents[p], ones, join->filled, 1, 0);
        copy_rows(join, extents[p], pieces[p].mesh.positions, join->whole.mesh.positions, 3 * sizeof(double), 0);
        free(ones);
    }
    const unsigned char *hole = memchr(join->filled, 0, join->whole.mesh.vertex_count);
    return hole ? tetlodi_fail(error, TETLOD_ERR_MESH, "no piece has point %td of the whole extent",
                               hole - join->filled)
                : TETLOD_OK;
}

static enum tetlod_status join_all(struct join *join, struct block *pieces, size_t count, const int64_t (*extents)[6],
                                   struct tetlod_error *error)
{
    uint64_t points = 0, wanted = 1;
    for (size_t p = 0; p < count; p++) {
        TETLOD_TRY(check_extent(join->extent, extents[p], p, error));
        points += pieces[p].mesh.vertex_count;
    }
    for (int d = 0; d < 6; d += 2)
        wanted = wanted > points ? wanted : wanted * (uint64_t)(join->extent[d + 1] - join->extent[d] + 1);
    if (wanted > points)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "the pieces have %llu points, fewer than the whole extent",
                            (unsigned long long)points);
    TETLOD_TRY(start_whole(join, pieces, count, error));
    TETLOD_TRY(join_points(join, pieces, count, extents, error));
    TETLOD_TRY(join_fields(join, pieces, count, extents, false, error));
    TETLOD_TRY(join_fields(join, pieces, count, extents, true, error));
    return join_hidden(join, pieces, count, extents, error);
}

enum tetlod_status vtkxml_join(struct blocks *blocks, size_t first, const int64_t (*extents)[6], const int64_t whole[6],
                               struct io_report *report, struct tetlod_error *error)
{
    struct join join = {.extent = whole, .report = report};
    size_t count = blocks->count - first;
    if (count == 0)
        return TETLOD_OK;
    enum tetlod_status status = join_all(&join, blocks->at + first, count, extents, error);
    free(join.filled);
    for (size_t b = first; b < blocks->count; b++)
        block_fini(&blocks->at[b]);
    blocks->at[first] = join.whole;
    blocks->count = first + 1;
    return status;
}
