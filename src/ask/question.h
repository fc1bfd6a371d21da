/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A question about a field, as text: 'mean(p)', 'volume(T > 400)', 'max(|v|) in box(0,0,0, 1,1,1) < 3'.
 *
 *     question  = quantity 'at' point | quantity 'along' 'line' line | function [where] , [ compare number ]
 *     function  = ('mean' | 'integral' | 'min' | 'max') '(' quantity ')'
 *               | 'volume' '(' [ quantity compare number ] ')' | 'quantile' '(' quantity ',' number ')'
 *     where     = 'in' 'box' '(' six numbers ')' | 'over' 'region' number        (one of each may be given)
 *     quantity  = name | name ':' component | '|' name '|' | name ':mag'         a name with other signs is in "quotes"
 *     compare   = '<' | '<=' | '>' | '>='
 */
#ifndef TETLOD_QUESTION_H
#define TETLOD_QUESTION_H

#include <stdbool.h>

#include "format/tetlod.h"

enum ask_function { ASK_AT, ASK_ALONG, ASK_MEAN, ASK_INTEGRAL, ASK_MIN, ASK_MAX, ASK_VOLUME, ASK_QUANTILE };

enum ask_compare { ASK_NO_LIMIT, ASK_LESS, ASK_AT_MOST, ASK_GREATER, ASK_AT_LEAST };

enum { ASK_SCALAR = -1, ASK_LENGTH = -2 }; /* instead of a component */

struct ask_quantity {
    char name[256]; /* "": none, volume() of the domain */
    int component;
};

struct ask_question {
    enum ask_function function;
    struct ask_quantity quantity;
    enum ask_compare side; /* of a volume: where the quantity is above or below `number` */
    double number;         /* the volume's threshold, the quantile's fraction */
    bool in_box, over_region;
    double box[2][3];
    double region;
    double place[2][3];       /* of 'at' and 'along' */
    enum ask_compare compare; /* a predicate: the answer against `limit` */
    double limit;
};

/* ERR_ARGUMENT with the character where the text stops to make sense, and what could stand there. */
TETLOD_CHECKED enum tetlod_status ask_parse(const char *text, struct ask_question *out, struct tetlod_error *error);

#endif
