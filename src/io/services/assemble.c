/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/services/assemble.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/utf8_clean.h"

enum { MAX_COMPONENTS = 4096 }; // more than any field of a mesh has

enum tetlod_status assemble_points(struct tetmesh *mesh, uint64_t count, enum tetlod_type type,
                                   struct tetlod_error *error)
{
    if (count >= TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "%llu points are more than the %u that fit",
                            (unsigned long long)count, TETLOD_NONE - 1);
    mesh->positions = array_zero((size_t)count, 3 * sizeof *mesh->positions);
    if (!mesh->positions)
        return tetlodi_fail_nomem(error, "the points", count * 24);
    mesh->vertex_count = (uint32_t)count;
    mesh->position_type = type;
    return TETLOD_OK;
}

enum tetlod_status assemble_points_of(struct tetmesh *mesh, uint64_t count, double **positions, enum tetlod_type type,
                                      struct tetlod_error *error)
{
    enum tetlod_status status = assemble_points(mesh, count, type, error);
    if (status == TETLOD_OK && *positions) {
        free(mesh->positions);
        mesh->positions = array_shrink(*positions, (size_t)count, 3 * sizeof **positions);
    } else
        free(*positions);
    *positions = NULL;
    return status;
}

/* A name that can be stored and that `find` does not know yet; the caller frees it. */
static char *clean_name(const struct tetmesh *mesh, const char *name,
                        uint32_t (*find)(const struct tetmesh *mesh, const char *name), uint32_t count)
{
    size_t capacity = strlen(name) + 32, length;
    char *clean = array_new(capacity, 1);
    if (!clean)
        return NULL;
    snprintf(clean, capacity, "%s", *name ? name : "field");
    utf8_clean(clean);
    length = strlen(clean);
    for (uint32_t n = count + 1; find(mesh, clean) != TETLOD_NONE; n++)
        snprintf(clean + length, capacity - length, "_%u", n);
    return clean;
}

static enum tetlod_status check_components(const char *name, uint64_t components, struct tetlod_error *error)
{
    if (components >= 1 && components <= MAX_COMPONENTS)
        return TETLOD_OK;
    return tetlodi_fail(error, TETLOD_ERR_MESH, "array '%.80s' has %llu components, not 1 to %d", name,
                        (unsigned long long)components, MAX_COMPONENTS);
}

enum tetlod_status assemble_field(struct tetmesh *mesh, const char *name, uint64_t components, enum tetlod_type type,
                                  struct tetlod_error *error)
{
    TETLOD_TRY(check_components(name, components, error));
    char *clean = clean_name(mesh, name, tetmesh_find_field, mesh->field_count);
    if (!clean)
        return tetlodi_fail_nomem(error, "a field's name", strlen(name));
    enum tetlod_status status = tetmesh_add_field(mesh, clean, (uint32_t)components, type, error);
    free(clean);
    return status;
}

bool block_path_has(const char *path, const char *name)
{
    size_t length = strlen(name);
    for (const char *at = path; *at; at++)
        if (*at == '/' && strncmp(at + 1, name, length) == 0 && at[1 + length] == '/')
            return true;
    return false;
}

bool values_are_whole(const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (values[i] != trunc(values[i]))
            return false;
    return true;
}

bool assemble_vector_name(const char *const names[3], char *out, size_t size)
{
    size_t length = strlen(names[0]);
    for (int d = 0; d < 3; d++)
        if (length < 2 || length >= size || strlen(names[d]) != length ||
            strncmp(names[d], names[0], length - 1) != 0 ||
            (names[d][length - 1] | 32) != "xyz"[d])
            return false;
    length -= length > 2 && names[0][length - 2] == '_' ? 2 : 1;
    memcpy(out, names[0], length);
    out[length] = 0;
    return true;
}

enum tetlod_status assemble_cell_field(struct tetmesh *mesh, const char *name, uint64_t components,
                                       enum tetlod_type type, uint64_t cells, struct tetlod_error *error)
{
    TETLOD_TRY(check_components(name, components, error));
    char *clean = clean_name(mesh, name, tetmesh_find_cell_field, mesh->cell_field_count);
    if (!clean)
        return tetlodi_fail_nomem(error, "a field's name", strlen(name));
    enum tetlod_status status = tetmesh_add_cell_field(mesh, clean, (uint32_t)components, type, cells, error);
    free(clean);
    return status;
}

