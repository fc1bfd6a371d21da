/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Several blocks as one: pieces of a partition, blocks of a multi-block file, grids of PLOT3D. Points and cells follow
 * one another; a field is kept where all blocks have it with the same number of components. Structured grids become
 * hexahedra, because the cells of a neighbour must be split alike.
 */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/services/weld_pieces.h"
#include "src/util/array.h"

/* The list of fields of a block, at points or of cells. */
static struct point_field *fields_of(struct block *block, bool cell, uint32_t *count)
{
    *count = cell ? block->mesh.cell_field_count : block->mesh.field_count;
    return cell ? block->mesh.cell_fields : block->mesh.fields;
}

struct point_field *block_find_like(struct block *block, bool cell, const struct point_field *like)
{
    uint32_t count;
    struct point_field *fields = fields_of(block, cell, &count);
    for (uint32_t f = 0; f < count; f++)
        if (fields[f].components == like->components && strcmp(fields[f].name, like->name) == 0)
            return &fields[f];
    return NULL;
}

static uint64_t rows_of(const struct block *block, bool cell)
{
    return cell ? block_cell_count(block) : block->mesh.vertex_count;
}

/* Of what has been copied, only the name is still needed. */
static void drop_values(struct point_field *field)
{
    free(field->values);
    field->values = NULL;
}

/* One field over all blocks; not there if one of them lacks it. */
static enum tetlod_status merge_field(struct blocks *blocks, struct block *out, bool cell,
                                      const struct point_field *like,
                                      struct io_report *report, struct tetlod_error *error)
{
    enum tetlod_type type = TETLOD_FLOAT32;
    bool is_integer = true;
    for (size_t b = 0; b < blocks->count; b++) {
        const struct point_field *field = block_find_like(&blocks->at[b], cell, like);
        if (!rows_of(&blocks->at[b], cell))
            continue;
        if (!field) {
            io_leave_out(report, &report->partial_arrays, like->name, strlen(like->name));
            return TETLOD_OK;
        }
        type = field->type == TETLOD_FLOAT64 ? TETLOD_FLOAT64 : type;
        is_integer &= field->is_integer;
    }
    if (cell)
        TETLOD_TRY(assemble_cell_field(&out->mesh, like->name, like->components, type, rows_of(out, true), error));
    else
        TETLOD_TRY(assemble_field(&out->mesh, like->name, like->components, type, error));
    uint32_t count;
    struct point_field *merged = fields_of(out, cell,
                                           &count) + (cell ? out->mesh.cell_field_count : out->mesh.field_count) - 1;
    double *at = merged->values;
    merged->is_integer = is_integer;
    memcpy(merged->unit, like->unit, sizeof merged->unit);
    for (size_t b = 0; b < blocks->count; b++) {
        struct point_field *field = block_find_like(&blocks->at[b], cell, like);
        size_t size = (size_t)rows_of(&blocks->at[b], cell) * like->components;
        if (size)
            memcpy(at, field->values, size * sizeof *at);
        at += size;
        if (field)
            drop_values(field);
    }
    return TETLOD_OK;
}

void block_note_others(struct block *first, struct block *block, bool cell, struct io_report *report)
{
    uint32_t count;
    struct point_field *fields = fields_of(block, cell, &count);
    for (uint32_t f = 0; f < count; f++)
        if (!block_find_like(first, cell, &fields[f]))
            io_leave_out(report, &report->partial_arrays, fields[f].name, strlen(fields[f].name));
}

/* The fields of the first block that has points or cells, as far as all others have them. */
static enum tetlod_status merge_fields(struct blocks *blocks, struct block *out, bool cell, struct io_report *report,
                                       struct tetlod_error *error)
{
    uint32_t count = 0;
    struct block *first = NULL;
    for (size_t b = 0; b < blocks->count; b++) {
        if (!rows_of(&blocks->at[b], cell))
            continue;
        first = first ? first : &blocks->at[b];
        block_note_others(first, &blocks->at[b], cell, report);
    }
    struct point_field *fields = first ? fields_of(first, cell, &count) : NULL;
    for (uint32_t f = 0; f < count; f++)
        TETLOD_TRY(merge_field(blocks, out, cell, &fields[f], report, error));
    return TETLOD_OK;
}

