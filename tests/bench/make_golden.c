/* SPDX-License-Identifier: BSD-3-Clause */
/* make_golden FOLDER: writes the streams of tests/golden, whose bytes stay as they are for ever. Used once for each version of the
 * format. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/gen.h"
#include "tests/memory_sink.h"

static const struct {
    const char *name;
    struct gen_options options;
    int keep_order;
} golden[] = {
    {"one_tet", {GEN_SOUP, 1, 1, 1, 2, TETLOD_FLOAT32, 0, 0}, 0},
    {"grid_float32", {GEN_GRID, 2, 5, 9, 2, TETLOD_FLOAT32, 0, 0}, 0},
    {"grid_float64", {GEN_GRID, 3, 4, 6, 3, TETLOD_FLOAT64, 0, 0}, 0},
    {"holes_float32", {GEN_HOLES, 4, 4, 7, 4, TETLOD_FLOAT32, 0, 0}, 0},
    {"soup_float64", {GEN_SOUP, 5, 4, 5, 4, TETLOD_FLOAT64, 0, 0}, 0},
    {"grid_12_bit", {GEN_GRID, 6, 5, 8, 2, TETLOD_FLOAT32, 12, 0}, 0},
    {"soup_30_bit", {GEN_SOUP, 7, 3, 4, 4, TETLOD_FLOAT64, 30, 0}, 0},
    {"kept_order", {GEN_HOLES, 10, 4, 6, 3, TETLOD_FLOAT32, 0, 0}, 1},
    {"tail_float32", {GEN_GRID, 8, 5, 8, 3, TETLOD_FLOAT32, 0, 12}, 0},
    {"tail_float64", {GEN_HOLES, 9, 4, 6, 4, TETLOD_FLOAT64, 16, 20}, 0},
};

int main(int argc, char **argv)
{
    for (size_t i = 0; argc > 1 && i < sizeof golden / sizeof *golden; i++) {
        struct recode recode;
        struct memory_sink memory = {0};
        struct tetlodi_sink sink = memory_sink(&memory);
        char path[4096];
        snprintf(path, sizeof path, "%s/%s.tetlod", argv[1], golden[i].name);
        if (!gen_make(&recode, &golden[i].options))
            return 1;
        recode.input.keep_order = golden[i].keep_order;
        FILE *out = tetlodi_write(&recode.input, &sink, NULL) == TETLOD_OK ? fopen(path, "wb") : NULL;
        if (!out || fwrite(memory.bytes, 1, memory.size, out) != memory.size || fclose(out) != 0)
            return 1;
        free(memory.bytes);
        gen_free(&recode);
    }
    return argc > 1 ? 0 : 2;
}
