/* SPDX-License-Identifier: BSD-3-Clause */
#define _GNU_SOURCE
#include "server/net/connection.h"

#include <arpa/inet.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

#include "server/net/request_head.h"
#include "src/util/clock.h"

enum {
    ANSWER_BYTES = HEADER_TEXT + 4096, // of an answer's first line and headers
    MAX_DRAINED = 1 << 20, // bytes behind a refused request that are read so that the client sees the refusal
    PIECE = 65536, // bytes of a body that are made at a time
    TURN = 16, // steps before other connections have their turn
};

/* Where a request is between its thread and whoever wakes it. */
enum state { RUNNING, SUSPENDED, WOKEN };

/* A request from its first line to the end of its answer. */
struct call {
    struct request request;
    struct request_head head;
    struct waiter waiter;
    struct waiting waiting;
    bool registered, gone; /* the peer knows `waiting`; its client has left */
    atomic_int state;
    double started;
    unsigned status;
    uint64_t bytes;
    const char *route;
    char id[40];
    /* the client, maybe behind a proxy, and what is counted of it */
    char remote[INET6_ADDRSTRLEN], network[INET6_ADDRSTRLEN];
};

/* An answer on its way. */
struct sending {
    char *head; /* what is left of it is sent with the chunk */
    size_t head_size, head_sent;
    const unsigned char *chunk;
    size_t chunk_left;
    uint64_t position, left; /* in the whole body, of what is sent: behind the chunk */
    unsigned char *piece;    /* [PIECE], of a body that is made while it is sent */
    ptrdiff_t (*read)(void *owner, uint64_t begin, size_t size, unsigned char *out); /* as in the response */
    void (*release)(void *owner);
    void *owner;
};

enum phase { READING, ANSWERING, SENDING, PARTING };

struct connection {
    struct connection_link link;
    struct connections *all;
    struct peer *peer;
    int fd;
    enum phase phase;
    bool keep, refused; /* another request may follow; bytes that nobody wants may follow */
    struct call call;
    struct sending out;
    size_t drained;
    size_t filled, seen; /* of `in`; looked at for a request's end */
    size_t request_size; /* of the request at the front */
    char in[];           /* [header_bytes] */
};

/* ---- waiting ---- */

static void wake(struct waiter *waiter)
{
    struct call *call = (struct call *)(void *)((char *)waiter - offsetof(struct call, waiter));
    struct connection *connection = (struct connection *)(void *)((char *)call - offsetof(struct connection, call));
    if (atomic_exchange(&call->state, WOKEN) == SUSPENDED)
        connection->all->woken(connection);
}

/* The client has left: what it waits for is given up. */
static struct waiter *leave(struct waiting *waiting)
{
    struct call *call = (struct call *)(void *)((char *)waiting - offsetof(struct call, waiting));
    struct request *request = &call->request;
    if (!request->awaited || !cache_unwait(request->awaited_in, request->awaited, &call->waiter))
        return NULL;
    call->gone = true;
    return &call->waiter;
}

/* Lets go of the thread until the request's waiter is woken, which may have happened already. */
static enum step suspend(struct connection *connection)
{
    struct call *call = &connection->call;
    int before = RUNNING;
    call->registered = true;
    connection->link.asleep = true;
    peer_wait(connection->peer, &call->waiting);
    if (atomic_compare_exchange_strong(&call->state, &before, SUSPENDED))
        return STEP_ASLEEP;
    connection->link.asleep = false;
    return STEP_ON;
}

/* Goes on after a wait; false: there is nobody to answer. */
static bool go_on(struct connection *connection)
{
    struct call *call = &connection->call;
    if (call->registered) {
        peer_moved(connection->peer, monotonic_seconds());
        peer_wait(connection->peer, NULL);
    }
    call->registered = false;
    atomic_store(&call->state, RUNNING);
    return !call->gone;
}

/* ---- requests ---- */

static const char *find_header(void *opaque, const char *name)
{
    const struct call *call = opaque;
    return head_find(&call->head, name);
}

static bool good_id(const char *id)
{
    size_t size = strspn(id, "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_.");
    return size && size < sizeof((struct call *)0)->id && !id[size];
}

/* The lines of a header joined by commas, as RFC 9110 reads them; of what is too long the end. */
struct joined {
    size_t size;
    char text[1024];
};

