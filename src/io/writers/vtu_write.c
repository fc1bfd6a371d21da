/* SPDX-License-Identifier: BSD-3-Clause */
/* Writing VTU 1.0: raw appended data, in zlib blocks or plain, UInt64 headers, little-endian. All arrays are packed first,
 * because the XML in front gives their offsets. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "format/fail.h"
#include "src/io/writers/writers.h"
#include "src/io/writers/layout.h"
#include "src/util/array.h"
#include "src/util/parallel.h"
#include "src/util/put.h"

enum {
    GROUP = 32, // blocks that are compressed at a time, on all threads
    BLOCK = 1 << 18,    // whole values of every type
    DEFLATE_LEVEL = 4,  // 6 takes twice the time for 1 % less
    VTK_TETRA = 10,
};

/* Where an array's values come from, one after the other. */
enum kind { FLOAT32, FLOAT64, INT32, INT64, UINT8 };

struct column {
    enum kind kind;
    uint64_t count;
    const double *values;    /* FLOAT32, FLOAT64; whole numbers for INT32, INT64 */
    const uint32_t *indices; /* INT32, INT64 without values: these, or 4, 8, 12, ... if NULL; UINT8: VTK_TETRA throughout */
};

struct packed {
    unsigned char *bytes; /* owned: header and blocks */
    size_t size;
};

static size_t width_of(enum kind kind)
{
    return kind == UINT8 ? 1 : kind == FLOAT64 || kind == INT64 ? 8 : 4;
}

static void store(unsigned char *out, uint64_t word, size_t size)
{
    for (size_t b = 0; b < size; b++)
        out[b] = (unsigned char)(word >> 8 * b);
}

static void store_double(unsigned char *out, double value)
{
    uint64_t word;
    memcpy(&word, &value, sizeof word);
    store(out, word, sizeof word);
}

static void store_float(unsigned char *out, double value)
{
    float narrow = (float)value;
    uint32_t word;
    memcpy(&word, &narrow, sizeof word);
    store(out, word, sizeof word);
}

static uint64_t integer_at(const struct column *column, uint64_t i)
{
    if (column->values)
        return (uint64_t)(int64_t)column->values[i];
    return column->indices ? column->indices[i] : 4 * (i + 1);
}

/* The values first .. first + count; a loop for each kind, because compilers make single stores of them. */
static void fill(const struct column *column, uint64_t first, size_t count, unsigned char *out)
{
    switch (column->kind) {
    case FLOAT64:
        for (size_t i = 0; i < count; i++)
            store_double(out + 8 * i, column->values[first + i]);
        break;
    case FLOAT32:
        for (size_t i = 0; i < count; i++)
            store_float(out + 4 * i, column->values[first + i]);
        break;
    case INT32:
        for (size_t i = 0; i < count; i++)
            store(out + 4 * i, integer_at(column, first + i), 4);
        break;
    case INT64:
        for (size_t i = 0; i < count; i++)
            store(out + 8 * i, integer_at(column, first + i), 8);
        break;
    case UINT8:
        memset(out, VTK_TETRA, count);
        break;
    }
}

/* Blocks that threads fill and compress, each into its part of a buffer. */
struct group {
    const struct column *column;
    uint64_t first;       /* block */
    uLong bound;          /* of a compressed block */
    unsigned char *plain; /* [worker * BLOCK] */
    unsigned char *packed; /* [block of the group * bound] */
    uLong sizes[GROUP];   /* 0: failed */
};

static void pack_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct group *group = context;
    const struct column *column = group->column;
    size_t width = width_of(column->kind), most = BLOCK / width;
    unsigned char *plain = group->plain + (size_t)worker * BLOCK;
    for (size_t b = begin; b < end; b++) {
        uint64_t first = (group->first + b) * most, left = column->count - first;
        size_t count = left < most ? (size_t)left : most;
        uLong size = group->bound;
        fill(column, first, count, plain);
        group->sizes[b] = compress2(group->packed + b * group->bound, &size, plain, (uLong)(count * width), DEFLATE_LEVEL) == Z_OK
                              ? size
                              : 0;
    }
}

static enum tetlod_status pack_group(struct group *group, uint64_t blocks, struct packed *out, size_t *capacity,
                                     unsigned threads, struct tetlod_error *error)
{
    size_t count = blocks - group->first < GROUP ? (size_t)(blocks - group->first) : GROUP;
    parallel_for(threads, count, 1, pack_range, group);
    for (size_t b = 0; b < count; b++) {
        if (!group->sizes[b] || !array_reserve((void **)&out->bytes, capacity, out->size + group->sizes[b], 1))
            return tetlodi_fail_nomem(error, "compressing the output", group->bound);
        memcpy(out->bytes + out->size, group->packed + b * group->bound, group->sizes[b]);
        store(out->bytes + 24 + 8 * (group->first + b), group->sizes[b], 8);
        out->size += group->sizes[b];
    }
    return TETLOD_OK;
}

