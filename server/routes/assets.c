/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/routes/assets.h"

#include <string.h>

const struct embedded_file *assets_find(const char *path)
{
    for (size_t i = 0; i < embedded_file_count; i++)
        if (strcmp(embedded_files[i].path, path) == 0)
            return &embedded_files[i];
    return NULL;
}
