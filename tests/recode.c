/* SPDX-License-Identifier: BSD-3-Clause */
#include "tests/recode.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/read/reader.h"

struct reader {
    struct recode *out;
    const struct tetlodi_index *index;
    struct tetlod_cursor *cursor;
    const struct tetlod_info *info;
    double *positions, *node_positions, **values, **node_values, **exact;
    uint32_t *corners, *children, *node_at;
};

static void *copy(const void *array, size_t count, size_t size)
{
    void *new = malloc(count * size + 1);
    if (new)
        memcpy(new, array, count * size);
    return new;
}

/* The tail's values. The cursor is at the finest level. */
static int take_exact(struct reader *r)
{
    struct tetlod_mesh mesh;
    tetlod_cursor_mesh(r->cursor, &mesh);
    r->exact = calloc(r->info->field_count + (size_t)1, sizeof *r->exact);
    for (uint32_t f = 0; f < r->info->field_count && r->exact; f++)
        if (r->index->exact_later[f] &&
            !(r->exact[f] = copy(mesh.fields[f], mesh.vertices, r->info->fields[f].components * sizeof(double))))
            return 0;
    return r->exact != NULL;
}

/* The original's arrays, with room for the nodes. */
static int take_original(struct reader *r)
{
    struct tetlod_mesh mesh;
    tetlod_cursor_mesh(r->cursor, &mesh);
    r->positions = copy(mesh.positions, mesh.vertices, 3 * sizeof(double));
    r->corners = copy(mesh.corners, mesh.tets, 4 * sizeof(uint32_t));
    r->children = malloc((size_t)mesh.vertices * 4 * sizeof(uint32_t));
    r->node_positions = malloc((size_t)mesh.vertices * 3 * sizeof(double));
    r->node_at = malloc(mesh.vertices * sizeof(uint32_t));
    r->values = calloc(r->info->field_count + 1, sizeof *r->values);
    r->node_values = calloc(r->info->field_count + 1, sizeof *r->node_values);
    r->out->fields = calloc(r->info->field_count + 1, sizeof *r->out->fields);
    r->out->levels = calloc(r->info->level_count + (size_t)1, sizeof *r->out->levels);
    int done = r->positions && r->corners && r->children && r->node_positions && r->node_at && r->values &&
               r->node_values && r->out->fields && r->out->levels;
    for (uint32_t f = 0; f < r->info->field_count && done; f++) {
        size_t n = r->info->fields[f].components;
        r->values[f] = copy(mesh.fields[f], mesh.vertices, n * sizeof(double));
        r->node_values[f] = malloc(mesh.vertices * n * sizeof(double));
        done = r->values[f] && r->node_values[f];
    }
    for (uint32_t v = 0; v < mesh.vertices && done; v++)
        r->node_at[v] = v;
    return done;
}

/* Undoes one record: a contraction, or none where it is a level's exact tail. */
static enum tetlod_status contract(struct reader *r, uint32_t *contractions, struct tetlod_error *error)
{
    struct tetlod_mesh before, after;
    uint32_t contraction = *contractions, *children = r->children + 4 * (size_t)contraction;
    tetlod_cursor_mesh(r->cursor, &before);
    uint32_t v = before.parents[before.vertices - 1];
    TETLOD_TRY(tetlod_cursor_coarsen(r->cursor, error));
    tetlod_cursor_mesh(r->cursor, &after);
    if (after.vertices == before.vertices)
        return TETLOD_OK;
    ++*contractions;
    for (uint32_t i = 0; i < 4; i++) {
        uint32_t slot = i ? after.vertices + i - 1 : v;
        children[i] = slot < before.vertices ? r->node_at[slot] : TETLOD_NONE;
    }
    r->node_at[v] = r->info->vertices + contraction;
    memcpy(r->node_positions + 3 * (size_t)contraction, after.positions + 3 * (size_t)v, 3 * sizeof(double));
    for (uint32_t f = 0; f < r->info->field_count; f++) {
        size_t n = r->info->fields[f].components;
        memcpy(r->node_values[f] + n * contraction, after.fields[f] + n * v, n * sizeof(double));
    }
    return TETLOD_OK;
}

