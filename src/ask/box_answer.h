/* SPDX-License-Identifier: BSD-3-Clause */
/* What is known of the original by its sums of boxes and regions (SPEC 3.9), without any level. */
#ifndef TETLOD_BOX_ANSWER_H
#define TETLOD_BOX_ANSWER_H

#include "format/read/box_sums.h"
#include "src/ask/answer.h"

/* An interval that holds the answer for a box or a region; *volume is at most that of the box or region. `component`
 * counts through all fields. False: they do not say. Costs O(boxes * log boxes) at most. */
bool box_answer(const struct tetlodi_box_sums *sums, const struct ask_question *question, uint32_t component,
                struct ask_interval *out, double *volume);

#endif
