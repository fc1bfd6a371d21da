/* SPDX-License-Identifier: BSD-3-Clause */
/* The child sends what it has read through a pipe, array by array, and frees each, so that both together hold it about
 * once. */
#include "src/io/services/contain.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/pages.h"

/* ---- the pipe */

static bool send_bytes(int fd, const void *bytes, size_t size)
{
    const unsigned char *at = bytes;
    while (size) {
        ssize_t sent = write(fd, at, size);
        if (sent < 0 && errno == EINTR)
            continue;
        if (sent <= 0)
            return false;
        at += sent;
        size -= (size_t)sent;
    }
    return true;
}

static bool take_bytes(int fd, void *bytes, size_t size)
{
    unsigned char *at = bytes;
    while (size) {
        ssize_t got = read(fd, at, size);
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            return false;
        at += got;
        size -= (size_t)got;
    }
    return true;
}

/* An array with its size in front; the child's is freed, and given back while it is sent. */
static bool send_array(int fd, void *array, uint64_t size)
{
    enum { PART = 1 << 20 };
    bool good = send_bytes(fd, &size, sizeof size);
    for (size_t at = 0; good && at < size; at += PART) {
        size_t part = size - at < PART ? (size_t)size - at : PART;
        good = send_bytes(fd, (char *)array + at, part);
        pages_drop((char *)array + at, part);
    }
    free(array);
    return good;
}

/* NULL if the size is not the one that is expected, or something fails. */
static void *take_array(int fd, uint64_t expected)
{
    uint64_t size;
    if (!take_bytes(fd, &size, sizeof size) || size != expected)
        return NULL;
    void *array = array_new((size_t)size, 1);
    if (array && size && !take_bytes(fd, array, (size_t)size)) {
        free(array);
        return NULL;
    }
    return array;
}

/* ---- blocks */

struct field_head {
    uint32_t name_size, components;
    uint8_t type, is_integer;
    char unit[UNIT_SIZE];
};

struct block_head {
    uint64_t cell_count, connectivity_count, hidden_count;
    uint32_t vertex_count, field_count, cell_field_count, dims[3];
    uint8_t position_type, has_types, has_connectivity, has_point_numbers, has_cell_numbers;
};

static bool send_field(int fd, struct point_field *field, uint64_t rows)
{
    struct field_head head = {(uint32_t)strlen(field->name), field->components, (uint8_t)field->type,
                              field->is_integer, ""};
    memcpy(head.unit, field->unit, sizeof head.unit);
    bool good = send_bytes(fd, &head, sizeof head) && send_bytes(fd, field->name, head.name_size) &&
                send_array(fd, field->values, rows * field->components * sizeof(double));
    field->values = NULL;
    return good;
}

static bool send_block(int fd, struct block *block)
{
    struct tetmesh *mesh = &block->mesh;
    struct cells *cells = &block->cells;
    uint64_t rows = block_cell_count(block);
    struct block_head head = {cells->count, cells->connectivity_count, block->hidden ? rows : 0, mesh->vertex_count,
                              mesh->field_count, mesh->cell_field_count, {0}, (uint8_t)mesh->position_type,
                              cells->types != NULL, cells->connectivity != NULL, block->point_numbers != NULL,
                              block->cell_numbers != NULL};
    memcpy(head.dims, block->dims, sizeof head.dims);
    bool good = send_bytes(fd, &head, sizeof head) && send_array(fd, mesh->positions,
                                                                 mesh->vertex_count * (uint64_t)24);
    mesh->positions = NULL;
    for (uint32_t f = 0; good && f < mesh->field_count; f++)
        good = send_field(fd, &mesh->fields[f], mesh->vertex_count);
    for (uint32_t f = 0; good && f < mesh->cell_field_count; f++)
        good = send_field(fd, &mesh->cell_fields[f], rows);
    if (good && cells->types)
        good = send_array(fd, cells->types, cells->count) && send_array(fd, cells->offsets, (cells->count + 1) * 8);
    if (good && cells->connectivity)
        good = send_array(fd, cells->connectivity, cells->connectivity_count * 4);
    if (good && block->point_numbers)
        good = send_array(fd, block->point_numbers, mesh->vertex_count * sizeof *block->point_numbers);
    if (good && block->cell_numbers)
        good = send_array(fd, block->cell_numbers, rows * sizeof *block->cell_numbers);
    return good && (!block->hidden || send_array(fd, block->hidden, head.hidden_count));
}

