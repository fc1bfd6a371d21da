/* SPDX-License-Identifier: BSD-3-Clause */
/* make_golden FOLDER [plain]: writes the streams of tests/golden, whose bytes stay as they are for ever. Used once for
 * each version of the format. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/gen.h"
#include "tests/memory_sink.h"
#include "tests/stream_fuzz.h"

static const struct {
    const char *name;
    struct gen_options options;
    uint64_t inverted;
} golden[] = {
    {"one_tet", {GEN_SOUP, 1, 1, 1, 2, TETLOD_FLOAT32, 0, 0, 0}, 0},
    {"grid_float32", {GEN_GRID, 2, 5, 9, 2, TETLOD_FLOAT32, 0, 0, 0}, 0},
    {"grid_float64", {GEN_GRID, 3, 4, 6, 3, TETLOD_FLOAT64, 0, 0, 0}, 0},
    {"holes_float32", {GEN_HOLES, 4, 4, 7, 4, TETLOD_FLOAT32, 0, 0, 0}, 0},
    {"soup_float64", {GEN_SOUP, 5, 4, 5, 4, TETLOD_FLOAT64, 0, 0, 0}, 6},
    {"grid_12_bit", {GEN_GRID, 6, 5, 8, 2, TETLOD_FLOAT32, 12, 0, 0}, 0},
    {"soup_30_bit", {GEN_SOUP, 7, 3, 4, 4, TETLOD_FLOAT64, 30, 0, 0}, 5},
    {"kept_order", {GEN_HOLES, 8, 4, 9, 3, TETLOD_FLOAT32, 0, 0, 0}, 0},
    {"cells_float32", {GEN_HOLES, 11, 4, 7, 3, TETLOD_FLOAT32, 0, 0, 0}, 0},
    {"parents_float32", {GEN_GRID, 12, 6, 7, 3, TETLOD_FLOAT32, 0, 0, 0}, 0},
    {"tail_float32", {GEN_GRID, 8, 5, 8, 3, TETLOD_FLOAT32, 0, 12, 0}, 0},
    {"tail_float64", {GEN_HOLES, 9, 4, 6, 4, TETLOD_FLOAT64, 16, 20, 0}, 0},
    {"tail_noise", {GEN_GRID, 10, 5, 4, 3, TETLOD_FLOAT64, 12, 16, 1}, 0},
};

enum { CELL_FIELDS = 6 };

/* A field of cells of each type, with extreme values. Its values, which the caller frees; NULL: out of memory. */
static double *add_cells(struct tetlodi_write_input *input, struct tetlodi_write_cells cells[CELL_FIELDS])
{
    static const char *const names[] = {"strain", "energy", "material", "part", "element", "time \xc2\xb5s"};
    size_t tets = input->tets;
    double *values = malloc((CELL_FIELDS + 1) * tets * sizeof *values);
    uint64_t seed = 12;
    for (int f = 0; f < CELL_FIELDS && values; f++) {
        uint32_t components = f == 0 ? 2 : 1;
        double *at = values + (f ? (size_t)f + 1
                               : 0) * tets, most = f < 3 ? 0x1p7 : f == 3 ? 0x1p15 : f == 4 ? 0x1p31 : 0x1p52;
        for (size_t i = 0; i < components * tets; i++) {
            double value = (double)(int64_t)(gen_random(&seed) >> 11) / 0x1p52 - 1; // -1 .. 1
            at[i] = f == 0   ? (double)(float)value
                    : f == 1 ? value * 1e300
                    : f == 2 ? (double)(i * 8 / tets) - 4
                             : floor(value * most);
        }
        cells[f] = (struct tetlodi_write_cells){names[f], components, (enum tetlod_cell_type)f, f == 2, at,
                                               0, 0};
    }
    input->cell_field_count = CELL_FIELDS;
    input->cells = cells;
    return values;
}

enum { TETS_OF_CELL = 7 };

/* Seven tetrahedra at a time have the values of one cell, and the second field is rounded. The cells, to be freed. */
static uint32_t *join_cells(struct tetlodi_write_input *input, struct tetlodi_write_cells cells[CELL_FIELDS],
                            double *values)
{
    uint32_t *parents = malloc(input->tets * sizeof *parents);
    const double *of[CELL_FIELDS];
    for (int f = 0; f < CELL_FIELDS; f++)
        of[f] = cells[f].values;
    for (size_t t = 0; parents && t < input->tets; t++) {
        parents[t] = (uint32_t)t / TETS_OF_CELL;
        for (int f = 0; f < CELL_FIELDS; f++)
            for (size_t n = cells[f].components, c = 0; c < n; c++)
                values[of[f] - values + (ptrdiff_t)(t * n + c)] = of[f][t / TETS_OF_CELL * TETS_OF_CELL * n + c];
    }
    for (size_t t = 0; t < input->tets; t++)
        values[of[1] - values + (ptrdiff_t)t] = 0x1p880 * floor(of[1][t] / 0x1p980 + 0.5);
    cells[1].quantum = 0x1p880;
    cells[1].error = 0x1p879;
    input->parents = parents;
    return parents;
}

/* The stream as it is written, or with an index that is not packed, as corpora of the fuzz targets want it. */
static int save(const char *folder, const char *name, const struct memory_sink *memory, int plain)
{
    size_t size = memory->size;
    uint8_t *bytes = plain ? stream_fuzz_plain(memory->bytes, memory->size, &size) : memory->bytes;
    char path[4096];
    snprintf(path, sizeof path, "%s/%s.tetlod", folder, name);
    FILE *out = bytes ? fopen(path, "wb") : NULL;
    int done = out && fwrite(bytes, 1, size, out) == size && fclose(out) == 0;
    if (plain)
        free(bytes);
    return done;
}

int main(int argc, char **argv)
{
    for (size_t i = 0; argc > 1 && i < sizeof golden / sizeof *golden; i++) {
        struct recode recode;
        struct memory_sink memory = {0};
        struct tetlodi_sink sink = memory_sink(&memory);
        if (!gen_make(&recode, &golden[i].options))
            return 1;
        struct tetlodi_write_cells cells[CELL_FIELDS] = {0};
        double *values = NULL;
        uint32_t *parents = NULL;
        bool joins = strcmp(golden[i].name, "parents_float32") == 0,
             has_cells = strcmp(golden[i].name, "cells_float32") == 0;
        if ((joins || has_cells) && !(values = add_cells(&recode.input, cells)))
            return 1;
        if (joins && !(parents = join_cells(&recode.input, cells, values)))
            return 1;
        recode.input.inverted_tets = golden[i].inverted;
        recode.input.keep_order = strcmp(golden[i].name, "kept_order") == 0;
        if (tetlodi_write(&recode.input, &sink, NULL) != TETLOD_OK || !save(argv[1], golden[i].name, &memory, argc > 2))
            return 1;
        free(values);
        free(parents);
        free(memory.bytes);
        gen_free(&recode);
    }
    return argc > 1 ? 0 : 2;
}
