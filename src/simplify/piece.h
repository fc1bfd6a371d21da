/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A part of a mesh, with all that contracting it needs and leaves: so that a mesh can be contracted piece by piece,
 * joined, cut elsewhere and contracted further. The whole mesh is one piece without frozen vertices.
 *
 * What holds for a contraction (PROOF.md, 2 to 6) is asked of the star of the edge alone. So it holds in a piece where
 * the piece has the whole stars of both ends: vertices whose star is not all there must be frozen.
 */
#ifndef TETLOD_PIECE_H
#define TETLOD_PIECE_H

#include "src/simplify/mesh/border.h"
#include "src/simplify/simplify_options.h"

/* What is one for all pieces of a mesh. */
struct piece_whole {
    struct working_whole ranges;
    uint32_t *controlled;
    uint32_t controlled_count, component_count;
    double *limits; /* NULL: none has its own */
    uint64_t degenerate_tets, inverted_tets, folded_tets; /* as in its contraction log */
};

/* How far contracting has come, in all that led to the piece. */
struct piece_state {
    double *certified, *predicted; /* [component] running maxima, fractions of the range */
    double moved;
};

struct piece {
    const struct piece_whole *whole; /* borrowed */
    /* Nothing has been contracted yet: the arrays of `mesh` are the whole mesh's, borrowed, and those that follow from
     * it are NULL: `frozen`, `bounds`, `predicted`, `moved`. */
    bool fresh;
    struct tetmesh mesh;             /* positions and values as they are now; no cell fields */
    uint8_t *frozen;                 /* [vertex] not contracted here: its star is not all there */
    uint8_t *flags;                  /* [vertex] VERTEX_BOUNDARY, FROZEN, SINGULAR, FIXED, as in the whole mesh */
    uint8_t *boundary_faces;         /* [tet] bit f: the face opposite corner f is on the whole mesh's boundary */
    double *bounds;                  /* [2 * component of the vertex] U and L, less the component's middle */
    double *predicted;               /* [component of the vertex] the accumulated prediction */
    double *moved, *most;            /* [vertex] how far the boundary has moved there, and may move */
    uint32_t *nodes;                 /* [vertex] in the log of the last contraction; NULL before */
    uint32_t *tets;                  /* [tet] its number before the last contraction; NULL before */
    uint32_t *origins; /* [tet of its working mesh] which one of the piece's it is; from piece_open to piece_take */
    struct piece_state state;
};

/* The whole mesh as a fresh piece, to be cut, of whose boundary nothing is known yet. The mesh and *whole must outlive
 * all its pieces. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status piece_begin(struct piece *piece, struct piece_whole *whole,
                                              const struct tetmesh *mesh, const uint32_t *controlled,
                                              uint32_t controlled_count, const double *limits,
                                              struct tetlod_error *error);

/* The boundary of a whole mesh, what may be contracted there, and how far it may move: as a piece has them. */
struct piece_border {
    uint8_t *flags, *boundary_faces;
    double *most;
    uint64_t degenerate_tets, inverted_tets, folded_tets;
};

/* `turned`: as in its piece_whole. Of the options those of the boundary and the threads count. To be freed in any
 * case. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status piece_border_find(struct piece_border *out, const struct tetmesh *mesh, bool turned,
                                                    const struct simplify_options *options,
                                                    struct tetlod_error *error);
void piece_border_fini(struct piece_border *border);

/* Gives a fresh piece its border, with the vertices that regions and the options fix; the border is empty then.
 * ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status piece_take_border(struct piece *piece, struct piece_whole *whole,
                                                    struct piece_border *border,
                                                    const struct simplify_options *options,
                                                    struct tetlod_error *error);

/* A fresh piece gets arrays of its own, to be contracted. ERR_NOMEM: it is as before. */
TETLOD_CHECKED enum tetlod_status piece_own(struct piece *piece, struct tetlod_error *error);

/* All of it. Of the options those of the boundary, the regions and the threads count. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status piece_of_mesh(struct piece *piece, struct piece_whole *whole,
                                                const struct tetmesh *mesh, const uint32_t *controlled,
                                                uint32_t controlled_count, const double *limits,
                                                const struct simplify_options *options, struct tetlod_error *error);

/* Some tetrahedra of a piece, as a piece; *out_vertices (the caller frees it) are their vertices there. Vertices that
 * other tetrahedra have as well are frozen. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status piece_cut(struct piece *out, const struct piece *of, const uint32_t *tets,
                                            uint32_t tet_count, uint32_t **out_vertices, struct tetlod_error *error);

/* The same where shared[vertex] says which vertices other tetrahedra have as well: for many parts of one piece.
 * number[vertex] is scratch, TETLOD_NONE everywhere before and after. */
TETLOD_CHECKED enum tetlod_status piece_part(struct piece *out, const struct piece *of, const uint32_t *tets,
                                             uint32_t tet_count, const uint8_t *shared, uint32_t *number,
                                             uint32_t **out_vertices, struct tetlod_error *error);

/* A piece of that size with the state of another one, whose vertices and tetrahedra the caller fills in. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status piece_new(struct piece *out, const struct piece *like, uint32_t vertices,
                                            uint32_t tets, struct tetlod_error *error);

/* Copies a vertex with all of its state. */
void piece_copy_vertex(struct piece *out, uint32_t to, const struct piece *of, uint32_t from);

void piece_fini(struct piece *piece);
void piece_whole_fini(struct piece_whole *whole);

/* The piece's working mesh. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status piece_open(struct piece *piece, struct working *working, struct contraction_log *log,
                                             struct tetlod_error *error);

/* The piece becomes what is left of its working mesh. ERR_NOMEM: it is as before. */
TETLOD_CHECKED enum tetlod_status piece_take(struct piece *piece, const struct working *working,
                                             const struct border *border, struct tetlod_error *error);

#endif
