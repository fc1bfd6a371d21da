/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The writer holds the same state as a cursor and walks it from the base mesh up, telling the codec what the contraction
 * forest says. Leaves are numbered depth first, so that "below a node" is a range. A tetrahedron comes back with the split of
 * the last of the nodes in which its corners meet.
 */
#include "format/writer.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <zstd.h>

#include "format/base.h"
#include "format/checksum.h"
#include "format/fail.h"
#include "format/index.h"

struct range {
    uint32_t begin, end;
};

struct writer {
    const struct tetlodi_write_input *in;
    struct tetlod_error *error;
    uint32_t nodes;
    uint32_t *parent;      /* [node] */
    struct range *range;   /* [node] of positions of its leaves */
    uint32_t *position;    /* [leaf] depth first */
    uint32_t *slot_at;     /* [position] slot of the leaf's living ancestor */
    uint32_t *meeting_begin, *meeting; /* [contraction + 1], tetrahedra whose corners meet in its node */
    uint8_t *waiting;      /* [tet] nodes still to be split before it is there */
    uint32_t *node_at;     /* [slot] */
    uint32_t *original_of; /* [tet in order of arrival] */
    uint32_t *arrived;     /* tetrahedra of the record at hand, original numbers */
    uint32_t (*arrived_corners)[4];
    size_t arrived_capacity;
    uint32_t *components;  /* [field] */
    uint8_t *wide;
    double *values;        /* [MOST_CHILDREN * row] */
    struct tetlodi_state state;
    struct tetlodi_codec codec;
    struct tetlodi_buffer *coded;  /* [1 + field_count] of the level at hand */
    struct tetlodi_buffer *stored; /* [level * (1 + field_count)] */
    struct tetlodi_index index;
    ZSTD_CCtx *zstd;
};

static enum tetlod_status out_of_memory(struct writer *w)
{
    return tetlodi_fail_nomem(w->error, "the stream", (uint64_t)w->in->tets * 64);
}

static const uint32_t *children_of(const struct writer *w, uint32_t node)
{
    return w->in->children + 4 * (size_t)(node - w->in->vertices);
}

static uint32_t child_count(const uint32_t *children)
{
    uint32_t count = 0;
    while (count < MOST_CHILDREN && children[count] != TETLOD_NONE)
        count++;
    return count;
}

/* ---- the forest */

static enum tetlod_status link_parents(struct writer *w)
{
    for (uint32_t node = 0; node < w->nodes; node++)
        w->parent[node] = TETLOD_NONE;
    for (uint32_t node = w->in->vertices; node < w->nodes; node++) {
        const uint32_t *children = children_of(w, node);
        uint32_t count = child_count(children);
        if (count < 2)
            return tetlodi_fail(w->error, TETLOD_ERR_ARGUMENT, "contraction %u has fewer than two vertices",
                                node - w->in->vertices);
        for (uint32_t c = 0; c < count; c++) {
            if (children[c] >= node || w->parent[children[c]] != TETLOD_NONE)
                return tetlodi_fail(w->error, TETLOD_ERR_ARGUMENT, "contraction %u takes a vertex that is not there",
                                    node - w->in->vertices);
            w->parent[children[c]] = node;
        }
    }
    return TETLOD_OK;
}

/* Sizes from the leaves up, then begins from the roots down: children follow each other inside their parent. */
static void number_leaves(struct writer *w)
{
    uint32_t next = 0;
    for (uint32_t node = 0; node < w->nodes; node++)
        w->range[node] = (struct range){0, node < w->in->vertices};
    for (uint32_t node = 0; node < w->nodes; node++)
        if (w->parent[node] != TETLOD_NONE)
            w->range[w->parent[node]].end += w->range[node].end;
    for (uint32_t node = w->nodes; node-- > 0;) {
        uint32_t size = w->range[node].end;
        if (w->parent[node] == TETLOD_NONE) {
            w->range[node] = (struct range){next, next + size};
            next += size;
        }
        if (node < w->in->vertices) {
            w->position[node] = w->range[node].begin;
            continue;
        }
        const uint32_t *children = children_of(w, node);
        uint32_t begin = w->range[node].begin;
        for (uint32_t c = 0; c < child_count(children); c++) {
            struct range *range = &w->range[children[c]];
            *range = (struct range){begin, begin + range->end};
            begin = range->end;
        }
    }
}

