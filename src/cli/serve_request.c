/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/serve_request.h"

#include <stdlib.h>
#include <string.h>

#include "src/cli/cli.h"
#include "src/util/file.h"

static const struct option options[] = {
    {"listen", required_argument, NULL, 'l'},        {"metrics", required_argument, NULL, 'm'},
    {"stream-origin", required_argument, NULL, 'o'}, {"base-path", required_argument, NULL, 'B'},
    {"memory", required_argument, NULL, 'M'},        {"cors", required_argument, NULL, 'C'},
    {"host", required_argument, NULL, 'H'},          {"token", required_argument, NULL, 'K'},
    {"secure-cookie", no_argument, NULL, 'S'},       {"trust-proxy", required_argument, NULL, 'P'},
    {"threads", required_argument, NULL, 't'},       {"cache", required_argument, NULL, 'c'},
    {"connections", required_argument, NULL, 'n'},   {"per-address", required_argument, NULL, 'a'},
    {"jobs", required_argument, NULL, 'j'},          {"header-bytes", required_argument, NULL, 'b'},
    {"timeout", required_argument, NULL, 'T'},       {"drain", required_argument, NULL, 'd'},
    {"grace", required_argument, NULL, 'g'},         {"scan", required_argument, NULL, 's'},
    {"keep-replaced", required_argument, NULL, 'k'}, {"socket-mode", required_argument, NULL, 'u'},
    {"access-log", no_argument, NULL, 'A'},          {"quiet", no_argument, NULL, 'q'},
    {"config", required_argument, NULL, 'f'},        {0},
};

static const char reloaded[] = "KCH"; // taken from the file again while the server runs

static bool take_seconds(const char *name, const char *text, double *out)
{
    return cli_parse_number(&command_serve, name, text, 1e-3, out);
}

static bool take_count(const char *name, const char *text, uint64_t least, uint64_t most, uint64_t *out)
{
    return cli_parse_count(&command_serve, name, text, least, most, out);
}

bool settings_add_address(struct settings *settings, const char *address)
{
    if (settings->server.listen_count == MAX_ADDRESSES) {
        cli_usage("serve", "--listen may be given %d times at most", MAX_ADDRESSES);
        return false;
    }
    settings->addresses[settings->server.listen_count++] = address;
    return true;
}

static bool add_text(const char *name, const char **list, size_t *count, const char *value)
{
    if (*count == MAX_LISTED) {
        cli_usage("serve", "--%s may be given %d times at most", name, MAX_LISTED);
        return false;
    }
    list[(*count)++] = value;
    return true;
}

static bool take_mode(const char *text, unsigned *out)
{
    char *end;
    unsigned long mode = strtoul(text, &end, 8);
    if (text[0] < '0' || text[0] > '7' || *end || !mode || mode > 0777) {
        cli_usage("serve", "--socket-mode takes three octal digits such as 660, not '%s'", text);
        return false;
    }
    *out = (unsigned)mode;
    return true;
}

/* Options that are numbers. */
static bool take_number(struct server_options *server, int option, const char *value)
{
    uint64_t count = 0;
    bool taken = true;
    switch (option) {
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
    case 'j':
        taken = take_count("jobs", value, 1, 1000000, &count);
        server->jobs_per_client = (size_t)count;
        return taken;
    case 'b':
        taken = take_count("header-bytes", value, 1024, (uint64_t)1 << 33, &count);
        server->header_bytes = (size_t)count;
        return taken;
    case 'T':
        return take_seconds("timeout", value, &server->idle_seconds);
    case 'd':
        return take_seconds("drain", value, &server->drain_seconds);
    case 'g':
        return cli_parse_number(&command_serve, "grace", value, 0, &server->grace_seconds);
    case 's':
        return take_seconds("scan", value, &server->scan_seconds);
    case 'k':
        return take_seconds("keep-replaced", value, &server->keep_replaced);
    default:
        return false;
    }
}

static bool take_option(struct settings *settings, int option, const char *value)
{
    struct server_options *server = &settings->server;
    switch (option) {
    case 'l':
        return settings_add_address(settings, value);
    case 'o':
        return add_text("stream-origin", settings->origins, &server->stream_origin_count, value);
    case 'C':
        return add_text("cors", settings->cors, &server->cors_count, value);
    case 'H':
        return add_text("host", settings->hosts, &server->host_count, value);
    case 'P':
        return add_text("trust-proxy", settings->proxies, &server->proxy_count, value);
    case 'K':
        server->token_file = value;
        return true;
    case 'S':
        server->secure_cookie = true;
        return true;
    case 'B':
        server->base_path = value;
        return true;
    case 'm':
        server->metrics = value;
        return true;
    case 'u':
        return take_mode(value, &server->socket_mode);
    case 'A':
        settings->access_log = true;
        return true;
    case 'q':
        settings->quiet = true;
        return true;
    default:
        return take_number(server, option, value);
    }
}

