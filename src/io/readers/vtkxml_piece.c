/* SPDX-License-Identifier: BSD-3-Clause */
/* One piece of a VTK file as a block: points, which structured kinds may leave out, cells, and the values at both. */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/readers/vtkxml_document.h"
#include "src/io/services/pieces.h"
#include "src/util/array.h"

struct reader {
    const struct vtkxml_document *document;
    const struct vtkxml_piece *piece;
    struct block *block;
    struct io_report *report;
    struct tetlod_error *error;
    uint32_t range, ranges; /* of the points and of the cells; of structured kinds there is one */
    struct vtkxml_slice points, cells;
};

/* Of so many points or cells those that are read. */
static struct vtkxml_slice slice_of(const struct reader *r, uint64_t count)
{
    uint64_t first = range_begin(count, r->range, r->ranges);
    return (struct vtkxml_slice){count, first, range_begin(count, r->range + 1, r->ranges) - first};
}

/* Of rows with so many values. */
static struct vtkxml_slice slice_times(struct vtkxml_slice rows, uint64_t width)
{
    return (struct vtkxml_slice){rows.all * width, rows.first * width, rows.count * width};
}

/* A piece's array of count x components values, which are in the file. */
static enum tetlod_status require_array(const struct reader *r, enum vtkxml_section section, const char *name,
                                        uint64_t components, uint64_t count, const struct vtkxml_array **out)
{
    const struct vtkxml_array *array = vtkxml_find(r->document, r->piece, section, name);
    *out = array;
    if (!array)
        return tetlodi_fail(r->error, TETLOD_ERR_MESH, "piece %td has no array '%.60s'",
                            r->piece - r->document->pieces, name ? name : "Points");
    if (array->components != components)
        return tetlodi_fail(r->error, TETLOD_ERR_MESH, "array '%.60s' (line %llu) has %llu components, not %llu",
                            array->name, (unsigned long long)array->line, (unsigned long long)array->components,
                            (unsigned long long)components);
    if (count > UINT64_MAX / components)
        return tetlodi_fail(r->error, TETLOD_ERR_MESH, "a count of %llu is more than a file can hold",
                            (unsigned long long)count);
    return vtkxml_check_count(r->document, array, count * components, r->error);
}

static enum tetlod_type type_of(const struct vtkxml_array *array)
{
    return array->type == VALUE_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
}

static enum tetlod_status read_points(struct reader *r)
{
    const struct vtkxml_array *array;
    TETLOD_TRY(require_array(r, VTKXML_POINTS, NULL, 3, r->points.all, &array));
    TETLOD_TRY(assemble_points(&r->block->mesh, r->points.count, type_of(array), r->error));
    return vtkxml_values(r->document, array, slice_times(r->points, 3), VTKXML_DOUBLES, r->block->mesh.positions,
                         r->error);
}

/* ---- structured kinds */

/* Points along the axes; their number is bounded by the values that the piece has of them, or by their cells'. */
static enum tetlod_status count_structured(struct reader *r)
{
    uint64_t points = 1, cells = 1;
    for (int d = 0; d < 3; d++) {
        uint64_t n = (uint64_t)(r->piece->extent[2 * d + 1] - r->piece->extent[2 * d]) + 1;
        if (n > TETLOD_NONE / points)
            return tetlodi_fail(r->error, TETLOD_ERR_MESH, "the extent of piece %td has more points than fit",
                                r->piece - r->document->pieces);
        points *= n;
        cells *= n > 1 ? n - 1 : 1;
        r->block->dims[d] = (uint32_t)n;
    }
    r->points = vtkxml_whole(points);
    r->cells = vtkxml_whole(cells);
    return TETLOD_OK;
}

/* An array of values at points or of cells bounds how many points a file of this size can mean. */
static enum tetlod_status check_structured(const struct reader *r)
{
    for (size_t a = r->piece->first_array; a < r->piece->array_end; a++) {
        const struct vtkxml_array *array = &r->document->arrays[a];
        bool cell = array->section == VTKXML_CELL_DATA;
        if (cell || array->section == VTKXML_POINT_DATA)
            return vtkxml_check_count(r->document, array, cell ? r->cells.all : r->points.all, r->error);
    }
    return tetlodi_fail(r->error, TETLOD_ERR_MESH, "piece %td has values neither at points nor of cells",
                        r->piece - r->document->pieces);
}