static bool below(const struct writer *w, uint32_t leaf, uint32_t node)
{
    return w->position[leaf] >= w->range[node].begin && w->position[leaf] < w->range[node].end;
}

/* The different nodes in which a tetrahedron's corners meet, three at most: those of neighbours in depth first order. */
static uint32_t meetings(const struct writer *w, uint32_t tet, uint32_t out[3])
{
    uint32_t leaves[4], count = 0;
    memcpy(leaves, w->in->corners + 4 * (size_t)tet, sizeof leaves);
    for (int i = 1; i < 4; i++)
        for (int j = i; j > 0 && w->position[leaves[j - 1]] > w->position[leaves[j]]; j--) {
            uint32_t swap = leaves[j];
            leaves[j] = leaves[j - 1];
            leaves[j - 1] = swap;
        }
    for (int i = 0; i < 3; i++) {
        uint32_t node = leaves[i];
        bool seen = false;
        while (node != TETLOD_NONE && !below(w, leaves[i + 1], node))
            node = w->parent[node];
        for (uint32_t k = 0; k < count; k++)
            seen |= out[k] == node;
        if (node != TETLOD_NONE && !seen)
            out[count++] = node;
    }
    return count;
}

static enum tetlod_status list_meetings(struct writer *w)
{
    uint32_t out[3], contractions = w->in->contractions;
    uint64_t total = 0;
    for (uint32_t t = 0; t < w->in->tets; t++) {
        w->waiting[t] = (uint8_t)meetings(w, t, out);
        for (uint32_t i = 0; i < w->waiting[t]; i++)
            w->meeting_begin[out[i] - w->in->vertices + 1]++;
        total += w->waiting[t];
    }
    if (total > UINT32_MAX)
        return tetlodi_fail(w->error, TETLOD_ERR_LIMIT, "the mesh is too large");
    w->meeting = malloc((total ? total : 1) * sizeof *w->meeting);
    uint32_t *next = malloc((contractions + (size_t)1) * sizeof *next);
    if (!w->meeting || !next) {
        free(next);
        return out_of_memory(w);
    }
    for (uint32_t c = 0; c < contractions; c++)
        w->meeting_begin[c + 1] += w->meeting_begin[c];
    memcpy(next, w->meeting_begin, contractions * sizeof *next);
    for (uint32_t t = 0; t < w->in->tets; t++) {
        uint32_t count = meetings(w, t, out);
        for (uint32_t i = 0; i < count; i++)
            w->meeting[next[out[i] - w->in->vertices]++] = t;
    }
    free(next);
    return TETLOD_OK;
}

/* ---- base mesh */

static const double *node_position(const struct writer *w, uint32_t node)
{
    uint32_t n = w->in->vertices;
    return node < n ? w->in->positions + 3 * (size_t)node : w->in->node_positions + 3 * (size_t)(node - n);
}

static void node_row(const struct writer *w, uint32_t node, double *out)
{
    uint32_t n = w->in->vertices;
    for (uint32_t f = 0; f < w->in->field_count; f++) {
        const struct tetlodi_write_field *field = &w->in->fields[f];
        size_t k = field->components;
        memcpy(out, node < n ? field->values + node * k : field->node_values + (node - n) * k, k * sizeof *out);
        out += k;
    }
}

