/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A cursor replays records by decoding them and undoes them from the state's own memory. What the coder has learned carries on
 * from level to level, so that its models are kept at every level's start that has been passed: going up again decodes
 * the level's frames anew from there.
 */
#include <stdlib.h>
#include <string.h>

#include "format/base.h"
#include "format/fail.h"
#include "format/reader.h"

struct models { /* at the start of a level's records */
    struct tetlodi_geometry_model geometry;
    struct tetlodi_field_model *fields; /* [field_count] */
};

struct tetlod_cursor {
    struct tetlod_file *file; /* borrowed */
    struct tetlodi_state state;
    struct tetlodi_codec codec;
    uint32_t *components; /* [field_count] of the selected fields, else 0 */
    uint8_t *wide;        /* [field_count] */
    uint8_t **frames;     /* [1 + field_count] of the level that is being decoded */
    struct models **models; /* [level_count] by the level that they lead to */
    uint32_t level, done; /* the state is level `level` and `done` records of the next */
    bool decoding;        /* the coders stand right behind those records */
};

static void drop_frames(struct tetlod_cursor *cursor)
{
    for (uint32_t part = 0; part <= cursor->file->index.info.field_count && cursor->frames; part++) {
        free(cursor->frames[part]);
        cursor->frames[part] = NULL;
    }
    cursor->decoding = false;
}

/* Reads the frames of a level and sets the coders on them. */
static enum tetlod_status load_frames(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    drop_frames(cursor);
    for (uint32_t part = 0; part <= cursor->file->index.info.field_count; part++) {
        size_t size;
        if (part && !cursor->components[part - 1])
            continue;
        TETLOD_TRY(tetlodi_read_frame(cursor->file, level, part, &cursor->frames[part], &size, error));
        tetlodi_decoder_init(part ? &cursor->codec.fields[part - 1] : &cursor->codec.geometry, cursor->frames[part], size);
    }
    return TETLOD_OK;
}

static enum tetlod_status save_models(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    uint32_t fields = cursor->state.field_count;
    if (level >= cursor->file->index.info.level_count || cursor->models[level])
        return TETLOD_OK;
    struct models *models = malloc(sizeof *models + fields * sizeof *models->fields);
    if (!models)
        return tetlodi_fail_nomem(error, "the coder's models", sizeof *models);
    models->fields = (struct tetlodi_field_model *)(models + 1);
    models->geometry = cursor->codec.geometry_model;
    memcpy(models->fields, cursor->codec.field_models, fields * sizeof *models->fields);
    cursor->models[level] = models;
    return TETLOD_OK;
}

/* A decision costs at least 1/89 bit (SPEC.md, entropy coding) and a tetrahedron one, a vertex more: a frame that promises more
 * than it can hold is not given the memory. */
static enum tetlod_status check_promise(const struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    const struct tetlodi_index *index = &cursor->file->index;
    const struct tetlod_level *now = &index->info.levels[level];
    uint64_t most = 1024 * ((uint64_t)index->frames[(size_t)level * (index->info.field_count + 1)].raw + 1);
    uint64_t tets = now->tets - (level ? now[-1].tets : 0), vertices = now->vertices - (level ? now[-1].vertices : 0);
    if (tets <= most && vertices <= most)
        return TETLOD_OK;
    return tetlodi_fail(error, TETLOD_ERR_STREAM, "level %u promises more than its bytes can hold", level);
}

static enum tetlod_status read_base(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    const struct tetlod_level *base = &cursor->file->index.info.levels[0];
    TETLOD_TRY(check_promise(cursor, 0, error));
    TETLOD_TRY(load_frames(cursor, 0, error));
    TETLOD_TRY(tetlodi_state_reserve(&cursor->state, base->vertices, base->tets, error));
    TETLOD_TRY(tetlodi_base_code(&cursor->codec, base->vertices, base->tets, error));
    TETLOD_TRY(tetlodi_state_begin(&cursor->state, base->vertices, base->tets, error));
    drop_frames(cursor);
    return save_models(cursor, 1, error);
}

