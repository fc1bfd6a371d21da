/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/stream/level_mesh.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/originals.h"
#include "src/stream/metadata.h"
#include "src/util/array.h"
#include "src/util/pages.h"

/* Copies an array; `from` is given back on the way if `gives`, so that both together take its memory once. */
static void copy_array(void *to, const void *from, size_t size, bool gives)
{
    enum { PART = 1 << 20 };
    for (size_t at = 0; at < size; at += PART) {
        size_t part = size - at < PART ? size - at : PART;
        memcpy((char *)to + at, (const char *)from + at, part);
        if (gives)
            // the decoder's own, which only says that nobody else may write it
            pages_drop((void *)((uintptr_t)from + at), part);
    }
}

static enum tetlod_status copy(const struct tetlod_info *info, const struct tetlod_cursor *cursor, bool gives,
                               struct tetmesh *out,
                               struct tetlod_error *error)
{
    struct tetlod_mesh mesh;
    tetlod_cursor_mesh(cursor, &mesh);
    *out = (struct tetmesh){.vertex_count = mesh.vertices, .tet_count = mesh.tets,
                            .position_type = info->position_type};
    out->positions = array_new(mesh.vertices, 3 * sizeof(double));
    out->corners = array_new(mesh.tets, 4 * sizeof(uint32_t));
    enum tetlod_status status = TETLOD_OK;
    if (!out->positions || !out->corners)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "a level", (uint64_t)mesh.vertices * 24 + (uint64_t)mesh.tets * 16));
    copy_array(out->positions, mesh.positions, mesh.vertices * 3 * sizeof(double), gives);
    copy_array(out->corners, mesh.corners, mesh.tets * 4 * sizeof(uint32_t), gives);
    for (uint32_t f = 0; f < info->field_count; f++) {
        const struct tetlod_field *field = &info->fields[f];
        if (!mesh.fields[f])
            continue;
        TETLOD_TRY_DONE(tetmesh_add_field(out, field->name, field->components, field->type, error));
        copy_array(out->fields[out->field_count - 1].values, mesh.fields[f],
                   (size_t)mesh.vertices * field->components * sizeof(double),
                   gives);
    }
    tetmesh_set_origin(out, info, mesh.level);
done:
    if (status != TETLOD_OK)
        tetmesh_fini(out);
    return status;
}

enum tetlod_status level_mesh_copy(const struct tetlod_info *info, const struct tetlod_cursor *cursor,
                                   struct tetmesh *out,
                                   struct tetlod_error *error)
{
    return copy(info, cursor, false, out, error);
}

enum tetlod_status level_mesh_take(const struct tetlod_info *info, struct tetlod_cursor **cursor, struct tetmesh *out,
                                   struct tetlod_error *error)
{
    enum tetlod_status status = copy(info, *cursor, true, out, error);
    tetlod_cursor_free(*cursor);
    *cursor = NULL;
    return status;
}

static void take_units(const json_t *metadata, struct point_field *fields, uint32_t count)
{
    for (uint32_t f = 0; f < count; f++) {
        const char *unit = metadata_unit(metadata, fields[f].name);
        size_t length = strlen(unit);
        if (length < sizeof fields[f].unit)
            memcpy(fields[f].unit, unit, length + 1);
    }
}

enum tetlod_status level_mesh_units(const struct tetlod_info *info, struct tetmesh *mesh, struct tetlod_error *error)
{
    json_t *metadata = metadata_json(info);
    if (!metadata)
        return tetlodi_fail_nomem(error, "the metadata", info->metadata_size);
    take_units(metadata, mesh->fields, mesh->field_count);
    take_units(metadata, mesh->cell_fields, mesh->cell_field_count);
    for (uint32_t f = 0; f < mesh->field_count; f++)
        mesh->fields[f].is_ids = metadata_is_id(json_object_get(metadata, "ids"), mesh->fields[f].name);
    json_decref(metadata);
    return TETLOD_OK;
}

enum tetlod_status level_mesh_step(const struct tetlod_info *info, const struct tetlod_series *series,
                                   struct tetmesh *mesh,
                                   struct tetlod_error *error)
{
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    for (uint32_t f = 0; f < steps->field_count; f++) {
        const struct tetlod_field *field = &info->fields[steps->fields[f]];
        TETLOD_TRY(tetmesh_add_field(mesh, field->name, field->components, steps->types[f], error));
        memcpy(mesh->fields[mesh->field_count - 1].values, tetlod_step_values(series, f),
               (size_t)mesh->vertex_count * field->components * sizeof(double));
    }
    return TETLOD_OK;
}