static enum tetlod_status pack(const struct column *column, struct packed *out, struct tetlod_error *error)
{
    uint64_t total = column->count * width_of(column->kind), blocks = (total + BLOCK - 1) / BLOCK;
    size_t header = 8 * (3 + (size_t)blocks), capacity = 0;
    unsigned threads = blocks > 1 ? parallel_cores() : 1;
    threads = threads < GROUP ? threads : GROUP;
    struct group group = {.column = column, .bound = compressBound(BLOCK)};
    enum tetlod_status status = TETLOD_OK;
    group.plain = array_new(threads, BLOCK);
    group.packed = array_new(blocks < GROUP ? (size_t)blocks : GROUP, group.bound);
    if (!group.plain || !group.packed || !array_reserve((void **)&out->bytes, &capacity, header, 1))
        status = tetlodi_fail_nomem(error, "an array of the output", total);
    out->size = header;
    for (; status == TETLOD_OK && group.first < blocks; group.first += GROUP)
        status = pack_group(&group, blocks, out, &capacity, threads, error);
    free(group.plain);
    free(group.packed);
    if (status != TETLOD_OK)
        return status;
    store(out->bytes, blocks, 8);
    store(out->bytes + 8, BLOCK, 8);
    store(out->bytes + 16, total % BLOCK, 8);
    return TETLOD_OK;
}

/* The same without compression: size and values. */
static enum tetlod_status pack_plain(const struct column *column, struct packed *out, struct tetlod_error *error)
{
    uint64_t total = column->count * width_of(column->kind);
    out->bytes = array_new((size_t)total + 8, 1);
    if (!out->bytes)
        return tetlodi_fail_nomem(error, "an array of the output", total);
    out->size = (size_t)total + 8;
    store(out->bytes, total, 8);
    fill(column, 0, (size_t)column->count, out->bytes + 8);
    return TETLOD_OK;
}

struct writer {
    const struct tetmesh *mesh;
    const struct tetlodi_sink *sink;
    struct tetlod_error *error;
    bool plain;
    struct packed *arrays; /* the fields, those of cells, then points, connectivity, offsets, types */
    uint64_t offset;       /* of the next array in the appended data */
    uint32_t next;
    enum tetlod_status status; /* of the sink; nothing is written after a failure */
};

static void put(struct writer *w, const void *bytes, size_t size)
{
    if (w->status == TETLOD_OK)
        w->status = w->sink->write(w->sink->opaque, bytes, size);
}

static void write_text(struct writer *w, const char *text)
{
    put(w, text, strlen(text));
}

static void put_name(struct writer *w, const char *text)
{
    for (; *text; text++) {
        const char *escape = xml_escape(*text);
        put(w, escape ? escape : text, escape ? strlen(escape) : 1);
    }
}

static void put_array(struct writer *w, const char *type, const char *name, uint32_t components, const char *unit)
{
    char line[160];
    snprintf(line, sizeof line, "        <DataArray type=\"%s\" Name=\"", type);
    write_text(w, line);
    put_name(w, name);
    snprintf(line, sizeof line, "\" NumberOfComponents=\"%" PRIu32 "\" format=\"appended\" offset=\"%" PRIu64 "\"", components,
             w->offset);
    write_text(w, line);
    if (*unit) {
        write_text(w, ">" VTK_XML_UNIT);
        put_name(w, unit);
        write_text(w, VTK_XML_UNIT_END "</DataArray>\n");
    } else {
        write_text(w, "/>\n");
    }
    w->offset += w->arrays[w->next++].size;
}

/* What a program shows first: the first scalar and the first vector. */
static void put_active(struct writer *w, const char *attribute, uint32_t components)
{
    for (uint32_t f = 0; f < w->mesh->field_count; f++)
        if (w->mesh->fields[f].components == components) {
            write_text(w, attribute);
            put_name(w, w->mesh->fields[f].name);
            write_text(w, "\"");
            return;
        }
}

static bool is_wide(const struct tetmesh *mesh)
{
    return mesh->tet_count > INT32_MAX / 4; // then the last offset does not fit Int32
}

