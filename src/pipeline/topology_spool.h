/* SPDX-License-Identifier: BSD-3-Clause */
/* Streams of topology groups on their way into the stream of the first one: one after the other in a temporary file
 * (format/SPEC.md, 3.8). */
#ifndef TETLOD_TOPOLOGY_SPOOL_H
#define TETLOD_TOPOLOGY_SPOOL_H

#include "format/coding/topologies.h"
#include "format/common/sink.h"
#include "format/write/write_input.h"
#include "src/util/spool.h"

struct topology_spool {
    struct spool streams;
    uint32_t count;
    struct tetlod_topology *topologies; /* [count] */
    uint8_t (*cids)[DIGEST_SIZE];
    struct tetlodi_buffer table;
    struct tetlod_source source; /* of all streams so far */
    struct tetlodi_write_section sections[2];
};

/* For so many groups. It is to be freed in any case. ERR_IO, ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status topology_spool_init(struct topology_spool *spool, uint32_t count,
                                                      struct tetlod_error *error);
void topology_spool_fini(struct topology_spool *spool);

/* Where the next group's stream goes. */
struct tetlodi_sink topology_spool_sink(struct topology_spool *spool);

/* What is known of group `group`; but for the first one its stream has just been written. `times` [steps] are borrowed.
 * ERR_IO. */
TETLOD_CHECKED enum tetlod_status topology_spool_note(struct topology_spool *spool, uint32_t group, uint32_t steps,
                                                      const double *times,
                                                      struct tetlod_error *error);

/* The sections TOPO and NEXT, when all groups are noted: valid as long as the spool. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status topology_spool_sections(struct topology_spool *spool, struct tetlod_error *error);

#endif
