/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/forest.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

struct column {
    char *name; /* owned; NULL for the position */
    uint32_t components;
    enum tetlod_type type;
    size_t offset; /* in a row */
};

struct counts {
    uint32_t vertices, tets;
};

struct forest {
    uint32_t level_count, column_count, slots, tets;
    struct counts *levels;
    struct column *columns; /* the position, then the fields */
    size_t row_size;
    uint32_t *parents; /* [slots] */
    uint32_t *corners; /* [4 * tets], of the finest level */
    size_t version_count;
    size_t *first_version;   /* [slots + 1] */
    uint32_t *version_level; /* from which it is valid */
    unsigned char *rows;     /* [row_size * version_count] */
};

/* What grows while the levels are replayed: versions in order of time. */
struct history {
    size_t count, slot_cap, level_cap, row_cap;
    uint32_t *slot, *level;
    unsigned char *rows;
    size_t *last; /* [slots] newest version of a slot */
};

void forest_free(struct forest *forest)
{
    if (!forest)
        return;
    for (uint32_t c = 0; forest->columns && c < forest->column_count; c++)
        free(forest->columns[c].name);
    free(forest->columns);
    free(forest->levels);
    free(forest->parents);
    free(forest->corners);
    free(forest->first_version);
    free(forest->version_level);
    free(forest->rows);
    free(forest);
}

uint64_t forest_bytes(const struct forest *forest)
{
    return (uint64_t)forest->slots * (4 + sizeof(size_t)) + (uint64_t)forest->tets * 16 +
           (uint64_t)forest->version_count * (4 + forest->row_size);
}

static size_t width_of(enum tetlod_type type)
{
    return type == TETLOD_FLOAT32 ? 4 : 8;
}

static bool describe(struct forest *forest, const struct tetlod_info *info)
{
    forest->level_count = info->level_count;
    forest->column_count = 1 + info->field_count;
    forest->slots = info->vertices;
    forest->tets = info->tets;
    forest->levels = array_new(info->level_count, sizeof *forest->levels);
    forest->columns = array_zero(forest->column_count, sizeof *forest->columns);
    forest->parents = array_new(forest->slots, sizeof *forest->parents);
    forest->corners = array_new(forest->tets, 4 * sizeof *forest->corners);
    if (!forest->levels || !forest->columns || !forest->parents || !forest->corners)
        return false;
    for (uint32_t c = 0; c < forest->column_count; c++) {
        struct column *column = &forest->columns[c];
        const struct tetlod_field *field = c ? &info->fields[c - 1] : NULL;
        column->components = field ? field->components : 3;
        column->type = field ? field->type : info->position_type;
        column->offset = forest->row_size;
        if (field && !(column->name = strdup(field->name)))
            return false;
        forest->row_size += column->components * width_of(column->type);
    }
    return true;
}

static void pack_row(const struct forest *forest, const struct tetlod_mesh *mesh, uint32_t slot, unsigned char *row)
{
    for (uint32_t c = 0; c < forest->column_count; c++) {
        const struct column *column = &forest->columns[c];
        const double *values = (c ? mesh->fields[c - 1] : mesh->positions) + (size_t)slot * column->components;
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

static bool add_version(struct history *history, size_t row_size, uint32_t slot, uint32_t level, const unsigned char *row)
{
    size_t count = history->count + 1;
    if (!array_reserve((void **)&history->slot, &history->slot_cap, count, sizeof *history->slot) ||
        !array_reserve((void **)&history->level, &history->level_cap, count, sizeof *history->level) ||
        !array_reserve((void **)&history->rows, &history->row_cap, count, row_size))
        return false;
    history->slot[count - 1] = slot;
    history->level[count - 1] = level;
    memcpy(history->rows + (count - 1) * row_size, row, row_size);
    history->last[slot] = count - 1;
    history->count = count;
    return true;
}

/* Takes what level `level` brought: new slots, and the slots whose contents are others. Levels grow geometrically, so
 * that looking at every slot at every level is some twenty looks a slot. */
static enum tetlod_status take_level(struct forest *forest, struct history *history, const struct tetlod_mesh *mesh,
                                     uint32_t level, unsigned char *row, struct tetlod_error *error)
{
    uint32_t known = level ? forest->levels[level - 1].vertices : 0;
    if (mesh->vertices > forest->slots || mesh->tets > forest->tets || mesh->vertices < known)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "level %u has more than the finest level", level);
    forest->levels[level] = (struct counts){mesh->vertices, mesh->tets};
    for (uint32_t v = 0; v < mesh->vertices; v++) {
        pack_row(forest, mesh, v, row);
        if (v < known && memcmp(row, history->rows + history->last[v] * forest->row_size, forest->row_size) == 0)
            continue;
        if (!add_version(history, forest->row_size, v, level, row))
            return tetlodi_fail_nomem(error, "a stream in memory", (history->count + 1) * (uint64_t)forest->row_size);
        if (v < known)
            continue;
        forest->parents[v] = mesh->parents[v];
        if (level && mesh->parents[v] >= v)
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "level %u: a vertex comes before its parent", level);
    }
    return TETLOD_OK;
}

/* History by time becomes versions by slot: a stable counting sort. */
static bool sort_versions(struct forest *forest, const struct history *history)
{
    forest->version_count = history->count;
    forest->first_version = array_zero((size_t)forest->slots + 2, sizeof *forest->first_version);
    forest->version_level = array_new(history->count, sizeof *forest->version_level);
    forest->rows = array_new(history->count, forest->row_size);
    if (!forest->first_version || !forest->version_level || !forest->rows)
        return false;
    size_t *next = forest->first_version + 1; // one ahead: ends as the slots' first versions
    for (size_t i = 0; i < history->count; i++)
        next[history->slot[i] + 1]++;
    for (uint32_t v = 0; v < forest->slots; v++)
        next[v + 1] += next[v];
    for (size_t i = 0; i < history->count; i++) {
        size_t place = next[history->slot[i]]++;
        forest->version_level[place] = history->level[i];
        memcpy(forest->rows + place * forest->row_size, history->rows + i * forest->row_size, forest->row_size);
    }
    return true;
}

