/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/http/message.h"

#include <jansson.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "src/util/utf8_clean.h"

void response_init(struct response *response)
{
    memset(response, 0, offsetof(struct response, headers));
}

/* Room for the value of one more header; 0: there is none. */
static size_t room_for_header(struct response *response)
{
    return response->header_count < RESPONSE_HEADERS ? sizeof response->header_text - response->header_bytes : 0;
}

/* Takes a value of so many bytes, and a NUL, that is in its place. */
static void take_header(struct response *response, const char *name, size_t size)
{
    response->headers[response->header_count].name = name;
    response->headers[response->header_count++].value = response->header_bytes;
    response->header_bytes += size + 1;
}

void response_header(struct response *response, const char *name, const char *format, ...)
{
    size_t room = room_for_header(response);
    va_list arguments;
    va_start(arguments, format);
    int size = vsnprintf(response->header_text + response->header_bytes, room, format, arguments);
    va_end(arguments);
    if (size < 0 || (size_t)size >= room)
        response->headers_lost = true;
    else
        take_header(response, name, (size_t)size);
}

void response_header_text(struct response *response, const char *name, const char *value)
{
    size_t size = strlen(value);
    if (size >= room_for_header(response)) {
        response->headers_lost = true;
        return;
    }
    memcpy(response->header_text + response->header_bytes, value, size + 1);
    take_header(response, name, size);
}

static size_t find_header(const struct response *response, const char *name)
{
    size_t i = 0;
    while (i < response->header_count && strcasecmp(response->headers[i].name, name) != 0)
        i++;
    return i;
}

const char *response_header_value(const struct response *response, size_t i)
{
    return response->header_text + response->headers[i].value;
}

const char *response_find_header(const struct response *response, const char *name)
{
    size_t i = find_header(response, name);
    return i < response->header_count ? response_header_value(response, i) : NULL;
}

void response_vary(struct response *response, const char *name)
{
    char both[128];
    size_t i = find_header(response, "Vary");
    if (i == response->header_count) {
        response_header_text(response, "Vary", name);
        return;
    }
    snprintf(both, sizeof both, "%s, %s", response_header_value(response, i), name);
    response->headers[i] = response->headers[--response->header_count];
    response_header_text(response, "Vary", both);
}

void response_release(struct response *response)
{
    if (response->release)
        response->release(response->owner);
    response->release = NULL;
    response->owner = NULL;
    response->kind = BODY_NONE;
    response->size = 0;
}

void response_static(struct response *response, unsigned status, const char *media_type, const char *text)
{
    response_release(response);
    response->status = status;
    response->media_type = media_type;
    response->kind = BODY_BYTES;
    response->bytes = text;
    response->size = strlen(text);
}

void response_pieces(struct response *response, const char *media_type, uint64_t size,
                     ptrdiff_t (*read)(void *owner, uint64_t begin, size_t size,
                                       unsigned char *out), void (*release)(void *owner), void *owner)
{
    response_release(response);
    response->status = 200;
    response->media_type = media_type;
    response->kind = BODY_PIECES;
    response->read = read;
    response->offset = 0;
    response->size = size;
    response->release = release;
    response->owner = owner;
    response->ranges = true;
}

void response_owned(struct response *response, unsigned status, const char *media_type, void *bytes, size_t size)
{
    response_release(response);
    response->status = status;
    response->media_type = media_type;
    response->kind = BODY_BYTES;
    response->bytes = bytes;
    response->size = size;
    response->release = free;
    response->owner = bytes;
}

const char *status_title(unsigned status)
{
    static const struct {
        unsigned status;
        const char *title;
    } titles[] = {
        {200, "OK"},
        {204, "No Content"},
        {206, "Partial Content"},
        {303, "See Other"},
        {304, "Not Modified"},
        {308, "Permanent Redirect"},
        {400, "Bad Request"},
        {401, "Unauthorized"},
        {404, "Not Found"},
        {405, "Method Not Allowed"},
        {413, "Content Too Large"},
        {414, "URI Too Long"},
        {416, "Range Not Satisfiable"},
        {421, "Misdirected Request"},
        {422, "Unprocessable Content"},
        {429, "Too Many Requests"},
        {431, "Request Header Fields Too Large"},
        {500, "Internal Server Error"},
        {501, "Not Implemented"},
        {503, "Service Unavailable"},
        {505, "HTTP Version Not Supported"},
    };
    for (size_t i = 0; i < sizeof titles / sizeof *titles; i++)
        if (titles[i].status == status)
            return titles[i].title;
    return "Error";
}

/* Prints a message; one that is too long ends with three dots, never inside a character. */
static void print_detail(char *out, size_t capacity, const char *format, va_list arguments)
{
    int size = vsnprintf(out, capacity, format, arguments);
    if (size >= 0 && (size_t)size >= capacity) {
        size_t end = capacity - 4;
        while (end && ((unsigned char)out[end] & 0xc0) == 0x80)
            end--;
        memcpy(out + end, "...", 4);
    }
    utf8_clean(out);
}

/* A target as a reference that leads to it from itself: a proxy may have taken off the front of its path. */
static json_t *relative_target(const char *target)
{
    size_t size = strcspn(target, "?");
    while (size && target[size - 1] != '/')
        size--;
    return json_sprintf("./%s", target + size);
}

static void put_problem(struct response *response, unsigned status, const char *target, const char *name,
                        json_t *choices, const char *detail)
{
    json_t *problem = json_pack("{s:s, s:i, s:s, s:o}", "title", status_title(status), "status", (int)status, "detail",
                                detail, "instance", relative_target(target));
    if (!problem) // an instance that is not UTF-8
        problem = json_pack("{s:s, s:i, s:s}", "title", status_title(status), "status", (int)status, "detail", detail);
    if (choices)
        json_object_set_new(problem, name, choices);
    char *text = problem ? json_dumps(problem, JSON_PRESERVE_ORDER) : NULL;
    json_decref(problem);
    response->header_count = response->header_bytes = 0;
    response->headers_lost = false;
    response->etag[0] = 0;
    response->ranges = false;
    if (text)
        response_owned(response, status, "application/problem+json", text, strlen(text));
    else
        response_static(response, status, "application/problem+json", "{\"title\":\"out of memory\"}");
    if (status == 503 || status == 429)
        response_header_text(response, "Retry-After", "1");
    response_header_text(response, "Cache-Control", "no-store");
}

void response_problem(struct response *response, unsigned status, const char *target, const char *format, ...)
{
    char detail[512];
    va_list arguments;
    va_start(arguments, format);
    print_detail(detail, sizeof detail, format, arguments);
    va_end(arguments);
    put_problem(response, status, target, NULL, NULL, detail);
}

void response_problem_choices(struct response *response, unsigned status, const char *target, const char *name,
                              json_t *choices, const char *format, ...)
{
    char detail[512];
    va_list arguments;
    va_start(arguments, format);
    print_detail(detail, sizeof detail, format, arguments);
    va_end(arguments);
    put_problem(response, status, target, name, choices, detail);
}

const char *request_header(const struct request *request, const char *name)
{
    return request->header ? request->header(request->opaque, name) : NULL;
}

void request_unpin(struct request *request)
{
    for (size_t i = 0; i < REQUEST_PINS; i++)
        if (request->pins[i].entry) {
            cache_release(request->pins[i].cache, request->pins[i].entry);
            request->pins[i].entry = NULL;
        }
}
