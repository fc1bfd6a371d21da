/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: the forest, and a mesh that has the level before. The walk is the caller's: what each record does is planned of
 * the forest alone and applied, and the stars are kept as they were. Batches of such records are coded behind it, on
 * other threads if there are any: the geometry of one batch and, column by column, the fields of the one before. Each
 * column has a coder of its own, so the bytes are those of one thread.
 */
#include "format/write/record_write.h"

#include <stdlib.h>
#include <string.h>

#include "format/coding/record_fields.h"
#include "format/common/ascending.h"
#include "format/fail.h"

/* ---- numbers */

double tetlodi_node_value(const struct tetlodi_record_writer *w, uint32_t column, uint32_t node, size_t component)
{
    const struct tetlodi_write_field *field = column ? &w->in->fields[column - 1] : NULL;
    const double *values = !field ? w->in->positions : field->values ? field->values : field->exact,
                 *node_values = field ? field->node_values : w->in->node_positions;
    size_t n = w->replay->columns[column].components, originals = n * w->in->vertices, at = node * n + component;
    return at < originals ? values[at] : node_values[at - originals];
}

static unsigned axis_of(uint32_t column, size_t component)
{
    return column ? 0 : (unsigned)component;
}

bool tetlodi_node_is_rounded(const struct tetlodi_record_writer *w, uint32_t column, uint32_t node)
{
    return column && !w->in->fields[column - 1].values && node < w->in->vertices;
}

int64_t tetlodi_node_code(const struct tetlodi_record_writer *w, uint32_t column, uint32_t node, size_t component)
{
    int64_t code = scale_code(&w->replay->columns[column].scale, axis_of(column, component),
                              tetlodi_node_value(w, column, node, component));
    bool rounded = tetlodi_node_is_rounded(w, column, node);
    return rounded && code > w->in->fields[column - 1].most ? w->in->fields[column - 1].most : code;
}

/* ---- slots */

/* A vertex in numbers of the whole mesh. */
static uint32_t outside(const struct tetlodi_record_writer *w, uint32_t vertex)
{
    return w->part ? page_part_outside(w->part, vertex) : vertex;
}

void tetlodi_settle_node(struct tetlodi_record_writer *w, uint32_t node, uint32_t slot)
{
    const uint32_t number = outside(w, slot);
    w->node_at[slot] = node;
    for (uint32_t p = w->lineage->range[node].begin; p < w->lineage->range[node].end; p++)
        w->slot_at[p] = number;
}

uint32_t tetlodi_slot_of(const struct tetlodi_record_writer *w, uint32_t tet, int corner)
{
    return w->slot_at[w->lineage->position[w->in->corners[4 * (size_t)tet + (size_t)corner]]];
}

void tetlodi_settle_tet(struct tetlodi_record_writer *w, uint32_t number, uint32_t tet, const uint32_t corners[4])
{
    uint32_t slots[4];
    unsigned places = 0;
    for (int c = 0; c < 4; c++)
        slots[c] = outside(w, corners[c]);
    for (unsigned c = 0; c < 4; c++) {
        uint32_t slot = tetlodi_slot_of(w, tet, (int)c);
        places |= c << (slot == slots[0] ? 0 : slot == slots[1] ? 2 : slot == slots[2] ? 4 : 6);
    }
    w->original_of[number] = tet;
    w->places[number] = (uint8_t)places;
}

/* Does the leaf that a star's tetrahedron has at its vertex come from a node? */
static inline bool goes_with(const struct tetlodi_record_writer *w, uint32_t corner, const struct leaf_range *range)
{
    uint32_t place = (w->places[corner / 4] >> 2 * (corner & 3)) & 3u;
    uint32_t leaf = w->in->corners[4 * (size_t)w->original_of[corner / 4] + place];
    return w->lineage->position[leaf] - range->begin < range->end - range->begin;
}

bool tetlodi_tets_room(struct tetlodi_record_writer *w, size_t tets)
{
    return TETLODI_ROOM(w->memory, w->original_of, w->original_capacity, tets) &&
           TETLODI_ROOM(w->memory, w->places, w->places_capacity, tets);
}

/* Does the vertex at a slot split on the way to a level with that many contractions? */
static bool splits(const struct tetlodi_record_writer *w, uint32_t slot, uint32_t contractions)
{
    uint32_t node = w->node_at[slot];
    return node >= w->in->vertices && node - w->in->vertices >= contractions;
}

