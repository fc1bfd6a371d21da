/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The part of the original mesh that a star covers, seen from where the star is to be contracted to.
 *
 * Every tetrahedron of the level has a list of the original ones that overlap it. A star's cover is the union of its
 * lists. A contraction to v' makes a cone from v' over every link face; between two cones stands a wall, the triangle
 * of v' and an edge of the link; where walls meet is a spoke, the edge from v' to a vertex of the link. All there is to
 * know of an original vertex is on which side of every wall's plane it is, as bits that cull, and how far, which is
 * computed where it is asked.
 */
#ifndef TETLOD_COVER_H
#define TETLOD_COVER_H

#include "src/simplify/exact/overlaps.h"

/* On which side of a wall's plane a vertex is: that it counts to, and, rounding in doubt, where it may be. */
enum { POSITIVE, MAYBE_NOT_POSITIVE, MAYBE_NOT_NEGATIVE, SIDES };

struct wall {
    uint32_t link[2];   /* numbers of its vertices in the link */
    uint32_t cones[2];  /* that it bounds; the same twice on the boundary */
    bool outer;         /* it lies on the boundary */
    double length;      /* of its normal */
};

struct cone {
    uint32_t tet;       /* of the level */
    uint32_t link[3];
    uint32_t walls[3];  /* opposite these */
    bool outer;         /* its link face lies on the boundary */
    uint32_t originals; /* scratch of cover_pass_on */
    double normal[3];   /* of the link face, inwards */
    double scale[3];    /* weight of link[i] at p = scale[i] * distance of p from walls[i] */
    double apex;        /* weight of v' at p = apex * normal . (p - link[0]) */
    double tolerance;   /* of normal . (p - link[0]) */
};

struct spoke {
    uint32_t cone, walls[2]; /* one that it bounds, and that one's walls that meet in it */
    double sine;             /* of the angle between these walls */
};

/* One thread's. Numbers of vertices, link vertices, walls and cones are the cover's own. */
enum { COVER_PARTS = 24, COVER_LANES = 2 };

struct cover {
    /* the originals */
    bool gathered;
    uint32_t tet_count, vertex_count, inside_count, edge_count;
    uint32_t *tets;              /* of the original */
    uint32_t (*corners)[4];      /* [tet] vertices */
    uint32_t *vertices;          /* of the original; those hosted by the star first */
    double (*positions)[3];      /* [vertex] */
    float steepest;              /* the largest of the tetrahedra's slopes */
    uint32_t (*edges)[2];        /* once each, after cover_edges */
    /* the star */
    uint32_t link_count, wall_count, cone_count;
    uint32_t *link;              /* slots */
    struct wall *walls;
    struct cone *cones;
    /* seen from `apex` */
    /* no vertex of the link is farther from it, nor of the originals once these are gathered */
    double apex[3], reach;
    /* the largest of the cones', and of the originals' once these are gathered: (longest edge)^2 * reach / 6V */
    double condition;
    /* a point counts that is this far outside of a wall, in weights: by rounding it may be inside */
    double beyond;
    uint32_t words;              /* of a set of walls */
    uint32_t stride;             /* the walls, and idle ones up to a multiple of COVER_LANES */
    double *normals;             /* [3][stride] of the walls */
    double *tolerances;          /* [stride] of the distances' rounding, scaled */
    double *thresholds;          /* [stride] distances from there on count as positive */
    double (*offsets)[3];        /* [vertex] from the apex */
    uint64_t *signs;             /* [vertex][SIDES][words] sets of walls */
    uint32_t *homes;             /* [vertex] the cone whose signs it has, or TETLOD_NONE */
    uint64_t *cone_walls, *cone_signs; /* [cone][words] its walls, and the signs inside it */
    uint64_t *spoke_walls;       /* [link][words] the walls that meet there, but those on the boundary */
    struct spoke *spokes;        /* [link] */
    /* scratch; the first four are empty between stars */
    uint64_t *listed, *covered; /* sets of original tetrahedra, and of the level's */
    uint32_t *numbers;        /* [original vertex] its number, or TETLOD_NONE */
    uint32_t *slot_numbers;   /* [slot] its number in the link, or TETLOD_NONE */
    uint32_t *table;          /* of edges: their numbers, plus 1 */
    uint32_t *pairs;          /* [link * link] number of the wall there, plus 1; all 0 between stars */
    /* [2][words] of cover_pass_on: the walls that all corners of an original may be on the negative side of, on the
     * positive */
    uint64_t *sides;
    uint32_t *held;           /* [vertex] of the same: the cone that it is inside of, or TETLOD_NONE */
    uint64_t *masks;          /* [cone][2][words] behind them: what a cone is on the other side of */
    struct place {
        uint32_t cone, original;
    } *places;                /* [place_count] cones, and originals that may overlap them, by these */
    size_t place_count;
    size_t capacity[COVER_PARTS];
};

TETLOD_CHECKED enum tetlod_status cover_init(struct cover *cover, const struct working *working,
                                             struct tetlod_error *error);
void cover_fini(struct cover *cover);

/* Bytes that a thread takes, about. */
uint64_t cover_bytes(uint32_t vertices, uint32_t tets);

/* Takes up a gathered star, without the originals under it. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status cover_begin(struct cover *cover, const struct working *working,
                                                const struct star *star, struct tetlod_error *error);

/* Looks at it from p. *out_sound: every cone has a volume. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status cover_set_apex(struct cover *cover, const struct working *working, const double p[3],
                                             bool *out_sound, struct tetlod_error *error);

/* The cone that a point on an original edge is in, found without the originals, or TETLOD_NONE; its weights at the link
 * vertices, and at v'. */
uint32_t cover_cone_at(struct cover *cover, const struct working *working, const double p[3], double weights[3],
                       double *apex_weight);

/* Gathers the originals under the star, if they are not there yet, and makes room for their vertices' sides. *out_few:
 * they are not too many. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status cover_gather(struct cover *cover, const struct overlaps *overlaps,
                                               const struct star *star, bool *out_few, struct tetlod_error *error);

/* Finds where a vertex is: its offset, its sides and its home. */
void cover_place(struct cover *cover, uint32_t vertex);

/* The cone whose directions from v' hold the vertex, or TETLOD_NONE where the star has none. It may be beyond the
 * link. */
uint32_t cover_cone_of(const struct cover *cover, uint32_t vertex);

/* Lists the edges of the cover. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status cover_edges(struct cover *cover, struct tetlod_error *error);

/* After all vertices were placed: finds the lists that the star's cones will have. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status cover_pass_on(struct cover *cover, const struct working *working, struct passed *out,
                                                struct tetlod_error *error);

/* Of a place at `r` from the apex: its distance from a wall's plane, scaled. The same bits as its signs are taken
 * from. */
static inline double cover_distance(const struct cover *cover, uint32_t wall, const double r[3])
{
    const double *n = cover->normals + wall;
    return n[0] * r[0] + n[cover->stride] * r[1] + n[2 * (size_t)cover->stride] * r[2];
}

/* A vertex's set of walls. */
static inline const uint64_t *cover_side(const struct cover *cover, uint32_t vertex, unsigned side)
{
    return cover->signs + ((size_t)vertex * SIDES + side) * cover->words;
}

/* Height of p over the cone's link face, scaled. */
static inline double cone_height(const struct cone *cone, const struct cover *cover, const struct working *working,
                                 const double p[3])
{
    const double *base = working_row(working, cover->link[cone->link[0]]);
    return cone->normal[0] * (p[0] - base[0]) + cone->normal[1] * (p[1] - base[1]) + cone->normal[2] * (p[2] - base[2]);
}

#endif
