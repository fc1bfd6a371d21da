/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Lifecycle. Threads: an acceptor, which spreads connections over the HTTP threads; those; workers for what takes
 * longer than a connection's thread may wait, and decoders for what takes longer than that; a reaper, which looks at
 * late connections; a scanner, which looks at the files.
 */
#define _GNU_SOURCE
#include "server/server.h"

#include <errno.h>
#include <math.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "format/fail.h"
#include "server/http/access_log.h"
#include "server/net/http.h"
#include "server/net/listener.h"
#include "server/routes/routes.h"
#include "server/rules.h"
#include "src/util/array.h"
#include "src/util/buffer.h"
#include "src/util/clock.h"
#include "src/util/memory_limit.h"
#include "src/util/parallel.h"

enum { MAX_LISTENERS = 16, MAX_DESCRIPTORS = 1 << 20, QUEUE = 256, OWN_DESCRIPTORS = 48, MIN_FILES = 8,
      UNSENT = 64 << 10 };

/* Between looks at connections, and no wait is longer: a time beyond it would not fit into what the system counts
 * with. */
static const double KEEPER_SECONDS = 0.25, MAX_SECONDS = 1e9;

/* Threads that have not ended so long after the drain are left alone. */
static const double LAST_SECONDS = 0.6;

struct server {
    struct server_options options;
    struct site site, metrics_site;
    const char **routes;
    char *stream_origins, *base_path;
    struct proxies *proxies;
    char *urls[MAX_LISTENERS];
    struct gate *gate;
    struct http *http, *metrics_http;
    struct listener listeners[MAX_LISTENERS]; /* the metrics' own one last */
    size_t listener_count;
    int wake; /* eventfd: the acceptor is to end */
    pthread_t acceptor, reaper, scanner;
    bool accepting, reaping, scanning;
    pthread_mutex_t lock;
    pthread_cond_t changed, stop;
    bool stopping, rescan, scanned_out; /* under the lock */
    atomic_llong quiet_until;           /* seconds: when the next lost answer is logged */
};

static void say(struct server *server, const char *level, const char *message)
{
    if (server->options.log)
        server->options.log(server->options.log_opaque, level, message);
}

/* Counts a lost answer, and says why now and then: where one is lost, many are. */
static void note_lost(void *opaque, const char *why)
{
    enum { QUIET_SECONDS = 10 };
    struct server *server = opaque;
    long long now = (long long)monotonic_seconds(), until = atomic_load(&server->quiet_until);
    metrics_count(server->site.metrics, METRIC_ANSWERS_LOST);
    if (now >= until && atomic_compare_exchange_strong(&server->quiet_until, &until, now + QUIET_SECONDS))
        say(server, "warning", why);
}

/* ---- the acceptor ---- */

static void refuse(struct server *server, int fd)
{
    static const char body[] = "{\"title\":\"Service Unavailable\",\"status\":503,\"detail\":\"too many connections; "
                               "try later\"}";
    char answer[400];
    int size = snprintf(answer, sizeof answer,
                        "HTTP/1.1 503 Service Unavailable\r\nRetry-After: 1\r\nConnection: close\r\nCache-Control: "
                        "no-store\r\n"
                                               "Content-Type: application/problem+json\r\nContent-Length: "
                                               "%zu\r\n\r\n%s", sizeof body - 1, body);
    ssize_t ignored = send(fd, answer, (size_t)size, MSG_NOSIGNAL | MSG_DONTWAIT);
    (void)ignored; // the client may be gone already
    close(fd);
    metrics_count(server->site.metrics, METRIC_CONNECTIONS_REFUSED);
}

/* Accepts one connection; false if there is none, or none can be had now. Of an answer the kernel gets little more than
 * what is on its way to the reader. By default it takes a whole large answer; a thousand of those fill its memory, and
 * some readers wait for seconds. */
