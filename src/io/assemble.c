/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/assemble.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/cell_split.h"
#include "src/util/array.h"
#include "src/util/utf8.h"

enum { MOST_COMPONENTS = 4096 }; // more than any field of a mesh has

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

static void number_name(const struct tetmesh *mesh, char *name, size_t capacity)
{
    size_t length = strlen(name);
    if (tetmesh_find_field(mesh, name) == TETLOD_NONE)
        return;
    for (uint32_t n = mesh->field_count + 1; tetmesh_find_field(mesh, name) != TETLOD_NONE; n++)
        snprintf(name + length, capacity - length, "_%u", n);
}

enum tetlod_status assemble_field(struct tetmesh *mesh, const char *name, uint64_t components, enum tetlod_type type,
                                  struct tetlod_error *error)
{
    if (components == 0 || components > MOST_COMPONENTS)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "point array '%.80s' has %llu components, not 1 to %d", name,
                            (unsigned long long)components, MOST_COMPONENTS);
    size_t capacity = strlen(name) + 32;
    char *clean = array_new(capacity, 1);
    if (!clean)
        return tetlodi_fail_nomem(error, "a field's name", capacity);
    snprintf(clean, capacity, "%s", *name ? name : "field");
    utf8_clean(clean);
    number_name(mesh, clean, capacity);
    enum tetlod_status status = tetmesh_add_field(mesh, clean, (uint32_t)components, type, error);
    free(clean);
    return status;
}

enum { NO_VOLUME = CELL_SHAPES, UNKNOWN }; // what a VTK type may be besides a shape

struct vtk_type {
    uint8_t type, shape, least_corners; /* of higher order cells the corners come first */
};

static const struct vtk_type vtk_types[] = {
    {10, CELL_TET, 4},          {11, CELL_HEXAHEDRON, 8}, {12, CELL_HEXAHEDRON, 8},        {13, CELL_WEDGE, 6},
    {14, CELL_PYRAMID, 5},      {15, CELL_PENTAGONAL_PRISM, 10}, {16, CELL_HEXAGONAL_PRISM, 12},
    {24, CELL_TET, 10},         {25, CELL_HEXAHEDRON, 20}, {26, CELL_WEDGE, 15},           {27, CELL_PYRAMID, 13},
    {29, CELL_HEXAHEDRON, 27},  {31, CELL_WEDGE, 12},     {32, CELL_WEDGE, 18},            {33, CELL_HEXAHEDRON, 24},
    {37, CELL_PYRAMID, 19},     {71, CELL_TET, 4},        {72, CELL_HEXAHEDRON, 8},        {73, CELL_WEDGE, 6},
    {74, CELL_PYRAMID, 5},      {78, CELL_TET, 4},        {79, CELL_HEXAHEDRON, 8},        {80, CELL_WEDGE, 6},
    {81, CELL_PYRAMID, 5},
};

enum { VTK_VOXEL = 11 };

static struct vtk_type find_type(unsigned char type)
{
    static const uint8_t flat[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 21, 22, 23, 28, 30, 34, 35, 36, 68, 69, 70, 75, 76, 77};
    for (size_t i = 0; i < sizeof vtk_types / sizeof *vtk_types; i++)
        if (vtk_types[i].type == type)
            return vtk_types[i];
    return (struct vtk_type){type, memchr(flat, type, sizeof flat) ? NO_VOLUME : UNKNOWN, 0};
}

static enum tetlod_status check_cell(const struct vtk_cells *cells, uint64_t c, uint32_t point_count,
                                     struct tetlod_error *error)
{
    int64_t begin = cells->offsets[c], end = cells->offsets[c + 1];
    struct vtk_type type = find_type(cells->types[c]);
    if (begin < 0 || end < begin || (uint64_t)end > cells->connectivity_count)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "cell %llu: its offsets %lld..%lld do not fit the %llu corners",
                            (unsigned long long)c, (long long)begin, (long long)end,
                            (unsigned long long)cells->connectivity_count);
    if (type.shape == UNKNOWN)
        return tetlodi_fail(error, TETLOD_ERR_MESH,
                            "cell %llu is of VTK type %u, which cannot be split; tetrahedralize it first",
                            (unsigned long long)c, cells->types[c]);
    if (end - begin < type.least_corners)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "cell %llu (VTK type %u) has %lld points, it needs %u",
                            (unsigned long long)c, cells->types[c], (long long)(end - begin), type.least_corners);
    for (int64_t i = begin; i < end; i++)
        if (cells->connectivity[i] < 0 || cells->connectivity[i] >= point_count)
            return tetlodi_fail(error, TETLOD_ERR_MESH, "cell %llu refers to point %lld, but there are only %u points",
                                (unsigned long long)c, (long long)cells->connectivity[i], point_count);
    return TETLOD_OK;
}

/* Checks all cells and counts the tetrahedra that they can make at most. */
static enum tetlod_status count_tets(const struct vtk_cells *cells, uint32_t point_count, uint64_t *out,
                                     struct io_report *report, struct tetlod_error *error)
{
    static const uint8_t most[CELL_SHAPES] = {1, 2, 3, 6, 9, 12};
    *out = 0;
    for (uint64_t c = 0; c < cells->count; c++) {
        TETLOD_TRY(check_cell(cells, c, point_count, error));
        uint8_t shape = find_type(cells->types[c]).shape;
        *out += shape == NO_VOLUME ? 0 : most[shape];
        report->skipped_cells += shape == NO_VOLUME;
        report->split_cells += shape != NO_VOLUME && shape != CELL_TET;
    }
    return TETLOD_OK;
}

