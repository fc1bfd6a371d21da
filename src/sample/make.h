/* SPDX-License-Identifier: BSD-3-Clause */
/* What the samples share. Only + - * / and sqrt, which IEEE 754 rounds alike everywhere, and no libm. */
#ifndef TETLOD_SAMPLE_MAKE_H
#define TETLOD_SAMPLE_MAKE_H

#include "src/mesh/tetmesh.h"

enum tetlod_status sample_make_cube(struct tetmesh *out, uint32_t size, struct tetlod_error *error);
enum tetlod_status sample_make_fin(struct tetmesh *out, uint32_t size, struct tetlod_error *error);
enum tetlod_status sample_make_post(struct tetmesh *out, uint32_t size, struct tetlod_error *error);
enum tetlod_status sample_make_torus(struct tetmesh *out, uint32_t size, struct tetlod_error *error);
enum tetlod_status sample_make_shell(struct tetmesh *out, uint32_t size, struct tetlod_error *error);
enum tetlod_status sample_make_delta(struct tetmesh *out, uint32_t size, struct tetlod_error *error);
enum tetlod_status sample_make_wake(struct tetmesh *out, uint32_t size, struct tetlod_error *error);
void sample_move_wake(struct tetmesh *mesh, double time);

/* Room for a mesh of float32 positions; ERR_LIMIT where ids would not fit. */
TETLOD_CHECKED enum tetlod_status sample_alloc(struct tetmesh *out, uint64_t vertices, uint64_t tets,
                                               struct tetlod_error *error);

/* The same for a structured grid of dims points, with the fields Pressure and Velocity. */
TETLOD_CHECKED enum tetlod_status sample_alloc_flow(struct tetmesh *out, const uint32_t dims[3],
                                                    struct tetlod_error *error);

/* Rounds positions and fields to float32, which they are to be exactly. */
void sample_round(struct tetmesh *mesh);

/* Appends a hexahedron, split into six by smallest id; its corners' positions must be there. */
void sample_hexahedron(struct tetmesh *mesh, const uint32_t corners[8]);

/* Cosine and sine of `fraction` of a full turn, 0 <= fraction <= 1. */
void sample_turn(double fraction, double *cosine, double *sine);

/* A step from 0 to 1 around x = 0. */
double sample_step(double x);

#endif
