/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/readers/foam_text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <zlib.h>

#include "format/fail.h"
#include "src/io/readers/readers.h"
#include "src/util/array.h"
#include "src/util/file.h"

/* A packed file: zlib unpacks it piece by piece into the window. */
enum { WINDOW = 1 << 18, AHEAD = 1 << 16 }; /* a word or comment's end is looked for in so many bytes */

struct gzip {
    z_stream stream;
    const unsigned char *end; /* of the packed bytes */
    uint64_t unpacked; /* before the window */
    bool is_done, is_damaged;
    char window[WINDOW];
};

enum tetlod_status foam_fail(const struct foam_file *file, const char *why)
{
    const struct gzip *gzip = file->gzip;
    if (gzip && gzip->is_damaged)
        return tetlodi_fail(file->error, TETLOD_ERR_MESH, "%s.gz: its gzip data is damaged or truncated", file->name);
    unsigned long long at = gzip ? gzip->unpacked + (uint64_t)(file->rest.at - gzip->window)
                                 : (unsigned long long)((const unsigned char *)file->rest.at - file->view.bytes);
    return tetlodi_fail(file->error, TETLOD_ERR_MESH, "%s: byte %llu: %s", file->name, at, why);
}

static uint64_t packed_left(const struct gzip *gzip)
{
    return (uint64_t)(gzip->end - gzip->stream.next_in);
}

/* One call of inflate into what is free of the window. After the end another gzip file may follow. */
static void inflate_some(struct gzip *gzip)
{
    enum { MOST = 1 << 30 };
    uint64_t left = packed_left(gzip);
    gzip->stream.avail_in = (uInt)(left < MOST ? left : MOST);
    int result = inflate(&gzip->stream, Z_NO_FLUSH);
    gzip->is_done = result == Z_STREAM_END && (packed_left(gzip) < 2 ||
                                               memcmp(gzip->stream.next_in, "\x1f\x8b", 2) != 0);
    if (result == Z_STREAM_END && !gzip->is_done)
        result = inflateReset(&gzip->stream);
    gzip->is_damaged = result != Z_OK && !gzip->is_done; // without more input it says Z_BUF_ERROR
}

/* Moves the window on, so that it begins with the rest. */
static void refill(struct foam_file *file)
{
    struct gzip *gzip = file->gzip;
    size_t rest = (size_t)(file->rest.end - file->rest.at);
    gzip->unpacked += (uint64_t)(file->rest.at - gzip->window);
    memmove(gzip->window, file->rest.at, rest);
    gzip->stream.next_out = (unsigned char *)gzip->window + rest;
    gzip->stream.avail_out = (uInt)(WINDOW - rest);
    while (gzip->stream.avail_out && !gzip->is_done && !gzip->is_damaged)
        inflate_some(gzip);
    file->rest = (struct text){gzip->window, (const char *)gzip->stream.next_out};
    file_view_pass(&file->view, gzip->stream.next_in);
}

/* Brings so many bytes into the window as a word can have, where it is near its end. Whether there is a byte left. */
static inline bool look_ahead(struct foam_file *file)
{
    struct gzip *gzip = file->gzip;
    if (gzip && file->rest.end - file->rest.at < AHEAD && !gzip->is_done && !gzip->is_damaged)
        refill(file);
    return file->rest.at < file->rest.end;
}

enum tetlod_status foam_end(struct foam_file *file)
{
    while (file->gzip && look_ahead(file))
        file->rest.at = file->rest.end;
    return file->gzip && file->gzip->is_damaged ? foam_fail(file, "") : TETLOD_OK;
}

static enum tetlod_status start_unpacking(struct foam_file *file)
{
    struct gzip *gzip = file->gzip = array_new(1, sizeof *gzip);
    if (gzip) {
        gzip->stream = (z_stream){.next_in = file->view.bytes};
        gzip->end = file->view.bytes + file->view.size;
        gzip->unpacked = 0;
        gzip->is_done = gzip->is_damaged = false;
    }
    if (!gzip || inflateInit2(&gzip->stream, 16 + MAX_WBITS) != Z_OK) {
        free(gzip);
        file->gzip = NULL;
        return tetlodi_fail_nomem(file->error, "unpacking a file", sizeof *gzip);
    }
    file->rest = (struct text){gzip->window, gzip->window};
    return TETLOD_OK;
}

