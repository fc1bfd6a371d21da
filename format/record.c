/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A record: its shape and positions (SPEC 7.2), the values of fields (SPEC 8), then per further child the labels of the
 * star and the tetrahedra that come back (SPEC 7.3, 7.4). Every double is made by the same operations in the same order
 * in all decoders: no fused multiply-add, no other association.
 */
#include "format/record.h"

#include <stdlib.h>

#include "format/fail.h"
#include "format/star_view.h"

static void number_init(struct tetlodi_number *number, size_t count)
{
    for (size_t i = 0; i < count; i++)
        tetlodi_number_init(&number[i]);
}

enum tetlod_status tetlodi_recorder_init(struct tetlodi_recorder *recorder, struct tetlodi_replay *replay,
                                         struct tetlod_error *error)
{
    uint32_t fields = replay->column_count - 1, codes = 0;
    for (uint32_t f = 0; f <= fields; f++)
        codes += replay->columns[f].components;
    *recorder = (struct tetlodi_recorder){.replay = replay,
                                          .coders = calloc(fields + 1, sizeof *recorder->coders),
                                          .models = malloc(sizeof *recorder->models),
                                          .field_models = calloc(fields + 1, sizeof *recorder->field_models),
                                          .codes = calloc(codes, sizeof *recorder->codes)};
    if (!recorder->coders || !recorder->models || !recorder->field_models || !recorder->codes) {
        tetlodi_recorder_fini(recorder);
        return tetlodi_fail_nomem(error, "the coder's models", (fields + 1) * sizeof *recorder->field_models);
    }
    struct tetlodi_geometry_models *models = recorder->models;
    tetlodi_bits_init(models->splits[0], sizeof models->splits / sizeof(struct tetlodi_bit));
    tetlodi_bits_init(models->label, LABEL_CONTEXTS);
    tetlodi_bits_init(models->boundary, sizeof models->boundary / sizeof(struct tetlodi_bit));
    tetlodi_bits_init(models->arity, 4);
    tetlodi_bits_init(models->placement, 4);
    tetlodi_bits_init(models->made, 2);
    tetlodi_bits_init(models->across, 2);
    tetlodi_bits_init(&models->irregular, 1);
    tetlodi_bits_init(&models->flip, 1);
    tetlodi_bits_init(&models->fresh, 1);
    number_init(&models->extra, 1);
    number_init(&models->vertex, 1);
    number_init(models->middle, 3);
    tetlodi_bits_init(models->step[0].none, sizeof models->step / (sizeof(struct tetlodi_bit)));
    number_init(models->corner, 3);
    for (uint32_t f = 0; f < fields; f++) {
        number_init(recorder->field_models[f].child, 2);
        number_init(&recorder->field_models[f].corner, 1);
    }
    return TETLOD_OK;
}

void tetlodi_recorder_fini(struct tetlodi_recorder *recorder)
{
    if (recorder->replay)
        tetlodi_star_fini(&recorder->star, recorder->replay->memory);
    free(recorder->coders);
    free(recorder->models);
    free(recorder->field_models);
    free(recorder->codes);
    *recorder = (struct tetlodi_recorder){0};
}

/* Bits of the largest distance of a component of the link from the vertex's own. */
static unsigned extent(const struct tetlodi_star_view *star, const struct tetlodi_column *column, unsigned component)
{
    const int64_t *codes = column->codes + component;
    int64_t own = codes[(size_t)star->vertex * column->components];
    uint64_t most = 0;
    for (uint32_t i = 0; i < star->link_count; i++) {
        uint64_t distance = code_distance(codes[(size_t)star->link[i] * column->components], own);
        most = distance > most ? distance : most;
    }
    return bit_length(most);
}

/* Where the vertex was among its children: at the first's place, in their middle, or elsewhere. */
enum placement { AT_FIRST = 0, IN_MIDDLE = 1, ELSEWHERE = 2 };

