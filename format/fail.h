/* SPDX-License-Identifier: BSD-3-Clause */
/* How every layer reports a failure: fill the error, return its status. Not installed. */
#ifndef TETLOD_FAIL_H
#define TETLOD_FAIL_H

#include "format/tetlod.h"

/* Fills *error (may be NULL) with a printf-formatted message and returns `status`. The message is one line, without a
 * trailing full stop or newline; it says where the failure is and, if possible, how to fix it. */
enum tetlod_status tetlodi_fail(struct tetlod_error *error, enum tetlod_status status, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* ERR_NOMEM, naming what did not fit. */
enum tetlod_status tetlodi_fail_nomem(struct tetlod_error *error, const char *what, uint64_t bytes);

/* Passes a failure on where nothing is owned. */
#define TETLOD_TRY(expression)                                                                                         \
    do {                                                                                                               \
        enum tetlod_status try_status_ = (expression);                                                                 \
        if (try_status_ != TETLOD_OK)                                                                                  \
            return try_status_;                                                                                        \
    } while (0)

/* The same where a `done:` label releases what is owned and returns `status`. */
#define TETLOD_TRY_DONE(expression)                                                                                    \
    do {                                                                                                               \
        status = (expression);                                                                                         \
        if (status != TETLOD_OK)                                                                                       \
            goto done;                                                                                                 \
    } while (0)

#endif
