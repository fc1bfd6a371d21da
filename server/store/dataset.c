/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/store/dataset.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "format/fail.h"
#include "format/reader.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

enum { ERRORS_CAPACITY = 96 };

struct dataset {
    atomic_uint references;
    char id[ID_CAPACITY];
    struct open_file *opened;
    struct tetlod_file *file;
    struct file_identity identity;
    struct tetlod_series *series; /* NULL: one moment */
    char (*level_errors)[ERRORS_CAPACITY]; /* [level_count], printed once: every answer has one */
};

static void print_errors(const struct tetlod_info *info, uint32_t level, char *out, size_t capacity)
{
    size_t used = 0;
    out[0] = 0;
    for (int m = 0; m < TETLOD_MEASURES; m++) {
        double worst = -1;
        for (uint32_t f = 0; f < info->field_count; f++) {
            double error = info->levels[level].errors[f * TETLOD_MEASURES + (uint32_t)m];
            if (info->fields[f].controlled && (isnan(worst) || isnan(error) || error > worst))
                worst = isnan(worst) ? worst : error;
        }
        if (worst >= 0 && used < capacity)
            used += (size_t)snprintf(out + used, capacity - used, "%s%s=%.9g", used ? ", " : "",
                                     tetlod_measure_name((enum tetlod_measure)m), worst);
    }
}

static enum tetlod_status print_all_errors(struct dataset *dataset, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(dataset->file);
    dataset->level_errors = array_new(info->level_count, sizeof *dataset->level_errors);
    if (!dataset->level_errors)
        return tetlodi_fail_nomem(error, "a stream's levels", info->level_count * (uint64_t)ERRORS_CAPACITY);
    for (uint32_t k = 0; k < info->level_count; k++)
        print_errors(info, k, dataset->level_errors[k], ERRORS_CAPACITY);
    return TETLOD_OK;
}

/* Reads bytes that the file has; false with errno. */
static bool read_bytes(int fd, uint64_t offset, unsigned char *out, size_t size)
{
    while (size) {
        ssize_t got = pread(fd, out, size, (off_t)offset);
        if (got <= 0) {
            errno = got ? errno : ESTALE; // it shrank
            return false;
        }
        out += got;
        offset += (uint64_t)got;
        size -= (size_t)got;
    }
    return true;
}

/* The library's source. It holds what it reads against digests. */
static enum tetlod_status read_source(void *opaque, uint64_t offset, void *buffer, size_t size)
{
    struct dataset *dataset = opaque;
    int fd = open_file_use(dataset->opened);
    if (fd < 0)
        return errno == ESTALE ? TETLOD_ERR_MISMATCH : TETLOD_ERR_IO;
    bool complete = read_bytes(fd, offset, buffer, size);
    open_file_let_go(dataset->opened);
    return complete ? TETLOD_OK : TETLOD_ERR_IO;
}

static bool still_the_same(const struct dataset *dataset, int fd)
{
    struct file_identity now;
    return identity_of(fd, &now) && identity_same(&now, &dataset->identity);
}

/* Whoever writes into a file changes its time first: bytes that were read before a look at the time are those of before. */
bool dataset_read(struct dataset *dataset, uint64_t offset, void *out, size_t size)
{
    int fd = open_file_use(dataset->opened);
    if (fd < 0)
        return false;
    bool good = read_bytes(fd, offset, out, size) && still_the_same(dataset, fd);
    open_file_let_go(dataset->opened);
    return good;
}

static enum tetlod_status open_stream(struct dataset *dataset, struct tetlod_error *error)
{
    const struct tetlod_source source = {read_source, dataset, dataset->identity.size};
    const struct tetlod_options options = {.struct_size = sizeof options, .threads = parallel_cores()};
    TETLOD_TRY(tetlod_open(&dataset->file, &source, &options, error));
    if (tetlod_info(dataset->file)->bytes > dataset->identity.size)
        return tetlodi_fail(error, TETLOD_ERR_TRUNCATED, "the stream ends too early: %llu of %llu bytes",
                            (unsigned long long)dataset->identity.size,
                            (unsigned long long)tetlod_info(dataset->file)->bytes);
    if (tetlod_section_index(tetlod_info(dataset->file), "TIME") != TETLOD_NONE)
        TETLOD_TRY(tetlod_series_new(&dataset->series, dataset->file, error));
    return print_all_errors(dataset, error);
}

enum tetlod_status dataset_open(struct dataset **out, const char *id, struct open_files *files, const char *path, int fd,
                                struct tetlod_error *error)
{
    struct dataset *dataset = array_zero(1, sizeof *dataset);
    *out = NULL;
    if (!dataset || !identity_of(fd, &dataset->identity)) {
        close(fd);
        bool memory = !dataset;
        free(dataset);
        return memory ? tetlodi_fail_nomem(error, "a stream", sizeof *dataset) : tetlodi_fail(error, TETLOD_ERR_IO, "is not a regular file");
    }
    atomic_init(&dataset->references, 1);
    snprintf(dataset->id, sizeof dataset->id, "%s", id);
    dataset->opened = open_file_new(files, path, fd, &dataset->identity);
    enum tetlod_status status = dataset->opened ? open_stream(dataset, error) : tetlodi_fail_nomem(error, "a stream", sizeof *dataset);
    if (status == TETLOD_OK)
        *out = dataset;
    else
        dataset_release(dataset);
    return status;
}

struct dataset *dataset_hold(struct dataset *dataset)
{
    atomic_fetch_add(&dataset->references, 1);
    return dataset;
}

void dataset_release(struct dataset *dataset)
{
    if (!dataset || atomic_fetch_sub(&dataset->references, 1) != 1)
        return;
    tetlod_series_free(dataset->series);
    tetlod_close(dataset->file);
    open_file_free(dataset->opened);
    free(dataset->level_errors);
    free(dataset);
}

const char *dataset_id(const struct dataset *dataset)
{
    return dataset->id;
}

const struct tetlod_info *dataset_info(const struct dataset *dataset)
{
    return tetlod_info(dataset->file);
}

const char *dataset_level_errors(const struct dataset *dataset, uint32_t level)
{
    return dataset->level_errors[level];
}

struct tetlod_file *dataset_file(struct dataset *dataset)
{
    return dataset->file;
}

const struct tetlod_series *dataset_series(const struct dataset *dataset)
{
    return dataset->series;
}

const struct file_identity *dataset_identity(const struct dataset *dataset)
{
    return &dataset->identity;
}

enum tetlod_status dataset_check(struct dataset *dataset, struct tetlod_error *error)
{
    return tetlodi_check_parts(dataset->file, error);
}

bool dataset_intact(struct dataset *dataset)
{
    int fd = open_file_use(dataset->opened);
    if (fd < 0)
        return false;
    bool same = still_the_same(dataset, fd);
    open_file_let_go(dataset->opened);
    return same;
}
