/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What the readers share. A reader turns a file into blocks: points, cells of any kind, and values at both. From there
 * the way to a tetmesh is the same for all formats: blocks_merge.c joins blocks, split.c makes tetrahedra.
 */
#ifndef TETLOD_ASSEMBLE_H
#define TETLOD_ASSEMBLE_H

#include "src/io/services/input.h"
#include "src/mesh/mixed_cells.h"
#include "src/mesh/tetmesh.h"

/* Appends a cell. The corners are the file's numbers less those of its first point. */
TETLOD_CHECKED enum tetlod_status cells_add(struct cells *cells, unsigned char type, const int64_t *corners,
                                            size_t corner_count, struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status cells_add_numbers(struct cells *cells, unsigned char type, const uint32_t *corners,
                                                    size_t corner_count, struct tetlod_error *error);
/* Gives cells that are tetrahedra throughout their types and offsets. */
TETLOD_CHECKED enum tetlod_status cells_give_types(struct cells *cells, struct tetlod_error *error);
/* Takes types and offsets away again where they say nothing else. */
void cells_drop_types(struct cells *cells);

/* Puts the middles of a quadratic cell's edges into VTK's order: CGNS and Exodus list those of the upright edges before
 * those of the top. */
void cells_middles_to_vtk(unsigned char type, int64_t *points);

/* Puts the points of Lagrange hexahedra into the order that VTK has since its version 9: before, those of the last two
 * upright edges were swapped. What does not fit its cell is left as it is, for block_split to refuse. */
void cells_renew_lagrange(struct cells *cells);

/* Of a point that a file counts from 1, its number from 0 on; -1, which no point has, for what cannot be one. */
static inline int64_t point_from_one(int64_t number)
{
    return number > 0 ? number - 1 : -1;
}

/* A file's number of a point as cells hold it. */
static inline uint32_t cells_point(int64_t number)
{
    return number < 0 || number >= TETLOD_NONE ? TETLOD_NONE : (uint32_t)number;
}

struct block {
    struct tetmesh mesh;   /* points and their fields; cell_fields have a tuple per cell; no corners yet */
    struct cells cells;
    uint32_t dims[3];      /* points along i, j, k of a structured grid, which has no other cells; or 0 */
    unsigned char *hidden; /* owned, by cell: not 0 for ghosts and blanked cells, which are left out; NULL: none */
    /* Owned, of a piece: the numbers of its points and of its cells in the whole mesh (numbered.c); NULL: unknown */
    uint64_t *point_numbers, *cell_numbers;
    /* A range of the points and of the cells of the block before, whose cells count points from the first range's */
    bool goes_on;
};

struct blocks {
    struct block *at; /* owned */
    size_t count, capacity;
};

/* Appends an empty block; pointers to others become invalid. */
TETLOD_CHECKED enum tetlod_status blocks_add(struct blocks *blocks, struct block **out, struct tetlod_error *error);
void block_fini(struct block *block);
void blocks_fini(struct blocks *blocks);

/* Cells, those of a structured grid counted. */
uint64_t block_cell_count(const struct block *block);

/* Room for points; ERR_MESH if there are more than ids can name. The caller has checked the count against the file. */
TETLOD_CHECKED enum tetlod_status assemble_points(struct tetmesh *mesh, uint64_t count, enum tetlod_type type,
                                                  struct tetlod_error *error);

/* The same with positions that are there already, in an array that becomes the mesh's. Also after a failure *positions
 * is NULL. */
TETLOD_CHECKED enum tetlod_status assemble_points_of(struct tetmesh *mesh, uint64_t count, double **positions,
                                                     enum tetlod_type type,
                                                     struct tetlod_error *error);

/* tetmesh_add_field with a name that any format can hold: what is not UTF-8 or is a control character becomes '_', an
 * empty one "field", one that is taken gets a number. */
TETLOD_CHECKED enum tetlod_status assemble_field(struct tetmesh *mesh, const char *name, uint64_t components,
                                                 enum tetlod_type type, struct tetlod_error *error);

/* The same for a field of `cells` cells. */
TETLOD_CHECKED enum tetlod_status assemble_cell_field(struct tetmesh *mesh, const char *name, uint64_t components,
                                                      enum tetlod_type type, uint64_t cells,
                                                      struct tetlod_error *error);

/* Notes the unit of an array: UTF-8 without white space about it; what is longer than a unit is none. */
void unit_set(char unit[UNIT_SIZE], const char *text, size_t length);

/* The unit that is a product of powers: "kg m^-1 s^-2". Nothing if all exponents are 0. */
void unit_of_powers(char unit[UNIT_SIZE], const char *const *names, const double *exponents, size_t count);

/* Numbers of cells that become a field, if any is not 0: regions, say. */
struct cell_numbers {
    double *values; /* owned; NULL: all 0 so far */
    size_t capacity, count;
};
TETLOD_CHECKED enum tetlod_status cell_numbers_add(struct cell_numbers *numbers, uint64_t cell, int64_t number,
                                                   struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status cell_numbers_to_field(struct cell_numbers *numbers, struct tetmesh *mesh,
                                                        const char *name, uint64_t cells,
                                                        struct tetlod_error *error);
void cell_numbers_fini(struct cell_numbers *numbers);

/* Whether what is at a path of names of blocks, "/OUTER/INNER/", is in the block `name`: one of these, or several with
 * a slash between. */
bool block_path_has(const char *path, const char *name);

/* Whether all values are whole numbers: text may hold others where its type says integer. */
bool values_are_whole(const double *values, size_t count);

/* Whether three names, one after the other, are those of a vector: they end in X, Y, Z (or x, y, z, or _x, ...). Gives
 * the name without that. */
bool assemble_vector_name(const char *const names[3], char *out, size_t size);

/* Marks the cells of which `flags` (VTK's vtkGhostType: duplicate 1, refined 8, hidden 32) says that they are not to be
 * drawn. */
TETLOD_CHECKED enum tetlod_status block_hide(struct block *block, const double *flags, struct io_report *report,
                                             struct tetlod_error *error);

/* Marks the cells of a structured grid with a corner that is blanked: not 0 in `blank`. */
TETLOD_CHECKED enum tetlod_status block_hide_points(struct block *block, const unsigned char *blank,
                                                    struct io_report *report, struct tetlod_error *error);

/* Whether an array of that name tells what VTK does not draw. */
bool is_ghosts(const char *name, uint64_t components);

/* Takes the last field, at points or of cells, away, and hides the cells that it marks: as above; of a structured grid
 * also those with a point that is hidden (2). */
TETLOD_CHECKED enum tetlod_status block_take_ghosts(struct block *block, bool cell, struct io_report *report,
                                                    struct tetlod_error *error);

/* The block's field of the name and components of another's, at points or of cells; or NULL. */
struct point_field *block_find_like(struct block *block, bool cell, const struct point_field *like);

/* Counts the fields that a block has and the first one lacks. */
void block_note_others(struct block *first, struct block *block, bool cell, struct io_report *report);

/* Makes one block of all, which are emptied: points, cells, and the fields that all of them have. Points of several
 * blocks become one by their numbers in the whole mesh where all blocks know them, else they are welded; those of one
 * block are welded if it is a grid, or the options say so. Cells of several blocks are refused, unless they are to be
 * dropped later. */
TETLOD_CHECKED enum tetlod_status blocks_merge(struct blocks *blocks, const struct io_read_options *options,
                                               struct block *out, struct io_report *report,
                                               struct tetlod_error *error);

/* Makes one block of each that comes in ranges. ERR_NOMEM, ERR_MESH. */
TETLOD_CHECKED enum tetlod_status blocks_join_ranges(struct blocks *blocks, struct io_report *report,
                                                     struct tetlod_error *error);

/* Makes one of points that are no further apart than the tolerance and have the same values in all fields. Of pieces
 * origins[point] tells them apart (weld_pieces.h); NULL: it is one. Cells of several pieces are refused, unless `drops`
 * says that they will be dropped. */
TETLOD_CHECKED enum tetlod_status block_weld(struct block *block, double tolerance, const uint32_t *origins, bool drops,
                                             struct io_report *report, struct tetlod_error *error);

/* Cells refer to target[point] in place of the point. */
void block_redirect(struct block *block, const uint32_t *target);

/* Refuses cells that several pieces have. They refer to target[point] in place of each point. ERR_MESH, ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status block_check_twice(const struct block *block, const uint32_t *target,
                                                    struct tetlod_error *error);

/* Whether two points have the same values in all fields. */
bool mesh_same_values(const struct tetmesh *mesh, uint32_t a, uint32_t b);

/* The numbers that the points, or with `cell` the cells, of all blocks have in the whole mesh: their own, or those of a
 * field that is known for that. *out, in the order of the blocks, is to be freed; NULL: a block does not say. */
TETLOD_CHECKED enum tetlod_status blocks_numbers(struct blocks *blocks, bool cell, uint64_t **out,
                                                 struct tetlod_error *error);

/* Points of one number become one, in the order of their numbers; so do cells get into order, if they have numbers and
 * each is another one's. *fits: points of one number are at one place; else only the field of these numbers goes.
 * Cells of several pieces are refused, unless `drops` says that they will be dropped. */
TETLOD_CHECKED enum tetlod_status block_join_numbered(struct block *block, const uint64_t *points,
                                                      const uint64_t *cells, bool drops, bool *fits,
                                                      struct io_report *report, struct tetlod_error *error);

/* The hexahedra of a structured grid, in the order of its cells. */
TETLOD_CHECKED enum tetlod_status cells_of_grid(const uint32_t dims[3], struct cells *out, struct tetlod_error *error);

/* The block's tetrahedra, first the cells that are tetrahedra, as they are, then those of cells that are split, turned
 * as most of the first are. The block is emptied. With options->keep_cells the mesh has the cells, too, unless all are
 * tetrahedra of four points. */
TETLOD_CHECKED enum tetlod_status block_split(struct block *block, const struct io_read_options *options,
                                              struct tetmesh *out, struct io_report *report,
                                              struct tetlod_error *error);

#endif
