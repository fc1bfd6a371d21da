/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/cli.h"
#include "src/cli/explode.h"

static const char help[] =
    "usage: tetlod explode PATH... -o FOLDER [--meshes] [--viewer]\n"
    "\n"
    "Lays streams out as files at the paths of the HTTP interface, for a server that only sends files:\n"
    "FOLDER/v1/meshes/... with the descriptions (index.json), the whole stream, the base mesh, and the\n"
    "records from each level to the next. server/deploy/nginx-static.conf serves such a folder.\n"
    "\n"
    "  -o, --output FOLDER  the folder; created if it is not there\n"
    "      --meshes         also every level as VTU\n"
    "      --viewer         also the page: FOLDER/index.html shows the streams on any host of files,\n"
    "                       under any path\n"
    "\n"
    "example: tetlod explode streams/ -o /srv/www --viewer\n";

static int run(int argc, char **argv)
{
    static const struct option options[] = {
        {"output", required_argument, NULL, 'o'}, {"meshes", no_argument, NULL, 'm'}, {"viewer", no_argument, NULL,
                                                                                       'v'}, {0}};
    struct explode_options request = {0};
    struct tetlod_error error = {0};
    int option;
    while ((option = cli_option(&command_explode, argc, argv, "o:", options)) != -1) {
        if (option == 'o')
            request.folder = optarg;
        else if (option == 'm')
            request.meshes = 1;
        else if (option == 'v')
            request.viewer = 1;
        else
            return EXIT_USAGE;
    }
    if (!request.folder)
        return cli_usage("explode", "it needs -o FOLDER");
    if (optind == argc)
        return cli_usage("explode", "missing operand: it takes streams, or folders of *.tetlod");
    request.paths = (const char *const *)(argv + optind);
    request.path_count = (size_t)(argc - optind);
    return explode(&request, &error) == TETLOD_OK ? EXIT_DONE : cli_fail(&error);
}

const struct command command_explode = {"explode", "lay streams out as files for a plain web server", help, run};