/* The code of the first child if the vertex is in the middle of all. */
static int64_t middle_prediction(const struct tetlodi_scale *scale, unsigned axis, int64_t vertex_code,
                                 const int64_t codes[4], uint32_t children)
{
    if (scale->bits) {
        int64_t code = vertex_code * children;
        for (uint32_t i = 1; i < children; i++)
            code -= codes[i];
        int64_t most = (INT64_C(1) << scale->bits) - 1;
        return code < 0 ? 0 : code > most ? most : code;
    }
    double value = scale_value(scale, axis, vertex_code) * (double)children;
    for (uint32_t i = 1; i < children; i++)
        value -= scale_value(scale, axis, codes[i]);
    return isfinite(value) ? scale_code(scale, axis, value) : vertex_code;
}

static enum placement choose_placement(const struct tetlodi_record *record, int64_t (*all)[4],
                                       const struct tetlodi_column *column)
{
    const struct tetlodi_scale *scale = &column->scale;
    const int64_t *own = column->codes + (size_t)record->vertex * 3;
    int first = 1, middle = 1;
    for (unsigned axis = 0; axis < 3; axis++) {
        const int64_t *codes = all[axis];
        uint64_t difference =
            (uint64_t)codes[0] - (uint64_t)middle_prediction(scale, axis, own[axis], codes, record->children); // may wrap
        first &= codes[0] == own[axis];
        middle &= difference + 2 <= 4;
    }
    return first ? AT_FIRST : middle ? IN_MIDDLE : ELSEWHERE;
}

/* How far the link reaches from the vertex along an axis, to either side. */
struct reach {
    uint64_t low, high;
};

static struct reach reach(const struct tetlodi_star_view *star, const struct tetlodi_column *column, unsigned axis)
{
    const int64_t *codes = column->codes + axis;
    int64_t own = codes[(size_t)star->vertex * 3];
    struct reach out = {0, 0};
    for (uint32_t i = 0; i < star->link_count; i++) {
        int64_t code = codes[(size_t)star->link[i] * 3];
        uint64_t distance = code_distance(code, own);
        if (code < own)
            out.low = distance > out.low ? distance : out.low;
        else
            out.high = distance > out.high ? distance : out.high;
    }
    return out;
}

/* The next code of the link's from `code` on to one side, along an axis; `code` itself if there is none. */
static int64_t next_code(const struct tetlodi_star_view *star, const struct tetlodi_column *column, unsigned axis,
                         int64_t code, int negative)
{
    const int64_t *codes = column->codes + axis;
    int64_t best = code;
    for (uint32_t i = 0; i < star->link_count; i++) {
        int64_t other = codes[(size_t)star->link[i] * 3];
        if (negative ? other < code && (best == code || other > best) : other > code && (best == code || other < best))
            best = other;
    }
    return best;
}