static enum tetlod_status read_coordinates(const struct reader *r, double *axes[3], enum tetlod_type *type)
{
    size_t axis = 0;
    *type = TETLOD_FLOAT32;
    for (size_t a = r->piece->first_array; a < r->piece->array_end && axis < 3; a++) {
        const struct vtkxml_array *array = &r->document->arrays[a];
        if (array->section != VTKXML_COORDINATES)
            continue;
        uint32_t count = r->block->dims[axis];
        TETLOD_TRY(vtkxml_check_count(r->document, array, count, r->error));
        axes[axis] = array_new(count, sizeof **axes);
        if (!axes[axis])
            return tetlodi_fail_nomem(r->error, "the coordinates", (uint64_t)count * 8);
        TETLOD_TRY(vtkxml_values(r->document, array, vtkxml_whole(count), VTKXML_DOUBLES, axes[axis++], r->error));
        *type = type_of(array) == TETLOD_FLOAT64 ? TETLOD_FLOAT64 : *type;
    }
    return axis == 3 ? TETLOD_OK
                     : tetlodi_fail(r->error, TETLOD_ERR_MESH, "piece %td has not three arrays of Coordinates",
                                    r->piece - r->document->pieces);
}

static void image_point(const struct reader *r, const uint32_t at[3], double out[3])
{
    const struct vtkxml_document *d = r->document;
    double step[3];
    for (int k = 0; k < 3; k++)
        step[k] = (double)(r->piece->extent[2 * k] + (int64_t)at[k]) * d->spacing[k];
    for (int row = 0; row < 3; row++)
        out[row] = d->origin[row] + (d->direction[3 * row] * step[0] + d->direction[3 * row + 1] * step[1] +
                                     d->direction[3 * row + 2] * step[2]);
}

static enum tetlod_status make_points(struct reader *r)
{
    double *axes[3] = {NULL, NULL, NULL};
    bool is_image = r->document->kind == VTKXML_IMAGE;
    enum tetlod_type type = TETLOD_FLOAT64;
    enum tetlod_status status = is_image ? TETLOD_OK : read_coordinates(r, axes, &type);
    if (status == TETLOD_OK)
        status = assemble_points(&r->block->mesh, r->points.all, type, r->error);
    double *p = r->block->mesh.positions;
    const uint32_t *dims = r->block->dims;
    uint32_t at[3];
    for (at[2] = 0; status == TETLOD_OK && at[2] < dims[2]; at[2]++)
        for (at[1] = 0; at[1] < dims[1]; at[1]++)
            for (at[0] = 0; at[0] < dims[0]; at[0]++, p += 3) {
                if (is_image)
                    image_point(r, at, p);
                for (int d = 0; d < 3 && !is_image; d++)
                    p[d] = axes[d][at[d]];
            }
    for (int d = 0; d < 3; d++)
        free(axes[d]);
    return status;
}

static enum tetlod_status read_structured(struct reader *r)
{
    TETLOD_TRY(count_structured(r));
    if (r->document->kind == VTKXML_STRUCTURED)
        return read_points(r);
    TETLOD_TRY(check_structured(r));
    return make_points(r);
}

/* ---- cells */

/* Where the corners of cells end; those of a range count from where the cells before end. What falls becomes more than
 * there is, which blocks_merge.c refuses. */
static enum tetlod_status read_offsets(struct reader *r, const struct vtkxml_array *array, struct cells *cells,
                                       struct vtkxml_slice *corners)
{
    uint64_t *offsets = cells->offsets, before = r->cells.first > 0;
    const struct vtkxml_slice slice = {r->cells.all, r->cells.first - before, r->cells.count + before};
    offsets[0] = 0;
    TETLOD_TRY(vtkxml_values(r->document, array, slice, VTKXML_INTS, offsets + 1 - before, r->error));
    corners->first = offsets[0];
    corners->count = offsets[cells->count] - offsets[0];
    corners->all = r->ranges > 1 ? corners->all : corners->count;
    for (uint64_t c = 0; c <= cells->count; c++)
        offsets[c] -= corners->first;
    return TETLOD_OK;
}

/* Of a range the corners lie among those of all cells. */
static enum tetlod_status check_corners(const struct reader *r, const struct vtkxml_array *offsets,
                                        const struct vtkxml_slice *corners)
{
    if (corners->all > INT64_MAX)
        return tetlodi_fail(r->error, TETLOD_ERR_MESH, "array 'offsets' (line %llu): its last value %lld is negative",
                            (unsigned long long)offsets->line, (long long)corners->all);
    if (corners->first <= corners->all && corners->count <= corners->all - corners->first)
        return TETLOD_OK;
    return tetlodi_fail(r->error, TETLOD_ERR_MESH, "array 'offsets' (line %llu): its values fall",
                        (unsigned long long)offsets->line);
}

/* The types and offsets of cells, unless all are tetrahedra: most meshes are, and then neither needs room; and where
 * their corners are. */
