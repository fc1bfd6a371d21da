/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/reader.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "format/checksum.h"
#include "format/fail.h"
#include "format/order.h"

static const uint64_t DEFAULT_BYTES = (uint64_t)16 << 30;

/* Stored bytes of the source, in a block that the caller frees. */
static enum tetlod_status read_stored(const struct tetlod_file *file, uint64_t offset, size_t size, uint8_t **out,
                                      struct tetlod_error *error)
{
    *out = NULL;
    if (offset > file->source.size || size > file->source.size - offset) {
        enum tetlod_status status = tetlodi_fail(error, TETLOD_ERR_TRUNCATED,
                                                 "the stream ends at byte %llu, before byte %llu that it should have",
                                                 (unsigned long long)file->source.size,
                                                 (unsigned long long)(offset + size));
        if (error)
            error->offset = file->source.size;
        return status;
    }
    *out = malloc(size ? size : 1);
    if (!*out)
        return tetlodi_fail_nomem(error, "a part of the stream", size);
    enum tetlod_status status = file->source.read(file->source.opaque, offset, *out, size);
    if (status != TETLOD_OK) {
        free(*out);
        *out = NULL;
        return tetlodi_fail(error, status, "cannot read %zu bytes at %llu of the stream", size,
                            (unsigned long long)offset);
    }
    return TETLOD_OK;
}

static enum tetlod_status read_part(const struct tetlod_file *file, const struct tetlodi_frame *frame,
                                    const char *what, uint8_t **out, struct tetlod_error *error)
{
    TETLOD_TRY(read_stored(file, frame->offset, frame->size, out, error));
    if (tetlodi_crc32(*out, frame->size) == frame->crc)
        return TETLOD_OK;
    free(*out);
    *out = NULL;
    tetlodi_fail(error, TETLOD_ERR_CHECKSUM, "%s, bytes %llu to %llu: the checksum does not match", what,
                 (unsigned long long)frame->offset, (unsigned long long)(frame->offset + frame->size));
    if (error)
        error->offset = frame->offset;
    return TETLOD_ERR_CHECKSUM;
}

enum tetlod_status tetlodi_read_frame(const struct tetlod_file *file, uint32_t level, uint32_t part, uint8_t **out,
                                      size_t *out_size, struct tetlod_error *error)
{
    const struct tetlod_info *info = &file->index.info;
    const struct tetlodi_frame *frame = &file->index.frames[(size_t)level * (info->field_count + 1) + part];
    char what[96];
    snprintf(what, sizeof what, "level %u, %.60s", level, part ? info->fields[part - 1].name : "the records");
    *out_size = frame->size;
    return read_part(file, frame, what, out, error);
}

enum tetlod_status tetlod_order(const struct tetlod_file *file, uint32_t *vertices, uint32_t *tets, uint8_t *corners,
                                struct tetlod_error *error)
{
    const struct tetlod_info *info = &file->index.info;
    struct tetlodi_order order = {info->vertices, info->tets, vertices, tets, corners};
    struct tetlodi_coder coder;
    uint8_t *bytes;
    if (!info->keeps_order)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "the stream does not keep the original order (build --keep-order does)");
    TETLOD_TRY(read_part(file, &file->index.order, "the original order", &bytes, error));
    tetlodi_decode_start(&coder, file->index.slowest, bytes, file->index.order.size);
    int good = tetlodi_order_code(&coder, &order);
    free(bytes);
    return good ? TETLOD_OK : tetlodi_fail(error, TETLOD_ERR_STREAM, "the original order is damaged");
}

/* ---- opening */

static enum tetlod_status read_index(struct tetlod_file *file, const struct tetlodi_header *header,
                                     const uint8_t raw_header[HEADER_SIZE], struct tetlod_error *error)
{
    const struct tetlodi_frame frame = {HEADER_SIZE, header->index_size, header->index_crc};
    uint8_t *index = NULL, cid[16];
    enum tetlod_status status;
    TETLOD_TRY_DONE(read_part(file, &frame, "the index", &index, error));
    TETLOD_TRY_DONE(tetlodi_index_decode(&file->index, index, header->index_size,
                                         HEADER_SIZE + (uint64_t)header->index_size, error));
    if (file->index.info.bytes != header->file_size)
        TETLOD_TRY_DONE(tetlodi_fail(error, TETLOD_ERR_STREAM, "the header and the index disagree about the size"));
    tetlodi_content_id(raw_header, index, header->index_size, cid);
    if (memcmp(cid, header->cid, sizeof cid) != 0)
        TETLOD_TRY_DONE(tetlodi_fail(error, TETLOD_ERR_CHECKSUM, "the content id is not that of the header and index"));
    for (int i = 0; i < 16; i++)
        snprintf(file->index.info.cid + 2 * i, 3, "%02x", cid[i]);
done:
    free(index);
    return status;
}

