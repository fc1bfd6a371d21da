/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The command line. A command is a function in cmd_<name>.c and a line in main.c's table; its help is the text that it
 * declares beside it. Results go to standard output, messages and progress to standard error.
 */
#ifndef TETLOD_CLI_H
#define TETLOD_CLI_H

#include <getopt.h>
#include <stdbool.h>
#include <stdio.h>

#include "format/tetlod.h"
#include "src/mesh/nan_fill.h"

enum exit_status {
    EXIT_DONE = 0,
    EXIT_FAILED = 1,
    EXIT_USAGE = 2,
    EXIT_INVALID = 3,
    EXIT_QUALITY = 4,   /* verify: the stream is valid, but levels are worse meshes than its original */
    EXIT_NO = 4,        /* ask: the predicate does not hold; diff: beyond the limit */
    EXIT_UNDECIDED = 5  /* ask, features, diff: the finest level does not decide it */
};

struct command {
    const char *name, *summary, *help;
    int (*run)(int argc, char **argv); /* argv[0] is the command's name */
};

extern const struct command command_build, command_info, command_extract, command_verify, command_compare,
    command_convert, command_sample, command_serve, command_explode, command_plot,
    command_formats, command_ask, command_diff, command_features, command_sample_points, command_plan, command_run,
    command_merge;

/* What `tetlod help words` prints. */
extern const char cli_words[];

/* Is a program's first argument a word that asks for its help? */
bool cli_asks_help(const char *word);

/* Prints the error as one line and gives the exit status for it. */
int cli_fail(const struct tetlod_error *error);

/* What is freed goes back to the system at once from here on. */
void cli_give_memory_back(void);

/* What is behind the last slash of a path. */
const char *cli_base_name(const char *path);

/* Prints text that may come from a file, without its control characters and what is not UTF-8, on standard error. */
void cli_print_safe(const char *text);

/* Prints "tetlod COMMAND: message; try tetlod help COMMAND" and gives EXIT_USAGE. */
int cli_usage(const char *command, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* getopt_long over a command's options, with our messages: the next option's `val`, -1 at the end, '?' after a message.
 * Every command also knows --help, which prints the help and exits. */
int cli_option(const struct command *command, int argc, char **argv, const char *short_options,
               const struct option *long_options);

/* Option values. False after a usage message that names the option, the value and what would do. */
/* 0.01, 1% */
bool cli_parse_fraction(const struct command *command, const char *option, const char *text, double *out);
bool cli_parse_number(const struct command *command, const char *option, const char *text, double least, double *out);
bool cli_parse_count(const struct command *command, const char *option, const char *text, uint64_t least, uint64_t most,
                     uint64_t *out); /* K, M, G suffixes (powers of 1024) where most exceeds 2^32 */
bool cli_parse_nan_fill(const struct command *command, const char *text, struct nan_fill *out); /* 0.5, neighbours */
bool cli_parse_measure(const struct command *command, const char *text, enum tetlod_measure *out);

/* Exactly `count` operands after the options, or a usage message that names `what` is wanted. */
bool cli_operands(const struct command *command, int argc, int count, const char *what);

/* Whether a command may write `output`: EXIT_USAGE, after a message, if it is one of the `count` files `inputs` (NULL
 * ones are skipped), or if its extension names a format other than `extension` (NULL: any will do). */
int cli_check_output_name(const struct command *command, const char *output, const char *extension,
                          const char *const *inputs, size_t count);

/* The same, and EXIT_FAILED, after a message, if no file can be written there. */
int cli_check_output(const struct command *command, const char *output, const char *extension,
                     const char *const *inputs, size_t count);

/* Is the file a stream, bare or in a VTKHDF file, where a command takes meshes too? */
bool cli_is_stream(const char *path);

/* The finest level whose bytes are all in a stream file, of which a part may be missing; TETLOD_NONE: not even level
 * 0. */
uint32_t cli_finest_here(const struct tetlod_info *info, int fd);

/* Whether all of the stream is there. */
bool cli_is_whole(const struct tetlod_info *info, int fd);

/* Whether all bytes of a section, and of the values of a cell field, are in such a file. */
bool cli_section_here(const struct tetlod_info *info, const struct tetlod_section *section, int fd);
bool cli_cells_here(const struct tetlod_info *info, int fd, uint32_t cell_field);

/* Prints the table of levels: about ten of them, or all. */
void cli_print_levels(const struct tetlod_info *info, bool all);

/* Prints a line for each field: its error at a level, certified or measured, in percent and in its units. */
void cli_print_promises(FILE *out, const struct tetlod_info *info, uint32_t level);

/* Warns of the worst field, but ids, that is not controlled, if it is more than 10 % off at a level. */
void cli_warn_uncontrolled(const char *command, const struct tetlod_info *info, uint32_t level);

/* Opens a stream file that cursors decode with so many threads; messages start with the path. *out_fd is to be closed
 * after the file. */
TETLOD_CHECKED enum tetlod_status cli_open_stream(const char *path, unsigned threads, struct tetlod_file **out,
                                                  int *out_fd,
                                                  struct tetlod_error *error);

#endif
