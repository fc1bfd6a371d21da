/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/cli.h"

static int run(int argc, char **argv)
{
    while (cli_option(&command_info, argc, argv, "", (struct option[]){{0}}) != -1)
        return EXIT_USAGE;
    return EXIT_FAILED;
}

const struct command command_info = {"info", "", "usage: tetlod info\n", run};
