/* SPDX-License-Identifier: BSD-3-Clause */
#define _GNU_SOURCE
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "src/cli/cli.h"
#include "src/cli/serve_request.h"

static const char help[] =
    "usage: tetlod serve [OPTIONS] PATH...\n"
    "\n"
    "Serves streams over HTTP: files, or every *.tetlod of a folder, and every *.vtkhdf with a stream in\n"
    "it. Prints the viewer's URL; stops on SIGINT or SIGTERM after the answers in progress. It notices\n"
    "files that are new, replaced or gone (at once on SIGHUP). On SIGHUP it also reads token, CORS and\n"
    "hosts again.\n"
    "\n"
    "  --listen ADDR:PORT      where to listen; may be repeated (default 127.0.0.1:8080). Also\n"
    "                          [ADDR]:PORT, unix:PATH. A socket handed over by systemd (LISTEN_FDS) takes\n"
    "                          the place of the default\n"
    "  --socket-mode MODE      who may connect to Unix sockets, in octal digits (default 666 less the\n"
    "                          umask)\n"
    "  --metrics ADDR:PORT     serve /metrics there and not with the rest; /healthz and /readyz are\n"
    "                          there, too\n"
    "  --base-path PATH        where the site begins for its clients, such as /levels/; paths without it\n"
    "                          work as well. Not needed behind a proxy that removes the path\n"
    "  --cors ORIGIN|*|none    pages of this origin may read the answers; may be repeated (default: of\n"
    "                          all origins; of none on loopback addresses and Unix sockets)\n"
    "  --host NAME             a name that Host may have on a loopback address beside localhost, such as\n"
    "                          a proxy's; may be repeated; * allows any\n"
    "  --token FILE            answer only clients that send the file's content: ?token=TOKEN once in a\n"
    "                          browser, or a header Authorization: Bearer TOKEN. /healthz, /readyz and\n"
    "                          the address of --metrics alone ask for none. The answer to a wrong token\n"
    "                          waits a second\n"
    "  --secure-cookie         the cookie that holds the token is sent over HTTPS only\n"
    "  --trust-proxy ADDR      this proxy says whom it asks for (X-Forwarded-For): an address,\n"
    "                          ADDRESS/BITS, or unix for Unix sockets; may be repeated\n"
    "  --stream-origin ORIGIN  the page may also load streams from there, such as\n"
    "                          https://data.example.org; may be repeated (default: from this server\n"
    "                          alone)\n"
    "  --threads N             HTTP threads; as many make meshes, and as many decode (default: one per\n"
    "                          core)\n"
    "  --cache BYTES           memory for finished answers (default 256M, at most an eighth of what there\n"
    "                          is)\n"
    "  --memory BYTES          memory for decoded streams, and for surfaces that are too large for the\n"
    "                          cache: unused ones are dropped first (default: half of what the machine or\n"
    "                          the control group has). Levels in pages of streams for which it is too\n"
    "                          little are decoded into temporary files in the folder that TMPDIR names;\n"
    "                          levels without pages that it does not hold are refused (422)\n"
    "  --connections N         at a time (default 4096, or what three quarters of the descriptors allow)\n"
    "  --per-address N         connections of one address at a time (default: no limit); those of trusted\n"
    "                          proxies are not counted\n"
    "  --jobs N                answers of one address that are being made at a time (default 64)\n"
    "  --header-bytes BYTES    request line and headers of a request (default 8K)\n"
    "  --timeout SECONDS       for a request to arrive, and for a reader that stalls (default 30)\n"
    "  --drain SECONDS         for answers in progress when stopping (default 10)\n"
    "  --grace SECONDS         of it, in which connections are still accepted while /readyz says 503\n"
    "                          (default 0)\n"
    "  --scan SECONDS          between looks at the paths (default 2)\n"
    "  --keep-replaced SECONDS how long a replaced stream's URLs stay after their last use (default 60)\n"
    "  --config FILE           read options from a file: a line each, without the dashes, as in 'cors\n"
    "                          https://example.org'; '#' begins a comment. SIGHUP reads token, cors and\n"
    "                          host of it again\n"
    "  --access-log            write a JSON line for each answer to standard error\n"
    "  --quiet                 no messages but errors\n"
    "\n"
    "It speaks HTTP/1.1 without TLS; server/deploy shows how to put nginx or Varnish in front.\n";

enum { FIRST_HANDED_OVER = 3 };

static void print_message(void *opaque, const char *level, const char *message)
{
    const bool *quiet = opaque;
    if (*quiet)
        return;
    bool plain = strcmp(level, "info") == 0;
    fprintf(stderr, "tetlod: %s%s%s\n", plain ? "" : level, plain ? "" : ": ", message);
}

static void print_access(void *opaque, const char *line)
{
    (void)opaque;
    fprintf(stderr, "%s\n", line);
}