static bool is_original(const struct tetlodi_record_writer *w, uint32_t node)
{
    return node < w->in->vertices && !(w->in->later && w->in->later[node]);
}

/* The first axis along which two nodes are at different places; 3: at the same. */
static size_t axis_between(const struct tetlodi_record_writer *w, uint32_t a, uint32_t b)
{
    size_t axis = 0;
    while (axis < 3 && tetlodi_node_code(w, 0, a, axis) == tetlodi_node_code(w, 0, b, axis))
        axis++;
    return axis;
}

static bool same_place(const struct tetlodi_record_writer *w, uint32_t a, uint32_t b)
{
    return axis_between(w, a, b) == 3;
}

/* A node's children: the one at its own place first if there is one, which costs no position; else the least in x, y,
 * z, so that the sign of where the second lies can be learned. */
static uint32_t order_children(struct tetlodi_record_writer *w, uint32_t node, uint32_t *children)
{
    uint32_t count = lineage_child_count(w->lineage, node), first = 0;
    memcpy(children, lineage_children(w->lineage, node), count * sizeof *children);
    for (uint32_t c = 1; c < count; c++) {
        uint32_t a = children[c], b = children[first];
        size_t axis = axis_between(w, a, b);
        bool less = axis < 3 && tetlodi_node_code(w, 0, a, axis) < tetlodi_node_code(w, 0, b, axis);
        if (!same_place(w, b, node) && (same_place(w, a, node) || less))
            first = c;
    }
    uint32_t swap = children[0];
    children[0] = children[first];
    children[first] = swap;
    return count;
}

/* Tetrahedra that wait for this record only. */
static bool list_arrivals(struct tetlodi_record_writer *w, uint32_t node)
{
    uint32_t c = node - w->in->vertices, begin = w->lineage->meeting_begin[c], end = w->lineage->meeting_begin[c + 1];
    size_t tets = w->replay->tets + (size_t)(end - begin);
    if (!TETLODI_ROOM(w->memory, w->arrived, w->arrived_capacity, end - begin) ||
        !tetlodi_tets_room(w, tets) ||
        !TETLODI_ROOM(w->memory, w->replay->corners, w->replay->corners_capacity, 4 * tets))
        return false;
    w->arrived_count = 0;
    for (uint32_t i = begin; i < end; i++)
        if (--w->lineage->waiting[w->lineage->meeting[i]] == 0) {
            w->arrived[w->arrived_count++].tet = w->lineage->meeting[i];
            __builtin_prefetch(w->in->corners + 4 * (size_t)w->lineage->meeting[i]);
        }
    return true;
}

static bool is_even_permutation(const uint32_t a[4], const uint32_t b[4])
{
    unsigned swaps = 0;
    uint32_t c[4] = {b[0], b[1], b[2], b[3]};
    for (int i = 0; i < 4; i++)
        for (int j = i + 1; j < 4 && c[i] != a[i]; j++)
            if (c[j] == a[i]) {
                c[j] = c[i];
                c[i] = a[i];
                swaps++;
            }
    return swaps % 2 == 0;
}

/* A vertex of the whole mesh in numbers of the part; TETLOD_NONE: it has no such vertex. */
static uint32_t inside(const struct tetlodi_record_writer *w, uint32_t number)
{
    const struct tetlodi_page_part *part = w->part;
    uint32_t place;
    if (!part)
        return number;
    const uint32_t first = part->runs->first_vertex;
    place = number < first ? ascending_place(part->listed, part->listed_count, number)
                           : part->listed_count + (number - first);
    return place <= w->replay->vertices && page_part_outside(part, place) == number ? place : TETLOD_NONE;
}

/* Is a tetrahedron there, between the vertex and its child, and at which edge of the link? */
static void look_at(const struct tetlodi_record_writer *w, struct tetlodi_arrival *arrival,
                    const struct tetlodi_star_view *star)
{
    const uint32_t ends[2] = {outside(w, star->vertex), outside(w, w->replay->vertices)};
    uint32_t *corners = arrival->corners;
    int others = 0;
    arrival->there = true;
    for (int c = 0; c < 4; c++) {
        uint32_t slot = tetlodi_slot_of(w, arrival->tet, c);
        corners[c] = slot == ends[0] ? star->vertex : slot == ends[1] ? w->replay->vertices : inside(w, slot);
        arrival->there &= corners[c] != TETLOD_NONE;
        if (slot != ends[0] && slot != ends[1] && others < 2)
            arrival->others[others++] = corners[c];
        for (int d = 0; d < c; d++)
            arrival->there &= corners[c] != corners[d];
    }
    arrival->edge = arrival->there ? tetlodi_star_edge(star, &w->recorder.marks, arrival->others[0],
                                                      arrival->others[1]) : TETLOD_NONE;
}

