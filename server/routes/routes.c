/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/routes/routes.h"

#include <jansson.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "server/http/access.h"
#include "server/http/conditions.h"
#include "server/http/params.h"
#include "server/http/respond.h"
#include "server/routes/handlers.h"
#include "server/routes/viewer.h"
#include "src/util/buffer.h"

#define ROUTE(template, handle, health, parameters, answer, operation, summary)                               \
    {template, handle, parameters, health, false},
#define MADE(what, handle, parameters, answer, at_level, level_summary, at_step, step_summary)                    \
    {"/v1/meshes/{id}/{cid}/levels/{level}/" what ".{format}", handle, parameters, false, false},                 \
    {"/v1/meshes/{id}/{cid}/bands/{band}/steps/{step}/" what ".{format}", handle, parameters, false, true},

const struct route site_routes[] = {
#include "server/routes/routes.def"
    {NULL, NULL, NULL, false, false},
};

static const char page_route[] = "/"; // the page and the files that it loads

static const char allow[] = "GET, HEAD, OPTIONS";

/* Matches a path, not decoded, with a template. Captures are decoded afterwards, so that an encoded '/' or '.' is
 * data. */
static bool match(const char *template, const char *path, size_t size, char captures[CAPTURES][CAPTURE_CAPACITY])
{
    const char *end = path + size;
    struct {
        const char *start;
        size_t size;
    } found[CAPTURES];
    size_t count = 0;
    while (*template) {
        if (*template != '{') {
            if (path == end || *path++ != *template++)
                return false;
            continue;
        }
        template = strchr(template, '}') + 1;
        const char *start = path;
        while (path < end && *path != '/' && (!*template || *path != *template))
            path++;
        if (path == start)
            return false;
        found[count].start = start;
        found[count++].size = (size_t)(path - start);
    }
    bool matches = path == end; // the paths of most templates do not: nothing is decoded for these
    for (size_t i = 0; matches && i < count; i++)
        matches = percent_decode(found[i].start, found[i].size, captures[i], CAPTURE_CAPACITY);
    return matches;
}

/* The path of a request target: absolute form ("http://host/path", which RFC 9112 obliges servers to take) loses its
 * front. NULL: it has none; what begins with neither '/' nor a scheme is no path, and what has control characters is to
 * reach no Location. */
static const char *path_of(const char *target)
{
    for (const char *c = target; *c; c++)
        if ((unsigned char)*c < 0x20 || *c == 0x7f)
            return NULL;
    if (target[0] == '/')
        return target;
    if (strncasecmp(target, "http://", 7) != 0 && strncasecmp(target, "https://", 8) != 0)
        return NULL;
    const char *authority = strstr(target, "//") + 2;
    size_t size = strcspn(authority, "/?");
    return authority[size] == '/' ? authority + size : "/";
}

/* A path below the base path, with its '/'. A proxy may have taken the base off: then it is there already. */
static const char *below_base(const struct site *site, const char *path)
{
    size_t size = site->base_path ? strlen(site->base_path) - 1 : 0; // without its last '/'
    return strncmp(path, site->base_path ? site->base_path : "", size) == 0 && path[size] == '/' ? path + size : path;
}

/* Whether the path is the base path without its last '/': links of the page would lead elsewhere. */
static bool is_bare_base(const struct site *site, const char *path, size_t size)
{
    size_t base = site->base_path ? strlen(site->base_path) - 1 : 0;
    return base && size == base && strncmp(path, site->base_path, base) == 0;
}

/* Redirects to the base path with its last '/', by a relative reference. */
static enum outcome answer_bare_base(struct exchange *exchange, const char *path, size_t size)
{
    const char *slash = path + size;
    while (slash[-1] != '/')
        slash--;
    response_static(exchange->response, 308, "text/plain; charset=utf-8",
                    "The site is at the address of the Location header.\n");
    response_header(exchange->response, "Location", "%.*s/", (int)(path + size - slash), slash);
    return ANSWERED;
}

static enum outcome answer_only_health(struct exchange *exchange)
{
    response_problem(exchange->response, 404, exchange->request->target,
                     "this address answers /metrics, /healthz and /readyz alone");
    return ANSWERED;
}

/* Calls the handler; meanwhile the stream that the template names is held. */
static enum outcome call_handler(struct exchange *exchange, const struct route *route)
{
    static const char of_stream[] = "/v1/meshes/{id}", of_content[] = "/v1/meshes/{id}/{cid}/";
    if (strncmp(route->template, of_stream, sizeof of_stream - 1) != 0)
        return route->handle(exchange);
    bool has_cid = strncmp(route->template, of_content, sizeof of_content - 1) == 0;
    exchange->dataset = has_cid ? captured_dataset(exchange) : named_dataset(exchange);
    enum outcome outcome = exchange->dataset ? route->handle(exchange) : ANSWERED;
    dataset_release(exchange->dataset);
    return outcome;
}

