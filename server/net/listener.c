/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/net/listener.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/util/number_text.h"

enum { BACKLOG = 1024 };

static enum tetlod_status fail_address(const char *address, const char *why, struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_IO, "cannot listen on %.120s: %s", address, why);
}

static bool is_loopback(const struct sockaddr_storage *bound)
{
    const struct in6_addr *six = &((const struct sockaddr_in6 *)(const void *)bound)->sin6_addr;
    if (bound->ss_family == AF_INET)
        return ntohl(((const struct sockaddr_in *)(const void *)bound)->sin_addr.s_addr) >> 24 == 127;
    return bound->ss_family == AF_INET6 && (IN6_IS_ADDR_LOOPBACK(six) ||
                                            (IN6_IS_ADDR_V4MAPPED(six) && six->s6_addr[12] == 127));
}

/* What the socket is bound to: who reaches it, and its URL. */
static void describe(struct listener *listener)
{
    struct sockaddr_storage bound = {0};
    socklen_t size = sizeof bound;
    char host[64] = "", port[16] = "";
    if (getsockname(listener->fd, (struct sockaddr *)&bound, &size) != 0)
        return;
    if (bound.ss_family == AF_UNIX) {
        listener->reach = REACH_UNIX;
        snprintf(listener->url, sizeof listener->url, "unix:%s",
                 ((const struct sockaddr_un *)(void *)&bound)->sun_path);
        return;
    }
    listener->reach = is_loopback(&bound) ? REACH_LOOPBACK : REACH_NETWORK;
    getnameinfo((struct sockaddr *)&bound, size, host, sizeof host, port, sizeof port, NI_NUMERICHOST | NI_NUMERICSERV);
    bool six = bound.ss_family == AF_INET6;
    snprintf(listener->url, sizeof listener->url, "http://%s%s%s:%s/", six ? "[" : "", host, six ? "]" : "", port);
}

static enum tetlod_status start_listening(struct listener *listener, const char *address, struct tetlod_error *error)
{
    int flags = fcntl(listener->fd, F_GETFL);
    if (listen(listener->fd, BACKLOG) != 0 || flags < 0 || fcntl(listener->fd, F_SETFL, flags | O_NONBLOCK) < 0 ||
        fcntl(listener->fd, F_SETFD, FD_CLOEXEC) < 0) {
        enum tetlod_status status = fail_address(address, strerror(errno), error);
        listener_close(listener);
        return status;
    }
    describe(listener);
    return TETLOD_OK;
}

static enum tetlod_status open_tcp(struct listener *listener, const char *address, struct tetlod_error *error)
{
    char host[128];
    const char *colon = strrchr(address, ':');
    size_t size = colon ? (size_t)(colon - address) : 0;
    uint64_t port;
    if (!colon || size >= sizeof host || !text_count(colon + 1, false, &port) || port > 65535)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "'%.120s' is not an address: give ADDR:PORT, [ADDR]:PORT or unix:PATH", address);
    bool brackets = size > 2 && address[0] == '[' && address[size - 1] == ']';
    snprintf(host, sizeof host, "%.*s", (int)(brackets ? size - 2 : size), address + brackets);
    struct addrinfo hints = {.ai_flags = AI_PASSIVE | AI_NUMERICSERV, .ai_socktype = SOCK_STREAM}, *list = NULL;
    int failed = getaddrinfo(host[0] ? host : NULL, colon + 1, &hints, &list);
    if (failed)
        return fail_address(address, gai_strerror(failed), error);
    int on = 1, why = 0;
    for (struct addrinfo *one = list; one && listener->fd < 0; one = one->ai_next) {
        int fd = socket(one->ai_family, one->ai_socktype | SOCK_CLOEXEC, one->ai_protocol);
        if (fd < 0) {
            why = errno;
            continue;
        }
        setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
        if (bind(fd, one->ai_addr, one->ai_addrlen) == 0)
            listener->fd = fd;
        else {
            why = errno;
            close(fd);
        }
    }
    freeaddrinfo(list);
    return listener->fd < 0 ? fail_address(address, strerror(why), error) : start_listening(listener, address, error);
}

/* Removes a socket that a server left behind when it died. Only a refused connection tells that nobody listens there: a
 * server that is stopped or busy does not answer, and it shall keep its socket. */
static enum tetlod_status clear_path(const struct sockaddr_un *name, const char *path, struct tetlod_error *error)
{
    struct stat about;
    if (lstat(path, &about) != 0 || !S_ISSOCK(about.st_mode))
        return TETLOD_OK; // bind says what is wrong
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0)
        return fail_address(path, strerror(errno), error);
    int why = connect(fd, (const struct sockaddr *)name, sizeof *name) == 0 ? 0 : errno;
    close(fd);
    if (why == ECONNREFUSED)
        return unlink(path) == 0 ? TETLOD_OK : fail_address(path, strerror(errno), error);
    return fail_address(path, why && why != EAGAIN ? strerror(why) : "another server listens there", error);
}

static enum tetlod_status open_unix(struct listener *listener, const char *path, unsigned mode,
                                    struct tetlod_error *error)
{
    struct sockaddr_un name = {.sun_family = AF_UNIX};
    if (!*path || strlen(path) >= sizeof name.sun_path)
        return fail_address(path, "a Unix socket's path has 1 to 107 bytes", error);
    memcpy(name.sun_path, path, strlen(path));
    TETLOD_TRY(clear_path(&name, path, error));
    listener->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    // the file never has more than its mode
    bool narrowed = listener->fd >= 0 && (!mode || fchmod(listener->fd, mode) == 0);
    if (!narrowed || bind(listener->fd, (struct sockaddr *)&name, sizeof name) != 0) {
        enum tetlod_status status = fail_address(path, strerror(errno), error);
        listener_close(listener);
        return status;
    }
    snprintf(listener->unlink_at, sizeof listener->unlink_at, "%s", path);
    if (mode && chmod(path, mode) != 0) { // whatever the umask is
        enum tetlod_status status = fail_address(path, strerror(errno), error);
        listener_close(listener);
        return status;
    }
    return start_listening(listener, path, error);
}

enum tetlod_status listener_open(struct listener *out, const char *address, unsigned socket_mode,
                                 struct tetlod_error *error)
{
    *out = (struct listener){.fd = -1};
    if (strncmp(address, "unix:", 5) == 0)
        return open_unix(out, address + 5, socket_mode, error);
    if (strncmp(address, "fd:", 3) != 0)
        return open_tcp(out, address, error);
    uint64_t fd;
    if (!text_count(address + 3, false, &fd) || fd > INT32_MAX)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "'%.120s' is not a descriptor", address);
    out->fd = (int)fd;
    return start_listening(out, address, error);
}

void listener_close(struct listener *listener)
{
    if (listener->fd >= 0)
        close(listener->fd);
    if (listener->unlink_at[0])
        unlink(listener->unlink_at);
    listener->fd = -1;
    listener->unlink_at[0] = 0;
}
