/* SPDX-License-Identifier: BSD-3-Clause */
#define _GNU_SOURCE // pread
#include "src/stream/level_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "format/fail.h"
#include "format/read/exact_values.h"
#include "src/stream/page_region.h"
#include "src/util/array.h"
#include "src/util/pages.h"
#include "src/util/spool.h"

/* Rows of doubles. A field that the last level makes exact has codes as well, from which it is made. */
struct file_column {
    uint32_t components;
    uint64_t values, codes; /* where they begin in the file; codes: 0 if there are none */
};

struct level_file {
    struct tetlod_file *file;     /* borrowed */
    struct tetlod_cursor *cursor; /* with some of the pages; NULL: all are there */
    uint32_t level, group;        /* group: the last level in pages up to `level` */
    uint32_t next_page;           /* of the group */
    uint64_t memory, tets_there;
    struct file_column *columns;  /* [1 + field_count] positions, then fields */
    uint64_t corners, size;       /* in the file */
    int descriptor;
    unsigned char *at;            /* the file, while it is written */
    atomic_bool *failed;          /* owned: readers may change it */
};

bool level_file_is_for(const struct tetlod_info *info, uint32_t level)
{
    return page_region_is(info, level) || (info->page_count && info->exact_last && level + 1 == info->level_count);
}

static const struct tetlod_level *level_of(const struct level_file *l)
{
    return &tetlod_info(l->file)->levels[l->level];
}

/* ---- some pages at a time */

/* What a cursor with these pages takes, and the numbers that are made of it (struct some). */
static uint64_t decoding_bytes(const struct tetlod_page_set_info *pages)
{
    return pages->memory + pages->vertices * 5 + pages->tets * 8;
}

/* Pages of the group from `first` on, and all that they need. */
static enum tetlod_status make_set(const struct level_file *l, uint32_t first, uint32_t count,
                                   struct tetlod_page_set **out, uint64_t *bytes, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(l->file);
    struct tetlod_page_set_info about;
    TETLOD_TRY(tetlod_page_set_new(out, l->file, info->first_paged_level - 1, NULL, 0, error));
    enum tetlod_status status = TETLOD_OK;
    for (uint32_t p = first; p < first + count && status == TETLOD_OK; p++)
        status = tetlod_page_set_add(*out, l->group, p, error);
    tetlod_page_set_info(*out, &about);
    *bytes = decoding_bytes(&about);
    if (status != TETLOD_OK)
        tetlod_page_set_free(*out);
    return status;
}

/* As many of the next pages as the memory allows, one at least. */
static enum tetlod_status choose_pages(const struct level_file *l, uint32_t *out_count, struct tetlod_error *error)
{
    uint32_t left = tetlod_page_count(l->file, l->group) - l->next_page, count = 1;
    uint64_t bytes = 0;
    while (count < left) {
        struct tetlod_page_set *set;
        TETLOD_TRY(make_set(l, l->next_page, count + 1, &set, &bytes, error));
        tetlod_page_set_free(set);
        if (bytes > l->memory)
            break;
        count++;
    }
    *out_count = count;
    return TETLOD_OK;
}

/* What decoding the largest page takes. */
static enum tetlod_status find_most(const struct level_file *l, uint64_t *out, struct tetlod_error *error)
{
    *out = 0;
    for (uint32_t p = 0; p < tetlod_page_count(l->file, l->group); p++) {
        struct tetlod_page_set *set;
        uint64_t bytes;
        TETLOD_TRY(make_set(l, p, 1, &set, &bytes, error));
        tetlod_page_set_free(set);
        *out = bytes > *out ? bytes : *out;
    }
    return TETLOD_OK;
}

/* ---- the file */

static uint64_t add_area(struct level_file *l, uint64_t size)
{
    enum { PAGE = 1 << 16 }; // of any system
    uint64_t begin = l->size;
    l->size += (size + PAGE - 1) / PAGE * PAGE;
    return begin;
}

