/* SPDX-License-Identifier: BSD-3-Clause */
/* A tetlod stream as a mesh: its finest level. */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/formats.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

static enum tetlod_status copy_mesh(struct tetmesh *mesh, struct cells *cells, const struct tetlod_info *info, const struct tetlod_mesh *from,
                                    struct tetlod_error *error)
{
    TETLOD_TRY(assemble_points(mesh, from->vertices, info->position_type, error));
    memcpy(mesh->positions, from->positions, 3 * (size_t)from->vertices * sizeof *mesh->positions);
    cells->connectivity = array_new(from->tets, 4 * sizeof *cells->connectivity);
    if (!cells->connectivity)
        return tetlodi_fail_nomem(error, "the tetrahedra", (uint64_t)from->tets * 16);
    memcpy(cells->connectivity, from->corners, 4 * (size_t)from->tets * sizeof *cells->connectivity);
    cells->count = from->tets;
    cells->connectivity_count = 4 * (uint64_t)from->tets;
    for (uint32_t f = 0; f < info->field_count; f++) {
        const struct tetlod_field *field = &info->fields[f];
        TETLOD_TRY(assemble_field(mesh, field->name, field->components, field->type, error));
        memcpy(mesh->fields[f].values, from->fields[f],
               (size_t)field->components * from->vertices * sizeof *mesh->fields[f].values);
    }
    return TETLOD_OK;
}

static enum tetlod_status copy_cells(struct tetmesh *mesh, const struct tetlod_file *file, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    for (uint32_t f = 0; f < info->cell_field_count; f++) {
        const struct tetlod_cell_field *field = &info->cell_fields[f];
        enum tetlod_type type = field->type == TETLOD_CELL_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
        TETLOD_TRY(tetmesh_add_cell_field(mesh, field->name, field->components, type, info->tets, error));
        mesh->cell_fields[f].is_integer = field->type > TETLOD_CELL_FLOAT64;
        TETLOD_TRY(tetlod_cells(file, f, mesh->cell_fields[f].values, error));
    }
    return TETLOD_OK;
}

bool stream_sniff(const unsigned char *bytes, size_t size)
{
    static const char magic[] = "\x89TLD\r\n\x1a\n"; // SPEC.md, header
    return size >= sizeof magic - 1 && memcmp(bytes, magic, sizeof magic - 1) == 0;
}

enum tetlod_status stream_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                            struct tetlod_error *error)
{
    struct block *block;
    TETLOD_TRY(blocks_add(out, &block, error));
    struct tetmesh *mesh = &block->mesh;
    struct tetlod_file *file = NULL;
    struct tetlod_cursor *cursor = NULL;
    struct tetlod_mesh finest;
    enum tetlod_status status;
    const struct tetlod_options options = {.struct_size = sizeof options, .threads = parallel_cores()};
    (void)report;
    TETLOD_TRY_DONE(tetlod_open_memory(&file, input->bytes, input->size, &options, error));
    TETLOD_TRY_DONE(tetlod_cursor_new(&cursor, file, NULL, 0, error));
    TETLOD_TRY_DONE(tetlod_cursor_seek(cursor, tetlod_info(file)->level_count - 1, error));
    tetlod_cursor_mesh(cursor, &finest);
    TETLOD_TRY_DONE(copy_mesh(mesh, &block->cells, tetlod_info(file), &finest, error));
    status = copy_cells(mesh, file, error);
done:
    tetlod_cursor_free(cursor);
    tetlod_close(file);
    return status;
}