/* ---- the file: in each line an option without its dashes, and its value ---- */

static bool fail_line(const struct settings *settings, size_t line, const char *why)
{
    cli_usage("serve", "%s, line %zu: %s", settings->path, line, why);
    return false;
}

static bool read_line(struct settings *settings, char *line, size_t number)
{
    line += strspn(line, " \t");
    size_t size = strlen(line), name = strcspn(line, " \t=");
    while (size && strchr(" \t\r", line[size - 1]))
        line[--size] = 0;
    if (!size || *line == '#')
        return true;
    char *value = line + name + strspn(line + name, " \t=");
    line[name] = 0;
    const struct option *option = options;
    while (option->name && strcmp(option->name, line) != 0)
        option++;
    if (!option->name || option->val == 'f')
        return fail_line(settings, number, "there is no such option");
    if ((option->has_arg == required_argument) != (*value != 0))
        return fail_line(settings, number, *value ? "this option takes no value" : "this option needs a value");
    if (settings->file_count == MAX_GIVEN)
        return fail_line(settings, number, "these are too many lines");
    settings->file[settings->file_count++] = (struct given){option->val, *value ? value : NULL};
    return true;
}

static bool read_file(struct settings *settings)
{
    struct tetlod_error error = {0};
    unsigned char *bytes;
    size_t size;
    if (!settings->path)
        return true;
    if (file_read(settings->path, &bytes, &size, &error) != TETLOD_OK) {
        cli_fail(&error);
        return false;
    }
    char *text = settings->text = malloc(size + 1);
    if (text) {
        memcpy(text, bytes, size);
        text[size] = 0;
    }
    free(bytes);
    for (size_t number = 1; text; number++) {
        char *end = strchr(text, '\n');
        if (end)
            *end++ = 0;
        if (!read_line(settings, text, number))
            return false;
        text = end;
    }
    return settings->text != NULL;
}

/* Puts everything in its place, the file's options first: of an option that counts once the command line has the last
 * word. */
static bool apply(struct settings *settings)
{
    struct server_options *server = &settings->server;
    for (size_t i = 0; i < settings->file_count; i++)
        if (!take_option(settings, settings->file[i].option, settings->file[i].value))
            return false;
    for (size_t i = 0; i < settings->line_count; i++)
        if (!take_option(settings, settings->line[i].option, settings->line[i].value))
            return false;
    server->listen = settings->addresses;
    server->stream_origins = settings->origins;
    server->cors = settings->cors;
    server->hosts = settings->hosts;
    server->proxies = settings->proxies;
    return true;
}

bool settings_read(struct settings *out, int argc, char **argv)
{
    int option;
    *out = (struct settings){0};
    while ((option = cli_option(&command_serve, argc, argv, "", options)) != -1) {
        if (option == '?')
            return false;
        if (option == 'f') {
            out->path = optarg;
            continue;
        }
        if (out->line_count == MAX_GIVEN) {
            cli_usage("serve", "at most %d options may be given", MAX_GIVEN);
            return false;
        }
        out->line[out->line_count++] = (struct given){option, optarg};
    }
    return read_file(out) && apply(out);
}

static bool same(const struct given *a, const struct given *b)
{
    return a->option == b->option && (a->value == b->value ||
                                      (a->value && b->value && strcmp(a->value, b->value) == 0));
}

/* An option in the file of `a` that only a restart takes, and that the file of `b` does not have; NULL if there is
 * none. */
static const char *find_change(const struct settings *a, const struct settings *b)
{
    for (size_t i = 0; i < a->file_count; i++) {
        bool found = strchr(reloaded, a->file[i].option) != NULL;
        for (size_t j = 0; j < b->file_count; j++)
            found |= same(&a->file[i], &b->file[j]);
        const struct option *option = options;
        while (option->val != a->file[i].option)
            option++;
        if (!found)
            return option->name;
    }
    return NULL;
}

bool settings_read_again(struct settings *out, const struct settings *before, const char **changed)
{
    *out = (struct settings){.path = before->path, .line_count = before->line_count};
    memcpy(out->line, before->line, sizeof before->line);
    if (!read_file(out) || !apply(out)) {
        settings_fini(out);
        return false;
    }
    *changed = find_change(out, before);
    *changed = *changed ? *changed : find_change(before, out);
    return true;
}

void settings_fini(struct settings *settings)
{
    free(settings->text);
    settings->text = NULL;
}
