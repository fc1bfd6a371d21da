/* SPDX-License-Identifier: BSD-3-Clause */
/* Writing VTU 1.0: raw appended data, in zlib blocks or plain, UInt64 headers, little-endian. Arrays are compressed
 * first, because the XML in front gives their offsets. */
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "format/fail.h"
#include "src/io/writers/cell_lists.h"
#include "src/io/writers/facts.h"
#include "src/io/writers/layout.h"
#include "src/io/writers/writers.h"
#include "src/mesh/ids.h"
#include "src/util/array.h"
#include "src/util/parallel.h"
#include "src/util/put.h"

enum {
    GROUP = 32, // blocks that are compressed at a time, on all threads
    BLOCK = 1 << 18,    // whole values of every type
    DEFLATE_LEVEL = 4,  // 6 takes twice the time for 1 % less
};

struct packed {
    unsigned char *bytes; /* owned: header and blocks; NULL without compression */
    size_t size;
};

static void store_word(unsigned char *out, uint64_t word)
{
    for (size_t b = 0; b < 8; b++)
        out[b] = (unsigned char)(word >> 8 * b);
}

/* ---- compression */

/* Blocks that threads fill and compress, each into its part of a buffer. */
struct group {
    const struct layout_array *array;
    uint64_t first;       /* block */
    uLong bound;          /* of a compressed block */
    unsigned char *plain; /* [worker * BLOCK] */
    unsigned char *packed; /* [block of the group * bound] */
    uLong sizes[GROUP];   /* 0: failed */
};

static void pack_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct group *group = context;
    const struct layout_array *array = group->array;
    size_t most = BLOCK / array->width;
    unsigned char *plain = group->plain + (size_t)worker * BLOCK;
    for (size_t b = begin; b < end; b++) {
        uint64_t first = (group->first + b) * most, left = array->rows * array->words - first;
        size_t count = left < most ? (size_t)left : most;
        uLong size = group->bound;
        layout_store(array, first, count, plain);
        bool good = compress2(group->packed + b * group->bound, &size, plain, (uLong)(count * array->width),
                              DEFLATE_LEVEL) == Z_OK;
        group->sizes[b] = good ? size : 0;
    }
}

static enum tetlod_status pack_group(struct group *group, uint64_t blocks, struct packed *out, size_t *capacity,
                                     unsigned threads, struct tetlod_error *error)
{
    size_t count = blocks - group->first < GROUP ? (size_t)(blocks - group->first) : GROUP;
    parallel_for(threads, count, 1, pack_range, group);
    for (size_t b = 0; b < count; b++) {
        if (!group->sizes[b] || !ARRAY_RESERVE(out->bytes, *capacity, out->size + group->sizes[b]))
            return tetlodi_fail_nomem(error, "compressing the output", group->bound);
        memcpy(out->bytes + out->size, group->packed + b * group->bound, group->sizes[b]);
        store_word(out->bytes + 24 + 8 * (group->first + b), group->sizes[b]);
        out->size += group->sizes[b];
    }
    return TETLOD_OK;
}

static enum tetlod_status pack(const struct layout_array *array, struct packed *out, struct tetlod_error *error)
{
    uint64_t total = array->rows * array->words * array->width, blocks = (total + BLOCK - 1) / BLOCK;
    size_t header = 8 * (3 + (size_t)blocks), capacity = 0;
    unsigned threads = blocks > 1 ? parallel_cores() : 1;
    threads = threads < GROUP ? threads : GROUP;
    struct group group = {.array = array, .bound = compressBound(BLOCK)};
    enum tetlod_status status = TETLOD_OK;
    group.plain = array_new(threads, BLOCK);
    group.packed = array_new(blocks < GROUP ? (size_t)blocks : GROUP, group.bound);
    if (!group.plain || !group.packed || !ARRAY_RESERVE(out->bytes, capacity, header))
        status = tetlodi_fail_nomem(error, "an array of the output", total);
    out->size = header;
    for (; status == TETLOD_OK && group.first < blocks; group.first += GROUP)
        status = pack_group(&group, blocks, out, &capacity, threads, error);
    free(group.plain);
    free(group.packed);
    if (status != TETLOD_OK)
        return status;
    store_word(out->bytes, blocks);
    store_word(out->bytes + 8, BLOCK);
    store_word(out->bytes + 16, total % BLOCK);
    return TETLOD_OK;
}

/* ---- the file */

struct writer {
    const struct tetmesh *mesh;
    struct put put;
    struct layout_array *arrays; /* owned: the fields, those of cells, then points, connectivity, offsets, types */
    struct packed *packed;       /* owned, by array */
    struct cell_lists lists;     /* of a mesh of cells */
    uint64_t offset;             /* of the next array in the appended data */
    uint32_t count, next;
};

static const char *type_of(const struct layout_array *array)
{
    if (array->width == 1)
        return "UInt8";
    bool integer = array->integer || array->kind != ROW_VALUES;
    return array->width == 4 ? (integer ? "Int32" : "Float32") : (integer ? "Int64" : "Float64");
}

