/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Pieces are the parts of a stage (work_share.h): a program reads those that it takes, and their blocks go to the one
 * that leads, packed and deflated. Helpers are called by the path of the file, and find the pieces in it by the same
 * reader.
 */
#include "src/io/services/pieces.h"

#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "format/fail.h"
#include "src/io/services/block_carrier.h"
#include "src/util/array.h"
#include "src/util/channel.h"
#include "src/util/packed_words.h"

/* Cells that a program reads at a time, at least. */
enum { MIN_RANGE_CELLS = 1 << 15 };

/* ---- a piece as bytes */

static bool put_numbers(void *opaque, void *numbers, size_t count, unsigned width, unsigned lag)
{
    return words_put(opaque, numbers, count, width, lag);
}

static bool get_numbers(void *opaque, void *numbers, size_t count, unsigned width, unsigned lag)
{
    return words_get(opaque, numbers, count, width, lag);
}

static enum tetlod_status pack(struct blocks *blocks, const struct io_report *report, struct buffer *out,
                               struct tetlod_error *error)
{
    struct block_carrier carrier = {put_numbers, out, false, false};
    bool good = buffer_append(out, report, sizeof *report) == TETLOD_OK &&
                buffer_append(out, &blocks->count, sizeof blocks->count) == TETLOD_OK;
    for (size_t b = 0; b < blocks->count && good; b++)
        good = block_carry(&carrier, &blocks->at[b]);
    return good ? TETLOD_OK : tetlodi_fail_nomem(error, "a piece", out->size);
}

static enum tetlod_status unpack(const unsigned char *bytes, size_t size, struct blocks *out, struct io_report *report,
                                 struct tetlod_error *error)
{
    struct words_source source = {bytes, size};
    struct block_carrier carrier = {get_numbers, &source, true, false};
    struct io_report own;
    struct block *block;
    size_t count = 0, first = out->count;
    bool good = words_get(&source, &own, sizeof own, 1, 1) && words_get(&source, &count, sizeof count, 1, 1);
    for (size_t b = 0; b < count && good; b++) {
        TETLOD_TRY(blocks_add(out, &block, error));
        good = block_carry(&carrier, block);
    }
    if (good && count && out->at[first].goes_on)
        report->hidden_cells += own.hidden_cells; // of arrays the first range has told
    else if (good)
        io_report_add(report, &own);
    return good ? TETLOD_OK : tetlodi_fail(error, TETLOD_ERR_NOMEM, "a piece that another program has read does not "
                                                                    "arrive: out of memory");
}

/* What is packed often repeats itself, as a regular grid's differences do: the fastest deflate finds that. The size
 * before stands in front. */
static enum tetlod_status deflate_piece(const struct buffer *from, struct buffer *out, struct tetlod_error *error)
{
    const uint64_t size = from->size;
    uLongf deflated = compressBound((uLong)from->size);
    unsigned char *to = buffer_append(out, &size, sizeof size) == TETLOD_OK ? buffer_extend(out, deflated) : NULL;
    if (!to || compress2(to, &deflated, from->bytes, (uLong)from->size, 1) != Z_OK)
        return tetlodi_fail_nomem(error, "a piece", deflated);
    out->size = sizeof size + deflated;
    return TETLOD_OK;
}

/* In a block that the caller frees; NULL: there is no room. */
static unsigned char *inflate_piece(const unsigned char *bytes, size_t size, size_t *out_size)
{
    uint64_t whole = 0;
    memcpy(&whole, bytes, sizeof whole);
    uLongf inflated = (uLongf)whole;
    unsigned char *out = array_new((size_t)whole, 1);
    *out_size = (size_t)whole;
    if (out && uncompress(out, &inflated, bytes + sizeof whole, (uLong)(size - sizeof whole)) == Z_OK)
        return out;
    free(out);
    return NULL;
}

/* ---- the stage */

struct reading_pieces {
    const struct piece_list *list;
    const struct work_share *share;
    const struct io_input *input; /* pieces of a piece are not shared */
    struct tetlod_error *error;
};

