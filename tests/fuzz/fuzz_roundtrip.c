/* SPDX-License-Identifier: BSD-3-Clause */
/* Bytes choose a random complex and a contraction sequence over it: what is written must be read back. */
#include <stdlib.h>
#include <string.h>

#include "tests/gen.h"
#include "tests/memory_sink.h"
#include "tests/stream_fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

static void demand(int condition)
{
    if (!condition)
        abort();
}

/* The original's own numbering, corner by corner. */
static void check_order(const struct recode *recode, const struct tetlod_file *file, const struct tetlod_mesh *mesh)
{
    uint32_t *vertices = malloc(mesh->vertices * sizeof *vertices), *tets = malloc(mesh->tets * sizeof *tets);
    uint8_t *corners = malloc(4 * (size_t)mesh->tets);
    demand(vertices && tets && corners);
    demand(tetlod_order(file, vertices, tets, corners, NULL) == TETLOD_OK);
    for (uint32_t v = 0; v < mesh->vertices; v++)
        demand(vertices[v] == (uint32_t)mesh->fields[0][v]);
    for (size_t t = 0; t < mesh->tets; t++)
        for (size_t c = 0; c < 4; c++)
            demand(recode->input.corners[4 * (size_t)tets[t] + c] ==
                   vertices[mesh->corners[4 * t + corners[4 * t + c]]]);
    free(vertices);
    free(tets);
    free(corners);
}

/* The finest level has the original's tetrahedra. The first field is the original's numbering. */
static void check_finest(const struct recode *recode, const struct memory_sink *memory)
{
    struct tetlod_file *file;
    struct tetlod_cursor *cursor;
    struct tetlod_mesh mesh;
    uint64_t sums[2] = {0, 0};
    demand(tetlod_open_memory(&file, memory->bytes, memory->size, NULL, NULL) == TETLOD_OK);
    demand(tetlod_cursor_new(&cursor, file, NULL, 0, NULL) == TETLOD_OK);
    demand(tetlod_cursor_seek(cursor, tetlod_info(file)->level_count - 1, NULL) == TETLOD_OK);
    tetlod_cursor_mesh(cursor, &mesh);
    demand(mesh.tets == recode->input.tets && mesh.vertices == recode->input.vertices);
    for (size_t t = 0; t < mesh.tets; t++) {
        uint64_t products[2] = {1, 1};
        for (size_t c = 0; c < 4; c++) {
            uint64_t ours = recode->input.corners[4 * t +
                                                  c], theirs = (uint64_t)mesh.fields[0][mesh.corners[4 * t + c]];
            products[0] *= 2 * ours * UINT64_C(0x9e3779b97f4a7c15) + 1;
            products[1] *= 2 * theirs * UINT64_C(0x9e3779b97f4a7c15) + 1;
        }
        sums[0] += products[0] ^ products[0] >> 31;
        sums[1] += products[1] ^ products[1] >> 31;
    }
    demand(sums[0] == sums[1]);
    for (size_t v = 0; v < mesh.vertices; v++)
        demand(memcmp(mesh.positions + 3 * v, recode->input.positions + 3 * (size_t)mesh.fields[0][v], 24) == 0);
    if (recode->input.keep_order)
        check_order(recode, file, &mesh);
    tetlod_cursor_free(cursor);
    tetlod_close(file);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    struct recode recode;
    struct memory_sink memory = {0};
    struct tetlodi_sink sink = memory_sink(&memory);
    struct gen_options options = {0};
    if (size < 6)
        return 0;
    memcpy(&options.seed, bytes, size < 14 ? size - 6 : 8);
    const uint8_t *last = bytes + size - 6;
    options.kind = (enum gen_kind)(last[0] % GEN_KINDS);
    options.size = 1 + last[1] % 4;
    options.levels = 1 + last[2] % 20;
    options.arity = 2 + last[3] % 3;
    options.type = last[4] % 2 ? TETLOD_FLOAT64 : TETLOD_FLOAT32;
    options.position_bits = last[5] % 31;
    options.tail_bits = last[4] & 4 ? 1 + (last[4] >> 3) % 30 : 0;
    options.noise = last[3] > 127;
    demand(gen_make(&recode, &options));
    recode.input.keep_order = last[4] & 2;
    demand(tetlodi_write(&recode.input, &sink, NULL) == TETLOD_OK);
    stream_fuzz(memory.bytes, memory.size);
    check_finest(&recode, &memory);
    free(memory.bytes);
    gen_free(&recode);
    return 0;
}
