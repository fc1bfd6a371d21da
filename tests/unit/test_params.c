/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/http/conditions.h"
#include "server/http/params.h"
#include "src/util/number_text.h"
#include "tests/test.h"

static void test_percent_decode(void)
{
    static const struct {
        const char *text, *decoded; /* NULL: refused */
    } cases[] = {
        {"fin", "fin"},       {"my%20mesh", "my mesh"}, {"%2e%2E", ".."},   {"a%2fb", "a/b"}, {"", ""},
        {"a+b", "a+b"},       {"%00", NULL},            {"a%", NULL},       {"a%4", NULL},    {"%zz", NULL},
        {"%0a", NULL},        {"%ff", NULL},            {"%c3%a9", "\xc3\xa9"}, {"%c0%af", NULL}, {"%ed%a0%80", NULL},
        {"%f4%90%80%80", NULL}, {"%f0%9f%90%9f", "\xf0\x9f\x90\x9f"}, {"123456789abcdefg", NULL},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char out[16];
        bool decoded = percent_decode(cases[i].text, strlen(cases[i].text), out, sizeof out);
        if (decoded != (cases[i].decoded != NULL))
            TEST_FAIL("'%s' is %s", cases[i].text, decoded ? "decoded" : "refused");
        else if (decoded)
            CHECK_TEXT(out, cases[i].decoded);
    }
}

static void test_percent_encode(void)
{
    char out[32];
    CHECK(percent_encode("fin-1_a.b~", out, sizeof out));
    CHECK_TEXT(out, "fin-1_a.b~");
    CHECK(percent_encode("a b/\xc3\xa9?", out, sizeof out));
    CHECK_TEXT(out, "a%20b%2F%C3%A9%3F");
    CHECK(!percent_encode("   ", out, 9));
    CHECK(percent_encode("   ", out, 10));
}

static void test_names(void)
{
    CHECK_INT(query_begins_with("token=x&a=1", "token"), true);
    CHECK_INT(query_begins_with("t%6Fken&a=1", "token"), true);
    CHECK_INT(query_begins_with("tokens=1", "token"), false);
    CHECK_INT(query_begins_with("a=1&token=x", "token"), false);
    CHECK_INT(query_begins_with("", "token"), false);
    CHECK_INT(list_begins_with("a,b", "a"), 2);
    CHECK_INT(list_begins_with("a,b", "a,b"), 3);
    CHECK_INT(list_begins_with("a", "a"), 1);
    CHECK_INT(list_begins_with("ab", "a"), 0);
    CHECK_INT(list_begins_with("", "a"), 0);
}

static void test_query_value(void)
{
    char out[16];
    CHECK_INT(query_value("error=0.01&measure=sampled", "measure", out, sizeof out), QUERY_FOUND);
    CHECK_TEXT(out, "sampled");
    CHECK_INT(query_value("error=1e+3", "error", out, sizeof out), QUERY_FOUND);
    CHECK_TEXT(out, "1e+3");
    CHECK_INT(query_value("%65rror=1%25&&", "error", out, sizeof out), QUERY_FOUND);
    CHECK_TEXT(out, "1%");
    CHECK_INT(query_value("error", "error", out, sizeof out), QUERY_FOUND);
    CHECK_TEXT(out, "");
    CHECK_INT(query_value("a=b=c", "a", out, sizeof out), QUERY_FOUND);
    CHECK_TEXT(out, "b=c");
    CHECK_INT(query_value(NULL, "error", out, sizeof out), QUERY_ABSENT);
    CHECK_INT(query_value("errors=1", "error", out, sizeof out), QUERY_ABSENT);
    CHECK_INT(query_value("error=1&error=1", "error", out, sizeof out), QUERY_BAD);
    CHECK_INT(query_value("error=%", "error", out, sizeof out), QUERY_BAD);
    CHECK_INT(query_value("error=0123456789abcdef", "error", out, sizeof out), QUERY_BAD);
}

