/* SPDX-License-Identifier: BSD-3-Clause */
/* A request and its answer, as the handlers see them: no sockets, no library. */
#ifndef TETLOD_SERVER_MESSAGE_H
#define TETLOD_SERVER_MESSAGE_H

#include "server/http/guesses.h"
#include "server/store/cache.h"

enum method { METHOD_GET, METHOD_HEAD, METHOD_OPTIONS, METHOD_OTHER };

enum { REQUEST_PINS = 4 };

struct request {
    enum method method;
    const char *target; /* path and query as sent, not decoded */
    const char *(*header)(void *opaque, const char *name); /* NULL if it is not there */
    void *opaque;
    bool loopback; /* it came to an address that only this machine reaches */
    bool local;    /* the same, or a Unix socket */
    const char *client; /* whose work it is: an address, or a network of IPv6; NULL: the process itself */
    unsigned refused;        /* status for a request whose body or framing is refused, or 0 */
    const char *why_refused;
    /* What to wake when something that the answer needs is there; NULL: the caller's thread makes it instead. */
    struct waiter *waiter;
    bool waited; /* it has been woken at least once */
    struct cache_entry *awaited; /* pinned: what the waiter waits for, or waited for */
    struct cache *awaited_in;
    bool guessed; /* it brought a wrong token, and waits for its answer or has waited */
    struct guess guess;
    /* Entries that this request has asked for: kept until its answer is sent, so that each is found again and a body
     * that lies in one stays. */
    struct {
        struct cache *cache;
        struct cache_entry *entry;
    } pins[REQUEST_PINS];
};

/* BODY_PIECES: made while it is sent. BODY_ABSENT: it is not there, for the answer has none: a 304, or one to HEAD. */
enum body_kind { BODY_NONE, BODY_BYTES, BODY_PIECES, BODY_ABSENT };

#define SIZE_UNKNOWN UINT64_MAX

/* HEADER_TEXT: of all values together. A Location has up to 4,000 bytes (the names of many cell fields), the others
 * never fill the rest. */
enum { RESPONSE_HEADERS = 24, HEADER_TEXT = 8192, ETAG_CAPACITY = 1000 };

struct response {
    unsigned status;
    const char *route; /* template of the route, static: for metrics and logs */
    const char *media_type; /* static */
    enum body_kind kind;
    const void *bytes; /* BODY_BYTES: from byte `held` of the whole body on */
    uint64_t held;
    /* BODY_PIECES: writes up to `size` bytes of the whole body from `begin` on, by one thread at a time, and returns
     * how many. 0: there are none yet, and the request's waiter will be woken. -1: they are not to be had, and the
     * connection ends before its time, by which the client knows. */
    ptrdiff_t (*read)(void *owner, uint64_t begin, size_t size, unsigned char *out);
    uint64_t offset; /* in the whole body, where what is sent begins */
    uint64_t size;     /* of the body that is sent; SIZE_UNKNOWN at most where it is absent */
    void (*release)(void *owner); /* lets go of what the body borrows from; NULL: it is there for good or pinned */
    void *owner;
    bool ranges;        /* Range may cut it */
    bool close;         /* the connection ends after it */
    char etag[ETAG_CAPACITY]; /* quoted, or empty */
    size_t header_count, header_bytes; /* of header_text, which is in use up to there */
    bool headers_lost;                 /* one did not fit: the answer is not sent */
    struct {
        const char *name; /* static */
        size_t value;     /* where it begins in header_text */
    } headers[RESPONSE_HEADERS];
    char header_text[HEADER_TEXT];
};

/* An empty response. (Headers are not cleared: they are many bytes and count only up to header_count.) */
void response_init(struct response *response);

/* Adds a header. Where it does not fit, site_answer refuses the request instead. */
void response_header_text(struct response *response, const char *name, const char *value);
void response_header(struct response *response, const char *name, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Adds a name to the one Vary header. */
void response_vary(struct response *response, const char *name);

const char *response_header_value(const struct response *response, size_t i);
const char *response_find_header(const struct response *response, const char *name);

void response_release(struct response *response);

/* A body that never changes nor goes. */
void response_static(struct response *response, unsigned status, const char *media_type, const char *text);

/* A body made while it is sent; takes over `owner`. */
void response_pieces(struct response *response, const char *media_type, uint64_t size,
                     ptrdiff_t (*read)(void *owner, uint64_t begin, size_t size,
                                       unsigned char *out), void (*release)(void *owner), void *owner);

/* Takes over malloc'ed bytes. */
void response_owned(struct response *response, unsigned status, const char *media_type, void *bytes, size_t size);

/* WAITING: the request's waiter will be woken; then the same request is to be given again. */
enum outcome { ANSWERED, WAITING };

/* What is known of a request when its answer was sent, or its client has left. */
struct finished {
    const char *method, *id, *remote; /* remote: the client's address */
    const char *route;                /* the response's */
    char *target;                     /* as sent; may be changed now */
    unsigned status;
    uint64_t bytes;
    double seconds;
    bool complete;
};

struct json_t;

/* Replaces what is there by a problem+json answer (RFC 9457). `target` is the request's. */
void response_problem(struct response *response, unsigned status, const char *target, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* The same with an array of texts under `name` that says what would do; takes over the reference to `choices`. */
void response_problem_choices(struct response *response, unsigned status, const char *target, const char *name,
                              struct json_t *choices, const char *format, ...) __attribute__((format(printf, 6, 7)));

const char *status_title(unsigned status);

/* A request header, or NULL. */
const char *request_header(const struct request *request, const char *name);

/* Lets go of all pins. */
void request_unpin(struct request *request);

#endif