static void add_vertex(struct writer *w, uint32_t node)
{
    struct tetlodi_state *state = &w->state;
    uint32_t v = state->vertices++;
    double *row = w->values;
    w->node_at[v] = node;
    memcpy(state->positions + 3 * (size_t)v, node_position(w, node), 3 * sizeof(double));
    node_row(w, node, row);
    for (uint32_t f = 0; f < state->field_count; row += state->components[f++])
        memcpy(state->fields[f] + (size_t)v * state->components[f], row, state->components[f] * sizeof *row);
    for (uint32_t p = w->range[node].begin; p < w->range[node].end; p++)
        w->slot_at[p] = v;
}

static uint32_t root_of(const struct writer *w, uint32_t leaf)
{
    while (w->parent[leaf] != TETLOD_NONE)
        leaf = w->parent[leaf];
    return leaf;
}

/* The tetrahedra that are always there, their vertices in the order in which they come, then the vertices that are left. */
static void make_base(struct writer *w)
{
    struct tetlodi_state *state = &w->state;
    for (uint32_t p = 0; p < w->in->vertices; p++)
        w->slot_at[p] = TETLOD_NONE;
    for (uint32_t t = 0; t < w->in->tets; t++) {
        if (w->waiting[t])
            continue;
        for (int c = 0; c < 4; c++) {
            uint32_t leaf = w->in->corners[4 * (size_t)t + (size_t)c];
            if (w->slot_at[w->position[leaf]] == TETLOD_NONE)
                add_vertex(w, root_of(w, leaf));
            state->corners[4 * (size_t)state->tets + (size_t)c] = w->slot_at[w->position[leaf]];
        }
        w->original_of[state->tets++] = t;
    }
    for (uint32_t v = 0; v < w->in->vertices; v++)
        if (w->slot_at[w->position[v]] == TETLOD_NONE)
            add_vertex(w, root_of(w, v));
}

/* ---- levels */

static void start_coders(struct writer *w)
{
    for (uint32_t part = 0; part <= w->in->field_count; part++) {
        w->coded[part].size = 0;
        tetlodi_encoder_init(part ? &w->codec.fields[part - 1] : &w->codec.geometry, &w->coded[part]);
    }
}

/* Closes the level's coders and stores what they have written. */
static enum tetlod_status store_level(struct writer *w, uint32_t level, uint32_t records)
{
    uint32_t parts = w->in->field_count + 1;
    const struct tetlodi_write_level *in = &w->in->levels[level];
    struct tetlod_level *out = &w->index.levels[level];
    out->vertices = w->state.vertices;
    out->tets = w->state.tets;
    out->domain_error = in->domain_error;
    memcpy(w->index.errors + (size_t)level * w->in->field_count * TETLOD_MEASURES, in->errors,
           w->in->field_count * TETLOD_MEASURES * sizeof(double));
    w->index.records[level] = records;
    for (uint32_t part = 0; part < parts; part++) {
        struct tetlodi_buffer *coded = &w->coded[part], *stored = &w->stored[(size_t)level * parts + part];
        struct tetlodi_frame *frame = &w->index.frames[(size_t)level * parts + part];
        tetlodi_encoder_finish(part ? &w->codec.fields[part - 1] : &w->codec.geometry);
        stored->capacity = ZSTD_compressBound(coded->size);
        stored->bytes = malloc(stored->capacity);
        if (coded->failed || !stored->bytes)
            return out_of_memory(w);
        if (coded->size > UINT32_MAX / 2)
            return tetlodi_fail(w->error, TETLOD_ERR_LIMIT, "level %u takes more than 2 GB; use a smaller --growth", level);
        stored->size = ZSTD_compress2(w->zstd, stored->bytes, stored->capacity, coded->bytes, coded->size);
        if (ZSTD_isError(stored->size))
            return tetlodi_fail(w->error, TETLOD_ERR_NOMEM, "zstd: %s", ZSTD_getErrorName(stored->size));
        *frame = (struct tetlodi_frame){0, (uint32_t)stored->size, (uint32_t)coded->size,
                                        tetlodi_crc32(stored->bytes, stored->size)};
    }
    return TETLOD_OK;
}

