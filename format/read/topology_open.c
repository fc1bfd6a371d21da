/* SPDX-License-Identifier: BSD-3-Clause */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/read/reader.h"

enum tetlod_status tetlod_open_topology(struct tetlod_file **out, const struct tetlod_file *file, uint32_t topology,
                                        struct tetlod_error *error)
{
    const struct tetlod_info *info = &file->index.info;
    *out = NULL;
    if (topology >= info->topology_count)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "there is no topology group number %u", topology);
    const struct tetlod_source *whole = file->part ? &file->part->whole : &file->source; // the part goes with the file
    if (topology == 0)
        return tetlod_open(out, whole, &file->options, error);
    const struct tetlod_topology *of = &info->topologies[topology];
    size_t times = of->step_count * sizeof *of->times;
    struct tetlodi_part *part = malloc(sizeof *part + times);
    if (!part)
        return tetlodi_fail_nomem(error, "a topology group", sizeof *part + times);
    *part = (struct tetlodi_part){.whole = *whole, .offset = info->stream_offset + of->offset,
                                  .step_count = of->step_count};
    memcpy(part->times, of->times, times);
    const struct tetlod_source source = tetlodi_part_source(part, of->size);
    enum tetlod_status status = tetlod_open(out, &source, &file->options, error);
    if (status != TETLOD_OK) {
        free(part);
        return status;
    }
    (*out)->part = part;
    const struct tetlod_info *opened = &(*out)->index.info;
    if (strcmp(opened->cid, of->cid) == 0 && opened->bytes == of->size && !opened->topology_count &&
        tetlod_section_index(opened, TAG_TIME) != TETLOD_NONE)
        return TETLOD_OK;
    tetlod_close(*out);
    *out = NULL;
    return tetlodi_fail(error, TETLOD_ERR_STREAM, "topology group %u is another stream than the table says", topology);
}
