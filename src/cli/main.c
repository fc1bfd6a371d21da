/* SPDX-License-Identifier: BSD-3-Clause */
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "src/cli/cli.h"
#include "src/util/file.h"
#include "src/util/nearest.h"

static const struct command *const commands[] = {
    &command_build,   &command_info,    &command_extract, &command_verify,
    &command_compare, &command_convert, &command_sample,
#ifndef TETLOD_NO_SERVER
    &command_serve,   &command_explode,
#endif
    &command_ask,     &command_diff,    &command_features, &command_plot,
    &command_sample_points, &command_formats, &command_plan, &command_run, &command_merge,
};

enum { COMMANDS = sizeof commands / sizeof *commands };

static const struct command *find_command(const char *name)
{
    for (int i = 0; i < COMMANDS; i++)
        if (strcmp(commands[i]->name, name) == 0)
            return commands[i];
    return NULL;
}

static void print_commands(FILE *out)
{
    fprintf(out, "tetlod " TETLOD_VERSION_STRING ": levels of detail for tetrahedral volumes\n\n"
                 "usage: tetlod COMMAND [OPTIONS] ...\n\n");
    for (int i = 0; i < COMMANDS; i++)
        fprintf(out, "  %-13s %s\n", commands[i]->name, commands[i]->summary);
    fprintf(out,
            "\n'tetlod help COMMAND' explains one, 'tetlod help words' the words. Exit status: 0 done, 1 failed,\n"
            "2 usage, 3 invalid input, 4 a valid stream whose levels are worse meshes than its original (verify);\n"
            "4 no (ask, diff), 5 undecided (ask, diff, features). 'tetlod --version' says which one it is.\n");
}

static int unknown_command(const char *name)
{
    const char *best = NULL;
    for (int i = 0; i < COMMANDS; i++)
        nearest_offer(name, commands[i]->name, &best);
    nearest_offer(name, "--version", &best);
    fprintf(stderr, "tetlod: there is no command '");
    cli_print_safe(name);
    fprintf(stderr, "'%s%s%s; 'tetlod help' lists them\n", best ? ", did you mean '" : "", best ? best : "",
            best ? "'?" : "");
    return EXIT_USAGE;
}

static int help(int argc, char **argv)
{
    if (argc < 2) {
        print_commands(stdout);
        return EXIT_DONE;
    }
    const struct command *command = find_command(argv[1]);
    bool words = strcmp(argv[1], "words") == 0;
    if (!command && !words)
        return unknown_command(argv[1]);
    printf("%s", words ? cli_words : command->help);
    return EXIT_DONE;
}

static int run(int argc, char **argv)
{
    if (argc < 2) {
        print_commands(stderr);
        return EXIT_USAGE;
    }
    if (cli_asks_help(argv[1]))
        return help(argc - 1, argv + 1);
    if (strcmp(argv[1], "--version") == 0) {
        printf("tetlod " TETLOD_VERSION_STRING "\n");
        return EXIT_DONE;
    }
    cli_give_memory_back();
    const struct command *command = find_command(argv[1]);
    return command ? command->run(argc - 1, argv + 1) : unknown_command(argv[1]);
}


static void say(const char *text)
{
    ssize_t written = write(STDERR_FILENO, text, strlen(text));
    (void)written;
}

/* Input files are mapped: where one becomes shorter meanwhile, there is nothing to read. */
static void on_lost_bytes(int number, siginfo_t *info, void *context)
{
    char path[4096];
    (void)number;
    (void)context;
    say("tetlod: ");
    say(file_mapped_at(info->si_addr, path, sizeof path) ? path : "an input file");
    say(": became shorter while it was read; wait until it is written, then try again\n");
    _exit(EXIT_FAILED);
}

int main(int argc, char **argv)
{
    sigaction(SIGBUS, &(struct sigaction){.sa_sigaction = on_lost_bytes, .sa_flags = SA_SIGINFO}, NULL);
    int result = run(argc, argv);
    if ((fflush(stdout) != 0 || ferror(stdout)) && result == EXIT_DONE) {
        fprintf(stderr, "tetlod: cannot write to standard output\n");
        return EXIT_FAILED;
    }
    return result;
}
