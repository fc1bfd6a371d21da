/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/print_json.h"

#include <stdio.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/cli/cli.h"
#include "src/report/info_json.h"

int cli_print_json(json_t *object)
{
    struct tetlod_error error = {0};
    char *text = object ? json_dumps(object, INFO_JSON_FLAGS) : NULL;
    json_decref(object);
    if (!text) {
        tetlodi_fail_nomem(&error, "the JSON", 4096);
        return cli_fail(&error);
    }
    puts(text);
    free(text);
    return EXIT_DONE;
}
