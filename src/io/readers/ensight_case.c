/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The case file: lines KEY: VALUES in sections. Time sets come after what refers to them, so that names of files with a
 * number in place of ***** are made at the end.
 */
#include "src/io/readers/ensight_case.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/services/file_values.h"
#include "src/io/readers/readers.h"
#include "src/io/services/time_steps.h"
#include "src/util/array.h"

struct time_set {
    int64_t number, start, increment;
    int64_t *numbers; /* owned: of the files; or NULL: start, start + increment, ... */
    double *times;    /* owned */
    size_t count, number_count, time_capacity, number_capacity;
};

struct reader {
    struct ensight_case *out;
    struct text rest;
    struct time_set *sets; /* owned */
    size_t set_count, set_capacity;
    struct tetlod_error *error;
};

static void entry_fini(struct ensight_entry *entry)
{
    free(entry->kind);
    free(entry->name);
    free(entry->file);
    *entry = (struct ensight_entry){0};
}

void ensight_case_fini(struct ensight_case *ensight)
{
    entry_fini(&ensight->model);
    for (size_t v = 0; v < ensight->variable_count; v++)
        entry_fini(&ensight->variables[v]);
    free(ensight->variables);
    *ensight = (struct ensight_case){0};
}

static char *copy(struct text text)
{
    return strndup(text.at, (size_t)(text.end - text.at));
}

static enum tetlod_status fail_nomem(const struct reader *r)
{
    return tetlodi_fail_nomem(r->error, "the list of files", sizeof(struct ensight_entry));
}

/* ---- lines */

/* A word, or what stands in quotes. */
static struct text word_or_quoted(struct text *text)
{
    struct text word = text_word(text);
    const char *quote = word.at < word.end && *word.at == '"' ? memchr(word.at + 1, '"',
                                                                       (size_t)(text->end - word.at - 1)) : NULL;
    if (!quote)
        return word;
    text->at = quote + 1;
    return (struct text){word.at + 1, quote};
}

static unsigned count_words(struct text text)
{
    unsigned count = 0;
    for (struct text word = word_or_quoted(&text); word.at != word.end; word = word_or_quoted(&text))
        count++;
    return count;
}

/* [time set] [file set] NAME... FILE; of a model only the file, and words may follow it. */
static enum tetlod_status read_entry(const struct reader *r, struct text kind, struct text values, bool is_model,
                                     struct ensight_entry *out)
{
    unsigned least = is_model ? 1 : 2;
    for (int i = 0; i < 2 && count_words(values) > least; i++) {
        struct text after = values;
        int64_t number;
        if (!text_int(&after, &number))
            break;
        values = after;
        out->time_set = i == 0 ? number : out->time_set;
    }
    struct text name = {values.at, values.at}, file = word_or_quoted(&values);
    while (!is_model && count_words(values)) {
        name.end = file.end;
        file = word_or_quoted(&values);
    }
    while (name.at < name.end && *name.at == ' ')
        name.at++;
    out->kind = copy(kind);
    out->name = copy(name);
    out->file = copy(file);
    return out->kind && out->name && out->file ? TETLOD_OK : fail_nomem(r);
}

static enum tetlod_status add_variable(struct reader *r, struct text kind, struct text values)
{
    struct ensight_case *out = r->out;
    if (!ARRAY_RESERVE(out->variables, out->variable_capacity, out->variable_count + 1))
        return fail_nomem(r);
    struct ensight_entry *entry = &out->variables[out->variable_count++];
    *entry = (struct ensight_entry){0};
    return read_entry(r, kind, values, false, entry);
}

/* ---- time */

static enum tetlod_status add_set(struct reader *r, struct text values)
{
    struct time_set set = {.increment = 1};
    if (!text_int(&values, &set.number))
        return tetlodi_fail(r->error, TETLOD_ERR_MESH, "a time set has no number");
    if (!ARRAY_RESERVE(r->sets, r->set_capacity, r->set_count + 1))
        return fail_nomem(r);
    r->sets[r->set_count++] = set;
    return TETLOD_OK;
}

/* Numbers from the value on, over as many lines as they take. */
static enum tetlod_status read_list(struct reader *r, struct text values, struct time_set *set, bool are_times)
{
    struct text text = {values.at, r->rest.end}, before = text;
    double time;
    int64_t number;
    while (are_times ? text_double(&text, false, &time) : text_int(&text, &number)) {
        bool good = are_times ? ARRAY_RESERVE(set->times, set->time_capacity, set->count + 1)
                              : ARRAY_RESERVE(set->numbers, set->number_capacity, set->number_count + 1);
        if (!good)
            return fail_nomem(r);
        if (are_times)
            set->times[set->count++] = time;
        else
            set->numbers[set->number_count++] = number;
        before = text;
    }
    if (before.at > r->rest.at)
        r->rest.at = before.at;
    return TETLOD_OK;
}