/* Takes a tetrahedron out of those that wait, into the order of arrival, with its corners as the stream has them. */
static void arrive(struct tetlodi_record_writer *w, uint32_t i, const uint32_t corners[4], uint32_t *count)
{
    uint32_t number = w->replay->tets + (*count)++;
    memcpy(w->replay->corners + 4 * (size_t)number, corners, 4 * sizeof *corners);
    for (int c = 0; c < 4; c++)
        __builtin_prefetch(w->replay->stars + corners[c]);
    tetlodi_settle_tet(w, number, w->arrived[i].tet, corners);
    w->arrived[i] = w->arrived[--w->arrived_count];
}

/* The first of those that wait at the first edge from `edge` on; arrived_count: there is none. */
static uint32_t next_at_edge(const struct tetlodi_record_writer *w, uint32_t edge)
{
    uint32_t least = TETLOD_NONE, found = w->arrived_count;
    for (uint32_t i = 0; i < w->arrived_count; i++)
        if (w->arrived[i].edge >= edge && w->arrived[i].edge < least) {
            least = w->arrived[i].edge;
            found = i;
        }
    return found;
}

/* Plans a waiting tetrahedron at its link edge, and in which orientation it comes back. */
static void plan_edge(struct tetlodi_record_writer *w, struct tetlodi_star_view *star, uint32_t i, uint32_t *count)
{
    uint32_t corners[4], e = w->arrived[i].edge;
    tetlodi_star_between(star, w->replay, e, w->replay->vertices, corners);
    star->made[e] = is_even_permutation(w->arrived[i].corners, corners) ? MADE : MADE_FLIPPED;
    if (star->made[e] == MADE_FLIPPED)
        corners_flip(corners);
    arrive(w, i, corners, count);
}

/* What the rule of link edges leaves. 0 if out of memory. */
static int plan_extras(struct tetlodi_record_writer *w, struct tetlodi_star_view *star, uint32_t *count)
{
    for (uint32_t i = 0; i < w->arrived_count;) {
        const struct tetlodi_arrival *arrival = &w->arrived[i];
        uint32_t corners[4] = {star->vertex, w->replay->vertices, arrival->others[0], arrival->others[1]};
        if (!arrival->there) {
            i++;
            continue;
        }
        if (!is_even_permutation(arrival->corners, corners)) {
            corners[2] = arrival->others[1];
            corners[3] = arrival->others[0];
        }
        if (!TETLODI_ROOM(w->memory, star->extras, star->extras_capacity, star->extra_count + (size_t)1))
            return 0;
        for (int k = 0; k < 2; k++)
            star->extras[star->extra_count][k] = tetlodi_place_of(&w->recorder, corners[2 + k]);
        star->extra_count++;
        arrive(w, i, corners, count);
    }
    return 1;
}

/* Plans how a child parts from the rest, and puts the tetrahedra that come back behind those that are there: their
 * number, or TETLOD_NONE if out of memory. */
static uint32_t plan_split(struct tetlodi_record_writer *w, struct tetlodi_star_view *star, uint32_t node)
{
    uint32_t count = 0;
    const struct leaf_range range = w->lineage->range[node];
    for (uint32_t i = 0; i < star->size; i++)
        star->labels[i] = goes_with(w, star->corners[i], &range);
    tetlodi_settle_node(w, node, w->replay->vertices);
    for (uint32_t i = 0; i < w->arrived_count; i++)
        look_at(w, &w->arrived[i], star);
    for (uint32_t i = next_at_edge(w, 0); i < w->arrived_count;) {
        uint32_t edge = w->arrived[i].edge;
        plan_edge(w, star, i, &count);
        i = next_at_edge(w, edge + 1);
    }
    return plan_extras(w, star, &count) ? count : TETLOD_NONE;
}

static enum tetlod_status no_memory(const struct tetlodi_record_writer *w, struct tetlod_error *error)
{
    return tetlodi_fail_nomem(error, "the stream", (uint64_t)w->in->tets * 64);
}

static enum tetlod_status wrong_page(struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                        "the sequence cannot be written: a contraction is in the wrong page");
}

enum { AHEAD = 32 }; /* vertices: about three records of a usual level */

