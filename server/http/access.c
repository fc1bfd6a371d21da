/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/http/access.h"

#include <ctype.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "server/http/params.h"
#include "src/util/clock.h"
#include "src/util/hash.h"

enum { TOKEN_CAPACITY = 256, COOKIE_NAME = 32 };

/* ---- Host ---- */

static bool is_local_name(const char *name, size_t size)
{
    static const char localhost[] = "localhost";
    size_t known = sizeof localhost - 1;
    if (size >= known && strncasecmp(name + size - known, localhost, known) == 0)
        return size == known || name[size - known - 1] == '.';
    return (size == 5 && memcmp(name, "[::1]", 5) == 0) || (size > 4 && strncmp(name, "127.", 4) == 0 &&
                                                            strspn(name, "0123456789.") >= size);
}

static bool host_allowed(const struct access_policy *policy, const char *host)
{
    size_t size = host[0] == '[' ? strcspn(host, "]") + 1 : strcspn(host, ":");
    if (size > strlen(host))
        return false;
    for (size_t i = 0; i < policy->host_count; i++)
        if (strcmp(policy->hosts[i], "*") == 0 ||
            (strlen(policy->hosts[i]) == size && strncasecmp(policy->hosts[i], host, size) == 0))
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

/* What came of the tokens that a request brings: each place where one may be can only raise it. */
enum token { TOKEN_NONE, TOKEN_WRONG, TOKEN_RIGHT };

static enum token compare_token(const char *token, const char *text, size_t size)
{
    return is_token(token, text, size) ? TOKEN_RIGHT : TOKEN_WRONG;
}

static enum token bearer_token(const struct request *request, const char *token)
{
    const char *value = request_header(request, "Authorization");
    if (!value || strncasecmp(value, "Bearer ", 7) != 0)
        return TOKEN_NONE;
    value += 7 + strspn(value + 7, " ");
    return compare_token(token, value, strcspn(value, " \t"));
}

/* Browsers keep cookies by host, whatever the port and, within its path, the site: the name tells servers apart by what
 * the browser calls them and by the base path. (By neither port nor token: servers behind one proxy take each
 * other's.) */
static void print_cookie_name(const struct exchange *exchange, char out[static COOKIE_NAME])
{
    const char *parts[] = {request_header(exchange->request, "Host"), exchange->site->base_path};
    uint64_t hash = HASH_START;
    for (size_t i = 0; i < 2; i++)
        for (const char *c = parts[i] ? parts[i] : ""; *c; c++)
            hash = hash_byte(hash, (unsigned char)tolower((unsigned char)*c));
    snprintf(out, COOKIE_NAME, "tetlod_token_%08" PRIx32 "=", hash_folded(hash));
}

static enum token cookie_token(const struct exchange *exchange, const char *token)
{
    const char *at = request_header(exchange->request, "Cookie");
    enum token best = TOKEN_NONE;
    char name[COOKIE_NAME];
    print_cookie_name(exchange, name);
    while (at && *at) {
        at += strspn(at, " \t;");
        size_t size = strcspn(at, ";"), named = strlen(name);
        if (size >= named && strncmp(at, name, named) == 0) {
            enum token one = compare_token(token, at + named, size - named);
            best = one > best ? one : best;
        }
        at += size;
    }
    return best;
}

static enum token query_token(const char *query, const char *token)
{
    char given[TOKEN_CAPACITY];
    switch (query_value(query, "token", given, sizeof given)) {
    case QUERY_FOUND:
        return compare_token(token, given, strlen(given));
    case QUERY_BAD:
        return TOKEN_WRONG;
    default:
        return TOKEN_NONE;
    }
}

/* Where a browser finds the site: below the base path where there is one, from where the request went otherwise, for a
 * proxy may have taken off the front of its path. */
static size_t print_place(const struct site *site, const char *path, size_t size, char *out, size_t capacity)
{
    size_t start = size, base = site->base_path ? strlen(site->base_path) - 1 : 0;
    if (base && size == base && strncmp(path, site->base_path, base) == 0)
        return (size_t)snprintf(out, capacity, "%s", site->base_path);
    if (base)
        return (size_t)snprintf(out, capacity, "%.*s%.*s", (int)base, site->base_path, (int)size, path);
    while (start && path[start - 1] != '/')
        start--;
    return (size_t)snprintf(out, capacity, "./%.*s", (int)(size - start), path + start);
}

/* The way in for browsers: ?token=... becomes a cookie, and leaves the address. */
static void answer_with_cookie(struct exchange *exchange, const char *target)
{
    const struct site *site = exchange->site;
    char to[HEADER_TEXT / 2], name[COOKIE_NAME];
    size_t path = strcspn(target, "?"), used = print_place(site, target, path, to, sizeof to);
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
    print_cookie_name(exchange, name);
    response_static(exchange->response, 303, "text/plain; charset=utf-8",
                    "Go on at the address of the Location header.\n");
    response_header_text(exchange->response, "Location", to);
    response_header(exchange->response, "Set-Cookie", "%s%s; Path=%s; HttpOnly; SameSite=Lax%s", name,
                    exchange->policy->token,
                    site->base_path ? site->base_path : "/", site->secure_cookie ? "; Secure" : "");
    response_header_text(exchange->response, "Cache-Control", "no-store");
}

static void answer_unauthorized(struct exchange *exchange)
{
    response_problem(exchange->response, 401, exchange->request->target,
                     "this server asks for its token: open ./?token=TOKEN in a browser, or send Authorization: Bearer "
                     "TOKEN");
    response_header_text(exchange->response, "WWW-Authenticate", "Bearer");
}

/* A wrong token is counted, and its answer waits. Without a waiter (a request of the same process) it does not. */
static enum admission delay_guess(struct exchange *exchange)
{
    struct request *request = exchange->request;
    struct guesses *guesses = exchange->site->guesses;
    metrics_count(exchange->site->metrics, METRIC_WRONG_TOKENS);
    request->guessed = true;
    if (guesses && request->waiter && request->client) {
        guesses_add(guesses, &request->guess, request->client, request->waiter, monotonic_seconds());
        return ACCESS_WAITS;
    }
    answer_unauthorized(exchange);
    return ACCESS_ANSWERED;
}

/* Too many wrong tokens of this client wait for their answers: whether this one is right is not said before. */
static bool is_held_up(struct exchange *exchange)
{
    struct guesses *guesses = exchange->site->guesses;
    if (!guesses || !exchange->request->client || guesses_admit(guesses, exchange->request->client))
        return false;
    response_problem(exchange->response, 429, exchange->request->target,
                     "too many wrong tokens came from this address; try later");
    return true;
}

static enum admission check_token(struct exchange *exchange, const char *path)
{
    const char *token = exchange->policy->token, *query = strchr(path, '?');
    struct request *request = exchange->request;
    size_t size = strcspn(path, "?");
    if (!token || exchange->site->only_health || request->method == METHOD_OPTIONS || // preflights carry no token
        (size == 8 && strncmp(path, "/healthz", 8) == 0) || (size == 7 && strncmp(path, "/readyz", 7) == 0))
        return ACCESS_GRANTED;
    enum token in_query = query_token(query ? query + 1 : NULL, token);
    enum token bearer = bearer_token(request, token), cookie = cookie_token(exchange, token);
    if (request->guessed || (!in_query && !bearer && !cookie)) { // its time is over, or it tried none
        answer_unauthorized(exchange);
        return ACCESS_ANSWERED;
    }
    if (is_held_up(exchange))
        return ACCESS_ANSWERED;
    if (in_query != TOKEN_RIGHT)
        return bearer == TOKEN_RIGHT || cookie == TOKEN_RIGHT ? ACCESS_GRANTED : delay_guess(exchange);
    answer_with_cookie(exchange, path);
    return ACCESS_ANSWERED;
}

enum admission access_check(struct exchange *exchange, const char *path)
{
    const struct access_policy *policy = exchange->policy;
    const char *host = request_header(exchange->request, "Host");
    if (exchange->request->loopback && !policy->token && host && !host_allowed(policy, host)) {
        response_problem(exchange->response, 421, exchange->request->target,
                         "on this machine's own address the server answers to localhost, not to '%.80s'; --host NAME "
                         "allows another name",
                         host);
        return ACCESS_ANSWERED;
    }
    return check_token(exchange, path);
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

void access_headers(const struct access_policy *policy, const struct request *request, struct response *response)
{
    const char *origin = allowed_origin(policy, request);
    response_header_text(response, "Cross-Origin-Resource-Policy", origin ? "cross-origin" : "same-origin");
    if (policy->origin_count && !(origin && strcmp(origin, "*") == 0))
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
                             "ETag, Content-Range, Content-Length, Content-Encoding, Accept-Ranges, Location, "
                             "Retry-After, Server-Timing, "
                             "Tetlod-Level, Tetlod-Vertices, Tetlod-Tets, Tetlod-Error, Tetlod-Uncontrolled, "
                             "Tetlod-Band, Tetlod-Step, Tetlod-Topology, "
                             "Tetlod-Time, Tetlod-Box-Level, Tetlod-Box-Error, Tetlod-Transition-Tets, "
                             "Tetlod-Transition-Error, X-Request-Id");
}
