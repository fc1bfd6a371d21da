/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/records.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/base.h"
#include "format/fail.h"

enum { BOUNDARY = -1, SEVERAL = -2 };

struct slot_edge { /* of the table that matches the faces around the vertex */
    uint32_t x, y;
    int32_t face; /* 3 * tetrahedron in the star + number of the link vertex opposite; -1: empty */
    uint32_t uses;
};

struct tetlodi_scratch {
    size_t star_capacity, table_capacity, tet_capacity;
    uint8_t *labels;          /* [star] */
    uint32_t (*link)[3];      /* [star] the corners other than the vertex, in order */
    int32_t *across;          /* [3 * star] the star's tetrahedron across the face, BOUNDARY or SEVERAL */
    struct slot_edge *table;
    uint32_t (*tets)[4];      /* in order of arrival */
    uint8_t *used;            /* encoder: [tets of the record] already predicted */
    double *values;           /* [MOST_CHILDREN * (row - 3)] */
};

enum tetlod_status tetlodi_codec_init(struct tetlodi_codec *codec, struct tetlodi_state *state, bool wide_positions,
                                      const uint8_t *wide_fields, struct tetlod_error *error)
{
    size_t fields = state->field_count ? state->field_count : 1;
    *codec = (struct tetlodi_codec){.state = state,
                                    .wide_positions = wide_positions,
                                    .wide_fields = wide_fields,
                                    .fields = calloc(fields, sizeof *codec->fields),
                                    .field_models = calloc(fields, sizeof *codec->field_models),
                                    .scratch = calloc(1, sizeof *codec->scratch)};
    if (codec->scratch)
        codec->scratch->values = calloc(MOST_CHILDREN * (size_t)state->row, sizeof(double));
    if (!codec->fields || !codec->field_models || !codec->scratch || !codec->scratch->values) {
        tetlodi_codec_fini(codec);
        return tetlodi_fail_nomem(error, "the codec", fields * sizeof *codec->field_models);
    }
    struct tetlodi_geometry_model *model = &codec->geometry_model;
    struct tetlodi_bit *bits = model->split;
    for (size_t i = 0; i < SPLIT_CONTEXTS; i++)
        bits[i] = TETLODI_BIT_NEW;
    for (size_t i = 0; i < LABEL_CONTEXTS; i++)
        model->label[i] = TETLODI_BIT_NEW;
    for (size_t i = 0; i < 2; i++)
        model->children[i] = model->placement[i] = model->boundary[i] = TETLODI_BIT_NEW;
    for (size_t i = 0; i < 3; i++)
        model->label_of_many[i] = TETLODI_BIT_NEW;
    model->pair = TETLODI_BIT_NEW;
    for (size_t i = 0; i < POSITION_CONTEXTS; i++)
        tetlodi_number_init(&model->position[i]);
    tetlodi_number_init(&model->exceptions);
    tetlodi_number_init(&model->exception_vertex);
    for (size_t f = 0; f < fields; f++)
        for (int i = 0; i < 2; i++)
            tetlodi_number_init(&codec->field_models[f].residual[i]);
    return TETLOD_OK;
}

void tetlodi_codec_fini(struct tetlodi_codec *codec)
{
    if (codec->scratch) {
        free(codec->scratch->labels);
        free(codec->scratch->link);
        free(codec->scratch->across);
        free(codec->scratch->table);
        free(codec->scratch->tets);
        free(codec->scratch->used);
        free(codec->scratch->values);
    }
    free(codec->scratch);
    free(codec->fields);
    free(codec->field_models);
    *codec = (struct tetlodi_codec){0};
}

static bool grow(void *pointer, size_t count, size_t size)
{
    void **array = pointer, *moved = realloc(*array, count * size);
    *array = moved ? moved : *array;
    return moved;
}

static bool reserve_star(struct tetlodi_scratch *scratch, size_t count)
{
    if (count <= scratch->star_capacity)
        return true;
    size_t capacity = count + count / 2 + 32;
    if (!grow(&scratch->labels, capacity, 1) || !grow(&scratch->link, capacity, sizeof *scratch->link) ||
        !grow(&scratch->across, capacity, 3 * sizeof *scratch->across))
        return false;
    scratch->star_capacity = capacity;
    return true;
}

static bool reserve_tets(struct tetlodi_scratch *scratch, size_t count)
{
    if (count <= scratch->tet_capacity)
        return true;
    size_t capacity = count + count / 2 + 32;
    if (!grow(&scratch->tets, capacity, sizeof *scratch->tets) || !grow(&scratch->used, capacity, 1))
        return false;
    scratch->tet_capacity = capacity;
    return true;
}

