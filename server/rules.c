/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/rules.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/buffer.h"
#include "src/util/file.h"

enum { MAX_ORIGIN_BYTES = 240, MAX_TOKEN = 200 };

/* "http" or "https", a host that may start with "*.", a port: nothing that could end the directive of the policy. */
static bool good_origin(const char *origin)
{
    size_t scheme = strncmp(origin, "https://", 8) == 0 ? 8 : strncmp(origin, "http://", 7) == 0 ? 7 : 0;
    const char *host = origin + scheme;
    return scheme && *host && !host[strspn(host,
                                           "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-.:[]*")];
}

enum tetlod_status rules_stream_origins(const struct server_options *options, char **out, struct tetlod_error *error)
{
    struct buffer text = {0};
    for (size_t i = 0; i < options->stream_origin_count; i++) {
        const char *origin = options->stream_origins[i];
        if (good_origin(origin) && text.size + strlen(origin) < MAX_ORIGIN_BYTES) {
            if (buffer_printf(&text, " %s", origin) == TETLOD_OK)
                continue;
            buffer_fini(&text);
            return tetlodi_fail_nomem(error, "the server", 0);
        }
        buffer_fini(&text);
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "'%.120s' is not an origin such as https://example.org (%d bytes at most for all)",
                            origin, MAX_ORIGIN_BYTES);
    }
    *out = (char *)text.bytes;
    return TETLOD_OK;
}

enum tetlod_status rules_base_path(const struct server_options *options, char **out, struct tetlod_error *error)
{
    const char *path = options->base_path;
    if (!path)
        return TETLOD_OK;
    size_t size = strlen(path);
    if (size < 2 || path[0] != '/' || path[size - 1] != '/' || strstr(path, "//") ||
        path[strspn(path, "/-._~%ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789")])
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "'%.120s' is not a base path such as /levels/", path);
    *out = strdup(path);
    return *out ? TETLOD_OK : tetlodi_fail_nomem(error, "the server", size);
}

/* The token in a file, allocated. */
static enum tetlod_status read_token(const char *path, char **out, struct tetlod_error *error)
{
    unsigned char *bytes;
    size_t size;
    TETLOD_TRY(file_read(path, &bytes, &size, error));
    while (size && strchr(" \t\r\n", bytes[size - 1]))
        size--;
    char *token = *out = array_zero(size + 1, 1);
    if (token && size)
        memcpy(token, bytes, size);
    free(bytes);
    if (!token)
        return tetlodi_fail_nomem(error, "the token", size);
    if (!size || size > MAX_TOKEN ||
        token[strspn(token, "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-._~+/=")])
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "%.400s: a token is 1 to %d letters, digits and -._~+/= in one line", path, MAX_TOKEN);
    return TETLOD_OK;
}

enum tetlod_status rules_set(struct access *access, const struct server_options *options, struct tetlod_error *error)
{
    enum tetlod_status status = TETLOD_OK;
    char *token = NULL;
    for (size_t i = 0; i < options->cors_count; i++) {
        const char *origin = options->cors[i];
        if (strcmp(origin, "*") != 0 && strcmp(origin, "none") != 0 && (!good_origin(origin) || strchr(origin, '*')))
            return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                                "'%.120s' is neither an origin such as https://example.org nor '*' nor 'none'", origin);
    }
    if (options->token_file)
        status = read_token(options->token_file, &token, error);
    const struct access_policy policy = {options->cors, options->cors_count, options->hosts, options->host_count,
                                         token};
    if (status == TETLOD_OK && !access_set(access, &policy))
        status = tetlodi_fail_nomem(error, "the server", 0);
    free(token);
    return status;
}