static enum outcome dispatch(struct exchange *exchange, const char *target)
{
    struct response *response = exchange->response;
    const char *path = below_base(exchange->site, target);
    size_t size = strcspn(path, "?");
    exchange->path = path;
    exchange->query = path[size] ? path + size + 1 : NULL;
    for (const struct route *route = site_routes; route->template; route++)
        if (match(route->template, path, size, exchange->captures)) {
            response->route = route->template;
            exchange->parameters = route->parameters;
            exchange->of_step = route->of_step;
            if (exchange->site->only_health && !route->health)
                break;
            return call_handler(exchange, route);
        }
    if (exchange->site->only_health)
        return answer_only_health(exchange);
    if (is_bare_base(exchange->site, path, size))
        return answer_bare_base(exchange, path, size);
    const struct embedded_file *asset =
        percent_decode(path, size, exchange->captures[0], CAPTURE_CAPACITY) ? assets_find(exchange->captures[0]) : NULL;
    if (asset && strcmp(asset->path, "/view/") != 0) { // that one is /view/{id}'s
        response->route = page_route;
        return handle_asset(exchange, asset);
    }
    response_problem(response, 404, exchange->request->target,
                     "not found; openapi.json at the root of the site lists the paths");
    return ANSWERED;
}

static void answer_options(struct response *response)
{
    response->status = 204;
    response_header_text(response, "Allow", allow);
}

/* A problem as a page, for readers who come with a browser's address line. The link leads to the root, relative to the
 * path. */
static void show_problem(struct exchange *exchange)
{
    struct response *response = exchange->response;
    struct buffer page = {0};
    json_t *problem = response->kind == BODY_BYTES ? json_loadb(response->bytes, (size_t)response->size, 0,
                                                                NULL) : NULL;
    const char *detail = json_string_value(json_object_get(problem, "detail"));
    bool made = detail &&
                buffer_printf(&page, "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<meta "
                                     "name=\"viewport\" content=\"width=device-width\">\n"
                                     "<title>Not found</title>\n<style>body { font: 16px system-ui, "
                                     "sans-serif; margin: 10vh auto; max-width: 40em; padding: 0 1em "
                                     "}</style>\n"
                                     "<h1>Not found</h1>\n<p>") == TETLOD_OK &&
                buffer_append_escaped(&page, detail) == TETLOD_OK &&
                buffer_printf(&page, ".</p>\n<p><a href=\"./") == TETLOD_OK;
    for (const char *c = exchange->path + 1; made && *c && *c != '?'; c++)
        made = *c != '/' || buffer_append(&page, "../", 3) == TETLOD_OK;
    made = made && buffer_printf(&page, "\">What is served here</a></p>\n</html>\n") == TETLOD_OK;
    json_decref(problem);
    if (!made) {
        buffer_fini(&page);
        return;
    }
    response_owned(response, 404, "text/html; charset=utf-8", page.bytes, page.size);
    response_header_text(response, "Content-Security-Policy", "default-src 'none'; style-src 'unsafe-inline'");
}

/* Refuses what is no request for this server, whoever sends it. The connection ends: what follows might be a body that
 * nobody reads. */
static bool refuse(const struct request *request, const char *path, struct response *response)
{
    bool whole_server = request->method == METHOD_OPTIONS && strcmp(request->target, "*") == 0;
    bool other_method = request->method == METHOD_OTHER && (!request->refused || request->refused == 413);
    if (other_method) {
        response_problem(response, 405, request->target, "only %s are answered here", allow);
        response_header_text(response, "Allow", allow);
    } else if (request->refused)
        response_problem(response, request->refused, request->target, "%s", request->why_refused);
    else if (!path && !whole_server)
        response_problem(response, 400, request->target,
                         "a request's target begins with '/' or with http://, and has no control characters");
    else
        return false;
    response->close = true;
    return true;
}

/* What every answer ends with. */
static void complete(struct exchange *exchange)
{
    const struct request *request = exchange->request;
    struct response *response = exchange->response;
    if (response->status == 200 && (request->method == METHOD_GET || request->method == METHOD_HEAD))
        apply_conditions(request, response);
    const char *accept = request_header(request, "Accept");
    if (response->status == 404 && exchange->path && accept && strstr(accept, "text/html"))
        show_problem(exchange);
    access_headers(exchange->policy, request, response);
    response->close |= atomic_load(&exchange->site->draining);
    if (!response->headers_lost)
        return;
    response_problem(response, 414, request->target,
                     "the headers of this answer would be too long; ask for less in one request");
    access_headers(exchange->policy, request, response);
}

enum outcome site_answer(struct site *site, struct request *request, struct response *response)
{
    struct exchange exchange = {.site = site, .request = request, .response = response};
    const char *path = path_of(request->target);
    enum outcome outcome = ANSWERED;
    enum admission admission;
    exchange.policy = access_hold(site->access);
    if (refuse(request, path, response))
        ; // answered
    else if ((admission = access_check(&exchange, path ? below_base(site, path) : request->target)) != ACCESS_GRANTED)
        outcome = admission == ACCESS_WAITS ? WAITING : ANSWERED;
    else if (request->method == METHOD_OPTIONS)
        answer_options(response);
    else
        outcome = dispatch(&exchange, path);
    if (outcome == WAITING)
        response_release(response);
    else
        complete(&exchange);
    access_let_go(site->access, exchange.policy);
    return outcome;
}
