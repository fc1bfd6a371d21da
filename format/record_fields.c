/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The values of fields in a record (SPEC 8), both ways. A child is predicted where it lies in the star before the split;
 * the vertex's own value often is its first child's, or the middle of all children's, so that nothing is left to say of one.
 */
#include "format/record_fields.h"

#include "format/star_view.h"

void tetlodi_copies_code(struct tetlodi_coder *coder, struct tetlodi_field_models *models, unsigned components)
{
    for (unsigned c = 1; c < components; c++) {
        if (!code_bit(coder, &models->copies, models->copied[c] < c))
            continue;
        unsigned source = code_tree(coder, models->source, 6, models->copied[c]);
        coder->bad |= source >= c;
        models->copied[c] = (uint8_t)(source < c ? source : c);
    }
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

/* Where a child is in the star before the split: a tetrahedron, by place, and the weights of its other three corners. */
struct location {
    uint32_t tet; /* TETLOD_NONE: at the vertex, or there is none */
    double weights[3];
};

TETLODI_INLINE double least_of(double least, double b, double c, double d)
{
    least = b < least ? b : least;
    least = c < least ? c : least;
    return d < least ? d : least;
}

/* The first tetrahedron that holds the point, or the one whose least barycentric weight is greatest. */
static void locate(const struct tetlodi_recorder *recorder, const double point[3], struct location *out)
{
    const struct tetlodi_star_view *star = &recorder->star;
    const double *v = recorder->replay->columns[0].values + (size_t)star->vertex * 3;
    double px = point[0] - v[0], py = point[1] - v[1], pz = point[2] - v[2], best = -INFINITY;
    out->tet = TETLOD_NONE;
    for (uint32_t i = 0; i < star->size && !(best >= 0); i += 2) {
        struct corner2 p0 = corner2(star, i, 0), p1 = corner2(star, i, 1), p2 = corner2(star, i, 2);
        pair2 ax = p0.x - v[0], ay = p0.y - v[1], az = p0.z - v[2];
        pair2 bx = p1.x - v[0], by = p1.y - v[1], bz = p1.z - v[2];
        pair2 cx = p2.x - v[0], cy = p2.y - v[1], cz = p2.z - v[2];
        pair2 nx = by * cz - bz * cy, ny = bz * cx - bx * cz, nz = bx * cy - by * cx;
        pair2 mx = py * az - pz * ay, my = pz * ax - px * az, mz = px * ay - py * ax;
        pair2 scale = 1 / ((ax * nx + ay * ny) + az * nz);
        pair2 w0 = ((px * nx + py * ny) + pz * nz) * scale;
        pair2 w1 = ((cx * mx + cy * my) + cz * mz) * scale;
        pair2 w2 = 0 - ((bx * mx + by * my) + bz * mz) * scale;
        pair2 rest = 1 - ((w0 + w1) + w2);
        double least0 = least_of(rest[0], w0[0], w1[0], w2[0]), least1 = least_of(rest[1], w0[1], w1[1], w2[1]);
        if (least0 > best) {
            best = least0;
            *out = (struct location){i, {w0[0], w1[0], w2[0]}};
        }
        if (least1 > best && !(best >= 0)) {
            best = least1;
            *out = (struct location){i + 1, {w0[1], w1[1], w2[1]}};
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
    const uint32_t *others = recorder->star.others[where->tet], *link = recorder->star.link;
    double own = scale_value(&column->scale, 0, column->codes[v * n + component]), value = own;
    for (int k = 0; k < 3; k++) {
        double other = scale_value(&column->scale, 0, column->codes[link[others[k]] * n + component]);
        value = value + where->weights[k] * (other - own);
    }
    return isfinite(value) ? scale_code(&column->scale, 0, value) : column->codes[v * n + component];
}

/* Locates the children's positions in the star. */
static void locate_children(const struct tetlodi_recorder *recorder, const struct tetlodi_record *record,
                            struct location where[4])
{
    const struct tetlodi_column *positions = recorder->replay->columns;
    for (uint32_t i = 0; i < record->children; i++) {
        double point[3];
        int same = 1;
        for (unsigned axis = 0; axis < 3; axis++) {
            same &= recorder->codes[axis][i] == positions->codes[(size_t)record->vertex * 3 + axis];
            point[axis] = scale_value(&positions->scale, axis, recorder->codes[axis][i]);
        }
        where[i].tet = TETLOD_NONE;
        if (!same)
            locate(recorder, point, &where[i]);
    }
}

/* What is known when a component's values are coded. */
struct context {
    struct tetlodi_field_models *models;
    const struct tetlodi_scale *scale;
    uint8_t *zeros;  /* of the component's last value that had some */
    unsigned extent; /* bits of the link's greatest distance */
};

/* Most trailing zeros that a code is told to have. */
static unsigned most_zeros(const struct tetlodi_scale *scale)
{
    return scale->bits - 1 < MOST_ZEROS ? scale->bits - 1 : MOST_ZEROS;
}

/* A code of a contraction, which mostly ends in zeros: how many, and what is before the one above them. */
TETLODI_INLINE int64_t code_round(struct tetlodi_coder *coder, const struct context *context, int first, int64_t base, int64_t code)
{
    struct tetlodi_field_models *models = context->models;
    unsigned most = most_zeros(context->scale), zeros = 0;
    if (coder->encoder)
        zeros = code && __builtin_ctzll((uint64_t)code) < (int)most ? (unsigned)__builtin_ctzll((uint64_t)code) : most;
    zeros = code_tree(coder, models->zeros[*context->zeros], 4, zeros);
    coder->bad |= zeros > most;
    zeros = zeros > most ? most : zeros;
    *context->zeros = (uint8_t)zeros;
    unsigned shift = zeros < most ? zeros + 1 : most, extent = context->extent;
    int64_t one = zeros < most ? INT64_C(1) << zeros : 0, middle = zeros < most ? 0 : INT64_C(1) << most >> 1;
    base = ((base + middle) >> shift << shift) + one;
    int64_t difference = code_difference(code, base, scale_width(context->scale)) >> shift;
    difference = code_number(coder, &models->child[0][first], extent > shift ? extent - shift : 0, difference);
    return code_offset(base, (int64_t)((uint64_t)difference << shift), context->scale);
}

/* A child's code from what is predicted of it. An original's has all bits. */
TETLODI_INLINE int64_t code_value(struct tetlodi_coder *coder, const struct context *context, int first, int leaf,
                                 int64_t base, int64_t code)
{
    const struct tetlodi_scale *scale = context->scale;
    if (!leaf && scale->bits)
        return code_round(coder, context, first, base, code);
    int64_t difference = code_difference(code, base, scale_width(scale));
    difference = code_number(coder, &context->models->child[leaf][first], context->extent, difference);
    return code_offset(base, difference, scale);
}

/* The first child, after the others: the vertex's own value, or what makes that the middle of all, or a value. */
TETLODI_INLINE int64_t code_first(struct tetlodi_coder *coder, const struct context *context, enum tetlodi_placement placement,
                                 int leaf, int64_t special, int64_t base, int64_t code)
{
    struct tetlodi_field_models *models = context->models;
    uint64_t nudge = (uint64_t)code - (uint64_t)special + 1;
    int kept = placement == AT_FIRST ? nudge == 1 : nudge < 4;
    if (placement != ELSEWHERE && code_bit(coder, &models->kept[placement][leaf], kept)) {
        nudge = placement == AT_FIRST ? 1 : code_tree(coder, models->nudge, 2, (unsigned)nudge);
        return code_offset(special, (int64_t)nudge - 1, context->scale);
    }
    return code_value(coder, context, 1, leaf, base, code);
}

TETLODI_INLINE void field_inline(struct tetlodi_recorder *recorder, uint32_t field, const struct tetlodi_record *record,
                                const struct location where[4], int64_t (*codes)[4], int encoding)
{
    const struct tetlodi_column *column = &recorder->replay->columns[field];
    struct tetlodi_field_models *models = &recorder->field_models[field - 1];
    struct tetlodi_coder coder = recorder->coders[field]; // in registers
    const int64_t *own = column->codes + (size_t)record->vertex * column->components;
    coder.encoder = encoding ? coder.encoder : NULL;
    for (unsigned c = 0; c < column->components; c++) {
        if (models->copied[c] < c) {
            memcpy(codes[c], codes[models->copied[c]], sizeof *codes);
            continue;
        }
        struct context context = {models, &column->scale, &models->last_zeros[c], extent(&recorder->star, column, c)};
        for (uint32_t i = 1; i < record->children; i++)
            codes[c][i] = code_value(&coder, &context, 0, record->leaves >> i & 1, interpolate(recorder, column, c, &where[i]),
                                     codes[c][i]);
        int64_t special = own[c];
        if (record->placement == IN_MIDDLE)
            special = tetlodi_middle(&column->scale, 0, own[c], codes[c], record->children);
        codes[c][0] = code_first(&coder, &context, record->placement, record->leaves & 1, special,
                                 interpolate(recorder, column, c, &where[0]), codes[c][0]);
    }
    recorder->coders[field] = coder;
}

void tetlodi_record_fields(struct tetlodi_recorder *recorder, const struct tetlodi_record *record)
{
    const struct tetlodi_replay *replay = recorder->replay;
    struct location where[4];
    if (replay->column_count < 2)
        return;
    locate_children(recorder, record, where);
    int64_t(*codes)[4] = recorder->codes + 3;
    for (uint32_t f = 1; f < replay->column_count; codes += replay->columns[f++].components) {
        if (recorder->coders[f].encoder)
            field_inline(recorder, f, record, where, codes, 1);
        else
            field_inline(recorder, f, record, where, codes, 0);
        recorder->coders[0].bad |= recorder->coders[f].bad;
    }
}
