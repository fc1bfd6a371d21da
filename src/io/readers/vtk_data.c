/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/readers/vtk_data.h"

#include <stdarg.h>
#include <stdio.h>

#include "format/fail.h"

enum { PART = 1 << 16 }; // numbers that are converted at a time

enum tetlod_status vtk_fail(const struct vtk_stream *stream, struct tetlod_error *error, const char *format, ...)
{
    char what[160];
    unsigned long line = 1;
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    if (stream->binary)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "byte %td: %s", stream->rest.at - stream->begin, what);
    for (const char *at = stream->begin; at < stream->rest.at; at++)
        line += *at == '\n';
    line -= stream->rest.at > stream->begin && stream->rest.at[-1] == '\n'; // it is the line just read
    return tetlodi_fail(error, TETLOD_ERR_MESH, "line %lu: %s", line, what);
}

enum tetlod_status vtk_array_type(const struct vtk_stream *stream, struct text word, struct vtk_array_type *out,
                                  struct tetlod_error *error)
{
    static const struct {
        const char *name;
        struct vtk_array_type type;
    } types[] = {
        {"float", {VTK_NUMBERS, VALUE_FLOAT32}},          {"double", {VTK_NUMBERS, VALUE_FLOAT64}},
        {"int", {VTK_NUMBERS, VALUE_INT32}},              {"unsigned_int", {VTK_NUMBERS, VALUE_UINT32}},
        {"char", {VTK_NUMBERS, VALUE_INT8}},              {"signed_char", {VTK_NUMBERS, VALUE_INT8}},
        {"unsigned_char", {VTK_NUMBERS, VALUE_UINT8}},    {"short", {VTK_NUMBERS, VALUE_INT16}},
        {"unsigned_short", {VTK_NUMBERS, VALUE_UINT16}},  {"long", {VTK_NUMBERS, VALUE_INT64}},
        {"unsigned_long", {VTK_NUMBERS, VALUE_UINT64}},   {"vtkIdType", {VTK_NUMBERS, VALUE_INT32}},
        {"vtktypeint64", {VTK_NUMBERS, VALUE_INT64}},     {"vtktypeuint64", {VTK_NUMBERS, VALUE_UINT64}},
        {"vtktypeint32", {VTK_NUMBERS, VALUE_INT32}},     {"bit", {VTK_BITS, VALUE_UINT8}},
        {"string", {VTK_STRINGS, VALUE_UINT8}},
    };
    for (size_t t = 0; t < sizeof types / sizeof *types; t++)
        if (text_is(word, types[t].name)) {
            *out = types[t].type;
            return TETLOD_OK;
        }
    return vtk_fail(stream, error, "there is no data type '%.*s'", text_length(word), word.at);
}

static size_t left(const struct vtk_stream *stream)
{
    return (size_t)(stream->rest.end - stream->rest.at);
}

enum tetlod_status vtk_check_count(const struct vtk_stream *stream, enum value_type type, uint64_t count,
                                   struct tetlod_error *error)
{
    uint64_t most = stream->binary ? left(stream) / value_size(type) : (left(stream) + 1) / 2;
    if (count <= most)
        return TETLOD_OK;
    return vtk_fail(stream, error, "the file ends too early for %llu values; is it truncated?",
                    (unsigned long long)count);
}

static enum tetlod_status fail_number(const struct vtk_stream *stream, struct tetlod_error *error)
{
    return vtk_fail(stream, error, "%s",
                    left(stream) ? "there should be a number here" : "the file ends too early; is it truncated?");
}

enum tetlod_status vtk_doubles(struct vtk_stream *stream, enum value_type type, size_t count, double *out,
                               struct tetlod_error *error)
{
    TETLOD_TRY(vtk_check_count(stream, type, count, error));
    for (size_t i = 0; i < count && stream->binary; i += PART) {
        size_t part = count - i < PART ? count - i : PART;
        values_to_doubles((const unsigned char *)stream->rest.at, type, true, part, out + i);
        stream->rest.at += part * value_size(type);
        file_view_pass(stream->view, stream->rest.at);
    }
    for (size_t i = 0; i < count && !stream->binary; i++) {
        if (!text_double(&stream->rest, type == VALUE_FLOAT32, &out[i]))
            return fail_number(stream, error);
        file_view_pass(stream->view, stream->rest.at);
    }
    return TETLOD_OK;
}

enum tetlod_status vtk_ints(struct vtk_stream *stream, enum value_type type, size_t count, int64_t *out,
                            struct tetlod_error *error)
{
    if (value_is_float(type))
        return vtk_fail(stream, error, "these should be integers");
    TETLOD_TRY(vtk_check_count(stream, type, count, error));
    file_view_pass(stream->view, stream->rest.at);
    if (stream->binary) {
        values_to_ints((const unsigned char *)stream->rest.at, type, true, count, out);
        stream->rest.at += count * value_size(type);
        return TETLOD_OK;
    }
    for (size_t i = 0; i < count; i++)
        if (!text_int(&stream->rest, &out[i]))
            return fail_number(stream, error);
    return TETLOD_OK;
}

/* A binary string's length is in the low bits of a big-endian word of 1, 2, 4 or 8 bytes; the two high bits tell
 * which. */
static bool skip_string(struct vtk_stream *stream)
{
    if (left(stream) == 0)
        return false;
    unsigned kind = (unsigned char)*stream->rest.at >> 6, bytes = 8u >> kind;
    uint64_t length = 0;
    if (left(stream) < bytes)
        return false;
    for (unsigned b = 0; b < bytes; b++)
        length = length << 8 | (unsigned char)*stream->rest.at++;
    length &= ~((uint64_t)3 << (8 * bytes - 2));
    if (length > left(stream))
        return false;
    stream->rest.at += length;
    return true;
}

enum tetlod_status vtk_skip(struct vtk_stream *stream, struct vtk_array_type type, uint64_t count,
                            struct tetlod_error *error)
{
    if (stream->binary && type.kind != VTK_STRINGS) {
        uint64_t values = type.kind == VTK_BITS ? count / 8 + (count % 8 != 0) : count;
        TETLOD_TRY(vtk_check_count(stream, type.type, values, error));
        stream->rest.at += values * value_size(type.type);
        return TETLOD_OK;
    }
    for (uint64_t i = 0; i < count; i++) {
        if (left(stream) == 0 || (stream->binary && !skip_string(stream)))
            return fail_number(stream, error);
        if (!stream->binary && type.kind == VTK_STRINGS)
            text_line(&stream->rest);
        else if (!stream->binary)
            text_word(&stream->rest);
    }
    return TETLOD_OK;
}