/* Meshes made of layers: the child is level with a vertex of the link, the one of so many ranks to this side. */
static unsigned rank_of(const struct tetlodi_star_view *star, const struct tetlodi_column *column, unsigned axis,
                        int64_t value, int negative)
{
    int64_t code = column->codes[(size_t)star->vertex * 3 + axis];
    for (unsigned rank = 0; rank < 64; rank++) {
        int64_t next = next_code(star, column, axis, code, negative);
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
    unsigned far, level; /* how far it went at most, 0 to 3; whether it was level with a vertex of the link last */
};

/* How far a step of so many bits goes where the link reaches to so many. */
static unsigned far_of(unsigned length, unsigned room)
{
    return length + 3 <= room ? 1 : length + 2 <= room ? 2 : 3;
}

/* Codes how far a child is from the vertex along an axis. */
static int64_t code_step(struct tetlodi_recorder *recorder, unsigned axis, struct reach link, struct trail *trail,
                         int64_t value)
{
    const struct tetlodi_star_view *star = &recorder->star;
    const struct tetlodi_column *column = recorder->replay->columns;
    struct tetlodi_coder *coder = recorder->coders;
    struct tetlodi_step *models = &recorder->models->step[axis];
    int64_t own = column->codes[(size_t)star->vertex * 3 + axis];
    if (code_bit(coder, &models->none[trail->far], value == 0))
        return 0;
    unsigned side = link.high / 2 > link.low ? 4 : link.low / 2 > link.high ? 0 : link.high > link.low ? 3 : 2;
    int negative = code_bit(coder, &models->side[side], value < 0);
    unsigned room = bit_length(negative ? link.low : link.high), length;
    unsigned rank = coder->encoding ? rank_of(star, column, axis, (int64_t)((uint64_t)own + (uint64_t)value), negative) : 0;
    trail->level = (unsigned)code_bit(coder, &models->level[trail->level], rank < 64);
    if (trail->level) {
        int64_t code = own;
        for (rank = code_tree(coder, models->rank, 6, rank) + 1; rank; rank--)
            code = next_code(star, column, axis, code, negative);
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

static void code_positions(struct tetlodi_recorder *recorder, struct tetlodi_record *record)
{
    struct tetlodi_coder *coder = &recorder->coders[0];
    struct tetlodi_geometry_models *models = recorder->models;
    const struct tetlodi_column *column = &recorder->replay->columns[0];
    const struct tetlodi_scale *scale = &column->scale;
    const int64_t *own = column->codes + (size_t)record->vertex * 3;
    unsigned width = scale_width(scale), placement = 0;
    if (coder->encoding)
        placement = choose_placement(record, recorder->codes, column);
    placement = code_tree(coder, models->placement, 2, placement);
    coder->bad |= placement == 3;
    placement %= 3;
    struct trail trails[4] = {{0, 0}, {0, 0}, {0, 0}, {0, 0}};
    for (unsigned axis = 0; axis < 3; axis++) {
        int64_t *codes = recorder->codes[axis];
        struct reach link = reach(&recorder->star, column, axis);
        for (uint32_t i = placement == ELSEWHERE ? 0 : 1; i < record->children; i++) {
            int64_t difference = code_difference(codes[i], own[axis], width);
            difference = code_step(recorder, axis, link, &trails[i], difference);
            codes[i] = code_offset(own[axis], difference, scale);
        }
        if (placement == AT_FIRST) {
            codes[0] = own[axis];
        } else if (placement == IN_MIDDLE) {
            int64_t middle = middle_prediction(scale, axis, own[axis], codes, record->children);
            int64_t difference = code_difference(codes[0], middle, width);
            difference = code_number(coder, &models->middle[axis], record->children, difference);
            codes[0] = code_offset(middle, difference, scale);
        }
    }
}

/* Where a child is in the star before the split: a tetrahedron, by place, and the weights of its other three corners. */
struct location {
    uint32_t tet; /* TETLOD_NONE: at the vertex, or there is none */
    double weights[3];
};

/* The first tetrahedron that holds the point, or the one whose least barycentric weight is greatest. */
static void locate(const struct tetlodi_recorder *recorder, const double point[3], struct location *out)
{
    const struct tetlodi_star_view *star = &recorder->star;
    const double *positions = recorder->replay->columns[0].values, *v = positions + (size_t)star->vertex * 3;
    double px = point[0] - v[0], py = point[1] - v[1], pz = point[2] - v[2], best = -INFINITY;
    out->tet = TETLOD_NONE;
    for (uint32_t i = 0; i < star->size && !(best >= 0); i++) {
        const double *p0 = positions + (size_t)star->others[i][0] * 3, *p1 = positions + (size_t)star->others[i][1] * 3,
                     *p2 = positions + (size_t)star->others[i][2] * 3;
        double ax = p0[0] - v[0], ay = p0[1] - v[1], az = p0[2] - v[2];
        double bx = p1[0] - v[0], by = p1[1] - v[1], bz = p1[2] - v[2];
        double cx = p2[0] - v[0], cy = p2[1] - v[1], cz = p2[2] - v[2];
        double nx = by * cz - bz * cy, ny = bz * cx - bx * cz, nz = bx * cy - by * cx;
        double mx = py * az - pz * ay, my = pz * ax - px * az, mz = px * ay - py * ax;
        double scale = 1 / ((ax * nx + ay * ny) + az * nz);
        double w0 = ((px * nx + py * ny) + pz * nz) * scale;
        double w1 = ((cx * mx + cy * my) + cz * mz) * scale;
        double w2 = 0 - ((bx * mx + by * my) + bz * mz) * scale;
        double least = 1 - ((w0 + w1) + w2);
        least = w0 < least ? w0 : least;
        least = w1 < least ? w1 : least;
        least = w2 < least ? w2 : least;
        if (least > best) {
            best = least;
            *out = (struct location){i, {w0, w1, w2}};
        }
    }
}

static int64_t interpolate(const struct tetlodi_recorder *recorder, const struct tetlodi_column *column, unsigned component,
                           const struct location *where)
{
    uint32_t v = recorder->star.vertex;
    size_t n = column->components;
    if (where->tet == TETLOD_NONE)
        return column->codes[v * n + component];
    const uint32_t *others = recorder->star.others[where->tet];
    const double *values = column->values + component;
    double own = values[v * n];
    double value = own + where->weights[0] * (values[others[0] * n] - own);
    value = value + where->weights[1] * (values[others[1] * n] - own);
    value = value + where->weights[2] * (values[others[2] * n] - own);
    return isfinite(value) ? scale_code(&column->scale, 0, value) : column->codes[v * n + component];
}

static void code_fields(struct tetlodi_recorder *recorder, struct tetlodi_record *record)
{
    const struct tetlodi_replay *replay = recorder->replay;
    struct location where[4];
    if (replay->column_count < 2)
        return;
    for (uint32_t i = 0; i < record->children; i++) {
        double point[3];
        int same = 1;
        for (unsigned axis = 0; axis < 3; axis++) {
            same &= recorder->codes[axis][i] == replay->columns[0].codes[(size_t)record->vertex * 3 + axis];
            point[axis] = scale_value(&replay->columns[0].scale, axis, recorder->codes[axis][i]);
        }
        where[i].tet = TETLOD_NONE;
        if (!same)
            locate(recorder, point, &where[i]);
    }
    int64_t(*codes)[4] = recorder->codes + 3;
    for (uint32_t f = 1; f < replay->column_count; f++) {
        const struct tetlodi_column *column = &replay->columns[f];
        unsigned width = scale_width(&column->scale);
        for (unsigned c = 0; c < column->components; c++, codes++) {
            unsigned context = extent(&recorder->star, column, c);
            for (uint32_t i = 0; i < record->children; i++) {
                int64_t base = interpolate(recorder, column, c, &where[i]);
                int64_t difference = code_difference((*codes)[i], base, width);
                difference = code_number(&recorder->coders[f], &recorder->field_models[f - 1].child[i > 0], context,
                                         difference);
                (*codes)[i] = code_offset(base, difference, &column->scale);
            }
        }
        recorder->coders[0].bad |= recorder->coders[f].bad;
    }
}

/* What the labels of a star are guessed from: the two vertices that the split vertex parts into. */
struct pair {
    double a[3], b[3], along[3], middle3[3], length2;
};

static void pair_init(struct pair *pair, const double *a, const double *b)
{
    for (int i = 0; i < 3; i++) {
        pair->a[i] = a[i];
        pair->b[i] = b[i];
        pair->along[i] = b[i] - a[i];
        pair->middle3[i] = 1.5 * (a[i] + b[i]);
    }
    pair->length2 = (pair->along[0] * pair->along[0] + pair->along[1] * pair->along[1]) + pair->along[2] * pair->along[2];
}

/* SPEC 7.3: which of the two leave the tetrahedron in its orientation (2 bits), and which is nearer, in 8 steps. */
static unsigned geometry_context(const struct pair *pair, const double *p0, const double *p1, const double *p2, int even)
{
    static const double steps[7] = {-6, -2.5, -0.75, 0, 0.75, 2.5, 6};
    double ux = p1[0] - p0[0], uy = p1[1] - p0[1], uz = p1[2] - p0[2];
    double vx = p2[0] - p0[0], vy = p2[1] - p0[1], vz = p2[2] - p0[2];
    double nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    double a = (nx * (pair->a[0] - p0[0]) + ny * (pair->a[1] - p0[1])) + nz * (pair->a[2] - p0[2]);
    double b = (nx * (pair->b[0] - p0[0]) + ny * (pair->b[1] - p0[1])) + nz * (pair->b[2] - p0[2]);
    unsigned sides = even ? (unsigned)(a < 0) | (unsigned)(b < 0) << 1 : (unsigned)(a > 0) | (unsigned)(b > 0) << 1;
    double nearer = (((p0[0] + p1[0]) + p2[0]) - pair->middle3[0]) * pair->along[0] +
                    (((p0[1] + p1[1]) + p2[1]) - pair->middle3[1]) * pair->along[1];
    nearer = nearer + (((p0[2] + p1[2]) + p2[2]) - pair->middle3[2]) * pair->along[2];
    unsigned step = 0;
    while (step < 7 && nearer > steps[step] * pair->length2)
        step++;
    return sides * 8 + step;
}

/* The labels of neighbours that are known: how many stay, how many go, as one of ten. */
static unsigned neighbour_context(const struct tetlodi_star_view *star, uint32_t i)
{
    static const uint8_t pairs[4][4] = {{0, 1, 2, 3}, {4, 5, 6, 6}, {7, 8, 8, 8}, {9, 9, 9, 9}};
    unsigned stay = 0, go = 0;
    for (int c = 0; c < 3; c++) {
        unsigned seen = star->edge[star->edges[i][c]].seen;
        stay += seen & 1;
        go += seen >> 1;
    }
    return pairs[stay][go];
}

static void code_labels(struct tetlodi_recorder *recorder, uint32_t child, unsigned at_first)
{
    struct tetlodi_star_view *star = &recorder->star;
    const double *positions = recorder->replay->columns[0].values;
    struct pair pair;
    pair_init(&pair, positions + (size_t)star->vertex * 3, positions + (size_t)child * 3);
    for (uint32_t i = 0; i < star->size; i++) {
        const uint32_t *others = star->others[i];
        unsigned geometry = geometry_context(&pair, positions + (size_t)others[0] * 3, positions + (size_t)others[1] * 3,
                                             positions + (size_t)others[2] * 3, !(star->place[i] & 1));
        unsigned context = (at_first * 32 + geometry) * 10 + neighbour_context(star, i);
        int label = code_bit(&recorder->coders[0], &recorder->models->label[context], star->labels[i]);
        star->labels[i] = (uint8_t)label;
        for (int c = 0; c < 3; c++)
            star->edge[star->edges[i][c]].seen |= (uint8_t)(1 << label);
    }
}

/* Whether the tetrahedron between a vertex and its child at a boundary face would be a positive one. */
static unsigned positive_between(const struct tetlodi_recorder *recorder, uint32_t e, uint32_t child)
{
    const double *positions = recorder->replay->columns[0].values;
    uint32_t corners[4];
    tetlodi_star_between(&recorder->star, recorder->replay, e, child, corners);
    const double *p0 = positions + (size_t)corners[0] * 3, *p1 = positions + (size_t)corners[1] * 3,
                 *p2 = positions + (size_t)corners[2] * 3, *p3 = positions + (size_t)corners[3] * 3;
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
        const struct tetlodi_link_edge *edge = &star->edge[e];
        if ((edge->count > 1 && edge->made != (edge->seen == 3)) || (edge->made && edge->flip))
            return 1;
    }
    return star->extra_count > 0;
}

static void code_edges(struct tetlodi_recorder *recorder, uint32_t child, unsigned at_first, int irregular)
{
    struct tetlodi_star_view *star = &recorder->star;
    struct tetlodi_coder *coder = &recorder->coders[0];
    struct tetlodi_geometry_models *models = recorder->models;
    for (uint32_t e = 0; e < star->edge_count; e++) {
        struct tetlodi_link_edge *edge = &star->edge[e];
        unsigned differ = edge->seen == 3;
        if (edge->count == 1) {
            unsigned context = (at_first * 2 + star->labels[edge->tet]) * 2 + positive_between(recorder, e, child);
            edge->made = (uint8_t)code_bit(coder, &models->boundary[context], edge->made);
        } else {
            edge->made = (uint8_t)(irregular ? code_bit(coder, &models->made[differ], edge->made) : (int)differ);
        }
        edge->flip = (uint8_t)(irregular && edge->made ? code_bit(coder, &models->flip, edge->flip) : 0);
    }
}

/* Tetrahedra (vertex, child, x, y) that no edge of the link implies, or that are there more than once. */
static enum tetlod_status code_extras(struct tetlodi_recorder *recorder, uint32_t child, struct tetlod_error *error)
{
    struct tetlodi_star_view *star = &recorder->star;
    struct tetlodi_coder *coder = &recorder->coders[0];
    struct tetlodi_memory *memory = recorder->replay->memory;
    int64_t count = code_number(coder, &recorder->models->extra, 0, star->extra_count);
    if (count < 0 || (uint64_t)count > recorder->most_tets - recorder->replay->tets)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "a record brings back more tetrahedra than its level has");
    star->extra_count = (uint32_t)count;
    if (!TETLODI_ROOM(memory, star->extras, star->extras_capacity, star->extra_count))
        return tetlodi_no_room(memory, error);
    for (uint32_t i = 0; i < star->extra_count; i++) {
        for (int k = 0; k < 2; k++) {
            int64_t id = code_number(coder, &recorder->models->extra, 1, star->extras[i][k]);
            if (id < 0 || id >= child || id == star->vertex)
                return tetlodi_fail(error, TETLOD_ERR_STREAM, "a record names a vertex that is not there");
            star->extras[i][k] = (uint32_t)id;
        }
        if (star->extras[i][0] == star->extras[i][1])
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "a record names a vertex twice");
    }
    return TETLOD_OK;
}

