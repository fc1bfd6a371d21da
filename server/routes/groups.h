/* SPDX-License-Identifier: BSD-3-Clause */
/* Stored bytes of steps in time (SPEC 3.7): a group of a band, and all that a step needs of a client that holds
 * nothing. */
#ifndef TETLOD_SERVER_GROUPS_H
#define TETLOD_SERVER_GROUPS_H

#include "server/http/exchange.h"
#include "server/routes/steps.h"

/* Header, index and geometry up to the band's level, the table of steps, and the group that the step is in. */
enum outcome respond_step_prefix(struct exchange *exchange, const struct step_choice *choice);

#endif
