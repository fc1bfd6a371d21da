/* SPDX-License-Identifier: BSD-3-Clause */
#define _GNU_SOURCE
#include "server/net/http.h"

#include <errno.h>
#include <pthread.h>
#include <stdlib.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/random.h>
#include <time.h>
#include <unistd.h>

#include "format/fail.h"
#include "server/net/connection.h"
#include "src/util/array.h"

enum { EVENTS = 64 /* that are taken at a time */ };

struct queue {
    struct connection *first, *last;
};

/* A thread, and the connections that it has. */
struct loop {
    pthread_t thread;
    int epoll, wake;
    atomic_size_t count;
    pthread_mutex_t lock; /* over the next three */
    struct connection *newest;
    struct queue woken;
    bool stopping;
    struct queue again; /* those that others were let before */
    time_t dated;       /* when `date` was printed */
    char date[sizeof "Thu, 01 Jan 1970 00:00:00 GMT"];
};

struct http {
    struct connections connections;
    unsigned count; /* of loops whose threads run */
    struct loop loops[];
};

static void append(struct queue *queue, struct connection *connection)
{
    connection_link(connection)->next = NULL;
    if (queue->first)
        connection_link(queue->last)->next = connection;
    else
        queue->first = connection;
    queue->last = connection;
}

static struct connection *take(struct queue *queue)
{
    struct connection *connection = queue->first;
    if (connection)
        queue->first = connection_link(connection)->next;
    return connection;
}

static void knock(struct loop *loop)
{
    uint64_t one = 1;
    ssize_t ignored = write(loop->wake, &one, sizeof one);
    (void)ignored; // a counter that is full wakes, too
}

static void on_woken(struct connection *connection)
{
    struct loop *loop = connection_link(connection)->loop;
    pthread_mutex_lock(&loop->lock);
    append(&loop->woken, connection);
    pthread_mutex_unlock(&loop->lock);
    knock(loop);
}

/* ---- connections of a loop ---- */

static void link_in(struct loop *loop, struct connection *connection)
{
    struct connection_link *link = connection_link(connection);
    link->loop = loop;
    pthread_mutex_lock(&loop->lock);
    link->older = loop->newest;
    if (link->older)
        connection_link(link->older)->newer = connection;
    loop->newest = connection;
    pthread_mutex_unlock(&loop->lock);
    atomic_fetch_add(&loop->count, 1);
}

static void end(struct loop *loop, struct connection *connection)
{
    struct connection_link *link = connection_link(connection);
    pthread_mutex_lock(&loop->lock);
    *(link->newer ? &connection_link(link->newer)->older : &loop->newest) = link->older;
    if (link->older)
        connection_link(link->older)->newer = link->newer;
    pthread_mutex_unlock(&loop->lock);
    atomic_fetch_sub(&loop->count, 1);
    connection_free(connection);
}

/* The time as HTTP writes it, printed once a second. */
static const char *print_date(struct loop *loop)
{
    struct tm utc;
    time_t now = time(NULL);
    if (!loop->date[0] || now != loop->dated)
        strftime(loop->date, sizeof loop->date, "%a, %d %b %Y %H:%M:%S GMT", gmtime_r(&now, &utc));
    loop->dated = now;
    return loop->date;
}

static void advance(struct loop *loop, struct connection *connection)
{
    enum step step = connection_advance(connection, print_date(loop));
    if (step == STEP_ENDED)
        end(loop, connection);
    else if (step == STEP_ON) {
        connection_link(connection)->queued = true;
        append(&loop->again, connection);
    }
}

/* An event of its socket. One that is queued, or sleeps, sees by itself what there is when it goes on. */
static void on_event(struct loop *loop, struct connection *connection)
{
    const struct connection_link *link = connection_link(connection);
    if (!link->asleep && !link->queued)
        advance(loop, connection);
}

static void run_again(struct loop *loop)
{
    struct queue again = loop->again;
    loop->again = (struct queue){0};
    for (struct connection *connection; (connection = take(&again));) {
        connection_link(connection)->queued = false;
        advance(loop, connection);
    }
}

