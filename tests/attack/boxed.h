/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Meshes that are finer in boxes against the oracle: in the transition between the two levels nothing is off by more
 * than is said, and local bounds hold everywhere. The input has a field of cells, SHAPE_MARK, that tells its parts; the
 * mesh has it, too.
 */
#ifndef TETLOD_ATTACK_BOXED_H
#define TETLOD_ATTACK_BOXED_H

#include "format/tetlod.h"
#include "tests/attack/oracle.h"

/* What a region is held against. */
struct region_case {
    const struct tetlod_file *file;
    /* in the stream's numbering; value i is component component_of[i] of field field_of[i] */
    const struct oracle_mesh *original;
    const uint32_t *field_of, *component_of;
    double radius;    /* the domain error of the coarse level, a length */
    bool definite;    /* nothing overlaps, so that what is said of the transition is no more than the truth */
    const char *said; /* what the program said of it */
};

/* Reads legacy VTK as the program writes it. False: text says what is wrong, after its kind. */
bool region_holds(const struct region_case *c, const char *path, char *text, size_t size);

#endif
