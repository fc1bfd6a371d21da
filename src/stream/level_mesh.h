/* SPDX-License-Identifier: BSD-3-Clause */
/* A cursor's mesh as a tetmesh, for the writers and for measuring. */
#ifndef TETLOD_LEVEL_MESH_H
#define TETLOD_LEVEL_MESH_H

#include "src/mesh/tetmesh.h"

/* Copies the cursor's mesh; fields that it does not hold are left out. ERR_NOMEM. O(level). */
TETLOD_CHECKED enum tetlod_status level_mesh_copy(const struct tetlod_info *info, const struct tetlod_cursor *cursor,
                                                  struct tetmesh *out, struct tetlod_error *error);

/* The same in less memory: the cursor gives its arrays back while they are copied. Frees it and makes it NULL, also
 * after a failure. */
TETLOD_CHECKED enum tetlod_status level_mesh_take(const struct tetlod_info *info, struct tetlod_cursor **cursor,
                                                  struct tetmesh *out,
                                                  struct tetlod_error *error);

/* Adds the values that tetlod_seek_step gave: the series' fields, in its order, to the mesh of the band's level. */
TETLOD_CHECKED enum tetlod_status level_mesh_step(const struct tetlod_info *info, const struct tetlod_series *series,
                                                  struct tetmesh *mesh,
                                                  struct tetlod_error *error);

/* Says that the mesh is of a step in a band: its time, and the errors of the fields that have steps. */
void level_mesh_step_origin(const struct tetlod_info *info, const struct tetlod_series *series, uint32_t band,
                            uint32_t step, struct tetmesh *mesh);

/* Adds the stream's values of cells, all fields or the one number `field` (TETLOD_NONE: all), to the mesh of any level,
 * or to one of the tetrahedra that have these numbers (NULL: those of a level have the first ones). */
TETLOD_CHECKED enum tetlod_status level_mesh_cells(const struct tetlod_file *file, uint32_t field,
                                                   const uint32_t *tets, struct tetmesh *mesh,
                                                   struct tetlod_error *error);

/* The same of a step of the stream's series: values that are not known at that step are left out. */
TETLOD_CHECKED enum tetlod_status level_mesh_step_cells(const struct tetlod_file *file, struct tetlod_series *series,
                                                        uint32_t step, uint32_t field, struct tetmesh *mesh,
                                                        struct tetlod_error *error);

/* All of them but one of the name `except` (NULL: none); of a file that is cut off also without those of which bytes
 * are missing. */
TETLOD_CHECKED enum tetlod_status level_mesh_cells_here(const struct tetlod_file *file, const char *except,
                                                        const uint32_t *tets,
                                                        struct tetmesh *mesh, struct tetlod_error *error);

/* Gives the mesh's fields what the stream's metadata say: units, and which are ids. */
TETLOD_CHECKED enum tetlod_status level_mesh_units(const struct tetlod_info *info, struct tetmesh *mesh,
                                                   struct tetlod_error *error);

/* Puts the mesh of the finest level into the original's own numbering of vertices, tetrahedra and corners. ERR_ARGUMENT
 * if the stream does not keep it, or if the mesh is that of another level. */
TETLOD_CHECKED enum tetlod_status level_mesh_reorder(const struct tetlod_file *file, struct tetmesh *mesh,
                                                     struct tetlod_error *error);

/* What is made of a level's mesh: nothing, the original's order, the original's cells. */
enum level_form { FORM_STREAM, FORM_ORDER, FORM_CELLS };

/* FORM_CELLS puts the cells that were split, and the points that no tetrahedron has, in place of the tetrahedra
 * (tetmesh.h: cells); a stream of tetrahedra alone has these. `of_step`: the values are those of a step in time.
 * ERR_ARGUMENT where the stream does not keep what is asked for, or the mesh is that of another level. */
TETLOD_CHECKED enum tetlod_status level_mesh_form(const struct tetlod_file *file, enum level_form form, bool of_step,
                                                  struct tetmesh *mesh, struct tetlod_error *error);

/* The original's positions and values by `vertices`, their numbers there, on the tetrahedra of the finest level. To be
 * released, also after a failure. */
TETLOD_CHECKED enum tetlod_status level_mesh_gather(const struct tetmesh *finest, const struct tetmesh *original,
                                                    const uint32_t *vertices,
                                                    struct tetmesh *out, struct tetlod_error *error);

/* The other way round: the original (with the stream's fields, found by their names) in the numbering of the stream's
 * finest level, `finest`. ERR_MISMATCH if its tetrahedra are others. */
TETLOD_CHECKED enum tetlod_status level_mesh_renumber(const struct tetlod_file *file, const struct tetmesh *finest,
                                                      const struct tetmesh *original, struct tetmesh *out,
                                                      struct tetlod_error *error);

#endif
