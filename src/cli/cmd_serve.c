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

#include "server/server.h"
#include "src/cli/cli.h"

static const char help[] =
    "usage: tetlod serve [OPTIONS] PATH...\n"
    "\n"
    "Serves streams over HTTP: files, or every *.tetlod of a folder. Prints the viewer's URL; stops on SIGINT or SIGTERM\n"
    "after the answers in progress. It notices files that are new, replaced or gone (at once on SIGHUP).\n"
    "\n"
    "  --listen ADDR:PORT      where to listen; may be repeated (default 127.0.0.1:8080). Also [ADDR]:PORT, unix:PATH.\n"
    "                          A socket handed over by systemd (LISTEN_FDS) takes the place of the default\n"
    "  --metrics ADDR:PORT     serve /metrics there and not with the rest\n"
    "  --base-path PATH        where the site begins for its clients, such as /levels/; paths without it work as well. Not\n"
    "                          needed behind a proxy that removes the path\n"
    "  --cors ORIGIN|*|none    pages of this origin may read the answers; may be repeated (default: of all origins;\n"
    "                          of none on loopback addresses and Unix sockets)\n"
    "  --host NAME             a name that Host may have on a loopback address beside localhost, such as a proxy's; may be\n"
    "                          repeated; * allows any\n"
    "  --token FILE            answer only clients that send the file's content: ?token=TOKEN once in a browser, or a header\n"
    "                          Authorization: Bearer TOKEN. /healthz, /readyz and the address of --metrics ask for none\n"
    "  --stream-origin ORIGIN  the page may also load streams from there, such as https://data.example.org; may be repeated\n"
    "                          (default: from this server alone)\n"
    "  --threads N             HTTP threads; as many make meshes, and as many decode (default: one per core)\n"
    "  --cache BYTES           memory for finished answers (default 256M)\n"
    "  --memory BYTES          memory for decoded streams, and for surfaces that are too large for the cache: unused\n"
    "                          ones are dropped first (default: half of the machine's)\n"
    "  --connections N         at a time (default 4096, or what three quarters of the descriptors allow)\n"
    "  --per-address N         connections of one address at a time (default: no limit; not behind a proxy)\n"
    "  --header-bytes BYTES    request line and headers of a request (default 8K)\n"
    "  --timeout SECONDS       for a request to arrive, and for a reader that stalls (default 30)\n"
    "  --drain SECONDS         for answers in progress when stopping (default 10)\n"
    "  --scan SECONDS          between looks at the paths (default 2)\n"
    "  --keep-replaced SECONDS how long a replaced stream's URLs stay after their last use (default 60)\n"
    "  --access-log            write a JSON line for each answer to standard error\n"
    "  --quiet                 no messages but errors\n"
    "\n"
    "It speaks HTTP/1.1 without TLS; server/deploy shows how to put nginx or Varnish in front.\n";

enum { MOST_ADDRESSES = 15, MOST_ORIGINS = 16, FIRST_HANDED_OVER = 3 };

struct settings {
    struct server_options server;
    const char *addresses[MOST_ADDRESSES], *origins[MOST_ORIGINS], *cors[MOST_ORIGINS], *hosts[MOST_ORIGINS];
    char handed_over[MOST_ADDRESSES][24];
    bool access_log;
};

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

static bool take_seconds(const char *name, const char *text, double *out)
{
    return cli_parse_number(&command_serve, name, text, 1e-3, out);
}

static bool take_count(const char *name, const char *text, uint64_t least, uint64_t most, uint64_t *out)
{
    return cli_parse_count(&command_serve, name, text, least, most, out);
}

static bool take_address(struct settings *settings, const char *address)
{
    if (settings->server.listen_count == MOST_ADDRESSES) {
        cli_usage("serve", "--listen may be given %d times at most", MOST_ADDRESSES);
        return false;
    }
    settings->addresses[settings->server.listen_count++] = address;
    return true;
}

static bool add_text(const char *name, const char **list, size_t *count, const char *value)
{
    if (*count == MOST_ORIGINS) {
        cli_usage("serve", "--%s may be given %d times at most", name, MOST_ORIGINS);
        return false;
    }
    list[(*count)++] = value;
    return true;
}

