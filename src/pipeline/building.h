/* SPDX-License-Identifier: BSD-3-Clause */
/* What a build knows while it runs (build.c), and how its levels come to their errors (level_errors.c). */
#ifndef TETLOD_BUILDING_H
#define TETLOD_BUILDING_H

#include "format/write/write_input.h"
#include "src/cells/cell_phases.h"
#include "src/log/contraction_log.h"
#include "src/mesh/orient.h"
#include "src/pipeline/build_options.h"
#include "src/pipeline/build_series.h"
#include "src/pipeline/field_cost.h"
#include "src/pipeline/keep_features.h"
#include "src/pipeline/local_bound.h"
#include "src/pipeline/precision.h"

/* How far the boundary may move while it counts as kept, as a fraction of the diagonal: by rounding. */
static const double BOUNDARY_KEPT = 1e-12;

struct build {
    const struct tetmesh *mesh;     /* that is contracted: rounded, if quantised. Levels have its values on its grids */
    const struct tetmesh *original; /* that errors are about */
    const uint32_t *numbering;      /* the corners as the caller numbers them: what is stored */
    const struct tetmesh *input;    /* with the cells that were split, if these are kept */
    struct oriented oriented;       /* `mesh` and `original` are in one turn (orient.h) */
    struct tetmesh turned;          /* the caller's mesh with those corners, if they differ */
    struct tetmesh rounded;
    double *rounding;               /* [field] bound of what rounding changed, if quantised */
    double rounded_by;              /* how far rounding has moved the boundary, in units of length */
    struct precision precision;     /* if fields are not */
    struct local_bounds bounds;     /* if they are asked for: `original` has them once the mesh is contracted */
    double (*ranges)[2];            /* [field] of the original; of a local bound 0 to the largest */
    const struct build_options *options;
    struct contraction_log log;
    struct cell_groups groups;      /* of a paged stream, fine to coarse */
    struct series_build *series;    /* if there is one */
    struct kept_features kept;      /* if they are asked for */
    struct tetlodi_write_level *levels; /* coarse to fine */
    double *errors;                     /* [mark][field][measure], fine to coarse */
    struct overlay_levels *overlay;     /* if it is asked for */
    struct field_cost cost;
    double *exact;                      /* [field] its answer at the current mark */
    bool *asked;                        /* [mark] it is measured (list_asked) */
    double *domains;                    /* [mark] the domain error, as far as it is known, in units of length */
    struct shared_measuring *measuring; /* by other programs, until the errors are asked for */
    double diagonal;                    /* that the stream knows */
    struct tetlod_error *error;
};

/* Does an error limit the contraction? */
static inline bool building_controls(const struct build *build, uint32_t field)
{
    for (uint32_t i = 0; i < build->options->control_count; i++)
        if (build->options->controls[i].field == field)
            return true;
    return false;
}

/* The ranges of all fields and the levels. Of one that writes these have their errors once level_errors_end has been
 * called: other programs may measure meanwhile. `opaque` is the build. ERR_NOMEM, ERR_LIMIT, ERR_CANCELLED, or what the
 * share fails with. */
TETLOD_CHECKED enum tetlod_status level_errors_begin(struct build *build);
TETLOD_CHECKED enum tetlod_status level_errors_end(void *opaque, struct tetlod_error *error);
void level_errors_fini(struct build *build);

#endif
