/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A value is coded as its distance, in numbers of a kind, from its value on the grid. The kind is each component's:
 * floats of the type, or decimals, which are few where a program wrote a few digits. Values of which there are few (0,
 * a material's) are remembered by their place on the grid. Where values of one place differ in their last bits, which
 * is noise, the distance is from the remembered one: a component is `near` if that makes it smaller.
 */
#include "format/coding/tail.h"

#include <stdlib.h>

#include "format/common/round.h"
#include "format/fail.h"

enum kind { KIND_FLOAT = 0, KIND_FIXED = 1, KIND_DIGITS = 2, KIND_COPY = 3 };
enum { MEMORY = 4096, NEAR_MEMORY = 65536, NEAR_MODELS = 2, MAX_POWER = 22, MAX_DIGITS = 15, SAMPLE = 1024 };
enum { NEAR_GAIN = 16 }; /* bytes; for fewer, a decoder does not need the large memory */

static const double powers[MAX_POWER + 1] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                                              1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

/* What the numbers of a component are. */
struct numbers {
    enum kind kind;
    unsigned digits; /* behind the point, or in all */
    enum tetlod_type type;
    int near; /* distances are from what is remembered of a place, if something is */
};

/* What is remembered of a place on the grid. */
struct remembered {
    int64_t code;
    double value;
    uint32_t turn; /* in which it was remembered: another turn's is forgotten */
    uint8_t again; /* it was the same value again the last time */
};

/* Bits of a float's code above those of its mantissa, at most. */
enum { MAX_WIDE = 12 };

struct models {
    struct tetlodi_bit kind[4], digits[32], source[64], repeat[2], odd;
    struct tetlodi_number number[NEAR_MODELS + 1]; /* of floats, of decimals, from what is remembered */
    /* [modelled bits] of distances that reach other exponents */
    struct tetlodi_bit wide[MAX_WIDE + 1][1 << MAX_WIDE];
};

/* Where an encoder was before a component. */
struct start {
    struct tetlodi_coder coder;
    struct tetlodi_encoder encoder;
    struct models models;
};

struct tail {
    struct models models;
    struct remembered memory[NEAR_MEMORY];
    uint32_t turn; /* counts the times that a component is coded */
    struct start start;
};

/* Decimals m * 10^e of so many digits in all, e from -22 on, in ascending order from 0: as floats, those of the least e
 * have fewer digits as well. Too large a number becomes the largest. */
static int64_t digits_code(unsigned digits, double value)
{
    double size = fabs(value), m = 0;
    int e = -MAX_POWER;
    for (; e <= MAX_POWER; e++) {
        m = floor((e < 0 ? size * powers[-e] : size / powers[e]) + 0.5);
        if (m < powers[digits])
            break;
    }
    if (e > MAX_POWER) {
        e = MAX_POWER;
        m = powers[digits] - 1;
    }
    int64_t code = (int64_t)m + (int64_t)(e + MAX_POWER) * 9 * (int64_t)powers[digits - 1];
    return value < 0 ? -code : code;
}

static double digits_value(unsigned digits, int64_t code)
{
    uint64_t size = code < 0 ? 0 - (uint64_t)code : (uint64_t)code, tenth = (uint64_t)powers[digits - 1];
    uint64_t steps = size < 10 * tenth ? 0 : (size - tenth) / (9 * tenth);
    if (steps > 2 * MAX_POWER)
        return NAN;
    int e = (int)steps - MAX_POWER;
    double m = (double)(size - steps * 9 * tenth), value = e < 0 ? m / powers[-e] : m * powers[e];
    return code < 0 ? -value : value;
}

/* The number of a kind that is nearest to a value, as an integer, and back. */
static int64_t number_code(const struct numbers *numbers, double value)
{
    if (numbers->kind == KIND_FLOAT)
        return float_code(numbers->type, value);
    if (numbers->kind == KIND_DIGITS)
        return digits_code(numbers->digits, value);
    double code = floor(value * powers[numbers->digits] + 0.5);
    return (int64_t)(code > 0x1p53 ? 0x1p53 : code > -0x1p53 ? code : -0x1p53); // NaN: the least
}

static double number_value(const struct numbers *numbers, int64_t code)
{
    if (numbers->kind == KIND_FLOAT)
        return float_value(numbers->type, code);
    double value = numbers->kind == KIND_DIGITS ? digits_value(numbers->digits,
                                                               code) : (double)code / powers[numbers->digits];
    return tetlodi_round(numbers->type, value);
}

static int is_number(const struct numbers *numbers, double value)
{
    double back = number_value(numbers, number_code(numbers, value));
    return memcmp(&back, &value, sizeof value) == 0;
}

/* The codes of a kind half a step of the grid below a value and above: what there is to choose from. */
static unsigned room(const struct numbers *numbers, const struct tetlodi_scale *scale, double value)
{
    double half = 0.5 * scale->step[0];
    return bit_length(code_distance(number_code(numbers, value + half), number_code(numbers, value - half)));
}

/* ---- choosing */

/* What the numbers of a sample would cost, in bits. */
static double cost_of(const struct numbers *numbers, const struct tetlodi_column *column, uint32_t vertices,
                      unsigned component,
                      const double *exact)
{
    const struct numbers floats = {.type = numbers->type};
    size_t n = column->components, step = vertices / SAMPLE + 1;
    double bits = 0;
    for (size_t v = 0; v < vertices; v += step) {
        double value = scale_value(&column->scale, 0, column->codes[v * n + component]);
        int good = is_number(numbers, exact[v * n + component]);
        bits += good ? room(numbers, &column->scale, value) : 8 + room(&floats, &column->scale, value);
    }
    return bits;
}

/* The cheapest kind of numbers of a component. */
static struct numbers choose(const struct tetlodi_column *column, uint32_t vertices, unsigned component,
                             const double *exact)
{
    struct numbers best = {.type = column->scale.type};
    double least = 0.95 * cost_of(&best, column, vertices, component, exact);
    for (unsigned digits = 0; digits <= MAX_DIGITS; digits++)
        for (unsigned kind = KIND_FIXED; kind <= KIND_DIGITS; kind++) {
            struct numbers numbers = {(enum kind)kind, digits, column->scale.type, 0};
            if (kind == KIND_DIGITS && !digits)
                continue;
            double cost = cost_of(&numbers, column, vertices, component, exact);
            if (cost < least) {
                least = cost;
                best = numbers;
            }
        }
    return best;
}

/* An earlier component with the same values, or the component itself. */
static unsigned find_source(const struct tetlodi_column *column, uint32_t vertices, unsigned component,
                            const double *exact)
{
    size_t n = column->components;
    for (unsigned source = 0; source < component; source++) {
        size_t v = 0;
        while (v < vertices && memcmp(&exact[v * n + source], &exact[v * n + component], sizeof *exact) == 0)
            v++;
        if (v == vertices)
            return source;
    }
    return component;
}

/* ---- coding */

static uint64_t code_plain_bits(struct tetlodi_coder *coder, unsigned count, uint64_t value)
{
    uint64_t bits = 0;
    while (count) {
        unsigned some = count < 16 ? count : 16;
        count -= some;
        bits = bits << some | code_plain(coder, some, (uint32_t)(value >> count) & ((1u << some) - 1));
    }
    return bits;
}

/* A distance, under one of the sets of models: as any number, but where it reaches into the exponents, these bits are
 * worth models. */
static int64_t code_distance_of(struct tetlodi_coder *coder, struct models *models, unsigned set, unsigned width,
                                unsigned context,
                                int64_t value)
{
    struct tetlodi_number *number = &models->number[set];
    uint64_t size = value < 0 ? 0 - (uint64_t)value : (uint64_t)value;
    unsigned mantissa = width == 32 ? 23 : 52, length = code_tree(coder, number->length[context], 7, bit_length(size));
    coder->bad |= length > width;
    if (!length || length > width)
        return 0;
    int negative = code_bit(coder, &number->sign, value < 0);
    if (length <= mantissa + 1) {
        size = code_below(coder, number->top[length], length, size);
    } else {
        unsigned wide = length - mantissa < MAX_WIDE ? length - mantissa : MAX_WIDE, left = length - 1 - wide;
        uint64_t top = UINT64_C(1) << wide | code_tree(coder, models->wide[wide], wide,
                                                       (unsigned)(size >> left) & ((1u << wide) - 1));
        size = top << left | code_plain_bits(coder, left, size);
    }
    return (int64_t)(negative ? 0 - size : size);
}

/* One value, from its code on the grid. */
static double code_exact(struct tetlodi_coder *coder, struct tail *tail, const struct numbers *numbers,
                         const struct tetlodi_scale *scale, int64_t code, double exact)
{
    const struct numbers floats = {.type = numbers->type};
    struct models *models = &tail->models;
    struct remembered *memory = &tail->memory[(uint64_t)code % (numbers->near ? NEAR_MEMORY : MEMORY)];
    int known = memory->turn == tail->turn && memory->code == code, near = known && numbers->near;
    if (known) {
        int same = memcmp(&memory->value, &exact, sizeof exact) == 0;
        memory->again = (uint8_t)code_bit(coder, &models->repeat[memory->again], same);
        if (memory->again)
            return memory->value;
    }
    if (numbers->kind != KIND_FLOAT && code_bit(coder, &models->odd, !is_number(numbers, exact)))
        numbers = &floats;
    double value = near ? memory->value : scale_value(scale, 0, code);
    unsigned set = near ? NEAR_MODELS : numbers->kind != KIND_FLOAT, context = near ? 0 : room(numbers, scale, value);
    unsigned width = numbers->kind == KIND_FLOAT && numbers->type == TETLOD_FLOAT32 ? 32 : 64;
    const struct tetlodi_scale ring = {.type = width == 32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64};
    int64_t base = number_code(numbers, value), difference = code_difference(number_code(numbers, exact), base, width);
    difference = code_distance_of(coder, models, set, width, context, difference);
    exact = number_value(numbers, code_offset(base, difference, &ring));
    coder->bad |= !isfinite(exact);
    *memory = (struct remembered){code, exact, tail->turn, 0};
    return exact;
}

/* What a component's numbers are, or KIND_COPY and in *source the earlier component that has its values. A component as
 * its own source is a near one. */
static struct numbers code_head(struct tetlodi_coder *coder, struct models *models, struct numbers numbers,
                                unsigned component,
                                unsigned *source)
{
    unsigned kind = code_tree(coder, models->kind, 2, numbers.near ? KIND_COPY : numbers.kind);
    if (kind == KIND_COPY) {
        *source = code_tree(coder, models->source, 6, *source);
        numbers.near = *source == component;
        coder->bad |= *source > component;
        if (numbers.near) {
            kind = code_tree(coder, models->kind, 2, numbers.kind);
            coder->bad |= kind == KIND_COPY;
        }
    }
    numbers.kind = (enum kind)kind;
    if (kind == KIND_FIXED || kind == KIND_DIGITS)
        numbers.digits = code_tree(coder, models->digits, 5, numbers.digits);
    coder->bad |= numbers.digits > MAX_DIGITS || (kind == KIND_DIGITS && !numbers.digits);
    return numbers;
}

/* An encoder's numbers are chosen, a decoder's are of the column's type. */
static void code_component(struct tetlodi_coder *coder, struct tail *tail, const struct tetlodi_column *column,
                           uint32_t vertices, unsigned component, struct numbers numbers, unsigned source,
                           double *exact)
{
    size_t n = column->components;
    tail->turn++;
    numbers = code_head(coder, &tail->models, numbers, component, &source);
    for (size_t v = 0; v < vertices && !coder->bad; v++) {
        double known = encoder_of(coder) ? exact[v * n + component] : 0;
        exact[v * n + component] = numbers.kind == KIND_COPY ? exact[v * n + source]
                                 : code_exact(coder, tail, &numbers, &column->scale, column->codes[v * n + component],
                                              known);
    }
}

static void remember_start(struct tail *tail, const struct tetlodi_coder *coder)
{
    tail->start.coder = *coder; // each by itself: a literal of them all would take a stack that browsers do not have
    tail->start.encoder = *coder->encoder;
    tail->start.models = tail->models;
}

static void back_to_start(struct tail *tail, struct tetlodi_coder *coder)
{
    struct tetlodi_encoder now = *coder->encoder;
    *coder = tail->start.coder;
    *coder->encoder = tail->start.encoder;
    coder->encoder->bytes = now.bytes; // may have moved
    coder->encoder->capacity = now.capacity;
    coder->encoder->failed = now.failed;
    tail->models = tail->start.models;
}

static uint64_t encoded(const struct tetlodi_coder *coder)
{
    return coder->encoder->size + coder->encoder->pending;
}

/* Near or not, whatever is smaller: only coding both ways tells. */
static void encode_component(struct tetlodi_coder *coder, struct tail *tail, const struct tetlodi_column *column,
                             uint32_t vertices, unsigned component, double *exact)
{
    struct numbers numbers = choose(column, vertices, component, exact), near = numbers;
    unsigned source = find_source(column, vertices, component, exact);
    if (source < component) {
        numbers.kind = KIND_COPY;
        code_component(coder, tail, column, vertices, component, numbers, source, exact);
        return;
    }
    near.near = 1;
    remember_start(tail, coder);
    code_component(coder, tail, column, vertices, component, near, source, exact);
    uint64_t size = encoded(coder);
    back_to_start(tail, coder);
    code_component(coder, tail, column, vertices, component, numbers, source, exact);
    if (encoded(coder) <= size + NEAR_GAIN)
        return;
    back_to_start(tail, coder);
    code_component(coder, tail, column, vertices, component, near, source, exact);
}

static void start_tail_models(struct models *models)
{
    tetlodi_bits_init(models->kind, 4);
    tetlodi_bits_init(models->digits, 32);
    tetlodi_bits_init(models->source, 64);
    tetlodi_bits_init(models->repeat, 2);
    tetlodi_bits_init(&models->odd, 1);
    tetlodi_bits_init(models->wide[0], sizeof models->wide / sizeof(struct tetlodi_bit));
    for (unsigned set = 0; set <= NEAR_MODELS; set++)
        tetlodi_number_init(&models->number[set]);
}

enum tetlod_status tetlodi_tail_code(struct tetlodi_coder *coder, const struct tetlodi_column *column,
                                     uint32_t vertices,
                                     double *exact, struct tetlod_error *error)
{
    struct tail *tail = calloc(1, sizeof *tail);
    struct tetlodi_coder own = *coder; // other threads use the coders beside this one
    if (!tail)
        return tetlodi_fail_nomem(error, "a field's exact values", sizeof *tail);
    start_tail_models(&tail->models);
    for (unsigned c = 0; c < column->components; c++)
        if (encoder_of(coder))
            encode_component(&own, tail, column, vertices, c, exact);
        else
            code_component(&own, tail, column, vertices, c, (struct numbers){.type = column->scale.type}, c, exact);
    free(tail);
    *coder = own;
    return coder->bad ? tetlodi_fail(error, TETLOD_ERR_STREAM, "its exact values are damaged") : TETLOD_OK;
}
