/* SPDX-License-Identifier: BSD-3-Clause */
/* The bytes of a connection: where a request's head ends does not hang on how the bytes come; a head that is accepted
 * has what a request must have, and says the same when it is written anew. */
#include <assert.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "server/net/request_head.h"
#include "src/util/buffer.h"

/* Texts have neither control characters, but tabs, nor ends of lines. */
static void check_text(const char *text)
{
    for (; *text; text++)
        assert((unsigned char)*text >= 0x20 || *text == '\t');
}

/* How many headers have that name; all are looked at. */
static size_t count_headers(const struct request_head *head, const char *wanted)
{
    const char *at = head->headers, *name, *value;
    size_t count = 0;
    while (head_next(head, &at, &name, &value)) {
        assert(*name && !strpbrk(name, " \t:"));
        check_text(name);
        count += strcasecmp(name, wanted) == 0;
    }
    assert(at == head->end);
    return count;
}

static void write_head(const struct request_head *head, struct buffer *out)
{
    const char *at = head->headers, *name, *value;
    assert(buffer_printf(out, "%s %s HTTP/1.%c\r\n", head->method, head->target, head->old ? '0' : '1') == TETLOD_OK);
    while (head_next(head, &at, &name, &value)) {
        check_text(value);
        assert(buffer_printf(out, "%s:%s\r\n", name, value) == TETLOD_OK);
    }
    assert(buffer_append(out, "\r\n", 2) == TETLOD_OK);
}

static void check_accepted(const struct request_head *head)
{
    struct request_head again;
    struct buffer first = {0}, second = {0};
    const char *length = head_find(head, "content-length");
    assert(*head->method && *head->target && !strpbrk(head->target, " \r\n"));
    assert(count_headers(head, "HOST") == 1 || (head->old && !count_headers(head, "host")));
    assert(!count_headers(head, "transfer-encoding") && count_headers(head, "content-length") <= 1);
    assert(!length || (*length && strspn(length, "0") == strlen(length)));
    write_head(head, &first);
    assert(head_size((const char *)first.bytes, first.size, 0) == first.size);
    char *copy = malloc(first.size);
    assert(copy);
    memcpy(copy, first.bytes, first.size);
    head_read(copy, first.size, true, &again);
    assert(!again.refused && again.keep == head->keep && again.old == head->old);
    write_head(&again, &second);
    assert(second.size == first.size && memcmp(first.bytes, second.bytes, first.size) == 0);
    free(copy);
    buffer_fini(&first);
    buffer_fini(&second);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    struct request_head head;
    const char *text = (const char *)bytes;
    if (!size)
        return 0;
    size_t whole = head_size(text, size, 0);
    for (size_t part = 0; part <= size && part < 64; part++) {
        size_t found = head_size(text, part, 0);
        assert(found ? found == whole : head_size(text, size, part) == whole);
    }
    size_t taken = whole ? whole : size;
    char *copy = malloc(taken);
    if (!copy)
        return 0;
    memcpy(copy, bytes, taken);
    head_read(copy, taken, whole != 0, &head);
    assert(head.end <= copy + taken && (whole || head.refused == 414 || head.refused == 431));
    count_headers(&head, "");
    if (!head.refused)
        check_accepted(&head);
    else
        assert(head.why_refused && head.refused >= 400 && head.refused <= 505);
    free(copy);
    return 0;
}
