/* SPDX-License-Identifier: BSD-3-Clause */
/* Numbers as bytes, by the function that also passes them on (channel.h): into a buffer, or out of one. */
#ifndef TETLOD_PARCEL_H
#define TETLOD_PARCEL_H

#include "src/util/channel.h"

struct parcel {
    struct work_share share; /* of which only pass() is there */
    struct channel channel;
    struct buffer *bytes; /* borrowed */
    size_t at;
    bool bad; /* no memory, or fewer bytes than there should be */
};

/* It stays where it is until its end. `packs`: what the channel is given is appended to the bytes; else it comes of
 * them. */
void parcel_begin(struct parcel *parcel, struct buffer *bytes, bool packs);

/* `what` lacks memory, perhaps. ERR_NOMEM; ERR_IO: the bytes are of something else. */
TETLOD_CHECKED enum tetlod_status parcel_end(const struct parcel *parcel, const char *what,
                                             struct tetlod_error *error);

#endif