static bool accept_one(struct server *server, struct listener *listener, struct http *http)
{
    union {
        struct sockaddr any;
        struct sockaddr_in four;
        struct sockaddr_in6 six;
        struct sockaddr_un path;
    } address = {0};
    socklen_t size = sizeof address;
    int on = 1, unsent = UNSENT, fd = accept4(listener->fd, &address.any, &size, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd < 0) {
        bool scarce = errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM;
        if (scarce) {
            note_lost(server, "a connection waits: no descriptor or memory is left for it (ulimit -n, LimitNOFILE)");
            nanosleep(&(struct timespec){0, 50 * 1000 * 1000}, NULL);
        }
        return false;
    }
    if (!gate_enter(server->gate, fd, &address.any, listener->reach, monotonic_seconds())) {
        refuse(server, fd);
        return true;
    }
    if (address.any.sa_family != AF_UNIX) {
        setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
        setsockopt(fd, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &unsent, sizeof unsent);
    }
    metrics_count(server->site.metrics, METRIC_CONNECTIONS);
    http_serve(http, fd, &address.any, size);
    return true;
}

static void *run_acceptor(void *opaque)
{
    struct server *server = opaque;
    struct pollfd polled[MAX_LISTENERS + 1];
    size_t count = server->listener_count;
    for (size_t i = 0; i < count; i++)
        polled[i] = (struct pollfd){server->listeners[i].fd, POLLIN, 0};
    polled[count] = (struct pollfd){server->wake, POLLIN, 0};
    for (;;) {
        if (poll(polled, count + 1, -1) < 0 && errno != EINTR)
            return NULL;
        if (polled[count].revents)
            return NULL;
        for (size_t i = 0; i < count; i++) {
            bool metrics = server->metrics_http && i + 1 == count;
            for (int some = 0; some < 64 && polled[i].revents; some++)
                if (!accept_one(server, &server->listeners[i], metrics ? server->metrics_http : server->http))
                    break;
        }
    }
}

/* ---- the reaper ---- */

/* Whether what was made of a stream, and lies under its content id, may still be asked for. */
static bool is_wanted(void *opaque, const char *key)
{
    return strncmp(key, "catalogue/", 10) == 0 || catalogue_has_content(opaque, key, strcspn(key, "-/"));
}

/* Looks at the paths. This may hang where a network's file system does: nothing else is done by this thread. */
static void *run_scanner(void *opaque)
{
    struct server *server = opaque;
    pthread_mutex_lock(&server->lock);
    while (!server->stopping) {
        double until = monotonic_seconds() + server->options.scan_seconds;
        while (!server->rescan && !server->stopping && monotonic_cond_wait(&server->changed, &server->lock, until))
            ;
        server->rescan = false;
        if (server->stopping)
            break;
        pthread_mutex_unlock(&server->lock);
        catalogue_scan(server->site.catalogue, monotonic_seconds());
        cache_sweep(server->site.memory, is_wanted, server->site.catalogue);
        cache_sweep(server->site.cache, is_wanted, server->site.catalogue);
        pthread_mutex_lock(&server->lock);
    }
    server->scanned_out = true;
    pthread_cond_broadcast(&server->changed);
    pthread_mutex_unlock(&server->lock);
    return NULL;
}

/* Threads that hang in files are replaced, and their waiters may learn of it. */
static void relieve(struct server *server)
{
    struct site *site = &server->site;
    size_t hanging = catalogue_hanging(site->catalogue, 1);
    if (!hanging)
        return;
    workers_relieve(site->workers, hanging);
    workers_relieve(site->decoders, hanging);
    workers_relieve(site->readers, hanging);
    cache_wake_waiters(site->cache);
    cache_wake_waiters(site->memory);
}

static void *run_reaper(void *opaque)
{
    struct server *server = opaque;
    pthread_mutex_lock(&server->lock);
    while (!server->stopping) {
        monotonic_cond_wait(&server->stop, &server->lock, monotonic_seconds() + KEEPER_SECONDS);
        pthread_mutex_unlock(&server->lock);
        double now = monotonic_seconds();
        for (size_t late = gate_reap(server->gate, now, false); late; late--)
            metrics_count(server->site.metrics, METRIC_CONNECTIONS_EXPIRED);
        for (size_t gone = gate_part(server->gate); gone; gone--)
            metrics_count(server->site.metrics, METRIC_CONNECTIONS_LEFT);
        guesses_wake(server->site.guesses, now);
        cache_wake_room_waiters(server->site.cache); // some may have waited long enough
        cache_wake_room_waiters(server->site.memory);
        relieve(server);
        pthread_mutex_lock(&server->lock);
    }
    pthread_mutex_unlock(&server->lock);
    return NULL;
}

