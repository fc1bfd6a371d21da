/* SPDX-License-Identifier: BSD-3-Clause */
/* The words that EnSight 6 and EnSight Gold share: types of elements and kinds of variables. */
#ifndef TETLOD_ENSIGHT_WORDS_H
#define TETLOD_ENSIGHT_WORDS_H

#include <string.h>

#include "src/io/readers/ensight_case.h"

enum { ENSIGHT_NSIDED = 1, ENSIGHT_NFACED = 2 };

struct ensight_element {
    const char *name;
    uint8_t type, corners; /* corners: of a cell, or NSIDED, NFACED with `varies` */
    bool varies;           /* of EnSight Gold alone */
};

/* The element whose name is the first word of the line, or NULL; ghosts have g_ in front. */
const struct ensight_element *ensight_find_element(const char *line, bool *is_ghost);

struct ensight_variable {
    const char *name;
    uint32_t components;
    bool cell;
};

/* False: this kind of variable is not read. */
bool ensight_find_variable(const struct ensight_entry *entry, struct ensight_variable *out);

/* The place of a component: EnSight has those of a symmetric tensor as xx, yy, zz, xy, xz, yz; VTK, and tetlod, the
 * last two the other way. */
uint32_t ensight_place(uint32_t component, uint32_t components);

static inline bool ensight_starts(const char *line, const char *word)
{
    return strncmp(line, word, strlen(word)) == 0;
}

static inline bool ensight_gives_ids(const char *line)
{
    return strstr(line, "given") || strstr(line, "ignore");
}

/* Adds the blocks of a case of EnSight 6: one of all unstructured parts, which share their nodes, and one for each
 * structured part. */
TETLOD_CHECKED enum tetlod_status ensight6_read(struct blocks *out, const struct ensight_case *ensight,
                                                const struct io_input *input, struct io_report *report,
                                                struct tetlod_error *error);

#endif