static enum tetlod_status select_fields(struct tetlod_cursor *cursor, const uint32_t *fields, uint32_t field_count,
                                        struct tetlod_error *error)
{
    const struct tetlod_info *info = &cursor->file->index.info;
    for (uint32_t f = 0; f < info->field_count; f++) {
        cursor->components[f] = fields ? 0 : info->fields[f].components;
        cursor->wide[f] = info->fields[f].type == TETLOD_FLOAT64;
    }
    for (uint32_t i = 0; i < field_count && fields; i++) {
        if (fields[i] >= info->field_count)
            return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "there is no field number %u", fields[i]);
        cursor->components[fields[i]] = info->fields[fields[i]].components;
    }
    return TETLOD_OK;
}

enum tetlod_status tetlod_cursor_new(struct tetlod_cursor **out, struct tetlod_file *file, const uint32_t *fields,
                                     uint32_t field_count, struct tetlod_error *error)
{
    const struct tetlod_info *info = &file->index.info;
    struct tetlod_cursor *cursor = calloc(1, sizeof *cursor);
    *out = NULL;
    if (!cursor)
        return tetlodi_fail_nomem(error, "a cursor", sizeof *cursor);
    cursor->file = file;
    cursor->components = calloc(info->field_count + 1, sizeof *cursor->components);
    cursor->wide = calloc(info->field_count + 1, 1);
    cursor->frames = calloc(info->field_count + 1, sizeof *cursor->frames);
    cursor->models = calloc(info->level_count, sizeof *cursor->models);
    enum tetlod_status status = TETLOD_OK;
    if (!cursor->components || !cursor->wide || !cursor->frames || !cursor->models)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "a cursor", info->level_count * sizeof *cursor->models));
    TETLOD_TRY_DONE(select_fields(cursor, fields, field_count, error));
    TETLOD_TRY_DONE(tetlodi_state_init(&cursor->state, cursor->components, info->field_count,
                                       file->max_bytes > SIZE_MAX ? SIZE_MAX : (size_t)file->max_bytes, error));
    TETLOD_TRY_DONE(tetlodi_codec_init(&cursor->codec, &cursor->state, info->position_type == TETLOD_FLOAT64,
                                       cursor->wide, error));
    TETLOD_TRY_DONE(read_base(cursor, error));
    *out = cursor;
done:
    if (status != TETLOD_OK)
        tetlod_cursor_free(cursor);
    return status;
}

void tetlod_cursor_free(struct tetlod_cursor *cursor)
{
    if (!cursor)
        return;
    drop_frames(cursor);
    for (uint32_t k = 0; k < cursor->file->index.info.level_count && cursor->models; k++)
        free(cursor->models[k]);
    free(cursor->models);
    free(cursor->frames);
    tetlodi_codec_fini(&cursor->codec);
    tetlodi_state_fini(&cursor->state);
    free(cursor->components);
    free(cursor->wide);
    free(cursor);
}

/* ---- up */

static enum tetlod_status begin_level(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    const struct models *models = cursor->models[cursor->level + 1];
    const struct tetlod_level *next = &cursor->file->index.info.levels[cursor->level + 1];
    TETLOD_TRY(check_promise(cursor, cursor->level + 1, error));
    TETLOD_TRY(load_frames(cursor, cursor->level + 1, error));
    TETLOD_TRY(tetlodi_state_reserve(&cursor->state, next->vertices, next->tets, error));
    cursor->codec.geometry_model = models->geometry;
    memcpy(cursor->codec.field_models, models->fields, cursor->state.field_count * sizeof *models->fields);
    tetlodi_level_begin(&cursor->codec);
    cursor->decoding = true;
    return TETLOD_OK;
}

/* Decodes the next record of the level and brings it in. */
static enum tetlod_status next_record(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    const struct tetlod_level *next = &cursor->file->index.info.levels[cursor->level + 1];
    struct tetlodi_state *state = &cursor->state;
    struct tetlodi_record record = {0};
    bool found = false;
    while (!found && cursor->codec.walk < state->vertices)
        found = tetlodi_walk_step(&cursor->codec, false, &record.slot);
    if (!found || cursor->codec.geometry.in.failed)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "level %u has fewer records than its index says", cursor->level + 1);
    TETLOD_TRY(tetlodi_record_code(&cursor->codec, &record, error));
    if (record.children - 1 > next->vertices - state->vertices || record.tet_count > next->tets - state->tets)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "level %u has more in it than its index says", cursor->level + 1);
    TETLOD_TRY(tetlodi_state_split(state, &record, error));
    cursor->done++;
    return TETLOD_OK;
}

