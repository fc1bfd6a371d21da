/* SPDX-License-Identifier: BSD-3-Clause */
/* Writing legacy VTK 3.0, binary, which is big-endian. All fields go into one FIELD, which takes any number of
 * components. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/io.h"
#include "src/util/array.h"

enum { BUFFER = 1 << 16, VTK_TETRA = 10 };

struct writer {
    const struct tetlodi_sink *sink;
    unsigned char *buffer; /* owned, BUFFER bytes */
    size_t used;
    enum tetlod_status status; /* of the sink; nothing is written after a failure */
};

static void flush(struct writer *w)
{
    if (w->status == TETLOD_OK && w->used)
        w->status = w->sink->write(w->sink->opaque, w->buffer, w->used);
    w->used = 0;
}

static void put_word(struct writer *w, uint64_t word, size_t size)
{
    if (BUFFER - w->used < size)
        flush(w);
    for (size_t b = size; b-- > 0;)
        w->buffer[w->used++] = (unsigned char)(word >> 8 * b);
}

static void put_text(struct writer *w, const char *text)
{
    for (; *text; text++)
        put_word(w, (unsigned char)*text, 1);
}

/* Names are one word: what would end it, and '%' itself, is written as %XX. */
static void put_name(struct writer *w, const char *name)
{
    for (; *name; name++) {
        char code[4];
        unsigned char c = (unsigned char)*name;
        if (c > 32 && c < 127 && c != '%' && c != '"')
            put_word(w, c, 1);
        else {
            snprintf(code, sizeof code, "%%%02X", c);
            put_text(w, code);
        }
    }
}

static void put_doubles(struct writer *w, enum tetlod_type type, const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        if (type == TETLOD_FLOAT64) {
            uint64_t word;
            memcpy(&word, &values[i], 8);
            put_word(w, word, 8);
        } else {
            float value = (float)values[i];
            uint32_t word;
            memcpy(&word, &value, 4);
            put_word(w, word, 4);
        }
    }
    put_text(w, "\n");
}

static void put_mesh(struct writer *w, const struct tetmesh *mesh)
{
    static const char *const types[] = {"float", "double"};
    char line[128];
    put_text(w, "# vtk DataFile Version 3.0\ntetlod\nBINARY\nDATASET UNSTRUCTURED_GRID\n");
    snprintf(line, sizeof line, "POINTS %" PRIu32 " %s\n", mesh->vertex_count, types[mesh->position_type]);
    put_text(w, line);
    put_doubles(w, mesh->position_type, mesh->positions, 3 * (size_t)mesh->vertex_count);
    snprintf(line, sizeof line, "CELLS %" PRIu32 " %" PRIu64 "\n", mesh->tet_count, 5 * (uint64_t)mesh->tet_count);
    put_text(w, line);
    for (size_t c = 0; c < 4 * (size_t)mesh->tet_count; c++) {
        if (c % 4 == 0)
            put_word(w, 4, 4);
        put_word(w, mesh->corners[c], 4);
    }
    snprintf(line, sizeof line, "\nCELL_TYPES %" PRIu32 "\n", mesh->tet_count);
    put_text(w, line);
    for (uint32_t t = 0; t < mesh->tet_count; t++)
        put_word(w, VTK_TETRA, 4);
    snprintf(line, sizeof line, "\nPOINT_DATA %" PRIu32 "\nFIELD FieldData %" PRIu32 "\n", mesh->vertex_count,
             mesh->field_count);
    put_text(w, mesh->field_count ? line : "\n");
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = &mesh->fields[f];
        put_name(w, field->name);
        snprintf(line, sizeof line, " %" PRIu32 " %" PRIu32 " %s\n", field->components, mesh->vertex_count,
                 types[field->type]);
        put_text(w, line);
        put_doubles(w, field->type, field->values, (size_t)field->components * mesh->vertex_count);
    }
}

enum tetlod_status io_write_vtk(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    if (mesh->vertex_count > INT32_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "legacy VTK numbers points with 31 bits; write .vtu");
    struct writer w = {sink, array_new(BUFFER, 1), 0, TETLOD_OK};
    if (!w.buffer)
        return tetlodi_fail_nomem(error, "a buffer", BUFFER);
    put_mesh(&w, mesh);
    flush(&w);
    free(w.buffer);
    return w.status;
}
