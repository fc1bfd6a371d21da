/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/stream/forest.h"

#include <assert.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/stream/forest_data.h"
#include "src/util/array.h"

/* A stage has at least so many times the tetrahedra of the one below. Decoding ends at the finest level, or at one that
 * has so many times fewer tetrahedra than the next such end. */
enum { STAGE_GROWTH = 4, END_GROWTH = 2 };

static void stop_decoding(struct forest *forest)
{
    tetlod_cursor_free(forest->cursor);
    forest->cursor = NULL;
}

void forest_free(struct forest *forest)
{
    if (!forest)
        return;
    stop_decoding(forest);
    for (uint32_t c = 0; forest->columns && c < forest->column_count; c++)
        free(forest->columns[c].name);
    for (uint32_t s = 0; forest->stages && s < forest->stage_count; s++) {
        free(forest->stages[s].corners);
        free(forest->stages[s].newest);
    }
    free(forest->columns);
    free(forest->chosen);
    free(forest->stages);
    free(forest->parents);
    free(forest->versions);
    free(forest->rows);
    free(forest->newest);
    free(forest);
}

uint64_t forest_bytes(const struct forest *forest)
{
    return atomic_load_explicit(&forest->bytes, memory_order_relaxed);
}

const struct tetlod_info *forest_info(const struct forest *forest)
{
    return tetlod_info(forest->file);
}

static size_t width_of(enum tetlod_type type)
{
    return type == TETLOD_FLOAT32 ? 4 : 8;
}

static bool describe_columns(struct forest *forest, const struct tetlod_info *info)
{
    forest->column_count = 1 + info->field_count;
    forest->columns = array_zero(forest->column_count, sizeof *forest->columns);
    for (uint32_t c = 0; forest->columns && c < forest->column_count; c++) {
        struct column *column = &forest->columns[c];
        const struct tetlod_field *field = c ? &info->fields[c - 1] : NULL;
        column->components = field ? field->components : 3;
        column->type = field ? field->type : info->position_type;
        column->offset = forest->row_size;
        if (field && !(column->name = strdup(field->name)))
            return false;
        forest->row_size += column->components * width_of(column->type);
    }
    return forest->columns != NULL;
}

uint32_t forest_last_level(const struct tetlod_info *info, uint32_t level)
{
    uint32_t last = info->level_count - 1;
    for (uint32_t k = last; k-- > level;)
        if ((uint64_t)END_GROWTH * info->levels[k].tets <= info->levels[last].tets)
            last = k;
    return last;
}

/* The last level is a stage, and below a stage the finest level that is no more than a quarter of it: so no level is
 * mapped from more than four times its size, and all stages together take a third more than the last. */
static bool choose_stages(struct forest *forest, const struct tetlod_info *info, uint32_t last)
{
    uint32_t first = info->level_count;
    struct stage *stages = forest->stages = array_zero(info->level_count, sizeof *forest->stages);
    for (uint32_t k = last + 1; stages && k-- > 0;) {
        const struct tetlod_level *level = &info->levels[k];
        if (k == last || (uint64_t)STAGE_GROWTH * level->tets <= stages[first].tets)
            stages[--first] = (struct stage){k, level->vertices, level->tets, NULL, NULL};
    }
    forest->stage_count = info->level_count - first;
    for (uint32_t s = 0; stages && s < forest->stage_count; s++)
        stages[s] = stages[first + s];
    return stages != NULL;
}

/* Each record gives one vertex other contents and brings at least one new vertex: two versions for a slot at most, and
 * one that the exact tail brings. */
static size_t most_versions(const struct forest *forest)
{
    return 3 * (size_t)forest->stages[forest->stage_count - 1].vertices;
}

uint64_t forest_estimate(const struct tetlod_info *info, uint32_t level)
{
    const struct tetlod_level *stage = &info->levels[forest_last_level(info, level)];
    uint64_t row = 3 * (info->position_type == TETLOD_FLOAT32 ? 4 : 8);
    uint64_t components = 3;
    for (uint32_t f = 0; f < info->field_count; f++) {
        row += info->fields[f].components * (info->fields[f].type == TETLOD_FLOAT32 ? 4 : 8);
        components += info->fields[f].components;
    }
    /* versions, parents and newest twice; stages; the cursor, which holds doubles, stars and what undoes records */
    return stage->vertices * (2 * (row + 8) + 12 + 8 * components + 64) + stage->tets * (uint64_t)(22 + 64) +
           ((uint64_t)1 << 16);
}

