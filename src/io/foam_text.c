/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/foam_text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <zlib.h>

#include "format/fail.h"
#include "src/io/formats.h"
#include "src/util/array.h"
#include "src/util/file.h"

enum tetlod_status foam_fail(const struct foam_file *file, const char *why)
{
    return tetlodi_fail(file->error, TETLOD_ERR_MESH, "%s: byte %td: %s", file->name,
                        (const unsigned char *)file->rest.at - file->view.bytes, why);
}

/* Unpacks gzip; a file of this size cannot hold more than 1100 times as much. */
static enum tetlod_status unpack(struct file_view *view, struct tetlod_error *error)
{
    z_stream stream = {.next_in = view->bytes, .avail_in = (uInt)view->size};
    unsigned char *out = NULL;
    size_t capacity = 0, size = 0;
    int result = view->size <= UINT32_MAX && inflateInit2(&stream, 16 + MAX_WBITS) == Z_OK ? Z_OK : Z_MEM_ERROR;
    while (result == Z_OK) {
        if (!array_reserve((void **)&out, &capacity, size + 65536, 1)) {
            result = Z_MEM_ERROR;
            break;
        }
        stream.next_out = out + size;
        stream.avail_out = (uInt)(capacity - size < 1 << 30 ? capacity - size : 1 << 30);
        size_t before = stream.avail_out;
        result = inflate(&stream, Z_NO_FLUSH);
        size += before - stream.avail_out; // without more input and output inflate says Z_BUF_ERROR
    }
    inflateEnd(&stream);
    file_view_close(view);
    *view = (struct file_view){.bytes = out, .size = size};
    if (result == Z_MEM_ERROR)
        return tetlodi_fail_nomem(error, "unpacking a file", size);
    return result == Z_STREAM_END ? TETLOD_OK : tetlodi_fail(error, TETLOD_ERR_MESH, "its gzip data is damaged or truncated");
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
            return tetlodi_fail(file->error, TETLOD_ERR_MESH, "there is no file %.200s beside it", name);
        }
    }
    enum tetlod_status status = file_view_path(&file->view, path, file->error);
    if (status == TETLOD_OK && is_packed)
        status = unpack(&file->view, file->error);
    free(path);
    return status;
}

struct text foam_token(struct foam_file *file)
{
    struct text *rest = &file->rest;
    file_view_pass(&file->view, rest->at);
    for (;;) {
        while (rest->at < rest->end && (*rest->at == ' ' || (*rest->at >= '\t' && *rest->at <= '\r')))
            rest->at++;
        if (rest->end - rest->at < 2 || rest->at[0] != '/' || (rest->at[1] != '/' && rest->at[1] != '*'))
            break;
        if (rest->at[1] == '/')
            text_line(rest);
        else
            for (rest->at += 2; rest->at < rest->end && !(rest->at[-1] == '/' && rest->at[-2] == '*'); rest->at++)
                ;
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
        struct text value = foam_token(file);
        if (key.at == key.end || value.at == value.end)
            return foam_fail(file, "its header has no end; is it truncated?");
        if (text_is(key, "format"))
            file->binary = text_is(value, "binary");
        if (text_is(key, "class"))
            snprintf(file->class_name, sizeof file->class_name, "%.*s", text_length(value), value.at);
        if (text_is(key, "arch")) {
            file->label = contains(value, "label=64") ? VALUE_INT64 : VALUE_INT32;
            file->scalar = contains(value, "scalar=32") ? VALUE_FLOAT32 : VALUE_FLOAT64;
        }
        while (!text_is(value, ";") && value.at != value.end)
            value = foam_token(file);
    }
    return TETLOD_OK;
}

enum tetlod_status foam_open(struct foam_file *file, const struct io_input *input, const char *name, struct tetlod_error *error)
{
    *file = (struct foam_file){.name = name, .label = VALUE_INT32, .scalar = VALUE_FLOAT64, .error = error};
    TETLOD_TRY(load(file, input, name));
    file->rest = (struct text){(const char *)file->view.bytes, (const char *)file->view.bytes + file->view.size};
    return read_header(file);
}

void foam_close(struct foam_file *file)
{
    file_view_close(&file->view);
}

enum tetlod_status foam_list(struct foam_file *file, enum value_type type, uint64_t width, uint64_t *count, bool *uniform)
{
    struct text token = foam_token(file);
    int64_t parsed;
    uint64_t left, least = file->binary ? value_size(type) * width : 2 * width;
    if (!text_int(&token, &parsed) || parsed < 0)
        return foam_fail(file, "there should be the size of a list here");
    token = foam_token(file);
    *uniform = text_is(token, "{");
    *count = (uint64_t)parsed;
    left = (uint64_t)(file->rest.end - file->rest.at) + !file->binary; // after the last word of a text there may be nothing
    if (!*uniform && !text_is(token, "("))
        return foam_fail(file, "there should be a list in ( ) here");
    if (*uniform ? *count > 1000 * left : *count > left / least)
        return foam_fail(file, "the file ends too early for this list; is it truncated?");
    return TETLOD_OK;
}

static enum tetlod_status list_end(struct foam_file *file, bool uniform)
{
    return text_is(foam_token(file), uniform ? "}" : ")") ? TETLOD_OK : foam_fail(file, "a list should end here");
}

enum tetlod_status foam_labels(struct foam_file *file, uint32_t **out, uint64_t *count)
{
    bool uniform;
    *out = NULL;
    TETLOD_TRY(foam_list(file, file->label, 1, count, &uniform));
    *out = array_new((size_t)*count, sizeof **out);
    if (!*out)
        return tetlodi_fail_nomem(file->error, file->name, *count * 4);
    if (file->binary && !uniform) {
        values_to_points((const unsigned char *)file->rest.at, file->label, false, (size_t)*count, *out);
        file->rest.at += *count * value_size(file->label);
        return list_end(file, uniform);
    }
    for (uint64_t i = 0; i < *count; i++) {
        struct text token = uniform && i ? (struct text){NULL, NULL} : foam_token(file);
        int64_t number;
        if (token.at && !text_int(&token, &number))
            return foam_fail(file, "there should be a whole number here");
        (*out)[i] = token.at ? cells_point(number) : (*out)[0];
    }
    return list_end(file, uniform);
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
    TETLOD_TRY(foam_list(file, file->scalar, width, count, &uniform));
    *out = array_new((size_t)*count, width * sizeof **out);
    if (!*out)
        return tetlodi_fail_nomem(file->error, file->name, *count * width * 8);
    if (file->binary && !uniform) {
        values_to_doubles((const unsigned char *)file->rest.at, file->scalar, false, (size_t)*count * width, *out);
        file->rest.at += *count * width * value_size(file->scalar);
        return list_end(file, uniform);
    }
    for (uint64_t i = 0; i < *count; i++)
        if (uniform && i)
            memcpy(*out + i * width, *out, width * sizeof **out);
        else
            TETLOD_TRY(text_row(file, width, *out + i * width));
    return list_end(file, uniform);
}