static enum tetlod_status merge_points(struct blocks *blocks, struct block *out, struct tetlod_error *error)
{
    uint64_t count = 0;
    enum tetlod_type type = TETLOD_FLOAT32;
    for (size_t b = 0; b < blocks->count; b++) {
        const struct tetmesh *mesh = &blocks->at[b].mesh;
        count += mesh->vertex_count;
        if (mesh->vertex_count && mesh->position_type == TETLOD_FLOAT64)
            type = TETLOD_FLOAT64;
    }
    TETLOD_TRY(assemble_points(&out->mesh, count, type, error));
    double *at = out->mesh.positions;
    for (size_t b = 0; b < blocks->count; b++) {
        struct tetmesh *mesh = &blocks->at[b].mesh;
        if (mesh->vertex_count)
            memcpy(at, mesh->positions, 3 * (size_t)mesh->vertex_count * sizeof *at);
        at += 3 * (size_t)mesh->vertex_count;
        free(mesh->positions);
        mesh->positions = NULL;
    }
    return TETLOD_OK;
}

/* Writes the hexahedra of a structured grid, in the order of its cells. */
static void put_hexahedra(const uint32_t dims[3], uint32_t first_point, uint32_t *out)
{
    uint32_t row = dims[0], slab = dims[0] * dims[1];
    for (uint32_t k = 0; k + 1 < dims[2]; k++)
        for (uint32_t j = 0; j + 1 < dims[1]; j++)
            for (uint32_t i = 0; i + 1 < dims[0]; i++, out += 8) {
                uint32_t o = first_point + i + row * j + slab * k;
                const uint32_t cell[8] = {o,        o + 1,        o + row + 1,        o + row,
                                          o + slab, o + slab + 1, o + slab + row + 1, o + slab + row};
                memcpy(out, cell, sizeof cell);
            }
}

enum tetlod_status cells_of_grid(const uint32_t dims[3], struct cells *out, struct tetlod_error *error)
{
    struct block grid = {.dims = {dims[0], dims[1], dims[2]}};
    uint64_t count = block_cell_count(&grid);
    *out = (struct cells){.count = count, .connectivity_count = 8 * count};
    out->types = array_new((size_t)count, 1);
    out->offsets = array_new((size_t)count + 1, sizeof *out->offsets);
    out->connectivity = array_new((size_t)count, 8 * sizeof *out->connectivity);
    if (!out->types || !out->offsets || !out->connectivity)
        return tetlodi_fail_nomem(error, "the cells", count * 41);
    memset(out->types, VTK_TYPE_HEXAHEDRON, (size_t)count);
    for (uint64_t c = 0; c <= count; c++)
        out->offsets[c] = 8 * c;
    put_hexahedra(dims, 0, out->connectivity);
    return TETLOD_OK;
}

static uint64_t connectivity_of(const struct block *block)
{
    return block->dims[0] ? 8 * block_cell_count(block) : block->cells.connectivity_count;
}

/* Shifts the points of copied cells; the counts in the face streams of polyhedra stay. */
static void shift_cell(unsigned char type, uint32_t *corners, uint64_t count, uint32_t first_point,
                       uint32_t point_count)
{
    uint64_t next_count = type == VTK_TYPE_POLYHEDRON ? 0 : UINT64_MAX; // where the next count is
    for (uint64_t i = 0; i < count; i++) {
        if (i == next_count)
            next_count = i == 0 ? 1 : i + 1 + (uint64_t)corners[i];
        else
            corners[i] = corners[i] < point_count ? corners[i] + first_point : TETLOD_NONE;
    }
}

