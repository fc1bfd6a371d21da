/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A large stream without building one: tile_stream FILE.tetlod COPIES OUT.tetlod writes so many copies of a mesh side
 * by side, contracted in turns, so that each level has so many copies of the tetrahedra of FILE's level, and its
 * errors.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "src/util/array.h"
#include "tests/recode.h"

static enum tetlod_status write_file(void *opaque, const void *bytes, size_t size)
{
    return fwrite(bytes, 1, size, opaque) == size ? TETLOD_OK : TETLOD_ERR_IO;
}

static void *room(size_t count, size_t size)
{
    void *array = array_new(count, size);
    if (!array) {
        fprintf(stderr, "tile_stream: out of memory\n");
        exit(1);
    }
    return array;
}

/* Copies an array of rows so often, one after the other or in turns. */
static double *copies(const double *rows, size_t count, size_t columns, uint32_t n, int in_turns)
{
    double *all = room(count * n, columns * sizeof *all);
    for (size_t i = 0; i < n; i++)
        for (size_t row = 0; row < count; row++)
            memcpy(all + columns * (in_turns ? row * n + i : i * count + row), rows + columns * row,
                   columns * sizeof *all);
    return all;
}

/* Along x, with a gap of the same width. */
static void move_apart(double *positions, size_t count, uint32_t n, int in_turns, double width, enum tetlod_type type)
{
    for (size_t row = 0; row < count * n; row++) {
        double x = positions[3 * row] + 2 * width * (double)(in_turns ? row % n : row / count);
        positions[3 * row] = type == TETLOD_FLOAT32 ? (double)(float)x : x;
    }
}

static uint32_t *copy_corners(const struct tetlodi_write_input *from, uint32_t n)
{
    uint32_t *corners = room((size_t)from->tets * n, 4 * sizeof *corners);
    size_t size = (size_t)from->tets * 4;
    for (size_t i = 0; i < size * n; i++)
        corners[i] = from->corners[i % size] + (uint32_t)(i / size) * from->vertices;
    return corners;
}

/* Contraction c of copy i is number c * n + i. */
static uint32_t *copy_children(const struct tetlodi_write_input *from, uint32_t n)
{
    uint32_t *children = room((size_t)from->contractions * n, 4 * sizeof *children);
    for (size_t i = 0; i < (size_t)from->contractions * n * 4; i++) {
        uint32_t copy = (uint32_t)(i / 4 % n), node = from->children[i / 4 / n * 4 + i % 4];
        children[i] = node == TETLOD_NONE      ? node
                      : node < from->vertices ? copy * from->vertices + node
                                              : n * from->vertices + (node - from->vertices) * n + copy;
    }
    return children;
}

static void tile(struct recode *out, const struct recode *from, const struct tetlod_info *info, uint32_t n)
{
    const struct tetlodi_write_input *input = &from->input;
    double width = info->bounds[1][0] - info->bounds[0][0];
    double *positions = copies(input->positions, input->vertices, 3, n, 0);
    double *node_positions = copies(input->node_positions, input->contractions, 3, n, 1);
    out->input = *input;
    out->fields = room(input->field_count, sizeof *out->fields);
    out->levels = room(input->level_count, sizeof *out->levels);
    move_apart(positions, input->vertices, n, 0, width, input->position_type);
    move_apart(node_positions, input->contractions, n, 1, width, input->position_type);
    for (uint32_t f = 0; f < input->field_count; f++) {
        out->fields[f] = from->fields[f];
        out->fields[f].values = copies(from->fields[f].values, input->vertices, from->fields[f].components, n, 0);
        if (from->fields[f].exact)
            out->fields[f].exact = copies(from->fields[f].exact, input->vertices, from->fields[f].components, n, 0);
        out->fields[f].node_values = copies(from->fields[f].node_values, input->contractions,
                                            from->fields[f].components, n, 1);
    }
    for (uint32_t k = 0; k < input->level_count; k++) {
        out->levels[k] = from->levels[k];
        out->levels[k].contractions *= n;
    }
    out->input.positions = positions;
    out->input.node_positions = node_positions;
    out->input.corners = copy_corners(input, n);
    out->input.children = copy_children(input, n);
    out->input.fields = out->fields;
    out->input.levels = out->levels;
    out->input.vertices *= n;
    out->input.tets *= n;
    out->input.contractions *= n;
}

int main(int argc, char **argv)
{
    struct tetlod_error error = {0};
    struct tetlod_file *file;
    struct recode recode, tiled;
    FILE *in = argc == 4 ? fopen(argv[1], "rb") : NULL, *out = argc == 4 ? fopen(argv[3], "wb") : NULL;
    int n = argc == 4 ? atoi(argv[2]) : 0;
    if (!in || !out || n < 1 || tetlod_open_fd(&file, fileno(in), NULL, &error) != TETLOD_OK) {
        fprintf(stderr, "usage: tile_stream FILE.tetlod COPIES OUT.tetlod\n%s\n", error.message);
        return 2;
    }
    enum tetlod_status status = recode_read(&recode, file, &error);
    if (status == TETLOD_OK) {
        const struct tetlodi_sink sink = {write_file, out};
        tile(&tiled, &recode, tetlod_info(file), (uint32_t)n);
        status = tetlodi_write(&tiled.input, &sink, &error);
        recode_free(&tiled);
        recode_free(&recode);
    }
    if (fclose(out) != 0 || status != TETLOD_OK) {
        fprintf(stderr, "tile_stream: %s\n", error.message[0] ? error.message : "cannot write");
        return 1;
    }
    tetlod_close(file);
    fclose(in);
    return 0;
}
