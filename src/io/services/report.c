/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/services/report.h"

#include <stdio.h>
#include <string.h>

/* Whether a name is in a list already: blocks and pieces repeat theirs. */
static bool is_listed(const char *list, const char *name, size_t length)
{
    for (const char *at = list; (at = strstr(at, "'")); at += strcspn(at, ",")) {
        at++;
        if (strncmp(at, name, length) == 0 && at[length] == '\'')
            return true;
    }
    return false;
}

void io_leave_out(struct io_report *report, uint32_t *counter, const char *name, size_t length)
{
    static const char more[] = ", ...";
    size_t used = strlen(report->left_out), room = sizeof report->left_out - sizeof more;
    bool full = used >= sizeof more && strcmp(report->left_out + used - (sizeof more - 1), more) == 0;
    (*counter)++;
    if (full || is_listed(report->left_out, name, length))
        return;
    if (used + length + 4 > room)
        snprintf(report->left_out + used, sizeof report->left_out - used, "%s", more);
    else
        snprintf(report->left_out + used, room - used + 1, "%s'%.*s'", used ? ", " : "", (int)length, name);
}
