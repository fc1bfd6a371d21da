/* SPDX-License-Identifier: BSD-3-Clause */
#include "tests/gen.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/memory_sink.h"

struct maker {
    const struct gen_options *options;
    uint64_t random;
    uint32_t vertices, tets, contractions;
    double *positions, *ids, *values, *node_positions, *node_ids, *node_values;
    uint32_t *corners, *children, *living, *owner; /* owner [vertex]: its living ancestor */
    uint32_t living_count;
};

uint64_t gen_random(uint64_t *state)
{
    uint64_t z = *state += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
    return z ^ z >> 31;
}

static uint32_t below(struct maker *m, uint32_t bound)
{
    return (uint32_t)(gen_random(&m->random) % bound);
}

static double number(struct maker *m, double value)
{
    return m->options->type == TETLOD_FLOAT32 ? (double)(float)value : value;
}

static void add_tet(struct maker *m, const uint32_t corners[4])
{
    memcpy(m->corners + 4 * (size_t)m->tets++, corners, 4 * sizeof *corners);
}

static void make_grid(struct maker *m)
{
    static const uint8_t paths[6][2] = {{1, 2}, {2, 1}, {2, 4}, {4, 2}, {4, 1}, {1, 4}};
    uint32_t n = m->options->size, side = n + 1;
    for (uint32_t z = 0; z < n; z++)
        for (uint32_t y = 0; y < n; y++)
            for (uint32_t x = 0; x < n; x++)
                for (int p = 0; p < 6; p++) {
                    uint32_t at[4] = {0, paths[p][0], (uint32_t)(paths[p][0] | paths[p][1]), 7}, corners[4];
                    for (int c = 0; c < 4; c++)
                        corners[c] = x + (at[c] & 1) + side * (y + (at[c] >> 1 & 1) + side * (z + (at[c] >> 2)));
                    if (p % 2) {
                        uint32_t swap = corners[1];
                        corners[1] = corners[2];
                        corners[2] = swap;
                    }
                    if (m->options->kind == GEN_GRID || below(m, 3))
                        add_tet(m, corners);
                }
    if (!m->tets) // nothing but holes
        add_tet(m, (uint32_t[4]){0, 1, 1 + side, 1 + side + side * side});
}

static void make_soup(struct maker *m)
{
    uint32_t wanted = m->options->size * m->options->size * m->options->size;
    while (m->tets < wanted) {
        uint32_t corners[4];
        for (int c = 0, again; c < 4; c += !again) {
            corners[c] = below(m, m->vertices);
            again = 0;
            for (int d = 0; d < c; d++)
                again |= corners[c] == corners[d];
        }
        add_tet(m, corners);
        if (below(m, 8) == 0 && m->tets < wanted)
            add_tet(m, corners);
    }
}

static void make_hub(struct maker *m)
{
    for (uint32_t v = 1; v + 2 < m->vertices; v++)
        add_tet(m, (uint32_t[4]){0, v, v + 1 + v % 2, v + 2 - v % 2});
}

static void set_numbers(struct maker *m)
{
    uint32_t side = m->options->size + 1;
    for (uint32_t v = 0; v < m->vertices; v++) {
        uint32_t at[3] = {v % side, v / side % side, v / side / side};
        for (int d = 0; d < 3; d++)
            m->positions[3 * (size_t)v + (size_t)d] = number(m, at[d] + (below(m, 2) ? 1e-3 * below(m, 400) : 0) - 1);
        m->ids[v] = v;
        m->values[2 * (size_t)v] = number(m, sin(0.7 * at[0]) * at[1]);
        m->values[2 * (size_t)v + 1] = number(m,
                                              below(m, 9) ? -0.0 : ldexp(below(m, 1000) - 500.0,
                                                                         (int)below(m, 200) - 100));
    }
    if (m->options->type == TETLOD_FLOAT64)
        m->values[1] = 1.7e308;
}

/* Vertices for one contraction: some of a tetrahedron's, or any. */
static uint32_t choose(struct maker *m, uint32_t out[4])
{
    uint32_t wanted = 2 + below(m, m->options->arity - 1), count = 0, tet = below(m, m->tets);
    for (uint32_t tries = 0; tries < 16 && count < wanted; tries++) {
        uint32_t node = m->living[below(m, m->living_count)];
        if (tries < 4)
            node = m->owner[m->corners[4 * (size_t)tet + tries]];
        int seen = 0;
        for (uint32_t i = 0; i < count; i++)
            seen |= out[i] == node;
        if (!seen)
            out[count++] = node;
    }
    return count;
}

