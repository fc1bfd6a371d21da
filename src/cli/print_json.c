/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/print_json.h"

#include <stdio.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/cli/cli.h"
#include "src/report/info_json.h"

/* Prints JSON with DEL and U+0080 to U+009F, which JSON may hold in strings and terminals obey, as escapes. */
static void print_escaped(const char *text)
{
    for (; *text; text++) {
        unsigned char first = (unsigned char)*text, second = (unsigned char)text[1];
        if (first == 0x7f)
            fputs("\\u007f", stdout);
        else if (first == 0xc2 && second >= 0x80 && second < 0xa0)
            printf("\\u%04x", (unsigned)(unsigned char)*++text);
        else
            putchar(*text);
    }
    putchar('\n');
}

int cli_print_json(json_t *object)
{
    struct tetlod_error error = {0};
    char *text = object ? json_dumps(object, INFO_JSON_FLAGS) : NULL;
    json_decref(object);
    if (!text) {
        tetlodi_fail_nomem(&error, "the JSON", 4096);
        return cli_fail(&error);
    }
    print_escaped(text);
    free(text);
    return EXIT_DONE;
}
