/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/util/parcel.h"

#include <string.h>

#include "format/fail.h"

static void put_bytes(void *opaque, void *bytes, size_t size)
{
    struct parcel *parcel = opaque;
    parcel->bad |= buffer_append(parcel->bytes, bytes, size) != TETLOD_OK;
}

static void get_bytes(void *opaque, void *bytes, size_t size)
{
    struct parcel *parcel = opaque;
    bool there = size <= parcel->bytes->size - parcel->at;
    if (bytes && size)
        there ? (void)memcpy(bytes, parcel->bytes->bytes + parcel->at, size) : (void)memset(bytes, 0, size);
    parcel->at += there ? size : 0;
    parcel->bad |= !there;
}

void parcel_begin(struct parcel *parcel, struct buffer *bytes, bool packs)
{
    *parcel = (struct parcel){.share = {.leads = packs, .pass = packs ? put_bytes : get_bytes, .opaque = parcel},
                              .channel = {&parcel->share, TETLOD_OK},
                              .bytes = bytes};
}

enum tetlod_status parcel_end(const struct parcel *parcel, const char *what, struct tetlod_error *error)
{
    const bool packs = parcel->share.leads;
    if (parcel->channel.status != TETLOD_OK || (packs && parcel->bad))
        return tetlodi_fail_nomem(error, what, parcel->bytes->size);
    return parcel->bad || (!packs && parcel->at < parcel->bytes->size)
               ? tetlodi_fail(error, TETLOD_ERR_IO, "%s: what another program has come to is not as it wrote it", what)
               : TETLOD_OK;
}
