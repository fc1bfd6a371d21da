/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The values of fields in a record (SPEC 8), both ways. What fields need of a record's geometry goes into a log, from
 * which they are decoded some hundred records at a time, each field by itself: in other threads, if there are any. A
 * child is predicted where it lies in the star before the split; the vertex's own value often is its first child's, or
 * the middle of all children's, so that nothing is left to say of one.
 */
#include "format/coding/record_fields.h"

#include <string.h>

#include "format/coding/star_view.h"

int64_t tetlodi_middle(const struct tetlodi_scale *scale, unsigned axis, int64_t vertex_code, const int64_t codes[4],
                       uint32_t children)
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
static unsigned extent(const struct tetlodi_column *column, const struct tetlodi_field_record *record,
                       const uint32_t *link,
                       unsigned component)
{
    const int64_t *codes = column->codes + component;
    int64_t own = codes[(size_t)record->vertex * column->components];
    uint64_t most = 0;
    for (uint32_t i = 0; i < record->link_count; i++) {
        uint64_t distance = code_distance(codes[(size_t)link[i] * column->components], own);
        most = distance > most ? distance : most;
    }
    return bit_length(most);
}

TETLODI_INLINE double least_of(double least, double b, double c, double d)
{
    least = b < least ? b : least;
    least = c < least ? c : least;
    return d < least ? d : least;
}

/* The first tetrahedron that holds the point, by its place in the star, or the one whose least barycentric weight is
 * greatest. */
static uint32_t find_tet(const struct tetlodi_star_view *star, const double v[3], const double point[3],
                         double weights[3])
{
    double px = point[0] - v[0], py = point[1] - v[1], pz = point[2] - v[2], best = -INFINITY;
    uint32_t found = TETLOD_NONE;
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
            found = i;
            weights[0] = w0[0], weights[1] = w1[0], weights[2] = w2[0];
        }
        if (least1 > best && !(best >= 0)) {
            best = least1;
            found = i + 1;
            weights[0] = w0[1], weights[1] = w1[1], weights[2] = w2[1];
        }
    }
    return found;
}

/* Where a child's position is in the star, whose vertex is at `v`. */
static void locate(const struct tetlodi_star_view *star, const struct tetlodi_scale *scale, const double v[3],
                   const struct tetlodi_record *record, unsigned child, struct tetlodi_location *out)
{
    double point[3];
    int same = 1;
    for (unsigned axis = 0; axis < 3; axis++) {
        same &= record->codes[axis][child] == star->own[axis];
        point[axis] = scale_value(scale, axis, record->codes[axis][child]);
    }
    uint32_t tet = same ? TETLOD_NONE : find_tet(star, v, point, out->weights);
    for (int k = 0; k < 3; k++)
        out->corners[k] = tet == TETLOD_NONE ? TETLOD_NONE : star->link[star->others[tet][k]];
}

int tetlodi_field_log_add(const struct tetlodi_recorder *recorder, struct tetlodi_field_log *log,
                          struct tetlodi_memory *memory, const struct tetlodi_star_view *star,
                          const struct tetlodi_record *record)
{
    const struct tetlodi_scale *scale = &recorder->replay->columns[0].scale;
    // one by one: of a loop over the axes gcc 12 makes wrong code at -O3
    const double v[3] = {scale_value(scale, 0, star->own[0]), scale_value(scale, 1, star->own[1]),
                         scale_value(scale, 2, star->own[2])};
    if (!TETLODI_ROOM(memory, log->records, log->records_capacity, log->count + (size_t)1) ||
        !TETLODI_ROOM(memory, log->locations, log->locations_capacity, log->location_count + (size_t)4) ||
        // never NULL
        !TETLODI_ROOM(memory, log->links, log->links_capacity, log->link_count + (size_t)star->link_count + 1))
        return 0;
    struct tetlodi_field_record *added = &log->records[log->count++];
    *added = (struct tetlodi_field_record){.vertex = record->vertex,
                                           .first_child = record->first_child,
                                           .number = record->number,
                                           .link_count = star->link_count,
                                           .children = (uint8_t)record->children,
                                           .placement = (uint8_t)record->placement,
                                           .leaves = (uint8_t)record->leaves};
    memcpy(added->nodes, record->nodes, sizeof added->nodes);
    for (uint32_t i = 0; i < star->link_count; i++)
        log->links[log->link_count++] = star->link[i];
    for (uint32_t i = 0; i < record->children; i++)
        locate(star, scale, v, record, i, &log->locations[log->location_count++]);
    return 1;
}

void tetlodi_field_log_fini(struct tetlodi_field_log *log, struct tetlodi_memory *memory)
{
    TETLODI_FREE(memory, log->records, log->records_capacity);
    TETLODI_FREE(memory, log->locations, log->locations_capacity);
    TETLODI_FREE(memory, log->links, log->links_capacity);
}

static int64_t interpolate(const struct tetlodi_column *column, unsigned component, int64_t own_code,
                           const struct tetlodi_location *where)
{
    size_t n = column->components;
    if (where->corners[0] == TETLOD_NONE)
        return own_code;
    double own = scale_value(&column->scale, 0, own_code), value = own;
    for (int k = 0; k < 3; k++) {
        double other = scale_value(&column->scale, 0, column->codes[where->corners[k] * n + component]);
        value = value + where->weights[k] * (other - own);
    }
    return isfinite(value) ? scale_code(&column->scale, 0, value) : own_code;
}

/* What is known when a component's values are coded. */
struct context {
    struct tetlodi_field_models *models;
    const struct tetlodi_scale *scale;
    uint8_t *zeros;  /* of the component's last value that had some */
    unsigned extent; /* bits of the link's greatest distance */
};

