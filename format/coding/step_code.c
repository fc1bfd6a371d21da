/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/coding/step_code.h"

#include "format/common/allowance.h"
#include "format/common/round.h"

#include <stdlib.h>

enum { SLOWEST = 7 };

/* ---- neighbours */

static void sort(uint32_t *list, size_t count)
{
    for (size_t gap = count / 2; gap; gap /= 2)
        for (size_t i = gap; i < count; i++) {
            uint32_t vertex = list[i];
            size_t at = i;
            for (; at >= gap && list[at - gap] > vertex; at -= gap)
                list[at] = list[at - gap];
            list[at] = vertex;
        }
}

/* Each list ascending, every vertex once; the lists move together. */
static void tidy(struct tetlodi_lower *lower)
{
    size_t to = 0;
    for (uint32_t v = 0; v < lower->vertices; v++) {
        size_t begin = lower->begin[v], end = lower->begin[v + 1];
        sort(lower->vertex + begin, end - begin);
        lower->begin[v] = to;
        for (size_t i = begin; i < end; i++)
            if (i == begin || lower->vertex[i] != lower->vertex[i - 1])
                lower->vertex[to++] = lower->vertex[i];
    }
    lower->begin[lower->vertices] = to;
}

int tetlodi_lower_init(struct tetlodi_lower *lower, const uint32_t *corners, size_t tets, uint32_t vertices,
                       struct tetlodi_memory *memory)
{
    *lower = (struct tetlodi_lower){.vertices = vertices};
    size_t begin_room = 0, vertex_room = 0;
    if (!TETLODI_ROOM(memory, lower->begin, begin_room, (size_t)vertices + 2) ||
        !TETLODI_ROOM(memory, lower->vertex, vertex_room, 6 * tets + 1))
        return 0;
    memset(lower->begin, 0, ((size_t)vertices + 2) * sizeof *lower->begin);
    size_t *next = lower->begin + 1; // becomes begin when all are placed
    for (int pass = 0; pass < 2; pass++) {
        for (size_t t = 0; t < tets; t++)
            for (int i = 0; i < 4; i++)
                for (int j = 0; j < 4; j++) {
                    uint32_t a = corners[4 * t + (size_t)i], b = corners[4 * t + (size_t)j];
                    if (a >= b)
                        continue;
                    if (pass == 0)
                        next[b + 1]++;
                    else
                        lower->vertex[next[b]++] = a;
                }
        for (size_t v = 0; v < vertices && pass == 0; v++)
            next[v + 1] += next[v];
    }
    tidy(lower);
    return 1;
}

void tetlodi_lower_fini(struct tetlodi_lower *lower)
{
    free(lower->begin);
    free(lower->vertex);
    *lower = (struct tetlodi_lower){0};
}

/* ---- values */

double tetlodi_step_value(const struct tetlodi_step_scale *scale, int64_t code)
{
    if (!(scale->quantum > 0))
        return float_value(scale->type, code);
    double value = scale->quantum * (double)code;
    return tetlodi_round(scale->type, value);
}

/* What predictions are made of: the code itself where there is a quantum. */
static double number_of(const struct tetlodi_step_scale *scale, int64_t code)
{
    return scale->quantum > 0 ? (double)code : float_value(scale->type, code);
}

static int64_t code_near(const struct tetlodi_step_scale *scale, double x)
{
    return scale->quantum > 0 ? (int64_t)floor(x + 0.5) : float_code(scale->type, x);
}

static double predict(const struct tetlodi_steps *steps, enum step_mode mode, uint32_t v)
{
    const struct tetlodi_lower *lower = steps->lower;
    size_t begin = lower->begin[v], end = lower->begin[v + 1];
    double sum = 0, rest = mode == STEP_KEY ? v ? steps->now[v - 1] : 0 : steps->before[v];
    if (mode == STEP_SAME || begin == end)
        return rest;
    for (size_t i = begin; i < end; i++) {
        uint32_t n = lower->vertex[i];
        sum += mode == STEP_KEY ? steps->now[n] : steps->now[n] - steps->before[n];
    }
    double mean = sum / (double)(end - begin), x = mode == STEP_KEY ? mean : rest + mean;
    return isfinite(x) ? x : rest;
}

