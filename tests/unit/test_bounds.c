/* SPDX-License-Identifier: BSD-3-Clause */
/* What a file can ask for goes with its bytes (SPEC 2.3): memory and time of the worst streams, which are at the
 * limit of
 * labels or have many levels, beside those of an ordinary one. */
#include <stdlib.h>
#include <time.h>

#include "format/common/allowance.h"
#include "format/read/cursor.h"
#include "format/read/reader.h"
#include "tests/gen.h"
#include "tests/heap.h"
#include "tests/memory_sink.h"
#include "tests/test.h"

#ifdef __SANITIZE_ADDRESS__ // which makes all of it slow
enum { HUB = 12, GRID = 8, MAX_RATIO = 20 };
#else
enum { HUB = 16, GRID = 12, MAX_RATIO = 6 };
#endif

struct cost {
    double seconds;              /* of processor, for a byte */
    uint64_t bytes, peak;        /* of the file; of memory */
    uint64_t labels, geometry;   /* of all records; bytes of geometry frames */
};

static double processor_seconds(void)
{
    struct timespec time;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

/* Opens the stream, and decodes every level with all fields. */
static void decode(const struct memory_sink *stream, struct cost *out)
{
    const size_t before = now;
    const double started = processor_seconds();
    struct tetlod_file *file;
    struct tetlod_cursor *cursor;
    struct tetlod_error error = {0};
    peak = now;
    *out = (struct cost){.bytes = stream->size};
    REQUIRE(tetlod_open_memory(&file, stream->bytes, stream->size, NULL, &error) == TETLOD_OK);
    const struct tetlod_info *info = tetlod_info(file);
    REQUIRE(tetlod_cursor_new(&cursor, file, NULL, TETLOD_NONE, &error) == TETLOD_OK);
    if (tetlod_cursor_seek(cursor, info->level_count - 1, &error) != TETLOD_OK)
        TEST_FAIL("%s", error.message);
    out->seconds = (processor_seconds() - started) / (double)stream->size;
    out->peak = peak - before;
    out->labels = cursor->recorder.labels;
    for (uint32_t k = 0; k < info->level_count; k++)
        out->geometry += file->index.frames[k * (1 + info->field_count)].size;
    tetlod_cursor_free(cursor);
    tetlod_close(file);
    CHECK_INT(now, before);
}

/* The least of three: other processes make it longer. */
static struct cost cost_of(const struct gen_options *options)
{
    struct cost cost = {0}, again;
    struct recode recode;
    struct memory_sink stream = {0};
    struct tetlodi_sink sink = memory_sink(&stream);
    if (!gen_make(&recode, options) || tetlodi_write(&recode.input, &sink, NULL) != TETLOD_OK) {
        TEST_FAIL("kind %d is not made", (int)options->kind);
        return cost;
    }
    decode(&stream, &cost);
    for (int i = 0; i < 2; i++) {
        decode(&stream, &again);
        cost.seconds = again.seconds < cost.seconds ? again.seconds : cost.seconds;
    }
    printf("# kind %d, size %u: %llu bytes; for each %.0f of memory, %.2f us; for each of geometry %.1f labels\n",
           (int)options->kind, options->size, (unsigned long long)cost.bytes, (double)cost.peak / (double)cost.bytes,
           cost.seconds * 1e6, (double)cost.labels / (double)cost.geometry);
    free(stream.bytes);
    gen_free(&recode);
    return cost;
}

static struct gen_options grid(uint32_t levels)
{
    return (struct gen_options){.kind = GEN_GRID, .seed = 1, .size = GRID, .levels = levels, .arity = 2,
                                .type = TETLOD_FLOAT32};
}

/* One vertex is in every tetrahedron: each split codes a label for all that are there. */
static struct gen_options hub(uint32_t size)
{
    return (struct gen_options){.kind = GEN_HUB, .seed = 1, .size = size, .levels = 5, .arity = 2,
                                .type = TETLOD_FLOAT32, .position_bits = 4};
}

static void check_memory(const struct cost *cost)
{
    CHECK(cost->peak <= (1 << 20) + 128 * cost->bytes);
    CHECK(cost->peak <= MEMORY_FREE + MEMORY_PER_BYTE * cost->bytes);
}

static void test_large_stars(void)
{
    const struct gen_options ordinary = grid(5), worst = hub(HUB);
    const struct cost usual = cost_of(&ordinary), cost = cost_of(&worst);
    CHECK(usual.labels < LABELS_FREE + LABELS_PER_BYTE * usual.geometry);
    CHECK(cost.labels <= LABELS_FREE + LABELS_PER_BYTE * cost.geometry);
    CHECK(cost.labels > LABELS_PER_BYTE * cost.geometry * 9 / 10); // it was padded
    CHECK(cost.seconds < MAX_RATIO * usual.seconds);
    check_memory(&usual);
    check_memory(&cost);
}

static void test_many_levels(void)
{
    const struct gen_options ordinary = grid(5), worst = grid(1000);
    const struct cost usual = cost_of(&ordinary), cost = cost_of(&worst);
    CHECK(cost.seconds < MAX_RATIO * usual.seconds);
    check_memory(&cost);
}

int main(void)
{
    RUN(test_large_stars);
    RUN(test_many_levels);
    return test_end();
}
