/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The mesh while its edges, faces and tetrahedra are contracted in parallel rounds (rounds.h), in as little memory as
 * will do.
 *
 * Vertices live in slots along a Hilbert curve, tetrahedra in the order of their least slot. Contracting a simplex
 * leaves its result in the slot of its last vertex and kills the others. A slot's node names its vertex in the
 * contraction log. Every tetrahedron is positive as listed (the mesh's own orientation is turned round if it is the
 * other one), or has frozen corners.
 *
 * A slot's row holds what evaluating reads, together: the position; U and L of each controlled component, less what
 * its values are kept less (field.h); and how far the boundary has moved there (PROOF.md, 2 and 5).
 *
 * The star of a slot is a list in a pool. A removed tetrahedron stays listed by the vertices around it until their
 * lists are pruned, because in a round other threads read those lists.
 */
#ifndef TETLOD_WORKING_H
#define TETLOD_WORKING_H

#include <stdatomic.h>

#include "src/log/contraction_log.h"
#include "src/simplify/mesh/field.h"

enum {
    VERTEX_ALIVE = 1,
    VERTEX_BOUNDARY = 2,
    /* corner of a degenerate, inverted or folded tetrahedron: contracted only with a vertex at the same point */
    VERTEX_FROZEN = 4,
    VERTEX_SINGULAR = 8,  /* not a manifold point, or frozen by the caller: never contracted */
    VERTEX_FIXED = 16,    /* where regions meet: stays where it is, others may be contracted into it */
};

struct span {
    uint64_t begin;
    uint32_t count, capacity;
};

/* A component whose error is controlled. */
struct component {
    uint32_t field, component;
    double scale;  /* 1 / the field's range; 0 for a constant field */
    double factor; /* error times this is compared with the limit: scale, times limit of all / limit of the field */
    double *predicted; /* [slot] the thesis's accumulated error (4.1, 4.2.3) */
};

struct working {
    uint32_t slot_count, tet_count;
    uint32_t vertices_alive, tets_alive;
    uint32_t stride; /* doubles of a row, a multiple of four */
    double *rows;    /* [stride * slot] */
    uint32_t (*corners)[4];  /* [tet] slots; the first is TETLOD_NONE when it is gone */
    uint8_t *boundary_faces; /* [tet] bit f: the face opposite corner f is on the boundary */
    uint8_t *flags;          /* [slot] VERTEX_... */
    uint32_t *node;          /* [slot] NULL: the slots are the mesh's vertices */
    struct span *stars;      /* [slot] */
    uint32_t *pool;
    size_t pool_capacity;
    atomic_size_t pool_size;
    enum tetlod_type position_type;
    struct grid position_grid[3];
    uint32_t component_count, field_count;
    struct component *components;
    struct working_field *fields; /* their values are below, those of one slot together */
    uint32_t *firsts;             /* [field] its first component in a row of values */
    uint32_t value_count;
    double *values;               /* [value_count * slot] */
    struct contraction_log *log;  /* borrowed */
};

enum { ROW_FIELDS = 3 }; /* behind the position: U and L of each component, then how far the boundary moved */

static inline double *working_row(const struct working *working, uint32_t slot)
{
    return working->rows + (size_t)working->stride * slot;
}

/* The slot's values of a field. */
static inline double *working_values(const struct working *working, uint32_t slot, uint32_t field)
{
    return working->values + (size_t)working->value_count * slot + working->firsts[field];
}

static inline uint32_t row_moved(const struct working *working)
{
    return ROW_FIELDS + 2 * working->component_count;
}

static inline bool working_alive(const struct working *working, uint32_t slot)
{
    return working->flags[slot] & VERTEX_ALIVE;
}

static inline bool tet_gone(const struct working *working, uint32_t tet)
{
    return working->corners[tet][0] == TETLOD_NONE;
}

static inline unsigned corner_of(const uint32_t corners[4], uint32_t slot)
{
    return (unsigned)(corners[1] == slot) + 2u * (corners[2] == slot) + 3u * (corners[3] == slot);
}