static void put_array(struct writer *w, const char *name, const char *unit)
{
    const struct layout_array *array = &w->arrays[w->next];
    uint32_t components = array->kind == ROW_VALUES ? array->words : 1;
    put_format(&w->put, "        <DataArray type=\"%s\" Name=\"", type_of(array));
    put_escaped(&w->put, name);
    put_format(&w->put, "\" NumberOfComponents=\"%" PRIu32 "\" format=\"appended\" offset=\"%" PRIu64 "\"", components,
               w->offset);
    if (*unit) {
        put_text(&w->put, ">" VTK_XML_UNIT);
        put_escaped(&w->put, unit);
        put_text(&w->put, VTK_XML_UNIT_END "</DataArray>\n");
    } else {
        put_text(&w->put, "/>\n");
    }
    w->offset += w->packed[w->next++].size;
}

/* What a program shows first: the first scalar and the first vector that are not ids. */
static void put_active(struct writer *w, const char *attribute, uint32_t components)
{
    uint32_t f = ids_first_other(w->mesh, components);
    if (f == TETLOD_NONE)
        return;
    put_text(&w->put, attribute);
    put_escaped(&w->put, w->mesh->fields[f].name);
    put_text(&w->put, "\"");
}

static void put_fields(struct writer *w, const struct point_field *fields, uint32_t count)
{
    for (uint32_t f = 0; f < count; f++)
        put_array(w, fields[f].name, fields[f].unit);
}

static void put_fact(struct put *put, const struct fact *fact)
{
    put_format(put, "      <DataArray type=\"%s\" Name=\"%s", fact->codes ? "UInt8" : "Float64", fact->name);
    if (fact->field) {
        put_text(put, " ");
        put_escaped(put, fact->field);
    }
    put_format(put, "\" NumberOfTuples=\"%zu\" format=\"ascii\">", fact->codes ? strlen(fact->codes) : 1);
    for (const char *code = fact->codes; code && *code; code++)
        put_format(put, code[1] ? "%d " : "%d", *code);
    if (!fact->codes)
        put_format(put, "%.17g", fact->value);
    put_text(put, "</DataArray>\n");
}

static void put_facts(struct put *put, const struct tetmesh *mesh)
{
    struct fact fact;
    for (uint32_t i = 0; fact_of(mesh, i, &fact); i++) {
        put_text(put, i ? "" : "    <FieldData>\n");
        put_fact(put, &fact);
    }
    put_text(put, fact_of(mesh, 0, &fact) ? "    </FieldData>\n" : "");
}

/* All that is in front of the arrays. */
static void put_head(struct writer *w, bool plain)
{
    const struct tetmesh *mesh = w->mesh;
    struct put *put = &w->put;
    put_format(put, "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"%s\" ",
               mesh->cells ? "2.2" : "1.0"); // before 2.1 the points of Lagrange hexahedra were in another order
    put_text(put, "byte_order=\"LittleEndian\" "
                  "header_type=\"UInt64\"");
    put_text(put, plain ? "" : " compressor=\"vtkZLibDataCompressor\"");
    put_text(put, ">\n  <UnstructuredGrid>\n");
    put_facts(put, mesh);
    put_format(put, "    <Piece NumberOfPoints=\"%" PRIu32 "\" NumberOfCells=\"%" PRIu32 "\">\n      <PointData",
               mesh->vertex_count,
               mesh->tet_count);
    put_active(w, " Scalars=\"", 1);
    put_active(w, " Vectors=\"", 3);
    put_text(put, ">\n");
    put_fields(w, mesh->fields, mesh->field_count);
    put_text(put, "      </PointData>\n");
    put_text(put, mesh->cell_field_count ? "      <CellData>\n" : "");
    put_fields(w, mesh->cell_fields, mesh->cell_field_count);
    put_text(put, mesh->cell_field_count ? "      </CellData>\n" : "");
    put_text(put, "      <Points>\n");
    put_array(w, "Points", "");
    put_text(put, "      </Points>\n      <Cells>\n");
    put_array(w, "connectivity", "");
    put_array(w, "offsets", "");
    put_array(w, "types", "");
    if (w->lists.face_count) {
        put_array(w, "faces", "");
        put_array(w, "faceoffsets", "");
    }
    put_text(put, "      </Cells>\n    </Piece>\n  </UnstructuredGrid>\n  <AppendedData encoding=\"raw\">\n   _");
}

static const char tail[] = "\n  </AppendedData>\n</VTKFile>\n";

static struct layout_array list_of(const uint32_t *list, size_t count, size_t width)
{
    return (struct layout_array){.kind = ROW_CORNERS, .words = 1, .width = width, .rows = count, .corners = list};
}

