/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/cli.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include "format/fail.h"
#include "format/common/utf8.h"
#include "src/io/io.h"
#include "src/stream/selection.h"
#include "src/util/nearest.h"
#include "src/util/number_text.h"

/* The one place that maps a status to an exit status. */
static int exit_status(enum tetlod_status status)
{
    if (status == TETLOD_OK)
        return EXIT_DONE;
    if (status >= 60)
        return EXIT_USAGE;
    return status >= 20 ? EXIT_INVALID : EXIT_FAILED;
}

void cli_print_safe(const char *text)
{
    for (size_t left = strlen(text); left > 0;) {
        size_t length = tetlodi_character_length((const uint8_t *)text, left);
        if (length)
            fwrite(text, 1, length, stderr);
        else
            fputc('?', stderr);
        text += length ? length : 1;
        left -= length ? length : 1;
    }
}

/* Left to itself glibc raises the size from which it maps memory to that of the largest array, keeps what it then frees
 * in an arena for each thread, and the peak is half as much again as what is in use. */
void cli_give_memory_back(void)
{
#ifdef __GLIBC__
    mallopt(M_MMAP_THRESHOLD, 256 << 10);
    mallopt(M_ARENA_MAX, 2);
#endif
}

const char *cli_base_name(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

int cli_fail(const struct tetlod_error *error)
{
    const char *message = error->message[0] ? error->message : tetlod_status_text(error->status);
    fprintf(stderr, "tetlod: ");
    cli_print_safe(message);
    fputc('\n', stderr);
    return exit_status(error->status);
}

bool cli_asks_help(const char *word)
{
    return strcmp(word, "help") == 0 || strcmp(word, "--help") == 0 || strcmp(word, "-h") == 0;
}

int cli_usage(const char *command, const char *format, ...)
{
    va_list arguments;
    fprintf(stderr, "tetlod %s: ", command);
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    fprintf(stderr, "; 'tetlod help %s' lists what there is\n", command);
    return EXIT_USAGE;
}

/* What other programs call an option of ours: the first that a command has is meant. */
static const char *other_name(const char *name, const struct option *options)
{
    static const char *const names[][2] = {
        {"port", "listen"},     {"p", "listen"},        {"bind", "listen"},     {"address", "listen"},
        {"jobs", "threads"},    {"j", "threads"},       {"cores", "threads"},   {"workers", "threads"},
        {"tolerance", "limit"}, {"tolerance", "max-error"}, {"tolerance", "error"}, {"timestep", "step"},
        {"array", "field"},     {"scalars", "field"},   {"variable", "field"},  {"outfile", "output"},
        {"ram", "memory"},      {"tmpdir", "scratch"},  {"verbose", "progress"}, {"silent", "quiet"},
        {"keep-order", "original-order"}, {"original-order", "keep-order"}};
    for (size_t n = 0; n < sizeof names / sizeof *names; n++)
        for (size_t o = 0; options[o].name && strcmp(names[n][0], name) == 0; o++)
            if (strcmp(options[o].name, names[n][1]) == 0)
                return options[o].name;
    return NULL;
}

/* The word that the help has behind an option, such as HOST:PORT, with the blank before it. */
static int value_word(const struct command *command, const char *option, const char **out)
{
    char before[72];
    snprintf(before, sizeof before, "--%s ", option);
    const char *at = strstr(command->help, before);
    *out = at ? at + strlen(before) - 1 : "";
    return at && (*out)[1] >= 'A' && (*out)[1] <= 'Z' ? 1 + (int)strcspn(*out + 1, " ]\n") : 0;
}

static void say_unknown(const struct command *command, const char *given, const struct option *options)
{
    char name[64];
    const char *bare = given + strspn(given, "-"), *value;
    snprintf(name, sizeof name, "%.*s", (int)strcspn(bare, "="), bare);
    const char *best = other_name(name, options);
    bool known = false, other = best != NULL;
    for (; options->name && !known; options++) {
        known = strcmp(options->name, name) == 0;
        if (!other)
            nearest_offer(name, options->name, &best);
    }
    int length = best ? value_word(command, best, &value) : 0;
    if (known)
        cli_usage(command->name, "option '--%s' takes no value", name);
    else if (best)
        cli_usage(command->name, "there is no option '%s', did you mean '--%s%.*s'?", given, best, length, value);
    else
        cli_usage(command->name, "there is no option '%s'", given);
}

int cli_option(const struct command *command, int argc, char **argv, const char *short_options,
               const struct option *long_options)
{
    static const struct option help = {"help", no_argument, NULL, 'h'};
    struct option options[64];
    char letters[64];
    size_t count = 0;
    while (long_options[count].name && count + 2 < sizeof options / sizeof *options) {
        options[count] = long_options[count];
        count++;
    }
    options[count] = help;
    options[count + 1] = (struct option){0};
    snprintf(letters, sizeof letters, ":h%s", short_options);
    opterr = 0;
    int option = getopt_long(argc, argv, letters, options, NULL);
    if (option == 'h') {
        printf("%s", command->help);
        exit(fflush(stdout) == 0 ? EXIT_DONE : EXIT_FAILED);
    }
    if (option == ':') {
        cli_usage(command->name, "option '%s' needs a value", argv[optind - 1]);
        return '?';
    }
    if (option == '?')
        say_unknown(command, argv[optind - 1], options);
    return option;
}

bool cli_parse_number(const struct command *command, const char *option, const char *text, double least, double *out)
{
    double value;
    if (!text_number(text, false, &value) || !(value >= least)) {
        cli_usage(command->name, "--%s takes a number of at least %g, not '%s'", option, least, text);
        return false;
    }
    *out = value;
    return true;
}

bool cli_parse_fraction(const struct command *command, const char *option, const char *text, double *out)
{
    double value;
    if (!text_number(text, true, &value) || value < 0) {
        cli_usage(command->name, "--%s takes a fraction of the range such as 0.01 or 1%%, not '%s'", option, text);
        return false;
    }
    *out = value;
    return true;
}

bool cli_parse_count(const struct command *command, const char *option, const char *text, uint64_t least, uint64_t most,
                     uint64_t *out)
{
    uint64_t value;
    if (!text_count(text, most > UINT32_MAX, &value) || value < least || value > most) {
        cli_usage(command->name, "--%s takes a whole number from %llu to %llu, not '%s'", option,
                  (unsigned long long)least, (unsigned long long)most, text);
        return false;
    }
    *out = value;
    return true;
}

bool cli_parse_nan_fill(const struct command *command, const char *text, struct nan_fill *out)
{
    *out = (struct nan_fill){.kind = strcmp(text, "neighbours") == 0 ? NAN_FILL_NEIGHBOURS : NAN_FILL_VALUE};
    if (out->kind == NAN_FILL_NEIGHBOURS || text_number(text, false, &out->value))
        return true;
    cli_usage(command->name, "--nan-fill takes a number, or 'neighbours' for the mean of the points around, not '%s'",
              text);
    return false;
}

bool cli_parse_measure(const struct command *command, const char *text, enum tetlod_measure *out)
{
    *out = selection_measure(text);
    if (*out != TETLOD_MEASURES)
        return true;
    cli_usage(command->name, "--measure is one of max, sampled, rms, predicted, not '%s'", text);
    return false;
}

bool cli_operands(const struct command *command, int argc, int count, const char *what)
{
    if (argc - optind == count)
        return true;
    cli_usage(command->name, "%s %s",
              argc - optind < count ? "missing operand: it takes" : "too many operands: it takes",
              what);
    return false;
}

/* Is it the extension, from the dot on, of a mesh that can be read? */
static bool is_mesh(const char *dot)
{
    struct io_format format;
    for (size_t number = 0; dot && io_format(number, &format); number++)
        for (size_t e = 0; format.reads && format.extensions && format.extensions[e]; e++)
            if (strcasecmp(format.extensions[e], dot + 1) == 0 && strcasecmp(dot + 1, "tetlod") != 0)
                return true;
    return false;
}

bool cli_is_stream(const char *path)
{
    const char *dot = strrchr(path, '.'); // what is wrong with a file of that name is said by who opens it
    return (dot && strcmp(dot, ".tetlod") == 0) || io_is_stream(path);
}

enum tetlod_status cli_open_stream(const char *path, unsigned threads, struct tetlod_file **out, int *out_fd,
                                   struct tetlod_error *error)
{
    const struct tetlod_options options = {.struct_size = sizeof options, .threads = threads};
    struct stat about;
    struct tetlod_error inner = {0};
    *out = NULL;
    *out_fd = open(path, O_RDONLY | O_CLOEXEC);
    if (*out_fd < 0)
        return tetlodi_fail(error, TETLOD_ERR_IO, "%s: cannot open: %s", path, strerror(errno));
    enum tetlod_status status;
    if (fstat(*out_fd, &about) == 0 && !S_ISREG(about.st_mode))
        status = tetlodi_fail(&inner, TETLOD_ERR_IO, "is not a regular file");
    else
        status = tetlod_open_fd(out, *out_fd, &options, &inner);
    if (status == TETLOD_OK)
        return TETLOD_OK;
    close(*out_fd);
    *out_fd = -1;
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path, *dot = strrchr(name, '.');
    if (status == TETLOD_ERR_NOT_TETLOD && is_mesh(dot))
        return tetlodi_fail(error, status,
                            "%s: is a mesh, not a stream; make one of it: tetlod build %.400s -o %.*s.tetlod", path,
                            path, (int)(dot - name), name);
    return tetlodi_fail(error, status, "%s: %s", path, inner.message);
}
