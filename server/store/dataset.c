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
    struct stored *stored;
    struct tetlod_file *file;
    uint64_t offset; /* of its stream in the file */
    uint32_t topology, steps_before;
    struct tetlod_series *series; /* NULL: one moment */
    char (*level_errors)[ERRORS_CAPACITY]; /* [level_count], printed once: every answer has one */
};

/* A stream's file, which its topology groups share. */
struct stored {
    atomic_uint references;
    char id[ID_CAPACITY];
    struct open_file *opened;
    struct file_identity identity;
    struct dataset *datasets; /* [count]: the whole stream, then its further topology groups */
    uint32_t count;
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
    struct stored *stored = opaque;
    int fd = open_file_use(stored->opened);
    if (fd < 0)
        return errno == ESTALE ? TETLOD_ERR_MISMATCH : TETLOD_ERR_IO;
    bool complete = read_bytes(fd, offset, buffer, size);
    open_file_let_go(stored->opened);
    return complete ? TETLOD_OK : TETLOD_ERR_IO;
}

static bool still_the_same(const struct stored *stored, int fd)
{
    struct file_identity now;
    return identity_of(fd, &now) && identity_same(&now, &stored->identity);
}

/* Whoever writes into a file changes its time first: bytes that were read before a look at the time are those of before. */
bool dataset_read(struct dataset *dataset, uint64_t offset, void *out, size_t size)
{
    struct stored *stored = dataset->stored;
    int fd = open_file_use(stored->opened);
    if (fd < 0)
        return false;
    bool good = read_bytes(fd, dataset->offset + offset, out, size) && still_the_same(stored, fd);
    open_file_let_go(stored->opened);
    return good;
}

/* Opens the whole stream, and makes a dataset for it and one for each further topology group. */
static enum tetlod_status open_whole(struct stored *stored, struct tetlod_error *error)
{
    const struct tetlod_source source = {read_source, stored, stored->identity.size};
    const struct tetlod_options options = {.struct_size = sizeof options, .threads = parallel_cores()};
    struct tetlod_file *file;
    TETLOD_TRY(tetlod_open(&file, &source, &options, error));
    const struct tetlod_info *info = tetlod_info(file);
    uint32_t count = info->topology_count ? info->topology_count : 1;
    stored->datasets = array_zero(count, sizeof *stored->datasets);
    if (!stored->datasets) {
        tetlod_close(file);
        return tetlodi_fail_nomem(error, "a stream", count * (uint64_t)sizeof *stored->datasets);
    }
    stored->count = count;
    stored->datasets[0].file = file;
    if (info->bytes <= stored->identity.size)
        return TETLOD_OK;
    return tetlodi_fail(error, TETLOD_ERR_TRUNCATED, "the stream ends too early: %llu of %llu bytes", (unsigned long long)stored->identity.size,
                        (unsigned long long)info->bytes);
}

static enum tetlod_status open_topology(struct stored *stored, uint32_t topology, struct tetlod_error *error)
{
    struct dataset *dataset = &stored->datasets[topology];
    dataset->stored = stored;
    dataset->topology = topology;
    if (topology) {
        const struct tetlod_topology *topologies = tetlod_info(stored->datasets[0].file)->topologies;
        dataset->offset = topologies[topology].offset;
        dataset->steps_before = dataset[-1].steps_before + topologies[topology - 1].step_count;
        TETLOD_TRY(tetlod_open_topology(&dataset->file, stored->datasets[0].file, topology, error));
    }
    if (tetlod_section_index(tetlod_info(dataset->file), "TIME") != TETLOD_NONE)
        TETLOD_TRY(tetlod_series_new(&dataset->series, dataset->file, error));
    return print_all_errors(dataset, error);
}

static void close_stored(struct stored *stored)
{
    for (uint32_t t = stored->count; t-- > 0;) {
        tetlod_series_free(stored->datasets[t].series);
        tetlod_close(stored->datasets[t].file);
        free(stored->datasets[t].level_errors);
    }
    open_file_free(stored->opened);
    free(stored->datasets);
    free(stored);
}

enum tetlod_status dataset_open(struct dataset **out, const char *id, struct open_files *files, const char *path, int fd,
                                struct tetlod_error *error)
{
    struct stored *stored = array_zero(1, sizeof *stored);
    *out = NULL;
    if (!stored || !identity_of(fd, &stored->identity)) {
        close(fd);
        bool memory = !stored;
        free(stored);
        return memory ? tetlodi_fail_nomem(error, "a stream", sizeof *stored) : tetlodi_fail(error, TETLOD_ERR_IO, "is not a regular file");
    }
    atomic_init(&stored->references, 1);
    snprintf(stored->id, sizeof stored->id, "%s", id);
    stored->opened = open_file_new(files, path, fd, &stored->identity);
    enum tetlod_status status = stored->opened ? open_whole(stored, error) : tetlodi_fail_nomem(error, "a stream", sizeof *stored);
    for (uint32_t t = 0; status == TETLOD_OK && t < stored->count; t++)
        status = open_topology(stored, t, error);
    if (status == TETLOD_OK)
        *out = stored->datasets;
    else
        close_stored(stored);
    return status;
}

struct dataset *dataset_hold(struct dataset *dataset)
{
    atomic_fetch_add(&dataset->stored->references, 1);
    return dataset;
}

void dataset_release(struct dataset *dataset)
{
    if (dataset && atomic_fetch_sub(&dataset->stored->references, 1) == 1)
        close_stored(dataset->stored);
}

struct dataset *dataset_topology(struct dataset *whole, uint32_t topology)
{
    return &whole->stored->datasets[topology];
}

struct dataset *dataset_with_content(struct dataset *whole, const char *cid, size_t size)
{
    for (uint32_t t = 0; t < whole->stored->count; t++) {
        const char *own = tetlod_info(whole->stored->datasets[t].file)->cid;
        if (strlen(own) == size && memcmp(own, cid, size) == 0)
            return &whole->stored->datasets[t];
    }
    return NULL;
}

uint32_t dataset_topology_number(const struct dataset *dataset)
{
    return dataset->topology;
}

uint32_t dataset_steps_before(const struct dataset *dataset)
{
    return dataset->steps_before;
}

const char *dataset_id(const struct dataset *dataset)
{
    return dataset->stored->id;
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

enum tetlod_status dataset_check(struct dataset *dataset, struct tetlod_error *error)
{
    return tetlodi_check_parts(dataset->file, error);
}

bool dataset_intact(struct dataset *dataset)
{
    struct stored *stored = dataset->stored;
    int fd = open_file_use(stored->opened);
    if (fd < 0)
        return false;
    bool same = still_the_same(stored, fd);
    open_file_let_go(stored->opened);
    return same;
}
