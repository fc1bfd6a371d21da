/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The head of a request: its first line and its headers (RFC 9112). It is read strictly: whatever a proxy in front
 * could read otherwise is refused. No request here has a body; two lengths, or a length beside a transfer coding, are
 * how requests are smuggled.
 */
#ifndef TETLOD_SERVER_REQUEST_HEAD_H
#define TETLOD_SERVER_REQUEST_HEAD_H

#include <stdbool.h>
#include <stddef.h>

/* All texts lie in the bytes that were read. */
struct request_head {
    const char *method, *target; /* "" if the first line is none */
    const char *headers, *end;   /* each a name and a value, both with a NUL */
    unsigned refused;            /* a status, or 0 */
    const char *why_refused;
    bool old;  /* HTTP/1.0 */
    bool keep; /* the client expects the connection to last */
};

/* The size of the head at the front, with its empty line; 0: it is not all there. `seen`: bytes that were looked at
 * before. */
size_t head_size(const char *bytes, size_t size, size_t seen);

/* Reads a head of `size` bytes, which it changes. Not `whole`: it is longer than a head may be, and is refused. */
void head_read(char *bytes, size_t size, bool whole, struct request_head *out);

/* The next header from `at` (at first: head->headers); false: there is none. */
bool head_next(const struct request_head *head, const char **at, const char **name, const char **value);

/* The value of the first header of that name, or NULL. */
const char *head_find(const struct request_head *head, const char *name);

#endif
