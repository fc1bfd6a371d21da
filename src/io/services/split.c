/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * From cells to tetrahedra: all cells are checked and counted first; polyhedra, and cells of higher order that are
 * subdivided, get a point in their centre; then tetrahedra are copied and the others split. The
 * mesh's parents remember whose cell a tetrahedron is part of.
 */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/common/round.h"
#include "src/io/services/assemble.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/cell_lattice.h"
#include "src/mesh/cell_refine.h"
#include "src/mesh/cell_split.h"
#include "src/util/array.h"
#include "src/util/pages.h"

enum { NO_VOLUME = CELL_SHAPES, POLYHEDRON, UNKNOWN }; // what a VTK type may be besides a shape

/* What can be used of the points behind the corners: the middles of the edges, or all points of a lattice. */
enum more_points { NO_MORE, MIDDLES, LATTICE };

struct vtk_type {
    uint8_t type, shape, least_corners; /* of higher order cells the corners come first */
    enum more_points more;
};

static const struct vtk_type vtk_types[] = {
    {10, CELL_TET, 4, NO_MORE},
    {11, CELL_HEXAHEDRON, 8, NO_MORE},
    {12, CELL_HEXAHEDRON, 8, NO_MORE},
    {13, CELL_WEDGE, 6, NO_MORE},
    {14, CELL_PYRAMID, 5, NO_MORE},
    {15, CELL_PENTAGONAL_PRISM, 10, NO_MORE},
    {16, CELL_HEXAGONAL_PRISM, 12, NO_MORE},
    {24, CELL_TET, 10, MIDDLES},
    {25, CELL_HEXAHEDRON, 20, MIDDLES},
    {26, CELL_WEDGE, 15, MIDDLES},
    {27, CELL_PYRAMID, 13, MIDDLES},
    {29, CELL_HEXAHEDRON, 27, MIDDLES},
    {31, CELL_WEDGE, 12, NO_MORE},
    {32, CELL_WEDGE, 18, MIDDLES},
    {33, CELL_HEXAHEDRON, 24, MIDDLES},
    {37, CELL_PYRAMID, 19, MIDDLES},
    {42, POLYHEDRON, 1, NO_MORE},
    {71, CELL_TET, 4, LATTICE},
    {72, CELL_HEXAHEDRON, 8, LATTICE},
    {73, CELL_WEDGE, 6, LATTICE},
    {74, CELL_PYRAMID, 5, LATTICE},
    {78, CELL_TET, 4, NO_MORE},
    {79, CELL_HEXAHEDRON, 8, NO_MORE},
    {80, CELL_WEDGE, 6, NO_MORE},
    {81, CELL_PYRAMID, 5, NO_MORE},
};

struct splitter {
    const struct cells *cells;
    const unsigned char *hidden; /* or NULL */
    struct tetmesh *out;         /* its positions have room for the centres */
    bool subdivide, is_turned;
    uint64_t most_tets, centres;
    uint32_t point_count, next_centre;
    const struct point_field *orders; /* of Lagrange cells, or NULL: their numbers of points tell them */
};

static struct vtk_type find_type(unsigned char type)
{
    static const uint8_t flat[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 21, 22, 23, 28, 30, 34, 35, 36, 68, 69, 70, 75, 76,
                                   77};
    for (size_t i = 0; i < sizeof vtk_types / sizeof *vtk_types; i++)
        if (vtk_types[i].type == type)
            return vtk_types[i];
    return (struct vtk_type){type, memchr(flat, type, sizeof flat) ? NO_VOLUME : UNKNOWN, 0, NO_MORE};
}

/* Whether a face stream fits its cell; *tets: how many tetrahedra its faces make with the centre. */
static bool check_faces(const uint32_t *stream, uint64_t size, uint32_t point_count, uint64_t *tets)
{
    uint64_t at = 1;
    *tets = 0;
    for (uint32_t f = 0; f < stream[0]; f++) {
        if (at >= size || stream[at] > size - at - 1)
            return false;
        for (uint32_t i = 1; i <= stream[at]; i++)
            if (stream[at + i] >= point_count)
                return false;
        *tets += stream[at] > 2 ? stream[at] - 2 : 0;
        at += 1 + (uint64_t)stream[at];
    }
    return at == size;
}