/* ---- start ---- */

static double seconds_or(double given, double otherwise)
{
    return given > 0 ? fmin(given, MAX_SECONDS) : otherwise;
}

static void set_defaults(struct server_options *options)
{
    options->threads = options->threads ? options->threads : parallel_cores();
    uint64_t there = memory_limit(""), eighth = there / 8;
    options->cache_bytes = options->cache_bytes           ? options->cache_bytes
                           : eighth < (uint64_t)256 << 20 ? eighth
                                                          : (uint64_t)256 << 20;
    options->memory_bytes = options->memory_bytes ? options->memory_bytes : there / 2;
    options->connections = options->connections ? options->connections : 4096;
    options->header_bytes = options->header_bytes ? options->header_bytes : 8192;
    options->jobs_per_client = options->jobs_per_client ? options->jobs_per_client : 64;
    options->idle_seconds = seconds_or(options->idle_seconds, 30);
    options->drain_seconds = seconds_or(options->drain_seconds, 10);
    options->grace_seconds = fmin(options->grace_seconds, options->drain_seconds);
    options->scan_seconds = seconds_or(options->scan_seconds, 2);
    options->keep_replaced = seconds_or(options->keep_replaced, 60);
}

/* Divides the descriptors that the process may have: a quarter for streams, which are opened again when they are
 * needed, some for the process itself, the rest for connections. */
static void divide_descriptors(struct server *server, size_t *out_all, size_t *out_files)
{
    struct server_options *options = &server->options;
    long limit = sysconf(_SC_OPEN_MAX);
    *out_all = limit > 0 && limit < MAX_DESCRIPTORS ? (size_t)limit : MAX_DESCRIPTORS;
    size_t own = OWN_DESCRIPTORS + 8 * (size_t)options->threads;
    *out_files = *out_all / 4 > MIN_FILES ? *out_all / 4 : MIN_FILES;
    size_t left = *out_all > *out_files + own ? *out_all - *out_files - own : 1;
    if (options->connections <= left)
        return;
    char message[160];
    snprintf(message, sizeof message,
             "at most %zu connections: the process may have %zu descriptors (ulimit -n, LimitNOFILE)", left, *out_all);
    say(server, "warning", message);
    options->connections = left;
}

static void say_memory(struct server *server)
{
    char message[160];
    snprintf(message, sizeof message,
             "at most %llu MB for streams (--memory) and %llu MB for answers (--cache), of %llu MB",
             (unsigned long long)(server->options.memory_bytes >> 20),
             (unsigned long long)(server->options.cache_bytes >> 20), (unsigned long long)(memory_limit("") >> 20));
    say(server, "info", message);
}

static size_t count_connections(void *opaque)
{
    const struct server *server = opaque;
    return gate_count(server->gate);
}

static enum tetlod_status take_rules(struct server *server, struct tetlod_error *error)
{
    const struct server_options *options = &server->options;
    TETLOD_TRY(rules_stream_origins(options, &server->stream_origins, error));
    TETLOD_TRY(rules_base_path(options, &server->base_path, error));
    server->site.stream_origins = server->stream_origins;
    server->site.base_path = server->base_path;
    server->site.secure_cookie = options->secure_cookie;
    return rules_set(server->site.access, options, error);
}