/* False: the loop is to end. */
static bool run_woken(struct loop *loop)
{
    pthread_mutex_lock(&loop->lock);
    struct queue woken = loop->woken;
    bool stopping = loop->stopping;
    loop->woken = (struct queue){0};
    pthread_mutex_unlock(&loop->lock);
    for (struct connection *connection; (connection = take(&woken));) {
        connection_link(connection)->asleep = false;
        advance(loop, connection);
    }
    return !stopping;
}

static void *run_loop(void *opaque)
{
    struct loop *loop = opaque;
    struct epoll_event events[EVENTS];
    uint64_t knocks;
    do {
        int count = epoll_wait(loop->epoll, events, EVENTS, loop->again.first ? 0 : -1);
        for (int i = 0; i < count; i++) {
            if (events[i].data.ptr)
                on_event(loop, events[i].data.ptr);
            else if (read(loop->wake, &knocks, sizeof knocks) < 0 && errno != EAGAIN)
                continue; // it knocks again
        }
        run_again(loop);
    } while (run_woken(loop));
    while (loop->newest)
        end(loop, loop->newest);
    return NULL;
}

void http_serve(struct http *http, int fd)
{
    struct connection *connection = connection_new(&http->connections, fd);
    if (!connection) {
        struct gate *gate = http->connections.options.gate;
        gate_leave(gate, gate_peer(gate, fd));
        close(fd);
        return;
    }
    struct loop *loop = &http->loops[0];
    for (unsigned i = 1; i < http->count; i++)
        if (atomic_load(&http->loops[i].count) < atomic_load(&loop->count))
            loop = &http->loops[i];
    link_in(loop, connection);
    // from here on the loop has it
    struct epoll_event event = {EPOLLIN | EPOLLOUT | EPOLLRDHUP | EPOLLET, {.ptr = connection}};
    if (epoll_ctl(loop->epoll, EPOLL_CTL_ADD, fd, &event) != 0)
        end(loop, connection);
}

/* ---- life ---- */

static bool start_loop(struct loop *loop)
{
    struct epoll_event knocks = {EPOLLIN, {.ptr = NULL}};
    loop->epoll = epoll_create1(EPOLL_CLOEXEC);
    loop->wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    pthread_mutex_init(&loop->lock, NULL);
    bool started = loop->epoll >= 0 && loop->wake >= 0 &&
                   epoll_ctl(loop->epoll, EPOLL_CTL_ADD, loop->wake, &knocks) == 0 &&
                   pthread_create(&loop->thread, NULL, run_loop, loop) == 0;
    if (started)
        return true;
    if (loop->epoll >= 0)
        close(loop->epoll);
    if (loop->wake >= 0)
        close(loop->wake);
    pthread_mutex_destroy(&loop->lock);
    return false;
}

static void stop_loop(struct loop *loop)
{
    pthread_mutex_lock(&loop->lock);
    loop->stopping = true;
    pthread_mutex_unlock(&loop->lock);
    knock(loop);
    pthread_join(loop->thread, NULL);
    close(loop->epoll);
    close(loop->wake);
    pthread_mutex_destroy(&loop->lock);
}

enum tetlod_status http_start(struct http **out, const struct http_options *options, struct tetlod_error *error)
{
    struct http *http = *out = calloc(1, sizeof *http + options->threads * sizeof *http->loops);
    if (!http)
        return tetlodi_fail_nomem(error, "the server", sizeof *http);
    http->connections.options = *options;
    http->connections.woken = on_woken;
    if (getrandom(&http->connections.id_base, sizeof http->connections.id_base, GRND_NONBLOCK) < 0)
        http->connections.id_base = (uint32_t)getpid();
    while (http->count < options->threads && start_loop(&http->loops[http->count]))
        http->count++;
    if (http->count == options->threads)
        return TETLOD_OK;
    http_stop(http);
    *out = NULL;
    return tetlodi_fail(error, TETLOD_ERR_NOMEM, "cannot start the HTTP threads (limits on threads or descriptors?)");
}

void http_stop(struct http *http)
{
    for (unsigned i = 0; http && i < http->count; i++)
        stop_loop(&http->loops[i]);
    free(http);
}