void level_mesh_step_origin(const struct tetlod_info *info, const struct tetlod_series *series, uint32_t band,
                            uint32_t step, struct tetmesh *mesh)
{
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    memcpy(mesh->origin.id, info->cid, sizeof mesh->origin.id);
    mesh->origin.has_time = true;
    mesh->origin.time = steps->times[step];
    for (uint32_t f = 0; f < steps->field_count; f++) {
        uint32_t own = tetmesh_find_field(mesh, info->fields[steps->fields[f]].name);
        mesh->fields[own].error = tetlod_step_error(series, f, band, step);
        mesh->fields[own].has_error = true;
    }
}

/* Where values of cells are from: the stream, or a step of its series. */
struct cell_source {
    const struct tetlod_file *file;
    struct tetlod_series *series; /* NULL: the stream's own */
    uint32_t step;
};

static enum tetlod_status add_cells(const struct cell_source *from, uint32_t f, const uint32_t *tets,
                                    struct tetmesh *mesh, double *all, struct tetlod_error *error)
{
    const struct tetlod_cell_field *field = &tetlod_info(from->file)->cell_fields[f];
    enum tetlod_type type = field->type == TETLOD_CELL_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
    TETLOD_TRY(from->series ? tetlod_step_cells(from->series, f, from->step, all, error)
                            : tetlod_cells(from->file, f, all, error));
    TETLOD_TRY(tetmesh_add_cell_field(mesh, field->name, field->components, type, mesh->tet_count, error));
    struct point_field *out = &mesh->cell_fields[mesh->cell_field_count - 1];
    out->is_integer = field->type > TETLOD_CELL_FLOAT64;
    for (size_t t = 0; t < mesh->tet_count; t++)
        memcpy(out->values + t * field->components, all + (tets ? tets[t] : t) * field->components,
               field->components * sizeof *all);
    return TETLOD_OK;
}

static enum tetlod_status add_chosen(const struct cell_source *from, uint32_t field, const uint32_t *tets,
                                     struct tetmesh *mesh, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(from->file);
    enum tetlod_status status = TETLOD_OK;
    for (uint32_t f = 0; f < info->cell_field_count && status == TETLOD_OK; f++) {
        if ((field != TETLOD_NONE && f != field) ||
            (from->series && !tetlod_has_step_cells(from->series, f, from->step)))
            continue;
        double *all = array_new(info->tets, info->cell_fields[f].components * sizeof *all);
        status = all ? add_cells(from, f, tets, mesh, all, error)
                     : tetlodi_fail_nomem(error, info->cell_fields[f].name,
                                          (uint64_t)info->tets * info->cell_fields[f].components * 8);
        free(all);
    }
    return status == TETLOD_OK ? level_mesh_units(info, mesh, error) : status;
}

enum tetlod_status level_mesh_cells(const struct tetlod_file *file, uint32_t field, const uint32_t *tets,
                                    struct tetmesh *mesh, struct tetlod_error *error)
{
    return add_chosen(&(struct cell_source){.file = file}, field, tets, mesh, error);
}

enum tetlod_status level_mesh_step_cells(const struct tetlod_file *file, struct tetlod_series *series, uint32_t step,
                                         uint32_t field, struct tetmesh *mesh, struct tetlod_error *error)
{
    return add_chosen(&(struct cell_source){file, series, step}, field, NULL, mesh, error);
}

enum tetlod_status level_mesh_cells_here(const struct tetlod_file *file, const char *except, const uint32_t *tets,
                                         struct tetmesh *mesh,
                                         struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    for (uint32_t f = 0; f < info->cell_field_count; f++) {
        if (except && strcmp(info->cell_fields[f].name, except) == 0)
            continue;
        enum tetlod_status status = level_mesh_cells(file, f, tets, mesh, error);
        if (status != TETLOD_OK && status != TETLOD_ERR_TRUNCATED)
            return status;
    }
    return TETLOD_OK;
}