static void join_lines(const struct request_head *head, const char *wanted, struct joined *out)
{
    const char *at = head->headers, *name, *value;
    while (head_next(head, &at, &name, &value)) {
        if (strcasecmp(name, wanted) != 0)
            continue;
        size_t size = strlen(value), room = sizeof out->text - 2;
        size_t kept = size < room ? size : room, before = out->size < room - kept ? out->size : room - kept;
        memmove(out->text, out->text + out->size - before, before);
        out->text[before] = ',';
        memcpy(out->text + before + 1, value + size - kept, kept);
        out->size = before + 1 + kept;
        out->text[out->size] = 0;
    }
}

/* The client: the connection's address or, behind a trusted proxy, the address that the proxy forwards. */
static void take_client(struct connection *connection)
{
    struct call *call = &connection->call;
    snprintf(call->remote, sizeof call->remote, "%s", peer_address(connection->peer));
    snprintf(call->network, sizeof call->network, "%s", peer_network(connection->peer));
    call->request.client = call->network;
    if (!peer_is_proxy(connection->peer))
        return;
    struct joined forwarded = {0};
    join_lines(&call->head, "X-Forwarded-For", &forwarded);
    if (proxies_client(connection->all->options.proxies, forwarded.text, call->remote))
        network_of(call->remote, call->network);
}

static void take_id(struct connection *connection)
{
    struct call *call = &connection->call;
    const char *id = head_find(&call->head, "X-Request-Id");
    if (id && good_id(id))
        snprintf(call->id, sizeof call->id, "%s", id);
    else
        snprintf(call->id, sizeof call->id, "%08x-%llx", (unsigned)connection->all->id_base,
                 (unsigned long long)atomic_fetch_add(&connection->all->next_id, 1));
}

static enum method method_of(const char *name)
{
    return strcmp(name, "GET") == 0       ? METHOD_GET
           : strcmp(name, "HEAD") == 0    ? METHOD_HEAD
           : strcmp(name, "OPTIONS") == 0 ? METHOD_OPTIONS
                                          : METHOD_OTHER;
}

/* Begins with the request of so many bytes at the front; not `whole`: it is too long. */
static void begin_call(struct connection *connection, size_t size, bool whole)
{
    struct call *call = &connection->call;
    *call = (struct call){.waiter.wake = wake, .waiting.leave = leave, .started = monotonic_seconds()};
    head_read(connection->in, size, whole, &call->head);
    enum reach reach = peer_reach(connection->peer);
    call->request = (struct request){.method = method_of(call->head.method), .target = call->head.target,
                                     .header = find_header, .opaque = call, .refused = call->head.refused,
                                     .why_refused = call->head.why_refused, .loopback = reach == REACH_LOOPBACK,
                                     .local = reach != REACH_NETWORK, .waiter = &call->waiter};
    take_client(connection);
    take_id(connection);
    connection->request_size = size;
    connection->refused = call->request.refused || call->request.method == METHOD_OTHER;
    connection->phase = ANSWERING;
}

/* Empty lines before a request are passed over (RFC 9112, 2.2). */
static void pass_empty_lines(struct connection *connection)
{
    size_t empty = 0;
    while (connection->filled - empty > 1 && memcmp(connection->in + empty, "\r\n", 2) == 0)
        empty += 2;
    if (!empty)
        return;
    connection->filled -= empty;
    connection->seen = 0;
    memmove(connection->in, connection->in + empty, connection->filled);
}

static enum step read_request(struct connection *connection)
{
    const size_t room = connection->all->options.header_bytes;
    pass_empty_lines(connection);
    size_t size = head_size(connection->in, connection->filled, connection->seen);
    connection->seen = connection->filled;
    if (size || connection->filled == room) {
        begin_call(connection, size ? size : room, size != 0);
        return STEP_ON;
    }
    ssize_t got = recv(connection->fd, connection->in + connection->filled, room - connection->filled, 0);
    if (got > 0)
        connection->filled += (size_t)got;
    return got > 0 || (got < 0 && errno == EINTR) ? STEP_ON : got < 0 && errno == EAGAIN ? STEP_BLOCKED : STEP_ENDED;
}

/* ---- answers ---- */

struct text {
    char bytes[ANSWER_BYTES];
    size_t size;
    bool full;
};