/* Lays the tetrahedra that come back behind those that are there. Their number, or TETLOD_NONE if memory is out. */
static uint32_t put_tets(struct tetlodi_recorder *recorder, uint32_t child)
{
    struct tetlodi_replay *replay = recorder->replay;
    const struct tetlodi_star_view *star = &recorder->star;
    size_t most = (size_t)replay->tets + star->edge_count + star->extra_count;
    if (!TETLODI_ROOM(replay->memory, replay->corners, replay->corners_capacity, 4 * most))
        return TETLOD_NONE;
    uint32_t count = 0;
    for (uint32_t e = 0; e < star->edge_count; e++) {
        if (!star->edge[e].made)
            continue;
        uint32_t *corners = replay->corners + 4 * ((size_t)replay->tets + count++);
        tetlodi_star_between(star, replay, e, child, corners);
        if (star->edge[e].flip) {
            uint32_t swap = corners[0];
            corners[0] = corners[1];
            corners[1] = swap;
        }
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

static int log_labels(struct tetlodi_recorder *recorder)
{
    struct tetlodi_replay *replay = recorder->replay;
    const struct tetlodi_star_view *star = &recorder->star;
    size_t at = replay->label;
    if (!TETLODI_ROOM(replay->memory, replay->labels, replay->labels_capacity, (at + star->size) / 8 + 1))
        return 0;
    for (uint32_t i = 0; i < star->size; i++, at++) {
        uint8_t mask = (uint8_t)(1u << (at & 7)), *byte = &replay->labels[at >> 3];
        *byte = (uint8_t)((*byte & ~mask) | (star->labels[i] ? mask : 0));
    }
    return 1;
}

/* Parts one child from the vertex. The star is laid out, both positions are in place. */
static enum tetlod_status code_split(struct tetlodi_recorder *recorder, unsigned number, unsigned at_first,
                                     struct tetlod_error *error)
{
    struct tetlodi_replay *replay = recorder->replay;
    struct tetlodi_star_view *star = &recorder->star;
    uint32_t child = replay->vertices;
    if (recorder->plan && !recorder->plan(recorder->opaque, star, number))
        return tetlodi_no_room(replay->memory, error);
    code_labels(recorder, child, at_first);
    int irregular = code_bit(&recorder->coders[0], &recorder->models->irregular, recorder->plan && is_irregular(star));
    code_edges(recorder, child, at_first, irregular);
    star->extra_count = irregular ? star->extra_count : 0;
    if (irregular)
        TETLOD_TRY(code_extras(recorder, child, error));
    uint32_t added = put_tets(recorder, child);
    if (added == TETLOD_NONE || !log_labels(recorder))
        return tetlodi_no_room(replay->memory, error);
    if (added > recorder->most_tets - replay->tets)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "a record brings back more tetrahedra than its level has");
    if (!tetlodi_replay_log(replay, star->vertex, added, number == 1) || !tetlodi_replay_apply(replay))
        return tetlodi_no_room(replay->memory, error);
    return TETLOD_OK;
}

/* Puts the children's codes into the columns: the first in the vertex's place, the others behind. */
static enum tetlod_status place_children(struct tetlodi_recorder *recorder, const struct tetlodi_record *record,
                                         struct tetlod_error *error)
{
    struct tetlodi_replay *replay = recorder->replay;
    if (!tetlodi_replay_room(replay, (size_t)replay->vertices + 3, replay->tets))
        return tetlodi_no_room(replay->memory, error);
    int64_t(*codes)[4] = recorder->codes;
    for (uint32_t f = 0; f < replay->column_count; f++) {
        struct tetlodi_column *column = &replay->columns[f];
        size_t n = column->components, before = (size_t)replay->records * n, at = (size_t)replay->vertices * n;
        if (!TETLODI_ROOM(replay->memory, column->before, column->before_capacity, before + n))
            return tetlodi_no_room(replay->memory, error);
        for (unsigned c = 0; c < n; c++, codes++) {
            column->before[before + c] = (*codes)[0];
            for (uint32_t i = 0; i < record->children; i++) {
                double value = scale_value(&column->scale, f ? 0 : c, (*codes)[i]);
                if (!isfinite(value))
                    return tetlodi_fail(error, TETLOD_ERR_STREAM, "a record holds a value that is not finite");
                if (i) {
                    column->codes[at + (i - 1) * n + c] = (*codes)[i];
                    column->values[at + (i - 1) * n + c] = value;
                }
            }
        }
    }
    tetlodi_replay_exchange(replay, record->vertex, replay->records);
    replay->records++;
    replay->all_records++;
    return TETLOD_OK;
}

static enum tetlod_status code_record(struct tetlodi_recorder *recorder, struct tetlodi_record *record,
                                      struct tetlod_error *error)
{
    struct tetlodi_replay *replay = recorder->replay;
    if (!tetlodi_star_lay_out(&recorder->star, replay, record->vertex))
        return tetlodi_no_room(replay->memory, error);
    record->children = 2 + code_tree(recorder->coders, recorder->models->arity, 2, record->children - 2);
    if (record->children > 4 || record->children - 1 > recorder->most_vertices - replay->vertices)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "a record makes more vertices than its level has");
    code_positions(recorder, record);
    code_fields(recorder, record);
    if (recorder->coders[0].bad)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "a record holds what no writer writes");
    const int64_t *own = replay->columns[0].codes + (size_t)record->vertex * 3;
    unsigned at_first = own[0] == recorder->codes[0][0] && own[1] == recorder->codes[1][0] && own[2] == recorder->codes[2][0];
    TETLOD_TRY(place_children(recorder, record, error));
    for (unsigned i = 1; i < record->children; i++) {
        if (i > 1 && !tetlodi_star_lay_out(&recorder->star, replay, record->vertex))
            return tetlodi_no_room(replay->memory, error);
        TETLOD_TRY(code_split(recorder, i, at_first, error));
    }
    return TETLOD_OK;
}