static bool take_numbers(int fd, struct block *block, const struct block_head *head)
{
    if (head->has_point_numbers)
        block->point_numbers = take_array(fd, head->vertex_count * sizeof *block->point_numbers);
    if (head->has_cell_numbers)
        block->cell_numbers = take_array(fd, block_cell_count(block) * sizeof *block->cell_numbers);
    return (!head->has_point_numbers || block->point_numbers) && (!head->has_cell_numbers || block->cell_numbers);
}

static bool take_field(int fd, struct tetmesh *mesh, uint64_t rows)
{
    enum { LONGEST = 4096 };
    struct field_head head;
    char name[LONGEST + 1];
    if (!take_bytes(fd, &head, sizeof head) || head.name_size > LONGEST || !take_bytes(fd, name, head.name_size))
        return false;
    name[head.name_size] = 0;
    enum tetlod_type type = head.type == TETLOD_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
    // the rows come by themselves: room for none
    if (assemble_cell_field(mesh, name, head.components, type, 0, NULL) != TETLOD_OK)
        return false;
    struct point_field *field = &mesh->cell_fields[mesh->cell_field_count - 1];
    field->is_integer = head.is_integer;
    unit_set(field->unit, head.unit, strnlen(head.unit, sizeof head.unit));
    free(field->values);
    field->values = take_array(fd, rows * head.components * sizeof(double));
    return field->values != NULL;
}

/* Fields at points are taken as fields of cells and then moved: both lists are the same. */
static bool take_fields(int fd, struct tetmesh *mesh, const struct block_head *head, uint64_t rows)
{
    for (uint32_t f = 0; f < head->field_count; f++)
        if (!take_field(fd, mesh, head->vertex_count))
            return false;
    mesh->fields = mesh->cell_fields;
    mesh->field_count = mesh->cell_field_count;
    mesh->cell_fields = NULL;
    mesh->cell_field_count = 0;
    for (uint32_t f = 0; f < head->cell_field_count; f++)
        if (!take_field(fd, mesh, rows))
            return false;
    return true;
}

static bool take_block(int fd, struct block *block)
{
    struct block_head head;
    struct cells *cells = &block->cells;
    if (!take_bytes(fd, &head, sizeof head) || head.cell_count > UINT64_MAX / 16)
        return false;
    memcpy(block->dims, head.dims, sizeof head.dims);
    block->mesh.vertex_count = head.vertex_count;
    block->mesh.position_type = head.position_type == TETLOD_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
    block->mesh.positions = take_array(fd, head.vertex_count * (uint64_t)24);
    cells->count = head.cell_count;
    cells->connectivity_count = head.connectivity_count;
    if (!block->mesh.positions || !take_fields(fd, &block->mesh, &head, block_cell_count(block)))
        return false;
    if (head.has_types) {
        cells->types = take_array(fd, cells->count);
        cells->offsets = cells->types ? take_array(fd, (cells->count + 1) * 8) : NULL;
        if (!cells->offsets)
            return false;
    }
    if (head.has_connectivity)
        cells->connectivity = take_array(fd, cells->connectivity_count * 4);
    if (!take_numbers(fd, block, &head))
        return false;
    if (head.hidden_count)
        block->hidden = head.hidden_count == block_cell_count(block) ? take_array(fd, head.hidden_count) : NULL;
    return (!head.has_connectivity || cells->connectivity) && (!head.hidden_count || block->hidden) &&
           (head.has_types || block->dims[0] || cells->connectivity_count == 4 * cells->count);
}

/* ---- the two processes */

struct result {
    enum tetlod_status status;
    char message[sizeof((struct tetlod_error *)0)->message];
    struct io_report report;
    uint64_t blocks;
};

