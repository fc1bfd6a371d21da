/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A record: its shape and positions (SPEC 7.2), the values of fields (SPEC 8), then per further child the labels of the
 * star and the tetrahedra that come back (SPEC 7.3, 7.4). Every double is made by the same operations in the same order
 * in all decoders: no fused multiply-add, no other association.
 */
#include "format/coding/record.h"

#include <stdlib.h>
#include <string.h>

#include "format/coding/record_fields.h"
#include "format/coding/star_view.h"
#include "format/common/allowance.h"
#include "format/common/ascending.h"
#include "format/fail.h"

static void number_init(struct tetlodi_number *number, size_t count)
{
    for (size_t i = 0; i < count; i++)
        tetlodi_number_init(&number[i]);
}

/* Models as they are before the first record. What repeats what in a field is not learned. */
static void start_records(struct tetlodi_recorder *recorder)
{
    struct tetlodi_geometry_models *models = recorder->models;
    tetlodi_bits_init(models->splits[0], sizeof models->splits / sizeof(struct tetlodi_bit));
    tetlodi_bits_init(models->label, LABEL_CONTEXTS);
    tetlodi_bits_init(models->boundary, sizeof models->boundary / sizeof(struct tetlodi_bit));
    tetlodi_bits_init(models->leaf[0][0], sizeof models->leaf / sizeof(struct tetlodi_bit));
    tetlodi_bits_init(models->arity, 4);
    tetlodi_bits_init(models->placement, 4);
    tetlodi_bits_init(models->made, 2);
    tetlodi_bits_init(&models->irregular, 1);
    tetlodi_bits_init(&models->flip, 1);
    number_init(&models->extra, 1);
    number_init(models->middle, 3);
    tetlodi_bits_init(models->step[0].none[0], sizeof models->step / (sizeof(struct tetlodi_bit)));
    for (uint32_t f = 0; f + 1 < recorder->replay->column_count; f++) {
        struct tetlodi_field_models *of = &recorder->field_models[f];
        number_init(of->child[0], 4);
        tetlodi_bits_init(of->zeros[0], sizeof of->zeros / sizeof(struct tetlodi_bit));
        tetlodi_bits_init(of->kept[0], 2);
        tetlodi_bits_init(of->kept[1], 2);
        tetlodi_bits_init(of->nudge, 4);
        memset(of->last_zeros, 0, sizeof of->last_zeros);
    }
}

void tetlodi_models_start(struct tetlodi_recorder *recorder)
{
    struct tetlodi_geometry_models *models = recorder->models;
    start_records(recorder);
    tetlodi_bits_init(models->across, 2);
    tetlodi_bits_init(&models->fresh, 1);
    number_init(&models->vertex, 1);
    number_init(models->corner, 3);
    for (uint32_t f = 0; f + 1 < recorder->replay->column_count; f++) {
        struct tetlodi_field_models *of = &recorder->field_models[f];
        number_init(&of->corner, 1);
        tetlodi_bits_init(&of->copies, 1);
        tetlodi_bits_init(of->source, 64);
    }
}

enum tetlod_status tetlodi_recorder_init(struct tetlodi_recorder *recorder, struct tetlodi_replay *replay,
                                         struct tetlod_error *error)
{
    uint32_t fields = replay->column_count - 1;
    *recorder = (struct tetlodi_recorder){.replay = replay,
                                          .coders = calloc(fields + 1, sizeof *recorder->coders),
                                          .models = malloc(sizeof *recorder->models),
                                          .field_models = calloc(fields + 1, sizeof *recorder->field_models)};
    if (!recorder->coders || !recorder->models || !recorder->field_models) {
        tetlodi_recorder_fini(recorder);
        return tetlodi_fail_nomem(error, "the coder's models", (fields + 1) * sizeof *recorder->field_models);
    }
    recorder->log = fields ? &recorder->logs[0] : NULL;
    for (uint32_t f = 0; f < fields; f++)
        for (unsigned c = 0; c < MAX_COMPONENTS; c++)
            recorder->field_models[f].copied[c] = (uint8_t)c;
    return TETLOD_OK;
}

uint64_t tetlodi_recorder_bytes(const struct tetlodi_recorder *recorder)
{
    return sizeof *recorder->models + (recorder->replay->column_count - (uint64_t)1) * sizeof *recorder->field_models;
}

void tetlodi_recorder_fini(struct tetlodi_recorder *recorder)
{
    for (int i = 0; i < 2 && recorder->replay; i++)
        tetlodi_field_log_fini(&recorder->logs[i], recorder->replay->memory);
    if (recorder->replay) {
        tetlodi_star_fini(&recorder->star, recorder->replay->memory);
        tetlodi_star_marks_fini(&recorder->marks, recorder->replay->memory);
    }
    free(recorder->coders);
    free(recorder->models);
    free(recorder->field_models);
    *recorder = (struct tetlodi_recorder){0};
}

