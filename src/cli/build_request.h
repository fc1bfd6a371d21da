/* SPDX-License-Identifier: BSD-3-Clause */
/* What tetlod build is asked for, and how far it is. */
#ifndef TETLOD_BUILD_REQUEST_H
#define TETLOD_BUILD_REQUEST_H

#include "src/cli/progress.h"
#include "src/cli/reading.h"
#include "src/cli/series_input.h"
#include "src/cli/series_topologies.h"
#include "src/pipeline/build.h"

/* Options --field, and --no-field. */
enum { MAX_FIELD_OPTIONS = 64 };

struct build_request {
    const char *input, *output, *carry, *contract, *region;
    const char *scratch; /* folder of temporary files; NULL: as TMPDIR says */
    const char *fields[MAX_FIELD_OPTIONS], *without[MAX_FIELD_OPTIONS];
    double units[MAX_FIELD_OPTIONS]; /* --abs-error of each field; 0: none */
    uint32_t field_count, without_count;
    const char *const *usual; /* without --field: what the first step's mesh has, for the other meshes of a series */
    uint32_t usual_count;
    bool regions_are_found; /* no --region names them */
    double show_error; /* of what other programs see of OUT.vtkhdf; negative: it is not given */
    double mail_error; /* of the finest level that is written; 0: all levels are */
    struct build_options build;
    struct reading reading;
    struct series_input series;
    struct series_topologies topologies; /* none: all steps are over one mesh */
    uint64_t nan_filled;
    /* ordered: --metric is given; moves_boundary: --domain-error */
    bool for_mail, json, quiet, all, ordered, moves_boundary;
    bool draws_progress; /* in any case */
    bool by_share; /* several programs build without --memory: each takes its share of the memory */
    char own_output[4096]; /* the name of the output where none is given */
    struct progress progress;
    double phase_started;
    enum build_phase phase;
    double seconds[BUILD_PHASES];
};

/* The options, as `tetlod help build` explains them. */
extern const char build_help[];

/* Takes the command line. EXIT_DONE, or EXIT_USAGE after a message. */
int build_request_parse(struct build_request *out, int argc, char **argv);

/* tetlod build, together with other programs (work_share.h); share NULL: alone. The exit status; of those that do not
 * write, only errors are printed. */
int build_together(int argc, char **argv, const struct work_share *share);

/* The names that the options give. */
const char *build_metric_name(enum metric metric);
const char *build_certify_name(enum certify certify);

#endif