static void put(struct text *text, const char *bytes, size_t size)
{
    text->full |= size > sizeof text->bytes - text->size;
    if (text->full)
        return;
    memcpy(text->bytes + text->size, bytes, size);
    text->size += size;
}

static void put_header(struct text *text, const char *name, const char *value)
{
    put(text, name, strlen(name));
    put(text, ": ", 2);
    put(text, value, strlen(value));
    put(text, "\r\n", 2);
}

static void put_number(struct text *text, uint64_t number, const char *after)
{
    char digits[64];
    put(text, digits, (size_t)snprintf(digits, sizeof digits, "%llu%s", (unsigned long long)number, after));
}

static void print_head(const struct connection *connection, const struct response *response, const char *date,
                       struct text *out)
{
    out->size = 0;
    out->full = false;
    put(out, "HTTP/1.1 ", 9);
    put_number(out, response->status, " ");
    put(out, status_title(response->status), strlen(status_title(response->status)));
    put(out, "\r\n", 2);
    put_header(out, "Date", date);
    put_header(out, "Server", "tetlod");
    for (size_t i = 0; i < response->header_count; i++)
        put_header(out, response->headers[i].name, response_header_value(response, i));
    if (response->media_type)
        put_header(out, "Content-Type", response->media_type);
    if (response->etag[0])
        put_header(out, "ETag", response->etag);
    put_header(out, "X-Request-Id", connection->call.id);
    bool no_size = response->status == 204 || response->size == SIZE_UNKNOWN ||
                   (response->status == 304 && response->kind == BODY_NONE);
    if (!no_size) {
        put(out, "Content-Length: ", 16);
        put_number(out, response->size, "\r\n");
    }
    if (!connection->keep)
        put_header(out, "Connection", "close");
    else if (connection->call.head.old)
        put_header(out, "Connection", "keep-alive");
    put(out, "\r\n", 2);
}

static void fini_sending(struct sending *out)
{
    if (out->release)
        out->release(out->owner);
    free(out->head);
    free(out->piece);
    *out = (struct sending){0};
}

/* Takes over what the body borrows from. */
static bool begin_body(struct sending *out, struct response *response)
{
    out->release = response->release;
    out->owner = response->owner;
    response->release = NULL;
    if (response->kind == BODY_BYTES) {
        out->chunk = (const unsigned char *)response->bytes + (response->offset - response->held);
        out->chunk_left = (size_t)response->size;
    } else if (response->kind == BODY_PIECES) {
        out->read = response->read;
        out->position = response->offset;
        out->left = response->size;
        out->piece = malloc(PIECE);
        return out->piece != NULL;
    }
    return true;
}

static enum step begin_sending(struct connection *connection, struct response *response, const char *date)
{
    struct call *call = &connection->call;
    struct sending *out = &connection->out;
    struct text head;
    bool no_body = response->status == 304 || response->status == 204 || call->request.method == METHOD_HEAD;
    call->status = response->status;
    call->route = response->route;
    call->bytes = no_body ? 0 : response->size;
    connection->keep = call->head.keep && !response->close && !connection->refused;
    connection->phase = SENDING;
    peer_sending(connection->peer, call->bytes, monotonic_seconds());
    print_head(connection, response, date, &head);
    out->head = head.full ? NULL : malloc(head.size);
    if (out->head)
        memcpy(out->head, head.bytes, head.size);
    out->head_size = head.size;
    bool ready = out->head && (no_body || begin_body(out, response));
    response_release(response);
    return ready ? STEP_ON : STEP_ENDED;
}

static enum step answer(struct connection *connection, const char *date)
{
    struct response response;
    if (!go_on(connection))
        return STEP_ENDED;
    response_init(&response);
    peer_busy(connection->peer);
    const struct http_options *options = &connection->all->options;
    if (options->answer(options->opaque, &connection->call.request, &response) == WAITING)
        return suspend(connection);
    return begin_sending(connection, &response, date);
}

/* The end of an answer, or of a request that gets none. */
static void end_call(struct connection *connection, bool complete)
{
    struct call *call = &connection->call;
    const struct http_options *options = &connection->all->options;
    double now = monotonic_seconds();
    if (call->status) {
        const struct finished finished = {call->head.method, call->id, call->remote, call->route,
                                          (char *)(uintptr_t)call->head.target, call->status, call->bytes,
                                          now - call->started, complete};
        options->finished(options->opaque, &finished);
    }
    if (call->registered)
        peer_wait(connection->peer, NULL);
    fini_sending(&connection->out);
    request_unpin(&call->request);
    peer_idle(connection->peer, now);
}