enum tetlod_status tetlodi_record_code(struct tetlodi_recorder *recorder, struct tetlodi_record *record,
                                       struct tetlod_error *error)
{
    struct tetlodi_replay *replay = recorder->replay;
    uint32_t splits = replay->splits, records = replay->records;
    enum tetlod_status status = code_record(recorder, record, error);
    if (status == TETLOD_OK)
        return TETLOD_OK;
    while (replay->splits > splits && tetlodi_replay_undo(replay))
        continue;
    if (replay->records > records)
        tetlodi_replay_exchange(replay, record->vertex, --replay->records);
    tetlodi_replay_forget(replay);
    return status;
}

void tetlodi_level_begin(struct tetlodi_recorder *recorder, uint32_t vertices, uint32_t tets)
{
    recorder->walk = 0;
    recorder->level_start = recorder->replay->vertices;
    recorder->most_vertices = vertices;
    recorder->most_tets = tets;
}

int tetlodi_level_step(struct tetlodi_recorder *recorder, int split, uint32_t *out_vertex)
{
    const struct tetlodi_replay *replay = recorder->replay;
    uint32_t v = recorder->walk, size = replay->stars[v].size / 4;
    unsigned age = v >= recorder->level_start;
    split = code_bit(recorder->coders, &recorder->models->splits[age][size < 15 ? size : 15], split);
    *out_vertex = v;
    recorder->walk += !split;
    return split;
}
