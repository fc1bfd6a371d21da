/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/stream_input.h"

#include <unistd.h>

#include "format/fail.h"

enum tetlod_status stream_input_fail(const struct stream_input *input, const char *place, enum tetlod_status status,
                                     const struct tetlod_error *inner, struct tetlod_error *error)
{
    const char *problem = status == TETLOD_ERR_IO ? web_source_problem(input->web) : "";
    return tetlodi_fail(error, status, "%s: %.400s%s%s", place, inner->message, *problem ? ": " : "", problem);
}

enum tetlod_status stream_input_open(struct stream_input *out, const char *place, unsigned threads,
                                     struct tetlod_error *error)
{
    const struct tetlod_options alone = {.struct_size = sizeof alone}; // the source is for one thread
    struct tetlod_error inner = {0};
    struct tetlod_source source;
    *out = (struct stream_input){.fd = -1};
    if (!web_source_is(place)) {
        TETLOD_TRY(cli_open_stream(place, threads, &out->file, &out->fd, error));
        out->finest = cli_finest_here(tetlod_info(out->file), out->fd);
        return TETLOD_OK;
    }
    enum tetlod_status status = web_source_open(&out->web, place, &source, &inner);
    if (status != TETLOD_OK)
        return tetlodi_fail(error, status, "%s: %.400s", place, inner.message);
    status = tetlod_open(&out->file, &source, &alone, &inner);
    if (status != TETLOD_OK)
        return stream_input_fail(out, place, status, &inner, error);
    const struct tetlod_info *info = tetlod_info(out->file);
    out->finest = TETLOD_NONE;
    const uint64_t here = source.size - info->stream_offset;
    for (uint32_t level = 0; level < info->level_count && info->levels[level].end <= here; level++)
        out->finest = level;
    return TETLOD_OK;
}

enum tetlod_status stream_input_fetch(const struct stream_input *input, const struct tetlod_span *spans, size_t count,
                                      struct tetlod_error *error)
{
    return input->web ? web_source_fetch(input->web, spans, count, error) : TETLOD_OK;
}

void stream_input_close(struct stream_input *input)
{
    tetlod_close(input->file);
    web_source_free(input->web);
    if (input->fd >= 0)
        close(input->fd);
    *input = (struct stream_input){.fd = -1};
}
