/* SPDX-License-Identifier: BSD-3-Clause */
/* What a client may write into a query, read by its grammar. Pure functions over NUL-terminated text of any content. */
#ifndef TETLOD_SERVER_PARAMS_H
#define TETLOD_SERVER_PARAMS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Percent-decodes `size` bytes into out, NUL-terminated. False for a broken escape, for what decodes to a control
 * character or to bytes that are not UTF-8, and for more than `capacity` - 1 bytes. */
bool percent_decode(const char *text, size_t size, char *out, size_t capacity);

/* Percent-encodes all but RFC 3986's unreserved characters; false if it does not fit. */
bool percent_encode(const char *text, char *out, size_t capacity);

enum query_result { QUERY_ABSENT, QUERY_FOUND, QUERY_BAD };

/* The value of a parameter of the query `text` (what follows '?', or NULL), decoded; '+' stands for itself, as it does
 * in 1e+3. QUERY_BAD: it is there twice, or its value cannot be decoded or is too long. */
enum query_result query_value(const char *text, const char *name, char *out, size_t capacity);

/* The same with '+' for a space, as forms and many libraries write it: for names that are not found with '+'. The value
 * has as many bytes as that of query_value. */
enum query_result query_form_value(const char *text, const char *name, char *out, size_t capacity);

/* Length of a name that a list, separated by commas, begins with, and of the comma behind it; 0: it begins with
 * another. */
size_t list_begins_with(const char *list, const char *name);

/* Which of `count` names a list begins with, and that length; a name may have commas: the longest counts. 0: with none.
 * The names stand `stride` bytes apart, as members of structs. */
size_t list_find(const char *list, const char *const *names, size_t stride, uint32_t count, uint32_t *out);

/* The same in a list as query_value reads it or, where no name is found, as query_form_value does: then the name is
 * copied from there. */
size_t list_find_either(char *list, const char *form, const char *const *names, size_t stride, uint32_t count,
                        uint32_t *out);

/* Whether the parameter at the beginning of `text` has this name, however it is written. */
bool query_begins_with(const char *text, const char *name);

/* The first of some names that are separated by spaces, each maybe with ":key" behind it; moves on. Its size; 0: there
 * is none. */
size_t next_name(const char **names, const char **out);

/* Finds a parameter whose name is not one of `names`, as next_name reads them, and copies what it is; false if there is
 * none. */
bool query_unknown(const char *text, const char *names, char *out, size_t capacity);

#endif
