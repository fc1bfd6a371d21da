/* SPDX-License-Identifier: BSD-3-Clause */
/* What a command may write to. */
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "src/cli/cli.h"
#include "src/io/io.h"
#include "src/util/file.h"

/* What an extension stands for; NULL: nothing that is known. */
static const char *meaning(const char *extension)
{
    static const char *const others[] = {"svg", "png", "jpg", "jpeg", "gif", "pdf", "html", "json", "csv", "txt",
                                         "npz"};
    struct io_format format;
    for (size_t i = 0; io_format(i, &format); i++)
        for (size_t e = 0; format.extensions[e]; e++)
            if (strcasecmp(extension, format.extensions[e]) == 0)
                return format.name;
    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        if (strcasecmp(extension, others[i]) == 0)
            return others[i];
    return NULL;
}

int cli_check_output_name(const struct command *command, const char *output, const char *extension,
                          const char *const *inputs, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (inputs[i] && file_same(output, inputs[i]))
            return cli_usage(command->name, "-o %s is the input %s: give the output another name", output, inputs[i]);
    const char *slash = strrchr(output, '/'), *dot = strrchr(slash ? slash : output, '.');
    const char *other = dot && extension && strcasecmp(dot + 1, extension) != 0 ? meaning(dot + 1) : NULL;
    if (other)
        return cli_usage(command->name, "-o %s says %s, and this command writes %s: name it %.*s.%s", output, other,
                         extension, (int)(dot - output), output, extension);
    return EXIT_DONE;
}

int cli_check_output(const struct command *command, const char *output, const char *extension,
                     const char *const *inputs, size_t count)
{
    struct tetlod_error error = {0};
    int result = cli_check_output_name(command, output, extension, inputs, count);
    return result == EXIT_DONE && file_output_check(output, &error) != TETLOD_OK ? cli_fail(&error) : result;
}
