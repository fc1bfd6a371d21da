/* SPDX-License-Identifier: BSD-3-Clause */
#include <inttypes.h>
#include <stdio.h>

#include "src/cli/cli.h"
#include "src/io/io.h"

static const char help[] =
    "usage: tetlod convert INPUT [--q SOLUTION] -o OUT\n"
    "\n"
    "Reads a mesh and writes it in the format that OUT's extension names. Cells that are not tetrahedra are split so\n"
    "that neighbours match, cells of higher order are taken by their corners, points that no tetrahedron uses are\n"
    "dropped, cell data is left out.\n"
    "\n"
    "  -o, --output OUT   the file to write: .vtu, .vtk, .msh; .stl, .ply (the boundary surface)\n"
    "      --q SOLUTION   the solution file of a PLOT3D grid, or a Medit .sol\n"
    "      --nan-fill V   values that are NaN become V, or with 'neighbours' the mean of the points around them, ring by\n"
    "                     ring (default: they are refused)\n"
    "\n"
    "reads: VTU, legacy VTK (unstructured, structured, rectilinear, structured points), Gmsh 2.2 and 4.1, Medit .mesh,\n"
    "TetGen .node with .ele, PLOT3D, and a tetlod stream's finest level; told by content first, by extension second\n"
    "example: tetlod convert bluntfinxyz.bin --q bluntfinq.bin -o blunt.vtu\n";

static void note(uint64_t count, const char *what)
{
    if (count)
        fprintf(stderr, "tetlod convert: %" PRIu64 " %s\n", count, what);
}

static int convert(const char *input, const struct io_read_options *options, const char *output)
{
    struct tetmesh mesh;
    struct tetlod_error error = {0};
    struct io_report report;
    enum tetlod_status status = io_check_output(output, &error);
    if (status == TETLOD_OK)
        status = io_read(&mesh, input, options, &report, &error);
    if (status != TETLOD_OK)
        return cli_fail(&error);
    status = io_write(&mesh, output, &error);
    if (status == TETLOD_OK) {
        note(report.split_cells, "cells split into tetrahedra");
        note(report.skipped_cells, "cells without volume left out");
        note(report.skipped_arrays, "arrays left out: cell data, or not numbers");
        note(report.nan_filled, "NaN values filled");
        note(mesh.unused_points, "points that no tetrahedron uses left out");
    }
    tetmesh_fini(&mesh);
    return status == TETLOD_OK ? EXIT_DONE : cli_fail(&error);
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {
        {"output", required_argument, NULL, 'o'}, {"q", required_argument, NULL, 'q'},
        {"nan-fill", required_argument, NULL, 'n'}, {0}};
    struct io_read_options read_options = {0};
    struct nan_fill fill;
    const char *output = NULL;
    for (int option; (option = cli_option(&command_convert, argc, argv, "o:", options)) != -1;) {
        if (option == 'o')
            output = optarg;
        else if (option == 'q')
            read_options.solution = optarg;
        else if (option == 'n' && cli_parse_nan_fill(&command_convert, optarg, &fill))
            read_options.nan_fill = &fill;
        else
            return EXIT_USAGE;
    }
    if (!cli_operands(&command_convert, argc, 1, "the INPUT mesh"))
        return EXIT_USAGE;
    if (!output)
        return cli_usage("convert", "-o OUT is missing: the file to write");
    return convert(argv[optind], &read_options, output);
}

const struct command command_convert = {"convert", "from any readable mesh to any writable one", help, run};