static const double *position_of(const struct maker *m, uint32_t node)
{
    return node < m->vertices ? m->positions + 3 * (size_t)node : m->node_positions + 3 * (size_t)(node - m->vertices);
}

static void contract(struct maker *m)
{
    uint32_t chosen[4], count = choose(m, chosen), node = m->vertices + m->contractions, c = m->contractions;
    if (count < 2)
        return;
    uint32_t kind = below(m, 4);
    for (uint32_t i = 0; i < 4; i++)
        m->children[4 * (size_t)c + i] = i < count ? chosen[i] : TETLOD_NONE;
    for (unsigned d = 0; d < 3; d++) {
        double sum = 0;
        for (uint32_t i = 0; i < count; i++)
            sum += position_of(m, chosen[i])[d];
        double at = kind < 2 ? position_of(m, chosen[kind])[d] : kind == 2 ? sum / count : 1e-3 * below(m, 5000);
        m->node_positions[3 * (size_t)c + d] = number(m, at);
    }
    m->node_ids[c] = node;
    m->node_values[2 * (size_t)c] = number(m, 0.01 * below(m, 1000));
    m->node_values[2 * (size_t)c + 1] = number(m, 1e-30 * below(m, 1000));
    for (uint32_t v = 0; v < m->vertices; v++)
        for (uint32_t i = 0; i < count; i++)
            m->owner[v] = m->owner[v] == chosen[i] ? node : m->owner[v];
    for (uint32_t k = 0; k < m->living_count; k++)
        for (uint32_t i = 0; i < count; i++)
            if (m->living[k] == chosen[i]) {
                m->living[k--] = m->living[--m->living_count];
                break;
            }
    m->living[m->living_count++] = node;
    m->contractions++;
}

static int allocate(struct maker *m, struct recode *out)
{
    size_t n = m->vertices, t = 6 * (size_t)m->options->size * m->options->size * m->options->size;
    m->positions = malloc(3 * n * sizeof(double));
    m->ids = malloc(n * sizeof(double));
    m->values = malloc(2 * n * sizeof(double));
    m->node_positions = malloc(3 * n * sizeof(double));
    m->node_ids = malloc(n * sizeof(double));
    m->node_values = malloc(2 * n * sizeof(double));
    m->corners = malloc(4 * t * sizeof(uint32_t));
    m->children = malloc(4 * n * sizeof(uint32_t));
    m->living = malloc(n * sizeof(uint32_t));
    m->owner = malloc(n * sizeof(uint32_t));
    out->fields = calloc(4, sizeof *out->fields);
    out->levels = calloc(m->options->levels + (size_t)1, sizeof *out->levels);
    return m->positions && m->ids && m->values && m->node_positions && m->node_ids && m->node_values && m->corners &&
           m->children && m->living && m->owner && out->fields && out->levels;
}

static void fill(struct maker *m, struct recode *out)
{
    static const double errors[4 * TETLOD_MEASURES] = {0};
    struct tetlodi_write_input *input = &out->input;
    double range[2] = {INFINITY, -INFINITY};
    for (size_t i = 0; i < 2 * (size_t)m->vertices; i++) {
        range[0] = fmin(range[0], m->values[i]);
        range[1] = fmax(range[1], m->values[i]);
    }
    *input = (struct tetlodi_write_input){.vertices = m->vertices,
                                          .tets = m->tets,
                                          .contractions = m->contractions,
                                          .position_type = m->options->type,
                                          .positions = m->positions,
                                          .corners = m->corners,
                                          .children = m->children,
                                          .node_positions = m->node_positions,
                                          .field_count = 2,
                                          .fields = out->fields,
                                          .levels = out->levels,
                                          .metadata = "{\"made by\":\"tests\"}",
                                          .compression = 1};
    out->fields[0] = (struct tetlodi_write_field){.name = "id",
                                                  .components = 1,
                                                  .type = TETLOD_FLOAT64,
                                                  .controlled = 1,
                                                  .range = {0, m->vertices - 1.0},
                                                  .values = m->ids,
                                                  .node_values = m->node_ids};
    out->fields[1] = (struct tetlodi_write_field){.name = "value",
                                                  .components = 2,
                                                  .type = m->options->type,
                                                  .range = {range[0], range[1]},
                                                  .values = m->values,
                                                  .node_values = m->node_values};
    uint32_t levels = m->options->levels < m->contractions + 1 ? m->options->levels : m->contractions + 1;
    input->level_count = levels;
    for (uint32_t k = 0; k < levels; k++) {
        uint32_t done = levels > 1 ? (uint32_t)((uint64_t)m->contractions * (levels - 1 - k) / (levels - 1)) : 0;
        out->levels[k] = (struct tetlodi_write_level){done, 0.25, errors};
    }
    if (levels == 1)
        input->contractions = 0;
}