static enum tetlod_status reserve_tets(struct tetmesh *mesh, uint64_t more, struct tetlod_error *error)
{
    if (more > ADJACENCY_MOST_TETS - mesh->tet_count)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "its cells make more than the %d tetrahedra that fit",
                            ADJACENCY_MOST_TETS);
    uint32_t *corners = array_resize(mesh->corners, (size_t)(mesh->tet_count + more), 4 * sizeof *corners);
    if (!corners)
        return tetlodi_fail_nomem(error, "the tetrahedra", (mesh->tet_count + more) * 16);
    mesh->corners = corners;
    return TETLOD_OK;
}

static void load_corners(const struct vtk_cells *cells, uint64_t c, enum cell_shape shape, uint32_t first_point,
                         uint32_t corner[CELL_MOST_CORNERS])
{
    static const uint8_t voxel[8] = {0, 1, 3, 2, 4, 5, 7, 6};
    const int64_t *from = cells->connectivity + cells->offsets[c];
    for (unsigned i = 0; i < cell_corners(shape); i++)
        corner[i] = first_point + (uint32_t)from[cells->types[c] == VTK_VOXEL ? voxel[i] : i];
}

/* Takes the tetrahedra over as they are; gives their volume, which is negative if most are turned the other way. */
static double copy_tets(struct tetmesh *mesh, const struct vtk_cells *cells, uint32_t first_point)
{
    double volume = 0;
    for (uint64_t c = 0; c < cells->count; c++) {
        uint32_t corner[CELL_MOST_CORNERS];
        if (find_type(cells->types[c]).shape != CELL_TET)
            continue;
        load_corners(cells, c, CELL_TET, first_point, corner);
        memcpy(mesh->corners + 4 * (size_t)mesh->tet_count++, corner, 4 * sizeof *corner);
        volume += cell_tet_volume6(corner, mesh->positions);
    }
    return volume;
}

enum tetlod_status assemble_vtk_cells(struct tetmesh *mesh, const struct vtk_cells *cells, uint32_t first_point,
                                      uint32_t point_count, struct io_report *report, struct tetlod_error *error)
{
    uint64_t most;
    TETLOD_TRY(count_tets(cells, point_count, &most, report, error));
    TETLOD_TRY(reserve_tets(mesh, most, error));
    bool is_turned = copy_tets(mesh, cells, first_point) < 0;
    for (uint64_t c = 0; c < cells->count; c++) {
        uint32_t corner[CELL_MOST_CORNERS], tets[CELL_MOST_TETS][4];
        uint8_t shape = find_type(cells->types[c]).shape;
        if (shape == NO_VOLUME || shape == CELL_TET)
            continue;
        load_corners(cells, c, (enum cell_shape)shape, first_point, corner);
        unsigned count = cell_split((enum cell_shape)shape, corner, mesh->positions, tets);
        for (unsigned t = 0; is_turned && t < count; t++)
            cell_tet_turn(tets[t]);
        memcpy(mesh->corners + 4 * (size_t)mesh->tet_count, tets, count * sizeof *tets);
        mesh->tet_count += count;
    }
    return TETLOD_OK;
}

enum tetlod_status assemble_grid(struct tetmesh *mesh, const uint32_t dims[3], struct io_report *report,
                                 struct tetlod_error *error)
{
    TETLOD_TRY(reserve_tets(mesh, grid_tet_count(dims), error));
    grid_split(dims, mesh->positions, mesh->corners);
    mesh->tet_count = (uint32_t)grid_tet_count(dims);
    report->split_cells = mesh->tet_count / 5;
    return TETLOD_OK;
}

enum tetlod_status cell_list_add(struct cell_list *list, unsigned char type, const int64_t *corners,
                                 size_t corner_count, struct tetlod_error *error)
{
    struct vtk_cells *cells = &list->cells;
    size_t count = (size_t)cells->count, filled = (size_t)cells->connectivity_count;
    if (!array_reserve((void **)&list->types, &list->type_capacity, count + 1, 1) ||
        !array_reserve((void **)&list->offsets, &list->offset_capacity, count + 2, sizeof *list->offsets) ||
        !array_reserve((void **)&list->connectivity, &list->connectivity_capacity, filled + corner_count,
                       sizeof *list->connectivity))
        return tetlodi_fail_nomem(error, "the cells", (uint64_t)filled * sizeof *list->connectivity);
    list->types[count] = type;
    list->offsets[count] = (int64_t)filled;
    list->offsets[count + 1] = (int64_t)(filled + corner_count);
    if (corner_count)
        memcpy(list->connectivity + filled, corners, corner_count * sizeof *corners);
    *cells = (struct vtk_cells){count + 1, filled + corner_count, list->types, list->offsets, list->connectivity};
    return TETLOD_OK;
}

void cell_list_fini(struct cell_list *list)
{
    free(list->types);
    free(list->offsets);
    free(list->connectivity);
    *list = (struct cell_list){0};
}