static enum tetlod_status build_site(struct server *server, struct tetlod_error *error)
{
    const struct server_options *options = &server->options;
    struct site *site = &server->site;
    size_t routes = 0;
    while (site_routes[routes].template)
        routes++;
    server->routes = array_zero(routes + 2, sizeof *server->routes);
    for (size_t i = 0; server->routes && i < routes; i++)
        server->routes[i] = site_routes[i].template;
    if (server->routes)
        server->routes[routes] = "/";
    site->metrics = server->routes ? metrics_new(server->routes) : NULL;
    site->cache = cache_new(options->cache_bytes);
    site->memory = cache_new(options->memory_bytes);
    site->serve_metrics = !options->metrics;
    site->access_log = options->access;
    site->access_log_of = options->log_opaque;
    site->jobs_per_client = options->jobs_per_client;
    site->connections = count_connections;
    site->connections_of = server;
    TETLOD_TRY(proxies_new(&server->proxies, options->proxies, options->proxy_count, error));
    size_t descriptors, files;
    divide_descriptors(server, &descriptors, &files);
    const struct gate_options limits = {
        .connections = options->connections,
        .per_address = options->connections_per_address,
        .request_seconds = options->idle_seconds,
        .answer_seconds = options->idle_seconds,
        .descriptors = descriptors,
        .proxies = server->proxies,
    };
    server->gate = gate_new(&limits);
    site->access = access_new();
    site->guesses = guesses_new();
    if (!site->metrics || !site->cache || !site->memory || !server->gate || !site->access || !site->guesses)
        return tetlodi_fail_nomem(error, "the server", 0);
    TETLOD_TRY(take_rules(server, error));
    TETLOD_TRY(workers_start(&site->workers, options->threads, QUEUE, error));
    TETLOD_TRY(workers_start(&site->decoders, options->threads, QUEUE, error));
    TETLOD_TRY(workers_start(&site->readers, options->threads, QUEUE, error));
    const struct catalogue_options catalogue = {
        .paths = options->paths,
        .path_count = options->path_count,
        .keep_replaced = options->keep_replaced,
        .most_files = files,
        .log = options->log,
        .log_opaque = options->log_opaque,
    };
    return catalogue_open(&site->catalogue, &catalogue, error);
}

/* What a browser is given: the address, and the base path where the address is a URL. */
static enum tetlod_status print_url(struct server *server, size_t i, struct tetlod_error *error)
{
    struct buffer text = {0};
    const char *url = server->listeners[i].url;
    bool http = strncmp(url, "http://", 7) == 0;
    if (buffer_printf(&text, "%s%s", url, http && server->base_path ? server->base_path + 1 : "") != TETLOD_OK)
        return tetlodi_fail_nomem(error, "the server", 0);
    server->urls[i] = (char *)text.bytes;
    return TETLOD_OK;
}

static enum tetlod_status open_listeners(struct server *server, struct tetlod_error *error)
{
    const struct server_options *options = &server->options;
    if (options->listen_count + 1 > MAX_LISTENERS)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "at most %d addresses can be listened on", MAX_LISTENERS - 1);
    for (size_t i = 0; i < options->listen_count; i++) {
        TETLOD_TRY(listener_open(&server->listeners[i], options->listen[i], options->socket_mode, error));
        server->listener_count++;
    }
    if (options->metrics) {
        TETLOD_TRY(listener_open(&server->listeners[server->listener_count], options->metrics, options->socket_mode,
                                 error));
        server->listener_count++;
    }
    for (size_t i = 0; i < server->listener_count; i++)
        TETLOD_TRY(print_url(server, i, error));
    return TETLOD_OK;
}

static enum outcome answer_request(void *opaque, struct request *request, struct response *response)
{
    return site_answer(opaque, request, response);
}

static void finish_request(void *opaque, const struct finished *finished)
{
    site_finished(opaque, finished);
}

static enum tetlod_status start_http(struct server *server, struct tetlod_error *error)
{
    struct http_options http = {
        .answer = answer_request,
        .finished = finish_request,
        .opaque = &server->site,
        .lost = note_lost,
        .lost_of = server,
        .gate = server->gate,
        .proxies = server->proxies,
        .threads = server->options.threads,
        .connections = server->options.connections,
        .header_bytes = server->options.header_bytes,
        .idle_seconds = (unsigned)(server->options.idle_seconds + 0.999),
    };
    TETLOD_TRY(http_start(&server->http, &http, error));
    if (!server->options.metrics)
        return TETLOD_OK;
    server->metrics_site = server->site;
    server->metrics_site.serve_metrics = server->metrics_site.only_health = true; // it is for those who run the server
    server->metrics_site.access_log = NULL;
    http.opaque = &server->metrics_site;
    http.threads = 1;
    return http_start(&server->metrics_http, &http, error);
}