static void raise_limit(int resource, uint64_t more)
{
    struct rlimit limit;
    if (getrlimit(resource, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY)
        return;
    limit.rlim_cur = more < limit.rlim_max - limit.rlim_cur ? limit.rlim_cur + more : limit.rlim_max;
    setrlimit(resource, &limit);
}

void contain_expect(uint64_t size)
{
    enum { MAX_RATIO = 2400 }; // deflate reaches 1032, for numbers that take twice the room here
    raise_limit(RLIMIT_CPU, size >> 22);
    raise_limit(RLIMIT_AS, size < UINT64_MAX / MAX_RATIO ? size * MAX_RATIO : UINT64_MAX);
}

static void set_limit(int resource, rlim_t now)
{
    struct rlimit limit;
    if (getrlimit(resource, &limit) == 0 && now < limit.rlim_cur) {
        limit.rlim_cur = now;
        setrlimit(resource, &limit);
    }
}

/* Libraries trust the counts in a file: they may take a minute and a gigabyte, and what a file of that size is
 * worth. */
static void limit_child(size_t size)
{
    unsigned long pages = 0;
    FILE *about = fopen("/proc/self/statm", "r");
    if (about && fscanf(about, "%lu", &pages) == 1)
        set_limit(RLIMIT_AS, (rlim_t)pages * (rlim_t)sysconf(_SC_PAGESIZE) + (1u << 30));
    if (about)
        fclose(about);
    set_limit(RLIMIT_CPU, 60);
    set_limit(RLIMIT_CORE, 0);
    contain_expect(size);
}

/* What libraries print, and what a crash prints, is not for the user. */
static void be_silent(void)
{
    int nowhere = open("/dev/null", O_WRONLY);
    if (nowhere >= 0)
        dup2(nowhere, STDERR_FILENO);
}

static void run_child(contained_reader read_file, const struct io_input *input, const struct io_report *report, int fd)
{
    struct blocks blocks = {0};
    struct result result = {.report = *report};
    struct tetlod_error error = {.offset = UINT64_MAX};
    limit_child(input->size);
    be_silent();
    result.status = read_file(&blocks, input, &result.report, &error);
    memcpy(result.message, error.message, sizeof result.message);
    result.blocks = result.status == TETLOD_OK ? blocks.count : 0;
    bool good = send_bytes(fd, &result, sizeof result);
    for (size_t b = 0; good && b < result.blocks; b++)
        good = send_block(fd, &blocks.at[b]);
}

static enum tetlod_status take_result(int fd, struct blocks *out, struct io_report *report, struct tetlod_error *error)
{
    struct result result;
    struct block *block;
    const char *format = report->format;
    if (!take_bytes(fd, &result, sizeof result))
        return tetlodi_fail(error, TETLOD_ERR_MESH,
                            "the library that reads this format fails on it: the file is damaged");
    result.message[sizeof result.message - 1] = 0;
    if (result.status != TETLOD_OK)
        return tetlodi_fail(error, result.status, "%s", result.message);
    *report = result.report;
    report->format = format;
    for (uint64_t b = 0; b < result.blocks; b++) {
        TETLOD_TRY(blocks_add(out, &block, error));
        if (!take_block(fd, block))
            return tetlodi_fail(error, TETLOD_ERR_MESH,
                                "what was read of it does not arrive: out of memory, or it is damaged");
    }
    return TETLOD_OK;
}

enum tetlod_status contain_read(contained_reader read_file, struct blocks *out, const struct io_input *input,
                                struct io_report *report, struct tetlod_error *error)
{
    int ends[2], status_of_child;
    if (pipe(ends) != 0)
        return tetlodi_fail(error, TETLOD_ERR_IO, "cannot make a pipe: %s", strerror(errno));
    pid_t child = fork();
    if (child < 0) {
        close(ends[0]);
        close(ends[1]);
        return tetlodi_fail(error, TETLOD_ERR_IO, "cannot start a process to read it: %s", strerror(errno));
    }
    if (child == 0) {
        close(ends[0]);
        run_child(read_file, input, report, ends[1]);
        _exit(0);
    }
    close(ends[1]);
    enum tetlod_status status = take_result(ends[0], out, report, error);
    close(ends[0]);
    while (waitpid(child, &status_of_child, 0) < 0 && errno == EINTR)
        ;
    return status;
}