static enum tetlod_status load(struct foam_file *file, const struct io_input *input, const char *name)
{
    char packed[512], *path = NULL;
    struct stat about;
    TETLOD_TRY(io_resolve(input, name, &path, file->error));
    bool is_packed = stat(path, &about) != 0;
    if (is_packed) {
        free(path);
        path = NULL;
        snprintf(packed, sizeof packed, "%.500s.gz", name);
        TETLOD_TRY(io_resolve(input, packed, &path, file->error));
        if (stat(path, &about) != 0) {
            free(path);
            return tetlodi_fail(file->error, TETLOD_ERR_MESH, "there is no file %.400s beside it", name);
        }
    }
    enum tetlod_status status = file_view_path(&file->view, path, file->error);
    free(path);
    file->rest = (struct text){(const char *)file->view.bytes, (const char *)file->view.bytes + file->view.size};
    return status == TETLOD_OK && is_packed ? start_unpacking(file) : status;
}

static void skip_comment(struct foam_file *file, bool is_line)
{
    struct text *rest = &file->rest;
    for (rest->at += 2; look_ahead(file); rest->at++)
        if (is_line ? *rest->at == '\n' : rest->end - rest->at > 1 && rest->at[0] == '*' && rest->at[1] == '/')
            break;
    size_t left = (size_t)(rest->end - rest->at);
    rest->at += is_line ? left > 0 : left < 2 ? left : 2;
}

struct text foam_token(struct foam_file *file)
{
    struct text *rest = &file->rest;
    if (!file->gzip)
        file_view_pass(&file->view, rest->at);
    while (look_ahead(file)) {
        if (*rest->at == ' ' || (*rest->at >= '\t' && *rest->at <= '\r'))
            rest->at++;
        else if (rest->end - rest->at >= 2 && rest->at[0] == '/' && (rest->at[1] == '/' || rest->at[1] == '*'))
            skip_comment(file, rest->at[1] == '/');
        else
            break;
    }
    struct text token = {rest->at, rest->at};
    static const char single[] = "(){};[]";
    if (rest->at < rest->end && strchr(single, *rest->at) && *rest->at)
        rest->at++;
    else if (rest->at < rest->end && *rest->at == '"') {
        for (rest->at++; rest->at < rest->end && *rest->at != '"'; rest->at++)
            ;
        rest->at += rest->at < rest->end;
    } else
        while (rest->at < rest->end && *rest->at > ' ' && !strchr(single, *rest->at))
            rest->at++;
    token.end = rest->at;
    if (token.at == token.end && rest->at < rest->end) // a byte that is none of text
        token.end = ++rest->at;
    return token;
}

static bool contains(struct text text, const char *what)
{
    size_t length = strlen(what);
    for (const char *at = text.at; (size_t)(text.end - at) >= length; at++)
        if (memcmp(at, what, length) == 0)
            return true;
    return false;
}

static enum tetlod_status read_header(struct foam_file *file)
{
    if (!text_is(foam_token(file), "FoamFile") || !text_is(foam_token(file), "{"))
        return foam_fail(file, "there should be a FoamFile header");
    for (struct text key = foam_token(file); !text_is(key, "}"); key = foam_token(file)) {
        bool is_format = text_is(key, "format"), is_class = text_is(key, "class"), is_arch = text_is(key, "arch"),
             is_end = key.at == key.end;
        struct text value = foam_token(file);
        if (is_end || value.at == value.end)
            return foam_fail(file, "its header has no end; is it truncated?");
        if (is_format)
            file->binary = text_is(value, "binary");
        if (is_class)
            snprintf(file->class_name, sizeof file->class_name, "%.*s", text_length(value), value.at);
        if (is_arch) {
            file->label = contains(value, "label=64") ? VALUE_INT64 : VALUE_INT32;
            file->scalar = contains(value, "scalar=32") ? VALUE_FLOAT32 : VALUE_FLOAT64;
        }
        while (!text_is(value, ";") && value.at != value.end)
            value = foam_token(file);
    }
    return TETLOD_OK;
}

