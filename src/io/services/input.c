/* SPDX-License-Identifier: BSD-3-Clause */
#define _GNU_SOURCE // realpath
#include "src/io/services/input.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

/* A file's own path without links; of one that is not there, which only says where others are, the folder's and its
 * name. The caller frees it. */
static char *real_path(const char *path)
{
    char *real = realpath(path, NULL), *out = NULL, *folder = NULL;
    const char *slash = strrchr(path, '/');
    size_t size = 0;
    if (real)
        return real;
    char *named = slash ? strndup(path, (size_t)(slash - path) + 1) : strdup(".");
    folder = named ? realpath(named, NULL) : NULL;
    size = folder ? strlen(folder) + strlen(path) + 2 : 0;
    out = size ? array_new(size, 1) : NULL;
    if (out)
        snprintf(out, size, "%s/%s", strcmp(folder, "/") == 0 ? "" : folder, slash ? slash + 1 : path);
    free(named);
    free(folder);
    return out;
}

/* Whether `path` is in the folder of `base`, whatever links are on the way. */
static bool is_beside(const char *base, const char *path)
{
    char *folder = real_path(base), *file = realpath(path, NULL);
    char *slash = folder ? strrchr(folder, '/') : NULL;
    bool beside = slash && file && strncmp(folder, file, (size_t)(slash - folder) + 1) == 0;
    free(folder);
    free(file);
    return beside;
}

bool sniff_holds(const unsigned char *bytes, size_t size, const char *word)
{
    size_t length = strlen(word);
    for (const unsigned char *at = bytes, *end = bytes + size; (size_t)(end - at) >= length; at++) {
        at = memchr(at, *word, (size_t)(end - at) - length + 1);
        if (!at)
            return false;
        if (memcmp(at, word, length) == 0)
            return true;
    }
    return false;
}

enum tetlod_status io_resolve(const struct io_input *from, const char *name, char **out, struct tetlod_error *error)
{
    const char *slash = from->path && *name != '/' ? strrchr(from->path, '/') : NULL;
    size_t folder = slash ? (size_t)(slash - from->path) + 1 : 0, size = folder + strlen(name) + 1;
    if (!from->path)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "names the file %.400s, but is not in a folder", name);
    *out = array_new(size, 1);
    if (!*out)
        return tetlodi_fail_nomem(error, "a file's name", size);
    snprintf(*out, size, "%.*s%s", (int)folder, from->path, name);
    char *real = realpath(*out, NULL);
    bool is_there = real != NULL;
    free(real);
    if (from->options && from->options->output && file_same(*out, from->options->output)) {
        free(*out);
        *out = NULL;
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "names the file %.400s, which is the output, too: give the output another name", name);
    }
    if (!is_there || (from->options && from->options->follow) || is_beside(from->path, *out))
        return TETLOD_OK; // opening it says why it is not there
    free(*out);
    *out = NULL;
    return tetlodi_fail(error, TETLOD_ERR_MESH,
                        "names the file %.400s, which is not in its folder; --follow reads it anyway",
                        name);
}

void io_input_close(struct opened_input *opened)
{
    file_input_close(&opened->file);
    file_view_close(&opened->view);
}

enum tetlod_status io_input_open(struct opened_input *opened, struct io_input *input, const char *path,
                                 struct tetlod_error *error)
{
    *opened = (struct opened_input){.file = {-1, 0}};
    TETLOD_TRY(file_input_open(&opened->file, path, error));
    TETLOD_TRY(file_view_open(&opened->view, &opened->file, path, error));
    input->file = &opened->file;
    input->view = &opened->view;
    input->bytes = opened->view.bytes;
    input->size = opened->view.size;
    return TETLOD_OK;
}

enum tetlod_status io_read_named(struct blocks *out, const struct io_input *from, const char *name,
                                 struct io_report *report, struct tetlod_error *error)
{
    enum { MAX_DEPTH = 8 };
    char *path = NULL;
    struct opened_input opened;
    struct tetlod_error inner = {.offset = UINT64_MAX};
    struct io_input input = {.options = from->options, .depth = from->depth + 1, .read_any = from->read_any};
    if (from->depth == MAX_DEPTH)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "files name one another more than %d times over", MAX_DEPTH);
    TETLOD_TRY(io_resolve(from, name, &path, error));
    enum tetlod_status status = io_input_open(&opened, &input, path, error); // which names it
    if (status == TETLOD_OK) {
        input.path = path;
        status = from->read_any(out, &input, report, &inner);
        if (status != TETLOD_OK)
            tetlodi_fail(error, status, "%.400s: %s", name, inner.message);
    }
    io_input_close(&opened);
    free(path);
    return status;
}
