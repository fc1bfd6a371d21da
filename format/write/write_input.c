/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/write/write_input.h"

#include <string.h>

#include "format/coding/index.h"
#include "format/common/allowance.h"
#include "format/common/utf8.h"

const char *tetlodi_metadata_wrong(const char *metadata)
{
    return strlen(metadata) > MAX_METADATA ? "it is larger than 1 MiB" : NULL;
}

const char *tetlodi_field_count_wrong(uint32_t fields, uint32_t cell_fields)
{
    return fields > MAX_FIELDS || cell_fields > MAX_FIELDS ? "it has more than 256 fields; leave some out" : NULL;
}

const char *tetlodi_field_wrong(const char *name, uint32_t components)
{
    if (components < 1 || components > MAX_COMPONENTS)
        return "a field has no or too many components (64 are allowed)";
    return !*name || strlen(name) > MAX_NAME || !tetlodi_plain_text(name, strlen(name))
               ? "a field's name is empty, longer than 255 bytes, or not plain UTF-8" : NULL;
}