/* Does the vertex at a slot split on the way to a level with that many contractions? */
static bool splits(const struct writer *w, uint32_t slot, uint32_t contractions)
{
    uint32_t node = w->node_at[slot];
    return node >= w->in->vertices && node - w->in->vertices >= contractions;
}

/* A node's children, the one at its own position first if there is one: that is the cheapest to code. */
static uint32_t order_children(const struct writer *w, uint32_t node, uint32_t out[MOST_CHILDREN])
{
    const uint32_t *children = children_of(w, node);
    uint32_t count = child_count(children);
    memcpy(out, children, count * sizeof *out);
    for (uint32_t c = 1; c < count; c++)
        if (memcmp(node_position(w, out[c]), node_position(w, node), 24) == 0 &&
            memcmp(node_position(w, out[0]), node_position(w, node), 24) != 0) {
            uint32_t swap = out[0];
            out[0] = out[c];
            out[c] = swap;
        }
    return count;
}

static void fill_labels(struct writer *w, struct tetlodi_record *record, uint32_t node, const uint32_t *children)
{
    const struct tetlodi_star *star = &w->state.stars[record->slot];
    for (uint32_t i = 0; i < star->count; i++) {
        const uint32_t *leaves = w->in->corners + 4 * (size_t)w->original_of[w->state.pool[star->begin + i]];
        int c = 0;
        while (!below(w, leaves[c], node))
            c++;
        record->labels[i] = 0;
        while (!below(w, leaves[c], children[record->labels[i]]))
            record->labels[i]++;
    }
}

/* Tetrahedra that have waited for this split last. Their corners' slots are up to date. */
static enum tetlod_status fill_arrivals(struct writer *w, struct tetlodi_record *record, uint32_t node)
{
    uint32_t c = node - w->in->vertices, begin = w->meeting_begin[c], end = w->meeting_begin[c + 1];
    if (end - begin > w->arrived_capacity) {
        size_t capacity = (end - begin) + (size_t)64;
        uint32_t *arrived = realloc(w->arrived, capacity * sizeof *arrived);
        w->arrived = arrived ? arrived : w->arrived;
        void *corners = realloc(w->arrived_corners, capacity * sizeof *w->arrived_corners);
        w->arrived_corners = corners ? corners : w->arrived_corners;
        if (!arrived || !corners)
            return out_of_memory(w);
        w->arrived_capacity = capacity;
    }
    record->tet_count = 0;
    for (uint32_t i = begin; i < end; i++) {
        uint32_t tet = w->meeting[i];
        if (--w->waiting[tet])
            continue;
        for (int k = 0; k < 4; k++)
            w->arrived_corners[record->tet_count][k] =
                w->slot_at[w->position[w->in->corners[4 * (size_t)tet + (size_t)k]]];
        w->arrived[record->tet_count++] = tet;
    }
    record->tets = w->arrived_corners;
    return TETLOD_OK;
}

/* The codec has put the tetrahedra into their order of arrival: which original is which. */
static void name_arrivals(struct writer *w, const struct tetlodi_record *record)
{
    for (uint32_t i = 0; i < record->tet_count; i++)
        for (uint32_t k = 0; k < record->tet_count; k++)
            if (w->arrived[k] != TETLOD_NONE && tetlodi_same_tet(w->arrived_corners[k], record->tets[i])) {
                w->original_of[w->state.tets + i] = w->arrived[k];
                w->arrived[k] = TETLOD_NONE;
                break;
            }
}