uint8_t *tetlodi_record_labels(struct tetlodi_codec *codec, uint32_t slot)
{
    return reserve_star(codec->scratch, codec->state->stars[slot].count) ? codec->scratch->labels : NULL;
}

/* ---- which vertices split */

void tetlodi_level_begin(struct tetlodi_codec *codec)
{
    codec->walk = 0;
    codec->level_vertices = codec->state->vertices;
}

bool tetlodi_walk_step(struct tetlodi_codec *codec, bool split, uint32_t *out_slot)
{
    uint32_t v = codec->walk, size = codec->state->stars[v].count / 6;
    uint32_t context = 2 * (size < 7 ? size : 7) + (v >= codec->level_vertices);
    split = tetlodi_code_bit(&codec->geometry, &codec->geometry_model.split[context], split);
    *out_slot = v;
    codec->walk += !split;
    return split;
}

/* ---- positions */

static uint64_t zigzag(uint64_t difference, bool wide)
{
    if (!wide)
        difference = (uint64_t)(int64_t)(int32_t)(uint32_t)difference;
    return difference << 1 ^ (difference >> 63 ? UINT64_MAX : 0);
}

static uint64_t unzigzag(uint64_t value)
{
    return value >> 1 ^ (value & 1 ? UINT64_MAX : 0);
}

/* Codes a float as the difference of its ordered bits from those of the prediction. */
double tetlodi_code_float(struct tetlodi_coder *coder, struct tetlodi_number *model, double value, double predicted,
                          bool wide)
{
    double nearest = wide ? predicted : (double)(float)predicted;
    uint64_t from = tetlodi_ordered_bits(isfinite(nearest) ? nearest : 0, wide);
    uint64_t coded = coder->encodes ? zigzag(tetlodi_ordered_bits(value, wide) - from, wide) : 0;
    coded = tetlodi_code_number(coder, model, coded);
    return coder->encodes ? value : tetlodi_from_ordered(from + unzigzag(coded), wide);
}

static unsigned length_of(uint64_t value)
{
    unsigned length = 0;
    for (; value; value >>= 1)
        length++;
    return length;
}

/* How far the link is from the vertex along each axis, as the size of a difference of ordered bits: the size to expect of a
 * child's. */
static void position_contexts(const struct tetlodi_codec *codec, uint32_t slot, uint32_t count, unsigned contexts[3])
{
    const struct tetlodi_state *state = codec->state;
    bool wide = codec->wide_positions;
    for (int d = 0; d < 3; d++) {
        uint64_t here = tetlodi_ordered_bits(state->positions[3 * (size_t)slot + (size_t)d], wide), most = 0;
        for (uint32_t i = 0; i < count; i++)
            for (int k = 0; k < 3; k++) {
                double x = state->positions[3 * (size_t)codec->scratch->link[i][k] + (size_t)d];
                uint64_t there = tetlodi_ordered_bits(x, wide), far = there > here ? there - here : here - there;
                most = far > most ? far : most;
            }
        unsigned length = length_of(most) / (wide ? 4 : 2);
        contexts[d] = length < POSITION_CONTEXTS ? length : POSITION_CONTEXTS - 1;
    }
}

static void code_position(struct tetlodi_codec *codec, double position[3], const double predicted[3],
                          const unsigned contexts[3])
{
    for (int d = 0; d < 3; d++)
        position[d] = tetlodi_code_float(&codec->geometry, &codec->geometry_model.position[contexts[d]], position[d],
                                 predicted[d], codec->wide_positions);
}

static bool same_position(const double a[3], const double b[3])
{
    return memcmp(a, b, 3 * sizeof *a) == 0;
}

static bool is_midpoint(const struct tetlodi_codec *codec, const struct tetlodi_record *record, const double at[3])
{
    for (int d = 0; d < 3; d++) {
        double expected = 2 * at[d] - record->positions[1][d];
        expected = codec->wide_positions ? expected : (double)(float)expected;
        if (fabs(expected - record->positions[0][d]) > fabs(at[d]) * 1e-5)
            return false;
    }
    return true;
}