static bool choose_fields(struct forest *forest, const uint32_t *fields, uint32_t count)
{
    forest->chosen = fields ? array_new(count, sizeof *fields) : NULL;
    forest->chosen_count = fields ? count : 0;
    for (uint32_t f = 0; forest->chosen && f < count; f++)
        forest->chosen[f] = fields[f];
    return !fields || forest->chosen;
}

enum tetlod_status forest_new(struct forest **out, struct tetlod_file *file, uint32_t level, struct tetlod_error *error)
{
    return forest_new_of(out, file, forest_last_level(tetlod_info(file), level), NULL, 0, error);
}

enum tetlod_status forest_new_of(struct forest **out, struct tetlod_file *file, uint32_t level, const uint32_t *fields,
                                 uint32_t count, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    *out = NULL;
    if (info->levels[level].vertices > UINT32_MAX / 3 || info->levels[level].tets > INT32_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "level %u has more vertices or tetrahedra than fit here", level);
    struct forest *forest = array_zero(1, sizeof *forest);
    bool known = forest && describe_columns(forest, info) && choose_stages(forest, info, level) &&
                 choose_fields(forest, fields, count);
    uint32_t vertices = known ? forest->stages[forest->stage_count - 1].vertices : 0;
    if (!known || most_versions(forest) > UINT32_MAX ||
        !(forest->parents = array_new(vertices, sizeof *forest->parents)) ||
        !(forest->newest = array_new(vertices, sizeof *forest->newest)) ||
        !(forest->versions = array_new(most_versions(forest), sizeof *forest->versions)) ||
        !(forest->rows = array_new(most_versions(forest) + 1, forest->row_size))) {
        forest_free(forest);
        return tetlodi_fail_nomem(error, "a stream in memory", 16 * (uint64_t)info->tets);
    }
    forest->file = file;
    *out = forest;
    return TETLOD_OK;
}

static void pack_row(const struct forest *forest, const struct tetlod_mesh *mesh, uint32_t slot, unsigned char *row)
{
    for (uint32_t c = 0; c < forest->column_count; c++) {
        const struct column *column = &forest->columns[c];
        const double *values = c ? mesh->fields[c - 1] : mesh->positions;
        if (!values) { // not decoded
            memset(row + column->offset, 0, column->components * width_of(column->type));
            continue;
        }
        values += (size_t)slot * column->components;
        for (uint32_t i = 0; i < column->components; i++) {
            if (column->type == TETLOD_FLOAT64)
                memcpy(row + column->offset + 8 * i, &values[i], 8);
            else {
                float value = (float)values[i]; // exact: that is the field's type
                memcpy(row + column->offset + 4 * i, &value, 4);
            }
        }
    }
}

/* Notes what a slot holds at the level being taken. */
static void add_version(struct forest *forest, const struct tetlod_mesh *mesh, uint32_t slot, uint32_t previous)
{
    size_t count = forest->version_count, size = forest->row_size;
    unsigned char *row = forest->rows + count * size;
    pack_row(forest, mesh, slot, row);
    if (previous != TETLOD_NONE && memcmp(row, forest->rows + previous * size, size) == 0)
        return;
    assert(count < most_versions(forest));
    forest->versions[count] = (struct version){forest->next_level, previous};
    forest->newest[slot] = (uint32_t)count;
    forest->version_count++;
}

/* Takes what a level brought: new slots, and other contents of slots that have split, which are parents of new ones. */
static void take_level(struct forest *forest, const struct tetlod_mesh *mesh)
{
    uint32_t level = forest->next_level, known = level ? tetlod_info(forest->file)->levels[level - 1].vertices : 0;
    for (uint32_t v = known; v < mesh->vertices; v++) {
        uint32_t parent = forest->parents[v] = mesh->parents[v];
        assert(!level || parent < v);
        if (parent < known && forest->versions[forest->newest[parent]].level < level)
            add_version(forest, mesh, parent, forest->newest[parent]);
        add_version(forest, mesh, v, TETLOD_NONE);
    }
    for (uint32_t v = 0; v < mesh->vertices && known == mesh->vertices; v++) // the exact tail
        add_version(forest, mesh, v, forest->newest[v]);
    forest->next_level++;
}