static enum tetlod_status take_sequence(struct reader *r, struct tetlod_error *error)
{
    uint32_t contractions = 0;
    for (uint32_t k = r->info->level_count; k-- > 0;) {
        struct tetlod_mesh mesh; // the tail has no records
        for (tetlod_cursor_mesh(r->cursor, &mesh); mesh.vertices > r->info->levels[k].vertices;
             tetlod_cursor_mesh(r->cursor, &mesh))
            TETLOD_TRY(contract(r, &contractions, error));
        r->out->levels[k] = (struct tetlodi_write_level){contractions, r->info->levels[k].domain_error,
                                                         r->info->levels[k].errors};
    }
    r->out->input.contractions = contractions;
    return TETLOD_OK;
}

static void fill_input(struct reader *r)
{
    struct tetlodi_write_input *input = &r->out->input;
    input->vertices = r->info->vertices;
    input->tets = r->info->tets;
    const struct tetlodi_scale *scale = &r->index->scales[0];
    input->position_type = scale->type;
    input->positions_were_float64 = scale->original != scale->type;
    input->position_bits = scale->bits;
    memcpy(input->position_origin, scale->origin, sizeof scale->origin);
    memcpy(input->position_step, scale->step, sizeof scale->step);
    input->positions = r->positions;
    input->corners = r->corners;
    input->children = r->children;
    input->node_positions = r->node_positions;
    input->field_count = r->info->field_count;
    input->level_count = r->info->level_count;
    input->fields = r->out->fields;
    input->levels = r->out->levels;
    input->degenerate_tets = r->info->degenerate_tets;
    input->inverted_tets = r->info->inverted_tets;
    input->unused_points = r->info->unused_points;
    input->metadata = r->info->metadata;
    input->compression = 1;
    for (uint32_t f = 0; f < input->field_count && r->values && r->node_values; f++) {
        const struct tetlod_field *field = &r->info->fields[f];
        scale = &r->index->scales[1 + f];
        r->out->fields[f] = (struct tetlodi_write_field){.name = field->name,
                                                         .components = field->components,
                                                         .type = scale->type,
                                                         .was_float64 = scale->original != scale->type,
                                                         .controlled = field->controlled,
                                                         .local_bound = field->bounds != TETLOD_NONE,
                                                         .bits = scale->bits,
                                                         .origin = scale->origin[0],
                                                         .step = scale->step[0],
                                                         .exact = r->exact ? r->exact[f] : NULL,
                                                         .range = {field->range[0], field->range[1]},
                                                         .values = r->values[f],
                                                         .node_values = r->node_values[f]};
    }
}

enum tetlod_status recode_read(struct recode *out, struct tetlod_file *file, struct tetlod_error *error)
{
    struct reader r = {.out = out, .index = &file->index, .info = tetlod_info(file)};
    *out = (struct recode){0};
    enum tetlod_status status = tetlod_cursor_new(&r.cursor, file, NULL, 0, error);
    if (status == TETLOD_OK)
        status = tetlod_cursor_seek(r.cursor, r.info->level_count - 1, error);
    if (status == TETLOD_OK && r.index->tail && !take_exact(&r))
        status = tetlodi_fail_nomem(error, "the exact values", r.info->tets);
    if (status == TETLOD_OK && r.index->tail)
        status = tetlod_cursor_seek(r.cursor, r.info->level_count - 2, error);
    if (status == TETLOD_OK && !take_original(&r))
        status = tetlodi_fail_nomem(error, "the sequence", r.info->tets);
    if (status == TETLOD_OK)
        status = take_sequence(&r, error);
    if (out->fields && out->levels)
        fill_input(&r);
    tetlod_cursor_free(r.cursor);
    free(r.node_at);
    free(r.values);
    free(r.exact);
    free(r.node_values);
    if (status != TETLOD_OK)
        recode_free(out);
    return status;
}

static void release(const void *array)
{
    union {
        const void *in;
        void *out;
    } pointer = {array}; // the input's pointers are const for the writer; here they are owned
    free(pointer.out);
}

void recode_free(struct recode *recode)
{
    for (uint32_t f = 0; f < recode->input.field_count; f++) {
        release(recode->fields[f].values);
        release(recode->fields[f].exact);
        release(recode->fields[f].node_values);
    }
    release(recode->input.positions);
    release(recode->input.corners);
    release(recode->input.children);
    release(recode->input.node_positions);
    free(recode->fields);
    free(recode->levels);
    *recode = (struct recode){0};
}

