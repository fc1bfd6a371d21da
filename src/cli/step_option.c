/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/step_option.h"

#include "src/util/number_text.h"

bool step_option_take(struct step_option *out, const struct command *command, bool by_time, const char *value)
{
    bool again = out->given;
    out->given = true;
    out->selection.by_time = by_time;
    if (again) {
        cli_usage(command->name, "--time or --step: one step can be chosen");
        return false;
    }
    if (by_time && !text_number(value, false, &out->selection.time)) {
        cli_usage(command->name, "--time takes a number, not '%s'", value);
        return false;
    }
    return by_time || cli_parse_count(command, "step", value, 0, UINT32_MAX, &out->selection.step);
}
