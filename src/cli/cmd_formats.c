/* SPDX-License-Identifier: BSD-3-Clause */
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "src/cli/cli.h"
#include "src/io/io.h"

static const char help[] =
    "usage: tetlod formats [--fields FILE]\n"
    "\n"
    "Lists the mesh files that this binary reads and writes: name, whether it is read and written,\n"
    "extensions, and what is known of the format. A file's content decides its format, then its\n"
    "extension.\n"
    "\n"
    "      --fields FILE  the names of the fields at points of a mesh or a stream instead, one a line\n"
    "\n"
    "example: tetlod formats\n";

static void list_formats(void)
{
    struct io_format format;
    for (size_t f = 0; io_format(f, &format); f++) {
        printf("%-9s %-4s %-5s", format.name, format.reads ? "read" : "-", format.writes ? "write" : "-");
        for (size_t e = 0; format.extensions[e]; e++)
            printf(" .%s", format.extensions[e]);
        printf("  %s\n", format.about);
    }
}

/* Of a stream only the index is read. */
static int list_stream_fields(const char *path)
{
    struct tetlod_error error = {0};
    struct tetlod_file *file;
    int fd;
    if (cli_open_stream(path, 1, &file, &fd, &error) != TETLOD_OK)
        return cli_fail(&error);
    const struct tetlod_info *info = tetlod_info(file);
    for (uint32_t f = 0; f < info->field_count; f++)
        puts(info->fields[f].name);
    tetlod_close(file);
    close(fd);
    return EXIT_DONE;
}

static int list_fields(const char *path)
{
    struct tetlod_error error = {0};
    struct tetmesh mesh;
    if (cli_is_stream(path))
        return list_stream_fields(path);
    if (io_read(&mesh, path, NULL, NULL, &error) != TETLOD_OK)
        return cli_fail(&error);
    for (uint32_t f = 0; f < mesh.field_count; f++)
        puts(mesh.fields[f].name);
    tetmesh_fini(&mesh);
    return EXIT_DONE;
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {{"fields", required_argument, NULL, 'f'}, {0}};
    const char *path = NULL;
    for (int option; (option = cli_option(&command_formats, argc, argv, "", options)) != -1;) {
        if (option == '?')
            return EXIT_USAGE;
        path = optarg;
    }
    if (!cli_operands(&command_formats, argc, 0, "nothing"))
        return EXIT_USAGE;
    if (path)
        return list_fields(path);
    list_formats();
    return EXIT_DONE;
}

const struct command command_formats = {"formats", "list the mesh files that can be read and written", help, run};
