/* SPDX-License-Identifier: BSD-3-Clause */
/* The pieces of all ranks as one mesh, numbered by the points' own numbers: what rank had what does not show. */
#ifndef TETLOD_GATHER_H
#define TETLOD_GATHER_H

#include <stdbool.h>

#include "src/mpi/tetlod_mpi.h"

/* Collective. On rank 0; *out is empty elsewhere. Its arrays are owned, names are
 * the piece's; to be freed in any case. All ranks return what the first that fails does: ERR_ARGUMENT, ERR_MESH,
 * ERR_LIMIT, ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status gather_pieces(struct tetlod_build_mesh *out, MPI_Comm comm,
                                                const struct tetlod_build_piece *piece,
                                                struct tetlod_error *error);
void gathered_fini(struct tetlod_build_mesh *mesh);

/* Collective: what this rank has come to, or what the first rank that fails has: its status and its message. */
TETLOD_CHECKED enum tetlod_status comm_agree(MPI_Comm comm, enum tetlod_status status, struct tetlod_error *error);

#endif