/* Returns whether the first child is where the vertex was. */
static bool code_positions(struct tetlodi_codec *codec, struct tetlodi_record *record, const unsigned contexts[3])
{
    const double *at = codec->state->positions + 3 * (size_t)record->slot;
    struct tetlodi_geometry_model *model = &codec->geometry_model;
    struct tetlodi_coder *coder = &codec->geometry;
    bool moved = tetlodi_code_bit(coder, &model->placement[0], !same_position(record->positions[0], at));
    for (uint32_t child = 1; child < record->children; child++)
        code_position(codec, record->positions[child], at, contexts);
    if (!moved) {
        memcpy(record->positions[0], at, sizeof record->positions[0]);
        return true;
    }
    double predicted[3] = {at[0], at[1], at[2]};
    bool middle = record->children == 2 && coder->encodes && is_midpoint(codec, record, at);
    middle = tetlodi_code_bit(coder, &model->placement[1], middle);
    for (int d = 0; d < 3 && middle; d++)
        predicted[d] = 2 * at[d] - record->positions[1][d];
    unsigned near[3] = {POSITION_CONTEXTS - 1, POSITION_CONTEXTS - 1, POSITION_CONTEXTS - 1};
    code_position(codec, record->positions[0], predicted, middle ? near : contexts);
    return false;
}

/* ---- labels */

static void copy_link(struct tetlodi_codec *codec, uint32_t slot)
{
    const struct tetlodi_state *state = codec->state;
    const uint32_t *tets = state->pool + state->stars[slot].begin;
    for (uint32_t i = 0; i < state->stars[slot].count; i++) {
        const uint32_t *corners = state->corners + 4 * (size_t)tets[i];
        for (int c = 0, k = 0; c < 4 && k < 3; c++)
            if (corners[c] != slot)
                codec->scratch->link[i][k++] = corners[c];
    }
}

static struct slot_edge *find_edge(struct slot_edge *table, size_t mask, uint32_t x, uint32_t y)
{
    size_t at = (size_t)((x * 0x9e3779b1u ^ y * 0x85ebca6bu) * 0xc2b2ae35u >> 8) & mask;
    while (table[at].face >= 0 && (table[at].x != x || table[at].y != y))
        at = (at + 1) & mask;
    return &table[at];
}

/* Which of the star's tetrahedra share a face that has the vertex: those with a link edge in common. */
static bool match_faces(struct tetlodi_scratch *scratch, uint32_t count)
{
    size_t size = 16;
    while (size < 6 * (size_t)count)
        size *= 2;
    if (size > scratch->table_capacity) {
        if (!grow(&scratch->table, size, sizeof *scratch->table))
            return false;
        scratch->table_capacity = size;
    }
    for (size_t i = 0; i < size; i++)
        scratch->table[i].face = -1;
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t k = 0; k < 3; k++) {
            uint32_t x = scratch->link[i][(k + 1) % 3], y = scratch->link[i][(k + 2) % 3];
            struct slot_edge *edge = find_edge(scratch->table, size - 1, x < y ? x : y, x < y ? y : x);
            int32_t *across = &scratch->across[3 * i + k];
            *across = BOUNDARY;
            if (edge->face < 0)
                *edge = (struct slot_edge){x < y ? x : y, x < y ? y : x, (int32_t)(3 * i + k), 1};
            else if (++edge->uses == 2) {
                *across = edge->face / 3;
                scratch->across[edge->face] = (int32_t)i;
            } else {
                if (edge->uses == 3) {
                    int32_t first = edge->face, second = 3 * scratch->across[first];
                    for (int32_t s = second; s < second + 3; s++)
                        if (scratch->across[s] == first / 3)
                            scratch->across[s] = SEVERAL;
                    scratch->across[first] = SEVERAL;
                }
                *across = SEVERAL;
            }
        }
    return true;
}

static double volume6(const double *p, const double *q, const double *r, const double *s)
{
    double ax = q[0] - p[0], ay = q[1] - p[1], az = q[2] - p[2];
    double bx = r[0] - p[0], by = r[1] - p[1], bz = r[2] - p[2];
    double cx = s[0] - p[0], cy = s[1] - p[1], cz = s[2] - p[2];
    return ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx);
}

static double distance2(const double *p, double x, double y, double z)
{
    x -= p[0];
    y -= p[1];
    z -= p[2];
    return x * x + y * y + z * z;
}

/* Which child suits the tetrahedron by its shape, 0..15: which of them leave its orientation as it is, and which is how much
 * nearer to the middle of its opposite face. */
