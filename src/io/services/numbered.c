/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Pieces whose points have numbers in the whole mesh: points of one number are one point, whatever lies at the same
 * place, and points and cells get into the order of their numbers. So it does not show into which pieces a mesh was
 * cut. A cut along a crack, or between bodies that touch, is not glued.
 */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/services/assemble.h"
#include "src/util/array.h"

/* ---- what numbers there are */

/* Fields that other programs keep these numbers in: VTK's, and those of its readers. */
static const char *const names[2][4] = {{"GlobalPointIds", "GlobalNodeIds", "GlobalNodeId", NULL},
                                        {"GlobalCellIds", "GlobalElementIds", "GlobalElementId", NULL}};

static const struct point_field *find_numbers(const struct tetmesh *mesh, bool cell)
{
    const struct point_field *fields = cell ? mesh->cell_fields : mesh->fields;
    uint32_t count = cell ? mesh->cell_field_count : mesh->field_count;
    for (const char *const *name = names[cell]; *name; name++)
        for (uint32_t f = 0; f < count; f++)
            if (fields[f].components == 1 && strcmp(fields[f].name, *name) == 0)
                return &fields[f];
    return NULL;
}

/* A block's numbers. False: it does not say them all. */
static bool copy_numbers(const struct block *block, bool cell, size_t rows, uint64_t *out)
{
    const double largest = 9007199254740992; // whole numbers beyond may be rounded
    const uint64_t *own = cell ? block->cell_numbers : block->point_numbers;
    const struct point_field *field = own ? NULL : find_numbers(&block->mesh, cell);
    if (own)
        memcpy(out, own, rows * sizeof *out);
    for (size_t i = 0; i < rows && field; i++) {
        if (!(field->values[i] >= 0 && field->values[i] < largest))
            return false;
        out[i] = (uint64_t)field->values[i];
    }
    return own || field;
}

enum tetlod_status blocks_numbers(struct blocks *blocks, bool cell, uint64_t **out, struct tetlod_error *error)
{
    uint64_t count = 0, at = 0;
    bool known = true;
    *out = NULL;
    for (size_t b = 0; b < blocks->count; b++)
        count += cell ? block_cell_count(&blocks->at[b]) : blocks->at[b].mesh.vertex_count;
    uint64_t *numbers = array_new((size_t)count, sizeof *numbers);
    if (!numbers)
        return tetlodi_fail_nomem(error, "the numbers of the pieces", count * sizeof *numbers);
    for (size_t b = 0; b < blocks->count && known; b++) {
        uint64_t rows = cell ? block_cell_count(&blocks->at[b]) : blocks->at[b].mesh.vertex_count;
        known = !rows || copy_numbers(&blocks->at[b], cell, (size_t)rows, numbers + at);
        at += rows;
    }
    if (known)
        *out = numbers;
    else
        free(numbers);
    return TETLOD_OK;
}

/* ---- order */

struct numbered {
    uint64_t number, row;
};

static int by_number(const void *a, const void *b)
{
    const struct numbered *x = a, *y = b;
    return x->number != y->number ? (x->number > y->number) - (x->number < y->number) : (x->row > y->row) -
                                                                                        (x->row < y->row);
}

/* Rows in the order of their numbers, those of one number in their own. */
static struct numbered *sort(const uint64_t *numbers, uint64_t count)
{
    struct numbered *order = array_new((size_t)count, sizeof *order);
    bool sorted = true;
    for (uint64_t i = 0; i < count && order; i++) {
        order[i] = (struct numbered){numbers[i], i};
        sorted &= !i || numbers[i - 1] <= numbers[i];
    }
    if (order && !sorted)
        qsort(order, (size_t)count, sizeof *order, by_number);
    return order;
}

/* The rows that order lists, `size` bytes each; frees `from`. NULL: no memory. */
static void *arrange(void *from, const struct numbered *order, uint64_t count, size_t size)
{
    unsigned char *out = array_new((size_t)count, size);
    for (uint64_t i = 0; i < count && out; i++)
        memcpy(out + i * size, (const unsigned char *)from + order[i].row * size, size);
    free(from);
    return out;
}

static bool arrange_fields(struct point_field *fields, uint32_t field_count, const struct numbered *order,
                           uint64_t count)
{
    bool good = true;
    for (uint32_t f = 0; f < field_count; f++) {
        fields[f].values = arrange(fields[f].values, order, count, fields[f].components * sizeof(double));
        good &= fields[f].values != NULL;
    }
    return good;
}

/* ---- points */

/* Are the points of each number at one place? Counts those with other values. */
static bool places_fit(const struct tetmesh *mesh, const struct numbered *order, struct io_report *report)
{
    uint64_t other = 0;
    for (uint32_t i = 1; i < mesh->vertex_count; i++) {
        if (order[i].number != order[i - 1].number)
            continue;
        uint32_t a = (uint32_t)order[i - 1].row, b = (uint32_t)order[i].row;
        const double *p = mesh->positions + 3 * (size_t)a, *q = mesh->positions + 3 * (size_t)b;
        if (!(p[0] == q[0] && p[1] == q[1] && p[2] == q[2]))
            return false;
        other += !mesh_same_values(mesh, a, b);
    }
    report->other_values += other;
    return true;
}

