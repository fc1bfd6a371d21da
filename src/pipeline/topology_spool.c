/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/topology_spool.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

static enum tetlod_status put(void *opaque, const void *bytes, size_t size)
{
    return spool_write(opaque, bytes, size, NULL);
}

enum tetlod_status topology_spool_init(struct topology_spool *spool, uint32_t count, struct tetlod_error *error)
{
    *spool = (struct topology_spool){.count = count,
                                     .topologies = array_zero(count, sizeof *spool->topologies),
                                     .cids = array_zero(count, sizeof *spool->cids)};
    if (!spool->topologies || !spool->cids)
        return tetlodi_fail_nomem(error, "the topology groups", count * sizeof *spool->topologies);
    return spool_open(&spool->streams, error);
}

void topology_spool_fini(struct topology_spool *spool)
{
    spool_close(&spool->streams);
    free(spool->topologies);
    free(spool->cids);
    tetlodi_buffer_fini(&spool->table);
    *spool = (struct topology_spool){0};
}

struct tetlodi_sink topology_spool_sink(struct topology_spool *spool)
{
    return (struct tetlodi_sink){put, &spool->streams};
}

enum tetlod_status topology_spool_note(struct topology_spool *spool, uint32_t group, uint32_t steps,
                                       const double *times,
                                       struct tetlod_error *error)
{
    struct tetlod_topology *topology = &spool->topologies[group];
    struct tetlodi_header header;
    uint8_t raw[HEADER_SIZE];
    topology->step_count = steps;
    topology->times = times;
    if (group == 0)
        return TETLOD_OK;
    topology->offset = spool->source.size;
    TETLOD_TRY(spool_source(&spool->streams, &spool->source, error));
    topology->size = spool->source.size - topology->offset;
    if (spool->source.read(spool->source.opaque, topology->offset, raw, sizeof raw) != TETLOD_OK ||
        tetlodi_header_decode(&header, raw, NULL) != TETLOD_OK)
        return tetlodi_fail(error, TETLOD_ERR_IO, "the streams of the steps cannot be read from a temporary file");
    memcpy(spool->cids[group], header.cid, DIGEST_SIZE);
    return TETLOD_OK;
}

enum tetlod_status topology_spool_sections(struct topology_spool *spool, struct tetlod_error *error)
{
    tetlodi_topologies_encode(spool->topologies, spool->count, (const uint8_t(*)[DIGEST_SIZE])spool->cids,
                              &spool->table);
    if (spool->table.failed)
        return tetlodi_fail_nomem(error, "the table of topology groups", spool->count * sizeof *spool->topologies);
    spool->sections[0] = (struct tetlodi_write_section){.tag = TAG_TOPOLOGIES, .early = 1, .bytes = spool->table.bytes,
                                                        .size = spool->table.size};
    spool->sections[1] = (struct tetlodi_write_section){.tag = TAG_NEXT, .row = ROW_CODED, .source = &spool->source,
                                                        .size = (size_t)spool->source.size};
    return TETLOD_OK;
}