static unsigned shape_context(const struct tetlodi_codec *codec, const struct tetlodi_record *record, uint32_t i)
{
    const double *positions = codec->state->positions, *at = positions + 3 * (size_t)record->slot;
    const uint32_t *link = codec->scratch->link[i];
    const double *q = positions + 3 * (size_t)link[0], *r = positions + 3 * (size_t)link[1],
                 *s = positions + 3 * (size_t)link[2];
    double before = volume6(at, q, r, s);
    bool first = before * volume6(record->positions[0], q, r, s) > 0;
    bool second = before * volume6(record->positions[1], q, r, s) > 0;
    double x = (q[0] + r[0] + s[0]) / 3, y = (q[1] + r[1] + s[1]) / 3, z = (q[2] + r[2] + s[2]) / 3;
    double d0 = distance2(record->positions[0], x, y, z), d1 = distance2(record->positions[1], x, y, z);
    unsigned nearer = d0 < d1 ? (2 * d0 < d1 ? 0 : 1) : (d0 < 2 * d1 ? 2 : 3);
    return nearer + 4 * (unsigned)first + 8 * (unsigned)second;
}

/* How many neighbours already have label 0 and 1: 10 cases of at most three. */
static unsigned neighbour_context(const struct tetlodi_scratch *scratch, uint32_t i)
{
    static const uint8_t numbers[4][4] = {{0, 1, 2, 3}, {4, 5, 6, 0}, {7, 8, 0, 0}, {9, 0, 0, 0}};
    unsigned counts[2] = {0, 0};
    for (int k = 0; k < 3; k++) {
        int32_t across = scratch->across[3 * i + (uint32_t)k];
        if (across >= 0 && (uint32_t)across < i)
            counts[scratch->labels[across] != 0]++;
    }
    return numbers[counts[0]][counts[1]];
}

static void code_labels(struct tetlodi_codec *codec, struct tetlodi_record *record, uint32_t count)
{
    struct tetlodi_geometry_model *model = &codec->geometry_model;
    for (uint32_t i = 0; i < count; i++) {
        uint8_t *label = &record->labels[i];
        if (record->children == 2) {
            unsigned context = 10 * shape_context(codec, record, i) + neighbour_context(codec->scratch, i);
            *label = (uint8_t)tetlodi_code_bit(&codec->geometry, &model->label[context], *label);
            continue;
        }
        uint8_t wanted = *label, at = 0; // one bit a child: is it a later one?
        while (at + 1u < record->children &&
               tetlodi_code_bit(&codec->geometry, &model->label_of_many[at], wanted > at))
            at++;
        *label = at;
    }
}

/* ---- tetrahedra that come back */

static uint32_t child_vertex(const struct tetlodi_codec *codec, const struct tetlodi_record *record, uint32_t child)
{
    return child ? codec->state->vertices + child - 1 : record->slot;
}

/* The tetrahedron between the star's tetrahedron i, which goes to child `own`, and its neighbour across the face opposite link
 * vertex k, which goes to `other`: i with the vertex replaced by the other child and the link vertex by its own, which is the
 * orientation of i. */
static void predicted_tet(const struct tetlodi_codec *codec, const struct tetlodi_record *record, uint32_t i, uint32_t k,
                          uint32_t own, uint32_t other, uint32_t out[4])
{
    const struct tetlodi_state *state = codec->state;
    uint32_t tet = state->pool[state->stars[record->slot].begin + i], opposite = codec->scratch->link[i][k];
    for (int c = 0; c < 4; c++) {
        uint32_t corner = state->corners[4 * (size_t)tet + (size_t)c];
        out[c] = corner == record->slot ? child_vertex(codec, record, other)
                 : corner == opposite   ? child_vertex(codec, record, own)
                                        : corner;
    }
}

bool tetlodi_same_tet(const uint32_t a[4], const uint32_t b[4])
{
    uint32_t c[4] = {b[0], b[1], b[2], b[3]};
    unsigned swaps = 0;
    for (int i = 0; i < 4; i++) {
        int j = i;
        while (j < 4 && c[j] != a[i])
            j++;
        if (j == 4)
            return false;
        if (j != i) {
            c[j] = c[i];
            c[i] = a[i];
            swaps++;
        }
    }
    return swaps % 2 == 0;
}