/* Sockets that systemd listens on for us (sd_listen_fds(3)): descriptors from 3 on. */
static bool take_handed_over(struct settings *settings, char names[static MAX_ADDRESSES][24])
{
    const char *pid = getenv("LISTEN_PID"), *count = getenv("LISTEN_FDS");
    if (!pid || !count || strtol(pid, NULL, 10) != (long)getpid())
        return true;
    long sockets = strtol(count, NULL, 10);
    for (long i = 0; i < sockets && i < MAX_ADDRESSES; i++) {
        snprintf(names[i], sizeof names[i], "fd:%ld", FIRST_HANDED_OVER + i);
        if (!settings_add_address(settings, names[i]))
            return false;
    }
    return true;
}

/* Tells systemd (Type=notify) where we are; without it, nothing. */
static void notify(const char *state)
{
    const char *path = getenv("NOTIFY_SOCKET");
    struct sockaddr_un name = {.sun_family = AF_UNIX};
    size_t size = path ? strlen(path) : 0;
    if (!size || size >= sizeof name.sun_path)
        return;
    memcpy(name.sun_path, path, size);
    if (path[0] == '@')
        name.sun_path[0] = 0; // an abstract name
    int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return;
    ssize_t ignored = sendto(fd, state, strlen(state), MSG_NOSIGNAL, (struct sockaddr *)&name,
                             (socklen_t)(offsetof(struct sockaddr_un, sun_path) + size));
    (void)ignored;
    close(fd);
}

/* As many descriptors as connections, the files, and what the process itself needs. */
static void raise_descriptor_limit(void)
{
    struct rlimit limit;
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0)
        return;
    limit.rlim_cur = limit.rlim_max < 1 << 20 ? limit.rlim_max : 1 << 20;
    setrlimit(RLIMIT_NOFILE, &limit);
}

/* SIGHUP: the paths are looked at, and token, CORS and hosts are read again. What cannot be read leaves all as it
 * was. */
static void reload(struct server *server, struct settings *settings)
{
    struct settings *again = malloc(sizeof *again);
    struct tetlod_error error = {0};
    const char *changed = NULL;
    server_rescan(server);
    if (!again || !settings_read_again(again, settings, &changed)) {
        print_message(&settings->quiet, "warning", "the options stay as they were");
        free(again);
        return;
    }
    if (server_reload(server, &again->server, &error) != TETLOD_OK) {
        print_message(&settings->quiet, "warning", error.message);
        print_message(&settings->quiet, "warning", "token, CORS and hosts stay as they were");
    } else if (changed) {
        char message[160];
        snprintf(message, sizeof message, "the option '%s' of the file has changed: only a restart takes it", changed);
        print_message(&settings->quiet, "warning", message);
    }
    settings_fini(again);
    free(again);
}

/* Until the server runs, SIGINT and SIGTERM end the process as they do by default: what it starts from may hang. */
static int serve(struct settings *settings)
{
    struct server *server;
    struct tetlod_error error = {0};
    sigset_t signals;
    int signal = 0;
    sigemptyset(&signals);
    sigaddset(&signals, SIGHUP);
    pthread_sigmask(SIG_BLOCK, &signals, NULL);
    raise_descriptor_limit();
    if (server_start(&server, &settings->server, &error) != TETLOD_OK)
        return cli_fail(&error);
    sigaddset(&signals, SIGINT);
    sigaddset(&signals, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &signals, NULL);
    for (size_t i = 0; server_url(server, i); i++)
        if (!settings->server.metrics || server_url(server, i + 1)) // the metrics' address, the last, is no viewer's
            printf("%s\n", server_url(server, i));
    fflush(stdout);
    notify("READY=1");
    while (sigwait(&signals, &signal) == 0 && signal == SIGHUP)
        reload(server, settings);
    notify("STOPPING=1");
    if (!server_stop(server))
        _exit(EXIT_DONE); // its threads may still work
    return EXIT_DONE;
}

static int run_with(struct settings *settings, int argc, char **argv)
{
    char handed_over[MAX_ADDRESSES][24];
    struct server_options *server = &settings->server;
    if (!settings_read(settings, argc, argv))
        return EXIT_USAGE;
    if (optind == argc)
        return cli_usage("serve", "missing operand: it takes streams, or folders of *.tetlod");
    if (!server->listen_count && !take_handed_over(settings, handed_over))
        return EXIT_USAGE;
    if (!server->listen_count)
        settings->addresses[server->listen_count++] = "127.0.0.1:8080";
    server->paths = (const char *const *)(argv + optind);
    server->path_count = (size_t)(argc - optind);
    server->log = print_message;
    server->log_opaque = &settings->quiet;
    server->access = settings->access_log ? print_access : NULL;
    return serve(settings);
}

static int run(int argc, char **argv)
{
    struct settings settings;
    int status = run_with(&settings, argc, argv);
    settings_fini(&settings);
    return status;
}

const struct command command_serve = {"serve", "serve streams over HTTP", help, run};
