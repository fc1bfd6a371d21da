/* SPDX-License-Identifier: BSD-3-Clause */
/* The coarse levels of a stream as a stream of their own. Not installed. */
#ifndef TETLOD_PREFIX_H
#define TETLOD_PREFIX_H

#include "format/common/sink.h"

/* Writes levels 0 to `level`: their frames as they are, an index of these levels alone, the early sections, and in the
 * metadata "part_of", the content id of `file`. The finest level gives the bytes of `file`, if that is whole. Of one
 * that is cut off values of cells of which bytes are missing are left out, as are the parts behind the finest level.
 * ERR_ARGUMENT if there is no such level, or as tetlod_open. */
TETLOD_CHECKED enum tetlod_status tetlodi_write_prefix(const struct tetlod_file *file, uint32_t level,
                                                       const struct tetlodi_sink *sink,
                                                       struct tetlod_error *error);

#endif