/* Codes whether a predicted tetrahedron is there, and takes it if so. */
static bool code_predicted(struct tetlodi_codec *codec, struct tetlodi_record *record, struct tetlodi_bit *model,
                           const uint32_t tet[4], uint32_t *count)
{
    struct tetlodi_scratch *scratch = codec->scratch;
    uint32_t match = record->tet_count;
    if (codec->geometry.encodes)
        for (match = 0; match < record->tet_count; match++)
            if (!scratch->used[match] && tetlodi_same_tet(tet, record->tets[match]))
                break;
    bool there = tetlodi_code_bit(&codec->geometry, model, codec->geometry.encodes && match < record->tet_count);
    if (!there)
        return true;
    if (codec->geometry.encodes)
        scratch->used[match] = 1;
    if (!reserve_tets(scratch, *count + 1))
        return false;
    memcpy(scratch->tets[(*count)++], tet, 4 * sizeof *tet);
    return true;
}

static bool code_implied(struct tetlodi_codec *codec, struct tetlodi_record *record, uint32_t star, uint32_t *count)
{
    struct tetlodi_geometry_model *model = &codec->geometry_model;
    for (uint32_t i = 0; i < star; i++)
        for (uint32_t k = 0; k < 3; k++) {
            int32_t across = codec->scratch->across[3 * i + k];
            uint32_t own = record->labels[i], other = 1 - own, tet[4];
            struct tetlodi_bit *bit = &model->pair;
            if (across == BOUNDARY && record->children == 2) {
                bit = &model->boundary[own];
            } else {
                if (across <= (int32_t)i || record->labels[across] == own)
                    continue;
                other = record->labels[across];
            }
            predicted_tet(codec, record, i, k, own, other, tet);
            if (!code_predicted(codec, record, bit, tet, count))
                return false;
        }
    return true;
}

static bool is_tet(const uint32_t c[4], uint32_t vertices)
{
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < i; j++)
            if (c[i] == c[j])
                return false;
    return c[0] < vertices && c[1] < vertices && c[2] < vertices && c[3] < vertices;
}

/* What the rule does not give, corner by corner. */
static enum tetlod_status code_exceptions(struct tetlodi_codec *codec, struct tetlodi_record *record, uint32_t *count,
                                          struct tetlod_error *error)
{
    struct tetlodi_geometry_model *model = &codec->geometry_model;
    struct tetlodi_coder *coder = &codec->geometry;
    uint32_t vertices = codec->state->vertices + record->children - 1, next = 0;
    uint64_t left = coder->encodes ? record->tet_count - *count : 0;
    left = tetlodi_code_number(coder, &model->exceptions, left);
    if (left > UINT32_MAX - *count)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "a record brings more tetrahedra than there can be");
    for (; left; left--) {
        uint32_t tet[4] = {0};
        while (coder->encodes && codec->scratch->used[next])
            next++;
        for (int c = 0; c < 4; c++) { // counted down from the newest: most are near it
            uint64_t back = coder->encodes ? vertices - 1 - record->tets[next][c] : 0;
            back = tetlodi_code_number(coder, &model->exception_vertex, back);
            tet[c] = back < vertices ? vertices - 1 - (uint32_t)back : TETLOD_NONE;
        }
        next++;
        if (coder->in.failed || !is_tet(tet, vertices))
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "a record has a tetrahedron that is none");
        if (!reserve_tets(codec->scratch, *count + 1))
            return tetlodi_fail_nomem(error, "a record", *count * sizeof tet);
        memcpy(codec->scratch->tets[(*count)++], tet, sizeof tet);
    }
    return TETLOD_OK;
}

/* ---- values */

/* The tetrahedron of the star that holds p best, as weights of its corners. False: none has a volume. */
static bool find_weights(const struct tetlodi_codec *codec, uint32_t slot, const double p[3], const uint32_t **out_corners,
                         double weights[4])
{
    const struct tetlodi_state *state = codec->state;
    const uint32_t *tets = state->pool + state->stars[slot].begin;
    double best = -INFINITY;
    for (uint32_t i = 0; i < state->stars[slot].count; i++) {
        const uint32_t *corners = state->corners + 4 * (size_t)tets[i];
        const double *q[4];
        double w[4];
        for (int c = 0; c < 4; c++)
            q[c] = state->positions + 3 * (size_t)corners[c];
        double whole = volume6(q[0], q[1], q[2], q[3]);
        w[1] = volume6(q[0], p, q[2], q[3]) / whole;
        w[2] = volume6(q[0], q[1], p, q[3]) / whole;
        w[3] = volume6(q[0], q[1], q[2], p) / whole;
        w[0] = 1 - w[1] - w[2] - w[3];
        double least = w[0];
        for (int c = 1; c < 4; c++)
            least = w[c] < least ? w[c] : least;
        if (whole != 0 && least > best) {
            best = least;
            *out_corners = corners;
            memcpy(weights, w, sizeof w);
        }
        if (best >= 0)
            break;
    }
    return best > -INFINITY;
}

