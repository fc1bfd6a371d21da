/* SPDX-License-Identifier: BSD-3-Clause */
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "src/cli/cli.h"
#include "src/cli/plan.h"
#include "src/many/folder_share.h"

static const char help[] =
    "usage: tetlod merge FOLDER -o OUT.tetlod [--threads N] [--quiet]\n"
    "\n"
    "Writes the stream of a plan (tetlod plan) from what its tasks have done (tetlod run). What they have\n"
    "left it does itself.\n"
    "\n"
    "  -o, --output OUT   the stream to write; OUT.vtkhdf: inside a VTKHDF file\n"
    "      --threads N    threads (default: as many as there are cores)\n"
    "      --quiet        no notes and no table of levels\n"
    "\n"
    "example: tetlod merge work -o big.tetlod\n";

enum { THREADS = 256, QUIET };

static int merge(const char *folder, const char *output, const char *threads, bool quiet)
{
    char path[2 * 4096], here[4096];
    struct tetlod_error error = {0};
    struct plan plan;
    struct work_share share = {0};
    int result = EXIT_DONE;
    bool relative = output[0] != '/' && getcwd(here, sizeof here); // the plan's folder is another one
    snprintf(path, sizeof path, "%s%s%s", relative ? here : "", relative ? "/" : "", output);
    if (plan_open(&plan, folder, &error) != TETLOD_OK ||
        folder_share_new(&share, plan.folder, 1, true, &error) != TETLOD_OK) {
        result = cli_fail(&error);
    } else {
        plan_add_option(&plan, "-o", path);
        plan_add_option(&plan, "--threads", threads);
        if (quiet)
            plan_add(&plan, "--quiet");
        optind = 0;
        result = build_together(plan.count, plan.arguments, &share);
    }
    folder_share_free(&share);
    plan_close(&plan);
    return result;
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {{"output", required_argument, NULL, 'o'},
                                            {"threads", required_argument, NULL, THREADS},
                                            {"quiet", no_argument, NULL, QUIET},
                                            {0}};
    const char *output = NULL, *threads = NULL;
    bool quiet = false;
    for (int option; (option = cli_option(&command_merge, argc, argv, "o:", options)) != -1;) {
        if (option != 'o' && option != THREADS && option != QUIET)
            return EXIT_USAGE;
        output = option == 'o' ? optarg : output;
        threads = option == THREADS ? optarg : threads;
        quiet |= option == QUIET;
    }
    if (!cli_operands(&command_merge, argc, 1, "the FOLDER of a plan"))
        return EXIT_USAGE;
    if (!output)
        return cli_usage("merge", "it needs -o OUT.tetlod");
    return merge(argv[optind], output, threads, quiet);
}

const struct command command_merge = {"merge", "write the stream that the tasks of a plan have made", help, run};