static enum tetlodi_placement choose_placement(const struct tetlodi_record *record, const int64_t own[3],
                                               const struct tetlodi_scale *scale)
{
    int first = 1, middle = 1;
    for (unsigned axis = 0; axis < 3; axis++) {
        const int64_t *codes = record->codes[axis];
        uint64_t difference =
            (uint64_t)codes[0] - (uint64_t)tetlodi_middle(scale, axis, own[axis], codes, record->children); // may wrap
        first &= codes[0] == own[axis];
        middle &= difference + 2 <= 4;
    }
    return first ? AT_FIRST : middle ? IN_MIDDLE : ELSEWHERE;
}

/* How far the link reaches from the vertex along an axis, to either side. */
struct reach {
    uint64_t low, high;
};

static struct reach reach(const struct tetlodi_star_view *star, int64_t own, unsigned axis)
{
    const int64_t *codes = star->axis_codes[axis];
    int64_t least = own, most = own;
    for (uint32_t i = 0; i < star->link_count; i++) {
        int64_t code = codes[i];
        least = code < least ? code : least;
        most = code > most ? code : most;
    }
    return (struct reach){code_distance(least, own), code_distance(most, own)};
}

/* The next code of the link's from `code` on to one side, along an axis; `code` itself if there is none. */
static int64_t next_code(const struct tetlodi_star_view *star, unsigned axis, int64_t code, int negative)
{
    const int64_t *codes = star->axis_codes[axis];
    // no code of a finite number, nor its mirror
    int64_t mirror = negative ? -1 : 0, from = code ^ mirror, best = INT64_MAX;
    for (uint32_t i = 0, count = star->link_count; i < count; i++) {
        int64_t other = codes[i] ^ mirror;
        other = other > from ? other : INT64_MAX;
        best = other < best ? other : best;
    }
    return best == INT64_MAX ? code : best ^ mirror;
}

/* Meshes made of layers: the child is level with a vertex of the link, the one of so many ranks to this side. */
static unsigned rank_of(const struct tetlodi_star_view *star, unsigned axis, int64_t code, int64_t value, int negative)
{
    for (unsigned rank = 0; rank < 64; rank++) {
        int64_t next = next_code(star, axis, code, negative);
        if (next == value)
            return rank;
        if (next == code || (negative ? next < value : next > value))
            return 64;
        code = next;
    }
    return 64;
}

/* What is known of a child from the axes before. */
struct trail {
    unsigned kind;  /* the record's placement, or 3: the first child, elsewhere */
    unsigned far;   /* how far it went at most, 0 to 3 */
    unsigned side;  /* where it went last: 0 nowhere, 1 up, 2 down */
    unsigned level; /* whether it was level with a vertex of the link last */
};

/* How far a step of so many bits goes where the link reaches to so many. */
static unsigned far_of(unsigned length, unsigned room)
{
    return length + 3 <= room ? 1 : length + 2 <= room ? 2 : 3;
}

/* Codes how far a child is from the vertex along an axis. */
TETLODI_INLINE int64_t code_step(struct tetlodi_coder *coder, struct tetlodi_step *models,
                                const struct tetlodi_star_view *star, unsigned axis, int64_t own, struct reach link,
                                struct trail *trail, int64_t value)
{
    unsigned eighth = star->size / 8 < 7 ? star->size / 8 : 7;
    if (code_bit(coder, &models->none[eighth][trail->far], value == 0))
        return 0;
    unsigned side = link.high / 2 > link.low ? 4 : link.low / 2 > link.high ? 0 : link.high > link.low ? 3 : 2;
    int negative = code_bit(coder, &models->side[trail->kind][trail->side][side], value < 0);
    trail->side = negative ? 2 : 1;
    unsigned room = bit_length(negative ? link.low : link.high), length;
    unsigned rank = 0;
    if (encoder_of(coder))
        rank = rank_of(star, axis, own, (int64_t)((uint64_t)own + (uint64_t)value), negative);
    trail->level = (unsigned)code_bit(coder, &models->level[trail->far][trail->level], rank < 64);
    if (trail->level) {
        int64_t code = own;
        for (rank = code_tree(coder, models->rank[trail->kind][trail->far], 6, rank) + 1; rank; rank--)
            code = next_code(star, axis, code, negative);
        length = bit_length(code_distance(code, own));
        value = (int64_t)((uint64_t)code - (uint64_t)own); // codes of float64 fill 64 bits: differences wrap
    } else {
        uint64_t distance = code_distance(value, 0);
        length = code_tree(coder, models->length[trail->far][room], 7, bit_length(distance));
        coder->bad |= length > 64 || !length;
        if (coder->bad)
            return 0;
        distance = code_below(coder, models->top[length], length, distance);
        value = (int64_t)(negative ? 0 - distance : distance);
    }
    unsigned far = far_of(length, room);
    trail->far = far > trail->far ? far : trail->far;
    return value;
}

