/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cells/cell_store.h"

#include <pthread.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/spool.h"

struct place {
    uint64_t at;
    size_t size;
};

struct cell_spool {
    pthread_mutex_t lock;
    struct spool spool;
    struct place *places; /* [cell] */
};

static enum tetlod_status put(void *opaque, uint32_t cell, const void *bytes, size_t size, struct tetlod_error *error)
{
    struct cell_spool *spool = opaque;
    pthread_mutex_lock(&spool->lock);
    spool->places[cell] = (struct place){spool->spool.size, size};
    enum tetlod_status status = spool_write(&spool->spool, bytes, size, error);
    pthread_mutex_unlock(&spool->lock);
    return status;
}

static enum tetlod_status get(void *opaque, uint32_t cell, size_t enough, unsigned char **out, size_t *size,
                              struct tetlod_error *error)
{
    struct cell_spool *spool = opaque;
    const struct place *place = &spool->places[cell];
    struct tetlod_source source;
    *size = place->size < enough ? place->size : enough;
    *out = array_new(*size, 1);
    if (!*out)
        return tetlodi_fail_nomem(error, "a cell", *size);
    pthread_mutex_lock(&spool->lock);
    enum tetlod_status status = spool_source(&spool->spool, &source, error);
    pthread_mutex_unlock(&spool->lock);
    if (status == TETLOD_OK && source.read(source.opaque, place->at, *out, *size) != TETLOD_OK)
        status = tetlodi_fail(error, TETLOD_ERR_IO, "a temporary file in %.100s cannot be read", spool_folder());
    if (status != TETLOD_OK) {
        free(*out);
        *out = NULL;
    }
    return status;
}

enum tetlod_status cell_spool_new(struct cell_store *out, uint32_t cells, struct tetlod_error *error)
{
    struct cell_spool *spool = array_zero(1, sizeof *spool);
    struct place *places = array_zero(cells, sizeof *places);
    *out = (struct cell_store){0};
    enum tetlod_status status =
        spool && places ? spool_open(&spool->spool, error) : tetlodi_fail_nomem(error, "the cells", cells);
    if (status != TETLOD_OK) {
        free(places);
        free(spool);
        return status;
    }
    spool->places = places;
    pthread_mutex_init(&spool->lock, NULL);
    *out = (struct cell_store){put, get, spool};
    return TETLOD_OK;
}

void cell_spool_free(struct cell_store *store)
{
    struct cell_spool *spool = store->opaque;
    if (spool) {
        pthread_mutex_destroy(&spool->lock);
        spool_close(&spool->spool);
        free(spool->places);
        free(spool);
    }
    *store = (struct cell_store){0};
}
