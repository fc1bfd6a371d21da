/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/ask/question.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/number_text.h"

struct text {
    const char *whole, *at;
    struct tetlod_error *error;
};

static enum tetlod_status wrong(const struct text *text, const char *expected)
{
    return tetlodi_fail(text->error, TETLOD_ERR_ARGUMENT, "the question '%.80s': character %d: expected %s",
                        text->whole,
                        (int)(text->at - text->whole) + 1, expected);
}

static void skip_blanks(struct text *text)
{
    text->at += strspn(text->at, " \t\n");
}

static bool take_sign(struct text *text, const char *sign)
{
    skip_blanks(text);
    size_t length = strlen(sign);
    if (strncmp(text->at, sign, length) != 0)
        return false;
    text->at += length;
    return true;
}

static bool in_name(char c)
{
    return isalnum((unsigned char)c) || c == '_' || c == '.' || (unsigned char)c >= 0x80;
}

static bool take_word(struct text *text, const char *word)
{
    skip_blanks(text);
    size_t length = strlen(word);
    if (strncmp(text->at, word, length) != 0 || in_name(text->at[length]))
        return false;
    text->at += length;
    return true;
}

static enum tetlod_status parse_sign(struct text *text, const char *sign, const char *expected)
{
    return take_sign(text, sign) ? TETLOD_OK : wrong(text, expected);
}

static enum tetlod_status parse_number(struct text *text, double *out)
{
    skip_blanks(text);
    return text_take_number(&text->at, out) ? TETLOD_OK : wrong(text, "a number");
}

/* '(' numbers with commas between them ')' */
static enum tetlod_status parse_numbers(struct text *text, unsigned count, double *out)
{
    TETLOD_TRY(parse_sign(text, "(", "'('"));
    for (unsigned i = 0; i < count; i++) {
        if (i > 0)
            TETLOD_TRY(parse_sign(text, ",", "','"));
        TETLOD_TRY(parse_number(text, &out[i]));
    }
    return parse_sign(text, ")", "')'");
}

static enum tetlod_status parse_name(struct text *text, char name[256])
{
    bool quoted = take_sign(text, "\"");
    size_t length = quoted ? strcspn(text->at, "\"") : 0;
    while (!quoted && in_name(text->at[length]))
        length++;
    if (length == 0 || length > 255)
        return wrong(text, "the name of a field, in \"quotes\" if it has signs other than letters, digits, '_', '.'");
    memcpy(name, text->at, length);
    name[length] = 0;
    text->at += length;
    return quoted ? parse_sign(text, "\"", "'\"' behind the name") : TETLOD_OK;
}

static enum tetlod_status parse_quantity(struct text *text, struct ask_quantity *out)
{
    out->component = ASK_SCALAR;
    if (take_sign(text, "|")) {
        out->component = ASK_LENGTH;
        TETLOD_TRY(parse_name(text, out->name));
        return parse_sign(text, "|", "'|'");
    }
    TETLOD_TRY(parse_name(text, out->name));
    if (*text->at != ':')
        return TETLOD_OK;
    text->at++;
    if (take_word(text, "mag")) {
        out->component = ASK_LENGTH;
        return TETLOD_OK;
    }
    char *end;
    unsigned long component = isdigit((unsigned char)*text->at) ? strtoul(text->at, &end, 10) : 256;
    if (component > 255)
        return wrong(text, "the number of a component, or 'mag'");
    text->at = end;
    out->component = (int)component;
    return TETLOD_OK;
}

static enum ask_compare take_compare(struct text *text)
{
    if (take_sign(text, "<="))
        return ASK_AT_MOST;
    if (take_sign(text, "<"))
        return ASK_LESS;
    if (take_sign(text, ">="))
        return ASK_AT_LEAST;
    return take_sign(text, ">") ? ASK_GREATER : ASK_NO_LIMIT;
}

static enum tetlod_status parse_volume(struct text *text, struct ask_question *out)
{
    if (take_sign(text, ")"))
        return TETLOD_OK;
    TETLOD_TRY(parse_quantity(text, &out->quantity));
    out->side = take_compare(text);
    if (out->side == ASK_NO_LIMIT)
        return wrong(text, "'<', '<=', '>' or '>='");
    TETLOD_TRY(parse_number(text, &out->number));
    return parse_sign(text, ")", "')'");
}