/* VTK's name for a cell field of the orders of Lagrange cells, which need not be the same along all axes. */
static const struct point_field *find_orders(const struct tetmesh *mesh)
{
    for (uint32_t f = 0; f < mesh->cell_field_count; f++)
        if (mesh->cell_fields[f].components == 3 && strcmp(mesh->cell_fields[f].name, "HigherOrderDegrees") == 0)
            return &mesh->cell_fields[f];
    return NULL;
}

/* The orders of a Lagrange cell; false: it has others than cell_lattice.h knows. */
static bool find_lattice(const struct splitter *s, uint64_t c, struct vtk_type type, unsigned orders[3])
{
    enum cell_shape shape = (enum cell_shape)type.shape;
    size_t points = (size_t)(s->cells->offsets[c + 1] - s->cells->offsets[c]);
    for (int d = 0; s->orders && d < 3; d++) {
        double order = s->orders->values[3 * (size_t)c + (size_t)d];
        orders[d] = order >= 1 && order <= CELL_LATTICE_MAX_ORDER ? (unsigned)order : 0;
    }
    return (s->orders && cell_lattice_fits(shape, points, orders)) || cell_lattice_orders(shape, points, orders);
}

static enum tetlod_status count_lattice(const struct splitter *s, uint64_t c, struct vtk_type type, uint64_t *tets,
                                        struct tetlod_error *error)
{
    unsigned orders[3];
    if (!find_lattice(s, c, type, orders))
        return tetlodi_fail(error, TETLOD_ERR_MESH,
                            "cell %llu (VTK type %u) of %llu points is no Lagrange cell of order 1 to %d that can be "
                            "subdivided; leave --subdivide out, and its corners are taken",
                            (unsigned long long)c, type.type,
                            (unsigned long long)(s->cells->offsets[c + 1] - s->cells->offsets[c]),
                            CELL_LATTICE_MAX_ORDER);
    *tets = cell_lattice_tets((enum cell_shape)type.shape, orders);
    return TETLOD_OK;
}

static enum tetlod_status check_cell(const struct splitter *s, uint64_t c, struct vtk_type type, uint64_t *tets,
                                     struct tetlod_error *error)
{
    static const uint8_t most[CELL_SHAPES] = {1, 3, 5, 9, 13, 17}; // a boundary's triangles without those of a corner
    const struct cells *cells = s->cells;
    uint64_t begin = cells->offsets[c], end = cells->offsets[c + 1];
    if (end < begin || end > cells->connectivity_count)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "cell %llu: its offsets %lld..%lld do not fit the %llu corners",
                            (unsigned long long)c, (long long)begin, (long long)end,
                            (unsigned long long)cells->connectivity_count);
    if (type.shape == UNKNOWN)
        return tetlodi_fail(error, TETLOD_ERR_MESH,
                            "cell %llu is of VTK type %u, which cannot be split; tetrahedralize it first",
                            (unsigned long long)c, type.type);
    if (end - begin < type.least_corners)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "cell %llu (VTK type %u) has %lld points, it needs %u",
                            (unsigned long long)c, type.type, (long long)(end - begin), type.least_corners);
    if (type.shape == POLYHEDRON)
        return check_faces(cells->connectivity + begin, end - begin, s->point_count, tets)
                   ? TETLOD_OK
                   : tetlodi_fail(error, TETLOD_ERR_MESH,
                                  "cell %llu: the faces of the polyhedron do not fit its points",
                                  (unsigned long long)c);
    for (uint64_t i = begin; i < end; i++)
        if (cells->connectivity[i] >= s->point_count)
            return tetlodi_fail(error, TETLOD_ERR_MESH, "cell %llu refers to point %lld, but there are only %u points",
                                (unsigned long long)c,
                                cells->connectivity[i] == TETLOD_NONE ? -1 : (long long)cells->connectivity[i],
                                s->point_count);
    *tets = type.shape == NO_VOLUME ? 0 : most[type.shape];
    if (s->subdivide && type.more == MIDDLES)
        *tets = type.shape == CELL_TET ? 8 : CELL_REFINED_MOST_TETS;
    return s->subdivide && type.more == LATTICE ? count_lattice(s, c, type, tets, error) : TETLOD_OK;
}

