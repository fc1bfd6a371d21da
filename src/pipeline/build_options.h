/* SPDX-License-Identifier: BSD-3-Clause */
/* What a build is asked for. */
#ifndef TETLOD_BUILD_OPTIONS_H
#define TETLOD_BUILD_OPTIONS_H

#include "format/write/write_input.h"
#include "src/cells/cell_phases.h"
#include "src/mesh/tetmesh.h"
#include "src/pipeline/quantise.h"
#include "src/simplify/simplify.h"
#include "src/util/work_share.h"

/* Up to this domain error, the default, the proved bound is stored as it is; above, the exact maximum is taken as well
 * (PROOF.md, 5). */
static const double DOMAIN_ERROR_SMALL = 0.001;

/* As many fields as a stream has at most can be controlled; each may bring its vector. */
enum { MAX_CONTROLS = 256 };

enum build_phase { BUILD_CONTRACT, BUILD_MEASURE, BUILD_ENCODE, BUILD_PHASES };

/* A field whose error is held. */
struct build_control {
    uint32_t field; /* of the mesh */
    double limit;   /* its own error limit, a fraction of the range; 0: the others' */
    double share;   /* of that limit: what it may use; 0: all of it */
};

enum { MAX_SERIES_STEPS = 1 << 20, MAX_SERIES_BANDS = 32 };

/* A field of cells that has values at every step. */
struct build_series_cells {
    uint32_t field, components; /* of the mesh's fields of cells */
    enum tetlod_cell_type type; /* holds them all */
    bool missing;   /* a step is without it: it has no steps */
};

struct build_series {
    uint32_t step_count;
    const double *times;           /* [step], not falling */
    struct tetlod_source values;   /* [step][control][components * vertices], each control's in its type */
    const enum tetlod_type *types; /* [control] */
    const double *bands;           /* falling errors, fractions of the range; the last is 0 */
    uint32_t band_count;
    bool own_ranges;               /* of each step's own range (SPEC 3.7), not of that over all steps */
    bool points_move;              /* the last control says how far */
    const double (*ranges)[2];     /* [control, but how far points move] over more steps than these, or NULL */
    const struct build_series_cells *cells; /* ascending */
    uint32_t cell_count;
    struct tetlod_source cell_values; /* [step][cells][components * tetrahedra] */
};

/* Tetrahedra of a cell of a paged stream: usually, at least and at most. */
enum { BUILD_CELL_TETS = 100000, BUILD_MIN_CELL_TETS = 100, BUILD_MAX_CELL_TETS = 1 << 27 };

struct build_options {
    const struct build_control *controls; /* at least one */
    uint32_t control_count;
    enum metric metric;
    enum certify certify;    /* (simplify.h) */
    bool local_bound;        /* every controlled field gets its local bound, as a field of its own (local_bound.h) */
    bool summary;            /* the section SUMS: exact sums over the original (make_summary.h) */
    double keep_features;    /* every level has as many extrema of this persistence (keep_features.h); 0: it need not */
    bool certify_all;        /* every field gets a `max`: the exact maximum, where it has no bound */
    unsigned contract;       /* CONTRACT_... (simplify.h) */
    double max_error;        /* fraction of the range */
    uint32_t min_tets;
    double boundary_angle;   /* degrees */
    double domain_error;     /* most that the boundary may move, a fraction of the diagonal */
    double growth;           /* > 1 */
    int compression;         /* effort, 1 .. 22 */
    bool keep_order;         /* store the mesh's own numbering */
    uint32_t paged;          /* tetrahedra of a cell: contracted by cells, stored in pages (cell_phases.h); 0: as one */
    enum cell_bands bands;   /* of a paged build */
    bool spools;             /* of a paged build: cells wait in a temporary file, and arrays need not be resident */
    const struct work_share *share; /* of a paged build: programs that make it together, or NULL */
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

/* What a build without options does; it needs controls, threads and metadata. */
struct build_options build_options_default(void);

/* What an option may be: an option of the program and a member of libtetlod-build's options. */
struct build_range {
    const char *option, *member;
    double value, least, most;
};

/* The first number that is out of its range. False: all are within. */
bool build_options_out_of_range(const struct build_options *options, struct build_range *out);

/* Why a mesh cannot be built by cells with these options, or NULL. */
const char *build_against_pages(const struct build_options *options);

/* Does this program write the stream, of those that make it together? */
static inline bool build_writes(const struct build_options *options)
{
    return !options->share || options->share->writes;
}

/* Says how much of a phase is done: at its beginning, while no other thread is at work, 0. ERR_CANCELLED. */
TETLOD_CHECKED enum tetlod_status build_say_done(const struct build_options *options, enum build_phase phase,
                                                 double done, struct tetlod_error *error);

/* Is the exact maximum of every level taken, over the overlay? */
bool build_asks_overlay(const struct build_options *options);

#endif