/* How long the numbers of the neighbours were; of rows without neighbours those of the two rows above. */
static unsigned context_of(const struct tetlodi_steps *steps, size_t v)
{
    const struct tetlodi_lower *lower = steps->lower;
    size_t begin = lower ? lower->begin[v] : 0, end = lower ? lower->begin[v + 1] : 0, sum = 0;
    for (size_t i = begin; i < end; i++)
        sum += steps->lengths[lower->vertex[i]];
    if (end > begin)
        sum = 2 * sum / (end - begin);
    else if (v)
        sum = (size_t)steps->lengths[v - 1] + steps->lengths[lower || v == 1 ? v - 1 : v - 2];
    return sum < NUMBER_CONTEXTS ? (unsigned)sum : NUMBER_CONTEXTS - 1;
}

static int is_code(const struct tetlodi_steps *steps, int64_t code)
{
    const struct tetlodi_step_scale *scale = &steps->scale;
    if (!steps->lower)
        return code >= steps->rows.least && code <= steps->rows.most;
    return (!(scale->quantum > 0) ||
            (code >= -MAX_STEP_CODE && code <= MAX_STEP_CODE)) && isfinite(tetlodi_step_value(scale, code));
}

/* Of a row without neighbours, whose code is that of the step before, as `above` is of the row above; codes[-1] is that
 * one's now. */
static int64_t predict_row(enum step_mode mode, const int64_t *codes, size_t row, int64_t above, unsigned width)
{
    if (mode == STEP_KEY)
        return row ? codes[-1] : 0;
    return mode == STEP_SAME || !row ? codes[0]
                                     : code_difference(codes[0], code_difference(above, codes[-1], width), width);
}

/* What an encoder tells where `near` is predicted: that, if it will do. Else a third of the way from the edge of those
 * allowed to their middle, or up to that middle what has no more bits: the next steps are then likely to need no
 * change. */
static int64_t choose_code(const struct tetlodi_step_scale *scale, int64_t near, const int64_t allowed[2])
{
    int64_t edge = near < allowed[0] ? allowed[0] : near > allowed[1] ? allowed[1] : near;
    if (edge == near || !(scale->quantum > 0)) // floats' codes may be too far apart to subtract
        return edge;
    int64_t middle = allowed[0] + (allowed[1] - allowed[0]) / 2, sign = edge < near ? -1 : 1;
    uint64_t inner = (uint64_t)(sign * (edge + (middle - edge) / 3 - near)), most = (uint64_t)(sign * (middle - near));
    uint64_t longest = (UINT64_C(1) << bit_length(inner)) - 1;
    return near + sign * (int64_t)(longest < most ? longest : most);
}

/* Both ways: an encoder chooses among the codes allowed. 0: a code is none. */
static int code_component(struct tetlodi_coder *coder, struct tetlodi_steps *steps, enum step_mode mode, int64_t *codes,
                          const int64_t *allowed)
{
    struct tetlodi_number *models = &steps->models.value[mode != STEP_KEY];
    unsigned width = steps->rows.width;
    int64_t above = 0, before = 0; // of the row above and of this one, in the step before
    for (size_t v = 0; v < steps->rows.count && mode != STEP_KEY && steps->lower; v++)
        steps->before[v] = number_of(&steps->scale, codes[v]);
    for (size_t v = 0; v < steps->rows.count; v++, above = before) {
        int64_t near = steps->lower ? code_near(&steps->scale, predict(steps, mode, (uint32_t)v))
                                    : predict_row(mode, codes + v, v, above, width);
        int64_t wanted = allowed ? choose_code(&steps->scale, near, allowed + 2 * v) : near;
        int64_t number = code_number(coder, models, context_of(steps, v),
                                     allowed ? code_difference(wanted, near, width) : 0);
        before = codes[v];
        codes[v] = code_difference(near, (int64_t)(0 - (uint64_t)number), width);
        if (!is_code(steps, codes[v]))
            return 0;
        if (steps->lower)
            steps->now[v] = number_of(&steps->scale, codes[v]);
        steps->lengths[v] = (uint8_t)bit_length(number < 0 ? 0 - (uint64_t)number : (uint64_t)number);
    }
    return 1;
}

static int code_step(struct tetlodi_coder *coder, struct tetlodi_steps *steps, enum step_mode wanted, int64_t *codes,
                     const int64_t *allowed)
{
    size_t n = steps->rows.count;
    enum step_mode mode = (enum step_mode)code_tree(coder, steps->models.mode, 2, wanted);
    if (mode >= STEP_MODES || (steps->first && steps->lower && mode != STEP_KEY))
        return 0;
    for (uint32_t c = 0; c < steps->components; c++)
        if (!code_component(coder, steps, mode, codes + c * n, allowed ? allowed + 2 * c * n : NULL))
            return 0;
    return !coder->bad;
}