/* ---- collated files: a list of bytes for each piece; the first one's begin with the header of all */

/* Bytes that have been read. */
static uint64_t position(const struct foam_file *file)
{
    const struct gzip *gzip = file->gzip;
    return gzip ? gzip->unpacked + (uint64_t)(file->rest.at - gzip->window)
                : (uint64_t)(file->rest.at - (const char *)file->view.bytes);
}

static void skip_bytes(struct foam_file *file, uint64_t count)
{
    while (count && look_ahead(file)) {
        uint64_t left = (uint64_t)(file->rest.end - file->rest.at), step = count < left ? count : left;
        file->rest.at += step;
        count -= step;
    }
}

/* Goes on to the bytes of a piece, from 0. */
static enum tetlod_status open_part(struct foam_file *file, uint32_t part)
{
    file->binary = false;
    for (uint32_t p = 0;; p++) {
        struct text count = foam_token(file);
        int64_t size;
        if (!text_int(&count, &size) || size < 0 || !text_is(foam_token(file), "("))
            return foam_fail(file, "there should be the bytes of a piece here");
        uint64_t begin = position(file);
        if (p == 0)
            TETLOD_TRY(read_header(file));
        if (p == part)
            return TETLOD_OK;
        if (position(file) - begin > (uint64_t)size)
            return foam_fail(file, "a header is longer than the piece that it is in");
        skip_bytes(file, (uint64_t)size - (position(file) - begin));
        if (!text_is(foam_token(file), ")"))
            return foam_fail(file, "there should be a ) behind the bytes of a piece; is it truncated?");
    }
}

enum tetlod_status foam_open(struct foam_file *file, const struct io_input *input, const char *name,
                             struct tetlod_error *error)
{
    *file = (struct foam_file){.name = name, .label = VALUE_INT32, .scalar = VALUE_FLOAT64, .error = error};
    TETLOD_TRY(load(file, input, name));
    TETLOD_TRY(read_header(file));
    if (strcmp(file->class_name, "decomposedBlockData") != 0)
        return TETLOD_OK;
    return input->part ? open_part(file, input->part - 1)
                       : foam_fail(file, "it holds several pieces, as files in a folder processorsN do");
}

void foam_close(struct foam_file *file)
{
    if (file->gzip)
        inflateEnd(&file->gzip->stream);
    free(file->gzip);
    file->gzip = NULL;
    file_view_close(&file->view);
}

/* Bytes that there can still be: packed, they are at most so many times fewer. */
static uint64_t most_left(struct foam_file *file)
{
    enum { MAX_RATIO = 1100 };
    uint64_t left = look_ahead(file) ? (uint64_t)(file->rest.end - file->rest.at) : 0;
    return left + (file->gzip ? MAX_RATIO * packed_left(file->gzip) : 0);
}

/* The count and the opening bracket of a list whose elements are so many bytes at least. */
static enum tetlod_status open_list(struct foam_file *file, uint64_t least, uint64_t *count, bool *uniform)
{
    struct text token = foam_token(file);
    int64_t parsed;
    if (!text_int(&token, &parsed) || parsed < 0)
        return foam_fail(file, "there should be the size of a list here");
    token = foam_token(file);
    *uniform = text_is(token, "{");
    *count = (uint64_t)parsed;
    if (!*uniform && !text_is(token, "("))
        return foam_fail(file, "there should be a list in ( ) here");
    uint64_t left = most_left(file) + !file->binary; // after the last word of a text there may be nothing
    if (*uniform ? *count > 1000 * left : *count > left / least)
        return foam_fail(file, "the file ends too early for this list; is it truncated?");
    return TETLOD_OK;
}

static enum tetlod_status close_list(struct foam_file *file, bool uniform)
{
    return text_is(foam_token(file), uniform ? "}" : ")") ? TETLOD_OK : foam_fail(file, "a list should end here");
}

