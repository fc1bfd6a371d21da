/* SPDX-License-Identifier: BSD-3-Clause */
#include <getopt.h>

#include "src/cli/cli.h"
#include "src/cli/plan.h"

static const char help[] =
    "usage: tetlod plan FOLDER INPUT... [OPTIONS of tetlod build]\n"
    "\n"
    "Several tasks of a job array build one stream: tetlod plan writes down in FOLDER what is built, each\n"
    "task does its share with tetlod run FOLDER, and tetlod merge FOLDER -o OUT.tetlod writes the stream\n"
    "that tetlod build --paged INPUT would write, byte for byte. All of them see FOLDER and INPUT under\n"
    "the same paths. The first task, and tetlod merge, have the mesh; the others get the cells that are\n"
    "contracted, the samples that errors are measured at, and the pages. A task that dies is run again,\n"
    "or not at all: the others do what it has left. FOLDER is no longer needed when the stream is there.\n"
    "\n"
    "Options are those of tetlod build but -o, and come behind FOLDER. server/deploy/many-machines.md\n"
    "has recipes for Slurm, GNU parallel, Kubernetes and others.\n"
    "\n"
    "example: tetlod plan work big.vtu --field p\n"
    "         tetlod run work & tetlod run work & wait\n"
    "         tetlod merge work -o big.tetlod\n";

static int run(int argc, char **argv)
{
    static const struct option none[] = {{0}};
    struct build_request request;
    struct tetlod_error error = {0};
    if (cli_option(&command_plan, argc < 2 ? argc : 2, argv, "", none) != -1)
        return EXIT_USAGE;
    if (argc < 3)
        return cli_usage("plan", "missing operands: it takes the FOLDER, then the INPUT mesh");
    const char *folder = argv[1];
    argv[1] = argv[0];
    optind = 0; // the scan begins anew
    int result = build_request_parse(&request, argc - 1, argv + 1);
    if (result != EXIT_DONE)
        return result;
    if (request.output != request.own_output)
        return cli_usage("plan", "the output is named when it is written: tetlod merge %s -o %s", folder,
                         request.output);
    const char *wrong = build_against_pages(&request.build);
    if (wrong)
        return cli_usage("plan", "cannot be built by several programs: %s", wrong);
    return plan_write(folder, &request, argc - 1, argv + 1, &error) == TETLOD_OK ? EXIT_DONE : cli_fail(&error);
}

const struct command command_plan = {"plan", "write down what several tasks are to build together", help, run};