TETLODI_INLINE void positions_inline(struct tetlodi_recorder *recorder, const struct tetlodi_star_view *star,
                                     struct tetlodi_record *record, int encoding)
{
    struct tetlodi_coder local = *recorder->coders, *coder = &local; // in registers
    struct tetlodi_geometry_models *models = recorder->models;
    const struct tetlodi_scale *scale = &recorder->replay->columns[0].scale;
    const int64_t *own = star->own;
    unsigned width = scale_width(scale), placement = 0;
    local.encoder = encoding ? local.encoder : NULL;
    if (encoding)
        placement = choose_placement(record, own, scale);
    placement = code_tree(coder, models->placement, 2, placement);
    coder->bad |= placement == 3;
    placement %= 3;
    struct trail trails[4] = {{.kind = placement == ELSEWHERE ? 3 : placement}, {.kind = placement},
                              {.kind = placement}, {.kind = placement}};
    for (unsigned axis = 0; axis < 3; axis++) {
        int64_t *codes = record->codes[axis];
        struct reach link = reach(star, own[axis], axis);
        for (uint32_t i = placement == ELSEWHERE ? 0 : 1; i < record->children; i++) {
            int64_t difference = code_difference(codes[i], own[axis], width);
            difference = code_step(coder, &models->step[axis], star, axis, own[axis], link, &trails[i], difference);
            codes[i] = code_offset(own[axis], difference, scale);
        }
        if (placement == AT_FIRST) {
            codes[0] = own[axis];
        } else if (placement == IN_MIDDLE) {
            int64_t middle = tetlodi_middle(scale, axis, own[axis], codes, record->children);
            int64_t difference = code_difference(codes[0], middle, width);
            difference = code_number(coder, &models->middle[axis], record->children, difference);
            codes[0] = code_offset(middle, difference, scale);
        }
    }
    record->placement = (enum tetlodi_placement)placement;
    struct tetlodi_bit(*leaf)[16] = models->leaf[placement];
    unsigned quarter = star->size / 4 < 15 ? star->size / 4 : 15, leaves = 0;
    for (uint32_t i = 0; i < record->children; i++)
        leaves |= (unsigned)code_bit(coder, &leaf[i ? 1 + (leaves & 1) : 0][quarter], record->leaves >> i & 1) << i;
    record->leaves = leaves;
    *recorder->coders = local;
}

static void code_positions(struct tetlodi_recorder *recorder, const struct tetlodi_star_view *star,
                           struct tetlodi_record *record)
{
    if (encoder_of(recorder->coders))
        positions_inline(recorder, star, record, 1);
    else
        positions_inline(recorder, star, record, 0);
}

/* What the labels of a star are guessed from: the two vertices that the split vertex parts into. */
struct pair {
    double a[3], b[3], along[3], middle3[3], steps[7];
};

static void pair_init(struct pair *pair, const double *a, const double *b)
{
    static const double steps[7] = {-6, -2.5, -0.75, 0, 0.75, 2.5, 6};
    double along[3];
    for (int i = 0; i < 3; i++) {
        pair->a[i] = a[i];
        pair->b[i] = b[i];
        pair->along[i] = along[i] = b[i] - a[i];
        pair->middle3[i] = 1.5 * (a[i] + b[i]);
    }
    double length2 = (along[0] * along[0] + along[1] * along[1]) + along[2] * along[2];
    for (int i = 0; i < 7; i++)
        pair->steps[i] = steps[i] * length2;
}

/* SPEC 7.3: which of the two leave a tetrahedron in its orientation (2 bits), which makes it larger, and which is
 * nearer, in 8 steps. The steps rise, so that all that are passed can be counted. */