void unit_set(char unit[UNIT_SIZE], const char *text, size_t length)
{
    while (length && (unsigned char)*text <= ' ') {
        text++;
        length--;
    }
    while (length && (unsigned char)text[length - 1] <= ' ')
        length--;
    unit[0] = 0;
    if (length >= UNIT_SIZE)
        return;
    memcpy(unit, text, length);
    unit[length] = 0;
    utf8_clean(unit);
}

void unit_of_powers(char unit[UNIT_SIZE], const char *const *names, const double *exponents, size_t count)
{
    char text[8 * UNIT_SIZE] = "";
    size_t length = 0;
    for (size_t i = 0; i < count && length < sizeof text - UNIT_SIZE; i++) {
        const char *space = length ? " " : "";
        if (exponents[i] == 1)
            length += (size_t)snprintf(text + length, UNIT_SIZE, "%s%s", space, names[i]);
        else if (exponents[i] != 0)
            length += (size_t)snprintf(text + length, UNIT_SIZE, "%s%s^%.4g", space, names[i], exponents[i]);
    }
    unit_set(unit, text, length);
}

/* Room for one more cell's number, those before it 0. */
static enum tetlod_status numbers_room(struct cell_numbers *numbers, uint64_t count, struct tetlod_error *error)
{
    if (!ARRAY_RESERVE(numbers->values, numbers->capacity, (size_t)count))
        return tetlodi_fail_nomem(error, "the numbers of cells", count * sizeof *numbers->values);
    while (numbers->count < count)
        numbers->values[numbers->count++] = 0;
    return TETLOD_OK;
}

enum tetlod_status cell_numbers_add(struct cell_numbers *numbers, uint64_t cell, int64_t number,
                                    struct tetlod_error *error)
{
    if (number == 0)
        return TETLOD_OK;
    TETLOD_TRY(numbers_room(numbers, cell + 1, error));
    numbers->values[cell] = (double)number;
    return TETLOD_OK;
}

enum tetlod_status cell_numbers_to_field(struct cell_numbers *numbers, struct tetmesh *mesh, const char *name,
                                         uint64_t cells,
                                         struct tetlod_error *error)
{
    if (!numbers->values)
        return TETLOD_OK;
    TETLOD_TRY(numbers_room(numbers, cells, error));
    TETLOD_TRY(assemble_cell_field(mesh, name, 1, TETLOD_FLOAT64, 0, error));
    struct point_field *field = &mesh->cell_fields[mesh->cell_field_count - 1];
    free(field->values);
    field->values = array_shrink(numbers->values, (size_t)cells, sizeof *numbers->values);
    field->is_integer = true;
    *numbers = (struct cell_numbers){0};
    return TETLOD_OK;
}

void cell_numbers_fini(struct cell_numbers *numbers)
{
    free(numbers->values);
    *numbers = (struct cell_numbers){0};
}

/* Room for the types and offsets of so many cells. */
static enum tetlod_status types_room(struct cells *cells, size_t count, struct tetlod_error *error)
{
    if (!ARRAY_RESERVE(cells->types, cells->type_capacity, count ? count : 1) ||
        !ARRAY_RESERVE(cells->offsets, cells->offset_capacity, count + 1))
        return tetlodi_fail_nomem(error, "the cells", (uint64_t)count * 9);
    return TETLOD_OK;
}

enum tetlod_status cells_give_types(struct cells *cells, struct tetlod_error *error)
{
    TETLOD_TRY(types_room(cells, (size_t)cells->count, error));
    memset(cells->types, VTK_TYPE_TET, (size_t)cells->count);
    for (uint64_t c = 0; c <= cells->count; c++)
        cells->offsets[c] = 4 * c;
    return TETLOD_OK;
}

void cells_drop_types(struct cells *cells)
{
    for (uint64_t c = 0; c < cells->count; c++)
        if (cells->types[c] != VTK_TYPE_TET || cells->offsets[c] != 4 * c || cells->offsets[c + 1] != 4 * c + 4)
            return;
    if (!cells->count || cells->connectivity_count != 4 * cells->count)
        return;
    free(cells->types);
    free(cells->offsets);
    cells->types = NULL;
    cells->offsets = NULL;
    cells->type_capacity = cells->offset_capacity = 0;
}