/* The field of the mesh before the split at a child's position, kept among the values that it comes from. */
static double predict_value(const struct tetlodi_state *state, uint32_t field, uint32_t component, uint32_t slot,
                            const uint32_t *corners, const double weights[4])
{
    uint32_t width = state->components[field];
    const double *values = state->fields[field] + component;
    if (!corners)
        return values[(size_t)slot * width];
    double least = INFINITY, most = -INFINITY, sum = 0;
    for (int c = 0; c < 4; c++) {
        double value = values[(size_t)corners[c] * width];
        least = value < least ? value : least;
        most = value > most ? value : most;
        sum += weights[c] * value;
    }
    return sum < least ? least : sum > most ? most : sum;
}

static void code_values(struct tetlodi_codec *codec, struct tetlodi_record *record, bool first_stays)
{
    const struct tetlodi_state *state = codec->state;
    for (uint32_t child = 0; child < record->children; child++) {
        const uint32_t *corners = NULL;
        double weights[4], *values = record->values[child];
        bool stays = child == 0 && first_stays;
        if (!stays && !find_weights(codec, record->slot, record->positions[child], &corners, weights))
            corners = NULL;
        for (uint32_t f = 0; f < state->field_count; f++)
            for (uint32_t c = 0; c < state->components[f]; c++, values++)
                *values = tetlodi_code_float(&codec->fields[f], &codec->field_models[f].residual[!stays], *values,
                                     predict_value(state, f, c, record->slot, corners, weights), codec->wide_fields[f]);
    }
}

/* ---- the record */

static enum tetlod_status check_coders(const struct tetlodi_codec *codec, struct tetlod_error *error)
{
    bool failed = codec->geometry.in.failed;
    for (uint32_t f = 0; f < codec->state->field_count; f++)
        failed |= codec->state->components[f] && codec->fields[f].in.failed;
    return failed ? tetlodi_fail(error, TETLOD_ERR_STREAM, "a level's records end too early") : TETLOD_OK;
}

static bool finite_row(const double *row, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        if (!isfinite(row[i]))
            return false;
    return true;
}

enum tetlod_status tetlodi_record_code(struct tetlodi_codec *codec, struct tetlodi_record *record,
                                       struct tetlod_error *error)
{
    struct tetlodi_scratch *scratch = codec->scratch;
    struct tetlodi_state *state = codec->state;
    struct tetlodi_coder *coder = &codec->geometry;
    uint32_t star = state->stars[record->slot].count, count = 0;
    unsigned contexts[3];
    bool encodes = coder->encodes;
    record->labels = tetlodi_record_labels(codec, record->slot);
    if (!record->labels || !reserve_tets(scratch, encodes ? record->tet_count : 0))
        return tetlodi_fail_nomem(error, "a record", star);
    if (encodes)
        memset(scratch->used, 0, record->tet_count);
    uint32_t more = record->children - 2;
    record->children = 2 + tetlodi_code_bit(coder, &codec->geometry_model.children[0], encodes && more > 0);
    if (record->children == 3)
        record->children += tetlodi_code_bit(coder, &codec->geometry_model.children[1], encodes && more > 1);
    copy_link(codec, record->slot);
    if (!match_faces(scratch, star))
        return tetlodi_fail_nomem(error, "a record", star * 6 * sizeof *scratch->table);
    position_contexts(codec, record->slot, star, contexts);
    bool first_stays = code_positions(codec, record, contexts);
    code_labels(codec, record, star);
    if (!code_implied(codec, record, star, &count))
        return tetlodi_fail_nomem(error, "a record", star);
    TETLOD_TRY(code_exceptions(codec, record, &count, error));
    for (uint32_t child = 0; child < record->children && !encodes; child++)
        record->values[child] = scratch->values + child * (state->row - 3);
    code_values(codec, record, first_stays);
    record->tets = scratch->tets;
    record->tet_count = count;
    TETLOD_TRY(check_coders(codec, error));
    for (uint32_t child = 0; child < record->children; child++)
        if (!finite_row(record->positions[child], 3) || !finite_row(record->values[child], state->row - 3))
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "a record has a number that is not finite");
    return TETLOD_OK;
}