static void geometry_contexts(struct tetlodi_star_view *star)
{
    struct pair pair;
    pair_init(&pair, star->ends[0], star->ends[1]);
    const double *a = pair.a, *b = pair.b, *d = pair.along, *m = pair.middle3, *s = pair.steps;
    const uint8_t *which = star->which;
    uint8_t *contexts = star->contexts;
    for (uint32_t i = 0, size = star->size; i < size; i += 2) {
        struct corner2 p0 = corner2(star, i, 0), p1 = corner2(star, i, 1), p2 = corner2(star, i, 2);
        pair2 ux = p1.x - p0.x, uy = p1.y - p0.y, uz = p1.z - p0.z;
        pair2 vx = p2.x - p0.x, vy = p2.y - p0.y, vz = p2.z - p0.z;
        pair2 nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
        pair2 of_a = (nx * (a[0] - p0.x) + ny * (a[1] - p0.y)) + nz * (a[2] - p0.z);
        pair2 of_b = (nx * (b[0] - p0.x) + ny * (b[1] - p0.y)) + nz * (b[2] - p0.z);
        pair2 near = ((((p0.x + p1.x) + p2.x) - m[0]) * d[0] + (((p0.y + p1.y) + p2.y) - m[1]) * d[1]) +
                     (((p0.z + p1.z) + p2.z) - m[2]) * d[2];
        pair2 sign = {(double)(1 - 2 * (int)(which[i] & 1)),
                      (double)(1 - 2 * (int)(which[i + (i + 1 < size)] & 1))};
        mask2 passed = (near > s[0]) + (near > s[1]) + (near > s[2]) + (near > s[3]) + (near > s[4]) + (near > s[5]) +
                       (near > s[6]);
        mask2 larger = of_a * of_a > of_b * of_b;
        mask2 context = ((of_a * sign < 0) & 8) + ((of_b * sign < 0) & 16) + (larger & 32) - passed;
        contexts[i] = (uint8_t)context[0];
        contexts[i + 1] = (uint8_t)context[1];
    }
}

/* By how many of three edges stay (in the lower two bits) and how many go: one of ten, 64 times. */
static const uint16_t neighbour_contexts[16] = {0,      4 * 64, 7 * 64, 9 * 64, 1 * 64, 5 * 64, 8 * 64, 9 * 64,
                                                2 * 64, 6 * 64, 8 * 64, 9 * 64, 3 * 64, 6 * 64, 8 * 64, 9 * 64};

TETLODI_INLINE void code_labels_inline(struct tetlodi_coder *all, struct tetlodi_bit *models,
                                       struct tetlodi_star_view *star,
                                      int encoding)
{
    struct tetlodi_coder coder = *all; // in registers
    coder.encoder = encoding ? coder.encoder : NULL;
    const uint32_t(*edges)[3] = (const uint32_t(*)[3])star->edges;
    const uint8_t *contexts = star->contexts;
    uint8_t *all_seen = star->seen, *labels = star->labels;
    for (uint32_t i = 0, size = star->size; i < size; i++) {
        uint8_t *e0 = all_seen + edges[i][0], *e1 = all_seen + edges[i][1], *e2 = all_seen + edges[i][2];
        unsigned context = contexts[i] | neighbour_contexts[*e0 + *e1 + *e2];
        int label = code_bit(&coder, &models[context], labels[i]);
        uint8_t seen = label ? LABEL_GOES : LABEL_STAYS;
        labels[i] = (uint8_t)label;
        *e0 |= seen;
        *e1 |= seen;
        *e2 |= seen;
    }
    *all = coder;
}

static void code_labels(struct tetlodi_recorder *recorder, struct tetlodi_star_view *star, unsigned at_first)
{
    struct tetlodi_bit *models = recorder->models->label + at_first * (LABEL_CONTEXTS / 2);
    geometry_contexts(star);
    if (encoder_of(recorder->coders))
        code_labels_inline(recorder->coders, models, star, 1);
    else
        code_labels_inline(recorder->coders, models, star, 0);
}

/* Whether the tetrahedron between a vertex and its child at a boundary face would be a positive one. */
static unsigned positive_between(const struct tetlodi_star_view *star, uint32_t e)
{
    const double *points[4];
    tetlodi_star_between_points(star, e, points);
    const double *p0 = points[0], *p1 = points[1], *p2 = points[2], *p3 = points[3];
    double ax = p1[0] - p0[0], ay = p1[1] - p0[1], az = p1[2] - p0[2];
    double bx = p2[0] - p0[0], by = p2[1] - p0[1], bz = p2[2] - p0[2];
    double cx = p3[0] - p0[0], cy = p3[1] - p0[1], cz = p3[2] - p0[2];
    double nx = by * cz - bz * cy, ny = bz * cx - bx * cz, nz = bx * cy - by * cx;
    return (ax * nx + ay * ny) + az * nz > 0;
}

