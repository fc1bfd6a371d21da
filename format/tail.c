/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A value is coded as its distance, in numbers of a kind, from its value on the grid. The kind is each component's: floats of the
 * type, or decimals, which are few where a program wrote a few digits. Values of which there are few (0, a material's) are
 * remembered by their place on the grid.
 */
#include "format/tail.h"

#include <stdlib.h>

#include "format/fail.h"
#include "format/round.h"

enum kind { KIND_FLOAT = 0, KIND_FIXED = 1, KIND_DIGITS = 2, KIND_COPY = 3 };
enum { MEMORY = 4096, MOST_POWER = 22, MOST_DIGITS = 15, SAMPLE = 1024 };

static const double powers[MOST_POWER + 1] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                                              1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

/* What the numbers of a component are. */
struct numbers {
    enum kind kind;
    unsigned digits; /* behind the point, or in all */
    enum tetlod_type type;
};

/* What is remembered of a place on the grid. */
struct remembered {
    int64_t code;
    double value;
    uint8_t known, again; /* there is something; it was the same value again the last time */
};

/* Bits of a float's code above those of its mantissa, at most. */
enum { MOST_WIDE = 12 };

struct tail {
    struct tetlodi_bit kind[4], digits[32], source[64], repeat[2], odd;
    struct tetlodi_number number[2]; /* of floats, of decimals */
    struct tetlodi_bit wide[MOST_WIDE + 1][1 << MOST_WIDE]; /* [modelled bits] of distances that reach other exponents */
    struct remembered memory[MEMORY];
};

/* Decimals m * 10^e of so many digits in all, e from -22 on, in ascending order from 0: as floats, those of the least e have
 * fewer digits as well. Too large a number becomes the largest. */
static int64_t digits_code(unsigned digits, double value)
{
    double size = fabs(value), m = 0;
    int e = -MOST_POWER;
    for (; e <= MOST_POWER; e++) {
        m = floor((e < 0 ? size * powers[-e] : size / powers[e]) + 0.5);
        if (m < powers[digits])
            break;
    }
    if (e > MOST_POWER) {
        e = MOST_POWER;
        m = powers[digits] - 1;
    }
    int64_t code = (int64_t)m + (int64_t)(e + MOST_POWER) * 9 * (int64_t)powers[digits - 1];
    return value < 0 ? -code : code;
}

static double digits_value(unsigned digits, int64_t code)
{
    uint64_t size = code < 0 ? 0 - (uint64_t)code : (uint64_t)code, tenth = (uint64_t)powers[digits - 1];
    uint64_t steps = size < 10 * tenth ? 0 : (size - tenth) / (9 * tenth);
    if (steps > 2 * MOST_POWER)
        return NAN;
    int e = (int)steps - MOST_POWER;
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
    double value = numbers->kind == KIND_DIGITS ? digits_value(numbers->digits, code) : (double)code / powers[numbers->digits];
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
static double cost_of(const struct numbers *numbers, const struct tetlodi_column *column, uint32_t vertices, unsigned component,
                      const double *exact)
{
    const struct numbers floats = {KIND_FLOAT, 0, numbers->type};
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
static struct numbers choose(const struct tetlodi_column *column, uint32_t vertices, unsigned component, const double *exact)
{
    struct numbers best = {KIND_FLOAT, 0, column->scale.type};
    double least = 0.95 * cost_of(&best, column, vertices, component, exact);
    for (unsigned digits = 0; digits <= MOST_DIGITS; digits++)
        for (unsigned kind = KIND_FIXED; kind <= KIND_DIGITS; kind++) {
            struct numbers numbers = {(enum kind)kind, digits, column->scale.type};
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
static unsigned find_source(const struct tetlodi_column *column, uint32_t vertices, unsigned component, const double *exact)
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

/* A distance: as any number, but where it reaches into the exponents, these bits are worth models. */
static int64_t code_distance_of(struct tetlodi_coder *coder, struct tail *tail, int decimal, unsigned width, unsigned context,
                                int64_t value)
{
    struct tetlodi_number *models = &tail->number[decimal];
    uint64_t size = value < 0 ? 0 - (uint64_t)value : (uint64_t)value;
    unsigned mantissa = width == 32 ? 23 : 52, length = code_tree(coder, models->length[context], 7, bit_length(size));
    coder->bad |= length > width;
    if (!length || length > width)
        return 0;
    int negative = code_bit(coder, &models->sign, value < 0);
    if (length <= mantissa + 1) {
        size = code_below(coder, models->top[length], length, size);
    } else {
        unsigned wide = length - mantissa < MOST_WIDE ? length - mantissa : MOST_WIDE, left = length - 1 - wide;
        uint64_t top = UINT64_C(1) << wide | code_tree(coder, tail->wide[wide], wide, (unsigned)(size >> left) & ((1u << wide) - 1));
        size = top << left | code_plain_bits(coder, left, size);
    }
    return (int64_t)(negative ? 0 - size : size);
}

/* One value, from its code on the grid. */
static double code_exact(struct tetlodi_coder *coder, struct tail *tail, const struct numbers *numbers,
                         const struct tetlodi_scale *scale, int64_t code, double exact)
{
    const struct numbers floats = {KIND_FLOAT, 0, numbers->type};
    struct remembered *memory = &tail->memory[(uint64_t)code % MEMORY];
    if (memory->known && memory->code == code) {
        int same = memcmp(&memory->value, &exact, sizeof exact) == 0;
        memory->again = (uint8_t)code_bit(coder, &tail->repeat[memory->again], same);
        if (memory->again)
            return memory->value;
    }
    if (numbers->kind != KIND_FLOAT && code_bit(coder, &tail->odd, !is_number(numbers, exact)))
        numbers = &floats;
    double value = scale_value(scale, 0, code);
    unsigned width = numbers->kind == KIND_FLOAT && numbers->type == TETLOD_FLOAT32 ? 32 : 64;
    const struct tetlodi_scale ring = {.type = width == 32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64};
    int64_t base = number_code(numbers, value), difference = code_difference(number_code(numbers, exact), base, width);
    difference = code_distance_of(coder, tail, numbers->kind != KIND_FLOAT, width, room(numbers, scale, value), difference);
    exact = number_value(numbers, code_offset(base, difference, &ring));
    coder->bad |= !isfinite(exact);
    *memory = (struct remembered){code, exact, 1, 0};
    return exact;
}

static void code_component(struct tetlodi_coder *coder, struct tail *tail, const struct tetlodi_column *column,
                           uint32_t vertices, unsigned component, double *exact)
{
    size_t n = column->components;
    unsigned source = component;
    struct numbers numbers = {KIND_FLOAT, 0, column->scale.type};
    if (coder->encoder) {
        source = find_source(column, vertices, component, exact);
        numbers = choose(column, vertices, component, exact);
    }
    numbers.kind = (enum kind)code_tree(coder, tail->kind, 2, source < component ? KIND_COPY : numbers.kind);
    if (numbers.kind == KIND_COPY) {
        source = code_tree(coder, tail->source, 6, source);
        coder->bad |= source >= component;
        for (size_t v = 0; v < vertices && !coder->bad; v++)
            exact[v * n + component] = exact[v * n + source];
        return;
    }
    if (numbers.kind != KIND_FLOAT)
        numbers.digits = code_tree(coder, tail->digits, 5, numbers.digits);
    coder->bad |= numbers.digits > MOST_DIGITS || (numbers.kind == KIND_DIGITS && !numbers.digits);
    for (size_t v = 0; v < vertices && !coder->bad; v++) {
        double known = coder->encoder ? exact[v * n + component] : 0;
        exact[v * n + component] =
            code_exact(coder, tail, &numbers, &column->scale, column->codes[v * n + component], known);
    }
}

static void start(struct tail *tail)
{
    tetlodi_bits_init(tail->kind, 4);
    tetlodi_bits_init(tail->digits, 32);
    tetlodi_bits_init(tail->source, 64);
    tetlodi_bits_init(tail->repeat, 2);
    tetlodi_bits_init(&tail->odd, 1);
    tetlodi_bits_init(tail->wide[0], sizeof tail->wide / sizeof(struct tetlodi_bit));
    tetlodi_number_init(&tail->number[0]);
    tetlodi_number_init(&tail->number[1]);
}

enum tetlod_status tetlodi_tail_code(struct tetlodi_coder *coder, const struct tetlodi_column *column, uint32_t vertices,
                                     double *exact, struct tetlod_error *error)
{
    struct tail *tail = malloc(sizeof *tail);
    struct tetlodi_coder own = *coder; // other threads use the coders beside this one
    if (!tail)
        return tetlodi_fail_nomem(error, "a field's exact values", sizeof *tail);
    start(tail);
    for (unsigned c = 0; c < column->components; c++) {
        memset(tail->memory, 0, sizeof tail->memory);
        code_component(&own, tail, column, vertices, c, exact);
    }
    free(tail);
    *coder = own;
    return coder->bad ? tetlodi_fail(error, TETLOD_ERR_STREAM, "its exact values are damaged") : TETLOD_OK;
}
