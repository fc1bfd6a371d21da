/* SPDX-License-Identifier: BSD-3-Clause */
/* What json_text_is_object takes for JSON is what Jansson takes for it. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "src/stream/metadata.h"
#include "src/util/json_text.h"
#include "tests/test.h"

/* Does Jansson take a text as `mine` says? It has no numbers above DBL_MAX and no keys with NUL: such a text tells
 * nothing. */
static bool jansson_agrees(const char *text, size_t size, bool mine)
{
    json_error_t error;
    json_t *value = json_loadb(text, size, JSON_ALLOW_NUL, &error);
    bool object = json_is_object(value);
    enum json_error_code code = value ? json_error_unknown : json_error_code(&error);
    json_decref(value);
    return object == mine || code == json_error_numeric_overflow || code == json_error_null_byte_in_key;
}

enum { GOOD = 7 }; /* of the texts, the first ones */

static const char *const texts[] = {"{}",
                                    " { } \n",
                                    "{\"a\":1}",
                                    "{\"a\" : [ ], \"b\":[1,2 , {\"c\":null}],\"d\":true,\"e\":false}",
                                    "{\"a\":-0,\"b\":0.5,\"c\":1e9,\"d\":-1.25E-3,\"e\":2e+2}",
                                    "{\"\\\"\\\\\\/\\b\\f\\n\\r\\t\\u00e9\\ud83d\\ude00\":\"\\u0000x\"}",
                                    "{\"\xc3\xa9\xe2\x82\xac\xf0\x9f\x98\x80\":\"\x7f\xc2\x85\"}",
                                    "",
                                    " ",
                                    "[]",
                                    "1",
                                    "null",
                                    "\"a\"",
                                    "{",
                                    "}",
                                    "{}}",
                                    "{} x",
                                    "{\"a\"}",
                                    "{\"a\":}",
                                    "{\"a\":1,}",
                                    "{,}",
                                    "{a:1}",
                                    "{'a':1}",
                                    "{\"a\":01}",
                                    "{\"a\":+1}",
                                    "{\"a\":.5}",
                                    "{\"a\":1.}",
                                    "{\"a\":1e}",
                                    "{\"a\":-}",
                                    "{\"a\":tru}",
                                    "{\"a\":[1,]}",
                                    "{\"a\":[1 2]}",
                                    "{\"a\":\"\\x\"}",
                                    "{\"a\":\"\\u12\"}",
                                    "{\"a\":\"\\ud800\"}",
                                    "{\"a\":\"\\udc00\"}",
                                    "{\"a\":\"\\ud800\\u0041\"}",
                                    "{\"a\":\"\n\"}",
                                    "{\"a\":\"\xff\"}",
                                    "{\"a\":\"\xed\xa0\x80\"}",
                                    "{\"a\":\"\xc0\x80\"}",
                                    "{\"a\":\"b}",
                                    "{\"a\":1 \"b\":2}"};

/* The same value as Jansson makes of a good text. */
static bool jansson_makes_the_same(const char *text, size_t size)
{
    const struct tetlod_info info = {.metadata = text, .metadata_size = size};
    json_t *mine = metadata_json(&info), *other = json_loadb(text, size, JSON_ALLOW_NUL, NULL), *empty = json_object();
    bool same = json_equal(mine, other ? other : empty);
    json_decref(mine);
    json_decref(other);
    json_decref(empty);
    return same;
}

static void test_texts(void)
{
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        if (!jansson_agrees(texts[i], strlen(texts[i]), json_text_is_object(texts[i], strlen(texts[i]))))
            TEST_FAIL("text %zu: %s", i, texts[i]);
    for (size_t i = 0; i < GOOD; i++)
        CHECK(json_text_is_object(texts[i], strlen(texts[i])) && jansson_makes_the_same(texts[i], strlen(texts[i])));
    CHECK(!json_text_is_object("{}", 1));
}

/* Bytes of the good texts changed, left out and doubled. */
static void test_changed_texts(void)
{
    static const char bytes[] = "{}[]:,\"\\/ \n-+.0159eEutfnal\x01\xc3\xa9\xf0\xff";
    uint32_t random = 1;
    int different = 0, taken = 0;
    for (int round = 0; round < 200000; round++) {
        char text[128];
        const char *from = texts[(random >> 8) % GOOD];
        size_t size = strlen(from);
        memcpy(text, from, size);
        for (int change = 0; change < 1 + round % 2; change++) {
            random = random * 1664525 + 1013904223;
            size_t at = (random >> 8) % size, kind = (random >> 5) & 3;
            if (kind == 0 && size > 1) {
                memmove(text + at, text + at + 1, --size - at);
            } else if (kind == 1 && size < sizeof text) {
                memmove(text + at + 1, text + at, size++ - at);
            } else {
                text[at] = bytes[(random >> 20) % (sizeof bytes - 1)];
            }
        }
        bool mine = json_text_is_object(text, size);
        if (!jansson_makes_the_same(text, size) && mine)
            TEST_FAIL("another value: %.*s", (int)size, text);
        taken += mine;
        bool agrees = jansson_agrees(text, size, mine);
        different += !agrees;
        if (!agrees)
            printf("# %.*s\n", (int)size, text);
    }
    CHECK(taken > 1000);
    CHECK_INT(different, 0);
}

static void test_depth(void)
{
    size_t deep = 1000000;
    char *text = malloc(deep);
    REQUIRE(text);
    memset(text, '[', deep);
    memcpy(text, "{\"a\":", 5);
    CHECK(!json_text_is_object(text, deep));
    free(text);
}

int main(void)
{
    RUN(test_texts);
    RUN(test_changed_texts);
    RUN(test_depth);
    return test_end();
}