/* The rule of SPEC 7.4: a tetrahedron comes back where labels differ. */
static int is_irregular(const struct tetlodi_star_view *star)
{
    for (uint32_t e = 0; e < star->edge_count; e++) {
        int inner = star->edge[e].first != star->edge[e].last;
        if ((inner && !star->made[e] != (star->seen[e] != LABELS_DIFFER)) || star->made[e] == MADE_FLIPPED)
            return 1;
    }
    return star->extra_count > 0;
}

/* At a boundary face, where the rule says nothing. */
static int code_boundary(struct tetlodi_recorder *recorder, const struct tetlodi_star_view *star, uint32_t e,
                         unsigned at_first)
{
    unsigned label = star->labels[star->edge[e].first / 3];
    unsigned context = (at_first * 2 + label) * 2 + positive_between(star, e);
    return code_bit(recorder->coders, &recorder->models->boundary[context], star->made[e] != NOT_MADE);
}

/* Keeps an edge in the list if a tetrahedron comes back at it. Few do, and which ones cannot be predicted: no
 * branch. */
TETLODI_INLINE uint32_t keep_edge(struct tetlodi_star_view *star, uint32_t kept, uint32_t e, unsigned made)
{
    star->edge[kept] = star->edge[e];
    star->made[kept] = (uint8_t)made;
    return kept + (made != NOT_MADE);
}

/* Codes at which edges tetrahedra come back, and leaves these in the list. */
static void code_edges(struct tetlodi_recorder *recorder, struct tetlodi_star_view *star, unsigned at_first)
{
    uint32_t kept = 0;
    for (uint32_t e = 0, count = star->edge_count; e < count; e++) {
        unsigned made = star->made[e] | (star->seen[e] == LABELS_DIFFER);
        if (star->edge[e].first == star->edge[e].last)
            made = (unsigned)code_boundary(recorder, star, e, at_first);
        kept = keep_edge(star, kept, e, made);
    }
    star->edge_count = kept;
}

static void code_edges_irregular(struct tetlodi_recorder *recorder, struct tetlodi_star_view *star, unsigned at_first)
{
    struct tetlodi_geometry_models *models = recorder->models;
    uint32_t kept = 0;
    for (uint32_t e = 0; e < star->edge_count; e++) {
        unsigned differ = star->seen[e] == LABELS_DIFFER;
        int made = star->made[e] != NOT_MADE, flip = star->made[e] == MADE_FLIPPED;
        if (star->edge[e].first == star->edge[e].last)
            made = code_boundary(recorder, star, e, at_first);
        else
            made = code_bit(recorder->coders, &models->made[differ], made);
        flip = made && code_bit(recorder->coders, &models->flip, flip);
        kept = keep_edge(star, kept, e, !made ? NOT_MADE : flip ? MADE_FLIPPED : MADE);
    }
    star->edge_count = kept;
}

/* The vertex at a place of the walk. */
TETLODI_INLINE uint32_t vertex_at(const struct tetlodi_recorder *recorder, uint32_t place)
{
    if (!recorder->paged)
        return place;
    uint32_t count = recorder->listed_count;
    return place < count ? recorder->listed[place] : recorder->level_start + (place - count);
}

/* One past the walk's last place, as it is now. */
static uint32_t walk_end(const struct tetlodi_recorder *recorder)
{
    uint32_t vertices = recorder->replay->vertices;
    return recorder->paged ? recorder->listed_count + (vertices - recorder->level_start) : vertices;
}

uint32_t tetlodi_place_of(const struct tetlodi_recorder *recorder, uint32_t vertex)
{
    if (!recorder->paged)
        return vertex;
    if (vertex >= recorder->level_start)
        return recorder->listed_count + (vertex - recorder->level_start);
    return ascending_place(recorder->listed, recorder->listed_count, vertex);
}

static enum tetlod_status too_many_tets(struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_STREAM, "a record brings back more tetrahedra than its level has");
}

/* Tetrahedra (vertex, child, x, y) that no edge of the link implies, or that are there more than once. */
static enum tetlod_status decode_extras(struct tetlodi_recorder *recorder, struct tetlodi_star_view *star,
                                        uint32_t child, struct tetlod_error *error)
{
    struct tetlodi_memory *memory = recorder->replay->memory;
    int64_t count = code_number(&recorder->coders[0], &recorder->models->extra, 0, 0);
    if (count < 0 || (uint64_t)count > recorder->most_tets - recorder->replay->tets)
        return too_many_tets(error);
    star->extra_count = (uint32_t)count;
    if (!TETLODI_ROOM(memory, star->extras, star->extras_capacity, star->extra_count))
        return tetlodi_no_room(memory, error);
    for (uint32_t i = 0; i < star->extra_count; i++) {
        for (int k = 0; k < 2; k++) {
            int64_t place = code_number(&recorder->coders[0], &recorder->models->extra, 1, 0);
            uint32_t id = place < 0 || place >= walk_end(recorder) ? child : vertex_at(recorder, (uint32_t)place);
            if (id >= child || id == star->vertex)
                return tetlodi_fail(error, TETLOD_ERR_STREAM, "a record names a vertex that is not there");
            star->extras[i][k] = id;
        }
        if (star->extras[i][0] == star->extras[i][1])
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "a record names a vertex twice");
    }
    return TETLOD_OK;
}

