/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The simplicial complex while it is contracted, with the log of its contractions.
 *
 * Vertices live in slots: a contraction of a simplex puts its result into the slot of the simplex's first vertex and frees
 * the others. Tetrahedra keep their number, until all are renumbered (complex_renumber). A slot's current node (original vertices are nodes 0 .. n-1, contraction
 * c makes node n + c) names it in the log (src/log/contraction_log.h).
 *
 * Functions that check change nothing; complex_contract asserts what they promised.
 */
#ifndef TETLOD_COMPLEX_H
#define TETLOD_COMPLEX_H

#include <stdbool.h>

#include "src/log/contraction_log.h"
#include "src/simplify/renumber.h"
#include "src/simplify/table.h"

enum {
    VERTEX_ALIVE = 1,
    VERTEX_BOUNDARY = 2,
    VERTEX_FROZEN = 4, /* corner of a degenerate, inverted or folded tetrahedron: contracted only with a vertex at the same point */
    VERTEX_SINGULAR = 8, /* not a manifold point: never contracted */
    VERTEX_FIXED = 16,   /* where regions meet: stays where it is, others may be contracted into it */
};

struct complex {
    uint32_t vertex_count, tet_count; /* of the original */
    uint32_t slot_count, tets_stored; /* that there are numbers for: at first the same, fewer after complex_renumber */
    uint32_t vertices_alive, tets_alive;
    double *positions;    /* [3 * slot], exactly representable in position_type */
    uint32_t *corners;    /* [4 * tet] slots; the first is TETLOD_NONE when the tetrahedron is gone */
    uint32_t *neighbours; /* [4 * tet] as adjacency_build makes them */
    uint8_t *flags;       /* [slot] VERTEX_... */
    uint32_t *changed;    /* [slot] contractions done when its star last changed, or it died */
    uint32_t *tet_changed; /* [tet] contractions done when it was last removed or re-attached */
    double *least_volume6; /* [tet] below it, one of its size is degenerate */
    uint32_t *born;       /* [slot] contractions done when it last became a contraction's result */
    enum tetlod_type position_type;
    struct grid position_grid[3];
    int orientation;      /* +1, or -1 where the input lists its tetrahedra the other way round */

    uint32_t *pool; /* stars: slot v's tetrahedra are pool[star_begin[v]] .. + star_count[v], in no order */
    size_t pool_size, pool_capacity, *star_begin;
    uint32_t *star_count, *star_capacity;

    uint32_t *node;             /* [slot] its current node */
    struct contraction_log log; /* of its contractions */

    uint32_t *local, *epoch_of, epoch; /* scratch: slot -> number in the star at hand */
};

/* Copies what it needs of the mesh. ERR_LIMIT, ERR_NOMEM. O(n). */
TETLOD_CHECKED enum tetlod_status complex_init(struct complex *complex, const struct tetmesh *mesh,
                                               struct tetlod_error *error);
void complex_fini(struct complex *complex);

/* Bytes that a complex of that size takes, about. */
uint64_t complex_bytes(uint32_t vertices, uint32_t tets);

static inline bool complex_alive(const struct complex *complex, uint32_t vertex)
{
    return complex->flags[vertex] & VERTEX_ALIVE;
}

/*
 * The star of a simplex: all tetrahedra that touch one of its vertices. A tetrahedron that has two of them or more is
 * removed by the contraction; one that has a single one is re-attached, with that corner moved.
 */
struct star {
    uint32_t simplex[4];
    uint32_t simplex_count;
    uint32_t tet_count, removed_count;
    bool at_one_point; /* the simplex's vertices are at one point: contracting it moves nothing */
    size_t capacity;
    uint32_t *tets;
    uint8_t *moving;  /* the corner that moves, or STAR_REMOVED */
    size_t local_tet_capacity, mark_capacity;
    uint32_t *local_tets; /* scratch of the link condition, as is the rest */
    uint8_t *marks;
    struct table filed;
};

enum { STAR_REMOVED = 4 };

void star_fini(struct star *star);

/* Gathers the star of a simplex of two to four distinct living vertices. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status star_gather(struct star *star, const struct complex *complex, const uint32_t *simplex,
                                              uint32_t simplex_count, struct tetlod_error *error);

/* The same of the listed tetrahedra alone: those of them that are in the star. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status star_gather_some(struct star *star, const struct complex *complex,
                                                   const uint32_t *simplex, uint32_t simplex_count, const uint32_t *tets,
                                                   uint32_t tet_count, struct tetlod_error *error);

/* Would every re-attached tetrahedron be well oriented and not degenerate with the moving corner at p? Exact up to the
 * relative tolerance TET_DEGENERATE, which is far above the rounding of the test. */
bool star_fits(const struct star *star, const struct complex *complex, const double p[3]);

/* The link condition: the result is a simplicial complex of the same topology, boundary included. Dey, Edelsbrunner, Guha
 * and Nekhayev 1999, with the boundary coned to a point; a face or a tetrahedron as a sequence of edges. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status star_link_condition(struct star *star, struct complex *complex, bool *out_holds,
                                                      struct tetlod_error *error);

/* Contracts the gathered simplex to p, which the checks have accepted. Afterwards simplex[0] is the result's slot.
 * ERR_NOMEM leaves the complex unusable but freeable. */
TETLOD_CHECKED enum tetlod_status complex_contract(struct complex *complex, const struct star *star, const double p[3],
                                                   struct tetlod_error *error);

/* The numbers that living tetrahedra and slots would have without gaps. False: no memory. */
bool complex_find_numbers(const struct complex *complex, struct renumbering *tets, struct renumbering *slots);

/* Takes over these numbers. False: no memory, or stars of more than 2^32 numbers: nothing has changed. */
bool complex_renumber(struct complex *complex, const struct renumbering *tets, const struct renumbering *slots);

/* Is a frozen vertex free now, for its last degenerate, inverted or folded tetrahedron is gone? Then it is no longer frozen. */
bool complex_unfreeze(struct complex *complex, uint32_t v);

/* p rounded to the mesh's position type. */
void complex_round_position(const struct complex *complex, double p[3]);

/* The living vertices that share a tetrahedron with v, other than v, appended to *out (capacity grown). ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status complex_link_vertices(struct complex *complex, uint32_t v, uint32_t **out,
                                                        size_t *out_capacity, size_t *out_count,
                                                        struct tetlod_error *error);

/* A tetrahedron's barycentric coordinates as affine functions: lambda_j(p) = gradient[j-1] . (p - origin), j = 1..3. */
struct tet_affine {
    double origin[3], gradient[3][3];
    double volume6; /* positive where the orientation is the mesh's */
    double size2;   /* longest edge, squared */
};

/* Not for degenerate tetrahedra: their vertices are frozen, so that no star that moves has one. */
void complex_affine(const struct complex *complex, uint32_t tet, struct tet_affine *out);

/* Is face f of the tetrahedron on the boundary? */
static inline bool complex_boundary_face(const struct complex *complex, uint32_t tet, unsigned face)
{
    return complex->neighbours[4 * (size_t)tet + face] == TETLOD_NONE;
}

#endif