/* Room for one more cell and its corners. While all cells are tetrahedra, they have no types. */
static enum tetlod_status cells_room(struct cells *cells, unsigned char type, size_t corner_count,
                                     struct tetlod_error *error)
{
    size_t filled = (size_t)cells->connectivity_count;
    if (!ARRAY_RESERVE(cells->connectivity, cells->connectivity_capacity, filled + corner_count))
        return tetlodi_fail_nomem(error, "the cells", (uint64_t)filled * sizeof *cells->connectivity);
    if (!cells->types && type == VTK_TYPE_TET && corner_count == 4)
        return TETLOD_OK;
    if (!cells->types)
        TETLOD_TRY(cells_give_types(cells, error));
    return types_room(cells, (size_t)cells->count + 1, error);
}

static void close_cell(struct cells *cells, unsigned char type, size_t corner_count)
{
    cells->connectivity_count += corner_count;
    cells->count++;
    if (!cells->types)
        return;
    cells->types[cells->count - 1] = type;
    cells->offsets[cells->count] = cells->connectivity_count;
}

enum tetlod_status cells_add(struct cells *cells, unsigned char type, const int64_t *corners, size_t corner_count,
                             struct tetlod_error *error)
{
    TETLOD_TRY(cells_room(cells, type, corner_count, error));
    for (size_t i = 0; i < corner_count; i++)
        cells->connectivity[cells->connectivity_count + i] = cells_point(corners[i]);
    close_cell(cells, type, corner_count);
    return TETLOD_OK;
}

enum tetlod_status cells_add_numbers(struct cells *cells, unsigned char type, const uint32_t *corners,
                                     size_t corner_count,
                                     struct tetlod_error *error)
{
    TETLOD_TRY(cells_room(cells, type, corner_count, error));
    if (corner_count)
        memcpy(cells->connectivity + cells->connectivity_count, corners, corner_count * sizeof *corners);
    close_cell(cells, type, corner_count);
    return TETLOD_OK;
}

void cells_middles_to_vtk(unsigned char type, int64_t *points)
{
    unsigned first = type == VTK_TYPE_HEXAHEDRON20 ? 12
                     : type == VTK_TYPE_WEDGE15    ? 9
                                                   : 0,
             count = type == VTK_TYPE_WEDGE15 ? 3 : 4;
    for (unsigned i = first; first && i < first + count; i++) {
        int64_t swap = points[i];
        points[i] = points[i + count];
        points[i + count] = swap;
    }
}

void cells_renew_lagrange(struct cells *cells)
{
    for (uint64_t c = 0; cells->types && c < cells->count; c++) {
        uint64_t begin = cells->offsets[c], end = cells->offsets[c + 1], order = 1;
        if (cells->types[c] != VTK_TYPE_LAGRANGE_HEXAHEDRON || end < begin || end > cells->connectivity_count)
            continue;
        while ((order + 1) * (order + 1) * (order + 1) < end - begin)
            order++;
        if ((order + 1) * (order + 1) * (order + 1) != end - begin)
            continue;
        uint32_t *edges = cells->connectivity + begin + 8 + 10 * (order - 1);
        for (uint64_t i = 0; i + 1 < order; i++) {
            uint32_t swap = edges[i];
            edges[i] = edges[i + order - 1];
            edges[i + order - 1] = swap;
        }
    }
}

enum tetlod_status blocks_add(struct blocks *blocks, struct block **out, struct tetlod_error *error)
{
    if (!ARRAY_RESERVE(blocks->at, blocks->capacity, blocks->count + 1))
        return tetlodi_fail_nomem(error, "the blocks", (uint64_t)blocks->count * sizeof *blocks->at);
    *out = &blocks->at[blocks->count++];
    **out = (struct block){0};
    return TETLOD_OK;
}

void block_fini(struct block *block)
{
    tetmesh_fini(&block->mesh);
    cells_fini(&block->cells);
    free(block->hidden);
    free(block->point_numbers);
    free(block->cell_numbers);
    *block = (struct block){0};
}