/* Copies the cells of a block; `shifts`: their points are counted from its own first. */
static void copy_cells(const struct block *block, struct cells *out, bool shifts, uint32_t first_point)
{
    const struct cells *cells = &block->cells;
    uint64_t count = block_cell_count(block), at = out->connectivity_count, size = connectivity_of(block);
    uint64_t each = block->dims[0] ? 8 : 4;
    for (uint64_t c = 0; c < count && out->types; c++) {
        out->types[out->count +
                   c] = block->dims[0] ? VTK_TYPE_HEXAHEDRON : cells->types ? cells->types[c] : VTK_TYPE_TET;
        out->offsets[out->count + c + 1] = at + (cells->offsets ? cells->offsets[c + 1] : each * (c + 1));
    }
    if (block->dims[0])
        put_hexahedra(block->dims, first_point, out->connectivity + at);
    else if (size) {
        memcpy(out->connectivity + at, cells->connectivity, (size_t)size * sizeof *cells->connectivity);
        for (uint64_t c = out->count; c < out->count + count && out->types && shifts; c++)
            shift_cell(out->types[c], out->connectivity + out->offsets[c], out->offsets[c + 1] - out->offsets[c],
                       first_point,
                       block->mesh.vertex_count);
        if (!out->types && shifts)
            shift_cell(VTK_TYPE_TET, out->connectivity + at, size, first_point, block->mesh.vertex_count);
    }
    out->count += count;
    out->connectivity_count += size;
}

/* Of cells that have been copied, only their number is still needed. */
static void drop_cells(struct cells *cells)
{
    uint64_t count = cells->count;
    cells_fini(cells);
    cells->count = count;
}

/* Offsets that do not fit would let shift_cell run out of the array. */
static enum tetlod_status check_offsets(const struct block *block, struct tetlod_error *error)
{
    const struct cells *cells = &block->cells;
    for (uint64_t c = 0; cells->offsets && c < cells->count; c++)
        if (cells->offsets[c] > cells->offsets[c + 1] || cells->offsets[c + 1] > cells->connectivity_count)
            return tetlodi_fail(error, TETLOD_ERR_MESH, "cell %llu: its offsets %llu..%llu do not fit the %llu corners",
                                (unsigned long long)c, (unsigned long long)cells->offsets[c],
                                (unsigned long long)cells->offsets[c +
                                                                   1], (unsigned long long)cells->connectivity_count);
    return cells->offsets && cells->offsets[0] != 0 ? tetlodi_fail(error, TETLOD_ERR_MESH,
                                                                   "cell 0 does not begin at offset 0")
                                                    : TETLOD_OK;
}

static enum tetlod_status merge_cells(struct blocks *blocks, struct block *out, bool shifts,
                                      struct tetlod_error *error)
{
    uint64_t count = 0, connectivity = 0, done = 0;
    uint32_t first_point = 0;
    bool hides = false, only_tets = true;
    for (size_t b = 0; b < blocks->count; b++) {
        TETLOD_TRY(check_offsets(&blocks->at[b], error));
        only_tets &= !blocks->at[b].dims[0] && (!blocks->at[b].cells.types || !blocks->at[b].cells.count);
        count += block_cell_count(&blocks->at[b]);
        connectivity += connectivity_of(&blocks->at[b]);
        hides |= blocks->at[b].hidden != NULL;
    }
    struct cells *cells = &out->cells;
    cells->types = only_tets ? NULL : array_new((size_t)count, 1);
    cells->offsets = only_tets ? NULL : array_zero((size_t)count + 1, sizeof *cells->offsets);
    cells->connectivity = array_new((size_t)connectivity, sizeof *cells->connectivity);
    out->hidden = hides ? array_zero((size_t)count, 1) : NULL;
    if ((!only_tets && (!cells->types || !cells->offsets)) || !cells->connectivity || (hides && !out->hidden))
        return tetlodi_fail_nomem(error, "the cells", count * 9 + connectivity * 4);
    for (size_t b = 0; b < blocks->count; b++) {
        struct block *block = &blocks->at[b];
        uint64_t here = block_cell_count(block);
        copy_cells(block, cells, shifts, first_point);
        if (block->hidden && here)
            memcpy(out->hidden + done, block->hidden, (size_t)here);
        done += here;
        first_point += block->mesh.vertex_count;
        drop_cells(&block->cells);
    }
    return TETLOD_OK;
}