/* What the record of a vertex that comes soon needs, where it is another miss of the cache for each tetrahedron. */
static void prefetch_star(const struct tetlodi_record_writer *w, uint32_t slot)
{
    const struct tetlodi_star *star = &w->replay->stars[slot];
    const uint32_t *corners = w->replay->pool + star->at;
    __builtin_prefetch(w->lineage->meeting_begin + (w->node_at[slot] - w->in->vertices));
    for (uint32_t i = 0; i < star->size; i++) {
        __builtin_prefetch(w->original_of + corners[i] / 4);
        __builtin_prefetch(w->places + corners[i] / 4);
        __builtin_prefetch(w->replay->corners + corners[i]);
    }
}

/* The corners that the labels of a star are found from, in time. */
static void prefetch_corners(const struct tetlodi_record_writer *w, uint32_t slot)
{
    const struct tetlodi_star *star = &w->replay->stars[slot];
    const uint32_t *corners = w->replay->pool + star->at;
    for (uint32_t i = 0; i < star->size; i++)
        __builtin_prefetch(w->in->corners + 4 * (size_t)w->original_of[corners[i] / 4]);
}

/* Parts a child from the vertex. Its position and the vertex's are in place. */
static enum tetlod_status part_child(struct tetlodi_record_writer *w, struct tetlodi_star_view *star,
                                     const struct tetlodi_record *record, uint32_t i, struct tetlod_error *error)
{
    struct tetlodi_replay *replay = w->replay;
    w->recorder.labels += star->size;
    tetlodi_star_part(star, replay, replay->vertices);
    uint32_t added = plan_split(w, star, record->nodes[i]);
    if (added == TETLOD_NONE || !tetlodi_replay_log_labels(replay, star->labels, star->size))
        return no_memory(w, error);
    if (added > w->recorder.most_tets - replay->tets)
        return wrong_page(error);
    if (!tetlodi_replay_log(replay, star->vertex, added, i == 1) || !tetlodi_replay_apply(replay))
        return no_memory(w, error);
    return TETLOD_OK;
}

/* Plans the record of a vertex and applies it. */
static enum tetlod_status plan_record(struct tetlodi_record_writer *w, uint32_t slot, struct tetlod_error *error)
{
    struct tetlodi_batch *batch = w->planned;
    struct tetlodi_replay *replay = w->replay;
    struct tetlodi_record *record = &batch->records[batch->count++];
    uint32_t node = w->node_at[slot];
    *record = (struct tetlodi_record){.vertex = slot, .first_child = replay->vertices};
    record->children = order_children(w, node, record->nodes);
    if (record->children - 1 > w->recorder.most_vertices - replay->vertices)
        return wrong_page(error);
    if (!list_arrivals(w, node))
        return no_memory(w, error);
    prefetch_corners(w, slot);
    for (uint32_t i = 0; i < record->children; i++) {
        record->leaves |= (unsigned)is_original(w, record->nodes[i]) << i;
        for (size_t axis = 0; axis < 3; axis++)
            record->codes[axis][i] = tetlodi_node_code(w, 0, record->nodes[i], axis);
    }
    w->node_at[slot] = record->nodes[0];
    for (uint32_t i = 1; i < record->children; i++) {
        struct tetlodi_star_view *star = &batch->stars[batch->star_count++];
        if (!tetlodi_star_lay_out(star, &w->recorder.marks, replay, slot))
            return no_memory(w, error);
        if (i == 1)
            TETLOD_TRY(tetlodi_record_place(replay, record, error));
        TETLOD_TRY(part_child(w, star, record, i, error));
    }
    if (w->part && w->arrived_count)
        return wrong_page(error);
    replay->label = 0; // the writer never goes back
    replay->records = replay->all_records = replay->splits = replay->all_splits = 0;
    return TETLOD_OK;
}

enum tetlod_status tetlodi_write_vertex(struct tetlodi_record_writer *w, uint32_t contractions,
                                        struct tetlod_error *error)
{
    struct tetlodi_batch *batch = w->planned;
    if (tetlodi_walk_ended(&w->recorder))
        return wrong_page(error);
    uint32_t slot = w->recorder.walk;
    bool split = splits(w, slot, contractions);
    if (slot + AHEAD < w->replay->vertices && splits(w, slot + AHEAD, contractions))
        prefetch_star(w, slot + AHEAD);
    uint32_t model = tetlodi_level_asks(&w->recorder, split);
    if (model == TETLOD_NONE)
        return TETLOD_OK;
    if (!TETLODI_ROOM(w->memory, batch->asked, batch->asked_capacity, batch->asked_count + 1))
        return no_memory(w, error);
    batch->asked[batch->asked_count++] = (uint8_t)(model | (split ? ASKED_SPLITS : 0));
    if (!split)
        return TETLOD_OK;
    TETLOD_TRY(plan_record(w, slot, error));
    return batch->star_count + MAX_CHILDREN > w->batch_stars ? tetlodi_write_batch(w, NULL, error) : TETLOD_OK;
}

