/* SPDX-License-Identifier: BSD-3-Clause */
/* Answers that are made from the mesh of a level: found in the cache, or made by a worker from the stream in memory. */
#ifndef TETLOD_SERVER_MADE_H
#define TETLOD_SERVER_MADE_H

#include "server/http/exchange.h"
#include "server/http/respond.h"
#include "src/mesh/tetmesh.h"
#include "src/stream/forest.h"
#include "src/util/buffer.h"
#include "src/util/room.h"

struct level_answer {
    uint32_t level;
    const char *name; /* tells it from all others that are made from the level; visible ASCII without '"' and '/' */
    const char *media_type;
    uint64_t file_bytes; /* an upper bound of what `write` writes */
    enum tetlod_status (*write)(const void *choice, const struct tetmesh *mesh, struct buffer *out,
                                struct tetlod_error *error);
    const void *choice; /* copied */
    size_t choice_size;
    bool finest; /* making it needs the stream up to its finest level, not only up to `level` */
    bool alone;  /* or no stream in memory: `mesh` gets NULL for it, and `mesh_bytes` is all that it takes */
    /* Of a region, which gets a note, or a step; NULL: the mesh is the level's. It needs up to `mesh_bytes` more. */
    enum tetlod_status (*mesh)(const void *choice, const struct forest *forest, struct room *room, struct tetmesh *out,
                               struct region_note *note, struct tetlod_error *error);
    /* What `write` writes of a mesh. Where this is there, `mesh` asks the room for its memory as it goes on, and
     * nothing is reserved before; NULL: all of it is. */
    enum tetlod_status (*measure)(const void *choice, const struct tetmesh *mesh, uint64_t *out,
                                  struct tetlod_error *error);
    /* note: may be NULL */
    void (*headers)(struct response *response, struct dataset *dataset, const void *choice,
                    const struct region_note *note);
    uint64_t mesh_bytes;
};

/* Whether what making takes has room in the cache; else the answer should be written while it is sent, if it can be. */
bool fits_cache(const struct site *site, const struct tetlod_info *info, const struct level_answer *answer);

enum outcome answer_from_level(struct exchange *exchange, struct dataset *dataset, const struct level_answer *answer);

#endif
