/* SPDX-License-Identifier: BSD-3-Clause */
#include <stdio.h>

#include "src/cli/cli.h"
#include "src/io/io.h"

static const char help[] = "usage: tetlod formats\n"
                           "\n"
                           "Lists the mesh files that this binary reads and writes: name, whether it is read and written,\n"
                           "extensions, and what is known of the format. A file's content decides its format, then its extension.\n"
                           "\n"
                           "example: tetlod formats\n";

static int run(int argc, char **argv)
{
    static const struct option options[] = {{0}};
    if (cli_option(&command_formats, argc, argv, "", options) != -1 || !cli_operands(&command_formats, argc, 0, "nothing"))
        return EXIT_USAGE;
    struct io_format format;
    for (size_t f = 0; io_format(f, &format); f++) {
        printf("%-9s %-4s %-5s", format.name, format.reads ? "read" : "-", format.writes ? "write" : "-");
        for (size_t e = 0; format.extensions[e]; e++)
            printf(" .%s", format.extensions[e]);
        printf("  %s\n", format.about);
    }
    return EXIT_DONE;
}

const struct command command_formats = {"formats", "list the mesh files that can be read and written", help, run};