/* Keeps the first point of each number. */
static enum tetlod_status join_points(struct block *block, struct numbered *order, bool drops,
                                      struct io_report *report, struct tetlod_error *error)
{
    struct tetmesh *mesh = &block->mesh;
    uint32_t count = mesh->vertex_count, kept = 0;
    uint32_t *target = array_new(count, sizeof *target);
    if (!target)
        return tetlodi_fail_nomem(error, "the points of the pieces", count * (uint64_t)sizeof *target);
    for (uint32_t i = 0; i < count; i++) {
        if (!i || order[i].number != order[kept - 1].number)
            order[kept++] = order[i];
        target[order[i].row] = kept - 1;
    }
    block_redirect(block, target);
    enum tetlod_status status = drops ? TETLOD_OK : block_check_twice(block, target, error);
    free(target);
    TETLOD_TRY(status);
    report->welded_points += count - kept;
    mesh->positions = arrange(mesh->positions, order, kept, 3 * sizeof *mesh->positions);
    bool good = arrange_fields(mesh->fields, mesh->field_count, order, kept) && mesh->positions;
    mesh->vertex_count = kept;
    return good ? TETLOD_OK : tetlodi_fail_nomem(error, "the points of the pieces", kept * UINT64_C(24));
}

/* ---- cells */

static bool arrange_cells(struct cells *cells, const struct numbered *order)
{
    uint64_t at = 0, *offsets = cells->offsets ? array_new((size_t)cells->count + 1, sizeof *offsets) : NULL;
    uint32_t *connectivity = array_new((size_t)cells->connectivity_count, sizeof *connectivity);
    bool good = connectivity && (offsets || !cells->offsets);
    for (uint64_t i = 0; i < cells->count && good; i++) {
        uint64_t begin = cells->offsets ? cells->offsets[order[i].row] : 4 * order[i].row,
                 size = cells->offsets ? cells->offsets[order[i].row + 1] - begin : 4;
        memcpy(connectivity + at, cells->connectivity + begin, (size_t)size * sizeof *connectivity);
        at += size;
        if (offsets)
            offsets[i + 1] = at;
    }
    if (!good) {
        free(offsets);
        free(connectivity);
        return false;
    }
    if (offsets)
        offsets[0] = 0;
    free(cells->offsets);
    free(cells->connectivity);
    cells->offsets = offsets;
    cells->connectivity = connectivity;
    if (cells->types)
        cells->types = arrange(cells->types, order, cells->count, 1);
    return cells->types || !offsets;
}

/* Is a number that of two cells that are both there? Then numbers tell nothing. */
static bool is_ambiguous(const struct block *block, const struct numbered *order)
{
    const unsigned char *hidden = block->hidden;
    uint64_t last = UINT64_MAX;
    for (uint64_t i = 0; i < block->cells.count; i++) {
        if (hidden && hidden[order[i].row])
            continue;
        if (last != UINT64_MAX && order[i].number == order[last].number)
            return true;
        last = i;
    }
    return false;
}

static enum tetlod_status order_cells(struct block *block, const uint64_t *numbers, struct tetlod_error *error)
{
    struct numbered *order = sort(numbers, block->cells.count);
    const struct cells *list = &block->cells;
    bool good = order != NULL, whole = list->offsets || list->connectivity_count == 4 * list->count;
    if (good && whole && !is_ambiguous(block, order)) {
        good = arrange_cells(&block->cells, order) &&
               arrange_fields(block->mesh.cell_fields, block->mesh.cell_field_count, order, block->cells.count);
        if (block->hidden)
            good &= (block->hidden = arrange(block->hidden, order, block->cells.count, 1)) != NULL;
    }
    free(order);
    return good ? TETLOD_OK : tetlodi_fail_nomem(error, "the cells of the pieces", block->cells.count * 16);
}

/* Numbers that each piece has counted by itself would keep points at one place apart. */
static void drop_numbers(struct tetmesh *mesh, struct io_report *report)
{
    const struct point_field *found = find_numbers(mesh, false);
    if (!found)
        return;
    struct point_field *field = &mesh->fields[found - mesh->fields];
    io_leave_out(report, &report->own_numbers, field->name, strlen(field->name));
    point_field_fini(field);
    mesh->field_count--;
    memmove(field, field + 1, (size_t)(mesh->fields + mesh->field_count - field) * sizeof *field);
}

enum tetlod_status block_join_numbered(struct block *block, const uint64_t *points, const uint64_t *cells, bool drops,
                                       bool *fits, struct io_report *report, struct tetlod_error *error)
{
    struct numbered *order = sort(points, block->mesh.vertex_count);
    if (!order)
        return tetlodi_fail_nomem(error, "the points of the pieces", block->mesh.vertex_count * UINT64_C(16));
    *fits = places_fit(&block->mesh, order, report);
    enum tetlod_status status = *fits ? join_points(block, order, drops, report, error) : TETLOD_OK;
    if (!*fits)
        drop_numbers(&block->mesh, report);
    free(order);
    return status == TETLOD_OK && *fits && cells ? order_cells(block, cells, error) : status;
}
