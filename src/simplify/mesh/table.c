/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/mesh/table.h"

#include <stdlib.h>
#include <string.h>

#include "src/util/array.h"

bool table_clear(struct table *table, size_t most)
{
    table->size = 16;
    while (table->size < most + most / 2 + 1)
        table->size *= 2;
    if (table->size > table->capacity) {
        free(table->keys);
        free(table->values);
        table->keys = array_new(table->size, sizeof *table->keys);
        table->values = array_new(table->size, sizeof *table->values);
        table->capacity = table->keys && table->values ? table->size : 0;
        if (!table->capacity)
            return false;
    }
    memset(table->keys, 0xff, table->size * sizeof *table->keys);
    return true;
}

void table_fini(struct table *table)
{
    free(table->keys);
    free(table->values);
    *table = (struct table){0};
}
