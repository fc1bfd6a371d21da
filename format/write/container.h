/* SPDX-License-Identifier: BSD-3-Clause */
/* A stream put together from its parts (SPEC 3): header, index, early sections, frames, the other sections. Not
 * installed. */
#ifndef TETLOD_CONTAINER_H
#define TETLOD_CONTAINER_H

#include "format/coding/index.h"
#include "format/common/sink.h"
#include "format/write/write_input.h"

/* `index` has its levels with their frames' sizes and digests, and no sections yet; `frames` are their bytes.
 * ERR_ARGUMENT for a section without a tag of its own, ERR_NOMEM, ERR_LIMIT, or what the sink returned. */
TETLOD_CHECKED enum tetlod_status tetlodi_container_write(struct tetlodi_index *index,
                                                          const struct tetlodi_buffer *frames,
                                                          const struct tetlodi_write_section *sections, uint32_t count,
                                                          const struct tetlodi_sink *sink, struct tetlod_error *error);

#endif