static enum tetlod_status merge_all(struct blocks *blocks, struct block *out, bool shifts, struct io_report *report,
                                    struct tetlod_error *error)
{
    TETLOD_TRY(merge_points(blocks, out, error));
    TETLOD_TRY(merge_cells(blocks, out, shifts, error));
    TETLOD_TRY(merge_fields(blocks, out, false, report, error));
    return merge_fields(blocks, out, true, report, error);
}

enum tetlod_status blocks_join_ranges(struct blocks *blocks, struct io_report *report, struct tetlod_error *error)
{
    size_t kept = 0;
    for (size_t b = 0, end; b < blocks->count; b = end) {
        struct block whole = {0};
        for (end = b + 1; end < blocks->count && blocks->at[end].goes_on;)
            end++;
        if (end > b + 1) {
            enum tetlod_status status = merge_all(&(struct blocks){blocks->at + b, end - b, 0}, &whole, false, report,
                                                  error);
            for (size_t i = b; i < end; i++)
                block_fini(&blocks->at[i]);
            blocks->at[b] = whole;
            TETLOD_TRY(status);
        }
        whole = blocks->at[b];
        blocks->at[b] = (struct block){0};
        blocks->at[kept++] = whole;
    }
    blocks->count = kept;
    return TETLOD_OK;
}

/* Which block each point is of. */
static uint32_t *list_origins(const struct blocks *blocks)
{
    size_t count = 0, at = 0;
    for (size_t b = 0; b < blocks->count; b++)
        count += blocks->at[b].mesh.vertex_count;
    uint32_t *origins = array_new(count, sizeof *origins);
    for (size_t b = 0; b < blocks->count && origins; b++)
        for (uint32_t v = 0; v < blocks->at[b].mesh.vertex_count; v++)
            origins[at++] = weld_origin(b, blocks->at[b].dims[0] != 0);
    return origins;
}

enum tetlod_status blocks_merge(struct blocks *blocks, const struct io_read_options *options, struct block *out,
                                struct io_report *report, struct tetlod_error *error)
{
    const double weld = options->welds ? options->weld : -1;
    const bool drops = options->drop_degenerate;
    *out = (struct block){0};
    if (blocks->count == 1 && (weld < 0 || !blocks->at[0].dims[0])) {
        *out = blocks->at[0];
        blocks->count = 0;
        return weld < 0 ? TETLOD_OK : block_weld(out, weld, NULL, drops, report, error);
    }
    report->blocks = blocks->count;
    uint64_t *points = NULL, *cells = NULL;
    uint32_t *origins = weld < 0 ? list_origins(blocks) : NULL;
    bool joined = false;
    enum tetlod_status status = weld < 0 && !origins ? tetlodi_fail_nomem(error, "the points' pieces", blocks->count)
                                                     : blocks_numbers(blocks, false, &points, error);
    if (status == TETLOD_OK && points)
        status = blocks_numbers(blocks, true, &cells, error);
    if (status == TETLOD_OK)
        status = merge_all(blocks, out, true, report, error);
    if (status == TETLOD_OK)
        blocks_fini(blocks);
    if (status == TETLOD_OK && points)
        status = block_join_numbered(out, points, cells, drops, &joined, report, error);
    free(points);
    free(cells);
    if (status == TETLOD_OK && (!joined || weld >= 0))
        status = block_weld(out, weld < 0 ? 0 : weld, origins, drops, report, error);
    free(origins);
    return status;
}
