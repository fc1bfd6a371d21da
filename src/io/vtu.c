/* SPDX-License-Identifier: BSD-3-Clause */
/* Reading VTU: the XML unstructured grid of VTK, versions 0.1 to 2.x, any number of pieces. */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/formats.h"
#include "src/io/vtu_document.h"
#include "src/util/array.h"

bool vtu_sniff(const unsigned char *bytes, size_t size)
{
    size_t start = size >= 3 && memcmp(bytes, "\xef\xbb\xbf", 3) == 0 ? 3 : 0;
    struct text text = {(const char *)bytes + start, (const char *)bytes + size};
    struct text word = text_word(&text);
    size_t length = (size_t)(word.end - word.at);
    return length >= 5 && (memcmp(word.at, "<?xml", 5) == 0 || (length >= 8 && memcmp(word.at, "<VTKFile", 8) == 0));
}

/* A piece's array of count x components values, which are in the file. */
static enum tetlod_status require_array(const struct vtu_document *document, const struct vtu_piece *piece,
                                        enum vtu_section section, const char *name, uint64_t components, uint64_t count,
                                        const struct vtu_array **out, struct tetlod_error *error)
{
    const struct vtu_array *array = vtu_find(document, piece, section, name);
    *out = array;
    if (!array)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "piece %td has no array '%.60s'", piece - document->pieces,
                            name ? name : "Points");
    if (array->components != components)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "array '%.60s' (line %llu) has %llu components, not %llu",
                            array->name, (unsigned long long)array->line, (unsigned long long)array->components,
                            (unsigned long long)components);
    if (count > UINT64_MAX / components)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "a count of %llu is more than a file can hold",
                            (unsigned long long)count);
    return vtu_check_count(document, array, count * components, error);
}

/* float32 if that is what every piece has, float64 for all else. */
static void merge_type(enum tetlod_type *type, const struct vtu_array *array)
{
    if (array->type != VALUE_FLOAT32)
        *type = TETLOD_FLOAT64;
}

static enum tetlod_status read_points(struct tetmesh *mesh, const struct vtu_document *document,
                                      struct tetlod_error *error)
{
    uint64_t count = 0;
    enum tetlod_type type = TETLOD_FLOAT32;
    const struct vtu_array *array;
    for (size_t p = 0; p < document->piece_count; p++) {
        const struct vtu_piece *piece = &document->pieces[p];
        if (piece->points == 0)
            continue;
        TETLOD_TRY(require_array(document, piece, VTU_POINTS, NULL, 3, piece->points, &array, error));
        merge_type(&type, array);
        count += piece->points;
    }
    TETLOD_TRY(assemble_points(mesh, count, type, error));
    double *positions = mesh->positions;
    for (size_t p = 0; p < document->piece_count; p++) {
        const struct vtu_piece *piece = &document->pieces[p];
        if (piece->points == 0)
            continue;
        array = vtu_find(document, piece, VTU_POINTS, NULL);
        TETLOD_TRY(vtu_doubles(document, array, 3 * (size_t)piece->points, positions, error));
        positions += 3 * (size_t)piece->points;
    }
    return TETLOD_OK;
}

/* The field that the first piece calls `like`, over all pieces. */
static enum tetlod_status read_field(struct tetmesh *mesh, const struct vtu_document *document,
                                     const struct vtu_array *like, struct tetlod_error *error)
{
    enum tetlod_type type = TETLOD_FLOAT32;
    const struct vtu_array *array;
    if (like->components == 0)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "array '%.60s' (line %llu) has no components", like->name,
                            (unsigned long long)like->line);
    for (size_t p = 0; p < document->piece_count; p++) {
        const struct vtu_piece *piece = &document->pieces[p];
        if (piece->points == 0)
            continue;
        TETLOD_TRY(require_array(document, piece, VTU_POINT_DATA, like->name, like->components, piece->points, &array,
                                 error));
        merge_type(&type, array);
    }
    TETLOD_TRY(assemble_field(mesh, like->name, like->components, type, error));
    double *values = mesh->fields[mesh->field_count - 1].values;
    for (size_t p = 0; p < document->piece_count; p++) {
        const struct vtu_piece *piece = &document->pieces[p];
        size_t count = (size_t)(piece->points * like->components);
        array = vtu_find(document, piece, VTU_POINT_DATA, like->name);
        if (count)
            TETLOD_TRY(vtu_doubles(document, array, count, values, error));
        values += count;
    }
    return TETLOD_OK;
}

