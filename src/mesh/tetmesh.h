/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A tetrahedral mesh with point fields, as flat arrays. Values are held as double whatever their type: a float32 is
 * exactly a double, and rounds back to the same bits.
 */
#ifndef TETLOD_TETMESH_H
#define TETLOD_TETMESH_H

#include <stdbool.h>

#include "format/tetlod.h"
#include "src/mesh/grid.h"

enum { UNIT_SIZE = 32 }; /* of a unit's name with its end */

struct point_field {
    char *name; /* owned */
    char unit[UNIT_SIZE]; /* as the file says; "": it does not */
    uint32_t components;
    enum tetlod_type type;
    double *values; /* owned, [components * vertex_count]; of a cell field [components * tet_count] */
    struct grid grid; /* that the values lie on */
    bool is_integer;  /* the file holds integers: ids of regions, of materials */
    bool is_ids;      /* not controlled, and no value is a mean of others (ids.h) */
    bool has_error;   /* the mesh is a level, whose error in this field is known */
    double error;     /* then: at most, a fraction of the field's range */
};

/* The stream and the level that a mesh was taken from, for files that have a place for it. */
struct mesh_origin {
    char id[33]; /* content id; "": the mesh is of no stream */
    uint32_t level;
    double domain_error; /* a fraction of the bounding box's diagonal */
    bool has_time;
    double time; /* of a step */
};

struct cells;

struct tetmesh {
    uint32_t vertex_count, tet_count, field_count;
    enum tetlod_type position_type;
    struct grid position_grid[3]; /* that x, y, z lie on */
    double *positions;         /* owned, [3 * vertex_count] */
    uint32_t *corners;         /* owned, [4 * tet_count]; 6V = (b-a).((c-a)x(d-a)) > 0 is the usual orientation */
    struct point_field *fields; /* owned */
    struct point_field *cell_fields; /* owned: values of tetrahedra */
    uint32_t cell_field_count;
    uint32_t *parents; /* owned, [tet_count]: alike where tetrahedra were made of one cell; NULL: none was split */
    /* Owned, or NULL: these cells in the file's order. Of a mesh that was read, beside the tetrahedra, and parents
     * number them; their points are the mesh's, then the further ones, which no tetrahedron has. Of one that is to be
     * written, in place of the tetrahedra: tet_count counts them, cell fields have their values, corners are NULL. */
    struct cells *cells;
    struct tetmesh *further;  /* owned, or NULL: their positions and values */
    uint32_t *further_places; /* owned: their numbers in the original, rising */
    uint64_t unused_points;    /* points of the input that no tetrahedron used: dropped */
    struct mesh_origin origin;
};

void tetmesh_fini(struct tetmesh *mesh);

/* Appends a field with room for its values, which are zero; its index is field_count - 1. */
TETLOD_CHECKED enum tetlod_status tetmesh_add_field(struct tetmesh *mesh, const char *name, uint32_t components,
                                                    enum tetlod_type type, struct tetlod_error *error);

/* The same for values of `cells` cells. */
TETLOD_CHECKED enum tetlod_status tetmesh_add_cell_field(struct tetmesh *mesh, const char *name, uint32_t components,
                                                         enum tetlod_type type, uint64_t cells,
                                                         struct tetlod_error *error);

/* Index of a field, or TETLOD_NONE. */
uint32_t tetmesh_find_field(const struct tetmesh *mesh, const char *name);
uint32_t tetmesh_find_cell_field(const struct tetmesh *mesh, const char *name);

/* The cell field that tells regions: of integers, with a name that says so; TETLOD_NONE: there is none. */
uint32_t tetmesh_find_region(const struct tetmesh *mesh);

/* Says that the mesh is a level of the stream: its origin, and the certified errors of its fields. One that is the
 * original has no origin: its file is the one that is made of the original. */
void tetmesh_set_origin(struct tetmesh *mesh, const struct tetlod_info *info, uint32_t level);

/* A level's mesh without its arrays: counts, types, names and origin. To be released. */
TETLOD_CHECKED enum tetlod_status tetmesh_shape(const struct tetlod_info *info, uint32_t level, struct tetmesh *out,
                                                struct tetlod_error *error);

void point_field_fini(struct point_field *field);

/* Drops points that no tetrahedron uses, keeping the order of the others, and adds their number to unused_points. */
TETLOD_CHECKED enum tetlod_status tetmesh_drop_unused(struct tetmesh *mesh, struct tetlod_error *error);

/* What every mesh must be before anything else looks at it: at least one tetrahedron, corners in range and different,
 * coordinates and values finite. The message names the first offender. */
TETLOD_CHECKED enum tetlod_status tetmesh_validate(const struct tetmesh *mesh, struct tetlod_error *error);

/* Its two halves: tetrahedra and their corners, then coordinates and values. */
TETLOD_CHECKED enum tetlod_status tetmesh_validate_tets(const struct tetmesh *mesh, struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status tetmesh_validate_values(const struct tetmesh *mesh, struct tetlod_error *error);
/* The parts of the latter. */
TETLOD_CHECKED enum tetlod_status tetmesh_validate_positions(const struct tetmesh *mesh, struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status tetmesh_validate_field(const struct tetmesh *mesh, uint32_t number,
                                                         struct tetlod_error *error);

/* The first corner that is not a number of one of so many points, or `count`. */
size_t tetmesh_find_outside(const uint32_t *corners, size_t count, uint32_t vertex_count);

/* Least and greatest over all components. */
void point_field_range(const struct point_field *field, uint32_t vertex_count, double range[2]);

/* Is the range's width, and one by it, a number? Else no fraction of it means anything. */
bool range_has_scale(const double range[2]);

/* An error as a fraction of the range: 0 if that is a point, the whole of it where the range has no scale. */
double range_fraction(const double range[2], double error);

#endif