enum tetlod_status tetlod_open(struct tetlod_file **out, const struct tetlod_source *source,
                               const struct tetlod_options *options, struct tetlod_error *error)
{
    struct tetlodi_header header;
    uint8_t *bytes = NULL;
    struct tetlod_file *file = calloc(1, sizeof *file);
    *out = NULL;
    if (!file)
        return tetlodi_fail_nomem(error, "a stream", sizeof *file);
    file->source = *source;
    file->max_bytes = options && options->struct_size >= sizeof *options && options->max_bytes ? options->max_bytes
                                                                                             : DEFAULT_BYTES;
    enum tetlod_status status;
    if (source->size < HEADER_SIZE)
        TETLOD_TRY_DONE(tetlodi_fail(error, source->size ? TETLOD_ERR_TRUNCATED : TETLOD_ERR_NOT_TETLOD,
                                     "%llu bytes are less than a stream's header",
                                     (unsigned long long)source->size));
    TETLOD_TRY_DONE(read_stored(file, 0, HEADER_SIZE, &bytes, error));
    TETLOD_TRY_DONE(tetlodi_header_decode(&header, bytes, error));
    TETLOD_TRY_DONE(read_index(file, &header, bytes, error));
    *out = file;
done:
    free(bytes);
    if (status != TETLOD_OK)
        tetlod_close(file);
    return status;
}

static enum tetlod_status read_memory(void *opaque, uint64_t offset, void *buffer, size_t size)
{
    memcpy(buffer, (const uint8_t *)opaque + offset, size);
    return TETLOD_OK;
}

enum tetlod_status tetlod_open_memory(struct tetlod_file **out, const void *bytes, size_t size,
                                      const struct tetlod_options *options, struct tetlod_error *error)
{
    union {
        const void *in;
        void *out;
    } opaque = {bytes}; // the source's pointer is not const because other sources' is not; it is only read
    struct tetlod_source source = {read_memory, opaque.out, size};
    return tetlod_open(out, &source, options, error);
}

static enum tetlod_status read_fd(void *opaque, uint64_t offset, void *buffer, size_t size)
{
    int fd = (int)(intptr_t)opaque;
    for (size_t done = 0; done < size;) {
        ssize_t got = pread(fd, (char *)buffer + done, size - done, (off_t)(offset + done));
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            return TETLOD_ERR_IO;
        done += (size_t)got;
    }
    return TETLOD_OK;
}

enum tetlod_status tetlod_open_fd(struct tetlod_file **out, int fd, const struct tetlod_options *options,
                                  struct tetlod_error *error)
{
    struct stat about;
    *out = NULL;
    if (fstat(fd, &about) != 0)
        return tetlodi_fail(error, TETLOD_ERR_IO, "cannot read the stream: %s", strerror(errno));
    struct tetlod_source source = {read_fd, (void *)(intptr_t)fd, (uint64_t)about.st_size};
    return tetlod_open(out, &source, options, error);
}

void tetlod_close(struct tetlod_file *file)
{
    if (!file)
        return;
    tetlodi_index_fini(&file->index);
    free(file);
}

/* ---- choosing */

const struct tetlod_info *tetlod_info(const struct tetlod_file *file)
{
    return &file->index.info;
}

uint32_t tetlod_field_index(const struct tetlod_info *info, const char *name)
{
    for (uint32_t f = 0; f < info->field_count; f++)
        if (strcmp(info->fields[f].name, name) == 0)
            return f;
    return TETLOD_NONE;
}

/* What an error is compared with: a fraction of the range, or in the field's units. */
enum unit { FRACTION, FIELD_UNITS };

static int level_holds(const struct tetlod_info *info, uint32_t level, double error, enum unit unit, uint32_t field,
                       enum tetlod_measure measure)
{
    int any = 0;
    for (uint32_t f = 0; f < info->field_count; f++) {
        if (field == TETLOD_NONE ? !info->fields[f].controlled : f != field)
            continue;
        any = 1;
        double range = unit == FIELD_UNITS ? info->fields[f].range[1] - info->fields[f].range[0] : 1;
        if (!(info->levels[level].errors[f * TETLOD_MEASURES + measure] * range <= error))
            return 0;
    }
    return any;
}

static uint32_t coarsest_within(const struct tetlod_info *info, double error, enum unit unit, uint32_t field,
                                enum tetlod_measure measure)
{
    for (uint32_t k = 0; k < info->level_count; k++)
        if (level_holds(info, k, error, unit, field, measure))
            return k;
    return TETLOD_NONE;
}

uint32_t tetlod_level_for_error(const struct tetlod_info *info, double error, uint32_t field,
                                enum tetlod_measure measure)
{
    return coarsest_within(info, error, FRACTION, field, measure);
}

uint32_t tetlod_level_for_abs_error(const struct tetlod_info *info, double error, uint32_t field,
                                    enum tetlod_measure measure)
{
    return coarsest_within(info, error, FIELD_UNITS, field, measure);
}

uint32_t tetlod_level_for_tets(const struct tetlod_info *info, uint64_t tets)
{
    uint32_t k = info->level_count - 1;
    while (k > 0 && info->levels[k].tets > tets)
        k--;
    return k;
}

uint32_t tetlod_level_for_bytes(const struct tetlod_info *info, uint64_t bytes)
{
    uint32_t k = info->level_count - 1;
    while (k > 0 && info->levels[k].end > bytes)
        k--;
    return k;
}