/* Integers stay integers. */
static enum kind kind_of(const struct point_field *field, size_t count)
{
    bool fits = field->is_integer;
    if (!field->is_integer)
        return field->type == TETLOD_FLOAT32 ? FLOAT32 : FLOAT64;
    for (size_t i = 0; i < count; i++) {
        if (!(fabs(field->values[i]) <= 0x1p53)) // also NaN: an option may have changed them
            return FLOAT64;
        fits &= fabs(field->values[i]) <= INT32_MAX;
    }
    return fits ? INT32 : INT64;
}

static void put_fields(struct writer *w, const struct point_field *fields, uint32_t count, size_t rows)
{
    static const char *const types[] = {"Float32", "Float64", "Int32", "Int64"};
    for (uint32_t f = 0; f < count; f++)
        put_array(w, types[kind_of(&fields[f], rows * fields[f].components)], fields[f].name, fields[f].components, fields[f].unit);
}

static void put_cell_data(struct writer *w)
{
    const struct tetmesh *mesh = w->mesh;
    if (!mesh->cell_field_count)
        return;
    write_text(w, "      <CellData>\n");
    put_fields(w, mesh->cell_fields, mesh->cell_field_count, mesh->tet_count);
    write_text(w, "      </CellData>\n");
}

/* All that is in front of the arrays. */
static void put_head(struct writer *w)
{
    const struct tetmesh *mesh = w->mesh;
    const char *float_types[] = {"Float32", "Float64"}, *int_type = is_wide(mesh) ? "Int64" : "Int32";
    char line[160];
    write_text(w, "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" "
                "header_type=\"UInt64\"");
    write_text(w, w->plain ? "" : " compressor=\"vtkZLibDataCompressor\"");
    write_text(w, ">\n  <UnstructuredGrid>\n");
    snprintf(line, sizeof line, "    <Piece NumberOfPoints=\"%" PRIu32 "\" NumberOfCells=\"%" PRIu32 "\">\n      <PointData",
             mesh->vertex_count, mesh->tet_count);
    write_text(w, line);
    put_active(w, " Scalars=\"", 1);
    put_active(w, " Vectors=\"", 3);
    write_text(w, ">\n");
    put_fields(w, mesh->fields, mesh->field_count, mesh->vertex_count);
    write_text(w, "      </PointData>\n");
    put_cell_data(w);
    write_text(w, "      <Points>\n");
    put_array(w, float_types[mesh->position_type], "Points", 3, "");
    write_text(w, "      </Points>\n      <Cells>\n");
    put_array(w, int_type, "connectivity", 1, "");
    put_array(w, int_type, "offsets", 1, "");
    put_array(w, "UInt8", "types", 1, "");
    write_text(w, "      </Cells>\n    </Piece>\n  </UnstructuredGrid>\n  <AppendedData encoding=\"raw\">\n   _");
}

static const char tail[] = "\n  </AppendedData>\n</VTKFile>\n";

static enum tetlod_status pack_all(const struct tetmesh *mesh, bool plain, struct packed *arrays, struct tetlod_error *error)
{
    static const enum kind float_kinds[] = {[TETLOD_FLOAT32] = FLOAT32, [TETLOD_FLOAT64] = FLOAT64};
    enum tetlod_status (*pack_one)(const struct column *, struct packed *, struct tetlod_error *) = plain ? pack_plain : pack;
    enum kind index_kind = is_wide(mesh) ? INT64 : INT32;
    uint64_t vertices = mesh->vertex_count, tets = mesh->tet_count;
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = &mesh->fields[f];
        struct column column = {kind_of(field, (size_t)vertices * field->components), field->components * vertices, field->values, NULL};
        TETLOD_TRY(pack_one(&column, arrays++, error));
    }
    for (uint32_t f = 0; f < mesh->cell_field_count; f++) {
        const struct point_field *field = &mesh->cell_fields[f];
        struct column column = {kind_of(field, (size_t)tets * field->components), field->components * tets, field->values, NULL};
        TETLOD_TRY(pack_one(&column, arrays++, error));
    }
    const struct column cells[] = {
        {float_kinds[mesh->position_type], 3 * vertices, mesh->positions, NULL},
        {index_kind, 4 * tets, NULL, mesh->corners},
        {index_kind, tets, NULL, NULL},
        {UINT8, tets, NULL, NULL},
    };
    for (size_t i = 0; i < sizeof cells / sizeof *cells; i++)
        TETLOD_TRY(pack_one(&cells[i], arrays++, error));
    return TETLOD_OK;
}