static uint64_t bytes_there(const struct forest *forest, uint32_t stages)
{
    const struct stage *last = &forest->stages[stages - 1];
    uint64_t bytes = last->vertices * (uint64_t)sizeof *forest->parents +
                     forest->version_count * (uint64_t)(sizeof *forest->versions + forest->row_size);
    for (uint32_t s = 0; s < stages; s++)
        bytes += forest->stages[s].tets * (uint64_t)16 + forest->stages[s].vertices * (uint64_t)sizeof *forest->newest;
    return bytes;
}

static enum tetlod_status make_room(struct stage *stage, struct tetlod_error *error)
{
    if (!stage->corners)
        stage->corners = array_new(stage->tets, 4 * sizeof *stage->corners);
    if (!stage->newest)
        stage->newest = array_new(stage->vertices, sizeof *stage->newest);
    return stage->corners && stage->newest ? TETLOD_OK
                                           : tetlodi_fail_nomem(error, "a stream in memory",
                                                                16 * (uint64_t)stage->tets);
}

/* Makes the levels up to a stage, at which the decoder stands, visible to other threads. */
static void publish(struct forest *forest, struct stage *stage, const struct tetlod_mesh *mesh)
{
    uint32_t there = (uint32_t)(stage - forest->stages) + 1;
    if (stage->tets) // else there may be no corners at all
        memcpy(stage->corners, mesh->corners, stage->tets * 4 * sizeof *stage->corners);
    memcpy(stage->newest, forest->newest, stage->vertices * sizeof *stage->newest);
    atomic_store_explicit(&forest->bytes, bytes_there(forest, there), memory_order_relaxed);
    atomic_store_explicit(&forest->stages_there, there, memory_order_release);
}

static enum tetlod_status take_next(struct forest *forest, struct tetlod_error *error)
{
    struct tetlod_mesh mesh;
    struct stage *stage = &forest->stages[atomic_load_explicit(&forest->stages_there, memory_order_relaxed)];
    uint32_t level = forest->next_level;
    const struct tetlod_level *expected = &tetlod_info(forest->file)->levels[level];
    if (!forest->cursor)
        TETLOD_TRY(tetlod_cursor_new(&forest->cursor, forest->file, forest->chosen, forest->chosen_count, error));
    TETLOD_TRY(tetlod_cursor_seek(forest->cursor, level, error));
    tetlod_cursor_mesh(forest->cursor, &mesh);
    if (mesh.vertices != expected->vertices || mesh.tets != expected->tets)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "level %u is not as large as the index says", level);
    if (level == stage->level)
        TETLOD_TRY(make_room(stage, error));
    take_level(forest, &mesh);
    if (level == stage->level)
        publish(forest, stage, &mesh);
    return TETLOD_OK;
}

enum tetlod_status forest_grow(struct forest *forest, struct tetlod_error *error)
{
    enum tetlod_status status = take_next(forest, error);
    bool whole = status == TETLOD_OK && forest->next_level == forest->stages[forest->stage_count - 1].level + 1;
    if (status != TETLOD_OK || whole)
        stop_decoding(forest);
    if (whole) {
        free(forest->newest);
        forest->newest = NULL;
    }
    return status;
}

uint32_t forest_levels(const struct forest *forest)
{
    uint32_t there = atomic_load_explicit(&forest->stages_there, memory_order_acquire);
    return there ? forest->stages[there - 1].level + 1 : 0;
}

/* ---- a level, as rows ---- */

struct forest_view {
    const struct forest *forest;
    const struct stage *stage; /* that the level is mapped from */
    uint32_t *standing; /* [slots of the stage] the vertex of the level that a slot stands for */
    uint32_t *versions; /* [vertices of the level] */
};

/* The least stage that has a level. */
static const struct stage *stage_of(const struct forest *forest, uint32_t level)
{
    const struct stage *stage = forest->stages;
    while (stage->level < level)
        stage++;
    return stage;
}

uint64_t forest_view_bytes(const struct forest *forest, uint32_t level)
{
    return sizeof(struct forest_view) +
           4 * ((uint64_t)stage_of(forest, level)->vertices + tetlod_info(forest->file)->levels[level].vertices);
}

void forest_view_free(struct forest_view *view)
{
    if (!view)
        return;
    free(view->standing);
    free(view->versions);
    free(view);
}

