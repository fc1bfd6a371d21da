/* SPDX-License-Identifier: BSD-3-Clause */
/* From a mesh to a stream: contract, measure every level, encode. */
#ifndef TETLOD_BUILD_H
#define TETLOD_BUILD_H

#include "format/common/sink.h"
#include "src/log/contraction_log.h"
#include "src/pipeline/build_options.h"
#include "src/pipeline/field_cost.h"

struct build_report {
    uint32_t contractions, levels;
    uint64_t refused[LOG_REFUSALS]; /* (contraction_log.h) */
    struct field_cost cost;
    uint32_t keys;                  /* steps of a series that drove the contraction */
    uint64_t turned_tets; /* numbered against their neighbours (orient.h); the counts that follow are without that */
    uint64_t loose_tets;  /* all, where they share so few points that hardly any has a neighbour; else 0 */
    uint64_t degenerate_tets, inverted_tets, folded_tets; /* the stream counts folded ones as inverted */
};

/* The mesh has passed tetmesh_validate and has a field at least. */
TETLOD_CHECKED enum tetlod_status build_stream(const struct tetmesh *mesh, const struct build_options *options,
                                               const struct tetlodi_sink *sink, struct build_report *report,
                                               struct tetlod_error *error);

/* Resolves a --field that names one field: NAME, NAME:mag, NAME:COMPONENT or coordinate_x, each with :LIMIT behind it
 * if wanted. Magnitudes, components and coordinates become fields of their own under that name. ERR_FIELD lists what
 * there is. */
TETLOD_CHECKED enum tetlod_status build_control_parse(struct tetmesh *mesh, const char *text, struct build_control *out,
                                                      struct tetlod_error *error);

/* Is it a limit, such as 0.01 or 1%? */
bool build_control_limit(const char *text, double *out);

/* Fields of coordinates are named so, with x, y or z behind it. */
#define COORDINATE_NAME "coordinate_"

/* The coordinate along the mesh's longest side becomes a field, which is controlled. */
TETLOD_CHECKED enum tetlod_status build_control_coordinate(struct tetmesh *mesh, struct build_control *out,
                                                           struct tetlod_error *error);

/* The cell field that tells regions: `name`; without one (NULL) integers that may tell them (ids.h); for "none" no
 * field (*out is NULL). */
TETLOD_CHECKED enum tetlod_status build_regions_choose(const struct tetmesh *mesh, const char *name, const char **out,
                                                       struct tetlod_error *error);

/* Of which field is this one the magnitude (*component is TETLOD_NONE) or a component, by name and value? TETLOD_NONE:
 * of none. */
uint32_t build_control_source(const struct tetmesh *mesh, uint32_t field, uint32_t *component);

/* Where a magnitude is controlled, its vector becomes so as well, each component within the share of the limit that
 * keeps the vector, and thus every magnitude of it, within the magnitude's limit. `controls` has room for twice as
 * many. */
void build_controls_add_vectors(const struct tetmesh *mesh, struct build_control *controls, uint32_t *count);

#endif
