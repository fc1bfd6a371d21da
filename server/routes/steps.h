/* SPDX-License-Identifier: BSD-3-Clause */
/* Steps in time (SPEC 3.7): which step and band a request means, and its mesh. */
#ifndef TETLOD_SERVER_STEPS_H
#define TETLOD_SERVER_STEPS_H

#include "server/http/exchange.h"
#include "server/http/params.h"
#include "server/jobs/made.h"
#include "src/stream/selection.h"

/* A step in a band, or none: then a level is meant. */
struct step_choice {
    bool any;
    struct dataset *dataset;    /* the topology group that has it, which the caller holds */
    uint32_t band, level, step; /* of that group; the level is the band's */
};

/* What the parameters `time` and `step` of a query mean, with the band by `error` or `abs_error`. Steps are counted
 * through all topology groups. QUERY_ABSENT: there is none of the two. QUERY_BAD: answered, also where a parameter is
 * not one of `names`. */
enum query_result query_step(struct exchange *exchange, struct dataset *dataset, const char *names,
                             struct step_choice *out);

/* The same without the band: the step that `time` or `step` means. */
enum query_result query_step_selection(struct exchange *exchange, struct dataset *dataset, struct step_selection *out);

/* Of a path .../bands/{band}/steps/{step}/...: captures 2 and 3, or the first of them alone. False: answered. */
bool captured_step(struct exchange *exchange, struct dataset *dataset, struct step_choice *out);
bool captured_band(struct exchange *exchange, struct dataset *dataset, struct step_choice *out);

/* The series' number of a field of the stream, or TETLOD_NONE. */
uint32_t field_with_steps(const struct dataset *dataset, uint32_t field);

/* Sets what makes the mesh of the band's level with the fields that have steps, in the series' order. The answer's
 * choice begins with its step_choice. */
void step_answer(struct level_answer *answer, const struct tetlod_info *info);

/* For names of answers: "-3-12", or "". */
enum { STEP_NAME = 32 };
void step_name(const struct step_choice *choice, char out[STEP_NAME]);

/* The step's number among those of all topology groups. */
uint32_t step_number(const struct step_choice *choice);

/* Tetlod-Level, -Vertices, -Tets, -Band, -Step, -Topology, -Time, -Error. */
void step_headers(struct response *response, const struct step_choice *choice);

#endif