static bool has_centre(const struct splitter *s, struct vtk_type type)
{
    return type.shape == POLYHEDRON || (s->subdivide && type.more == MIDDLES && type.shape != CELL_TET);
}

/* Whether a cell has points beyond its corners. */
static bool has_more_points(const struct splitter *s, uint64_t c, struct vtk_type type)
{
    return type.shape < CELL_SHAPES && s->cells->offsets[c + 1] - s->cells->offsets[c] > cell_corners(type.shape);
}

/* Whether an option would use these points. */
static bool can_subdivide(const struct splitter *s, uint64_t c, struct vtk_type type)
{
    unsigned orders[3];
    return type.more == MIDDLES || (type.more == LATTICE && find_lattice(s, c, type, orders));
}

/* Checks all cells and counts the tetrahedra and centres that they can make at most. */
static enum tetlod_status count_tets(struct splitter *s, struct io_report *report, struct tetlod_error *error)
{
    for (uint64_t c = 0; c < s->cells->count; c++) {
        struct vtk_type type = find_type(s->cells->types[c]);
        uint64_t tets = 0;
        TETLOD_TRY(check_cell(s, c, type, &tets, error));
        if (s->hidden && s->hidden[c])
            continue;
        s->most_tets += tets;
        s->centres += has_centre(s, type);
        report->skipped_cells += type.shape == NO_VOLUME;
        report->split_cells += type.shape != NO_VOLUME && (type.shape != CELL_TET || tets > 1);
        if (has_more_points(s, c, type) && !can_subdivide(s, c, type))
            report->higher_cells++;
        else
            report->linearised_cells += has_more_points(s, c, type) && !s->subdivide;
    }
    return TETLOD_OK;
}

static enum tetlod_status check_tet_count(uint64_t count, struct tetlod_error *error)
{
    return count <= ADJACENCY_MAX_TETS ? TETLOD_OK
                                        : tetlodi_fail(error, TETLOD_ERR_MESH,
                                                       "its cells make more than the %d tetrahedra that fit",
                                                       ADJACENCY_MAX_TETS);
}

/* ---- centres */

static enum tetlod_status grow_rows(double **values, uint64_t rows, uint32_t width, struct tetlod_error *error)
{
    double *grown = array_resize(*values, (size_t)rows, width * sizeof **values);
    if (!grown)
        return tetlodi_fail_nomem(error, "the centres of cells", rows * width * 8);
    *values = grown;
    return TETLOD_OK;
}

static enum tetlod_status reserve_centres(struct splitter *s, struct tetlod_error *error)
{
    struct tetmesh *out = s->out;
    uint64_t rows = s->point_count + s->centres;
    if (!s->centres)
        return TETLOD_OK;
    if (rows >= TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "with the centres of cells there are more points than fit");
    TETLOD_TRY(grow_rows(&out->positions, rows, 3, error));
    for (uint32_t f = 0; f < out->field_count; f++)
        TETLOD_TRY(grow_rows(&out->fields[f].values, rows, out->fields[f].components, error));
    out->vertex_count = (uint32_t)rows;
    return TETLOD_OK;
}

static void mean_row(double *values, uint32_t width, enum tetlod_type type, const uint32_t *points, size_t count,
                     uint32_t target)
{
    for (uint32_t c = 0; c < width; c++) {
        double sum = 0;
        for (size_t i = 0; i < count; i++)
            sum += values[(size_t)points[i] * width + c];
        sum = count ? sum / (double)count : 0;
        values[(size_t)target * width + c] = tetlodi_round(type, sum);
    }
}