static void round_all(const double *values, size_t count, size_t step, double origin, double size, double most,
                      int narrow)
{
    union {
        const double *in;
        double *out;
    } pointer = {values};
    for (size_t i = 0; i < count; i += step) {
        double code = floor((pointer.out[i] - origin) / size + 0.5);
        code = code > 0 ? code < most ? code : most : 0;
        double value = origin + size * code;
        pointer.out[i] = narrow ? (double)(float)value : value;
    }
}

static void scale_all(const double *values, size_t count, double by)
{
    union {
        const double *in;
        double *out;
    } pointer = {values};
    for (size_t i = 0; i < count; i++)
        pointer.out[i] *= by;
}

void recode_scale(struct recode *recode, uint32_t f, double by)
{
    struct tetlodi_write_field *field = &recode->fields[f];
    size_t vertices = (size_t)recode->input.vertices * field->components;
    const double *of_vertices[] = {field->values, field->exact};
    for (int i = 0; i < 2; i++)
        if (of_vertices[i])
            scale_all(of_vertices[i], vertices, by);
    scale_all(field->node_values, (size_t)recode->input.contractions * field->components, by);
    scale_all(field->range, 2, by);
    field->origin *= by;
    field->step *= by;
}

/* Goes back to the original's values and has no tail. */
static void leave_tail_out(struct recode *recode)
{
    struct tetlodi_write_input *input = &recode->input;
    int tail = 0;
    for (uint32_t f = 0; f < input->field_count; f++) {
        struct tetlodi_write_field *field = &recode->fields[f];
        if (!field->exact)
            continue;
        release(field->values);
        field->values = field->exact;
        field->exact = NULL;
        tail = 1;
    }
    input->level_count -= tail;
}

void recode_quantise(struct recode *recode, unsigned position_bits, unsigned field_bits)
{
    struct tetlodi_write_input *input = &recode->input;
    if (field_bits)
        leave_tail_out(recode);
    size_t n = input->vertices, m = input->contractions;
    for (unsigned axis = 0; axis < 3 && position_bits; axis++) {
        double low = INFINITY, high = -INFINITY, most = (double)((1u << position_bits) - 1);
        for (size_t v = 0; v < n; v++) {
            low = fmin(low, input->positions[3 * v + axis]);
            high = fmax(high, input->positions[3 * v + axis]);
        }
        double size = high > low ? (high - low) / most : 1;
        input->position_bits = position_bits;
        input->position_origin[axis] = low;
        input->position_step[axis] = size;
        round_all(input->positions + axis, 3 * n - axis, 3, low, size, most, input->position_type == TETLOD_FLOAT32);
        if (m)
            round_all(input->node_positions + axis, 3 * m - axis, 3, low, size, most,
                      input->position_type == TETLOD_FLOAT32);
    }
    for (uint32_t f = 0; f < input->field_count && field_bits; f++) {
        struct tetlodi_write_field *field = &recode->fields[f];
        double most = (double)((1u << field_bits) - 1), span = field->range[1] - field->range[0];
        field->bits = field_bits;
        field->origin = field->range[0];
        field->step = span > 0 ? span / most : 1;
        round_all(field->values, n * field->components, 1, field->origin, field->step, most,
                  field->type == TETLOD_FLOAT32);
        round_all(field->node_values, m * field->components, 1, field->origin, field->step, most,
                  field->type == TETLOD_FLOAT32);
    }
}

void recode_exact_later(struct recode *recode, unsigned field_bits)
{
    struct tetlodi_write_input *input = &recode->input;
    for (uint32_t f = 1; f < input->field_count; f++) {
        struct tetlodi_write_field *field = &recode->fields[f];
        double most = (double)((1u << field_bits) - 1), span = field->range[1] / most - field->range[0] / most;
        field->bits = field_bits;
        field->origin = field->range[0];
        field->step = span > 0 ? span : 1;
        field->exact = field->values;
        field->values = copy(field->values, (size_t)input->vertices * field->components, sizeof(double));
        round_all(field->values, (size_t)input->vertices * field->components, 1, field->origin, field->step, most,
                  field->type == TETLOD_FLOAT32);
        round_all(field->node_values, (size_t)input->contractions * field->components, 1, field->origin, field->step,
                  most,
                  field->type == TETLOD_FLOAT32);
    }
    recode->levels[input->level_count] = recode->levels[input->level_count - 1];
    input->level_count++;
}
