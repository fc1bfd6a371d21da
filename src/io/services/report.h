/* SPDX-License-Identifier: BSD-3-Clause */
/* What a caller asks of a reader, and what the reader did that its user should know. */
#ifndef TETLOD_IO_REPORT_H
#define TETLOD_IO_REPORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct nan_fill;
struct work_share;

/* Programs that read pieces of a file together (pieces.h). The rest io_read fills in. */
struct io_sharing {
    const struct work_share *share;
    const char *path; /* of the file that io_read was asked for */
    uint32_t pieces;  /* of a helper: how many the one that leads has found */
};

enum cell_data { CELL_DATA_KEEP, CELL_DATA_AVERAGE, CELL_DATA_DROP };

struct io_read_options {
    const char *solution; /* PLOT3D or Medit solution file that belongs to a grid, or NULL */
    const struct nan_fill *nan_fill; /* what NaN values of fields become; NULL: they are refused */
    const char *block;    /* the one block to read of a file that has several, by name; NULL: all */
    const char *time;     /* "last" or the number of a step from 0; NULL: the last */
    enum cell_data cell_data; /* AVERAGE: every cell field also becomes a point field */
    double weld;          /* tolerance, with `welds`: points are welded also where the file is one block */
    bool welds, subdivide, drop_degenerate;
    bool any_values;      /* values of points may be infinite or NaN: who reads checks the fields that are used */
    bool keep_cells;      /* the mesh has the cells, too, that were split (originals.h) */
    const char *output;   /* the file that will be written: a file that a file names may not be it; or NULL */
    bool follow;          /* files that a file names may be outside its folder */
    const struct io_sharing *sharing; /* or NULL */
};

/* What a reader did that its user should know. */
struct io_report {
    const char *format;    /* short name, static: "vtu", "vtk", "plot3d", ... */
    uint64_t split_cells;  /* cells that were not tetrahedra and were split */
    uint64_t linearised_cells; /* cells of higher order that were taken by their corners */
    uint64_t higher_cells; /* the same, of kinds that cannot be subdivided */
    uint64_t centres;      /* points that were added in the middle of cells */
    uint64_t skipped_cells; /* cells of lower dimension, which have no volume */
    uint64_t hidden_cells; /* ghosts and blanked cells, left out */
    uint64_t nan_filled;   /* values that were NaN and were filled */
    /* numbers of cell fields that are NaN, and stay so: Exodus has variables that not all blocks have */
    uint64_t nan_cells;
    uint64_t welded_points;
    uint64_t other_values; /* of those, joined by numbers: have other values in another piece */
    uint64_t apart_points; /* at a place that another piece has with other values, without numbers: not joined */
    uint64_t dropped_tets; /* degenerate and duplicate tetrahedra that were dropped */
    uint64_t blocks;       /* merged, if there were several */
    bool names_blocks;     /* the file has blocks with names, one of which can be asked for */
    uint64_t flat_blocks;  /* files of polygons among them, left out */
    uint64_t steps, step;  /* of time in the file, and the one that was read, from 0; 0, 0: there is no time */
    double time;           /* of that step */
    uint32_t skipped_arrays; /* arrays that are not numbers */
    uint32_t partial_arrays; /* arrays that not all blocks have */
    uint32_t own_numbers;    /* arrays of numbers of points that each piece has counted by itself */
    char left_out[256];      /* names of these kinds, as many as fit */
    uint32_t averaged_fields; /* cell fields that became point fields */
};

/* Adds what was done to a part of the file. */
void io_report_add(struct io_report *report, const struct io_report *part);

/* Counts an array that is left out, in one of the two counters, and notes its name of `length` bytes. */
void io_leave_out(struct io_report *report, uint32_t *counter, const char *name, size_t length);

#endif