static bool lay_out(struct level_file *l)
{
    const struct tetlod_info *info = tetlod_info(l->file);
    const uint64_t vertices = level_of(l)->vertices;
    l->columns = array_zero(1 + (size_t)info->field_count, sizeof *l->columns);
    l->failed = array_zero(1, sizeof *l->failed);
    l->corners = add_area(l, level_of(l)->tets * 16);
    for (uint32_t c = 0; l->columns && c <= info->field_count; c++) {
        struct file_column *column = &l->columns[c];
        column->components = c ? info->fields[c - 1].components : 3;
        column->values = add_area(l, vertices * column->components * 8);
        if (c && l->level > l->group && tetlodi_is_exact_later(l->file, c - 1))
            column->codes = add_area(l, vertices * column->components * 8);
    }
    return l->columns && l->failed;
}

/* With blocks on the disk for all of it: there is nobody to tell when there are none later. */
static enum tetlod_status open_file(struct level_file *l, struct tetlod_error *error)
{
    l->descriptor = spool_file();
    int failed = l->descriptor < 0 ? errno : posix_fallocate(l->descriptor, 0, (off_t)l->size);
    void *at = failed ? MAP_FAILED
                      : mmap(NULL, (size_t)l->size, PROT_READ | PROT_WRITE, MAP_SHARED, l->descriptor, 0);
    failed = !failed && at == MAP_FAILED ? errno : failed;
    if (failed)
        return tetlodi_fail(error, TETLOD_ERR_IO,
                            "there is no room for a temporary file of %llu MB: %s; TMPDIR names its folder",
                            (unsigned long long)(l->size >> 20) + 1, strerror(failed));
    l->at = at;
    return TETLOD_OK;
}

static void close_map(struct level_file *l)
{
    if (l->at)
        munmap(l->at, (size_t)l->size);
    l->at = NULL;
}

void level_file_free(struct level_file *l)
{
    if (!l)
        return;
    tetlod_cursor_free(l->cursor);
    close_map(l);
    if (l->descriptor >= 0)
        close(l->descriptor);
    free(l->failed);
    free(l->columns);
    free(l);
}

enum tetlod_status level_file_new(struct level_file **out, struct tetlod_file *file, uint32_t level, uint64_t memory,
                                  uint64_t *out_memory, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    *out = NULL;
    if (info->levels[level].tets > UINT32_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "level %u has more tetrahedra than fit here", level);
    struct level_file *l = *out = array_zero(1, sizeof *l);
    if (!l)
        return tetlodi_fail_nomem(error, "a level in a file", sizeof *l);
    l->file = file;
    l->level = level;
    l->group = page_region_is(info, level) ? level : level - 1;
    l->descriptor = -1;
    enum tetlod_status status = find_most(l, &l->memory, error);
    *out_memory = l->memory = l->memory > memory ? l->memory : memory;
    if (status == TETLOD_OK && !lay_out(l))
        status = tetlodi_fail_nomem(error, "a level in a file", info->field_count * sizeof *l->columns);
    if (status == TETLOD_OK)
        return TETLOD_OK;
    level_file_free(l);
    *out = NULL;
    return status;
}

/* ---- what a mesh of some pages leaves there */

/* Some pages' mesh, and what its numbers are with all pages. */
struct some {
    struct tetlod_mesh mesh;
    uint32_t *vertices, *tets, *levels;
    bool *used; /* [vertex] by a tetrahedron that is what it is at the level */
};

static bool number_some(struct some *some, const struct tetlod_cursor *cursor)
{
    tetlod_cursor_mesh(cursor, &some->mesh);
    some->vertices = array_new(some->mesh.vertices, sizeof *some->vertices);
    some->tets = array_new(some->mesh.tets, sizeof *some->tets);
    some->levels = array_new(some->mesh.tets, sizeof *some->levels);
    some->used = array_zero(some->mesh.vertices, sizeof *some->used);
    if (!some->vertices || !some->tets || !some->levels || !some->used)
        return false;
    tetlod_cursor_numbers(cursor, some->vertices, some->tets);
    tetlod_cursor_tet_levels(cursor, some->levels);
    return true;
}

static void put_tets(struct level_file *l, const struct some *some)
{
    for (uint32_t t = 0; t < some->mesh.tets; t++) {
        const uint32_t *corners = some->mesh.corners + 4 * (size_t)t;
        uint32_t numbers[4];
        if (some->levels[t] != l->group)
            continue;
        for (int c = 0; c < 4; c++) {
            some->used[corners[c]] = true;
            numbers[c] = some->vertices[corners[c]];
        }
        memcpy(l->at + l->corners + 16 * (uint64_t)some->tets[t], numbers, sizeof numbers);
        l->tets_there++;
    }
}