/* The point in the middle of others, with the mean of their values. */
static uint32_t add_centre(struct splitter *s, const uint32_t *points, size_t count)
{
    struct tetmesh *out = s->out;
    uint32_t centre = s->next_centre++;
    mean_row(out->positions, 3, out->position_type, points, count, centre);
    for (uint32_t f = 0; f < out->field_count; f++)
        mean_row(out->fields[f].values, out->fields[f].components, out->fields[f].type, points, count, centre);
    return centre;
}

/* ---- cells */

static void put_tets(struct splitter *s, uint64_t cell, uint32_t (*tets)[4], unsigned count)
{
    struct tetmesh *out = s->out;
    for (unsigned t = 0; s->is_turned && t < count; t++)
        cell_tet_turn(tets[t]);
    memcpy(out->corners + 4 * (size_t)out->tet_count, tets, count * sizeof *tets);
    for (unsigned t = 0; t < count; t++)
        out->parents[out->tet_count + t] = (uint32_t)cell;
    out->tet_count += count;
}

static void load_corners(const struct cells *cells, uint64_t c, enum cell_shape shape,
                         uint32_t corner[CELL_MAX_CORNERS])
{
    static const uint8_t voxel[8] = {0, 1, 3, 2, 4, 5, 7, 6};
    const uint32_t *from = cells->connectivity + cells->offsets[c];
    for (unsigned i = 0; i < cell_corners(shape); i++)
        corner[i] = from[cells->types[c] == VTK_TYPE_VOXEL ? voxel[i] : i];
}

/* The points of a polyhedron once each, gathered at the front of `points`; gives their number. */
static size_t polyhedron_points(const uint32_t *stream, uint32_t *points)
{
    size_t count = 0;
    uint64_t at = 1;
    for (uint32_t f = 0; f < stream[0]; at += 1 + (uint64_t)stream[at], f++)
        for (uint32_t i = 1; i <= stream[at]; i++) {
            size_t k = 0;
            while (k < count && points[k] != stream[at + i])
                k++;
            if (k == count)
                points[count++] = stream[at + i];
        }
    return count;
}

static double area_squared(const double *positions, const uint32_t *face, uint32_t a, uint32_t b, uint32_t c)
{
    const double *p = positions + 3 * (size_t)face[a], *q = positions + 3 * (size_t)face[b],
                 *r = positions + 3 * (size_t)face[c];
    double u[3], v[3], cross[3];
    for (int d = 0; d < 3; d++) {
        u[d] = q[d] - p[d];
        v[d] = r[d] - p[d];
    }
    for (int d = 0; d < 3; d++)
        cross[d] = u[(d + 1) % 3] * v[(d + 2) % 3] - u[(d + 2) % 3] * v[(d + 1) % 3];
    return cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2];
}

/* The point that a face is fanned from, alike by both its cells: the one of least number from which no triangle is
 * without area (points lie within straight edges where a neighbour is finer). Of a quadrilateral without such points it
 * is the one of least number, as of those of other cells. */
static uint32_t fan_start(const double *positions, const uint32_t *face, uint32_t sides)
{
    uint32_t least = 0, best = TETLOD_NONE;
    double largest = 0;
    for (uint32_t i = 1; i < sides; i++)
        least = face[i] < face[least] ? i : least;
    if (sides <= 3)
        return least;
    for (uint32_t i = 0; i < sides; i++) {
        double area = area_squared(positions, face, i, (i + 1) % sides, (i + 2) % sides);
        largest = area > largest ? area : largest;
    }
    for (uint32_t i = 0; i < sides; i++) {
        bool good = true;
        for (uint32_t k = 1; k + 1 < sides && good; k++)
            good = area_squared(positions, face, i, (i + k) % sides, (i + k + 1) % sides) > 1e-16 * largest;
        if (good && (best == TETLOD_NONE || face[i] < face[best]))
            best = i;
    }
    return best == TETLOD_NONE ? least : best;
}

