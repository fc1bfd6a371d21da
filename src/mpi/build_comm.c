/* SPDX-License-Identifier: BSD-3-Clause */
/* libtetlod-mpi: pieces of all ranks are joined by them, and they share out the work of the build. */
#include <stdlib.h>

#include "format/fail.h"
#include "src/library/library.h"
#include "src/mpi/gather.h"
#include "src/mpi/mpi_share.h"
#include "src/util/array.h"

/* The status of all ranks: what one has failed with by itself all return. */
static enum tetlod_status finish(MPI_Comm comm, struct work_share *share, enum tetlod_status status,
                                 struct tetlod_error *error)
{
    int rank = 0;
    char *text = NULL;
    struct tetlod_error own = {0};
    if (error)
        own = *error;
    bool good = mpi_share_finish(share, status == TETLOD_OK, own.message, &rank, &text);
    int code = (int)status;
    if (!good) {
        MPI_Bcast(&code, 1, MPI_INT, rank, comm);
        status = tetlodi_fail(error, (enum tetlod_status)code, "rank %d: %.400s", rank, text ? text : "has failed");
    }
    free(text);
    return status;
}

enum tetlod_status tetlod_build_comm(MPI_Comm comm, const struct tetlod_build_piece *piece,
                                     const struct tetlod_build_options *options,
                                     enum tetlod_status (*write)(void *opaque, const void *bytes, size_t size),
                                     void *opaque, struct tetlod_error *error)
{
    struct tetlod_build_mesh mesh;
    struct tetmesh copy = {0}; // on rank 0
    struct work_share share;
    int rank;
    MPI_Comm_rank(comm, &rank);
    enum tetlod_status status = gather_pieces(&mesh, comm, piece, error);
    if (status == TETLOD_OK)
        status = comm_agree(comm, rank ? TETLOD_OK : library_copy_mesh(&copy, &mesh, error), error);
    gathered_fini(&mesh);
    if (status == TETLOD_OK)
        status = comm_agree(comm, mpi_share_new(&share, comm, error), error);
    if (status == TETLOD_OK) {
        const struct tetlodi_sink sink = {write, opaque};
        status = library_build_copy(&copy, options, &share, &sink, error);
        status = finish(comm, &share, status, error);
        mpi_share_free(&share);
    }
    tetmesh_fini(&copy);
    return status;
}

/* ---- a series */

struct tetlod_build_comm_series {
    MPI_Comm comm;
    struct tetlod_build_series *steps; /* on rank 0 */
};

enum tetlod_status tetlod_build_comm_series_new(struct tetlod_build_comm_series **out, MPI_Comm comm,
                                                const struct tetlod_build_options *options, struct tetlod_error *error)
{
    int rank;
    struct tetlod_build_comm_series *series = *out = array_zero(1, sizeof *series);
    MPI_Comm_rank(comm, &rank);
    TETLOD_TRY(comm_agree(comm, series ? TETLOD_OK : tetlodi_fail_nomem(error, "the series", sizeof *series), error));
    MPI_Comm_dup(comm, &series->comm);
    return comm_agree(series->comm, rank ? TETLOD_OK : tetlod_build_series_new(&series->steps, options, error), error);
}

enum tetlod_status tetlod_build_comm_series_add(struct tetlod_build_comm_series *series,
                                                const struct tetlod_build_piece *piece, double time,
                                                struct tetlod_error *error)
{
    struct tetlod_build_mesh mesh;
    enum tetlod_status status = gather_pieces(&mesh, series->comm, piece, error);
    if (status == TETLOD_OK)
        status = comm_agree(series->comm,
                            series->steps ? tetlod_build_series_add(series->steps, &mesh, time, error) : TETLOD_OK,
                            error);
    gathered_fini(&mesh);
    return status;
}

enum tetlod_status tetlod_build_comm_series_write(struct tetlod_build_comm_series *series,
                                                  enum tetlod_status (*write)(void *opaque, const void *bytes,
                                                                              size_t size),
                                                  void *opaque, struct tetlod_error *error)
{
    return comm_agree(series->comm,
                      series->steps ? tetlod_build_series_finish(series->steps, write, opaque, error) : TETLOD_OK,
                      error);
}

void tetlod_build_comm_series_free(struct tetlod_build_comm_series *series)
{
    if (!series)
        return;
    tetlod_build_series_free(series->steps);
    if (series->comm) // 0 before it is made
        MPI_Comm_free(&series->comm);
    free(series);
}
