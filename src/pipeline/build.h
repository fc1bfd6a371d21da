/* SPDX-License-Identifier: BSD-3-Clause */
/* From a mesh to a stream: contract, measure every level, encode. */
#ifndef TETLOD_BUILD_H
#define TETLOD_BUILD_H

#include "format/write/writer.h"
#include "src/log/contraction_log.h"
#include "src/pipeline/field_cost.h"
#include "src/pipeline/quantise.h"
#include "src/simplify/simplify.h"
#include "src/mesh/tetmesh.h"

/* As many fields as a stream has at most can be controlled; each may bring its vector. */
enum { MAX_CONTROLS = 256 };

enum build_phase { BUILD_CONTRACT, BUILD_MEASURE, BUILD_ENCODE, BUILD_PHASES };

/* A field whose error is held. */
struct build_control {
    uint32_t field; /* of the mesh */
    double limit;   /* its own error limit, a fraction of the range; 0: the others' */
    double share;   /* of that limit: what it may use; 0: all of it */
};

struct build_series;

struct build_options {
    const struct build_control *controls; /* at least one */
    uint32_t control_count;
    enum metric metric;
    enum certify certify;    /* (simplify.h) */
    bool local_bound;        /* every controlled field gets its local bound, as a field of its own (local_bound.h) */
    bool summary;            /* the section SUMS: exact sums over the original (make_summary.h) */
    bool certify_all;        /* every field gets a `max`: the exact maximum, where it has no bound */
    unsigned contract;       /* CONTRACT_... (simplify.h) */
    double max_error;        /* fraction of the range */
    uint32_t min_tets;
    double boundary_angle;   /* degrees */
    double domain_error;     /* most that the boundary may move, a fraction of the diagonal */
    double growth;           /* > 1 */
    int compression;         /* effort, 1 .. 22 */
    bool keep_order;         /* store the mesh's own numbering */
    struct quantise_options quantise;
    unsigned threads;
    uint64_t memory;         /* bytes; 0: no limit */
    const char *metadata;    /* a JSON object */
    bool finds_cost; /* the report says which controlled field costs most (field_cost.h), where that can be found */
    const char *regions;     /* the cell field that tells regions, or NULL */
    const struct tetlodi_write_section *sections; /* further ones of the stream */
    uint32_t section_count;
    /* the mesh's other steps in time (build_series.h), or NULL; with the default metric, lossless */
    const struct build_series *series;
    bool (*progress)(void *opaque, enum build_phase phase, double done); /* false cancels; may be NULL */
    void *progress_opaque;
};

struct build_report {
    uint32_t contractions, levels;
    uint64_t refused[LOG_REFUSALS]; /* (contraction_log.h) */
    struct field_cost cost;
    uint32_t keys;                  /* steps of a series that drove the contraction */
    uint64_t turned_tets; /* numbered against their neighbours (orient.h); the counts that follow are without that */
    uint64_t degenerate_tets, inverted_tets, folded_tets; /* the stream counts folded ones as inverted */
};

/* What a build without options does; it needs controls, threads and metadata. */
struct build_options build_options_default(void);

/* What an option may be: an option of the program and a member of libtetlod-build's options. */
struct build_range {
    const char *option, *member;
    double value, least, most;
};

/* The first number that is out of its range. False: all are within. */
bool build_options_out_of_range(const struct build_options *options, struct build_range *out);

/* Is the exact maximum of every level taken, over the overlay? */
bool build_asks_overlay(const struct build_options *options);

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
