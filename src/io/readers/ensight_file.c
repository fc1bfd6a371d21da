/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/readers/ensight_file.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/readers/readers.h"

enum { WORD = 4, PART = 1 << 16 }; // of binary files: int32 or float32; how many are converted at a time

static size_t left(const struct ensight_file *file)
{
    return (size_t)(file->rest.end - file->rest.at);
}

enum tetlod_status ensight_fail(const struct ensight_file *file, const char *why)
{
    unsigned long line = 1;
    if (file->kind != ENSIGHT_TEXT)
        return tetlodi_fail(file->error, TETLOD_ERR_MESH, "%.400s: byte %td: %s", file->name,
                            file->rest.at - file->begin, why);
    for (const char *at = file->begin; at < file->rest.at; at++)
        line += *at == '\n';
    return tetlodi_fail(file->error, TETLOD_ERR_MESH, "%.400s: line %lu: %s", file->name, line, why);
}

static uint32_t word_at(const char *at, bool big_endian)
{
    uint32_t word;
    values_to_points((const unsigned char *)at, VALUE_UINT32, big_endian, 1, &word);
    return word;
}

/* The payload of the next record of a binary file; NULL if it does not fit. */
static const char *take_record(struct ensight_file *file, uint64_t size)
{
    bool marked = file->kind == ENSIGHT_FORTRAN;
    size_t marker = marked ? WORD : 0;
    const char *payload = file->rest.at + marker;
    if (left(file) < 2 * marker || size > left(file) - 2 * marker)
        return NULL;
    if (marked && (word_at(file->rest.at, file->big_endian) != size ||
                   word_at(payload + size, file->big_endian) != size))
        return NULL;
    file->rest.at = payload + size + marker;
    return payload;
}

static bool is_blank(char c)
{
    return c == ' ' || c == 0 || (c >= '\t' && c <= '\r');
}

bool ensight_line(struct ensight_file *file, char out[ENSIGHT_LINE + 1])
{
    struct text line;
    *out = 0;
    if (left(file) == 0)
        return false;
    if (file->kind == ENSIGHT_TEXT)
        line = text_line(&file->rest);
    else {
        const char *payload = take_record(file, ENSIGHT_LINE);
        if (!payload)
            return false;
        line = (struct text){payload, payload + strnlen(payload, ENSIGHT_LINE)};
    }
    while (line.at < line.end && is_blank(*line.at))
        line.at++;
    while (line.at < line.end && is_blank(line.end[-1]))
        line.end--;
    size_t length = (size_t)(line.end - line.at) < ENSIGHT_LINE ? (size_t)(line.end - line.at) : ENSIGHT_LINE;
    memcpy(out, line.at, length);
    out[length] = 0;
    return true;
}

static void find_kind(struct ensight_file *file)
{
    char line[ENSIGHT_LINE + 1];
    const char *at = file->rest.at;
    if (left(file) >= ENSIGHT_LINE && memcmp(at, "C Binary", 8) == 0)
        file->kind = ENSIGHT_C;
    else if (left(file) >= ENSIGHT_LINE + 2 * WORD && memcmp(at + WORD, "Fortran Binary", 14) == 0) {
        file->kind = ENSIGHT_FORTRAN;
        file->big_endian = word_at(at, true) == ENSIGHT_LINE;
    }
    if (file->kind != ENSIGHT_TEXT)
        ensight_line(file, line);
}

enum tetlod_status ensight_open(struct ensight_file *file, const struct io_input *input, const char *name,
                                bool is_geometry,
                                struct tetlod_error *error)
{
    char *path = NULL;
    file->name = name;
    file->view = (struct file_view){0};
    file->error = error;
    enum tetlod_status status = io_resolve(input, name, &path, error);
    if (status == TETLOD_OK)
        status = file_view_path(&file->view, path, error);
    free(path);
    if (status != TETLOD_OK)
        return status;
    file->begin = (const char *)file->view.bytes;
    file->rest = (struct text){file->begin, file->begin + file->view.size};
    if (is_geometry)
        find_kind(file);
    return TETLOD_OK;
}

void ensight_close(struct ensight_file *file)
{
    file_view_close(&file->view);
}

enum tetlod_status ensight_seek(struct ensight_file *file, uint64_t step)
{
    static const char word[] = "BEGIN TIME STEP";
    char line[ENSIGHT_LINE + 1];
    size_t length = sizeof word - 1, marker = file->kind == ENSIGHT_FORTRAN ? WORD : 0;
    if (left(file) < marker + length || memcmp(file->rest.at + marker, word, length) != 0)
        return TETLOD_OK;
    for (const char *at = file->rest.at; (size_t)(file->rest.end - at) >= length; at++) {
        at = memchr(at, *word, (size_t)(file->rest.end - at) - length + 1);
        if (!at)
            break;
        if (memcmp(at, word, length) != 0 || step-- > 0)
            continue;
        file->rest.at = at - marker;
        return ensight_line(file, line) ? TETLOD_OK : ensight_fail(file, "the file ends too early; is it truncated?");
    }
    return ensight_fail(file, "it has fewer steps in time than the case says");
}