/* All of the level's records are in: is the level what its index says? */
static enum tetlod_status finish_level(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    const struct tetlod_level *next = &cursor->file->index.info.levels[cursor->level + 1];
    uint32_t slot;
    while (cursor->codec.walk < cursor->state.vertices)
        if (tetlodi_walk_step(&cursor->codec, false, &slot) || cursor->codec.geometry.in.failed)
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "level %u has more records than its index says",
                                cursor->level + 1);
    if (cursor->state.vertices != next->vertices || cursor->state.tets != next->tets)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "level %u has %u vertices and %u tetrahedra, its index says %u and %u",
                            cursor->level + 1, cursor->state.vertices, cursor->state.tets, next->vertices, next->tets);
    TETLOD_TRY(save_models(cursor, cursor->level + 2, error));
    drop_frames(cursor);
    cursor->level++;
    cursor->done = 0;
    return TETLOD_OK;
}

static enum tetlod_status undo_to(struct tetlod_cursor *cursor, uint32_t done, struct tetlod_error *error)
{
    drop_frames(cursor);
    for (; cursor->done > done; cursor->done--)
        TETLOD_TRY(tetlodi_state_undo(&cursor->state, error));
    return TETLOD_OK;
}

/* Brings in `count` records of the next level beyond those that are, all of them at most. On failure the level is undone. */
static enum tetlod_status replay(struct tetlod_cursor *cursor, uint32_t count, struct tetlod_error *error)
{
    uint32_t records = cursor->file->index.records[cursor->level + 1], wanted = cursor->done + count;
    enum tetlod_status status = TETLOD_OK;
    if (!cursor->decoding) { // the coders cannot go back: begin the level again
        TETLOD_TRY(undo_to(cursor, 0, error));
        status = begin_level(cursor, error);
    }
    while (status == TETLOD_OK && cursor->done < wanted)
        status = next_record(cursor, error);
    if (status == TETLOD_OK && wanted == records)
        status = finish_level(cursor, error);
    if (status == TETLOD_OK)
        return TETLOD_OK;
    struct tetlod_error ignored;
    if (undo_to(cursor, 0, &ignored) != TETLOD_OK)
        return tetlodi_fail(error, TETLOD_ERR_NOMEM, "out of memory while undoing a damaged level");
    return status;
}

enum tetlod_status tetlod_cursor_refine(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    if (cursor->level + 1 == cursor->file->index.info.level_count)
        return TETLOD_END;
    return replay(cursor, 1, error);
}

/* ---- down */

enum tetlod_status tetlod_cursor_coarsen(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    if (!cursor->done) {
        if (!cursor->level)
            return TETLOD_END;
        cursor->done = cursor->file->index.records[cursor->level--];
    }
    return undo_to(cursor, cursor->done - 1, error);
}

enum tetlod_status tetlod_cursor_seek(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    if (level >= cursor->file->index.info.level_count)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "there is no level %u; the finest is %u", level,
                            cursor->file->index.info.level_count - 1);
    if (cursor->done && level <= cursor->level)
        TETLOD_TRY(undo_to(cursor, 0, error));
    while (cursor->level > level) {
        cursor->done = cursor->file->index.records[cursor->level--];
        TETLOD_TRY(undo_to(cursor, 0, error));
    }
    while (cursor->level < level)
        TETLOD_TRY(replay(cursor, cursor->file->index.records[cursor->level + 1] - cursor->done, error));
    return TETLOD_OK;
}

void tetlod_cursor_mesh(const struct tetlod_cursor *cursor, struct tetlod_mesh *out)
{
    const struct tetlodi_state *state = &cursor->state;
    *out = (struct tetlod_mesh){.vertices = state->vertices,
                                .tets = state->tets,
                                .level = cursor->level,
                                .positions = state->positions,
                                .fields = (const double *const *)state->fields,
                                .corners = state->corners,
                                .parents = state->parents};
}
