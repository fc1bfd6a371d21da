/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * From a contraction sequence to a stream (SPEC.md). Not installed: only the builder writes streams.
 *
 * The sequence is a forest. Nodes 0 .. vertices-1 are the original vertices; contraction c makes node vertices + c out
 * of two to four nodes that were alive. A level is the moment after its first `contractions` contractions. Which
 * tetrahedra a contraction removes follows from the forest: a tetrahedron is there while its four corners have four
 * different living ancestors. Any sequence over any list of tetrahedra round-trips, manifold or not.
 */
#ifndef TETLOD_WRITER_H
#define TETLOD_WRITER_H

#include "format/common/sink.h"
#include "format/write/write_input.h"

/* Encodes the whole stream into the sink. The same input gives the same bytes. ERR_ARGUMENT names a sequence that is
 * not one; ERR_NOMEM; ERR_LIMIT; ERR_CANCELLED; or what the sink returned. Without a
 * sink the levels are coded, and that is all. */
TETLOD_CHECKED enum tetlod_status tetlodi_write(const struct tetlodi_write_input *input,
                                                const struct tetlodi_sink *sink,
                                                struct tetlod_error *error);

#endif
