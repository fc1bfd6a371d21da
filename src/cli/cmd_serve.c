/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/cli.h"

static int run(int argc, char **argv)
{
    while (cli_option(&command_serve, argc, argv, "", (struct option[]){{0}}) != -1)
        return EXIT_USAGE;
    return EXIT_FAILED;
}

const struct command command_serve = {"serve", "", "usage: tetlod serve\n", run};