static void encode_extras(struct tetlodi_recorder *recorder, const struct tetlodi_star_view *star)
{
    code_number(&recorder->coders[0], &recorder->models->extra, 0, star->extra_count);
    for (uint32_t i = 0; i < star->extra_count; i++)
        for (int k = 0; k < 2; k++)
            code_number(&recorder->coders[0], &recorder->models->extra, 1, star->extras[i][k]);
}

/* Lays the tetrahedra that come back behind those that are there. Their number, or TETLOD_NONE if memory is out. */
static uint32_t put_tets(struct tetlodi_replay *replay, const struct tetlodi_star_view *star, uint32_t child)
{
    size_t most = (size_t)replay->tets + star->edge_count + star->extra_count;
    if (!TETLODI_ROOM(replay->memory, replay->corners, replay->corners_capacity, 4 * most))
        return TETLOD_NONE;
    uint32_t count = 0;
    for (uint32_t e = 0; e < star->edge_count; e++) {
        uint32_t *corners = replay->corners + 4 * ((size_t)replay->tets + count++);
        tetlodi_star_between(star, replay, e, child, corners);
        for (int c = 0; c < 4; c++)
            __builtin_prefetch(replay->stars + corners[c]);
        if (star->made[e] == MADE_FLIPPED)
            corners_flip(corners);
    }
    for (uint32_t i = 0; i < star->extra_count; i++) {
        uint32_t *corners = replay->corners + 4 * ((size_t)replay->tets + count++);
        corners[0] = star->vertex;
        corners[1] = child;
        corners[2] = star->extras[i][0];
        corners[3] = star->extras[i][1];
    }
    return count;
}

/* What is said of a split whose ends are known: labels, and where tetrahedra come back. 1: also which extras. */
static int code_split(struct tetlodi_recorder *recorder, struct tetlodi_star_view *star, unsigned at_first)
{
    code_labels(recorder, star, at_first);
    int irregular = encoder_of(recorder->coders) && is_irregular(star);
    irregular = code_bit(&recorder->coders[0], &recorder->models->irregular, irregular);
    if (irregular)
        code_edges_irregular(recorder, star, at_first);
    else
        code_edges(recorder, star, at_first);
    return irregular;
}

/* Parts one child from the vertex. The star is laid out, both positions are in place. */
static enum tetlod_status decode_split(struct tetlodi_recorder *recorder, unsigned number, unsigned at_first,
                                       struct tetlod_error *error)
{
    struct tetlodi_replay *replay = recorder->replay;
    struct tetlodi_star_view *star = &recorder->star;
    uint32_t child = replay->vertices;
    recorder->labels += star->size;
    tetlodi_star_part(star, replay, child);
    if (code_split(recorder, star, at_first))
        TETLOD_TRY(decode_extras(recorder, star, child, error));
    uint32_t added = put_tets(replay, star, child);
    if (added == TETLOD_NONE || !tetlodi_replay_log_labels(replay, star->labels, star->size))
        return tetlodi_no_room(replay->memory, error);
    if (added > recorder->most_tets - replay->tets)
        return too_many_tets(error);
    if (!tetlodi_replay_log(replay, star->vertex, added, number == 1) || !tetlodi_replay_apply(replay))
        return tetlodi_no_room(replay->memory, error);
    return TETLOD_OK;
}

enum tetlod_status tetlodi_record_place(struct tetlodi_replay *replay, struct tetlodi_record *record,
                                        struct tetlod_error *error)
{
    size_t vertices = (size_t)replay->vertices + record->children - 1;
    if (!tetlodi_replay_room(replay, vertices, replay->tets) ||
        !tetlodi_column_room(replay->columns, replay->memory, vertices, replay->records + (size_t)1))
        return tetlodi_no_room(replay->memory, error);
    if (!tetlodi_column_place(replay->columns, 1, record->vertex, replay->vertices, record->children, replay->records,
                              record->codes))
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "a record holds a value that is not finite");
    replay->columns->records = ++replay->records;
    replay->all_records++;
    replay->stars[record->vertex].leaf = record->leaves & 1;
    for (uint32_t i = 1; i < record->children; i++)
        replay->stars[replay->vertices + i - 1].leaf = record->leaves >> i & 1;
    return TETLOD_OK;
}

