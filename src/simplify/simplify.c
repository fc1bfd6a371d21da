/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/simplify.h"

#include "src/simplify/rounds/rounds.h"

bool simplify_in_rounds(const struct simplify_options *options)
{
    return options->metric == METRIC_ENVELOPE && options->certify == CERTIFY_FAST &&
           options->contract == CONTRACT_EDGES;
}

enum tetlod_status simplify(struct contraction_log *out, const struct tetmesh *mesh, const uint32_t *controlled,
                            uint32_t controlled_count, const double *limits, const struct simplify_options *options,
                            struct tetlod_error *error)
{
    return rounds_simplify(out, mesh, controlled, controlled_count, limits, options, error);
}

/* The working mesh; simplex by simplex what is known of each edge, and the quadrics; and what a limit that is asked
 * keeps. */
uint64_t simplify_bytes(const struct tetmesh *mesh, uint32_t controlled_count, const struct simplify_options *options)
{
    return rounds_bytes(mesh, controlled_count, options);
}