/* ---- coding */

static void codes_of(void *opaque, uint32_t field, const struct tetlodi_field_record *record, int64_t (*codes)[4])
{
    const struct tetlodi_record_writer *w = opaque;
    for (size_t n = w->replay->columns[field].components, k = 0; k < n; k++)
        for (uint32_t i = 0; i < record->children; i++)
            codes[k][i] = tetlodi_node_code(w, field, record->nodes[i], k);
}

/* What a column has coded becomes its frame, behind which the next one begins. */
static void end_frame(struct tetlodi_record_writer *w, uint32_t column, struct tetlodi_buffer *frames)
{
    struct tetlodi_written *to = &w->written[column];
    if (!frames)
        return;
    tetlodi_encode_finish(&w->recorder.coders[column]);
    tetlodi_put_block(&frames[column], to->encoder.bytes, to->encoder.size);
    to->failed |= frames[column].failed || to->encoder.failed;
    tetlodi_encode_start(&w->recorder.coders[column], w->slowest, &to->encoder, &to->memory);
}

static void code_geometry(struct tetlodi_record_writer *w)
{
    struct tetlodi_batch *batch = w->coded;
    struct tetlodi_record *record = batch->records;
    struct tetlodi_star_view *star = batch->stars;
    for (size_t at = 0; at < batch->asked_count;) {
        at += tetlodi_splits_encode(&w->recorder, batch->asked + at, batch->asked_count - at);
        if (!(batch->asked[at - 1] & ASKED_SPLITS))
            break;
        if (!tetlodi_record_encode(&w->recorder, &w->written[0].memory, record, star))
            w->written[0].failed = true;
        star += record++->children - 1;
    }
    end_frame(w, 0, batch->frames);
}

static int code_column(void *opaque, uint32_t column)
{
    struct tetlodi_record_writer *w = opaque;
    if (!column) {
        code_geometry(w);
    } else {
        tetlodi_field_encode(&w->recorder, w->fields_log, column, codes_of, w);
        end_frame(w, column, w->fields_frames);
    }
    return 1;
}

static enum tetlod_status await_columns(struct tetlodi_record_writer *w, struct tetlod_error *error)
{
    bool failed = false;
    tetlodi_helpers_wait(w->helpers);
    for (uint32_t c = 0; c < w->replay->column_count; c++)
        failed |= w->written[c].failed || w->written[c].encoder.failed;
    return failed ? no_memory(w, error) : TETLOD_OK;
}

enum tetlod_status tetlodi_write_batch(struct tetlodi_record_writer *w, struct tetlodi_buffer *frames,
                                       struct tetlod_error *error)
{
    struct tetlodi_batch *coded = w->planned;
    struct tetlodi_recorder *recorder = &w->recorder;
    TETLOD_TRY(await_columns(w, error));
    w->fields_log = recorder->log;
    w->fields_frames = w->coded->frames;
    recorder->log = recorder->log ? &recorder->logs[recorder->log == recorder->logs] : NULL;
    if (recorder->log)
        tetlodi_field_log_clear(recorder->log);
    w->planned = w->coded;
    w->coded = coded;
    coded->frames = frames;
    w->planned->count = w->planned->star_count = 0;
    w->planned->asked_count = 0;
    w->planned->frames = NULL;
    tetlodi_helpers_start(w->helpers, code_column, w, w->replay->column_count);
    return TETLOD_OK;
}

enum tetlod_status tetlodi_write_rest(struct tetlodi_record_writer *w, struct tetlod_error *error)
{
    TETLOD_TRY(tetlodi_write_batch(w, NULL, error));
    TETLOD_TRY(tetlodi_write_batch(w, NULL, error)); // its fields
    return await_columns(w, error);
}

/* ---- beginning and end */

static enum tetlod_type original_type(const struct tetlodi_write_field *field)
{
    return field->was_float64 ? TETLOD_FLOAT64 : field->type;
}

