/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Which bodies of two meshes are each other's. Where two bodies touch along a curved face, two meshes of them overlap a
 * little crosswise: that is not to be compared. So a body is compared with those that share more than a tenth of the
 * smaller one's volume. Where bodies of one mesh overlap each other, with the one that is most alike.
 */
#ifndef TETLOD_BODIES_H
#define TETLOD_BODIES_H

#include <stdbool.h>

#include "format/tetlod.h"

/* Volumes are counted in whole units, so that a sum does not depend on its order. */
struct body_pair {
    uint32_t bodies[2];
    uint64_t volume;
    bool kept;
};

/* Sorted once they are judged. Begins zeroed. */
struct body_pairs {
    struct body_pair *pairs; /* owned */
    size_t count, capacity;
};

void body_pairs_fini(struct body_pairs *pairs);

/* Adds to the volume that two bodies share. False if memory is out. */
bool body_pairs_add(struct body_pairs *pairs, uint32_t a, uint32_t b, uint64_t volume);

/* Says which are kept. volumes[m][body]: of each body. */
void body_pairs_judge(struct body_pairs *pairs, const uint64_t *const volumes[2]);

/* Is the pair kept? Of pairs that were judged. */
bool body_pairs_kept(const struct body_pairs *pairs, uint32_t a, uint32_t b);

#endif
