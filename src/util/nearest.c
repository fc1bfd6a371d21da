/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/util/nearest.h"

#include <ctype.h>
#include <stddef.h>
#include <string.h>

enum { MAX_LETTERS = 63, LETTERS_A_MISTAKE = 3 };

/* The distance of Levenshtein, row by row. */
unsigned nearest_distance(const char *a, const char *b)
{
    unsigned row[MAX_LETTERS + 1];
    size_t lengths[2] = {strlen(a), strlen(b)};
    if (lengths[0] > MAX_LETTERS || lengths[1] > MAX_LETTERS)
        return MAX_LETTERS;
    for (unsigned j = 0; j <= lengths[1]; j++)
        row[j] = j;
    for (unsigned i = 0; i < lengths[0]; i++) {
        unsigned diagonal = row[0];
        row[0] = i + 1;
        for (unsigned j = 0; j < lengths[1]; j++) {
            unsigned change = diagonal + (tolower((unsigned char)a[i]) != tolower((unsigned char)b[j]));
            diagonal = row[j + 1];
            row[j + 1] = (diagonal < row[j] ? diagonal : row[j]) + 1;
            row[j + 1] = change < row[j + 1] ? change : row[j + 1];
        }
    }
    return row[lengths[1]];
}

void nearest_offer(const char *text, const char *name, const char **io_best)
{
    unsigned distance = nearest_distance(text, name);
    if (distance <= (strlen(text) + 1) / LETTERS_A_MISTAKE && distance < strlen(name) &&
        (!*io_best || distance < nearest_distance(text, *io_best)))
        *io_best = name;
}
