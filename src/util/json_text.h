/* SPDX-License-Identifier: BSD-3-Clause */
/* The syntax of JSON (RFC 8259). Nothing here allocates. */
#ifndef TETLOD_JSON_TEXT_H
#define TETLOD_JSON_TEXT_H

#include <stdbool.h>
#include <stddef.h>

/* Is a text one JSON object in UTF-8, at most 1,024 deep? */
bool json_text_is_object(const char *text, size_t size);

/* A text that is taken piece by piece. Each call is true where the piece comes next, and is behind it then. */
struct json_text {
    const char *at, *end;
};

void json_skip_space(struct json_text *text);
bool json_take(struct json_text *text, char wanted);
bool json_take_word(struct json_text *text, const char *word);
bool json_take_number(struct json_text *text);
bool json_take_string(struct json_text *text); /* with its quotes */
bool json_take_hex(struct json_text *text, unsigned *out); /* four digits */

#endif