/* A cone from its centre over every face. */
static enum tetlod_status split_polyhedron(struct splitter *s, uint64_t c, struct tetlod_error *error)
{
    const uint32_t *stream = s->cells->connectivity + s->cells->offsets[c];
    uint64_t size = s->cells->offsets[c + 1] - s->cells->offsets[c], at = 1;
    uint32_t *points = array_new((size_t)size, sizeof *points);
    if (!points)
        return tetlodi_fail_nomem(error, "a polyhedron", size * sizeof *points);
    uint32_t centre = add_centre(s, points, polyhedron_points(stream, points));
    free(points);
    uint32_t first = s->out->tet_count;
    bool is_turned = s->is_turned;
    s->is_turned = false;
    for (uint32_t f = 0; f < stream[0]; at += 1 + (uint64_t)stream[at], f++) {
        const uint32_t *face = stream + at + 1;
        uint32_t sides = stream[at], least = sides ? fan_start(s->out->positions, face, sides) : 0;
        for (uint32_t i = 1; i + 1 < sides; i++) {
            uint32_t tet[1][4] = {{centre, face[least], face[(least + i) % sides], face[(least + i + 1) % sides]}};
            cell_tets_turn(tet, 1, s->out->positions); // the faces of a stream are not turned alike
            put_tets(s, c, tet, 1);
        }
    }
    s->is_turned = is_turned;
    for (uint32_t t = first; is_turned && t < s->out->tet_count; t++)
        cell_tet_turn(s->out->corners + 4 * (size_t)t);
    return TETLOD_OK;
}

static enum tetlod_status split_cell(struct splitter *s, uint64_t c, struct vtk_type type, struct tetlod_error *error)
{
    uint32_t corner[CELL_MAX_CORNERS], tets[CELL_LATTICE_MAX_TETS][4];
    const uint32_t *points = s->cells->connectivity + s->cells->offsets[c];
    unsigned count, orders[3];
    if (type.shape == POLYHEDRON)
        return split_polyhedron(s, c, error);
    if (s->subdivide && type.more == LATTICE && find_lattice(s, c, type, orders))
        count = cell_lattice_split((enum cell_shape)type.shape, orders, points, s->out->positions, tets);
    else if (s->subdivide && type.more == MIDDLES) {
        uint32_t centre = has_centre(s, type) ? add_centre(s, points, cell_corners((enum cell_shape)type.shape)) : 0;
        count = cell_refine((enum cell_shape)type.shape, points, centre, s->out->positions, tets);
    } else {
        load_corners(s->cells, c, (enum cell_shape)type.shape, corner);
        count = cell_split((enum cell_shape)type.shape, corner, s->out->positions, tets);
    }
    put_tets(s, c, tets, count);
    return TETLOD_OK;
}

static bool is_copied(const struct splitter *s, struct vtk_type type)
{
    return type.shape == CELL_TET && !(s->subdivide && type.more != NO_MORE);
}

/* Takes the tetrahedra over as they are; gives their volume, which is negative if most are turned the other way. */
static double copy_tets(struct splitter *s)
{
    double volume = 0;
    for (uint64_t c = 0; c < s->cells->count; c++) {
        uint32_t corner[1][4];
        if ((s->hidden && s->hidden[c]) || !is_copied(s, find_type(s->cells->types[c])))
            continue;
        memcpy(corner[0], s->cells->connectivity + s->cells->offsets[c], sizeof corner[0]);
        put_tets(s, c, corner, 1);
        volume += cell_tet_volume6(corner[0], s->out->positions);
    }
    return volume;
}

static enum tetlod_status split_all(struct splitter *s, struct tetlod_error *error)
{
    enum { STRIDE = 1 << 18 };
    s->is_turned = copy_tets(s) < 0;
    for (uint64_t c = 0, dropped = 0; c < s->cells->count; c++) {
        uint64_t behind = s->cells->offsets[c] > dropped ? s->cells->offsets[c] - dropped : 0;
        if (behind >= STRIDE) {
            pages_drop(s->cells->connectivity + dropped, behind * sizeof *s->cells->connectivity);
            dropped += behind;
        }
        struct vtk_type type = find_type(s->cells->types[c]);
        if ((s->hidden && s->hidden[c]) || type.shape == NO_VOLUME || is_copied(s, type))
            continue;
        TETLOD_TRY(split_cell(s, c, type, error));
    }
    return TETLOD_OK;
}