static void map_slots(struct forest_view *view, uint32_t level, uint32_t count)
{
    const struct forest *forest = view->forest;
    for (uint32_t v = 0; v < view->stage->vertices; v++)
        view->standing[v] = v < count ? v : view->standing[forest->parents[v]];
    for (uint32_t v = 0; v < count; v++) {
        uint32_t version = view->stage->newest[v];
        while (forest->versions[version].level > level)
            version = forest->versions[version].previous;
        view->versions[v] = version;
    }
}

enum tetlod_status forest_view_new(struct forest_view **out, const struct forest *forest, uint32_t level,
                                   struct tetlod_error *error)
{
    const struct stage *stage = stage_of(forest, level);
    uint32_t count = tetlod_info(forest->file)->levels[level].vertices;
    assert(level < forest_levels(forest));
    struct forest_view *view = *out = array_zero(1, sizeof *view);
    if (view) {
        *view = (struct forest_view){forest, stage, array_new(stage->vertices, sizeof *view->standing),
                                     array_new(count, sizeof *view->versions)};
        if (view->standing && view->versions) {
            map_slots(view, level, count);
            return TETLOD_OK;
        }
    }
    forest_view_free(view);
    *out = NULL;
    return tetlodi_fail_nomem(error, "a level", ((uint64_t)stage->vertices + count) * sizeof *view->standing);
}

void forest_view_corners(const void *opaque, uint64_t first, size_t count, uint32_t *out)
{
    const struct forest_view *view = opaque;
    const uint32_t *descendants = view->stage->corners + 4 * first;
    for (size_t i = 0; i < 4 * count; i++)
        out[i] = view->standing[descendants[i]];
}

void forest_view_values(const void *opaque, uint32_t c, uint64_t first, size_t count, double *out)
{
    const struct forest_view *view = opaque;
    const struct forest *forest = view->forest;
    const struct column *column = &forest->columns[c];
    size_t components = column->components;
    for (size_t v = 0; v < count; v++, out += components) {
        const unsigned char *row = forest->rows + view->versions[first + v] * forest->row_size + column->offset;
        if (column->type == TETLOD_FLOAT64)
            memcpy(out, row, 8 * components);
        else
            for (size_t i = 0; i < components; i++) {
                float value;
                memcpy(&value, row + 4 * i, 4);
                out[i] = value;
            }
    }
}

/* ---- a level, as a mesh ---- */

static bool allocate_arrays(struct tetmesh *mesh)
{
    mesh->positions = array_new(mesh->vertex_count, 3 * sizeof *mesh->positions);
    mesh->corners = array_new(mesh->tet_count, 4 * sizeof *mesh->corners);
    bool all = mesh->positions && mesh->corners;
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        mesh->fields[f].values = array_new(mesh->vertex_count,
                                           mesh->fields[f].components * sizeof *mesh->fields[f].values);
        all &= mesh->fields[f].values != NULL;
    }
    return all;
}

/* In blocks, because the columns of a point lie together. */
static void fill_mesh(const struct forest_view *view, struct tetmesh *mesh)
{
    enum { BLOCK = 1024 };
    forest_view_corners(view, 0, mesh->tet_count, mesh->corners);
    for (uint32_t first = 0; first < mesh->vertex_count; first += BLOCK) {
        size_t count = mesh->vertex_count - first < BLOCK ? mesh->vertex_count - first : BLOCK;
        forest_view_values(view, 0, first, count, mesh->positions + 3 * (size_t)first);
        for (uint32_t f = 0; f < mesh->field_count; f++)
            forest_view_values(view, 1 + f, first, count,
                               mesh->fields[f].values + (size_t)mesh->fields[f].components * first);
    }
}

enum tetlod_status forest_mesh(const struct forest *forest, uint32_t level, struct tetmesh *out,
                               struct tetlod_error *error)
{
    struct forest_view *view;
    *out = (struct tetmesh){0};
    TETLOD_TRY(forest_view_new(&view, forest, level, error));
    enum tetlod_status status = tetmesh_shape(tetlod_info(forest->file), level, out, error);
    if (status == TETLOD_OK && !allocate_arrays(out)) {
        status = tetlodi_fail_nomem(error, "a level", (uint64_t)out->tet_count * 16);
        tetmesh_fini(out);
    }
    if (status == TETLOD_OK)
        fill_mesh(view, out);
    forest_view_free(view);
    return status;
}
