/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/fail.h"

#include <stdarg.h>
#include <stdio.h>

const char *tetlod_status_text(enum tetlod_status status)
{
    switch (status) {
#define STATUS_TEXT(name, number, text)                                                                                \
    case TETLOD_##name:                                                                                                \
        return text;
        TETLOD_STATUS_LIST(STATUS_TEXT)
#undef STATUS_TEXT
    }
    return "unknown status";
}

const char *tetlod_version(void)
{
    return TETLOD_VERSION_STRING;
}

const char *tetlod_measure_name(enum tetlod_measure measure)
{
    static const char *const names[TETLOD_MEASURES] = {"max", "sampled", "rms", "predicted"};
    return (unsigned)measure < TETLOD_MEASURES ? names[measure] : "unknown";
}

enum tetlod_status tetlodi_fail(struct tetlod_error *error, enum tetlod_status status, const char *format, ...)
{
    if (error) {
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(error->message, sizeof error->message, format, arguments);
        va_end(arguments);
        error->status = status;
        error->offset = UINT64_MAX;
    }
    return status;
}

enum tetlod_status tetlodi_fail_nomem(struct tetlod_error *error, const char *what, uint64_t bytes)
{
    return tetlodi_fail(error, TETLOD_ERR_NOMEM, "out of memory: no room for %s (%llu bytes)", what,
                        (unsigned long long)bytes);
}
