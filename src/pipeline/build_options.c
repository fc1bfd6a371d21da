/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/build_options.h"

#include "format/fail.h"
#include "src/cells/cell_phases.h"
#include "src/util/parallel.h"

struct build_options build_options_default(void)
{
    return (struct build_options){.metric = METRIC_ENVELOPE,
                                  .contract = CONTRACT_EDGES,
                                  .max_error = 1,
                                  .min_tets = 1,
                                  .boundary_angle = 30,
                                  .domain_error = DOMAIN_ERROR_SMALL,
                                  .growth = 1.1,
                                  .compression = 19};
}

bool build_options_out_of_range(const struct build_options *options, struct build_range *out)
{
    const struct build_range ranges[] = {
        {"max-error", "max_error", options->max_error, 0, 1e6}, // predictions may pass the range
        {"domain-error", "domain_error", options->domain_error, 0, 1},
        {"keep-features", "keep_features", options->keep_features, 0, 1},
        {"boundary-angle", "boundary_angle", options->boundary_angle, 0, 180},
        {"growth", "growth", options->growth, 1.001, 16},
        {"threads", "threads", options->threads, 0, PARALLEL_MAX_THREADS},
        {"compress", "compression", options->compression, 1, 22},
        {"position-bits", "position_bits", options->quantise.position_bits, 0, QUANTISE_MAX_BITS},
        {"field-bits", "field_bits", options->quantise.field_bits, 0, QUANTISE_MAX_BITS},
        {"position-error", "position_error", options->quantise.position_error, 0, 1},
        {"field-error", "field_error", options->quantise.field_error, 0, 1},
    };
    for (size_t i = 0; i < sizeof ranges / sizeof *ranges; i++)
        if (!(ranges[i].value >= ranges[i].least && ranges[i].value <= ranges[i].most)) {
            *out = ranges[i];
            return true;
        }
    return false;
}

enum tetlod_status build_say_done(const struct build_options *options, enum build_phase phase, double done,
                                  struct tetlod_error *error)
{
    return !options->progress || options->progress(options->progress_opaque, phase, done)
               ? TETLOD_OK
               : tetlodi_fail(error, TETLOD_ERR_CANCELLED, "cancelled");
}

bool build_asks_overlay(const struct build_options *options)
{
    const struct quantise_options *quantise = &options->quantise;
    return options->certify_all || options->certify == CERTIFY_EXACT || options->metric == METRIC_MEASURED ||
           options->domain_error > DOMAIN_ERROR_SMALL || quantise->position_bits || quantise->position_error > 0;
}

const char *build_against_pages(const struct build_options *options)
{
    const struct simplify_options contraction = {
        .metric = options->metric, .certify = options->certify, .contract = options->contract};
    if (options->keep_features > 0)
        return "its levels are where its phases end, those of --keep-features elsewhere; leave one of them out";
    if (options->series) // SPEC 3.7: a band is a level, and its frames have all vertices of that level
        return "the values of a series' steps are stored for whole levels, not page by page, so that no page would "
               "have its own; a series builds without pages, and one step with --time N";
    return cells_wrong(&contraction);
}
