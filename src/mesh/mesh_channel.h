/* SPDX-License-Identifier: BSD-3-Clause */
/* A mesh for helpers (src/util/channel.h): what contracting and measuring it takes, without values of cells. */
#ifndef TETLOD_MESH_CHANNEL_H
#define TETLOD_MESH_CHANNEL_H

#include "src/mesh/tetmesh.h"
#include "src/util/channel.h"

/* `like`: a mesh that was passed before, or NULL. Arrays that both have are not passed again: where *mesh is received
 * it borrows them, until mesh_return_borrowed. To be freed in any case. */
void mesh_pass(struct channel *channel, struct tetmesh *mesh, const struct tetmesh *like);

/* Before the mesh is freed: what it has of `like` stays there. */
void mesh_return_borrowed(struct tetmesh *mesh, const struct tetmesh *like);

/* What a helper keeps of a mesh from one call to a later one. */
struct kept_mesh {
    struct tetmesh mesh; /* points and corners; empty: nothing is kept */
    bool bordered;       /* its border was found here */
};

void kept_mesh_fini(struct kept_mesh *kept);

#endif