static enum tetlod_status start_threads(struct server *server, struct tetlod_error *error)
{
    server->wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (server->wake < 0)
        return tetlodi_fail(error, TETLOD_ERR_IO, "cannot make an eventfd: %s", strerror(errno));
    server->accepting = pthread_create(&server->acceptor, NULL, run_acceptor, server) == 0;
    server->reaping = pthread_create(&server->reaper, NULL, run_reaper, server) == 0;
    server->scanning = pthread_create(&server->scanner, NULL, run_scanner, server) == 0;
    if (!server->accepting || !server->reaping || !server->scanning)
        return tetlodi_fail(error, TETLOD_ERR_NOMEM, "cannot start threads");
    return TETLOD_OK;
}

/* What is needed of the texts was copied: the caller may free them now. */
static void forget_texts(struct server_options *options)
{
    options->listen = options->paths = options->cors = options->hosts = options->proxies = options->stream_origins =
        NULL;
    options->metrics = options->token_file = options->base_path = NULL;
}

enum tetlod_status server_start(struct server **out, const struct server_options *options, struct tetlod_error *error)
{
    sigset_t all, before;
    *out = NULL;
    struct server *server = array_zero(1, sizeof *server);
    if (!server)
        return tetlodi_fail_nomem(error, "the server", sizeof *server);
    server->options = *options;
    server->wake = -1;
    set_defaults(&server->options);
    pthread_mutex_init(&server->lock, NULL);
    monotonic_cond_init(&server->changed);
    monotonic_cond_init(&server->stop);
    for (size_t i = 0; i < MAX_LISTENERS; i++)
        server->listeners[i].fd = -1;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before); // its threads inherit it: signals are the caller's business
    enum tetlod_status status = build_site(server, error);
    if (status == TETLOD_OK)
        status = open_listeners(server, error);
    if (status == TETLOD_OK)
        status = start_http(server, error);
    if (status == TETLOD_OK)
        status = start_threads(server, error);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    forget_texts(&server->options);
    if (status == TETLOD_OK) {
        say_memory(server);
        *out = server;
    } else
        (void)server_stop(server); // what it does not free is lost with a start that failed
    return status;
}

const char *server_url(const struct server *server, size_t i)
{
    return i < server->listener_count ? server->urls[i] : NULL;
}

void server_rescan(struct server *server)
{
    pthread_mutex_lock(&server->lock);
    server->rescan = true;
    pthread_cond_signal(&server->changed);
    pthread_mutex_unlock(&server->lock);
}

enum tetlod_status server_reload(struct server *server, const struct server_options *options,
                                 struct tetlod_error *error)
{
    return rules_set(server->site.access, options, error);
}

/* ---- stop ---- */

static void nap(double seconds)
{
    struct timespec time = {.tv_sec = (time_t)seconds};
    time.tv_nsec = (long)((seconds - (double)time.tv_sec) * 1e9);
    nanosleep(&time, NULL);
}

/* For the time of grace, /readyz says that it is enough, and whoever has not heard it yet is still answered. */
static void stop_accepting(struct server *server)
{
    uint64_t one = 1;
    atomic_store(&server->site.draining, true);
    atomic_store(&server->metrics_site.draining, true);
    if (server->accepting) {
        nap(server->options.grace_seconds);
        ssize_t ignored = write(server->wake, &one, sizeof one);
        (void)ignored;
        pthread_join(server->acceptor, NULL);
    }
    for (size_t i = 0; i < server->listener_count; i++)
        listener_close(&server->listeners[i]);
}