static enum tetlod_status read_types(struct reader *r, struct cells *cells, struct vtkxml_slice *out_corners)
{
    const struct vtkxml_array *types, *offsets;
    bool all_tets;
    size_t count = (size_t)r->cells.count;
    const struct vtkxml_slice last = {r->cells.all, r->cells.all - 1, 1};
    TETLOD_TRY(require_array(r, VTKXML_CELLS, "types", 1, r->cells.all, &types));
    TETLOD_TRY(require_array(r, VTKXML_CELLS, "offsets", 1, r->cells.all, &offsets));
    cells->count = count;
    TETLOD_TRY(vtkxml_is_sequence(r->document, types, r->cells, VTK_TYPE_TET, 0, &all_tets, r->error));
    if (all_tets)
        TETLOD_TRY(vtkxml_is_sequence(r->document, offsets, r->cells, 4 * (int64_t)(r->cells.first + 1), 4, &all_tets,
                                      r->error));
    *out_corners = slice_times(r->cells, 4);
    if (r->ranges > 1)
        TETLOD_TRY(vtkxml_values(r->document, offsets, last, VTKXML_INTS, &out_corners->all, r->error));
    if (all_tets)
        return check_corners(r, offsets, out_corners);
    cells->types = array_new(count, 1);
    cells->offsets = array_new(count + 1, sizeof *cells->offsets);
    if (!cells->types || !cells->offsets)
        return tetlodi_fail_nomem(r->error, "the cells", (uint64_t)count * 9);
    TETLOD_TRY(vtkxml_values(r->document, types, r->cells, VTKXML_BYTES, cells->types, r->error));
    TETLOD_TRY(read_offsets(r, offsets, cells, out_corners));
    return check_corners(r, offsets, out_corners);
}

static enum tetlod_status read_connectivity(struct reader *r, struct cells *cells, struct vtkxml_slice corners)
{
    const struct vtkxml_array *connectivity;
    TETLOD_TRY(require_array(r, VTKXML_CELLS, "connectivity", 1, 0, &connectivity));
    TETLOD_TRY(vtkxml_check_count(r->document, connectivity, corners.all, r->error));
    cells->connectivity = array_new((size_t)corners.count, sizeof *cells->connectivity);
    if (!cells->connectivity)
        return tetlodi_fail_nomem(r->error, "the cells", corners.count * sizeof *cells->connectivity);
    cells->connectivity_count = corners.count;
    return vtkxml_values(r->document, connectivity, corners, VTKXML_NUMBERS, cells->connectivity, r->error);
}

/* ---- polyhedra */

/* Where the face stream of each cell ends in `faces`, or -1 if it is no polyhedron. */
struct faces {
    int64_t *ends; /* owned */
    uint32_t *stream; /* owned */
    uint64_t size;
};

static enum tetlod_status load_faces(const struct reader *r, struct faces *out)
{
    const struct vtkxml_array *ends, *stream;
    TETLOD_TRY(require_array(r, VTKXML_CELLS, "faceoffsets", 1, r->cells.all, &ends));
    TETLOD_TRY(require_array(r, VTKXML_CELLS, "faces", 1, 0, &stream));
    out->ends = array_new((size_t)r->cells.all, sizeof *out->ends);
    if (!out->ends)
        return tetlodi_fail_nomem(r->error, "the polyhedra", r->cells.all * 8);
    TETLOD_TRY(vtkxml_values(r->document, ends, r->cells, VTKXML_INTS, out->ends, r->error));
    for (uint64_t c = 0; c < r->cells.all; c++)
        if (out->ends[c] > 0 && (uint64_t)out->ends[c] > out->size)
            out->size = (uint64_t)out->ends[c];
    TETLOD_TRY(vtkxml_check_count(r->document, stream, out->size, r->error));
    out->stream = array_new((size_t)out->size, sizeof *out->stream);
    if (!out->stream)
        return tetlodi_fail_nomem(r->error, "the polyhedra", out->size * sizeof *out->stream);
    return vtkxml_values(r->document, stream, vtkxml_whole(out->size), VTKXML_NUMBERS, out->stream, r->error);
}

/* The polyhedra's points in the connectivity become their face streams. */
static enum tetlod_status take_faces(struct reader *r, const struct faces *faces)
{
    struct cells *old = &r->block->cells, cells = {0};
    uint64_t begin = 0;
    enum tetlod_status status = TETLOD_OK;
    for (uint64_t c = 0; c < old->count && status == TETLOD_OK; c++) {
        bool is_poly = old->types[c] == VTK_TYPE_POLYHEDRON;
        uint64_t from = is_poly ? begin : old->offsets[c],
                 end = is_poly ? (uint64_t)faces->ends[c] : old->offsets[c + 1];
        const uint32_t *stream = is_poly ? faces->stream : old->connectivity;
        if (end < from || end > (is_poly ? faces->size : old->connectivity_count))
            status = tetlodi_fail(r->error, TETLOD_ERR_MESH, "cell %llu: its faces do not fit", (unsigned long long)c);
        else
            status = cells_add_numbers(&cells, old->types[c], stream + from, (size_t)(end - from), r->error);
        begin = is_poly ? end : begin;
    }
    cells_fini(old);
    *old = cells;
    return status;
}