/* What the numbers of an exact tail may be, by component. */
static double kind_of_number(uint32_t v, uint32_t component)
{
    static const double few[3] = {0, 1.5, 7.25}, powers[4] = {1e2, 1e5, 1e8, 1e12};
    switch (component) {
    case 2:
        return (v * 37 % 1001 - 500.0) / 100;
    case 3:
        return v % 17 ? (100000 + v * 7919u % 900000) / powers[v % 4] : sin(v);
    case 4:
        return (v % 5 - 2.5) * (1 + 1e-13 * sin(v));
    case 5:
        return v % 3 * 1000 + v * 7919u % 1000 * 1e-9;
    default:
        return few[v * v % 3];
    }
}

static int add_field(struct recode *out, const char *name, uint32_t components, enum tetlod_type type, uint32_t nodes)
{
    struct tetlodi_write_field *field = &out->fields[out->input.field_count];
    size_t n = out->input.vertices;
    double *values = malloc(n * components * sizeof *values), *made = malloc((nodes * (size_t)components + 1) *
                                                                             sizeof *made);
    double range[2] = {INFINITY, -INFINITY};
    *field = (struct tetlodi_write_field){.name = name, .components = components, .type = type, .values = values,
                                          .node_values = made, .was_float64 = type == TETLOD_FLOAT32};
    out->input.field_count++;
    if (!values || !made)
        return 0;
    for (size_t i = 0; i < n * components; i++) {
        values[i] = components > 1 ? kind_of_number((uint32_t)(i / components),
                                                    (uint32_t)(i % components)) : (float)cos(0.1 * (double)i);
        range[0] = fmin(range[0], values[i]);
        range[1] = fmax(range[1], values[i]);
    }
    for (size_t i = 0; i < (size_t)nodes * components; i++)
        made[i] = values[(i / components * 7919 % n) * components + i % components];
    field->range[0] = range[0];
    field->range[1] = range[1];
    return 1;
}

int gen_make(struct recode *out, const struct gen_options *options)
{
    uint32_t side = options->size + 1;
    struct maker m = {.options = options, .random = options->seed, .vertices = side * side * side};
    *out = (struct recode){0};
    int done = allocate(&m, out);
    if (done) {
        if (options->kind == GEN_SOUP)
            make_soup(&m);
        else if (options->kind == GEN_HUB)
            make_hub(&m);
        else
            make_grid(&m);
        set_numbers(&m);
        for (uint32_t v = 0; v < m.vertices; v++)
            m.living[v] = m.owner[v] = v;
        m.living_count = m.vertices;
        for (uint32_t i = 0; i < 2 * m.vertices && m.living_count > 4; i++)
            contract(&m);
        fill(&m, out);
        recode_quantise(out, options->position_bits, 0);
        if (options->tail_bits) {
            done = add_field(out, "kinds", options->noise ? 6 : 4, TETLOD_FLOAT64, m.contractions) &&
                   add_field(out, "narrow", 1, TETLOD_FLOAT32, m.contractions);
            recode_exact_later(out, options->tail_bits);
        }
    }
    free(m.living);
    free(m.owner);
    return done;
}

void gen_free(struct recode *recode)
{
    recode_free(recode);
}

int gen_write(const char *path, const struct gen_options *options)
{
    struct recode recode;
    struct memory_sink memory = {0};
    struct tetlodi_sink sink = memory_sink(&memory);
    bool made = gen_make(&recode, options) && tetlodi_write(&recode.input, &sink, NULL) == TETLOD_OK;
    FILE *file = made ? fopen(path, "wb") : NULL;
    made = file && fwrite(memory.bytes, 1, memory.size, file) == memory.size && fclose(file) == 0;
    free(memory.bytes);
    gen_free(&recode);
    return made;
}
