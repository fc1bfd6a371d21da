/* SPDX-License-Identifier: BSD-3-Clause */
/* The part of a tetrahedron in which linear functions are not negative, as tetrahedra. */
#ifndef TETLOD_CLIP_H
#define TETLOD_CLIP_H

enum { MAX_CLIP_PLANES = 7 }; /* a box and a threshold */

/* A piece: row i has the weights of its corner i for the corners of the tetrahedron that was clipped. */
typedef void clip_visit(void *opaque, const double piece[4][4]);

/* Gives every piece of the part where all `count` functions are at least 0; functions[k][c] is the value of function k
 * at corner c. Pieces do not overlap; some may be flat. The order is fixed. */
void clip_tet(const double functions[][4], unsigned count, clip_visit *visit, void *opaque);

/* The piece's share of the volume. */
double clip_share(const double piece[4][4]);

#endif