static enum tetlod_status read_time(struct reader *r, struct text key, struct text values)
{
    struct time_set *set = r->set_count ? &r->sets[r->set_count - 1] : NULL;
    if (text_is(key, "time set"))
        return add_set(r, values);
    if (!set)
        return TETLOD_OK;
    if (text_is(key, "time values"))
        return read_list(r, values, set, true);
    if (text_is(key, "filename numbers"))
        return read_list(r, values, set, false);
    bool good = true;
    if (text_is(key, "filename start number"))
        good = text_int(&values, &set->start);
    else if (text_is(key, "filename increment"))
        good = text_int(&values, &set->increment);
    return good ? TETLOD_OK : tetlodi_fail(r->error, TETLOD_ERR_MESH,
                                           "time set %" PRId64 ": '%.*s' is not a whole number", set->number,
                                           text_length(key), key.at);
}

static enum tetlod_status read_line(struct reader *r, struct text line)
{
    const char *colon = line.at < line.end ? memchr(line.at, ':', (size_t)(line.end - line.at)) : NULL;
    if (!colon || *line.at == '#')
        return TETLOD_OK;
    struct text key = {line.at, colon}, values = {colon + 1, line.end};
    while (key.at < key.end && (*key.at == ' ' || *key.at == '\t'))
        key.at++;
    while (key.at < key.end && (key.end[-1] == ' ' || key.end[-1] == '\t'))
        key.end--;
    if (text_is(key, "type"))
        r->out->is_gold = sniff_holds((const unsigned char *)values.at, (size_t)(values.end - values.at), "gold");
    if (text_is(key, "model") && !r->out->model.file)
        return read_entry(r, key, values, true, &r->out->model);
    if (sniff_holds((const unsigned char *)key.at, (size_t)(key.end - key.at), " per "))
        return add_variable(r, key, values);
    return read_time(r, key, values);
}

/* ---- the step */

/* The file's name with the number of the step that is the last one at or before the time. */
static enum tetlod_status fill_name(const struct reader *r, struct ensight_entry *entry, double time)
{
    const struct time_set *set = NULL;
    for (size_t s = 0; s < r->set_count && !set; s++)
        if (r->sets[s].number == entry->time_set || !entry->time_set)
            set = &r->sets[s];
    for (size_t i = 1; set && i < set->count && set->times[i] <= time; i++)
        entry->step = i;
    char *star = strchr(entry->file, '*');
    if (!set || !star)
        return TETLOD_OK;
    int width = (int)strspn(star, "*");
    int64_t number;
    if (entry->step < set->number_count)
        number = set->numbers[entry->step];
    else if (__builtin_mul_overflow((int64_t)entry->step, set->increment, &number) ||
             __builtin_add_overflow(number, set->start, &number))
        return tetlodi_fail(r->error, TETLOD_ERR_MESH, "the numbers of files of time set %" PRId64 " are too large",
                            set->number);
    size_t size = strlen(entry->file) + 32;
    char *name = array_new(size, 1);
    if (!name)
        return fail_nomem(r);
    snprintf(name, size, "%.*s%0*" PRId64 "%s", (int)(star - entry->file), entry->file, width, number, star + width);
    free(entry->file);
    entry->file = name;
    return TETLOD_OK;
}

static enum tetlod_status choose_step(struct reader *r, const struct io_input *input, struct io_report *report)
{
    struct time_steps steps = {0};
    enum tetlod_status status = TETLOD_OK;
    for (size_t s = 0; s < r->set_count; s++)
        for (size_t i = 0; i < r->sets[s].count && status == TETLOD_OK; i++)
            status = time_steps_add(&steps, r->sets[s].times[i], r->error);
    if (status == TETLOD_OK && steps.count)
        status = time_steps_choose(&steps, input->options, report, r->error);
    time_steps_fini(&steps);
    if (status == TETLOD_OK)
        status = fill_name(r, &r->out->model, report->time);
    for (size_t v = 0; v < r->out->variable_count && status == TETLOD_OK; v++)
        status = fill_name(r, &r->out->variables[v], report->time);
    return status;
}

enum tetlod_status ensight_case_read(struct ensight_case *out, const struct io_input *input, struct io_report *report,
                                     struct tetlod_error *error)
{
    const char *begin = (const char *)input->bytes;
    struct reader r = {.out = out, .rest = {begin, begin + input->size}, .error = error};
    enum tetlod_status status = TETLOD_OK;
    *out = (struct ensight_case){0};
    while (status == TETLOD_OK && r.rest.at < r.rest.end)
        status = read_line(&r, text_line(&r.rest));
    if (status == TETLOD_OK && !out->model.file)
        status = tetlodi_fail(error, TETLOD_ERR_MESH, "has no line 'model: FILE'");
    if (status == TETLOD_OK)
        status = choose_step(&r, input, report);
    for (size_t s = 0; s < r.set_count; s++) {
        free(r.sets[s].numbers);
        free(r.sets[s].times);
    }
    free(r.sets);
    return status;
}