static enum tetlod_status read_piece(const struct reading_pieces *r, uint32_t piece)
{
    struct blocks blocks = {0};
    struct io_report report = {0};
    struct buffer bytes = {0}, deflated = {0};
    enum tetlod_status status = r->list->read(r->list->opaque, piece, &blocks, r->input, &report, r->error);
    if (status == TETLOD_OK)
        status = pack(&blocks, &report, &bytes, r->error);
    if (status == TETLOD_OK)
        status = deflate_piece(&bytes, &deflated, r->error);
    buffer_fini(&bytes);
    if (status == TETLOD_OK)
        status = r->share->put(r->share->opaque, piece, deflated.bytes, deflated.size, r->error);
    buffer_fini(&deflated);
    blocks_fini(&blocks);
    return status;
}

static enum tetlod_status take_pieces(void *opaque)
{
    const struct reading_pieces *r = opaque;
    uint32_t piece;
    while (r->share->take(r->share->opaque, &piece, NULL))
        TETLOD_TRY(read_piece(r, piece));
    return TETLOD_OK;
}

static enum tetlod_status get_pieces(const struct reading_pieces *r, struct blocks *out, struct io_report *report)
{
    enum tetlod_status status = TETLOD_OK;
    for (uint32_t piece = 0; piece < r->list->count && status == TETLOD_OK; piece++) {
        unsigned char *deflated = NULL, *bytes = NULL;
        size_t size;
        status = r->share->get(r->share->opaque, piece, SIZE_MAX, &deflated, &size, r->error);
        if (status == TETLOD_OK)
            bytes = inflate_piece(deflated, size, &size);
        free(deflated);
        if (status == TETLOD_OK)
            status = bytes ? unpack(bytes, size, out, report, r->error) : tetlodi_fail_nomem(r->error, "a piece", size);
        free(bytes);
    }
    return status == TETLOD_OK ? blocks_join_ranges(out, report, r->error) : status;
}

static enum tetlod_status call_helpers(const struct io_sharing *sharing, const struct io_read_options *options,
                                       uint32_t count, struct tetlod_error *error)
{
    const struct work_share *share;
    enum work_call call = CALL_PIECES;
    TETLOD_TRY(sharing->share->call(sharing->share, &call, &share, error));
    struct channel channel = {share, TETLOD_OK};
    channel_text(&channel, (char *)(uintptr_t)sharing->path); // is only sent
    channel_text(&channel, (char *)(uintptr_t)options->time);
    CHANNEL_VALUE(&channel, count);
    return TETLOD_OK;
}

static enum tetlod_status share_pieces(struct reading_pieces *r, struct blocks *out, const struct io_input *input,
                                       struct io_report *report)
{
    const struct io_sharing *sharing = input->options->sharing;
    const bool leads = r->share->leads;
    if (leads)
        TETLOD_TRY(call_helpers(sharing, input->options, r->list->count, r->error));
    else if (sharing->pieces != r->list->count)
        return tetlodi_fail(r->error, TETLOD_ERR_MESH, "has %u pieces here, and %u where the first rank is",
                            r->list->count, sharing->pieces);
    enum tetlod_status status = work_share_run(r->share, r->list->count, NULL, NULL, take_pieces, r, r->error);
    if (status == TETLOD_OK)
        status = leads ? get_pieces(r, out, report) : TETLOD_MORE;
    r->share->end(r->share->opaque);
    return status;
}

uint32_t pieces_ranges(const struct io_read_options *options, uint64_t cells)
{
    const struct io_sharing *sharing = options ? options->sharing : NULL;
    uint64_t most = sharing ? 2 * (uint64_t)sharing->share->members : 1, worth = cells / MIN_RANGE_CELLS;
    return (uint32_t)(worth < 2 ? 1 : worth < most ? worth : most);
}

uint64_t range_begin(uint64_t count, uint32_t range, uint32_t ranges)
{
    return count / ranges * range + count % ranges * range / ranges;
}

enum tetlod_status pieces_read(const struct piece_list *list, struct blocks *out, const struct io_input *input,
                               struct io_report *report, struct tetlod_error *error)
{
    const struct io_sharing *sharing = input->options ? input->options->sharing : NULL;
    if (sharing && list->count > 1) {
        struct io_read_options alone = *input->options;
        struct io_input inner = *input;
        struct reading_pieces r = {list, sharing->share, &inner, error};
        inner.options = &alone;
        alone.sharing = NULL;
        return share_pieces(&r, out, input, report);
    }
    for (uint32_t piece = 0; piece < list->count; piece++)
        TETLOD_TRY(list->read(list->opaque, piece, out, input, report, error));
    return TETLOD_OK;
}