static bool take_option(struct settings *settings, int option, const char *value)
{
    struct server_options *server = &settings->server;
    uint64_t count = 0;
    bool taken = true;
    switch (option) {
    case 'l':
        return take_address(settings, value);
    case 'o':
        return add_text("stream-origin", settings->origins, &server->stream_origin_count, value);
    case 'C':
        return add_text("cors", settings->cors, &server->cors_count, value);
    case 'H':
        return add_text("host", settings->hosts, &server->host_count, value);
    case 'K':
        server->token_file = value;
        return true;
    case 'B':
        server->base_path = value;
        return true;
    case 'm':
        server->metrics = value;
        return true;
    case 't':
        taken = take_count("threads", value, 0, 256, &count);
        server->threads = (unsigned)count;
        return taken;
    case 'c':
        return take_count("cache", value, 1 << 20, (uint64_t)1 << 50, &server->cache_bytes);
    case 'M':
        return take_count("memory", value, 1 << 20, (uint64_t)1 << 50, &server->memory_bytes);
    case 'n':
        taken = take_count("connections", value, 1, 1000000, &count);
        server->connections = (size_t)count;
        return taken;
    case 'a':
        taken = take_count("per-address", value, 0, 1000000, &count);
        server->connections_per_address = (size_t)count;
        return taken;
    case 'b':
        taken = take_count("header-bytes", value, 1024, (uint64_t)1 << 33, &count);
        server->header_bytes = (size_t)count;
        return taken;
    case 'T':
        return take_seconds("timeout", value, &server->idle_seconds);
    case 'd':
        return take_seconds("drain", value, &server->drain_seconds);
    case 's':
        return take_seconds("scan", value, &server->scan_seconds);
    case 'k':
        return take_seconds("keep-replaced", value, &server->keep_replaced);
    case 'A':
        settings->access_log = true;
        return true;
    case 'q':
        return true;
    default:
        return false;
    }
}

/* Sockets that systemd listens on for us (sd_listen_fds(3)): descriptors from 3 on. */
static bool take_handed_over(struct settings *settings)
{
    const char *pid = getenv("LISTEN_PID"), *count = getenv("LISTEN_FDS");
    if (!pid || !count || strtol(pid, NULL, 10) != (long)getpid())
        return true;
    long sockets = strtol(count, NULL, 10);
    for (long i = 0; i < sockets && i < MOST_ADDRESSES; i++) {
        snprintf(settings->handed_over[i], sizeof settings->handed_over[i], "fd:%ld", FIRST_HANDED_OVER + i);
        if (!take_address(settings, settings->handed_over[i]))
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

static int serve(const struct settings *settings)
{
    struct server *server;
    struct tetlod_error error = {0};
    sigset_t signals;
    int signal = 0;
    sigemptyset(&signals);
    sigaddset(&signals, SIGINT);
    sigaddset(&signals, SIGTERM);
    sigaddset(&signals, SIGHUP);
    pthread_sigmask(SIG_BLOCK, &signals, NULL);
    raise_descriptor_limit();
    if (server_start(&server, &settings->server, &error) != TETLOD_OK)
        return cli_fail(&error);
    for (size_t i = 0; server_url(server, i); i++)
        if (!settings->server.metrics || server_url(server, i + 1)) // the metrics' address, the last, is no viewer's
            printf("%s\n", server_url(server, i));
    fflush(stdout);
    notify("READY=1");
    while (sigwait(&signals, &signal) == 0 && signal == SIGHUP)
        server_rescan(server);
    notify("STOPPING=1");
    server_stop(server);
    return EXIT_DONE;
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {
        {"listen", required_argument, NULL, 'l'},       {"metrics", required_argument, NULL, 'm'},
        {"stream-origin", required_argument, NULL, 'o'}, {"base-path", required_argument, NULL, 'B'},
        {"memory", required_argument, NULL, 'M'},       {"cors", required_argument, NULL, 'C'},         {"host", required_argument, NULL, 'H'},
        {"token", required_argument, NULL, 'K'},
        {"threads", required_argument, NULL, 't'},      {"cache", required_argument, NULL, 'c'},
        {"connections", required_argument, NULL, 'n'},  {"per-address", required_argument, NULL, 'a'},
        {"header-bytes", required_argument, NULL, 'b'}, {"timeout", required_argument, NULL, 'T'},
        {"drain", required_argument, NULL, 'd'},        {"scan", required_argument, NULL, 's'},
        {"keep-replaced", required_argument, NULL, 'k'}, {"access-log", no_argument, NULL, 'A'},
        {"quiet", no_argument, NULL, 'q'},              {0},
    };
    struct settings settings = {0};
    bool quiet = false;
    int option;
    while ((option = cli_option(&command_serve, argc, argv, "", options)) != -1) {
        if (!take_option(&settings, option, optarg))
            return EXIT_USAGE;
        quiet |= option == 'q';
    }
    if (optind == argc)
        return cli_usage("serve", "missing operand: it takes streams, or folders of *.tetlod");
    if (!settings.server.listen_count && !take_handed_over(&settings))
        return EXIT_USAGE;
    if (!settings.server.listen_count)
        settings.addresses[settings.server.listen_count++] = "127.0.0.1:8080";
    settings.server.listen = settings.addresses;
    settings.server.stream_origins = settings.origins;
    settings.server.cors = settings.cors;
    settings.server.hosts = settings.hosts;
    settings.server.paths = (const char *const *)(argv + optind);
    settings.server.path_count = (size_t)(argc - optind);
    settings.server.log = print_message;
    settings.server.log_opaque = &quiet;
    settings.server.access = settings.access_log ? print_access : NULL;
    return serve(&settings);
}

const struct command command_serve = {"serve", "serve streams over HTTP", help, run};