/* Waits for the answers in progress. */
static void drain(struct server *server, double until)
{
    while (gate_count(server->gate) && monotonic_seconds() < until) {
        gate_reap(server->gate, monotonic_seconds(), true);
        nap(0.01);
    }
    if (gate_count(server->gate))
        say(server, "warning", "stopping with answers unfinished");
}

static void stop_reaper(struct server *server)
{
    if (!server->reaping && !server->scanning)
        return;
    pthread_mutex_lock(&server->lock);
    server->stopping = true;
    pthread_cond_broadcast(&server->changed);
    pthread_cond_broadcast(&server->stop);
    pthread_mutex_unlock(&server->lock);
    if (server->reaping)
        pthread_join(server->reaper, NULL);
}

static void wake_room_waiters(struct server *server)
{
    if (server->site.cache)
        cache_wake_room_waiters(server->site.cache);
    if (server->site.memory)
        cache_wake_room_waiters(server->site.memory);
}

/* Drops what is queued; what is being made ends at its next step. These wake all who wait: a suspended connection could
 * not be ended. False if a file hangs, or a step takes too long: then nothing that the threads use is ours to free. */
static bool stop_workers(struct server *server, double until)
{
    struct workers *pools[] = {server->site.readers, server->site.decoders, server->site.workers};
    bool ended = true;
    for (size_t i = 0; i < sizeof pools / sizeof *pools; i++)
        workers_cancel(pools[i]);
    wake_room_waiters(server);
    for (size_t i = 0; i < sizeof pools / sizeof *pools; i++)
        ended &= workers_stop(pools[i], until);
    wake_room_waiters(server); // some began to seek meanwhile: they hear that there are no threads any more
    bool hanging = !ended && server->site.catalogue && catalogue_hanging(server->site.catalogue, LAST_SECONDS) > 0;
    if (!ended)
        say(server, "warning", hanging ? "stopping while a file does not answer"
            : "stopping while an answer is being made");
    return ended;
}

/* False if a path hangs and the thread with it; then the catalogue and the caches, which it reads, are not ours to
 * free. */
static bool stop_scanner(struct server *server, double until)
{
    if (!server->scanning)
        return true;
    pthread_mutex_lock(&server->lock);
    while (!server->scanned_out && monotonic_cond_wait(&server->changed, &server->lock, until))
        ;
    bool ended = server->scanned_out;
    pthread_mutex_unlock(&server->lock);
    if (ended)
        pthread_join(server->scanner, NULL);
    else
        say(server, "warning", "stopping while a path does not answer");
    return ended;
}

static void free_server(struct server *server)
{
    workers_free(server->site.readers);
    workers_free(server->site.decoders);
    workers_free(server->site.workers);
    gate_free(server->gate);
    cache_free(server->site.cache);
    cache_free(server->site.memory);
    catalogue_close(server->site.catalogue);
    metrics_free(server->site.metrics);
    free(server->routes);
    free(server->stream_origins);
    free(server->base_path);
    proxies_free(server->proxies);
    access_free(server->site.access);
    guesses_free(server->site.guesses);
    for (size_t i = 0; i < MAX_LISTENERS; i++)
        free(server->urls[i]);
    if (server->wake >= 0)
        close(server->wake);
    pthread_mutex_destroy(&server->lock);
    pthread_cond_destroy(&server->changed);
    pthread_cond_destroy(&server->stop);
    free(server);
}

bool server_stop(struct server *server)
{
    if (!server)
        return true;
    double until = monotonic_seconds() + server->options.drain_seconds;
    if (server->site.catalogue)
        catalogue_stop(server->site.catalogue);
    stop_accepting(server);
    if (server->gate)
        drain(server, until);
    until = fmin(until, monotonic_seconds()) + LAST_SECONDS;
    stop_reaper(server);
    if (!stop_workers(server, until))
        return false;
    if (server->site.guesses)
        guesses_wake(server->site.guesses, INFINITY);
    http_stop(server->metrics_http);
    http_stop(server->http);
    if (!stop_scanner(server, until))
        return false;
    free_server(server);
    return true;
}
