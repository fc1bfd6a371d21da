/* SPDX-License-Identifier: BSD-3-Clause */
/* Numbers as people write them: in queries and on the command line. */
#ifndef TETLOD_NUMBER_TEXT_H
#define TETLOD_NUMBER_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The finite decimal number that *at begins with; *at goes behind it. False: there is none, and *at stays. */
bool text_take_number(const char **at, double *out);

/* The same of a whole text; "1%" is 0.01 where `percent` is allowed. */
bool text_number(const char *text, bool percent, double *out);

/* A whole number with an optional suffix K, M, G, T (powers of 1024) where `suffix` is allowed. */
bool text_count(const char *text, bool suffix, uint64_t *out);

/* `count` finite numbers separated by commas. */
bool text_numbers(const char *text, size_t count, double *out);

/* Prints a number with as few digits as tell it from others, without the '+' of an exponent, which is a space to some
 * readers of queries. Its length. */
size_t print_number(char *out, size_t capacity, double value);

#endif