/* What a part of a mesh has from the whole. */
struct working_whole {
    bool turned; /* most of its tetrahedra are listed the other way round */
    double (*field_ranges)[2];     /* [controlled field] over all of its components */
    double (*component_ranges)[2]; /* [value] of each component of each field */
};

/* Is the slot one of a simplex's? */
static inline bool is_of(const uint32_t *simplex, uint32_t count, uint32_t slot)
{
    for (uint32_t s = 0; s < count; s++)
        if (simplex[s] == slot)
            return true;
    return false;
}

/* Has a tetrahedron another vertex of the simplex than that one? */
static inline bool tet_has_other(const uint32_t corners[4], const uint32_t *simplex, uint32_t count, uint32_t than)
{
    bool has = false;
    for (uint32_t s = 0; s < count; s++)
        has |= s != than && (corners[0] == simplex[s] || corners[1] == simplex[s] || corners[2] == simplex[s] ||
                             corners[3] == simplex[s]);
    return has;
}

/* Takes over the mesh. The log is the mesh's (log_init); its controlled components and the degenerate and inverted
 * tetrahedra are filled in (border_find adds the folded ones). `limits` (may be NULL) are multiples of the common
 * limit. Without `whole` the mesh is the whole. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status working_init(struct working *working, const struct tetmesh *mesh,
                                               const struct working_whole *whole, const uint32_t *controlled,
                                               uint32_t controlled_count, const double *limits,
                                               struct contraction_log *log, struct tetlod_error *error);

/* What border_find, and border_find_most, look at of the whole mesh: its tetrahedra and their stars, in the mesh's own
 * order. It has no fields. `turned` as in working_whole. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status working_look(struct working *working, const struct tetmesh *mesh, bool turned,
                                               struct contraction_log *log, struct tetlod_error *error);

/* Ends such a one: the mesh is as it was. */
void working_look_end(struct working *working, const struct tetmesh *mesh);

/* Which tetrahedron of the mesh each of a new working mesh is: out[tet]. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status working_origins(const struct working *working, const struct tetmesh *mesh,
                                                  uint32_t *out,
                                                  struct tetlod_error *error);

/* Are most of the mesh's tetrahedra, by volume, listed the other way round? */
bool working_is_turned(const struct tetmesh *mesh);
void working_fini(struct working *working);

/* Bytes that it takes at most, about. */
uint64_t working_bytes(const struct tetmesh *mesh, uint32_t controlled_count);

/* Room in the pool for so many more entries, so that working_place cannot fail; not while threads work. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status working_reserve(struct working *working, size_t entries, struct tetlod_error *error);

/* Numbers without the gaps that contractions have left: [old] the new one, or TETLOD_NONE of what is gone. The order
 * stays. */
struct renumbering {
    uint32_t *tets, *slots;
    uint32_t tet_count, slot_count; /* old ones */
    uint32_t tets_left, slots_left;
};

/* Numbers the living slots and tetrahedra anew, not while threads work; *out tells everybody else who has an array by
 * slot or by tetrahedron. What is gone leaves its stars. ERR_NOMEM: nothing has changed. */
TETLOD_CHECKED enum tetlod_status working_renumber(struct working *working, struct renumbering *out,
                                                   struct tetlod_error *error);
void renumbering_fini(struct renumbering *renumbering);

/* Moves what an array [slot] or [tet] has of the living to their new numbers, and gives the rest of it back. */
void *renumber_slots(const struct renumbering *renumbering, void *array, size_t element_size);
void *renumber_tets(const struct renumbering *renumbering, void *array, size_t element_size);

/* Takes removed tetrahedra out of a slot's star. */
void working_prune(struct working *working, uint32_t slot);

/* A contraction of a simplex of two to four vertices, in the slot of the last: tetrahedra, stars, boundary faces and
 * flags. The stars' other data are the caller's. Returns how many tetrahedra are gone. `list` has room for all of their
 * stars. */
uint32_t working_contract(struct working *working, const uint32_t *simplex, uint32_t count, uint32_t *list);

/* p as the mesh's type and grid can hold it. */
void working_round(const struct working *working, double p[3]);

/* The tetrahedron's orientation: +1, -1, 0 degenerate. */
int working_orientation(const struct working *working, uint32_t tet);

#endif
