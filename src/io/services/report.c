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

/* The names that a list has. */
static void add_names(struct io_report *report, const char *list)
{
    uint32_t counted = 0;
    for (const char *at = list, *end; (at = strchr(at, '\'')) && (end = strchr(at + 1, '\'')); at = end + 1)
        io_leave_out(report, &counted, at + 1, (size_t)(end - at - 1));
}

void io_report_add(struct io_report *report, const struct io_report *part)
{
    uint64_t *const counts[] = {&report->split_cells, &report->linearised_cells, &report->higher_cells,
                                &report->centres, &report->skipped_cells, &report->hidden_cells, &report->nan_filled,
                                &report->nan_cells, &report->welded_points, &report->other_values,
                                &report->apart_points, &report->dropped_tets, &report->blocks, &report->flat_blocks};
    const uint64_t more[] = {part->split_cells, part->linearised_cells, part->higher_cells, part->centres,
                             part->skipped_cells, part->hidden_cells, part->nan_filled, part->nan_cells,
                             part->welded_points, part->other_values, part->apart_points, part->dropped_tets,
                             part->blocks, part->flat_blocks};
    for (size_t i = 0; i < sizeof more / sizeof *more; i++)
        *counts[i] += more[i];
    report->names_blocks |= part->names_blocks;
    if (part->steps) {
        report->steps = part->steps;
        report->step = part->step;
        report->time = part->time;
    }
    report->skipped_arrays += part->skipped_arrays;
    report->partial_arrays += part->partial_arrays;
    report->own_numbers += part->own_numbers;
    report->averaged_fields += part->averaged_fields;
    add_names(report, part->left_out);
}
