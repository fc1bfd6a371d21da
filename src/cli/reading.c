/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/reading.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

static bool parse_cell_data(const struct command *command, const char *text, enum cell_data *out)
{
    static const char *const names[] = {"keep", "average", "drop"};
    for (int i = CELL_DATA_KEEP; i <= CELL_DATA_DROP; i++)
        if (strcmp(text, names[i]) == 0) {
            *out = (enum cell_data)i;
            return true;
        }
    cli_usage(command->name, "--cell-data is keep, average or drop, not '%s'", text);
    return false;
}

bool reading_option(struct reading *reading, const struct command *command, int option, const char *value)
{
    struct io_read_options *options = &reading->options;
    switch (option) {
    case READING_Q:
        options->solution = value;
        return true;
    case READING_NAN_FILL:
        options->nan_fill = &reading->fill;
        return cli_parse_nan_fill(command, value, &reading->fill);
    case READING_TIME:
        options->time = value;
        return true;
    case READING_BLOCK:
        options->block = value;
        return true;
    case READING_CELL_DATA:
        return parse_cell_data(command, value, &options->cell_data);
    case READING_WELD:
        options->welds = true;
        return cli_parse_number(command, "weld", value, 0, &options->weld);
    case READING_SUBDIVIDE:
        return options->subdivide = true;
    case READING_DROP_DEGENERATE:
        return options->drop_degenerate = true;
    case READING_FOLLOW:
        return options->follow = true;
    default:
        return false;
    }
}

void reading_notes(const char *command, const struct io_report *report, const struct tetmesh *mesh)
{
    const struct {
        uint64_t count;
        const char *what;
    } notes[] = {{report->blocks, "blocks merged"},
                 {report->flat_blocks, "blocks of polygons left out"},
                 {report->split_cells, "cells split into tetrahedra"},
                 {report->linearised_cells, "cells of higher order taken by their corners; --subdivide uses more"},
                 {report->higher_cells,
                  "cells of higher order taken by their corners; their other points are not used"},
                 {report->centres, "points added in the middle of cells"},
                 {report->skipped_cells, "cells without volume left out"},
                 {report->hidden_cells, "ghost or blanked cells left out"},
                 {report->welded_points, "points welded to others at the same place, or of the same number"},
                 {report->other_values, "of these have other values in another piece; those of the first are kept"},
                 {report->apart_points,
                  "points of pieces have other values than another piece at the same place, and stay apart; numbers of "
                  "points, as GlobalPointIds, would join them"},
                 {report->dropped_tets, "degenerate or duplicate tetrahedra dropped"},
                 {report->skipped_arrays, "arrays left out: not numbers, or of a kind that is not read"},
                 {report->partial_arrays, "arrays left out: not all blocks have them"},
                 {report->own_numbers, "arrays left out: each piece numbers its points by itself"},
                 {report->averaged_fields,
                  "fields made of cell data: at each point the mean over its tetrahedra by volume"},
                 {report->nan_filled, "NaN values filled"},
                 {report->nan_cells, "values of cells are NaN, and stay so"},
                 {mesh->unused_points, "points that no tetrahedron uses left out"}};
    if (report->steps > 1)
        fprintf(stderr, "tetlod %s: step %" PRIu64 " of 0 .. %" PRIu64 " in time: %g\n", command, report->step,
                report->steps - 1, report->time);
    for (size_t i = 0; i < sizeof notes / sizeof *notes; i++)
        if (notes[i].count)
            fprintf(stderr, "tetlod %s: %" PRIu64 " %s\n", command, notes[i].count, notes[i].what);
    if (report->left_out[0]) {
        fprintf(stderr, "tetlod %s: left out: ", command);
        cli_print_safe(report->left_out);
        fputc('\n', stderr);
    }
}