/* Rows of 8 bytes a component, values or codes. */
static void put_rows(struct level_file *l, const struct some *some, const void *rows, uint32_t components, uint64_t to)
{
    const size_t row = 8 * (size_t)components;
    for (uint32_t v = 0; v < some->mesh.vertices; v++)
        if (some->used[v])
            memcpy(l->at + to + row * some->vertices[v], (const char *)rows + row * v, row);
}

static void put_some(struct level_file *l, const struct some *some)
{
    put_tets(l, some);
    for (uint32_t c = 0; c <= tetlod_info(l->file)->field_count; c++) {
        const struct file_column *column = &l->columns[c];
        const double *values = c ? some->mesh.fields[c - 1] : some->mesh.positions;
        if (column->codes)
            put_rows(l, some, tetlodi_cursor_codes(l->cursor, c - 1), column->components, column->codes);
        else
            put_rows(l, some, values, column->components, column->values);
    }
    pages_drop(l->at, (size_t)l->size); // the file has them
}

static enum tetlod_status decode_some(struct level_file *l, struct tetlod_error *error)
{
    struct tetlod_page_set *set;
    struct some some = {0};
    uint32_t count;
    uint64_t bytes;
    TETLOD_TRY(choose_pages(l, &count, error));
    TETLOD_TRY(make_set(l, l->next_page, count, &set, &bytes, error));
    enum tetlod_status status = tetlod_cursor_select(l->cursor, set, error);
    tetlod_page_set_free(set);
    TETLOD_TRY(status);
    TETLOD_TRY(tetlod_cursor_seek(l->cursor, l->group, error));
    if (number_some(&some, l->cursor))
        put_some(l, &some);
    else
        status = tetlodi_fail_nomem(error, "some pages", some.mesh.tets * (uint64_t)8);
    free(some.vertices);
    free(some.tets);
    free(some.levels);
    free(some.used);
    l->next_page += count;
    return status;
}

static enum tetlod_status make_exact(struct level_file *l, struct tetlod_error *error)
{
    for (uint32_t c = 1; c <= tetlod_info(l->file)->field_count; c++) {
        const struct file_column *column = &l->columns[c];
        if (!column->codes)
            continue;
        TETLOD_TRY(tetlodi_exact_values(l->file, c - 1, (const int64_t *)(const void *)(l->at + column->codes),
                                        (double *)(void *)(l->at + column->values), error));
        pages_drop(l->at, (size_t)l->size);
    }
    return TETLOD_OK;
}

enum tetlod_status level_file_grow(struct level_file *l, struct tetlod_error *error)
{
    if (!l->at)
        TETLOD_TRY(open_file(l, error));
    if (!l->cursor)
        TETLOD_TRY(tetlod_cursor_new(&l->cursor, l->file, NULL, 0, error));
    if (l->next_page < tetlod_page_count(l->file, l->group)) {
        TETLOD_TRY(decode_some(l, error));
        return TETLOD_MORE;
    }
    tetlod_cursor_free(l->cursor);
    l->cursor = NULL;
    if (l->tets_there != level_of(l)->tets)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "level %u has tetrahedra of no page", l->group);
    TETLOD_TRY(make_exact(l, error));
    close_map(l);
    return TETLOD_OK;
}

/* ---- reading */

static void read_rows(const struct level_file *l, uint64_t begin, size_t size, void *out)
{
    char *bytes = out;
    while (size) {
        ssize_t got = pread(l->descriptor, bytes, size, (off_t)begin);
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0) {
            memset(bytes, 0, size);
            atomic_store(l->failed, true);
            return;
        }
        bytes += got;
        begin += (uint64_t)got;
        size -= (size_t)got;
    }
}

void level_file_values(const void *opaque, uint32_t column, uint64_t first, size_t count, double *out)
{
    const struct level_file *l = opaque;
    const size_t row = 8 * (size_t)l->columns[column].components;
    read_rows(l, l->columns[column].values + first * row, count * row, out);
}

void level_file_corners(const void *opaque, uint64_t first, size_t count, uint32_t *out)
{
    const struct level_file *l = opaque;
    read_rows(l, l->corners + 16 * first, 16 * count, out);
}

bool level_file_failed(const struct level_file *l)
{
    return atomic_load(l->failed);
}
