/* SPDX-License-Identifier: BSD-3-Clause */
#define _GNU_SOURCE // mkdtemp
#include "tests/reader_fuzz.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <sys/stat.h>
#include <unistd.h>

#include "src/mesh/mesh_check.h"
#include "src/util/file.h"
#include "tests/memory_sink.h"

static void require(bool condition, const char *what, const struct tetlod_error *error)
{
    if (condition)
        return;
    fprintf(stderr, "reader_fuzz: %s: %s\n", what, error->message);
    abort();
}

static bool same_fields(const struct point_field *a, const struct point_field *b, uint32_t vertices)
{
    return strcmp(a->name, b->name) == 0 && a->components == b->components && a->type == b->type &&
           memcmp(a->values, b->values, (size_t)vertices * a->components * sizeof *a->values) == 0;
}

static bool same_meshes(const struct tetmesh *a, const struct tetmesh *b)
{
    bool same = a->vertex_count == b->vertex_count && a->tet_count == b->tet_count &&
                a->field_count == b->field_count && a->position_type == b->position_type &&
                memcmp(a->positions, b->positions, 3 * (size_t)a->vertex_count * sizeof *a->positions) == 0 &&
                memcmp(a->corners, b->corners, 4 * (size_t)a->tet_count * sizeof *a->corners) == 0;
    for (uint32_t f = 0; same && f < a->field_count; f++)
        same = same_fields(&a->fields[f], &b->fields[f], a->vertex_count);
    return same;
}

static void check_round_trip(const struct tetmesh *mesh, const char *path,
                             enum tetlod_status (*write)(const struct tetmesh *, const struct tetlodi_sink *,
                                                         struct tetlod_error *))
{
    struct memory_sink memory = {0};
    struct tetlodi_sink sink = memory_sink(&memory);
    struct tetlod_error error = {0};
    struct tetmesh again = {0};
    struct io_report report = {0};
    require(write(mesh, &sink, &error) == TETLOD_OK, "write", &error);
    struct io_input input = {.bytes = memory.bytes, .size = memory.size};
    require(io_read_input(&again, path, &input, &report, &error) == TETLOD_OK, "read again", &error);
    require(same_meshes(mesh, &again), "not the same mesh", &error);
    tetmesh_fini(&again);
    free(memory.bytes);
}

void reader_fuzz(const char *path, const struct io_input *input)
{
    struct tetmesh mesh = {0};
    struct io_report report = {0};
    struct tetlod_error error = {0};
    struct mesh_report about;
    enum tetlod_status status = io_read_input(&mesh, path, input, &report, &error);
    if (status == TETLOD_OK) {
        require(tetmesh_validate(&mesh, &error) == TETLOD_OK, "accepted, but not valid", &error);
        require(mesh_check(mesh.positions, mesh.corners, mesh.vertex_count, mesh.tet_count, &about,
                           &error) == TETLOD_OK,
                "check", &error);
        check_round_trip(&mesh, "again.vtu", io_write_vtu);
        check_round_trip(&mesh, "again.vtk", io_write_vtk);
    } else
        require(error.status == status && error.message[0] && !strchr(error.message, '\n'),
                "a failure without a message",
                &error);
    tetmesh_fini(&mesh);
}

void reader_fuzz_two(const char *path, const char *other_path, const uint8_t *bytes, size_t size)
{
    if (size == 0)
        return;
    size_t first = (size - 1) * bytes[0] / 255;
    struct io_input input = {.bytes = bytes + 1, .size = first};
    if (bytes[0] < 255) {
        input.other = bytes + 1 + first;
        input.other_size = size - 1 - first;
        input.other_path = other_path;
    }
    reader_fuzz(path, &input);
}

enum { PATH = 200 };

/* Makes the folders on the way to a file, or removes them where they are empty. */
static void each_folder(const char *folder, const char *name, bool makes)
{
    char path[PATH];
    for (const char *slash = strchr(name, '/'); slash && makes; slash = strchr(slash + 1, '/')) {
        snprintf(path, sizeof path, "%s/%.*s", folder, (int)(slash - name), name);
        mkdir(path, 0700);
    }
    snprintf(path, sizeof path, "%s/%s", folder, name);
    for (char *slash = strrchr(path, '/'); slash && !makes && strlen(path) > strlen(folder);
         slash = strrchr(path, '/')) {
        *slash = 0;
        rmdir(path);
    }
}

static void write_file(const char *folder, const char *name, const uint8_t *bytes, size_t size)
{
    char path[PATH];
    each_folder(folder, name, true);
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "wb");
    if (file && size)
        fwrite(bytes, 1, size, file);
    if (file)
        fclose(file);
}

void reader_fuzz_folder(const char *const *names, size_t count, const uint8_t *bytes, size_t size)
{
    char folder[] = "/tmp/reader_fuzz_XXXXXX", path[PATH];
    struct io_input input = {.path = path};
    unsigned char *first = NULL;
    struct tetlod_error error;
    if (size < count || !mkdtemp(folder))
        return;
    const uint8_t *at = bytes + count - 1, *end = bytes + size;
    for (size_t i = 0; i < count; i++) {
        size_t left = (size_t)(end - at), some = i + 1 < count ? left * bytes[i] / 255 : left;
        write_file(folder, names[i], at, some);
        at += some;
    }
    snprintf(path, sizeof path, "%s/%s", folder, names[0]);
    if (file_read(path, &first, &input.size, &error) == TETLOD_OK) {
        input.bytes = first;
        reader_fuzz(path, &input);
    }
    free(first);
    for (size_t i = 0; i < count; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        unlink(path);
        each_folder(folder, names[i], false);
    }
}