static enum tetlod_status write_record(struct writer *w, uint32_t slot)
{
    uint32_t node = w->node_at[slot], children[MOST_CHILDREN];
    struct tetlodi_record record = {.slot = slot, .children = order_children(w, node, children)};
    record.labels = tetlodi_record_labels(&w->codec, slot);
    if (!record.labels)
        return out_of_memory(w);
    fill_labels(w, &record, node, children);
    for (uint32_t c = 0; c < record.children; c++) {
        memcpy(record.positions[c], node_position(w, children[c]), 24);
        record.values[c] = w->values + c * w->state.row;
        node_row(w, children[c], record.values[c]);
        uint32_t into = c ? w->state.vertices + c - 1 : slot;
        w->node_at[into] = children[c];
        for (uint32_t p = w->range[children[c]].begin; p < w->range[children[c]].end; p++)
            w->slot_at[p] = into;
    }
    TETLOD_TRY(fill_arrivals(w, &record, node));
    TETLOD_TRY(tetlodi_record_code(&w->codec, &record, w->error));
    name_arrivals(w, &record);
    TETLOD_TRY(tetlodi_state_split(&w->state, &record, w->error));
    w->state.undo_count = 0; // the writer never goes back
    return TETLOD_OK;
}

static enum tetlod_status write_level(struct writer *w, uint32_t level)
{
    uint32_t records = 0, slot;
    start_coders(w);
    tetlodi_level_begin(&w->codec);
    while (w->codec.walk < w->state.vertices)
        if (tetlodi_walk_step(&w->codec, splits(w, w->codec.walk, w->in->levels[level].contractions), &slot)) {
            TETLOD_TRY(write_record(w, slot));
            records++;
        }
    return store_level(w, level, records);
}

static enum tetlod_status write_levels(struct writer *w)
{
    TETLOD_TRY(tetlodi_state_reserve(&w->state, w->in->vertices, w->in->tets, w->error));
    start_coders(w);
    make_base(w);
    TETLOD_TRY(tetlodi_base_code(&w->codec, w->state.vertices, w->state.tets, w->error));
    TETLOD_TRY(tetlodi_state_begin(&w->state, w->state.vertices, w->state.tets, w->error));
    TETLOD_TRY(store_level(w, 0, 0));
    for (uint32_t level = 1; level < w->in->level_count; level++)
        TETLOD_TRY(write_level(w, level));
    if (w->state.tets != w->in->tets)
        return tetlodi_fail(w->error, TETLOD_ERR_ARGUMENT, "%u tetrahedra list a vertex twice",
                            w->in->tets - w->state.tets);
    return TETLOD_OK;
}

/* ---- the file */

static void fill_info(struct writer *w)
{
    struct tetlod_info *info = &w->index.info;
    const struct tetlodi_write_input *in = w->in;
    info->vertices = in->vertices;
    info->tets = in->tets;
    info->position_type = in->position_type;
    info->lossless = 1;
    info->degenerate_tets = in->degenerate_tets;
    info->inverted_tets = in->inverted_tets;
    info->unused_points = in->unused_points;
    info->metadata = in->metadata;
    info->metadata_size = strlen(in->metadata);
    for (int d = 0; d < 3; d++) {
        info->bounds[0][d] = info->bounds[1][d] = in->positions[d];
        for (size_t v = 1; v < in->vertices; v++) {
            info->bounds[0][d] = fmin(info->bounds[0][d], in->positions[3 * v + (size_t)d]);
            info->bounds[1][d] = fmax(info->bounds[1][d], in->positions[3 * v + (size_t)d]);
        }
    }
    for (uint32_t f = 0; f < in->field_count; f++)
        w->index.fields[f] = (struct tetlod_field){in->fields[f].name, in->fields[f].components, in->fields[f].type,
                                                   {in->fields[f].range[0], in->fields[f].range[1]},
                                                   in->fields[f].controlled};
}