static enum tetlod_status replay(struct forest *forest, struct history *history, struct tetlod_cursor *cursor,
                                 struct tetlod_error *error)
{
    enum tetlod_status status = TETLOD_OK;
    struct tetlod_mesh mesh;
    unsigned char *row = array_new(forest->row_size, 1);
    history->last = array_new(forest->slots, sizeof *history->last);
    if (!row || !history->last)
        status = tetlodi_fail_nomem(error, "a stream in memory", (uint64_t)forest->slots * sizeof *history->last);
    for (uint32_t level = 0; status == TETLOD_OK && level < forest->level_count; level++) {
        status = tetlod_cursor_seek(cursor, level, error);
        if (status != TETLOD_OK)
            break;
        tetlod_cursor_mesh(cursor, &mesh);
        status = take_level(forest, history, &mesh, level, row, error);
    }
    free(row);
    TETLOD_TRY(status);
    if (mesh.vertices != forest->slots || mesh.tets != forest->tets)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "the finest level is not as large as the index says");
    memcpy(forest->corners, mesh.corners, (size_t)forest->tets * 4 * sizeof *forest->corners);
    return sort_versions(forest, history) ? TETLOD_OK : tetlodi_fail_nomem(error, "a stream in memory", history->count);
}

enum tetlod_status forest_build(struct forest **out, struct tetlod_file *file, struct tetlod_error *error)
{
    struct tetlod_cursor *cursor = NULL;
    struct history history = {0};
    struct forest *forest = array_zero(1, sizeof *forest);
    enum tetlod_status status;
    *out = NULL;
    if (!forest || !describe(forest, tetlod_info(file)))
        status = tetlodi_fail_nomem(error, "a stream in memory", 16 * (uint64_t)tetlod_info(file)->tets);
    else
        status = tetlod_cursor_new(&cursor, file, NULL, 0, error);
    if (status == TETLOD_OK)
        status = replay(forest, &history, cursor, error);
    tetlod_cursor_free(cursor);
    free(history.slot);
    free(history.level);
    free(history.rows);
    free(history.last);
    if (status == TETLOD_OK)
        *out = forest;
    else
        forest_free(forest);
    return status;
}

static void unpack_row(const struct forest *forest, const unsigned char *row, uint32_t slot, struct tetmesh *mesh)
{
    for (uint32_t c = 0; c < forest->column_count; c++) {
        const struct column *column = &forest->columns[c];
        double *values = (c ? mesh->fields[c - 1].values : mesh->positions) + (size_t)slot * column->components;
        if (column->type == TETLOD_FLOAT64)
            memcpy(values, row + column->offset, 8 * column->components);
        else
            for (uint32_t i = 0; i < column->components; i++) {
                float value;
                memcpy(&value, row + column->offset + 4 * i, 4);
                values[i] = value;
            }
    }
}

static enum tetlod_status allocate_mesh(const struct forest *forest, uint32_t level, struct tetmesh *mesh,
                                        struct tetlod_error *error)
{
    mesh->vertex_count = forest->levels[level].vertices;
    mesh->tet_count = forest->levels[level].tets;
    mesh->position_type = forest->columns[0].type;
    mesh->positions = array_new(mesh->vertex_count, 3 * sizeof *mesh->positions);
    mesh->corners = array_new(mesh->tet_count, 4 * sizeof *mesh->corners);
    if (!mesh->positions || !mesh->corners)
        return tetlodi_fail_nomem(error, "a level", (uint64_t)mesh->tet_count * 16);
    for (uint32_t c = 1; c < forest->column_count; c++)
        TETLOD_TRY(tetmesh_add_field(mesh, forest->columns[c].name, forest->columns[c].components,
                                     forest->columns[c].type, error));
    return TETLOD_OK;
}

static void map_corners(const struct forest *forest, uint32_t *standing, struct tetmesh *mesh)
{
    uint32_t count = mesh->vertex_count;
    for (uint32_t v = 0; v < forest->slots; v++)
        standing[v] = v < count ? v : standing[forest->parents[v]];
    const uint32_t *leaves = forest->corners;
    uint32_t *corners = mesh->corners;
    for (size_t i = 0; i < (size_t)mesh->tet_count * 4; i++)
        corners[i] = standing[leaves[i]];
}

enum tetlod_status forest_mesh(const struct forest *forest, uint32_t level, struct tetmesh *out,
                               struct tetlod_error *error)
{
    *out = (struct tetmesh){0};
    uint32_t *standing = array_new(forest->slots, sizeof *standing);
    enum tetlod_status status = allocate_mesh(forest, level, out, error);
    if (status == TETLOD_OK && !standing)
        status = tetlodi_fail_nomem(error, "a level", (uint64_t)forest->slots * sizeof *standing);
    if (status == TETLOD_OK) {
        map_corners(forest, standing, out);
        for (uint32_t v = 0; v < out->vertex_count; v++) {
            size_t version = forest->first_version[v], end = forest->first_version[v + 1];
            while (version + 1 < end && forest->version_level[version + 1] <= level)
                version++;
            unpack_row(forest, forest->rows + version * forest->row_size, v, out);
        }
    } else
        tetmesh_fini(out);
    free(standing);
    return status;
}
