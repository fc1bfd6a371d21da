/* SPDX-License-Identifier: BSD-3-Clause */
/* Sockets that listen: TCP, Unix, or handed over by whoever started the process. */
#ifndef TETLOD_SERVER_LISTENER_H
#define TETLOD_SERVER_LISTENER_H

#include "format/tetlod.h"
#include "server/net/gate.h"

struct listener {
    int fd;
    enum reach reach;
    char url[160];       /* http://127.0.0.1:8080/, unix:/run/tetlod.sock */
    char unlink_at[108]; /* path of a Unix socket that is ours to remove, or empty */
};

/* `socket_mode` is that of a Unix socket's file; 0: what the umask leaves. */
TETLOD_CHECKED enum tetlod_status listener_open(struct listener *out, const char *address, unsigned socket_mode,
                                                struct tetlod_error *error);
void listener_close(struct listener *listener);

#endif