static enum tetlod_status write_vtu(const struct tetmesh *mesh, bool plain, const struct tetlodi_sink *sink,
                                    struct tetlod_error *error)
{
    size_t count = (size_t)mesh->field_count + mesh->cell_field_count + 4;
    struct writer w = {mesh, sink, error, plain, array_zero(count, sizeof *w.arrays), 0, 0, TETLOD_OK};
    if (!w.arrays)
        return tetlodi_fail_nomem(error, "the list of arrays", count * sizeof *w.arrays);
    enum tetlod_status status = pack_all(mesh, plain, w.arrays, error);
    if (status == TETLOD_OK) {
        put_head(&w);
        for (uint32_t a = 0; a < w.next; a++)
            put(&w, w.arrays[a].bytes, w.arrays[a].size);
        write_text(&w, tail);
        status = w.status;
    }
    for (size_t a = 0; a < count; a++)
        free(w.arrays[a].bytes);
    free(w.arrays);
    return status;
}

enum tetlod_status io_write_vtu(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    return write_vtu(mesh, false, sink, error);
}

enum tetlod_status io_write_vtu_plain(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                      struct tetlod_error *error)
{
    return write_vtu(mesh, true, sink, error);
}

/* The arrays of a file without compression, in its order. */
static void list_arrays(const struct tetmesh *shape, struct layout_array *out)
{
    static const size_t float_widths[] = {[TETLOD_FLOAT32] = 4, [TETLOD_FLOAT64] = 8};
    size_t wide = is_wide(shape) ? 8 : 4;
    uint64_t vertices = shape->vertex_count, tets = shape->tet_count;
    for (uint32_t f = 0; f < shape->field_count; f++) {
        const struct point_field *field = &shape->fields[f];
        *out++ = (struct layout_array){.kind = ROW_VALUES, .column = 1 + f, .words = field->components, .width = float_widths[field->type], .rows = vertices};
    }
    for (uint32_t f = 0; f < shape->cell_field_count; f++) {
        const struct point_field *field = &shape->cell_fields[f];
        enum kind kind = kind_of(field, (size_t)tets * field->components);
        *out++ = (struct layout_array){.kind = ROW_VALUES, .words = field->components, .width = width_of(kind), .integer = kind == INT32 || kind == INT64,
                                       .rows = tets, .values = field->values};
    }
    *out++ = (struct layout_array){.kind = ROW_VALUES, .words = 3, .width = float_widths[shape->position_type], .rows = vertices};
    *out++ = (struct layout_array){.kind = ROW_CORNERS, .words = 4, .width = wide, .rows = tets};
    *out++ = (struct layout_array){.kind = ROW_END, .words = 1, .width = wide, .rows = tets};
    *out++ = (struct layout_array){.kind = ROW_TYPE, .words = 1, .width = 1, .rows = tets};
}

static enum tetlod_status lay_out(struct io_layout *layout, struct writer *w, const struct layout_array *arrays, size_t count)
{
    for (size_t a = 0; a < count; a++)
        w->arrays[a].size = 8 + (size_t)(arrays[a].rows * arrays[a].words * arrays[a].width);
    put_head(w);
    for (size_t a = 0; a < count && w->status == TETLOD_OK; a++) {
        unsigned char size[8];
        store(size, w->arrays[a].size - 8, sizeof size);
        put(w, size, sizeof size);
        TETLOD_TRY(layout_add(layout, &arrays[a], w->error));
    }
    write_text(w, tail);
    return w->status == TETLOD_OK ? TETLOD_OK : tetlodi_fail_nomem(w->error, "a mesh file", 0);
}

enum tetlod_status io_layout_vtu(struct io_layout **out, const struct tetmesh *shape, struct tetlod_error *error)
{
    size_t count = (size_t)shape->field_count + shape->cell_field_count + 4;
    TETLOD_TRY(layout_start(out, error));
    const struct tetlodi_sink sink = layout_sink(*out);
    struct layout_array *arrays = array_new(count, sizeof *arrays);
    struct writer w = {shape, &sink, error, true, array_zero(count, sizeof *w.arrays), 0, 0, TETLOD_OK};
    enum tetlod_status status = arrays && w.arrays ? TETLOD_OK : tetlodi_fail_nomem(error, "a mesh file", count * sizeof *arrays);
    if (status == TETLOD_OK) {
        list_arrays(shape, arrays);
        status = lay_out(*out, &w, arrays, count);
    }
    free(arrays);
    free(w.arrays);
    if (status != TETLOD_OK) {
        io_layout_free(*out);
        *out = NULL;
    }
    return status;
}