static enum tetlod_status write_file(struct writer *w, const struct tetlodi_sink *sink)
{
    struct tetlodi_buffer index = {0}, stored = {0};
    struct tetlodi_header header = {0};
    uint8_t bytes[HEADER_SIZE];
    uint32_t frames = w->in->level_count * (w->in->field_count + 1);
    enum tetlod_status status = TETLOD_OK;
    tetlodi_index_encode(&w->index, &index);
    stored.capacity = ZSTD_compressBound(index.size);
    stored.bytes = malloc(stored.capacity);
    if (index.failed || !stored.bytes)
        TETLOD_TRY_DONE(out_of_memory(w));
    if (index.size > MOST_INDEX)
        TETLOD_TRY_DONE(tetlodi_fail(w->error, TETLOD_ERR_LIMIT, "the index is too large; use a larger --growth"));
    stored.size = ZSTD_compress2(w->zstd, stored.bytes, stored.capacity, index.bytes, index.size);
    if (ZSTD_isError(stored.size))
        TETLOD_TRY_DONE(tetlodi_fail(w->error, TETLOD_ERR_NOMEM, "zstd: %s", ZSTD_getErrorName(stored.size)));
    header.stored = (uint32_t)stored.size;
    header.raw = (uint32_t)index.size;
    header.crc = tetlodi_crc32(stored.bytes, stored.size);
    header.file_size = HEADER_SIZE + stored.size;
    for (uint32_t i = 0; i < frames; i++)
        header.file_size += w->stored[i].size;
    tetlodi_header_encode(&header, bytes);
    tetlodi_content_id(bytes, stored.bytes, stored.size, header.cid);
    tetlodi_header_encode(&header, bytes);
    status = sink->write(sink->opaque, bytes, HEADER_SIZE);
    if (status == TETLOD_OK)
        status = sink->write(sink->opaque, stored.bytes, stored.size);
    for (uint32_t i = 0; i < frames && status == TETLOD_OK; i++)
        status = sink->write(sink->opaque, w->stored[i].bytes, w->stored[i].size);
    if (status != TETLOD_OK)
        tetlodi_fail(w->error, status, "cannot write the stream");
done:
    tetlodi_buffer_fini(&index);
    tetlodi_buffer_fini(&stored);
    return status;
}

static enum tetlod_status check_input(const struct writer *w)
{
    const struct tetlodi_write_input *in = w->in;
    const char *wrong = NULL;
    if (!in->vertices || !in->tets || !in->level_count || in->field_count > MOST_FIELDS || in->level_count > MOST_LEVELS)
        wrong = "there is nothing in it, or too much";
    else if (in->levels[in->level_count - 1].contractions != 0 || in->levels[0].contractions != in->contractions)
        wrong = "its levels do not lead from the base mesh to the original";
    else if (strlen(in->metadata) > MOST_METADATA)
        wrong = "its metadata is too large";
    for (uint32_t k = 1; k < in->level_count && !wrong; k++)
        if (in->levels[k].contractions >= in->levels[k - 1].contractions)
            wrong = "its levels are not in order";
    for (uint32_t f = 0; f < in->field_count && !wrong; f++)
        if (in->fields[f].components < 1 || in->fields[f].components > MOST_COMPONENTS || strlen(in->fields[f].name) > 4096)
            wrong = "a field has too many components or too long a name";
    for (size_t c = 0; c < 4 * (size_t)in->tets && !wrong; c++)
        if (in->corners[c] >= in->vertices)
            wrong = "a tetrahedron's corner is out of range";
    return wrong ? tetlodi_fail(w->error, TETLOD_ERR_ARGUMENT, "the sequence cannot be written: %s", wrong) : TETLOD_OK;
}