void ensight_find_order(struct ensight_file *file)
{
    if (file->kind == ENSIGHT_C && left(file) >= WORD)
        file->big_endian = word_at(file->rest.at, true) < word_at(file->rest.at, false);
}

enum tetlod_status ensight_fits(const struct ensight_file *file, uint64_t count)
{
    uint64_t most = file->kind == ENSIGHT_TEXT ? (left(file) + 1) / 2 : left(file) / WORD;
    return count <= most ? TETLOD_OK : ensight_fail(file, "the file ends too early for this count; is it truncated?");
}

/* After numbers, the next line of text begins. */
static void end_line(struct ensight_file *file)
{
    while (left(file) && *file->rest.at != '\n' && is_blank(*file->rest.at))
        file->rest.at++;
    if (left(file) && *file->rest.at == '\n')
        file->rest.at++;
}

/* The next record of a binary file, of so many words. */
static enum tetlod_status take_words(struct ensight_file *file, uint64_t count, const unsigned char **out)
{
    *out = (const unsigned char *)take_record(file, count * WORD);
    return *out ? TETLOD_OK : ensight_fail(file,
                                           "the next record is not as long as it should be; is the file truncated?");
}

/* The next number of a text. In EnSight 6 numbers may touch: one ends where the next one's sign is, and a whole one
 * where its 8 columns of the line end. */
static struct text take_number(struct ensight_file *file, bool is_whole)
{
    enum { COLUMNS = 8 };
    struct text word = text_word(&file->rest);
    const char *line = word.at;
    if (!file->has_columns)
        return word;
    for (const char *at = word.at + 1; at < word.end; at++)
        if ((*at == '-' || *at == '+') && at[-1] != 'e' && at[-1] != 'E')
            word.end = at;
    while (is_whole && word.end - word.at > COLUMNS && line > file->begin && line[-1] != '\n')
        line--;
    if (is_whole && word.end - word.at > COLUMNS)
        word.end = word.at + COLUMNS - (word.at - line) % COLUMNS;
    file->rest.at = word.end;
    return word;
}

/* Whole numbers as they are, or narrowed, or only past them. */
static enum tetlod_status take_ints(struct ensight_file *file, uint64_t count, int64_t *wide, uint32_t *narrow)
{
    const unsigned char *words;
    int64_t value;
    TETLOD_TRY(ensight_fits(file, count));
    if (file->kind != ENSIGHT_TEXT) {
        TETLOD_TRY(take_words(file, count, &words));
        for (size_t i = 0; (wide || narrow) && i < count; i += PART) {
            size_t part = count - i < PART ? (size_t)count - i : PART;
            if (wide)
                values_to_ints(words + i * WORD, VALUE_INT32, file->big_endian, part, wide + i);
            else
                values_to_points(words + i * WORD, VALUE_INT32, file->big_endian, part, narrow + i);
            file_view_pass(&file->view, words + i * WORD);
        }
        return TETLOD_OK;
    }
    for (uint64_t i = 0; i < count; i++) {
        struct text word = take_number(file, true);
        if (!text_int(&word, &value))
            return ensight_fail(file, "there should be a whole number here");
        if (wide)
            wide[i] = value;
        else if (narrow)
            narrow[i] = cells_point(value);
        file_view_pass(&file->view, file->rest.at);
    }
    end_line(file);
    return TETLOD_OK;
}

enum tetlod_status ensight_ints(struct ensight_file *file, uint64_t count, int64_t *out)
{
    return take_ints(file, count, out, NULL);
}

enum tetlod_status ensight_points(struct ensight_file *file, uint64_t count, uint32_t *out)
{
    TETLOD_TRY(take_ints(file, count, NULL, out));
    for (uint64_t i = 0; i < count; i++)
        out[i] = out[i] == TETLOD_NONE || out[i] == 0 ? TETLOD_NONE : out[i] - 1;
    return TETLOD_OK;
}

enum tetlod_status ensight_floats(struct ensight_file *file, uint64_t count, double *out)
{
    const unsigned char *words;
    double value;
    TETLOD_TRY(ensight_fits(file, count));
    if (file->kind != ENSIGHT_TEXT) {
        TETLOD_TRY(take_words(file, count, &words));
        for (size_t i = 0; out && i < count; i += PART) {
            values_to_doubles(words + i * WORD, VALUE_FLOAT32, file->big_endian,
                              count - i < PART ? (size_t)count - i : PART, out + i);
            file_view_pass(&file->view, words + i * WORD);
        }
        return TETLOD_OK;
    }
    for (uint64_t i = 0; i < count; i++) {
        struct text word = take_number(file, false);
        if (!text_double(&word, true, out ? &out[i] : &value))
            return ensight_fail(file, "there should be a number here");
        file_view_pass(&file->view, file->rest.at);
    }
    end_line(file);
    return TETLOD_OK;
}

enum tetlod_status ensight_count(struct ensight_file *file, uint64_t *out)
{
    int64_t count;
    TETLOD_TRY(ensight_ints(file, 1, &count));
    *out = (uint64_t)count;
    return count < 0 ? ensight_fail(file, "a count is negative") : ensight_fits(file, *out);
}