void blocks_fini(struct blocks *blocks)
{
    for (size_t b = 0; b < blocks->count; b++)
        block_fini(&blocks->at[b]);
    free(blocks->at);
    *blocks = (struct blocks){0};
}

uint64_t block_cell_count(const struct block *block)
{
    const uint32_t *dims = block->dims;
    if (!dims[0])
        return block->cells.count;
    return dims[0] < 2 || dims[1] < 2 || dims[2] < 2 ? 0 : (uint64_t)(dims[0] - 1) * (dims[1] - 1) * (dims[2] - 1);
}

static enum tetlod_status need_hidden(struct block *block, struct tetlod_error *error)
{
    if (!block->hidden)
        block->hidden = array_zero((size_t)block_cell_count(block), 1);
    return block->hidden ? TETLOD_OK : tetlodi_fail_nomem(error, "the hidden cells", block_cell_count(block));
}

enum tetlod_status block_hide(struct block *block, const double *flags, struct io_report *report,
                              struct tetlod_error *error)
{
    enum { NOT_DRAWN = 1 | 8 | 32 };
    TETLOD_TRY(need_hidden(block, error));
    for (uint64_t c = 0; c < block_cell_count(block); c++)
        if (!block->hidden[c] && flags[c] >= 1 && flags[c] <= 255 && ((unsigned)flags[c] & NOT_DRAWN)) {
            block->hidden[c] = 1;
            report->hidden_cells++;
        }
    return TETLOD_OK;
}

enum tetlod_status block_hide_points(struct block *block, const unsigned char *blank, struct io_report *report,
                                     struct tetlod_error *error)
{
    size_t row = block->dims[0], slab = row * block->dims[1], cell = 0;
    TETLOD_TRY(need_hidden(block, error));
    for (size_t k = 0; k + 1 < block->dims[2]; k++)
        for (size_t j = 0; j + 1 < block->dims[1]; j++)
            for (size_t i = 0; i + 1 < block->dims[0]; i++, cell++) {
                const unsigned char *at = blank + i + row * j + slab * k;
                bool hide = at[0] | at[1] | at[row] | at[row + 1] | at[slab] | at[slab + 1] | at[slab + row] |
                            at[slab + row + 1];
                report->hidden_cells += hide && !block->hidden[cell];
                block->hidden[cell] |= hide;
            }
    return TETLOD_OK;
}

bool is_ghosts(const char *name, uint64_t components)
{
    return components == 1 && (strcmp(name, "vtkGhostType") == 0 || strcmp(name, "vtkGhostLevels") == 0);
}

static enum tetlod_status hide_flagged_points(struct block *block, const double *flags, struct io_report *report,
                                              struct tetlod_error *error)
{
    enum { HIDDEN_POINT = 2 };
    uint32_t count = block->mesh.vertex_count;
    unsigned char *blank = array_new(count, 1);
    if (!blank)
        return tetlodi_fail_nomem(error, "the hidden points", count);
    for (uint32_t v = 0; v < count; v++)
        blank[v] = flags[v] >= 1 && flags[v] <= 255 && ((unsigned)flags[v] & HIDDEN_POINT);
    enum tetlod_status status = memchr(blank, 1, count) ? block_hide_points(block, blank, report, error) : TETLOD_OK;
    free(blank);
    return status;
}

enum tetlod_status block_take_ghosts(struct block *block, bool cell, struct io_report *report,
                                     struct tetlod_error *error)
{
    struct tetmesh *mesh = &block->mesh;
    struct point_field *field =
        cell ? &mesh->cell_fields[--mesh->cell_field_count] : &mesh->fields[--mesh->field_count];
    bool levels = strcmp(field->name,
                         "vtkGhostLevels") == 0; // older versions gave levels of ghosts instead, all from 1 on
    enum tetlod_status status = TETLOD_OK;
    for (uint64_t c = 0; cell && levels && c < block_cell_count(block); c++)
        field->values[c] = field->values[c] > 0;
    if (cell)
        status = block_hide(block, field->values, report, error);
    else if (block->dims[0] && !levels)
        status = hide_flagged_points(block, field->values, report, error);
    point_field_fini(field);
    return status;
}