/* Does the first child take the vertex's place in space, too? */
static unsigned is_at_first(const struct tetlodi_star_view *star, const struct tetlodi_record *record)
{
    const int64_t *own = star->own;
    return own[0] == record->codes[0][0] && own[1] == record->codes[1][0] && own[2] == record->codes[2][0];
}

static uint32_t code_arity(struct tetlodi_recorder *recorder, uint32_t children)
{
    return 2 + code_tree(recorder->coders, recorder->models->arity, 2, children - 2);
}

static enum tetlod_status decode_record(struct tetlodi_recorder *recorder, struct tetlodi_record *record,
                                        struct tetlod_error *error)
{
    struct tetlodi_replay *replay = recorder->replay;
    struct tetlodi_star_view *star = &recorder->star;
    if (!tetlodi_star_lay_out(star, &recorder->marks, replay, record->vertex))
        return tetlodi_no_room(replay->memory, error);
    record->first_child = replay->vertices;
    record->number = replay->records;
    record->children = code_arity(recorder, 2);
    if (record->children > 4 || record->children - 1 > recorder->most_vertices - replay->vertices)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "a record makes more vertices than its level has");
    code_positions(recorder, star, record);
    if (recorder->coders[0].bad)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "a record holds what no writer writes");
    if (recorder->log && !tetlodi_field_log_add(recorder, recorder->log, replay->memory, star, record))
        return tetlodi_no_room(replay->memory, error);
    unsigned at_first = is_at_first(star, record);
    TETLOD_TRY(tetlodi_record_place(replay, record, error));
    for (unsigned i = 1; i < record->children; i++) {
        if (i > 1 && !tetlodi_star_lay_out(star, &recorder->marks, replay, record->vertex))
            return tetlodi_no_room(replay->memory, error);
        TETLOD_TRY(decode_split(recorder, i, at_first, error));
    }
    return TETLOD_OK;
}

static enum tetlod_status decode_or_undo(struct tetlodi_recorder *recorder, struct tetlodi_record *record,
                                         struct tetlod_error *error)
{
    struct tetlodi_replay *replay = recorder->replay;
    uint32_t splits = replay->splits, records = replay->records;
    enum tetlod_status status = decode_record(recorder, record, error);
    if (status == TETLOD_OK && recorder->labels > recorder->max_labels)
        status = tetlodi_fail(error, TETLOD_ERR_STREAM, "its records split larger stars than go with its bytes");
    if (status == TETLOD_OK)
        return TETLOD_OK;
    while (replay->splits > splits && tetlodi_replay_undo(replay))
        continue;
    if (replay->records > records) { // fields do not have the record, and other threads may have them
        tetlodi_column_exchange(replay->columns, 1, record->vertex, --replay->records);
        replay->columns->records = replay->records;
    }
    replay->stars[record->vertex].leaf = 0; // it may split yet
    tetlodi_replay_forget(replay);
    return status;
}

int tetlodi_record_encode(struct tetlodi_recorder *recorder, struct tetlodi_memory *memory,
                          struct tetlodi_record *record, struct tetlodi_star_view *stars)
{
    unsigned at_first = is_at_first(stars, record);
    code_arity(recorder, record->children);
    code_positions(recorder, stars, record);
    if (recorder->log && !tetlodi_field_log_add(recorder, recorder->log, memory, stars, record))
        return 0;
    for (unsigned i = 1; i < record->children; i++)
        if (code_split(recorder, &stars[i - 1], at_first))
            encode_extras(recorder, &stars[i - 1]);
    return 1;
}

static uint64_t labels_of(const struct tetlodi_recorder *recorder, uint32_t column, uint64_t bytes)
{
    if (!column)
        return limit_of(LABELS_FREE, LABELS_PER_BYTE, bytes);
    return limit_of(LABELS_FREE, FIELD_LABELS_PER_BYTE, bytes) / recorder->replay->columns[column].components;
}

bool tetlodi_labels_hold(const struct tetlodi_recorder *recorder, uint64_t labels, uint32_t column, uint64_t bytes)
{
    return labels <= labels_of(recorder, column, bytes);
}

void tetlodi_level_begin(struct tetlodi_recorder *recorder, uint32_t vertices, uint32_t tets)
{
    recorder->max_labels = UINT64_MAX;
    for (uint32_t c = 0; c < recorder->replay->column_count; c++) {
        uint64_t most = labels_of(recorder, c, recorder->replay->columns[c].frame_bytes);
        recorder->max_labels = most < recorder->max_labels ? most : recorder->max_labels;
    }
    recorder->walk = recorder->place = 0;
    recorder->paged = 0;
    recorder->level_start = recorder->replay->vertices;
    recorder->most_vertices = vertices;
    recorder->most_tets = tets;
}