/* The most trailing zeros that are counted for a code. */
static unsigned most_zeros(const struct tetlodi_scale *scale)
{
    return scale->bits - 1 < MAX_ZEROS ? scale->bits - 1 : MAX_ZEROS;
}

/* A code of a contraction, which mostly ends in zeros: how many, and what is before the one above them. */
TETLODI_INLINE int64_t code_round(struct tetlodi_coder *coder, const struct context *context, int first, int64_t base,
                                  int64_t code)
{
    struct tetlodi_field_models *models = context->models;
    unsigned most = most_zeros(context->scale), zeros = 0;
    if (encoder_of(coder))
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
TETLODI_INLINE int64_t code_first(struct tetlodi_coder *coder, const struct context *context,
                                  enum tetlodi_placement placement,
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

/* The codes of a record's children, component by component. */
TETLODI_INLINE void code_children(struct tetlodi_coder *coder, struct tetlodi_field_models *models,
                                  const struct tetlodi_column *column,
                                 const struct tetlodi_field_record *record, const uint32_t *link,
                                 const struct tetlodi_location *where, int64_t (*codes)[4])
{
    const int64_t *own = column->codes + (size_t)record->vertex * column->components;
    for (unsigned c = 0; c < column->components; c++) {
        if (models->copied[c] < c) {
            memcpy(codes[c], codes[models->copied[c]], sizeof *codes);
            continue;
        }
        struct context context = {models, &column->scale, &models->last_zeros[c], extent(column, record, link, c)};
        for (uint32_t i = 1; i < record->children; i++)
            codes[c][i] = code_value(coder, &context, 0, record->leaves >> i & 1,
                                     interpolate(column, c, own[c], &where[i]),
                                     codes[c][i]);
        int64_t special = own[c];
        if (record->placement == IN_MIDDLE)
            special = tetlodi_middle(&column->scale, 0, own[c], codes[c], record->children);
        codes[c][0] = code_first(coder, &context, (enum tetlodi_placement)record->placement, record->leaves & 1,
                                 special,
                                 interpolate(column, c, own[c], &where[0]), codes[c][0]);
    }
}

int tetlodi_column_place(struct tetlodi_column *column, int position, uint32_t vertex, uint32_t first_child,
                         uint32_t children,
                         uint32_t record, int64_t (*codes)[4])
{
    size_t n = column->components;
    for (unsigned c = 0; c < n; c++) {
        unsigned axis = position ? c : 0;
        if (!isfinite(scale_value(&column->scale, axis, codes[c][0])))
            return 0;
        for (uint32_t i = 1; i < children; i++) {
            size_t at = (first_child + (size_t)i - 1) * n + c;
            double value = scale_value(&column->scale, axis, codes[c][i]);
            column->codes[at] = codes[c][i];
            if (!isfinite(value))
                return 0;
            if (column->values)
                column->values[at] = value;
        }
    }
    for (unsigned c = 0; c < n; c++) {
        size_t at = vertex * n + c;
        column->before[record * n + c] = column->codes[at];
        column->codes[at] = codes[c][0];
        if (column->values)
            column->values[at] = scale_value(&column->scale, position ? c : 0, codes[c][0]);
    }
    return 1;
}

TETLODI_INLINE void code_field(struct tetlodi_recorder *recorder, const struct tetlodi_field_log *log, uint32_t field,
                               tetlodi_codes_of *codes_of, void *opaque, int encoding)
{
    int64_t codes[MAX_COMPONENTS][4] = {{0}};
    struct tetlodi_column *column = &recorder->replay->columns[field];
    struct tetlodi_coder coder = recorder->coders[field]; // in registers
    const struct tetlodi_location *where = log->locations;
    const uint32_t *link = log->links;
    uint32_t placed = column->records;
    coder.encoder = encoding ? coder.encoder : NULL;
    for (uint32_t r = 0; r < log->count && !coder.bad; r++) {
        const struct tetlodi_field_record *record = &log->records[r];
        for (size_t i = 0, end = r + 1 < log->count ? record[1].link_count : 0; i < end; i++) // the next record's
            __builtin_prefetch(column->codes + (size_t)link[record->link_count + i] * column->components);
        if (encoding)
            codes_of(opaque, field, record, codes);
        code_children(&coder, &recorder->field_models[field - 1], column, record, link, where, codes);
        if (coder.bad)
            break;
        if (!tetlodi_column_place(column, 0, record->vertex, record->first_child, record->children, record->number,
                                  codes))
            coder.bad = BAD_VALUE;
        else
            placed = record->number + 1;
        link += record->link_count;
        where += record->children;
    }
    column->records = placed; // once: the next column's thread has the same cache line
    recorder->coders[field] = coder;
}

void tetlodi_field_decode(struct tetlodi_recorder *recorder, const struct tetlodi_field_log *log, uint32_t field)
{
    code_field(recorder, log, field, NULL, NULL, 0);
}

void tetlodi_field_encode(struct tetlodi_recorder *recorder, const struct tetlodi_field_log *log, uint32_t field,
                          tetlodi_codes_of *codes_of, void *opaque)
{
    code_field(recorder, log, field, codes_of, opaque, 1);
}

int tetlodi_fields_room(struct tetlodi_recorder *recorder)
{
    struct tetlodi_replay *replay = recorder->replay;
    for (uint32_t f = 1; f < replay->column_count; f++) {
        struct tetlodi_column *column = &replay->columns[f];
        if (!TETLODI_ROOM(replay->memory, column->before, column->before_capacity,
                          replay->records * (size_t)column->components))
            return 0;
    }
    return 1;
}