/* The array whose row numbers[i] is row i of this one; this one is freed. NULL: out of memory. */
static double *scatter(double *rows, size_t width, const uint32_t *numbers, uint32_t count)
{
    double *out = array_new(count, width * sizeof *out);
    for (uint32_t i = 0; i < count && out; i++)
        memcpy(out + numbers[i] * width, rows + i * width, width * sizeof *out);
    if (out)
        free(rows);
    return out;
}

static enum tetlod_status check_permutation(const uint32_t *numbers, uint32_t count, struct tetlod_error *error)
{
    uint8_t *seen = array_zero(count, 1);
    bool good = true;
    if (!seen)
        return tetlodi_fail_nomem(error, "the original order", count);
    for (uint32_t i = 0; i < count && good; i++) {
        good = !seen[numbers[i]];
        seen[numbers[i]] = 1;
    }
    free(seen);
    return good ? TETLOD_OK : tetlodi_fail(error, TETLOD_ERR_STREAM, "the original order is damaged");
}

static enum tetlod_status reorder(struct tetmesh *mesh, const uint32_t *vertices, const uint32_t *tets,
                                  const uint8_t *places,
                                  struct tetlod_error *error)
{
    TETLOD_TRY(check_permutation(vertices, mesh->vertex_count, error));
    TETLOD_TRY(check_permutation(tets, mesh->tet_count, error));
    double *positions = scatter(mesh->positions, 3, vertices, mesh->vertex_count);
    uint32_t *corners = array_new(mesh->tet_count, 4 * sizeof *corners);
    mesh->positions = positions ? positions : mesh->positions;
    for (size_t t = 0; t < mesh->tet_count && corners; t++)
        for (size_t c = 0; c < 4; c++)
            corners[4 * (size_t)tets[t] + c] = vertices[mesh->corners[4 * t + places[4 * t + c]]];
    bool done = positions && corners;
    for (uint32_t f = 0; f < mesh->field_count && done; f++) {
        double *values = scatter(mesh->fields[f].values, mesh->fields[f].components, vertices, mesh->vertex_count);
        mesh->fields[f].values = values ? values : mesh->fields[f].values;
        done = values != NULL;
    }
    for (uint32_t f = 0; f < mesh->cell_field_count && done; f++) {
        double *values = scatter(mesh->cell_fields[f].values, mesh->cell_fields[f].components, tets, mesh->tet_count);
        mesh->cell_fields[f].values = values ? values : mesh->cell_fields[f].values;
        done = values != NULL;
    }
    if (corners) {
        free(mesh->corners);
        mesh->corners = corners;
    }
    return done ? TETLOD_OK : tetlodi_fail_nomem(error, "the original order", (uint64_t)mesh->vertex_count * 24);
}

enum tetlod_status level_mesh_reorder(const struct tetlod_file *file, struct tetmesh *mesh, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    if (mesh->vertex_count != info->vertices || mesh->tet_count != info->tets)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "the original order is that of the finest level, not of one of %u tetrahedra",
                            mesh->tet_count);
    uint32_t *vertices = array_new(mesh->vertex_count, sizeof *vertices),
             *tets = array_new(mesh->tet_count, sizeof *tets);
    uint8_t *places = array_new(mesh->tet_count, 4);
    enum tetlod_status status;
    if (vertices && tets && places)
        status = tetlod_order(file, vertices, tets, places, error);
    else
        status = tetlodi_fail_nomem(error, "the original order", (uint64_t)mesh->tet_count * 8);
    if (status == TETLOD_OK)
        status = reorder(mesh, vertices, tets, places, error);
    free(vertices);
    free(tets);
    free(places);
    return status;
}

static enum tetlod_status take_originals(const struct tetlod_file *file, uint32_t section, bool of_step,
                                         struct tetmesh *mesh, struct tetlod_error *error)
{
    size_t size = (size_t)tetlod_info(file)->sections[section].size;
    unsigned char *bytes = array_new(size, 1);
    enum tetlod_status status = bytes ? tetlod_section_read(file, section, bytes, error)
                                      : tetlodi_fail_nomem(error, "the original cells", size);
    if (status == TETLOD_OK)
        status = originals_decode(mesh, bytes, size, of_step, error);
    free(bytes);
    return status;
}

