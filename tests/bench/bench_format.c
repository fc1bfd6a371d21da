/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What a stream takes and how fast it is replayed: bench_format FILE.tetlod OUT [POSITION_BITS FIELD_BITS] writes it
 * once more to OUT, rounded if bits are given, and prints one line of comma-separated values: name, bits per
 * tetrahedron in all, of geometry frames, of field frames, of header and index, then millions of tetrahedra a second
 * decoded, undone and redone, milliseconds for a level near 50,000 tetrahedra, bytes of memory per tetrahedron.
 */
#define _POSIX_C_SOURCE 200809L
#include <malloc.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "format/read/reader.h"
#include "tests/memory_sink.h"
#include "tests/recode.h"

static double now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

static void fail(const struct tetlod_error *error)
{
    fprintf(stderr, "bench_format: %s\n", error->message);
    exit(1);
}

static void print_sizes(const struct tetlod_file *file)
{
    const struct tetlod_info *info = tetlod_info(file);
    double parts[2] = {0, 0}, tets = info->tets;
    for (uint32_t k = 0; k < info->level_count; k++)
        for (uint32_t p = 0; p <= info->field_count; p++)
            parts[p > 0] += 8.0 * file->index.frames[(size_t)k * (info->field_count + 1) + p].size;
    printf(",%.2f,%.2f,%.2f,%.2f", 8.0 * (double)info->bytes / tets, parts[0] / tets, parts[1] / tets,
           (8.0 * (double)info->bytes - parts[0] - parts[1]) / tets);
}

static void seek(struct tetlod_cursor *cursor, uint32_t level)
{
    struct tetlod_error error;
    if (tetlod_cursor_seek(cursor, level, &error) != TETLOD_OK)
        fail(&error);
}

static void print_speed(struct tetlod_file *file)
{
    const struct tetlod_info *info = tetlod_info(file);
    struct tetlod_cursor *cursor;
    struct tetlod_error error;
    uint32_t last = info->level_count - 1, near = tetlod_level_for_tets(info, 50000);
    double tets = 1e-6 * info->tets, times[4];
    size_t memory = mallinfo2().uordblks + mallinfo2().hblkhd;
    times[0] = now();
    if (tetlod_cursor_new(&cursor, file, NULL, 0, &error) != TETLOD_OK)
        fail(&error);
    seek(cursor, last);
    times[1] = now();
    memory = mallinfo2().uordblks + mallinfo2().hblkhd - memory;
    seek(cursor, 0);
    times[2] = now();
    seek(cursor, last);
    times[3] = now();
    printf(",%.2f,%.2f,%.2f", tets / (times[1] - times[0]), tets / (times[2] - times[1]), tets / (times[3] - times[2]));
    seek(cursor, near);
    double start = now();
    seek(cursor, near ? near - 1 : 0);
    seek(cursor, near);
    printf(",%.2f,%.0f\n", 500 * (now() - start), (double)memory / info->tets);
    tetlod_cursor_free(cursor);
}

int main(int argc, char **argv)
{
    struct tetlod_error error;
    struct tetlod_file *file, *again;
    struct recode recode;
    struct memory_sink memory = {0};
    FILE *in = argc > 2 ? fopen(argv[1], "rb") : NULL, *out = argc > 2 ? fopen(argv[2], "wb") : NULL;
    if (!in || !out || tetlod_open_fd(&file, fileno(in), NULL, &error) != TETLOD_OK) {
        fprintf(stderr, "usage: bench_format FILE.tetlod OUT [POSITION_BITS FIELD_BITS]\n");
        return 2;
    }
    if (recode_read(&recode, file, &error) != TETLOD_OK)
        fail(&error);
    if (argc > 4)
        recode_quantise(&recode, (unsigned)atoi(argv[3]), (unsigned)atoi(argv[4]));
    struct tetlodi_sink sink = memory_sink(&memory);
    if (tetlodi_write(&recode.input, &sink, &error) != TETLOD_OK ||
        tetlod_open_memory(&again, memory.bytes, memory.size, NULL, &error) != TETLOD_OK)
        fail(&error);
    if (fwrite(memory.bytes, 1, memory.size, out) != memory.size || fclose(out) != 0) {
        perror(argv[2]);
        return 1;
    }
    const char *name = strrchr(argv[1], '/') ? strrchr(argv[1], '/') + 1 : argv[1];
    printf("%.*s %s", (int)strcspn(name, "."), name, argc > 4 ? argv[3] : "lossless");
    print_sizes(again);
    print_speed(again);
    tetlod_close(again);
    recode_free(&recode);
    tetlod_close(file);
    free(memory.bytes);
    fclose(in);
    return 0;
}