/* ---- groups */

static int make_room(struct tetlodi_steps *steps, struct tetlodi_memory *memory)
{
    size_t n = steps->rows.count, doubles = steps->lower ? n + 1 : 1, rooms[4] = {0};
    return TETLODI_ROOM(memory, steps->codes, rooms[0], n * steps->components + 1) &&
           TETLODI_ROOM(memory, steps->before, rooms[1], doubles) &&
           TETLODI_ROOM(memory, steps->now, rooms[2], doubles) && TETLODI_ROOM(memory, steps->lengths, rooms[3], n + 1);
}

int tetlodi_steps_init(struct tetlodi_steps *steps, const struct tetlodi_lower *lower,
                       const struct tetlodi_step_scale *scale,
                       uint32_t components, struct tetlodi_memory *memory)
{
    *steps = (struct tetlodi_steps){.lower = lower, .scale = *scale, .components = components};
    steps->rows.count = lower->vertices;
    steps->rows.width = scale->quantum > 0 || scale->type != TETLOD_FLOAT32 ? 64 : 32;
    return make_room(steps, memory);
}

int tetlodi_steps_init_rows(struct tetlodi_steps *steps, const struct tetlodi_step_rows *rows, uint32_t components,
                            struct tetlodi_memory *memory)
{
    *steps = (struct tetlodi_steps){.rows = *rows, .components = components};
    return make_room(steps, memory);
}

void tetlodi_steps_fini(struct tetlodi_steps *steps)
{
    free(steps->codes);
    free(steps->before);
    free(steps->now);
    free(steps->lengths);
    *steps = (struct tetlodi_steps){0};
}

void tetlodi_steps_start(struct tetlodi_steps *steps)
{
    steps->first = 1;
    tetlodi_bits_init(steps->models.mode, 4);
    tetlodi_number_init(&steps->models.value[0]);
    tetlodi_number_init(&steps->models.value[1]);
}

bool tetlodi_steps_hold(uint64_t rows, uint64_t bytes)
{
    return is_within(rows, STEP_ROWS_FREE, STEP_ROWS_PER_BYTE, bytes);
}

int tetlodi_steps_decode(struct tetlodi_steps *steps, const uint8_t *bytes, size_t size)
{
    struct tetlodi_coder coder;
    tetlodi_decode_start(&coder, SLOWEST, bytes, size);
    int good = code_step(&coder, steps, STEP_KEY, steps->codes, NULL);
    steps->first = 0;
    while (good && coder.at < coder.end)
        good = *coder.at++ == 0;
    return good;
}

size_t tetlodi_steps_encode(struct tetlodi_steps *steps, const int64_t *allowed, struct tetlodi_buffer *out)
{
    size_t count = steps->rows.count * steps->components, least = SIZE_MAX;
    struct tetlodi_memory memory = {.most = UINT64_MAX};
    struct tetlodi_encoder best = {0};
    struct tetlodi_step_models *models = malloc(2 * sizeof *models);
    int64_t *codes = malloc(2 * (count + 1) * sizeof *codes);
    int failed = !models || !codes;
    for (int mode = 0; mode < (steps->first && steps->lower ? 1 : STEP_MODES) && !failed; mode++) {
        struct tetlodi_encoder encoder = {0};
        struct tetlodi_coder coder;
        memcpy(codes, steps->codes, count * sizeof *codes);
        models[0] = steps->models;
        tetlodi_encode_start(&coder, SLOWEST, &encoder, &memory);
        code_step(&coder, steps, (enum step_mode)mode, codes, allowed);
        tetlodi_encode_finish(&coder);
        failed = encoder.failed;
        if (!failed && encoder.size < least) {
            struct tetlodi_encoder worse = best;
            best = encoder;
            encoder = worse;
            least = best.size;
            memcpy(codes + count, codes, count * sizeof *codes);
            models[1] = steps->models;
        }
        free(encoder.bytes);
        steps->models = models[0];
    }
    if (!failed) {
        memcpy(steps->codes, codes + count, count * sizeof *codes);
        steps->models = models[1];
        tetlodi_put_block(out, best.bytes, best.size);
    }
    steps->first = 0;
    out->failed |= failed != 0;
    free(best.bytes);
    free(models);
    free(codes);
    return failed ? 0 : best.size;
}