/* ---- tetrahedra alone */

static bool is_left_out(const struct splitter *s, uint64_t c, struct vtk_type type)
{
    return (s->hidden && s->hidden[c]) || type.shape == NO_VOLUME;
}

/* Whether nothing is split, so that the corners can be moved to where the tetrahedra's will be. */
static bool only_tets(const struct splitter *s)
{
    uint64_t kept = 0;
    for (uint64_t c = 0; c < s->cells->count; c++) {
        struct vtk_type type = find_type(s->cells->types[c]);
        if (is_left_out(s, c, type))
            continue;
        if (!is_copied(s, type) || s->cells->offsets[c] < 4 * kept++)
            return false;
    }
    return true;
}

/* Makes tetrahedra and their values of what the block has, without room for a second copy. */
static void move_tets(const struct splitter *s, struct cells *cells)
{
    struct tetmesh *out = s->out;
    for (uint64_t c = 0; c < cells->count; c++) {
        if (is_left_out(s, c, find_type(cells->types[c])))
            continue;
        size_t t = out->tet_count++;
        memmove(cells->connectivity + 4 * t, cells->connectivity + cells->offsets[c], 4 * sizeof *cells->connectivity);
        for (uint32_t f = 0; f < out->cell_field_count && t < c; f++) {
            size_t width = out->cell_fields[f].components;
            memmove(out->cell_fields[f].values + t * width, out->cell_fields[f].values + c * width,
                    width * sizeof(double));
        }
    }
    for (uint32_t f = 0; f < out->cell_field_count; f++)
        out->cell_fields[f].values = array_shrink(out->cell_fields[f].values, out->tet_count,
                                                  out->cell_fields[f].components * sizeof(double));
    out->corners = array_shrink(cells->connectivity, out->tet_count, 4 * sizeof *out->corners);
    cells->connectivity = NULL;
}

/* ---- values of cells */

/* Every tetrahedron gets the values of its cell. */
static enum tetlod_status spread_values(struct tetmesh *mesh, struct tetlod_error *error)
{
    for (uint32_t f = 0; f < mesh->cell_field_count; f++) {
        struct point_field *field = &mesh->cell_fields[f];
        size_t width = field->components;
        double *values = array_new(mesh->tet_count, width * sizeof *values);
        if (!values)
            return tetlodi_fail_nomem(error, field->name, (uint64_t)mesh->tet_count * width * sizeof *values);
        for (size_t t = 0; t < mesh->tet_count; t++)
            memcpy(values + t * width, field->values + (size_t)mesh->parents[t] * width, width * sizeof *values);
        free(field->values);
        field->values = values;
    }
    return TETLOD_OK;
}

static enum tetlod_status new_corners(struct tetmesh *out, uint64_t tets, struct tetlod_error *error)
{
    TETLOD_TRY(check_tet_count(tets, error));
    out->corners = array_new((size_t)tets, 4 * sizeof *out->corners);
    out->parents = array_new((size_t)tets, sizeof *out->parents);
    return out->corners && out->parents ? TETLOD_OK : tetlodi_fail_nomem(error, "the tetrahedra", tets * 20);
}

/* Whether cells have more points than those of tetrahedra, so that they are worth keeping. */
static bool has_others(const struct cells *cells)
{
    for (uint64_t c = 0; c < cells->count; c++)
        if (cells->types[c] != VTK_TYPE_TET && find_type(cells->types[c]).shape != NO_VOLUME)
            return true;
    return false;
}