static enum tetlod_status allocate(struct writer *w)
{
    const struct tetlodi_write_input *in = w->in;
    size_t parts = in->field_count + (size_t)1, row = 3;
    w->nodes = in->vertices + in->contractions;
    w->parent = malloc(w->nodes * sizeof *w->parent);
    w->range = malloc(w->nodes * sizeof *w->range);
    w->position = malloc(in->vertices * sizeof *w->position);
    w->slot_at = malloc(in->vertices * sizeof *w->slot_at);
    w->meeting_begin = calloc(in->contractions + (size_t)1, sizeof *w->meeting_begin);
    w->waiting = malloc(in->tets);
    w->node_at = malloc(in->vertices * sizeof *w->node_at);
    w->original_of = malloc(in->tets * sizeof *w->original_of);
    w->components = calloc(parts, sizeof *w->components);
    w->wide = calloc(parts, 1);
    w->coded = calloc(parts, sizeof *w->coded);
    w->stored = calloc(parts * in->level_count, sizeof *w->stored);
    w->index.info.field_count = in->field_count;
    w->index.info.level_count = in->level_count;
    w->zstd = ZSTD_createCCtx();
    for (uint32_t f = 0; f < in->field_count; f++)
        row += in->fields[f].components;
    w->values = malloc(MOST_CHILDREN * row * sizeof *w->values);
    bool done = w->parent && w->range && w->position && w->slot_at && w->meeting_begin && w->waiting && w->node_at &&
                w->original_of && w->components && w->wide && w->coded && w->stored && w->zstd && w->values &&
                tetlodi_index_allocate(&w->index);
    if (!done)
        return out_of_memory(w);
    for (uint32_t f = 0; f < in->field_count; f++) {
        w->components[f] = in->fields[f].components;
        w->wide[f] = in->fields[f].type == TETLOD_FLOAT64;
    }
    bool set = !ZSTD_isError(ZSTD_CCtx_setParameter(w->zstd, ZSTD_c_compressionLevel, in->compression)) &&
               !ZSTD_isError(ZSTD_CCtx_setParameter(w->zstd, ZSTD_c_checksumFlag, 1)) &&
               !ZSTD_isError(ZSTD_CCtx_setParameter(w->zstd, ZSTD_c_windowLog, MOST_WINDOW_LOG));
    if (!set)
        return tetlodi_fail(w->error, TETLOD_ERR_ARGUMENT, "zstd has no compression level %d", in->compression);
    TETLOD_TRY(tetlodi_state_init(&w->state, w->components, in->field_count, SIZE_MAX, w->error));
    return tetlodi_codec_init(&w->codec, &w->state, in->position_type == TETLOD_FLOAT64, w->wide, w->error);
}

static void release(struct writer *w)
{
    for (size_t i = 0; i < (w->in->field_count + (size_t)1) * w->in->level_count && w->stored; i++)
        tetlodi_buffer_fini(&w->stored[i]);
    for (size_t part = 0; part <= w->in->field_count && w->coded; part++)
        tetlodi_buffer_fini(&w->coded[part]);
    void *const owned[] = {w->parent,   w->range,      w->position,    w->slot_at, w->meeting_begin, w->meeting,
                           w->waiting,  w->node_at,    w->original_of, w->arrived, w->arrived_corners, w->components,
                           w->wide,     w->values,     w->coded,       w->stored};
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
    tetlodi_codec_fini(&w->codec);
    tetlodi_state_fini(&w->state);
    tetlodi_index_fini(&w->index);
    ZSTD_freeCCtx(w->zstd);
}

enum tetlod_status tetlodi_write(const struct tetlodi_write_input *input, const struct tetlodi_sink *sink,
                                 struct tetlod_error *error)
{
    struct writer w = {.in = input, .error = error};
    enum tetlod_status status;
    TETLOD_TRY_DONE(check_input(&w));
    TETLOD_TRY_DONE(allocate(&w));
    TETLOD_TRY_DONE(link_parents(&w));
    number_leaves(&w);
    TETLOD_TRY_DONE(list_meetings(&w));
    TETLOD_TRY_DONE(write_levels(&w));
    fill_info(&w);
    TETLOD_TRY_DONE(write_file(&w, sink));
done:
    release(&w);
    return status;
}