static enum tetlod_status read_fields(struct tetmesh *mesh, const struct vtu_document *document,
                                      struct io_report *report, struct tetlod_error *error)
{
    const struct vtu_piece *piece = document->pieces;
    while (piece->points == 0)
        piece++;
    for (size_t a = piece->first_array; a < piece->array_end; a++) {
        const struct vtu_array *array = &document->arrays[a];
        if (array->section != VTU_POINT_DATA)
            continue;
        if (vtu_find(document, piece, VTU_POINT_DATA, array->name) != array)
            report->skipped_arrays++; // a second one of that name could not be told from the first
        else
            TETLOD_TRY(read_field(mesh, document, array, error));
    }
    return TETLOD_OK;
}

struct piece_cells {
    int64_t *offsets, *connectivity, *types;
    unsigned char *narrow_types;
};

static void piece_cells_fini(struct piece_cells *cells)
{
    free(cells->offsets);
    free(cells->connectivity);
    free(cells->types);
    free(cells->narrow_types);
}

static enum tetlod_status load_cells(const struct vtu_document *document, const struct vtu_piece *piece,
                                     struct piece_cells *cells, struct tetlod_error *error)
{
    const struct vtu_array *types, *offsets, *connectivity;
    TETLOD_TRY(require_array(document, piece, VTU_CELLS, "types", 1, piece->cells, &types, error));
    TETLOD_TRY(require_array(document, piece, VTU_CELLS, "offsets", 1, piece->cells, &offsets, error));
    TETLOD_TRY(require_array(document, piece, VTU_CELLS, "connectivity", 1, 0, &connectivity, error));
    size_t count = (size_t)piece->cells;
    cells->types = array_new(count, sizeof *cells->types);
    cells->narrow_types = array_new(count, 1);
    cells->offsets = array_new(count + 1, sizeof *cells->offsets);
    if (!cells->types || !cells->narrow_types || !cells->offsets)
        return tetlodi_fail_nomem(error, "the cells", (uint64_t)count * 17);
    TETLOD_TRY(vtu_ints(document, types, count, cells->types, error));
    cells->offsets[0] = 0;
    TETLOD_TRY(vtu_ints(document, offsets, count, cells->offsets + 1, error));
    for (size_t c = 0; c < count; c++)
        cells->narrow_types[c] = (unsigned char)(cells->types[c] < 0 || cells->types[c] > 255 ? 255 : cells->types[c]);
    int64_t corners = cells->offsets[count];
    if (corners < 0)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "array 'offsets' (line %llu): its last value %lld is negative",
                            (unsigned long long)offsets->line, (long long)corners);
    TETLOD_TRY(vtu_check_count(document, connectivity, (uint64_t)corners, error));
    cells->connectivity = array_new((size_t)corners, sizeof *cells->connectivity);
    if (!cells->connectivity)
        return tetlodi_fail_nomem(error, "the cells", (uint64_t)corners * 8);
    return vtu_ints(document, connectivity, (size_t)corners, cells->connectivity, error);
}

static enum tetlod_status read_cells(struct tetmesh *mesh, const struct vtu_document *document,
                                     struct io_report *report, struct tetlod_error *error)
{
    uint32_t first_point = 0;
    for (size_t p = 0; p < document->piece_count; p++) {
        const struct vtu_piece *piece = &document->pieces[p];
        struct piece_cells loaded = {0};
        if (piece->cells == 0) {
            first_point += (uint32_t)piece->points;
            continue;
        }
        enum tetlod_status status = load_cells(document, piece, &loaded, error);
        if (status == TETLOD_OK) {
            struct vtk_cells cells = {piece->cells, (uint64_t)loaded.offsets[piece->cells], loaded.narrow_types,
                                      loaded.offsets, loaded.connectivity};
            status = assemble_vtk_cells(mesh, &cells, first_point, (uint32_t)piece->points, report, error);
        }
        piece_cells_fini(&loaded);
        TETLOD_TRY(status);
        first_point += (uint32_t)piece->points;
    }
    return TETLOD_OK;
}

enum tetlod_status vtu_read(struct tetmesh *mesh, const struct io_input *input, struct io_report *report,
                            struct tetlod_error *error)
{
    struct vtu_document document;
    enum tetlod_status status;
    TETLOD_TRY_DONE(vtu_parse(&document, input->bytes, input->size, report, error));
    TETLOD_TRY_DONE(read_points(mesh, &document, error));
    if (mesh->vertex_count == 0) {
        status = tetlodi_fail(error, TETLOD_ERR_MESH, "there is no point in it");
        goto done;
    }
    TETLOD_TRY_DONE(read_fields(mesh, &document, report, error));
    status = read_cells(mesh, &document, report, error);
done:
    vtu_document_fini(&document);
    return status;
}
