/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/answer/access.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

enum { TOKEN_CAPACITY = 256 };

static const char cookie_name[] = "tetlod_token=";

/* ---- Host ---- */

static bool is_local_name(const char *name, size_t size)
{
    static const char localhost[] = "localhost";
    size_t known = sizeof localhost - 1;
    if (size >= known && strncasecmp(name + size - known, localhost, known) == 0)
        return size == known || name[size - known - 1] == '.';
    return (size == 5 && memcmp(name, "[::1]", 5) == 0) || (size > 4 && strncmp(name, "127.", 4) == 0 && strspn(name, "0123456789.") >= size);
}

static bool host_allowed(const struct access_policy *policy, const char *host)
{
    size_t size = host[0] == '[' ? strcspn(host, "]") + 1 : strcspn(host, ":");
    if (size > strlen(host))
        return false;
    for (size_t i = 0; i < policy->host_count; i++)
        if (strcmp(policy->hosts[i], "*") == 0 || (strlen(policy->hosts[i]) == size && strncasecmp(policy->hosts[i], host, size) == 0))
            return true;
    return is_local_name(host, size);
}

/* ---- the token ---- */

/* Compares in a time that does not tell how much is right. */
static bool is_token(const char *token, const char *text, size_t size)
{
    unsigned char differ = strlen(token) != size;
    for (size_t i = 0; i < size; i++)
        differ |= (unsigned char)(token[differ ? 0 : i] ^ text[i]);
    return !differ;
}

static bool has_bearer(const struct request *request, const char *token)
{
    const char *value = request_header(request, "Authorization");
    if (!value || strncasecmp(value, "Bearer ", 7) != 0)
        return false;
    value += 7 + strspn(value + 7, " ");
    return is_token(token, value, strcspn(value, " \t"));
}

static bool has_cookie(const struct request *request, const char *token)
{
    const char *at = request_header(request, "Cookie");
    while (at && *at) {
        at += strspn(at, " \t;");
        size_t size = strcspn(at, ";");
        if (size >= sizeof cookie_name - 1 && strncmp(at, cookie_name, sizeof cookie_name - 1) == 0 &&
            is_token(token, at + sizeof cookie_name - 1, size - (sizeof cookie_name - 1)))
            return true;
        at += size;
    }
    return false;
}

/* The way in for browsers: ?token=... becomes a cookie, and leaves the address. */
static void answer_with_cookie(struct exchange *exchange, const char *target)
{
    const struct site *site = exchange->site;
    char to[HEADER_TEXT / 2];
    size_t path = strcspn(target, "?"), start = path, used;
    while (start && target[start - 1] != '/')
        start--;
    used = (size_t)snprintf(to, sizeof to, "./%.*s", (int)(path - start), target + start);
    char separator = '?';
    for (const char *at = target + path; *at;) {
        at++; // '?' or '&'
        size_t size = strcspn(at, "&");
        if (size && !query_begins_with(at, "token") && used < sizeof to) {
            used += (size_t)snprintf(to + used, sizeof to - used, "%c%.*s", separator, (int)size, at);
            separator = '&';
        }
        at += size;
    }
    if (used >= sizeof to)
        snprintf(to, sizeof to, "./");
    response_static(exchange->response, 303, "text/plain; charset=utf-8", "Go on at the address of the Location header.\n");
    response_header_text(exchange->response, "Location", to);
    response_header(exchange->response, "Set-Cookie", "%s%s; Path=%s; HttpOnly; SameSite=Lax", cookie_name, site->access.token,
                    site->base_path ? site->base_path : "/");
    response_header_text(exchange->response, "Cache-Control", "no-store");
}

static bool token_allows(struct exchange *exchange, const char *path)
{
    const char *token = exchange->site->access.token, *query = strchr(path, '?');
    const struct request *request = exchange->request;
    char given[TOKEN_CAPACITY];
    size_t size = strcspn(path, "?");
    if (!token || (size == 8 && strncmp(path, "/healthz", 8) == 0) || (size == 7 && strncmp(path, "/readyz", 7) == 0))
        return true;
    if (query_value(query ? query + 1 : NULL, "token", given, sizeof given) == QUERY_FOUND && is_token(token, given, strlen(given))) {
        answer_with_cookie(exchange, path);
        return false;
    }
    if (request->method == METHOD_OPTIONS || has_bearer(request, token) || has_cookie(request, token))
        return true;
    response_problem(exchange->response, 401, request->target,
                     "this server asks for its token: open ./?token=TOKEN in a browser, or send Authorization: Bearer TOKEN");
    response_header_text(exchange->response, "WWW-Authenticate", "Bearer");
    return false;
}

bool access_allows(struct exchange *exchange, const char *path)
{
    const struct access_policy *policy = &exchange->site->access;
    const char *host = request_header(exchange->request, "Host");
    if (exchange->request->loopback && !policy->token && host && !host_allowed(policy, host)) {
        response_problem(exchange->response, 421, exchange->request->target,
                         "on this machine's own address the server answers to localhost, not to '%.80s'; --host NAME allows another name",
                         host);
        return false;
    }
    return token_allows(exchange, path);
}

/* ---- CORS ---- */

/* The origin that may read the answer, or NULL. */
static const char *allowed_origin(const struct access_policy *policy, const struct request *request)
{
    const char *origin = request_header(request, "Origin");
    if (!policy->origin_count)
        return request->loopback || request->local ? NULL : "*";
    for (size_t i = 0; i < policy->origin_count; i++)
        if (strcmp(policy->origins[i], "*") == 0)
            return "*";
        else if (origin && strcasecmp(policy->origins[i], origin) == 0)
            return policy->origins[i];
    return NULL;
}

void access_headers(const struct site *site, const struct request *request, struct response *response)
{
    const char *origin = allowed_origin(&site->access, request);
    response_header_text(response, "Cross-Origin-Resource-Policy", origin ? "cross-origin" : "same-origin");
    if (site->access.origin_count && !(origin && strcmp(origin, "*") == 0))
        response_vary(response, "Origin");
    if (!origin)
        return;
    response_header_text(response, "Access-Control-Allow-Origin", origin);
    response_header_text(response, "Timing-Allow-Origin", origin);
    if (request->method == METHOD_OPTIONS) {
        response_header_text(response, "Access-Control-Allow-Methods", "GET, HEAD, OPTIONS");
        response_header_text(response, "Access-Control-Allow-Headers",
                             "Range, If-Range, If-None-Match, If-Modified-Since, Accept-Encoding, Authorization");
        response_header_text(response, "Access-Control-Max-Age", "86400");
    } else
        response_header_text(response, "Access-Control-Expose-Headers",
                             "ETag, Content-Range, Content-Length, Content-Encoding, Accept-Ranges, Location, Retry-After, Server-Timing, "
                             "Tetlod-Level, Tetlod-Vertices, Tetlod-Tets, Tetlod-Error, Tetlod-Uncontrolled, Tetlod-Band, Tetlod-Step, Tetlod-Topology, "
                             "Tetlod-Time, Tetlod-Box-Level, Tetlod-Box-Error, Tetlod-Transition-Tets, Tetlod-Transition-Error, X-Request-Id");
}
