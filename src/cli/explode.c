/* SPDX-License-Identifier: BSD-3-Clause */
/* The same paths as a server's, with index.json for what is a folder. */
#include "src/cli/explode.h"

#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "format/fail.h"
#include "server/routes/assets.h"
#include "server/routes/stream_json.h"
#include "server/store/catalogue.h"
#include "src/stream/forest.h"
#include "src/io/io.h"
#include "src/stream/level_mesh.h"
#include "src/report/info_json.h"
#include "src/util/array.h"
#include "src/util/file.h"

enum { PATH_CAPACITY = 4096, COPY = 1 << 16, OPENING = 1 << 15 };

struct tree {
    const char *folder;
    const struct explode_options *options;
    struct tetlod_error *error;
};

/* Makes the folders on the way to a path. */
static enum tetlod_status make_folders(const struct tree *tree, char *path)
{
    for (char *slash = strchr(path + 1, '/'); slash; slash = strchr(slash + 1, '/')) {
        *slash = 0;
        int made = mkdir(path, 0777);
        int why = errno;
        *slash = '/';
        if (made != 0 && why != EEXIST)
            return tetlodi_fail(tree->error, TETLOD_ERR_IO, "%.400s: cannot make its folder: %s", path, strerror(why));
    }
    return TETLOD_OK;
}

__attribute__((format(printf, 3, 4))) static enum tetlod_status begin(const struct tree *tree, struct file_output **out,
                                                                      const char *format, ...)
{
    char path[PATH_CAPACITY];
    size_t used = (size_t)snprintf(path, sizeof path, "%s/", tree->folder);
    va_list arguments;
    *out = NULL;
    va_start(arguments, format);
    used += used < sizeof path ? (size_t)vsnprintf(path + used, sizeof path - used, format, arguments) : 0;
    va_end(arguments);
    if (used >= sizeof path)
        return tetlodi_fail(tree->error, TETLOD_ERR_IO, "%.400s: the path is too long", tree->folder);
    TETLOD_TRY(make_folders(tree, path));
    return file_output_open(out, path, tree->error);
}

/* Commits what was written, or takes it back. */
static enum tetlod_status finish(const struct tree *tree, struct file_output *output, enum tetlod_status status)
{
    return file_output_finish(output, status, tree->error);
}

static enum tetlod_status write_json(const struct tree *tree, struct file_output *output, json_t *object)
{
    char *text = object ? json_dumps(object, INFO_JSON_FLAGS | JSON_INDENT(1)) : NULL;
    struct tetlodi_sink sink = file_output_sink(output);
    enum tetlod_status status =
        text ? sink.write(sink.opaque, text, strlen(text)) : tetlodi_fail_nomem(tree->error, "JSON", 0);
    free(text);
    json_decref(object);
    return finish(tree, output, status);
}

static enum tetlod_status copy_bytes(const struct tree *tree, struct file_output *output, struct dataset *dataset,
                                     uint64_t first, uint64_t end)
{
    struct tetlodi_sink sink = file_output_sink(output);
    unsigned char *block = array_new(COPY, 1);
    enum tetlod_status status = block ? TETLOD_OK : tetlodi_fail_nomem(tree->error, "a copy", COPY);
    while (status == TETLOD_OK && first < end) {
        size_t some = end - first < COPY ? (size_t)(end - first) : COPY;
        struct tetlod_error why = {0};
        status = dataset_read(dataset, first, block, some, &why);
        if (status != TETLOD_OK)
            status = tetlodi_fail(tree->error, status, "%s: the stream cannot be read: %.400s", dataset_id(dataset),
                                  why.message);
        else
            status = sink.write(sink.opaque, block, some);
        first += some;
    }
    free(block);
    return finish(tree, output, status);
}

static enum tetlod_status write_levels(const struct tree *tree, struct dataset *dataset, const char *id)
{
    const struct tetlod_info *info = dataset_info(dataset);
    struct forest *forest = NULL;
    struct file_output *output;
    enum tetlod_status status = forest_new(&forest, dataset_file(dataset), info->level_count - 1, tree->error);
    while (status == TETLOD_OK && forest_levels(forest) < info->level_count)
        status = forest_grow(forest, tree->error);
    for (uint32_t k = 0; status == TETLOD_OK && k < info->level_count; k++) {
        struct tetmesh mesh;
        status = forest_mesh(forest, k, &mesh, tree->error);
        if (status != TETLOD_OK)
            break;
        status = level_mesh_units(info, &mesh, tree->error);
        if (status == TETLOD_OK)
            status = begin(tree, &output, "v1/meshes/%s/%s/levels/%" PRIu32 "/mesh.vtu", id, info->cid, k);
        if (status == TETLOD_OK) {
            struct tetlodi_sink sink = file_output_sink(output);
            status = finish(tree, output, io_write_vtu(&mesh, &sink, tree->error));
        }
        tetmesh_fini(&mesh);
    }
    forest_free(forest);
    return status;
}

