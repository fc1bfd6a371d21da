/* SPDX-License-Identifier: BSD-3-Clause */
/* What the commands that read meshes share: the options that say how, and the notes on what was done. */
#ifndef TETLOD_READING_H
#define TETLOD_READING_H

#include "src/cli/cli.h"
#include "src/io/io.h"

/* To be zeroed; `options` may then be given to io_read. */
struct reading {
    struct io_read_options options;
    struct nan_fill fill;
};

enum { READING_FIRST = 0x1000, READING_Q = READING_FIRST, READING_NAN_FILL, READING_TIME, READING_BLOCK,
      READING_CELL_DATA,
       READING_WELD, READING_SUBDIVIDE, READING_DROP_DEGENERATE, READING_FOLLOW, READING_END };

/* For a command's list of options. */
#define READING_OPTIONS                                                                                                \
    {"q", required_argument, NULL, READING_Q}, {"nan-fill", required_argument, NULL, READING_NAN_FILL},                \
        {"time", required_argument, NULL, READING_TIME}, {"block", required_argument, NULL, READING_BLOCK},            \
        {"cell-data", required_argument, NULL, READING_CELL_DATA}, {"weld", required_argument, NULL, READING_WELD},    \
        {"subdivide", no_argument, NULL, READING_SUBDIVIDE},                                                           \
        {"drop-degenerate", no_argument, NULL, READING_DROP_DEGENERATE}, {"follow", no_argument, NULL, READING_FOLLOW}

/* For a command's help. */
#define READING_HELP                                                                                                   \
    "      --q SOLUTION        the solution file of a PLOT3D grid, a Medit .sol or an MFEM grid function\n"            \
    "      --time N            the step to read where the file holds several: last (default), or its\n"                \
    "                          number from 0\n"                                                                        \
    "      --block NAME        the one block to read of a file of several (default: all, merged)\n"                    \
    "      --cell-data HOW     values of cells: keep them (default; where there are no others, also\n"                 \
    "                          average), average: also make point fields, the mean over a point's\n"                   \
    "                          tetrahedra by volume; or drop\n"                                                        \
    "      --subdivide         use the middles of the edges of quadratic cells, all points of Lagrange\n"              \
    "                          cells (default: corners only)\n"                                                        \
    "      --weld T            merge points that are at most T apart and have the same values (default:\n"             \
    "                          0 between pieces and blocks, and not at all within one)\n"                              \
    "      --drop-degenerate   drop degenerate and duplicate tetrahedra (default: they are carried along)\n"           \
    "      --nan-fill V        values that are NaN become V, or with 'neighbours' the mean of the points\n"            \
    "                          that edges join them to, ring by ring (default: they are refused)\n"                    \
    "      --follow            also read files that a file names outside its folder\n"

/* Takes one of these options; false after a usage message. */
bool reading_option(struct reading *reading, const struct command *command, int option, const char *value);

/* Says on standard error what was done to the mesh, a line each. */
void reading_notes(const char *command, const struct io_report *report, const struct tetmesh *mesh);

#endif