static void list_cells(const struct cell_lists *lists, struct layout_array *out)
{
    *out++ = list_of(lists->connectivity, lists->connectivity_count, 4);
    *out++ = list_of(lists->ends, lists->cell_count, 4);
    *out++ = list_of(lists->types, lists->cell_count, 1);
    if (!lists->face_count)
        return;
    *out++ = list_of(lists->faces, lists->face_count, 4);
    *out = list_of(lists->face_ends, lists->cell_count, 4);
}

static void list_arrays(const struct tetmesh *mesh, const struct cell_lists *lists, struct layout_array *out)
{
    const struct point_field positions = {.components = 3, .type = mesh->position_type, .values = mesh->positions};
    size_t wide = mesh->tet_count > INT32_MAX / 4 ? 8 : 4; // the last offset may not fit Int32
    for (uint32_t f = 0; f < mesh->field_count; f++)
        *out++ = layout_of_field(&mesh->fields[f], 1 + f, mesh->vertex_count);
    for (uint32_t f = 0; f < mesh->cell_field_count; f++)
        *out++ = layout_of_field(&mesh->cell_fields[f], 0, mesh->tet_count);
    *out++ = layout_of_field(&positions, 0, mesh->vertex_count);
    if (mesh->cells) {
        list_cells(lists, out);
        return;
    }
    *out++ = (struct layout_array){.kind = ROW_CORNERS, .words = 4, .width = wide, .rows = mesh->tet_count,
                                   .corners = mesh->corners};
    *out++ = (struct layout_array){.kind = ROW_END, .words = 1, .width = wide, .rows = mesh->tet_count};
    *out++ = (struct layout_array){.kind = ROW_TYPE, .words = 1, .width = 1, .rows = mesh->tet_count};
}

/* To be closed also after a failure. */
static enum tetlod_status writer_open(struct writer *w, const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                      struct tetlod_error *error)
{
    *w = (struct writer){.mesh = mesh, .count = mesh->field_count + mesh->cell_field_count + 4};
    if (mesh->cells) {
        TETLOD_TRY(cell_lists_make(&w->lists, mesh->cells, error));
        w->count += w->lists.face_count ? 2 : 0;
    }
    w->arrays = array_new(w->count, sizeof *w->arrays);
    w->packed = array_zero(w->count, sizeof *w->packed);
    if (!w->arrays || !w->packed)
        return tetlodi_fail_nomem(error, "the list of arrays", w->count * sizeof *w->arrays);
    list_arrays(mesh, &w->lists, w->arrays);
    return put_init(&w->put, sink, false, error);
}

static void writer_close(struct writer *w)
{
    for (uint32_t a = 0; w->packed && a < w->count; a++)
        free(w->packed[a].bytes);
    free(w->arrays);
    free(w->packed);
    cell_lists_fini(&w->lists);
}

enum tetlod_status io_write_vtu(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    struct writer w;
    enum tetlod_status status = writer_open(&w, mesh, sink, error);
    for (uint32_t a = 0; status == TETLOD_OK && a < w.count; a++)
        status = pack(&w.arrays[a], &w.packed[a], error);
    if (status == TETLOD_OK) {
        put_head(&w, false);
        for (uint32_t a = 0; a < w.count; a++)
            put_bytes(&w.put, w.packed[a].bytes, w.packed[a].size);
        put_text(&w.put, tail);
    }
    enum tetlod_status written = put_finish(&w.put);
    writer_close(&w);
    return status == TETLOD_OK ? written : status;
}

/* ---- piece by piece ---- */

static enum tetlod_status lay_out(struct io_layout *layout, struct writer *w, struct tetlod_error *error)
{
    for (uint32_t a = 0; a < w->count; a++)
        w->packed[a].size = 8 + (size_t)(w->arrays[a].rows * w->arrays[a].words * w->arrays[a].width);
    put_head(w, true);
    for (uint32_t a = 0; a < w->count; a++) {
        put_word(&w->put, w->packed[a].size - 8, 8);
        put_flush(&w->put);
        TETLOD_TRY(layout_add(layout, &w->arrays[a], error));
    }
    put_text(&w->put, tail);
    put_flush(&w->put);
    return w->put.status == TETLOD_OK ? TETLOD_OK : tetlodi_fail_nomem(error, "a mesh file", 0);
}

enum tetlod_status io_layout_vtu(struct io_layout **out, const struct tetmesh *shape, struct tetlod_error *error)
{
    struct writer w;
    TETLOD_TRY(layout_start(out, error));
    const struct tetlodi_sink sink = layout_sink(*out);
    enum tetlod_status status = writer_open(&w, shape, &sink, error);
    if (status == TETLOD_OK)
        status = lay_out(*out, &w, error);
    enum tetlod_status written = put_finish(&w.put);
    writer_close(&w);
    return layout_end(out, status == TETLOD_OK ? written : status);
}

enum tetlod_status io_write_vtu_plain(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                      struct tetlod_error *error)
{
    return layout_write_whole(io_layout_vtu, mesh, sink, error);
}