/* How many of `count` binary values of that type lie in memory, one at least. */
static enum tetlod_status values_ahead(struct foam_file *file, enum value_type type, uint64_t *count)
{
    enum { MOST = 1 << 16 }; // so that a mapped file is given back on the way
    uint64_t there = look_ahead(file) ? (uint64_t)(file->rest.end - file->rest.at) / value_size(type) : 0;
    if (!file->gzip)
        file_view_pass(&file->view, file->rest.at);
    there = there < MOST ? there : MOST;
    *count = *count < there ? *count : there;
    return there ? TETLOD_OK : foam_fail(file, "the file ends too early for this list; is it truncated?");
}

enum tetlod_status foam_list_begin(struct foam_list *list, struct foam_file *file)
{
    *list = (struct foam_list){.file = file};
    return open_list(file, file->binary ? value_size(file->label) : 2, &list->count, &list->uniform);
}

enum tetlod_status foam_list_of_lists(struct foam_list *list, struct foam_file *file)
{
    enum { LEAST = 4 }; // 0(), and what parts it from the next
    *list = (struct foam_list){.file = file};
    TETLOD_TRY(open_list(file, LEAST, &list->count, &list->uniform));
    return list->uniform ? foam_fail(file, "lists in a list cannot be uniform") : TETLOD_OK;
}

enum tetlod_status foam_list_next(struct foam_list *list)
{
    struct foam_file *file = list->file;
    if (list->uniform && list->taken++)
        return TETLOD_OK;
    if (file->binary && !list->uniform) {
        uint64_t one = 1;
        TETLOD_TRY(values_ahead(file, file->label, &one));
        values_to_points((const unsigned char *)file->rest.at, file->label, false, 1, &list->value);
        file->rest.at += value_size(file->label);
        return TETLOD_OK;
    }
    struct text token = foam_token(file);
    int64_t number;
    if (!text_int(&token, &number))
        return foam_fail(file, "there should be a whole number here");
    list->value = cells_point(number);
    return TETLOD_OK;
}

enum tetlod_status foam_list_end(struct foam_list *list)
{
    return close_list(list->file, list->uniform);
}

enum tetlod_status foam_labels(struct foam_file *file, uint32_t **out, uint64_t *count)
{
    struct foam_list list;
    *out = NULL;
    TETLOD_TRY(foam_list_begin(&list, file));
    *count = list.count;
    *out = array_new((size_t)list.count, sizeof **out);
    if (!*out)
        return tetlodi_fail_nomem(file->error, file->name, list.count * 4);
    for (uint64_t i = 0; i < list.count; i++) {
        TETLOD_TRY(foam_list_next(&list));
        (*out)[i] = list.value;
    }
    return foam_list_end(&list);
}

static enum tetlod_status text_row(struct foam_file *file, uint32_t width, double *out)
{
    if (width > 1 && !text_is(foam_token(file), "("))
        return foam_fail(file, "there should be a ( here");
    for (uint32_t c = 0; c < width; c++) {
        struct text token = foam_token(file);
        if (!text_double(&token, false, &out[c]))
            return foam_fail(file, "there should be a number here");
    }
    return width > 1 && !text_is(foam_token(file), ")") ? foam_fail(file, "there should be a ) here") : TETLOD_OK;
}

enum tetlod_status foam_scalars(struct foam_file *file, uint32_t width, double **out, uint64_t *count)
{
    bool uniform;
    *out = NULL;
    TETLOD_TRY(open_list(file, file->binary ? value_size(file->scalar) * width : 2 * width, count, &uniform));
    *out = array_new((size_t)*count, width * sizeof **out);
    if (!*out)
        return tetlodi_fail_nomem(file->error, file->name, *count * width * 8);
    bool is_binary = file->binary && !uniform;
    for (uint64_t i = 0, some; is_binary && i < *count * width; i += some) {
        some = *count * width - i;
        TETLOD_TRY(values_ahead(file, file->scalar, &some));
        values_to_doubles((const unsigned char *)file->rest.at, file->scalar, false, (size_t)some, *out + i);
        file->rest.at += some * value_size(file->scalar);
    }
    for (uint64_t i = 0; !is_binary && i < *count; i++)
        if (uniform && i)
            memcpy(*out + i * width, *out, width * sizeof **out);
        else
            TETLOD_TRY(text_row(file, width, *out + i * width));
    return close_list(file, uniform);
}
