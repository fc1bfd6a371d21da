/* SPDX-License-Identifier: BSD-3-Clause */
/* A stream that a command reads, from a file or from a URL. */
#ifndef TETLOD_STREAM_INPUT_H
#define TETLOD_STREAM_INPUT_H

#include "src/cli/cli.h"
#include "src/cli/web_source.h"

struct stream_input {
    struct tetlod_file *file; /* NULL: it is none */
    int fd;
    struct web_source *web;
    uint32_t finest;          /* that is here; TETLOD_NONE: not even level 0 */
};

/* Messages start with the place. To be closed, also after a failure. */
TETLOD_CHECKED enum tetlod_status stream_input_open(struct stream_input *out, const char *place, unsigned threads,
                                                    struct tetlod_error *error);
void stream_input_close(struct stream_input *input);

/* Fetches parts of a stream on a web host at once, so that reading them waits no more. Of a file: nothing to do. */
TETLOD_CHECKED enum tetlod_status stream_input_fetch(const struct stream_input *input, const struct tetlod_span *spans,
                                                     size_t count, struct tetlod_error *error);

/* Puts the place before a message about it, and what the host said behind. */
enum tetlod_status stream_input_fail(const struct stream_input *input, const char *place, enum tetlod_status status,
                                     const struct tetlod_error *inner, struct tetlod_error *error);

#endif