enum tetlod_status level_mesh_form(const struct tetlod_file *file, enum level_form form, bool of_step,
                                   struct tetmesh *mesh, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    uint32_t section = tetlod_section_index(info, TAG_ORIGINALS);
    if (form == FORM_STREAM)
        return TETLOD_OK;
    if (form == FORM_CELLS && (mesh->vertex_count != info->vertices || mesh->tet_count != info->tets))
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "the original cells are there at the finest level alone; coarser ones have tetrahedra");
    if (form == FORM_CELLS && !info->keeps_order)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "the stream keeps no original cells: build it with --keep-order");
    TETLOD_TRY(level_mesh_reorder(file, mesh, error));
    bool has_cells = form == FORM_CELLS && section != TETLOD_NONE;
    return has_cells ? take_originals(file, section, of_step, mesh, error) : TETLOD_OK;
}

enum tetlod_status level_mesh_gather(const struct tetmesh *finest, const struct tetmesh *original,
                                     const uint32_t *vertices,
                                     struct tetmesh *out, struct tetlod_error *error)
{
    *out = (struct tetmesh){.vertex_count = finest->vertex_count, .tet_count = finest->tet_count,
                            .position_type = original->position_type};
    out->positions = array_new(finest->vertex_count, 3 * sizeof(double));
    out->corners = array_new(finest->tet_count, 4 * sizeof(uint32_t));
    if (!out->positions || !out->corners)
        return tetlodi_fail_nomem(error, "the input", (uint64_t)finest->vertex_count * 24);
    memcpy(out->corners, finest->corners, 4 * (size_t)finest->tet_count * sizeof(uint32_t));
    for (size_t v = 0; v < finest->vertex_count; v++)
        memcpy(out->positions + 3 * v, original->positions + 3 * (size_t)vertices[v], 3 * sizeof(double));
    for (uint32_t f = 0; f < finest->field_count; f++) {
        const struct point_field *from = &original->fields[tetmesh_find_field(original, finest->fields[f].name)];
        size_t n = from->components;
        TETLOD_TRY(tetmesh_add_field(out, from->name, from->components, from->type, error));
        for (size_t v = 0; v < finest->vertex_count; v++)
            memcpy(out->fields[f].values + n * v, from->values + n * vertices[v], n * sizeof(double));
    }
    return TETLOD_OK;
}

/* Has the original the finest level's tetrahedra, by the order that the stream keeps? */
static enum tetlod_status check_order(const struct tetmesh *finest, const struct tetmesh *original,
                                      const uint32_t *vertices,
                                      const uint32_t *tets, const uint8_t *places, struct tetlod_error *error)
{
    for (size_t i = 0; i < 4 * (size_t)finest->tet_count; i++)
        if (original->corners[4 * (size_t)tets[i / 4] +
                              i % 4] != vertices[finest->corners[(i & ~(size_t)3) + places[i]]])
            return tetlodi_fail(error, TETLOD_ERR_MISMATCH, "tetrahedron %u of the input is another one in the stream",
                                tets[i / 4]);
    return TETLOD_OK;
}

enum tetlod_status level_mesh_renumber(const struct tetlod_file *file, const struct tetmesh *finest,
                                       const struct tetmesh *original,
                                       struct tetmesh *out, struct tetlod_error *error)
{
    uint32_t n = finest->vertex_count, m = finest->tet_count, *vertices = array_new(n, sizeof *vertices),
             *tets = array_new(m, sizeof *tets);
    uint8_t *places = array_new(m, 4);
    enum tetlod_status status;
    *out = (struct tetmesh){.vertex_count = n, .tet_count = m, .position_type = original->position_type};
    assert(n == tetlod_info(file)->vertices && m == tetlod_info(file)->tets);
    if (!vertices || !tets || !places)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the original order", (uint64_t)m * 8));
    if (original->vertex_count != n || original->tet_count != m)
        TETLOD_TRY_DONE(tetlodi_fail(error, TETLOD_ERR_MISMATCH,
                                     "the finest level has %u vertices and %u tetrahedra, the input %u and %u",
                                     n, m, original->vertex_count, original->tet_count));
    TETLOD_TRY_DONE(tetlod_order(file, vertices, tets, places, error));
    TETLOD_TRY_DONE(check_permutation(vertices, n, error));
    TETLOD_TRY_DONE(check_permutation(tets, m, error));
    TETLOD_TRY_DONE(check_order(finest, original, vertices, tets, places, error));
    status = level_mesh_gather(finest, original, vertices, out, error);
done:
    if (status != TETLOD_OK)
        tetmesh_fini(out);
    free(vertices);
    free(tets);
    free(places);
    return status;
}