static enum tetlod_status parse_arguments(struct text *text, struct ask_question *out)
{
    if (out->function == ASK_VOLUME)
        return parse_volume(text, out);
    TETLOD_TRY(parse_quantity(text, &out->quantity));
    if (out->function == ASK_QUANTILE) {
        TETLOD_TRY(parse_sign(text, ",", "',' and a fraction"));
        TETLOD_TRY(parse_number(text, &out->number));
        if (out->number < 0 || out->number > 1)
            return wrong(text, "a fraction from 0 to 1 before this");
    }
    return parse_sign(text, ")", "')'");
}

static enum tetlod_status parse_where(struct text *text, struct ask_question *out)
{
    for (;;) {
        if (!out->in_box && take_word(text, "in")) {
            if (!take_word(text, "box"))
                return wrong(text, "box(x0,y0,z0, x1,y1,z1)");
            TETLOD_TRY(parse_numbers(text, 6, out->box[0]));
            out->in_box = true;
            for (int i = 0; i < 3; i++)
                if (out->box[0][i] > out->box[1][i])
                    return wrong(text, "a box whose least corner comes first before this");
        } else if (!out->over_region && take_word(text, "over")) {
            if (!take_word(text, "region"))
                return wrong(text, "'region' and its number");
            TETLOD_TRY(parse_number(text, &out->region));
            out->over_region = true;
        } else {
            return TETLOD_OK;
        }
    }
}

/* Is the text a function's name and '('? Fields may have such names, too. */
static bool take_function(struct text *text, enum ask_function *out)
{
    static const struct {
        const char *word;
        enum ask_function function;
    } functions[] = {{"mean", ASK_MEAN},     {"integral", ASK_INTEGRAL}, {"min", ASK_MIN},
                     {"max", ASK_MAX},       {"volume", ASK_VOLUME},     {"quantile", ASK_QUANTILE}};
    struct text start = *text;
    for (size_t i = 0; i < sizeof functions / sizeof *functions; i++) {
        if (take_word(text, functions[i].word) && take_sign(text, "(")) {
            *out = functions[i].function;
            return true;
        }
        *text = start;
    }
    return false;
}

/* What is often asked for, and what no bound of values says anything of. */
static enum tetlod_status refuse_unprovable(struct text *text)
{
    static const char *const words[] = {"gradient", "grad",    "curl",       "divergence", "div",     "laplacian",
                                        "area",     "surface", "isosurface", "length",     "curvature"};
    const struct text start = *text;
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        if (take_word(text, words[i]) && take_sign(text, "("))
            return tetlodi_fail(text->error, TETLOD_ERR_ARGUMENT,
                                "%s(...) cannot be proved: a level's values are within a bound of the original's, "
                                "which says nothing of slopes, nor of areas of isosurfaces; ask for means, "
                                "integrals, extremes, volumes, quantiles or values", words[i]);
        *text = start;
    }
    return TETLOD_OK;
}

static enum tetlod_status parse_place(struct text *text, struct ask_question *out)
{
    TETLOD_TRY(refuse_unprovable(text));
    TETLOD_TRY(parse_quantity(text, &out->quantity));
    if (take_word(text, "at")) {
        out->function = ASK_AT;
        return parse_numbers(text, 3, out->place[0]);
    }
    if (!take_word(text, "along"))
        return wrong(text, "'at (x,y,z)' or 'along line(x0,y0,z0, x1,y1,z1)'; "
                           "functions are mean, integral, min, max, volume and quantile");
    out->function = ASK_ALONG;
    if (!take_word(text, "line"))
        return wrong(text, "line(x0,y0,z0, x1,y1,z1)");
    return parse_numbers(text, 6, out->place[0]);
}

enum tetlod_status ask_parse(const char *string, struct ask_question *out, struct tetlod_error *error)
{
    struct text text = {string, string, error};
    *out = (struct ask_question){0};
    if (take_function(&text, &out->function)) {
        TETLOD_TRY(parse_arguments(&text, out));
        TETLOD_TRY(parse_where(&text, out));
    } else {
        TETLOD_TRY(parse_place(&text, out));
    }
    out->compare = take_compare(&text);
    if (out->compare != ASK_NO_LIMIT)
        TETLOD_TRY(parse_number(&text, &out->limit));
    skip_blanks(&text);
    return *text.at ? wrong(&text, "the end, or '<', '<=', '>', '>=' and a number") : TETLOD_OK;
}
