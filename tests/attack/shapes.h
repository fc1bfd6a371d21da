/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Random adversarial meshes with fields. A seed gives the same mesh everywhere.
 *
 * Positions and values are doubles that their type (float or double) holds exactly: what a mesh file says is what the
 * oracle sees.
 */
#ifndef TETLOD_ATTACK_SHAPES_H
#define TETLOD_ATTACK_SHAPES_H

#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>

/* Seeds from here on make the odd ones, and the rare ones; and all three again, with marks, to be extracted finer in
 * boxes. */
enum { SHAPE_ODD_SEEDS = 1000000, SHAPE_RARE_SEEDS = 2000000, SHAPE_REGION_SEEDS = 3000000 };

/* The name of the field of cells that tells the mesh's parts. */
#define SHAPE_MARK "mark"

enum { SHAPE_MAX_FIELDS = 4, SHAPE_MAX_VERTICES = 8192, SHAPE_MAX_TETS = 40000 };

struct shape_field {
    char name[16];
    uint32_t components;
    bool wide; /* float64 */
    double *values;
};

struct shape {
    const char *kind;
    uint32_t vertices, tets, field_count;
    bool wide; /* positions are float64 */
    double *positions;  /* [3 * vertices] */
    uint32_t *corners;  /* [4 * tets] */
    uint32_t *body;     /* [vertices] the part of the recipe that made it: for fields that differ by body */
    uint32_t *region;   /* [tets] values of cells; NULL: none */
    uint32_t *marks;    /* [tets] others: numbers of parts, to be written as float64; NULL: none */
    struct shape_field fields[SHAPE_MAX_FIELDS];
};

struct dice {
    uint64_t state;
};

uint32_t dice_below(struct dice *dice, uint32_t bound);
double dice_unit(struct dice *dice); /* in [0, 1) */
bool dice_once_in(struct dice *dice, uint32_t times);

/* The mesh of a seed. Exits when out of memory. */
void shape_of_seed(struct shape *out, struct dice *dice, uint64_t seed);
void shape_make(struct shape *out, struct dice *dice);
/* The same, then spoiled in ways of their own (odd.c, rare.c). */
void shape_make_odd(struct shape *out, struct dice *dice);
void shape_make_rare(struct shape *out, struct dice *dice);
void shape_free(struct shape *shape);

void shape_drop_unused(struct shape *shape);                   /* vertices without a tetrahedron */
uint32_t shape_copy_vertex(struct shape *shape, uint32_t v); /* a further vertex of the same place and values */

/* Prints the beginning of the line of a finding: its seed, its mesh, what it is. */
void shape_print_finding(const struct shape *shape, uint64_t seed, const char *what, const char *format, va_list list);

/* Legacy VTK, binary. False: the file could not be written. */
bool shape_write(const struct shape *shape, const char *path);

/* Adds the Delaunay tetrahedra of the vertices from `first` on to the shape. */
void shape_delaunay(struct shape *shape, uint32_t first);

#endif
