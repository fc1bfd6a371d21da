/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/diff_limits.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

enum { MAX_LINE = 1024 };

enum tetlod_status diff_limits_one(struct diff_limits *out, const char *field, const char *limit, enum diff_norm norm,
                                   struct tetlod_error *error)
{
    if (!array_reserve((void **)&out->limits, &out->capacity, out->count + 1, sizeof *out->limits))
        return tetlodi_fail_nomem(error, "the limits", sizeof *out->limits);
    struct diff_limit *one = &out->limits[out->count++];
    *one = (struct diff_limit){strdup(field), limit ? strdup(limit) : NULL, norm};
    return one->field && (!limit || one->limit) ? TETLOD_OK : tetlodi_fail_nomem(error, "the limits", MAX_LINE);
}

void diff_limits_fini(struct diff_limits *limits)
{
    for (size_t i = 0; i < limits->count; i++) {
        free(limits->limits[i].field);
        free(limits->limits[i].limit);
    }
    free(limits->limits);
    *limits = (struct diff_limits){0};
}

/* The next word of a line, which may be in quotes; NULL: there is none. Ends it with NUL. */
static char *next_word(char **at)
{
    static const char blanks[] = " \t\r\n";
    char *word = *at + strspn(*at, blanks);
    bool quoted = *word == '"';
    if (!*word || *word == '#')
        return NULL;
    word += quoted;
    char *end = word + strcspn(word, quoted ? "\"" : blanks);
    *at = end + (*end != 0);
    *end = 0;
    return word;
}

static enum tetlod_status read_line(struct diff_limits *out, char *line, struct tetlod_error *error)
{
    char *field = next_word(&line), *limit = field ? next_word(&line) : NULL, *norm = limit ? next_word(&line) : NULL;
    static const double unit[2] = {0, 1};
    double value;
    if (!field)
        return TETLOD_OK;
    bool rms = norm && strcmp(norm, "rms") == 0;
    if (!limit || !diff_parse_limit(limit, unit, &value) || (norm && !rms && strcmp(norm, "max") != 0) ||
        next_word(&line))
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "a line is a field, its limit, and max or rms: 'p 2%%' or 'p 0.5 rms'");
    return diff_limits_one(out, field, limit, rms ? DIFF_RMS : DIFF_MAX, error);
}

enum tetlod_status diff_limits_read(struct diff_limits *out, const char *path, struct tetlod_error *error)
{
    char line[MAX_LINE];
    struct tetlod_error inner = {0};
    enum tetlod_status status = TETLOD_OK;
    FILE *file = fopen(path, "r");
    if (!file)
        return tetlodi_fail(error, TETLOD_ERR_IO, "%s: cannot open: %s", path, strerror(errno));
    unsigned number = 0;
    while (status == TETLOD_OK && fgets(line, sizeof line, file)) {
        number++;
        status = strchr(line, '\n') || feof(file)
                     ? read_line(out, line, &inner)
                     : tetlodi_fail(&inner, TETLOD_ERR_ARGUMENT, "the line is longer than %d bytes", MAX_LINE - 2);
    }
    bool failed = ferror(file);
    fclose(file);
    if (status != TETLOD_OK)
        return tetlodi_fail(error, status, "%s: line %u: %.400s", path, number, inner.message);
    if (failed || !out->count)
        return tetlodi_fail(error, TETLOD_ERR_IO, "%s: %s", path, failed ? "cannot be read" : "it has no limits");
    return TETLOD_OK;
}
