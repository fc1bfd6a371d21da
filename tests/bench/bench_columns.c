/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What of a stream is what: bench_columns FILE.tetlod prints bits per tetrahedron, comma-separated: which vertices
 * split, labels, tetrahedra that come back, base mesh's connectivity, positions, fields. A bit under a model costs the
 * logarithm of its chance. The decoder is compiled once more here, with the hook of coder.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static void count_bit(const void *model, unsigned chance, unsigned plain);
#define TETLODI_COUNT(model, chance, plain) count_bit(model, chance, plain)

#include "format/coding/base.c"
#include "format/read/cursor.c"
#include "format/coding/record.c"
#include "format/coding/record_fields.c"
#include "format/coding/tail.c"

enum { SLOTS = 1 << 20 }; /* more than there are models */

static struct cost {
    const char *model;
    double bits;
} costs[SLOTS], *last = costs;

static void count_bit(const void *model, unsigned chance, unsigned plain)
{
    if (model) {
        size_t at = (size_t)((uintptr_t)model * UINT64_C(0x9e3779b97f4a7c15) >> 44);
        while (costs[at].model && costs[at].model != model)
            at = (at + 1) % SLOTS;
        last = &costs[at];
        last->model = model;
    }
    last->bits += plain - (model ? log2(chance / 65536.0) : 0); // what has no model belongs to the bit before it
}

/* Bits under the models of a part of a structure. */
static double sum(const void *part, size_t size)
{
    double bits = 0;
    for (size_t i = 0; i < SLOTS; i++)
        if (costs[i].model >= (const char *)part && costs[i].model < (const char *)part + size)
            bits += costs[i].bits;
    return bits;
}
#define SUM(part) sum(&(part), sizeof(part))

int main(int argc, char **argv)
{
    struct tetlod_error error;
    struct tetlod_file *file;
    struct tetlod_cursor *cursor;
    FILE *in = argc > 1 ? fopen(argv[1], "rb") : NULL;
    if (!in || tetlod_open_fd(&file, fileno(in), NULL, &error) != TETLOD_OK ||
        tetlod_cursor_new(&cursor, file, NULL, 0, &error) != TETLOD_OK ||
        tetlod_cursor_seek(cursor, tetlod_info(file)->level_count - 1, &error) != TETLOD_OK) {
        fprintf(stderr, "bench_columns: %s\n", in ? error.message : "FILE.tetlod is missing: a whole stream");
        return 2;
    }
    const struct tetlodi_geometry_models *m = cursor->recorder.models;
    double tets = tetlod_info(file)->tets, fields = 0;
    double leaves = SUM(m->leaf);
    double made = SUM(m->irregular) + SUM(m->boundary) + SUM(m->made) + SUM(m->flip) + SUM(m->extra) + SUM(m->arity);
    double base = SUM(m->across) + SUM(m->fresh) + SUM(m->vertex);
    double positions = SUM(m->placement) + SUM(m->step) + SUM(m->middle) + SUM(m->corner);
    for (uint32_t f = 0; f < tetlod_info(file)->field_count; f++)
        fields += SUM(cursor->recorder.field_models[f]);
    printf("%.2f,%.2f,%.2f,%.2f,%.2f,%.2f\n", (SUM(m->splits) + leaves) / tets, SUM(m->label) / tets, made / tets,
           base / tets,
           positions / tets, fields / tets);
    tetlod_cursor_free(cursor);
    tetlod_close(file);
    fclose(in);
    return 0;
}
