/* SPDX-License-Identifier: BSD-3-Clause */
/* Compression of answers, for Content-Encoding. */
#ifndef TETLOD_SERVER_ENCODE_H
#define TETLOD_SERVER_ENCODE_H

#include "server/http/coding.h"
#include "src/util/buffer.h"

/* Replaces the contents by their encoded form (nothing to do for identity). */
TETLOD_CHECKED enum tetlod_status buffer_encode(struct buffer *buffer, enum coding coding, struct tetlod_error *error);

/* Memory that encoding so many bytes takes beside them, at most. */
uint64_t buffer_encoding_bytes(uint64_t size, enum coding coding);

#endif