/* What follows the answer: the next request, or the end of what is said. */
static enum step follow(struct connection *connection)
{
    end_call(connection, true);
    connection->filled -= connection->request_size;
    memmove(connection->in, connection->in + connection->request_size, connection->filled);
    connection->seen = 0;
    connection->phase = connection->keep ? READING : PARTING;
    if (connection->keep)
        return STEP_ON;
    shutdown(connection->fd, SHUT_WR);
    peer_parting(connection->peer, monotonic_seconds());
    return STEP_ON;
}

/* Makes the next piece of the body. */
static enum step read_piece(struct connection *connection)
{
    struct sending *out = &connection->out;
    if (!go_on(connection))
        return STEP_ENDED;
    size_t some = out->left < PIECE ? (size_t)out->left : PIECE;
    ptrdiff_t got = out->read(out->owner, out->position, some, out->piece);
    if (got == 0)
        return suspend(connection);
    if (got < 0)
        return STEP_ENDED;
    out->chunk = out->piece;
    out->chunk_left = (size_t)got;
    out->position += (size_t)got;
    out->left -= (size_t)got;
    return STEP_ON;
}

static enum step send_some(struct connection *connection)
{
    struct sending *out = &connection->out;
    if (!out->chunk_left && out->left)
        return read_piece(connection);
    struct iovec parts[2] = {{out->head + out->head_sent, out->head_size - out->head_sent},
                             {(void *)(uintptr_t)out->chunk, out->chunk_left}};
    const struct msghdr message = {.msg_iov = parts, .msg_iovlen = 2};
    ssize_t sent = sendmsg(connection->fd, &message, MSG_NOSIGNAL | (out->left ? MSG_MORE : 0));
    if (sent < 0)
        return errno == EAGAIN ? STEP_BLOCKED : errno == EINTR ? STEP_ON : STEP_ENDED;
    size_t of_head = (size_t)sent < parts[0].iov_len ? (size_t)sent : parts[0].iov_len;
    out->head_sent += of_head;
    out->chunk += (size_t)sent - of_head;
    out->chunk_left -= (size_t)sent - of_head;
    if (out->head_sent == out->head_size && !out->chunk_left && !out->left)
        return follow(connection);
    peer_moved(connection->peer, monotonic_seconds());
    return STEP_ON;
}

/* Nothing more is said. Whoever was refused may still be sending: if the connection was closed now, the refusal could
 * be lost on its way. */
static enum step part(struct connection *connection)
{
    char unwanted[4096];
    ssize_t got = recv(connection->fd, unwanted, sizeof unwanted, 0);
    if (got < 0 && errno == EAGAIN)
        return connection->refused ? STEP_BLOCKED : STEP_ENDED;
    connection->drained += got > 0 ? (size_t)got : 0;
    connection->refused = true; // by what it sends
    return got <= 0 || connection->drained > MAX_DRAINED ? STEP_ENDED : STEP_ON;
}

/* ---- life ---- */

struct connection *connection_new(struct connections *connections, int fd)
{
    struct connection *connection = malloc(sizeof *connection + connections->options.header_bytes);
    if (!connection)
        return NULL;
    memset(connection, 0, sizeof *connection); // what is read into is not touched before
    connection->all = connections;
    connection->fd = fd;
    connection->peer = gate_peer(connections->options.gate, fd);
    return connection;
}

enum step connection_advance(struct connection *connection, const char *date)
{
    enum step step = STEP_ON;
    for (int turn = 0; turn < TURN && step == STEP_ON; turn++)
        step = connection->phase == READING     ? read_request(connection)
               : connection->phase == ANSWERING ? answer(connection, date)
               : connection->phase == SENDING   ? send_some(connection)
                                                : part(connection);
    return step;
}

struct connection_link *connection_link(struct connection *connection)
{
    return &connection->link;
}

void connection_free(struct connection *connection)
{
    if (connection->phase == ANSWERING || connection->phase == SENDING)
        end_call(connection, false);
    gate_leave(connection->all->options.gate, connection->peer);
    close(connection->fd);
    free(connection);
}
