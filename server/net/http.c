/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What libmicrohttpd 0.9.75 does and what is done about it:
 * - it decodes paths and cuts them at %00: the request target is taken raw, from the URI log callback;
 * - what it refuses itself it refuses as HTML, which cannot be replaced, or not at all where a connection's memory is
 *   used up (test_protocol.py has the list): it copies cookies and lists headers in that memory. It gets four times
 *   what a request may take, and not more, for the library clears all of it after each answer; what is too long is
 *   refused here;
 * - it accepts bodies with Content-Length and Transfer-Encoding at once, and without strict checks no Host: any body
 * and
 *   any broken framing is refused here and ends the connection;
 * - a 304 gets the length of the body that it is queued with: that body is queued with it, or one of its length, and is
 * not
 *   sent; where the length is not known the connection ends, for without a body the length would be 0;
 * - it has no deadline for a request, only idle time, and divides connections unevenly: see gate.h and server.c;
 * - its threads must not block: a request that waits is suspended, and resumed by whoever finishes what it waits for.
 */
#include "server/net/http.h"

#include <arpa/inet.h>
#include <microhttpd.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/random.h>
#include <time.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/clock.h"

struct http {
    struct http_options options;
    struct MHD_Daemon *daemon;
    struct MHD_Response *spare; /* for requests for whose answer there is no memory */
    uint32_t id_base; /* of this process's request ids */
    atomic_uint_fast64_t next_id;
};

enum {
    ANSWER_BYTES = HEADER_TEXT + 4096, // of a connection's memory, for headers of answers
    LINE = 65536, // no header is that long
    MAX_DRAINED = 65536, // bytes of a refused body that are read so that the client sees the refusal
    PIECE = 65536, // bytes of a body that are made at a time; every connection with such a body has room for one
};

static const char no_memory[] = "{\"title\":\"Service Unavailable\",\"status\":503,\"detail\":\"the server is out of "
                                "memory; try later\"}";

/* Where a request is between its thread and whoever wakes it. */
enum state { RUNNING, SUSPENDED, WOKEN };

/* A request from its first line to the end of its answer. */
struct call {
    struct http *http;
    struct request request;
    struct waiter waiter;
    struct waiting waiting;
    bool registered, gone; /* the peer knows `waiting`; its client has left */
    struct MHD_Connection *connection;
    struct peer *peer;
    atomic_int state;
    bool headers_seen, given_id;
    size_t drained;
    double started;
    unsigned status;
    uint64_t bytes;
    const char *route;
    char method[16], id[40];
    /* the client, maybe behind a proxy, and what is counted of it */
    char remote[INET6_ADDRSTRLEN], network[INET6_ADDRSTRLEN];
    char target[];
};

/* A connection: its peer, and the request on it. The library forgets a request of which two things are wrong (the first
 * header does not fit into the connection's memory): it closes the connection without a call of on_completed. */
struct client {
    struct peer *peer;
    struct call *call;
    time_t dated; /* when `date` was printed */
    char date[sizeof "Thu, 01 Jan 1970 00:00:00 GMT"];
};

static struct client *client_of(struct MHD_Connection *connection)
{
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
    return info ? info->socket_context : NULL;
}

static void free_call(struct call *call)
{
    if (!call)
        return;
    request_unpin(&call->request);
    free(call);
}

/* ---- requests ---- */

static const char *find_header(void *opaque, const char *name)
{
    struct call *call = opaque;
    return MHD_lookup_connection_value(call->connection, MHD_HEADER_KIND, name);
}