static enum tetlod_status split_cells(struct block *block, const struct io_read_options *options, struct tetmesh *out,
                                      struct io_report *report, struct tetlod_error *error)
{
    struct splitter s = {.cells = &block->cells,
                         .hidden = block->hidden,
                         .out = out,
                         .subdivide = options->subdivide,
                         .point_count = out->vertex_count,
                         .next_centre = out->vertex_count,
                         .orders = find_orders(out)};
    TETLOD_TRY(count_tets(&s, report, error));
    if (only_tets(&s) && !(options->keep_cells && has_others(&block->cells))) {
        TETLOD_TRY(check_tet_count(s.most_tets, error));
        move_tets(&s, &block->cells);
        return TETLOD_OK;
    }
    TETLOD_TRY(reserve_centres(&s, error));
    report->centres = s.centres;
    TETLOD_TRY(new_corners(out, s.most_tets, error));
    TETLOD_TRY(split_all(&s, error));
    out->parents = array_shrink(out->parents, out->tet_count, sizeof *out->parents);
    out->corners = array_shrink(out->corners, out->tet_count, 4 * sizeof *out->corners);
    return TETLOD_OK;
}

static enum tetlod_status split_grid(struct block *block, struct tetmesh *out,
                                     struct io_report *report, struct tetlod_error *error)
{
    uint64_t tets = grid_tet_count(block->dims);
    TETLOD_TRY(new_corners(out, tets, error));
    grid_split(block->dims, out->positions, out->corners);
    for (uint32_t t = 0; t < tets; t++) {
        if (block->hidden && block->hidden[t / 5])
            continue;
        memmove(out->corners + 4 * (size_t)out->tet_count, out->corners + 4 * (size_t)t, 4 * sizeof *out->corners);
        out->parents[out->tet_count] = t / 5;
        out->tet_count++;
    }
    report->split_cells += out->tet_count / 5;
    return TETLOD_OK;
}

/* Tetrahedra throughout: the connectivity is what the mesh wants, and the values of cells are its own. */
static enum tetlod_status take_tets(struct block *block, struct tetmesh *out, struct tetlod_error *error)
{
    struct cells *cells = &block->cells;
    TETLOD_TRY(check_tet_count(cells->count, error));
    out->corners = cells->connectivity;
    out->tet_count = (uint32_t)cells->count;
    cells->connectivity = NULL;
    size_t count = 4 * (size_t)out->tet_count, i = tetmesh_find_outside(out->corners, count, out->vertex_count);
    if (i < count)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "cell %zu refers to point %lld, but there are only %u points",
                            i / 4,
                            out->corners[i] == TETLOD_NONE ? -1 : (long long)out->corners[i], out->vertex_count);
    return TETLOD_OK;
}

/* The cells go with the tetrahedra that were made of them. */
static enum tetlod_status keep_cells(struct block *block, struct tetmesh *out, struct tetlod_error *error)
{
    out->cells = array_zero(1, sizeof *out->cells);
    if (!out->cells)
        return tetlodi_fail_nomem(error, "the cells", sizeof *out->cells);
    if (block->dims[0])
        return cells_of_grid(block->dims, out->cells, error);
    *out->cells = block->cells;
    block->cells = (struct cells){0};
    return TETLOD_OK;
}

enum tetlod_status block_split(struct block *block, const struct io_read_options *options, struct tetmesh *out,
                               struct io_report *report, struct tetlod_error *error)
{
    enum tetlod_status status = TETLOD_OK;
    *out = block->mesh;
    block->mesh = (struct tetmesh){0};
    if (!block->dims[0] && !block->cells.types && !block->hidden)
        return take_tets(block, out, error);
    if (!block->dims[0] && !block->cells.types)
        TETLOD_TRY_DONE(cells_give_types(&block->cells, error));
    TETLOD_TRY_DONE(block->dims[0] ? split_grid(block, out, report, error)
                                   : split_cells(block, options, out, report, error));
    if (options->keep_cells && out->parents)
        TETLOD_TRY_DONE(keep_cells(block, out, error));
    cells_fini(&block->cells); // gives room for the values
    if (out->parents)
        status = spread_values(out, error);
done:
    return status;
}
