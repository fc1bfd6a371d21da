/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The stretches of a stream that have digests of their own: header and index together, each frame, each section, and of
 * the values of steps each group. Who sends stored bytes holds these against the digests, without decoding. Not
 * installed.
 */
#ifndef TETLOD_PARTS_H
#define TETLOD_PARTS_H

#include "format/read/reader.h"

/* All parts in the stream's order, without gaps, in an array that the caller frees. `series` is the stream's, or NULL
 * if it has one moment. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status tetlodi_parts(const struct tetlod_file *file, const struct tetlod_series *series,
                                                struct tetlodi_frame **out, size_t *out_count,
                                                struct tetlod_error *error);

/* Reads a part in pieces of bounded size and holds it against its digest. ERR_CHECKSUM, ERR_TRUNCATED, ERR_NOMEM, or
 * the source's. */
TETLOD_CHECKED enum tetlod_status tetlodi_check_part(const struct tetlod_file *file, const struct tetlodi_frame *part,
                                                     struct tetlod_error *error);

/* Of series.c: the groups of all sections TVAL and CSTP; NULL counts them. */
size_t tetlodi_series_parts(const struct tetlod_series *series, struct tetlodi_frame *out);

#endif