int tetlodi_walk_ended(const struct tetlodi_recorder *recorder)
{
    return recorder->place >= walk_end(recorder);
}

void tetlodi_page_begin(struct tetlodi_recorder *recorder, const struct tetlodi_page_lists *lists, uint32_t page,
                        uint32_t vertices, uint32_t tets)
{
    const struct tetlodi_replay *replay = recorder->replay;
    start_records(recorder);
    recorder->paged = 1;
    recorder->listed = lists->vertices + lists->begins[page];
    recorder->listed_count = lists->begins[page + 1] - lists->begins[page];
    recorder->seams = lists->seams;
    recorder->level_start = replay->vertices;
    recorder->most_vertices = replay->vertices + vertices;
    recorder->most_tets = replay->tets + tets;
    recorder->place = 0;
    recorder->walk = vertex_at(recorder, 0);
}

/* Under which model it is asked whether a vertex at the walk splits. TETLOD_NONE: it never does, or not here. */
TETLODI_INLINE uint32_t split_context(const struct tetlodi_recorder *recorder, const struct tetlodi_star *stars,
                                      uint32_t v)
{
    uint32_t size = stars[v].size / 4, before = v < recorder->level_start;
    if (stars[v].leaf || (recorder->paged && before && recorder->seams[v]))
        return TETLOD_NONE;
    return (before ? 0 : SPLIT_CONTEXTS) + (size < SPLIT_CONTEXTS ? size : SPLIT_CONTEXTS - 1);
}

int tetlodi_level_next(struct tetlodi_recorder *recorder)
{
    struct tetlodi_coder coder = *recorder->coders; // in registers
    struct tetlodi_bit *models = recorder->models->splits[0];
    const struct tetlodi_star *stars = recorder->replay->stars;
    uint32_t place = recorder->place, end = walk_end(recorder);
    coder.encoder = NULL;
    for (; place < end; place++) {
        uint32_t context = split_context(recorder, stars, vertex_at(recorder, place));
        if (context != TETLOD_NONE && code_bit(&coder, &models[context], 0))
            break;
    }
    *recorder->coders = coder;
    recorder->place = place;
    recorder->walk = vertex_at(recorder, place);
    return place < end;
}

uint32_t tetlodi_level_asks(struct tetlodi_recorder *recorder, int split)
{
    uint32_t context = split_context(recorder, recorder->replay->stars, recorder->walk);
    if (context == TETLOD_NONE || !split)
        recorder->walk = vertex_at(recorder, ++recorder->place);
    return context;
}

size_t tetlodi_splits_encode(struct tetlodi_recorder *recorder, const uint8_t *asked, size_t count)
{
    size_t done = 0;
    for (int split = 0; done < count && !split; done++) {
        unsigned model = asked[done] % ASKED_SPLITS;
        split = asked[done] / ASKED_SPLITS;
        code_bit(recorder->coders, &recorder->models->splits[model / SPLIT_CONTEXTS][model % SPLIT_CONTEXTS], split);
    }
    return done;
}

enum tetlod_status tetlodi_record_decode(struct tetlodi_recorder *recorder, struct tetlod_error *error)
{
    const uint32_t whole = recorder->log ? recorder->log->count : 0;
    struct tetlodi_record record = {.children = 2};
    if (!tetlodi_level_next(recorder))
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "it has fewer records than its index says");
    record.vertex = recorder->walk;
    enum tetlod_status status = decode_or_undo(recorder, &record, error);
    if (status != TETLOD_OK && recorder->log)
        recorder->log->count = whole; // it has no room in the columns
    return status;
}

enum tetlod_status tetlodi_check_ends(const struct tetlodi_recorder *recorder, struct tetlod_error *error)
{
    for (uint32_t c = 0; c < recorder->replay->column_count; c++) {
        const struct tetlodi_coder *coder = &recorder->coders[c];
        if (coder->bad)
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "it holds what no writer writes");
        for (const uint8_t *at = coder->at; at < coder->end; at++)
            if (*at)
                return tetlodi_fail(error, TETLOD_ERR_STREAM, "it has bytes that belong to nothing");
    }
    return TETLOD_OK;
}

enum tetlod_status tetlodi_fail_field(int bad, struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_STREAM, bad == BAD_VALUE ? "a record holds a value that is not finite"
                                                                   : "a record holds what no writer writes");
}
