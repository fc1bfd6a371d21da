/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/net/request_head.h"

#include <string.h>
#include <strings.h>

static const char token[] = "!#$%&'*+-.^_`|~0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz";

/* An empty line ends it, be it "\r\n" or, which is refused then, "\n" alone. */
size_t head_size(const char *bytes, size_t size, size_t seen)
{
    const char *end = bytes + size, *at = bytes + (seen > 3 ? seen - 3 : 0);
    while ((at = memchr(at, '\n', (size_t)(end - at)))) {
        at++;
        if (at < end && *at == '\n')
            return (size_t)(at + 1 - bytes);
        if (end - at > 1 && at[0] == '\r' && at[1] == '\n')
            return (size_t)(at + 2 - bytes);
    }
    return 0;
}

static void refuse(struct request_head *head, unsigned status, const char *why)
{
    if (head->refused)
        return; // the first fault is said
    head->refused = status;
    head->why_refused = why;
}

/* Takes a line off the front, and puts a NUL in place of its end. NULL: there is none, or it is none. */
static char *take_line(char **at, char *end, size_t *out_size)
{
    char *line = *at, *newline = memchr(line, '\n', (size_t)(end - line));
    if (!newline || newline == line || newline[-1] != '\r')
        return NULL;
    *at = newline + 1;
    newline[-1] = 0;
    *out_size = (size_t)(newline - 1 - line);
    return strlen(line) == *out_size && !memchr(line, '\r', *out_size) ? line : NULL;
}

static void read_version(const char *version, struct request_head *out)
{
    static const char digits[] = "0123456789";
    out->old = strcmp(version, "HTTP/1.0") == 0;
    if (out->old || strcmp(version, "HTTP/1.1") == 0)
        return;
    bool other = strncmp(version, "HTTP/", 5) == 0 && version[5] && strchr(digits, version[5]) && version[6] == '.' &&
                 version[7] && strchr(digits, version[7]) && !version[8];
    if (other)
        refuse(out, 505, "only HTTP/1.0 and HTTP/1.1 are spoken here");
    else
        refuse(out, 400, "a request begins with a method, a target and a version, with a space between two of them");
}

/* The first line: GET /healthz HTTP/1.1. */
static void read_first(char *line, struct request_head *out)
{
    char *target = line ? line + strspn(line, token) : NULL, *version = NULL;
    if (target && target > line && *target == ' ') {
        *target++ = 0;
        version = strchr(target, ' ');
    }
    if (!version || version == target) {
        refuse(out, 400, "a request begins with a method, a target and a version, with a space between two of them");
        return;
    }
    *version++ = 0;
    out->method = line;
    out->target = target;
    read_version(version, out);
}

/* What the headers say of a body and of what comes after it. */
struct framing {
    unsigned lengths, codings, hosts;
    bool content, closes, lasts;
};

static bool has_word(const char *list, const char *word)
{
    size_t size = strlen(word);
    while (*list) {
        list += strspn(list, " \t,");
        size_t found = strcspn(list, " \t,");
        if (found == size && strncasecmp(list, word, size) == 0)
            return true;
        list += found;
    }
    return false;
}

static void read_header(const char *name, const char *value, struct framing *framing, struct request_head *out)
{
    if (strcasecmp(name, "Content-Length") == 0) {
        framing->lengths++;
        framing->content |= strspn(value, "0") != strlen(value) || !*value;
        if (!*value || value[strspn(value, "0123456789")])
            refuse(out, 400, "a Content-Length is a number");
    } else if (strcasecmp(name, "Transfer-Encoding") == 0)
        framing->codings++;
    else if (strcasecmp(name, "Host") == 0)
        framing->hosts++;
    else if (strcasecmp(name, "Connection") == 0) {
        framing->closes |= has_word(value, "close");
        framing->lasts |= has_word(value, "keep-alive");
    }
}

static bool has_control(const char *text)
{
    for (; *text; text++)
        if (((unsigned char)*text < 0x20 && *text != '\t') || *text == 0x7f)
            return true;
    return false;
}

/* A line "name: value", which moves to the end of what was read; each line takes at most the room that it had. */
static void take_header(char *line, size_t size, char **put, struct framing *framing, struct request_head *out)
{
    size_t name_size = strspn(line, token);
    if (!name_size || line[name_size] != ':') {
        refuse(out, 400, "a header's name has characters that names do not have");
        return;
    }
    char *value = line + name_size + 1, *end = line + size, *name = *put;
    value += strspn(value, " \t");
    while (end > value && (end[-1] == ' ' || end[-1] == '\t'))
        end--;
    *end = 0;
    if (has_control(value))
        refuse(out, 400, "a header's value has control characters in it");
    memmove(name, line, name_size);
    name[name_size] = 0;
    memmove(name + name_size + 1, value, (size_t)(end - value) + 1);
    *put = name + name_size + 1 + (end - value) + 1;
    read_header(name, name + name_size + 1, framing, out);
}

void head_read(char *bytes, size_t size, bool whole, struct request_head *out)
{
    struct framing framing = {0};
    char *at = bytes, *end = bytes + size;
    size_t line_size;
    *out = (struct request_head){.method = "", .target = ""};
    read_first(take_line(&at, end, &line_size), out);
    char *put = at;
    out->headers = put;
    while (whole && at < end && !out->refused) {
        char *line = take_line(&at, end, &line_size);
        if (!line)
            refuse(out, 400, "a line of a request ends with CR and LF, and has no NUL nor another CR");
        else if (line_size)
            take_header(line, line_size, &put, &framing, out);
    }
    out->end = put;
    out->keep = !framing.closes && (!out->old || framing.lasts);
    if (!whole) {
        bool target = !*out->target || strlen(out->target) > size / 2;
        out->refused = target ? 414 : 431;
        out->why_refused = target ? "the request's target is too long" : "the request's headers are too long";
    }
    if (framing.hosts > 1 || (!out->old && !framing.hosts))
        refuse(out, 400, "a request has one Host header");
    if (framing.codings || framing.lengths > 1 || framing.content)
        refuse(out, 413, "request bodies are not accepted");
}

bool head_next(const struct request_head *head, const char **at, const char **name, const char **value)
{
    if (*at == head->end)
        return false;
    *name = *at;
    *value = *name + strlen(*name) + 1;
    *at = *value + strlen(*value) + 1;
    return true;
}

const char *head_find(const struct request_head *head, const char *wanted)
{
    const char *at = head->headers, *name, *value;
    while (head_next(head, &at, &name, &value))
        if (strcasecmp(name, wanted) == 0)
            return value;
    return NULL;
}