static enum tetlod_status write_stream(const struct tree *tree, struct dataset *dataset)
{
    const struct tetlod_info *info = dataset_info(dataset);
    struct file_output *output;
    const char *id = dataset_id(dataset); // as it is: servers of files decode paths. A stream's file has that name
    TETLOD_TRY(begin(tree, &output, "v1/meshes/%s/index.json", id));
    TETLOD_TRY(write_json(tree, output, describe_stream(dataset, id)));
    TETLOD_TRY(begin(tree, &output, "v1/meshes/%s/%s/stream", id, info->cid));
    TETLOD_TRY(copy_bytes(tree, output, dataset, 0, info->bytes));
    TETLOD_TRY(begin(tree, &output, "v1/meshes/%s/prefix",
                     id)); // whatever is asked for: a beginning that a client goes on from
    TETLOD_TRY(copy_bytes(tree, output, dataset, 0, info->levels[tetlod_level_for_bytes(info, OPENING)].end));
    TETLOD_TRY(begin(tree, &output, "v1/meshes/%s/%s/levels/0/mesh.tetlod", id, info->cid));
    TETLOD_TRY(copy_bytes(tree, output, dataset, 0, info->levels[0].end));
    for (uint32_t k = 1; k < info->level_count; k++) {
        TETLOD_TRY(begin(tree, &output, "v1/meshes/%s/%s/records/%" PRIu32 "-%" PRIu32, id, info->cid, k - 1, k));
        TETLOD_TRY(copy_bytes(tree, output, dataset, info->levels[k].offset, info->levels[k].end));
    }
    return tree->options->meshes ? write_levels(tree, dataset, id) : TETLOD_OK;
}

/* The page; a path that ends in '/' is its index.html. */
static enum tetlod_status write_page(const struct tree *tree)
{
    for (size_t i = 0; i < embedded_file_count; i++) {
        const struct embedded_file *file = &embedded_files[i];
        const struct embedded_bytes *plain = &file->coded[CODING_IDENTITY];
        struct file_output *output;
        if (strncmp(file->path, "/view/", 6) == 0) // a server's alone: it stands for every stream there
            continue;
        bool is_folder = file->path[strlen(file->path) - 1] == '/';
        TETLOD_TRY(begin(tree, &output, "%s%s", file->path + 1, is_folder ? "index.html" : ""));
        struct tetlodi_sink sink = file_output_sink(output);
        TETLOD_TRY(finish(tree, output, sink.write(sink.opaque, plain->bytes, (size_t)(plain->end - plain->bytes))));
    }
    return TETLOD_OK;
}

enum tetlod_status explode(const struct explode_options *options, struct tetlod_error *error)
{
    const struct tree tree = {options->folder, options, error};
    const struct catalogue_options from = {.paths = options->paths, .path_count = options->path_count};
    struct catalogue *catalogue;
    struct file_output *output;
    TETLOD_TRY(catalogue_open(&catalogue, &from, error));
    size_t count = 0;
    struct dataset **list = catalogue_list(catalogue, SIZE_MAX, &count, NULL);
    json_t *meshes = json_array();
    enum tetlod_status status = list ? TETLOD_OK : tetlodi_fail_nomem(error, "the catalogue", 0);
    for (size_t i = 0; i < count; i++) {
        if (status == TETLOD_OK)
            status = write_stream(&tree, list[i]);
        json_array_append_new(meshes, describe_in_catalogue(dataset_info(list[i]), dataset_id(list[i])));
        dataset_release(list[i]);
    }
    free(list);
    catalogue_close(catalogue);
    json_t *object = json_pack("{s:I, s:o}", "count", (json_int_t)count, "meshes", meshes);
    if (status == TETLOD_OK && options->viewer)
        status = write_page(&tree);
    if (status == TETLOD_OK)
        status = begin(&tree, &output, "v1/meshes/index.json");
    if (status == TETLOD_OK)
        return write_json(&tree, output, object);
    json_decref(object);
    return status;
}
