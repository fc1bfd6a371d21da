/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Building streams of a mesh whose pieces lie on the ranks of an MPI communicator: the public interface of
 * libtetlod-mpi, with the conventions of libtetlod-build (tetlod_build.h).
 *
 *     struct tetlod_build_piece piece = {.struct_size = sizeof piece, .mesh = &mesh, .point_ids = ids};
 *     status = tetlod_build_comm(MPI_COMM_WORLD, &piece, NULL, write_bytes, file, &error);
 *
 * All functions but those that free are collective: every rank of the communicator calls them. Rank 0's options are
 * those of the stream; of another rank's only `threads` counts. Points are numbered over the whole mesh; the stream
 * depends on these numbers, not on which rank has what, nor on how many ranks there are. A point may be on several
 * ranks, a tetrahedron on one: copies that a rank has of others' (ghosts) are marked. The pieces' arrays are borrowed
 * for the call.
 *
 * Caveats. Pieces are joined by all ranks, each of which takes about three times its share for that. Rank 0 gets what
 * they have come to: it has the whole mesh in memory while a stream is built (about 115 bytes a tetrahedron), three
 * others have it while they measure, and rank 0 between the steps of a series. MPI_Init_thread with
 * MPI_THREAD_SERIALIZED, or one thread a rank (options.threads 1). `write`, `progress` and `warn` are called on rank 0
 * alone. All ranks return the same status; the message says which rank has failed first.
 */
#ifndef TETLOD_MPI_PUBLIC_H
#define TETLOD_MPI_PUBLIC_H

#include <mpi.h>

#include "src/library/tetlod_build.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What a rank has of the mesh, which may be nothing: then with the fields of the others and no rows. Positions and
 * fields have one type on all ranks. */
struct tetlod_build_piece {
    size_t struct_size; /* sizeof(struct tetlod_build_piece) */
    const struct tetlod_build_mesh *mesh;
    const uint64_t *point_ids; /* [mesh->vertices] each point's number in the whole mesh */
    const uint8_t *ghosts;     /* [mesh->tets] 1: another rank has it too, and counts it; NULL: none */
};

/* Builds the stream of all pieces. Errors as of tetlod_build; TETLOD_ERR_MESH also for pieces that do not fit: a point
 * that lies elsewhere on another rank, a tetrahedron on two. */
TETLOD_API TETLOD_CHECKED enum tetlod_status
tetlod_build_comm(MPI_Comm comm, const struct tetlod_build_piece *piece, const struct tetlod_build_options *options,
                  enum tetlod_status (*write)(void *opaque, const void *bytes, size_t size), void *opaque,
                  struct tetlod_error *error);

/*
 * A series: the solver adds its pieces while it runs, with the same points and tetrahedra. The stream of the steps so
 * far can be written at any time, so that they are seen while the solver goes on. Rank 0 builds it alone.
 */
struct tetlod_build_comm_series;

TETLOD_API TETLOD_CHECKED enum tetlod_status
tetlod_build_comm_series_new(struct tetlod_build_comm_series **out, MPI_Comm comm,
                             const struct tetlod_build_options *options, struct tetlod_error *error);

/* Adds a step. Times rise. */
TETLOD_API TETLOD_CHECKED enum tetlod_status
tetlod_build_comm_series_add(struct tetlod_build_comm_series *series, const struct tetlod_build_piece *piece,
                             double time, struct tetlod_error *error);

/* Writes the stream of all steps so far; more can be added behind it. */
TETLOD_API TETLOD_CHECKED enum tetlod_status
tetlod_build_comm_series_write(struct tetlod_build_comm_series *series,
                               enum tetlod_status (*write)(void *opaque, const void *bytes, size_t size), void *opaque,
                               struct tetlod_error *error);

/* Collective, too. Takes NULL. */
TETLOD_API void tetlod_build_comm_series_free(struct tetlod_build_comm_series *series);

#ifdef __cplusplus
}
#endif
#endif
