/* SPDX-License-Identifier: BSD-3-Clause */
/* The sections TOPO and NEXT (SPEC 3.8): steps over other meshes, as streams inside the stream. Not installed. */
#ifndef TETLOD_TOPOLOGIES_H
#define TETLOD_TOPOLOGIES_H

#include "format/coding/index.h"

/* The table's bytes. `size` of the first group does not count. */
void tetlodi_topologies_encode(const struct tetlod_topology *topologies, uint32_t count,
                               const uint8_t (*cids)[DIGEST_SIZE],
                               struct tetlodi_buffer *out);

/* Sets info.topologies to what the table says, and holds it against the section NEXT. ERR_STREAM, ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status tetlodi_topologies_decode(struct tetlodi_index *index, const uint8_t *bytes,
                                                            size_t size,
                                                        struct tetlod_error *error);

#endif
