/* SPDX-License-Identifier: BSD-3-Clause */
/* What a client may write into a request, read by its grammar: query strings, Range, entity tags, Accept-Encoding. Pure
 * functions over NUL-terminated text of any content. */
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

/* The value of a parameter of the query `text` (what follows '?', or NULL), decoded; '+' stands for itself, as it does in
 * 1e+3. QUERY_BAD: it is there twice, or its value cannot be decoded or is too long. */
enum query_result query_value(const char *text, const char *name, char *out, size_t capacity);

/* The same with '+' for a space, as forms and many libraries write it: for names that are not found with '+'. The value has as many
 * bytes as that of query_value. */
enum query_result query_form_value(const char *text, const char *name, char *out, size_t capacity);

/* Length of a name that a list, separated by commas, begins with, and of the comma behind it; 0: it begins with another. */
size_t list_begins_with(const char *list, const char *name);

/* Which of `count` names a list begins with, and that length; a name may have commas: the longest counts. 0: with none. The names stand
 * `stride` bytes apart, as members of structs. */
size_t list_find(const char *list, const char *const *names, size_t stride, uint32_t count, uint32_t *out);

/* The same in a list as query_value reads it or, where no name is found, as query_form_value does: then the name is copied from there. */
size_t list_find_either(char *list, const char *form, const char *const *names, size_t stride, uint32_t count, uint32_t *out);

/* Whether the parameter at the beginning of `text` has this name, however it is written. */
bool query_begins_with(const char *text, const char *name);

/* Finds a parameter whose name is not one of `names` (ends with NULL) and copies what it is; false if there is none. */
bool query_unknown(const char *text, const char *const *names, char *out, size_t capacity);

/* A finite decimal number; "1%" is 0.01 where `percent` is allowed. */
bool text_number(const char *text, bool percent, double *out);

/* A whole number with an optional suffix K, M, G, T (powers of 1024) where `suffix` is allowed. */
bool text_count(const char *text, bool suffix, uint64_t *out);

/* `count` finite numbers separated by commas. */
bool text_numbers(const char *text, size_t count, double *out);

/* Prints a number with as few digits as tell it from others, without the '+' of an exponent, which is a space to some readers of
 * queries. Its length. */
size_t print_number(char *out, size_t capacity, double value);

enum range_result { RANGE_IGNORED, RANGE_OK, RANGE_UNSATISFIABLE };

/* Range header against a body of `size` bytes (RFC 9110, 14). One range only: several, other units and broken syntax are
 * ignored, as the RFC allows. */
enum range_result range_parse(const char *header, uint64_t size, uint64_t *out_first, uint64_t *out_length);

/* If-None-Match: a list of entity tags, compared weakly, or '*'. */
bool etag_list_has(const char *list, const char *etag);

/* If-Range: one strong entity tag. */
bool etag_same(const char *header, const char *etag);

enum coding { CODING_IDENTITY, CODING_GZIP, CODING_ZSTD, CODING_BROTLI, CODINGS };

/* What answers that are made here can have; Brotli is for files that were compressed before. */
enum { CODINGS_MADE = 1 << CODING_GZIP | 1 << CODING_ZSTD };

/* "", "gzip", "zstd", "br" */
const char *coding_name(enum coding coding);

/* The coding of the highest q that Accept-Encoding allows, of those in `have` (bits 1 << coding) and identity; among equals
 * br before zstd before gzip before identity. Without header (NULL) and where nothing is allowed: identity. */
enum coding coding_choose(const char *accept_encoding, unsigned have);

#endif
