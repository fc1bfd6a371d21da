/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/store/dataset.h"

#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "format/fail.h"
#include "format/reader.h"
#include "src/util/array.h"

enum { ERRORS_CAPACITY = 96 };

struct dataset {
    atomic_uint references;
    char id[ID_CAPACITY];
    int fd;
    struct tetlod_file *file;
    struct file_identity identity;
    char (*level_errors)[ERRORS_CAPACITY]; /* [level_count], printed once: every answer has one */
};

static bool take_identity(const struct stat *about, struct file_identity *out)
{
    *out = (struct file_identity){(uint64_t)about->st_dev, (uint64_t)about->st_ino, (uint64_t)about->st_size, (uint64_t)about->st_nlink, about->st_mtim, about->st_ctim};
    return S_ISREG(about->st_mode);
}

bool identity_of(int fd, struct file_identity *out)
{
    struct stat about;
    return fstat(fd, &about) == 0 && take_identity(&about, out);
}

bool identity_at(int folder, const char *path, struct file_identity *out)
{
    struct stat about;
    return fstatat(folder, path, &about, 0) == 0 && take_identity(&about, out);
}

static bool same_time(const struct timespec *a, const struct timespec *b)
{
    return a->tv_sec == b->tv_sec && a->tv_nsec == b->tv_nsec;
}

bool identity_same(const struct file_identity *a, const struct file_identity *b)
{
    return a->device == b->device && a->inode == b->inode && a->size == b->size &&
           same_time(&a->written, &b->written) &&
           (same_time(&a->changed, &b->changed) || a->links != b->links); // another name changes the time, too
}

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

enum tetlod_status dataset_open(struct dataset **out, const char *id, int fd, struct tetlod_error *error)
{
    enum tetlod_status status;
    struct dataset *dataset = array_zero(1, sizeof *dataset);
    *out = NULL;
    if (!dataset) {
        close(fd);
        return tetlodi_fail_nomem(error, "a stream", sizeof *dataset);
    }
    atomic_init(&dataset->references, 1);
    dataset->fd = fd;
    snprintf(dataset->id, sizeof dataset->id, "%s", id);
    if (!identity_of(fd, &dataset->identity))
        status = tetlodi_fail(error, TETLOD_ERR_IO, "is not a regular file");
    else
        status = tetlod_open_fd(&dataset->file, fd, NULL, error);
    if (status == TETLOD_OK && tetlod_info(dataset->file)->bytes > dataset->identity.size)
        status = tetlodi_fail(error, TETLOD_ERR_TRUNCATED, "the stream ends too early: %llu of %llu bytes",
                              (unsigned long long)dataset->identity.size,
                              (unsigned long long)tetlod_info(dataset->file)->bytes);
    if (status == TETLOD_OK)
        status = print_all_errors(dataset, error);
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
    tetlod_close(dataset->file);
    close(dataset->fd);
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

int dataset_fd(const struct dataset *dataset)
{
    return dataset->fd;
}

struct tetlod_file *dataset_file(struct dataset *dataset)
{
    return dataset->file;
}

const struct file_identity *dataset_identity(const struct dataset *dataset)
{
    return &dataset->identity;
}

enum tetlod_status dataset_check(struct dataset *dataset, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(dataset->file);
    for (uint32_t k = 0; k < info->level_count; k++)
        for (uint32_t part = 0; part <= info->field_count; part++) {
            uint8_t *bytes;
            size_t size;
            TETLOD_TRY(tetlodi_read_frame(dataset->file, k, part, &bytes, &size, error));
            free(bytes);
        }
    return TETLOD_OK;
}

bool dataset_intact(const struct dataset *dataset)
{
    struct file_identity now;
    return identity_of(dataset->fd, &now) && identity_same(&now, &dataset->identity);
}
