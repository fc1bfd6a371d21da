/* SPDX-License-Identifier: BSD-3-Clause */
/* The options of `tetlod serve`: those of its file, which is read again on request, and those of the command line. */
#ifndef TETLOD_SERVE_REQUEST_H
#define TETLOD_SERVE_REQUEST_H

#include <stdbool.h>
#include <stddef.h>

#include "server/server.h"

enum { MAX_ADDRESSES = 15, MAX_LISTED = 16, MAX_GIVEN = 256 };

/* An option as it was given: its letter and its value, NULL where it takes none. */
struct given {
    int option;
    const char *value;
};

struct settings {
    struct server_options server;
    const char *addresses[MAX_ADDRESSES], *origins[MAX_LISTED], *cors[MAX_LISTED], *hosts[MAX_LISTED],
        *proxies[MAX_LISTED];
    bool access_log, quiet;
    struct given line[MAX_GIVEN], file[MAX_GIVEN]; /* of the command line; of the file */
    size_t line_count, file_count;
    const char *path; /* of the file, or NULL */
    char *text;       /* its content, cut into pieces */
};

/* Reads the command line and the file that it names; `optind` is at the operands then. False: it was said what is
 * wrong. */
bool settings_read(struct settings *out, int argc, char **argv);

/* The same command line with the file as it is now. Tells by `changed` an option other than --token, --cors and --host
 * that differs, or NULL. On failure nothing is left to free. */
bool settings_read_again(struct settings *out, const struct settings *before, const char **changed);
void settings_fini(struct settings *settings);

bool settings_add_address(struct settings *settings, const char *address);

#endif
