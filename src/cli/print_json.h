/* SPDX-License-Identifier: BSD-3-Clause */
/* The answer of a command with --json. */
#ifndef TETLOD_PRINT_JSON_H
#define TETLOD_PRINT_JSON_H

#include <jansson.h>

/* Prints the object as one line, and takes it over. NULL means that memory is out. Gives the exit status, after a
 * message if it is not EXIT_DONE. */
int cli_print_json(json_t *object);

#endif