void tetlodi_set_columns(const struct tetlodi_write_input *in, struct tetlodi_column *columns)
{
    columns[0].components = 3;
    columns[0].scale.type = in->position_type;
    columns[0].scale.original = in->positions_were_float64 ? TETLOD_FLOAT64 : in->position_type;
    columns[0].scale.bits = in->position_bits;
    memcpy(columns[0].scale.origin, in->position_origin, sizeof in->position_origin);
    memcpy(columns[0].scale.step, in->position_step, sizeof in->position_step);
    for (uint32_t f = 0; f < in->field_count; f++) {
        const struct tetlodi_write_field *field = &in->fields[f];
        columns[1 + f].components = field->components;
        columns[1 + f].scale = (struct tetlodi_scale){field->type, original_type(field), field->bits,
                                                      {field->origin}, {field->step}};
    }
}

void tetlodi_set_codes(const struct tetlodi_record_writer *w, uint32_t vertex, uint32_t node)
{
    for (uint32_t c = 0; c < w->replay->column_count; c++) {
        size_t n = w->replay->columns[c].components;
        for (size_t k = 0; k < n; k++)
            w->replay->columns[c].codes[vertex * n + k] = tetlodi_node_code(w, c, node, k);
    }
}

enum { A_BATCH = 64 };

static bool batch_init(struct tetlodi_batch *batch, size_t stars)
{
    batch->records = malloc(stars * sizeof *batch->records);
    batch->stars = calloc(stars, sizeof *batch->stars);
    return batch->records && batch->stars;
}

enum tetlod_status tetlodi_record_writer_init(struct tetlodi_record_writer *w, size_t vertices, size_t tets,
                                              struct tetlod_error *error)
{
    w->memory = w->replay->memory;
    w->written = calloc(w->replay->column_count, sizeof *w->written);
    w->batch_stars = w->helpers ? A_BATCH : MAX_CHILDREN;
    w->planned = &w->batches[0];
    w->coded = &w->batches[1];
    if (!w->written || !batch_init(w->planned, w->batch_stars) || !batch_init(w->coded, w->batch_stars) ||
        !TETLODI_ROOM(w->memory, w->node_at, w->node_capacity, vertices) || !tetlodi_tets_room(w, tets))
        return no_memory(w, error);
    for (uint32_t c = 0; c < w->replay->column_count; c++)
        w->written[c].memory.most = UINT64_MAX;
    return tetlodi_recorder_init(&w->recorder, w->replay, error);
}

void tetlodi_record_writer_fini(struct tetlodi_record_writer *w)
{
    if (!w->memory)
        return;
    for (int i = 0; i < 2 && w->written; i++)
        tetlodi_field_log_fini(&w->recorder.logs[i], &w->written[0].memory);
    tetlodi_recorder_fini(&w->recorder);
    for (size_t c = 0; w->written && c < w->replay->column_count; c++)
        TETLODI_FREE(&w->written[c].memory, w->written[c].encoder.bytes, w->written[c].encoder.capacity);
    free(w->written);
    w->written = NULL;
    for (struct tetlodi_batch *batch = w->batches; batch < w->batches + 2; batch++) {
        for (size_t i = 0; batch->stars && i < w->batch_stars; i++)
            tetlodi_star_fini(&batch->stars[i], w->memory);
        TETLODI_FREE(w->memory, batch->asked, batch->asked_capacity);
        free(batch->records);
        free(batch->stars);
        *batch = (struct tetlodi_batch){0};
    }
    TETLODI_FREE(w->memory, w->node_at, w->node_capacity);
    TETLODI_FREE(w->memory, w->original_of, w->original_capacity);
    TETLODI_FREE(w->memory, w->places, w->places_capacity);
    TETLODI_FREE(w->memory, w->arrived, w->arrived_capacity);
}

void tetlodi_start_coders(struct tetlodi_record_writer *w, unsigned slowest)
{
    w->slowest = slowest;
    for (uint32_t c = 0; c < w->replay->column_count; c++)
        tetlodi_encode_start(&w->recorder.coders[c], slowest, &w->written[c].encoder, &w->written[c].memory);
}

enum tetlod_status tetlodi_end_frames(struct tetlodi_record_writer *w, struct tetlodi_buffer *frames,
                                      struct tetlod_error *error)
{
    for (uint32_t c = 0; c < w->replay->column_count; c++)
        end_frame(w, c, frames);
    return await_columns(w, error);
}