static void wake(struct waiter *waiter)
{
    struct call *call = (struct call *)(void *)((char *)waiter - offsetof(struct call, waiter));
    if (atomic_exchange(&call->state, WOKEN) == SUSPENDED)
        MHD_resume_connection(call->connection);
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

/* The library goes on to parse the query, for which each parameter takes some of the connection's memory; where that is
 * full the client hears nothing until the time-out. In its copy of the target it is to find no parameters. */
static void hide_parameters(const char *target)
{
    for (char *separator = strchr(target, '?'); separator; separator = strchr(separator, '&'))
        *separator = '_';
}

static void *on_target(void *opaque, const char *target, struct MHD_Connection *connection)
{
    struct http *http = opaque;
    struct client *client = client_of(connection);
    size_t size = strlen(target) + 1;
    struct call *call = array_zero(1, sizeof *call + size);
    if (!call)
        return NULL; // the handler says so
    memcpy(call->target, target, size);
    hide_parameters(target);
    if (client)
        client->call = call;
    call->http = http;
    call->connection = connection;
    call->started = monotonic_seconds();
    call->waiter.wake = wake;
    call->waiting.leave = leave;
    call->request = (struct request){.target = call->target, .header = find_header, .opaque = call,
                                     .waiter = &call->waiter};
    return call;
}

static size_t keep_escapes(void *opaque, struct MHD_Connection *connection, char *text)
{
    (void)opaque;
    (void)connection;
    return strlen(text);
}

struct framing {
    const char *end; /* of the value before */
    unsigned lengths, codings, hosts;
    bool content, bad_name, bad_value;
};

static enum MHD_Result count_header(void *opaque, enum MHD_ValueKind kind, const char *name, size_t name_size,
                                    const char *value,
                                    size_t value_size)
{
    struct framing *framing = opaque;
    static const char token[] = "!#$%&'*+-.^_`|~0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz";
    (void)kind;
    if (value) { // lines follow each other: what lies between a value and the next name was cut off by a NUL
        framing->bad_value |= framing->end && name > framing->end + 2 && name < framing->end + LINE;
        framing->end = value + strlen(value);
    }
    (void)value_size;
    if (!*name || strlen(name) != name_size || name[strspn(name, token)]) // "Content-Length : 5" among them
        framing->bad_name = true;
    else if (strcasecmp(name, "Content-Length") == 0) {
        framing->lengths++;
        framing->content |= !value || strspn(value, "0") != strlen(value) || !*value;
    } else if (strcasecmp(name, "Transfer-Encoding") == 0)
        framing->codings++;
    else if (strcasecmp(name, "Host") == 0)
        framing->hosts++;
    return MHD_YES;
}

/* No request here has a body; and two lengths, or a length beside a transfer coding, are how requests are smuggled. The
 * library checks none of this, or answers with HTML sent twice where it does. */
static unsigned refuse_framing(const struct call *call, const char *method, const char *version, const char **why)
{
    struct framing framing = {0};
    MHD_get_connection_values_n(call->connection, MHD_HEADER_KIND, count_header, &framing);
    const union MHD_ConnectionInfo *size = MHD_get_connection_info(call->connection,
                                                                   MHD_CONNECTION_INFO_REQUEST_HEADER_SIZE);
    if (size && size->header_size > call->http->options.header_bytes) {
        bool target = strlen(call->target) > call->http->options.header_bytes / 2;
        *why = target ? "the request's target is too long" : "the request's headers are too long";
        return target ? 414 : 431;
    }
    if (size && framing.end) // the request begins with its method and ends with an empty line
        framing.bad_value |=
            method + size->header_size > framing.end + 4 && method + size->header_size < framing.end + LINE;
    bool one = strcmp(version, "HTTP/1.1") == 0, zero = strcmp(version, "HTTP/1.0") == 0;
    if (!one && !zero)
        *why = "only HTTP/1.0 and HTTP/1.1 are spoken here";
    else if (framing.bad_name)
        *why = "a header's name has characters that names do not have";
    else if (framing.bad_value)
        *why = "a header's value has a NUL in it";
    else if (framing.hosts > 1 || (one && !framing.hosts))
        *why = "a request has one Host header";
    else if (framing.codings || framing.lengths > 1 || framing.content)
        *why = "request bodies are not accepted";
    else
        return 0;
    return !one && !zero ? 505 : framing.bad_name || framing.bad_value || framing.hosts != 1 ? 400 : 413;
}

static bool good_id(const char *id)
{
    size_t size = strspn(id, "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_.");
    return size && size < sizeof((struct call *)0)->id && !id[size];
}

/* The lines of a header joined by commas, as RFC 9110 reads them; of what is too long the end. */
struct joined {
    const char *name;
    size_t size;
    char text[1024];
};

static enum MHD_Result join_line(void *opaque, enum MHD_ValueKind kind, const char *name, const char *value)
{
    struct joined *joined = opaque;
    (void)kind;
    if (!value || strcasecmp(name, joined->name) != 0)
        return MHD_YES;
    size_t size = strlen(value), room = sizeof joined->text - 2;
    size_t kept = size < room ? size : room, before = joined->size < room - kept ? joined->size : room - kept;
    memmove(joined->text, joined->text + joined->size - before, before);
    joined->text[before] = ',';
    memcpy(joined->text + before + 1, value + size - kept, kept);
    joined->size = before + 1 + kept;
    joined->text[joined->size] = 0;
    return MHD_YES;
}

/* The client: the connection's address or, behind a trusted proxy, the address that the proxy forwards. */
static void take_client(struct call *call)
{
    if (!call->peer)
        return;
    snprintf(call->remote, sizeof call->remote, "%s", peer_address(call->peer));
    snprintf(call->network, sizeof call->network, "%s", peer_network(call->peer));
    call->request.client = call->network;
    if (!peer_is_proxy(call->peer))
        return;
    struct joined forwarded = {.name = "X-Forwarded-For"};
    MHD_get_connection_values(call->connection, MHD_HEADER_KIND, join_line, &forwarded);
    if (proxies_client(call->http->options.proxies, forwarded.text, call->remote))
        network_of(call->remote, call->network);
}

static void take_headers(struct call *call, const char *method, const char *version)
{
    struct http *http = call->http;
    const struct client *client = client_of(call->connection);
    const char *id = find_header(call, "X-Request-Id");
    call->headers_seen = true;
    call->peer = client ? client->peer : NULL;
    snprintf(call->method, sizeof call->method, "%s", method);
    call->request.method = strcmp(method, "GET") == 0       ? METHOD_GET
                           : strcmp(method, "HEAD") == 0    ? METHOD_HEAD
                           : strcmp(method, "OPTIONS") == 0 ? METHOD_OPTIONS
                                                            : METHOD_OTHER;
    call->request.refused = refuse_framing(call, method, version, &call->request.why_refused);
    if (call->request.refused || call->request.method == METHOD_OTHER) // a body may be announced that never comes
        MHD_set_connection_option(call->connection, MHD_CONNECTION_OPTION_TIMEOUT, 1u);
    call->request.loopback = call->peer && peer_reach(call->peer) == REACH_LOOPBACK;
    call->request.local = !call->peer || peer_reach(call->peer) != REACH_NETWORK;
    take_client(call);
    call->given_id = id && good_id(id);
    if (call->given_id)
        snprintf(call->id, sizeof call->id, "%s", id);
    else
        snprintf(call->id, sizeof call->id, "%08x-%llx", (unsigned)http->id_base,
                 (unsigned long long)atomic_fetch_add(&http->next_id, 1));
}

/* ---- responses ---- */

struct borrowed {
    void (*release)(void *owner);
    void *owner;
};

static void release_borrowed(void *opaque)
{
    struct borrowed *borrowed = opaque;
    borrowed->release(borrowed->owner);
    free(borrowed);
}

/* Tells of what does not get its answer. */
static void lose(const struct http *http, const char *why)
{
    http->options.lost(http->options.lost_of, why);
}

/* Lets go of the thread until the request's waiter is woken, which may have happened already. */
static void suspend(struct call *call)
{
    call->registered = call->peer != NULL;
    if (call->registered)
        peer_wait(call->peer, &call->waiting);
    MHD_suspend_connection(call->connection);
    int before = RUNNING;
    if (!atomic_compare_exchange_strong(&call->state, &before, SUSPENDED))
        MHD_resume_connection(call->connection); // it was woken before it slept
}

/* Goes on after a wait; false: there is nobody to answer. */
static bool go_on(struct call *call)
{
    if (call->registered)
        peer_wait(call->peer, NULL);
    call->registered = false;
    atomic_store(&call->state, RUNNING);
    return !call->gone;
}

/* A body that is made while it is sent. */
struct pieces {
    struct call *call;
    ptrdiff_t (*read)(void *owner, uint64_t begin, size_t size, unsigned char *out);
    void (*release)(void *owner);
    void *owner;
    uint64_t offset, size;
};

static void release_pieces(void *opaque)
{
    struct pieces *pieces = opaque;
    if (pieces->release)
        pieces->release(pieces->owner);
    free(pieces);
}

static ssize_t read_pieces(void *opaque, uint64_t position, char *out, size_t most)
{
    struct pieces *pieces = opaque;
    uint64_t left = pieces->size - position;
    size_t some = left < most ? (size_t)left : most;
    if (!go_on(pieces->call))
        return MHD_CONTENT_READER_END_WITH_ERROR;
    ptrdiff_t got = pieces->read(pieces->owner, pieces->offset + position, some, (unsigned char *)out);
    if (got == 0)
        suspend(pieces->call);
    if (got < 0)
        lose(pieces->call->http, "an answer broke off: its bytes could not be read");
    return got < 0 ? MHD_CONTENT_READER_END_WITH_ERROR : (ssize_t)got;
}

static struct MHD_Response *make_pieces_body(struct call *call, struct response *response)
{
    struct pieces *pieces = array_new(1, sizeof *pieces);
    if (!pieces)
        return NULL;
    *pieces = (struct pieces){call, response->read, response->release, response->owner, response->offset,
                              response->size};
    struct MHD_Response *made = MHD_create_response_from_callback(response->size, PIECE, read_pieces, pieces,
                                                                  release_pieces);
    if (made)
        response->release = NULL;
    else
        free(pieces);
    return made;
}

static ssize_t read_nothing(void *opaque, uint64_t position, char *out, size_t most)
{
    (void)opaque, (void)position, (void)out, (void)most;
    return MHD_CONTENT_READER_END_OF_STREAM;
}

/* For a 304, which has no body but may have the length of one. Where that is not known either, the library announces
 * chunks and sends the last of them unless it knows that the connection ends. */
static struct MHD_Response *make_absent_body(uint64_t size)
{
    struct MHD_Response *made =
        MHD_create_response_from_callback(size == SIZE_UNKNOWN ? MHD_SIZE_UNKNOWN : size, 1, read_nothing, NULL, NULL);
    if (made && size == SIZE_UNKNOWN)
        MHD_set_response_options(made, MHD_RF_HTTP_1_0_COMPATIBLE_STRICT, MHD_RO_END);
    return made;
}

/* The library's response for the body, which takes over what the body borrows from. */
static struct MHD_Response *make_body(struct call *call, struct response *response)
{
    static const char nothing[1] = "";
    if (response->kind == BODY_PIECES)
        return make_pieces_body(call, response);
    if (response->kind == BODY_ABSENT)
        return make_absent_body(response->size);
    const char *bytes =
        response->kind == BODY_NONE ? nothing : (const char *)response->bytes + (response->offset - response->held);
    if (response->kind == BODY_NONE || !response->release)
        return MHD_create_response_from_buffer((size_t)response->size, (void *)(uintptr_t)bytes,
                                               MHD_RESPMEM_PERSISTENT);
    struct borrowed *borrowed = array_new(1, sizeof *borrowed);
    if (!borrowed)
        return NULL;
    *borrowed = (struct borrowed){response->release, response->owner};
    struct MHD_Response *made = MHD_create_response_from_buffer_with_free_callback_cls(
        (size_t)response->size, (void *)(uintptr_t)bytes, release_borrowed, borrowed);
    if (!made)
        free(borrowed);
    else
        response->release = NULL;
    return made;
}

/* The time as HTTP writes it. The library would print it anew for each answer, under a lock. */
static const char *print_date(struct client *client)
{
    struct tm utc;
    time_t now = time(NULL);
    if (!client->date[0] || now != client->dated)
        strftime(client->date, sizeof client->date, "%a, %d %b %Y %H:%M:%S GMT", gmtime_r(&now, &utc));
    client->dated = now;
    return client->date;
}

static bool add_headers(struct MHD_Response *made, const struct call *call, const struct response *response)
{
    bool added = MHD_add_response_header(made, "Server", "tetlod") == MHD_YES;
    for (size_t i = 0; i < response->header_count; i++)
        added &= MHD_add_response_header(made, response->headers[i].name,
                                         response_header_value(response, i)) == MHD_YES;
    if (response->media_type)
        added &= MHD_add_response_header(made, "Content-Type", response->media_type) == MHD_YES;
    if (response->etag[0])
        added &= MHD_add_response_header(made, "ETag", response->etag) == MHD_YES;
    added &= MHD_add_response_header(made, "X-Request-Id", call->id) == MHD_YES;
    if (response->close)
        added &= MHD_add_response_header(made, "Connection", "close") == MHD_YES;
    struct client *client = client_of(call->connection);
    // after Connection: adding that makes the library forget that there is a date, and it sends a second one
    if (client)
        added &= MHD_add_response_header(made, "Date", print_date(client)) == MHD_YES;
    return added;
}

/* Says that there is no memory, with what was made for it when there was some. */
static enum MHD_Result queue_spare(struct http *http, struct MHD_Connection *connection)
{
    enum MHD_Result result = MHD_queue_response(connection, 503, http->spare);
    lose(http, result == MHD_YES ? "a request was answered with 503: there is no memory for its answer"
                                 : "a connection was closed: there is no memory for an answer");
    return result;
}

static enum MHD_Result queue(struct call *call, struct response *response)
{
    call->status = response->status;
    call->route = response->route;
    bool no_body = response->status == 304 || response->status == 204 || call->request.method == METHOD_HEAD;
    call->bytes = no_body ? 0 : response->size;
    if (call->peer)
        peer_sending(call->peer, call->bytes, monotonic_seconds());
    struct MHD_Response *made = make_body(call, response);
    enum MHD_Result result = MHD_NO;
    if (made && add_headers(made, call, response))
        result = MHD_queue_response(call->connection, response->status, made);
    if (made)
        MHD_destroy_response(made);
    response_release(response);
    if (result == MHD_YES)
        return MHD_YES;
    call->status = 503;
    call->bytes = call->request.method == METHOD_HEAD ? 0 : sizeof no_memory - 1;
    return queue_spare(call->http, call->connection);
}

static enum MHD_Result answer(struct call *call)
{
    struct response response;
    if (!go_on(call))
        return MHD_NO;
    response_init(&response);
    if (call->peer)
        peer_busy(call->peer);
    if (call->http->options.answer(call->http->options.opaque, &call->request, &response) == ANSWERED)
        return queue(call, &response);
    suspend(call);
    return MHD_YES;
}

static enum MHD_Result on_request(void *opaque, struct MHD_Connection *connection, const char *url, const char *method,
                                  const char *version, const char *upload, size_t *upload_size, void **context)
{
    struct call *call = *context;
    (void)url, (void)upload;
    if (!call)
        return queue_spare(opaque, connection);
    if (!call->headers_seen) {
        take_headers(call, method, version);
        bool refused = call->request.refused || call->request.method == METHOD_OTHER;
        if (refused && find_header(call, "Expect"))
            return answer(call); // it waits for leave to send its body
        return MHD_YES; // else what follows is read, so that the client sees the refusal
    }
    if (*upload_size) {
        call->drained += *upload_size;
        *upload_size = 0;
        return call->drained <= MAX_DRAINED ? MHD_YES : MHD_NO;
    }
    return answer(call);
}

/* ---- the end of a request ---- */

static void on_completed(void *opaque, struct MHD_Connection *connection, void **context,
                         enum MHD_RequestTerminationCode code)
{
    struct http *http = opaque;
    struct call *call = *context;
    struct client *client = client_of(connection);
    if (!call)
        return;
    double now = monotonic_seconds();
    if (call->status) {
        const struct finished finished = {call->method,
                                          call->id,
                                          call->remote,
                                          call->route,
                                          call->target,
                                          call->status,
                                          call->bytes,
                                          now - call->started,
                                          code == MHD_REQUEST_TERMINATED_COMPLETED_OK};
        http->options.finished(http->options.opaque, &finished);
    }
    if (call->registered)
        peer_wait(call->peer, NULL);
    if (call->peer)
        peer_idle(call->peer, now);
    free_call(call);
    *context = NULL;
    if (client)
        client->call = NULL;
}

static void on_connection(void *opaque, struct MHD_Connection *connection, void **context,
                          enum MHD_ConnectionNotificationCode code)
{
    struct http *http = opaque;
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
    struct peer *peer = info ? gate_peer(http->options.gate, info->connect_fd) : NULL;
    struct client *client = *context;
    if (code == MHD_CONNECTION_NOTIFY_STARTED) {
        *context = client = array_zero(1, sizeof *client);
        if (client)
            client->peer = peer;
        return;
    }
    if (client)
        free_call(client->call);
    free(client);
    *context = NULL;
    if (peer)
        gate_leave(http->options.gate, peer);
}

/* ---- life ---- */

static struct MHD_Response *make_spare(void)
{
    struct MHD_Response *made = MHD_create_response_from_buffer(sizeof no_memory - 1, (void *)(uintptr_t)no_memory,
                                                                MHD_RESPMEM_PERSISTENT);
    if (made && MHD_add_response_header(made, "Content-Type", "application/problem+json") == MHD_YES &&
        MHD_add_response_header(made, "Cache-Control", "no-store") == MHD_YES &&
        MHD_add_response_header(made, "Retry-After", "1") == MHD_YES)
        return made;
    if (made)
        MHD_destroy_response(made);
    return NULL;
}

void http_stop(struct http *http)
{
    if (!http)
        return;
    if (http->daemon)
        MHD_stop_daemon(http->daemon);
    if (http->spare)
        MHD_destroy_response(http->spare);
    free(http);
}

enum tetlod_status http_start(struct http **out, const struct http_options *options, struct tetlod_error *error)
{
    *out = NULL;
    struct http *http = array_zero(1, sizeof *http);
    if (!http)
        return tetlodi_fail_nomem(error, "the server", sizeof *http);
    http->options = *options;
    http->spare = make_spare();
    if (getrandom(&http->id_base, sizeof http->id_base, GRND_NONBLOCK) < 0)
        http->id_base = (uint32_t)getpid();
    unsigned per_thread = (unsigned)options->connections + 1; // any thread may get them all: the gate counts
    struct MHD_OptionItem more[] = {
        {options->threads > 1 ? MHD_OPTION_THREAD_POOL_SIZE : MHD_OPTION_END, (intptr_t)options->threads, NULL},
        {MHD_OPTION_END, 0, NULL},
    };
    http->daemon = MHD_start_daemon(
        MHD_USE_EPOLL_INTERNAL_THREAD | MHD_USE_NO_LISTEN_SOCKET | MHD_USE_ITC | MHD_ALLOW_SUSPEND_RESUME, 0, NULL,
        NULL, on_request, http, MHD_OPTION_CONNECTION_LIMIT, per_thread * options->threads,
        MHD_OPTION_CONNECTION_MEMORY_LIMIT, 4 * options->header_bytes + ANSWER_BYTES, MHD_OPTION_CONNECTION_TIMEOUT,
        options->idle_seconds, MHD_OPTION_URI_LOG_CALLBACK, on_target, http, MHD_OPTION_UNESCAPE_CALLBACK, keep_escapes,
        http, MHD_OPTION_NOTIFY_COMPLETED, on_completed, http, MHD_OPTION_NOTIFY_CONNECTION, on_connection, http,
        MHD_OPTION_ARRAY, more, MHD_OPTION_END);
    if (!http->daemon || !http->spare) {
        http_stop(http);
        return tetlodi_fail(error, TETLOD_ERR_NOMEM,
                            "cannot start the HTTP threads (limits on threads or descriptors?)");
    }
    *out = http;
    return TETLOD_OK;
}

void http_serve(struct http *http, int fd, const struct sockaddr *address, socklen_t address_size)
{
    if (MHD_add_connection(http->daemon, fd, address, address_size) != MHD_YES) {
        lose(http, "a connection was closed: there is no memory for it");
        struct peer *peer = gate_peer(http->options.gate, fd); // the library has closed fd
        if (peer)
            gate_leave(http->options.gate, peer);
    }
}
