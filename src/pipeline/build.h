/* SPDX-License-Identifier: BSD-3-Clause */
/* From a mesh to a stream: contract, measure every level, encode. */
#ifndef TETLOD_BUILD_H
#define TETLOD_BUILD_H

#include "format/writer.h"
#include "src/pipeline/quantise.h"
#include "src/simplify/simplify.h"
#include "src/mesh/tetmesh.h"

enum build_phase { BUILD_CONTRACT, BUILD_MEASURE, BUILD_ENCODE, BUILD_PHASES };

/* A field whose error is held. */
struct build_control {
    uint32_t field; /* of the mesh */
    double limit;   /* its error limit as a multiple of the others' */
};

struct build_options {
    const struct build_control *controls; /* at least one */
    uint32_t control_count;
    enum metric metric;
    enum certify certify;    /* (simplify.h) */
    unsigned contract;       /* CONTRACT_... (simplify.h) */
    uint32_t candidates;     /* per simplex; 0: the usual number (candidates.h) */
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
    bool (*progress)(void *opaque, enum build_phase phase, double done); /* false cancels; may be NULL */
    void *progress_opaque;
};

struct build_report {
    uint32_t contractions, levels;
    uint64_t degenerate_tets, inverted_tets, folded_tets; /* the stream counts folded ones as inverted */
};

/* The mesh has passed tetmesh_validate and has a field at least. */
TETLOD_CHECKED enum tetlod_status build_stream(const struct tetmesh *mesh, const struct build_options *options,
                                               const struct tetlodi_sink *sink, struct build_report *report,
                                               struct tetlod_error *error);

/* Resolves what --field says: NAME, NAME:mag or NAME:COMPONENT, each with :LIMIT behind it if wanted. Magnitudes and
 * components become fields of their own under that name. ERR_FIELD lists what there is. */
TETLOD_CHECKED enum tetlod_status build_control_parse(struct tetmesh *mesh, const char *text, struct build_control *out,
                                                      struct tetlod_error *error);

/* Without --field: the first scalar field, or the first field's magnitude. ERR_MESH if there is no field. */
TETLOD_CHECKED enum tetlod_status build_control_default(struct tetmesh *mesh, struct build_control *out,
                                                        struct tetlod_error *error);

#endif
