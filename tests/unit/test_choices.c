/* SPDX-License-Identifier: BSD-3-Clause */
/* Which level an error asks for: the table of tests/choices, which the decoders in Python and for the web are held
 * against, too. */
#include <jansson.h>
#include <stdbool.h>
#include <stdlib.h>

#include "format/tetlod.h"
#include "tests/test.h"

enum { MOST = 16 };

struct table {
    json_t *json;
    struct tetlod_info info;
    struct tetlod_field fields[MOST];
    struct tetlod_level levels[MOST];
    double errors[MOST][MOST * TETLOD_MEASURES];
};

static double number_of(const json_t *object, const char *key)
{
    const json_t *value = json_object_get(object, key);
    return value ? json_number_value(value) : NAN;
}

static bool read_table(struct table *table)
{
    char path[1024];
    snprintf(path, sizeof path, "%s/tests/choices/choices.json", getenv("ROOT") ? getenv("ROOT") : ".");
    table->json = json_load_file(path, 0, NULL);
    json_t *fields = json_object_get(table->json, "fields"), *levels = json_object_get(table->json, "levels");
    table->info = (struct tetlod_info){.field_count = (uint32_t)json_array_size(fields),
                                       .level_count = (uint32_t)json_array_size(levels),
                                       .fields = table->fields,
                                       .levels = table->levels};
    for (uint32_t f = 0; f < table->info.field_count; f++) {
        const json_t *field = json_array_get(fields, f), *range = json_object_get(field, "range");
        table->fields[f] = (struct tetlod_field){.name = json_string_value(json_object_get(field, "name")),
                                                 .components = (uint32_t)number_of(field, "components"),
                                                 .controlled = json_is_true(json_object_get(field, "controlled")),
                                                 .bounds = TETLOD_NONE};
        for (size_t i = 0; i < 2; i++)
            table->fields[f].range[i] = json_number_value(json_array_get(range, i));
    }
    for (uint32_t k = 0; k < table->info.level_count; k++) {
        const json_t *level = json_array_get(levels, k);
        table->levels[k] = (struct tetlod_level){.tets = (uint32_t)number_of(level, "tets"),
                                                 .end = (uint64_t)number_of(level,
                                                                            "bytes"), .errors = table->errors[k]};
        for (uint32_t i = 0; i < table->info.field_count * TETLOD_MEASURES; i++)
            table->errors[k][i] = number_of(json_object_get(json_object_get(level, "errors"),
                                                            table->fields[i / TETLOD_MEASURES].name),
                                            tetlod_measure_name((enum tetlod_measure)(i % TETLOD_MEASURES)));
    }
    return table->info.level_count > 0;
}

static uint32_t answer(const struct tetlod_info *info, const json_t *question)
{
    const char *name = json_string_value(json_object_get(question, "field"));
    const char *measure = json_string_value(json_object_get(question, "measure"));
    uint32_t field = name ? tetlod_field_index(info, name) : TETLOD_NONE;
    int m = 0;
    while (measure && m < TETLOD_MEASURES && strcmp(measure, tetlod_measure_name((enum tetlod_measure)m)) != 0)
        m++;
    double absolute = number_of(question, "abs_error");
    if (isnan(absolute))
        return tetlod_level_for_error(info, number_of(question, "error"), field, (enum tetlod_measure)m);
    return tetlod_level_for_abs_error(info, absolute, field, (enum tetlod_measure)m);
}

static void test_table(void)
{
    static struct table table;
    REQUIRE(read_table(&table));
    const json_t *questions = json_object_get(table.json, "questions");
    CHECK(json_array_size(questions) > 20);
    for (size_t i = 0; i < json_array_size(questions); i++) {
        const json_t *question = json_array_get(questions, i);
        uint32_t got = answer(&table.info, question), wanted = (uint32_t)number_of(question, "level");
        if (got != wanted)
            TEST_FAIL("question %zu: level %u, not %u", i, got, wanted);
    }
    // A measure that the index does not hold has no level.
    CHECK_INT(tetlod_level_for_error(&table.info, 1, TETLOD_NONE, TETLOD_PREDICTED), TETLOD_NONE);
    CHECK_INT(tetlod_level_for_abs_error(&table.info, 1e30, 3, TETLOD_MAX), TETLOD_NONE);
    json_decref(table.json);
}

int main(void)
{
    RUN(test_table);
    return test_end();
}