static void test_query_unknown(void)
{
    static const char names[] = "error field:key";
    char out[16];
    CHECK(!query_unknown(NULL, names, out, sizeof out));
    CHECK(!query_unknown("error=1&field=x&", names, out, sizeof out));
    CHECK(query_unknown("error=1&eror=2", names, out, sizeof out));
    CHECK_TEXT(out, "eror");
    CHECK(query_unknown("key=1", names, out, sizeof out) && query_unknown("fiel=1", names, out, sizeof out));
    CHECK(query_unknown("error=1", "", out, sizeof out) && query_unknown("=1", names, out, sizeof out));
    CHECK(query_unknown("%00=1", names, out, sizeof out));
    CHECK_TEXT(out, "");
}

static void test_numbers(void)
{
    double x = 0, v[3];
    CHECK(text_number("0.01", false, &x) && x == 0.01);
    CHECK(text_number("1%", true, &x) && fabs(x - 0.01) < 1e-15);
    CHECK(text_number("-1e-3", false, &x) && x == -1e-3);
    static const char *const bad[] = {"", "nan", "inf", "0x10", "1e999", "1 ", " 1", "1%%", "e", ".", "1,5", "--1",
                                      "1x"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        if (text_number(bad[i], true, &x))
            TEST_FAIL("'%s' is read as %g", bad[i], x);
    CHECK(!text_number("1%", false, &x));
    const char *at = "-2.5e1) 7";
    CHECK(text_take_number(&at, &x) && x == -25 && strcmp(at, ") 7") == 0);
    CHECK(!text_take_number(&at, &x) && *at == ')');
    CHECK(text_numbers("1,-2.5,3e2", 3, v) && v[0] == 1 && v[1] == -2.5 && v[2] == 300);
    CHECK(!text_numbers("1,2", 3, v));
    CHECK(!text_numbers("1,2,3,4", 3, v));
    CHECK(!text_numbers("1,2,", 3, v));
    CHECK(!text_numbers("1,2,3,", 3, v));
}

static void test_counts(void)
{
    uint64_t n = 0;
    CHECK(text_count("0", false, &n) && n == 0);
    CHECK(text_count("18446744073709551615", false, &n) && n == UINT64_MAX);
    CHECK(!text_count("18446744073709551616", false, &n));
    CHECK(text_count("64K", true, &n) && n == 65536);
    CHECK(!text_count("64K", false, &n));
    CHECK(!text_count("99999999999G", true, &n));
    CHECK(!text_count("-1", false, &n) && !text_count("", true, &n) && !text_count("K", true, &n) &&
          !text_count("1.5", true, &n));
}

static void test_ranges(void)
{
    static const struct {
        const char *header;
        uint64_t size;
        enum range_result result;
        uint64_t first, length;
    } cases[] = {
        {"bytes=0-99", 1000, RANGE_OK, 0, 100},
        {"bytes=0-", 1000, RANGE_OK, 0, 1000},
        {"bytes=900-2000", 1000, RANGE_OK, 900, 100},
        {"bytes=-5", 1000, RANGE_OK, 995, 5},
        {"bytes=-2000", 1000, RANGE_OK, 0, 1000},
        {"Bytes= 1-1 ", 1000, RANGE_OK, 1, 1},
        {"bytes=0-99999999999999999999999999", 1000, RANGE_OK, 0, 1000},
        {"bytes=1000-", 1000, RANGE_UNSATISFIABLE, 0, 0},
        {"bytes=99999999999999999999-", 1000, RANGE_UNSATISFIABLE, 0, 0},
        {"bytes=-0", 1000, RANGE_UNSATISFIABLE, 0, 0},
        {"bytes=0-0", 0, RANGE_UNSATISFIABLE, 0, 0},
        {"bytes=-1", 0, RANGE_UNSATISFIABLE, 0, 0},
        {NULL, 1000, RANGE_IGNORED, 0, 0},
        {"", 1000, RANGE_IGNORED, 0, 0},
        {"bytes=", 1000, RANGE_IGNORED, 0, 0},
        {"bytes=-", 1000, RANGE_IGNORED, 0, 0},
        {"bytes=5-4", 1000, RANGE_IGNORED, 0, 0},
        {"bytes=0-1,5-6", 1000, RANGE_IGNORED, 0, 0},
        {"items=0-1", 1000, RANGE_IGNORED, 0, 0},
        {"bytes=a-b", 1000, RANGE_IGNORED, 0, 0},
        {"bytes=0x1-2", 1000, RANGE_IGNORED, 0, 0},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        uint64_t first = 0, length = 0;
        enum range_result result = range_parse(cases[i].header, cases[i].size, &first, &length);
        if (result != cases[i].result || first != cases[i].first || length != cases[i].length)
            TEST_FAIL("%s: %d, %llu + %llu", cases[i].header ? cases[i].header : "(none)", result,
                      (unsigned long long)first, (unsigned long long)length);
    }
}

static void test_etags(void)
{
    CHECK(etag_list_has("\"a\"", "\"a\""));
    CHECK(etag_list_has("\"b\", W/\"a\"", "\"a\""));
    CHECK(etag_list_has(" * ", "\"a\""));
    CHECK(etag_list_has("\"x,y\",\"a\"", "\"a\""));
    CHECK(!etag_list_has("\"ab\"", "\"a\""));
    CHECK(!etag_list_has("a", "\"a\""));
    CHECK(!etag_list_has("\"a", "\"a\""));
    CHECK(!etag_list_has("*a", "\"a\""));
    CHECK(!etag_list_has("", "\"a\""));
    CHECK(!etag_list_has(NULL, "\"a\""));
    CHECK(etag_same("\"a\"", "\"a\""));
    CHECK(!etag_same("W/\"a\"", "\"a\""));
    CHECK(!etag_same("Sat, 01 Jan 2000 00:00:00 GMT", "\"a\""));
}

static void test_codings(void)
{
    static const struct {
        const char *header;
        enum coding coding, file; // of what is made, of a file that has Brotli, too
    } cases[] = {
        {NULL, CODING_IDENTITY, CODING_IDENTITY},
        {"", CODING_IDENTITY, CODING_IDENTITY},
        {"gzip", CODING_GZIP, CODING_GZIP},
        {"gzip, deflate, br, zstd", CODING_ZSTD, CODING_BROTLI},
        {"zstd;q=0.5, gzip;q=0.8", CODING_GZIP, CODING_GZIP},
        {"zstd;q=0, gzip", CODING_GZIP, CODING_GZIP},
        {"gzip;q=0", CODING_IDENTITY, CODING_IDENTITY},
        {"gzip;q=0.0, *;q=0", CODING_IDENTITY, CODING_IDENTITY},
        {"*", CODING_ZSTD, CODING_BROTLI},
        {"br", CODING_IDENTITY, CODING_BROTLI},
        {"identity, gzip;q=0.5", CODING_IDENTITY, CODING_IDENTITY},
        {"identity;q=0.5, gzip;q=0.5", CODING_GZIP, CODING_GZIP},
        {"GZIP ; Q=1.000", CODING_GZIP, CODING_GZIP},
        {"gzip;q=2", CODING_IDENTITY, CODING_IDENTITY},
        {"gzip;q=abc", CODING_IDENTITY, CODING_IDENTITY},
        {"xgzip, gzipx", CODING_IDENTITY, CODING_IDENTITY},
        {",,, gzip ,", CODING_GZIP, CODING_GZIP},
        {"br;q=0, gzip", CODING_GZIP, CODING_GZIP},
        {"br;q=0.5, zstd", CODING_ZSTD, CODING_ZSTD},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        for (int file = 0; file < 2; file++) {
            enum coding chosen = coding_choose(cases[i].header, CODINGS_MADE | (file ? 1u << CODING_BROTLI : 0));
            if (chosen != (file ? cases[i].file : cases[i].coding))
                TEST_FAIL("'%s' chooses %d", cases[i].header ? cases[i].header : "(none)", chosen);
        }
}

int main(void)
{
    RUN(test_percent_decode);
    RUN(test_percent_encode);
    RUN(test_query_value);
    RUN(test_query_unknown);
    RUN(test_numbers);
    RUN(test_names);
    RUN(test_counts);
    RUN(test_ranges);
    RUN(test_etags);
    RUN(test_codings);
    return test_end();
}