static enum tetlod_status read_polyhedra(struct reader *r)
{
    struct faces faces = {0};
    if (!r->block->cells.types || !memchr(r->block->cells.types, VTK_TYPE_POLYHEDRON, (size_t)r->cells.count))
        return TETLOD_OK;
    enum tetlod_status status = load_faces(r, &faces);
    if (status == TETLOD_OK)
        status = take_faces(r, &faces);
    free(faces.ends);
    free(faces.stream);
    return status;
}

static enum tetlod_status read_unstructured(struct reader *r)
{
    struct cells *cells = &r->block->cells;
    struct vtkxml_slice corners;
    r->points = slice_of(r, r->piece->points);
    r->cells = slice_of(r, r->piece->cells);
    r->block->goes_on = r->range > 0;
    if (r->points.count)
        TETLOD_TRY(read_points(r));
    if (!r->cells.count)
        return TETLOD_OK;
    TETLOD_TRY(read_types(r, cells, &corners));
    TETLOD_TRY(read_connectivity(r, cells, corners));
    if (r->document->is_old_lagrange)
        cells_renew_lagrange(cells);
    return read_polyhedra(r);
}

/* ---- values */

static enum tetlod_status read_field(struct reader *r, const struct vtkxml_array *like, bool cell)
{
    struct tetmesh *mesh = &r->block->mesh;
    const struct vtkxml_array *array;
    const struct vtkxml_slice rows = cell ? r->cells : r->points;
    if (like->components == 0)
        return tetlodi_fail(r->error, TETLOD_ERR_MESH, "array '%.60s' (line %llu) has no components", like->name,
                            (unsigned long long)like->line);
    TETLOD_TRY(require_array(r, like->section, like->name, like->components, rows.all, &array));
    if (cell)
        TETLOD_TRY(assemble_cell_field(mesh, array->name, array->components, type_of(array), rows.count, r->error));
    else
        TETLOD_TRY(assemble_field(mesh, array->name, array->components, type_of(array), r->error));
    struct point_field *field = cell ? &mesh->cell_fields[mesh->cell_field_count -
                                                          1] : &mesh->fields[mesh->field_count - 1];
    field->is_integer = !value_is_float(array->type);
    memcpy(field->unit, array->unit, sizeof field->unit);
    TETLOD_TRY(vtkxml_values(r->document, array, slice_times(rows, array->components), VTKXML_DOUBLES, field->values,
                             r->error));
    return is_ghosts(array->name, array->components) ? block_take_ghosts(r->block, cell, r->report,
                                                                         r->error) : TETLOD_OK;
}

static enum tetlod_status read_fields(struct reader *r)
{
    for (size_t a = r->piece->first_array; a < r->piece->array_end; a++) {
        const struct vtkxml_array *array = &r->document->arrays[a];
        bool cell = array->section == VTKXML_CELL_DATA;
        if ((!cell && array->section != VTKXML_POINT_DATA) || !(cell ? r->cells.count : r->points.count))
            continue;
        if (vtkxml_find(r->document, r->piece, array->section, array->name) != array)
            // a second one of that name would look like the first
            io_leave_out(r->report, &r->report->skipped_arrays, array->name, strlen(array->name));
        else
            TETLOD_TRY(read_field(r, array, cell));
    }
    return TETLOD_OK;
}

/* Raw bytes can be read from anywhere; what polyhedra are made of would have to be looked for. */
bool vtkxml_has_ranges(const struct vtkxml_document *document, const struct vtkxml_piece *piece)
{
    bool good = document->kind == VTKXML_UNSTRUCTURED && document->appended_raw && !piece->source &&
                !vtkxml_find(document, piece, VTKXML_CELLS, "faces");
    for (size_t a = piece->first_array; a < piece->array_end; a++)
        good &= document->arrays[a].format == VTKXML_APPENDED;
    return good;
}

enum tetlod_status vtkxml_read_piece(const struct vtkxml_document *document, const struct vtkxml_piece *piece,
                                     uint32_t range, uint32_t ranges, struct block *block, struct io_report *report,
                                     struct tetlod_error *error)
{
    struct reader r = {.document = document, .piece = piece, .block = block, .report = report, .error = error,
                       .range = range, .ranges = ranges};
    TETLOD_TRY(document->kind == VTKXML_UNSTRUCTURED ? read_unstructured(&r) : read_structured(&r));
    return read_fields(&r);
}
