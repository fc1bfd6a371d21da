/* SPDX-License-Identifier: BSD-3-Clause */
/* A tetlod stream as a mesh: its finest level. */
#include <string.h>

#include "format/fail.h"
#include "src/io/readers/readers.h"
#include "src/stream/level_mesh.h"
#include "src/util/parallel.h"

bool stream_sniff(const unsigned char *bytes, size_t size)
{
    static const char magics[2][9] = {"\x89TLD\r\n\x1a\n", "\x89TLH\r\n\x1a\n"}; // SPEC.md, 3.1 and 3.10
    return size >= 8 && (memcmp(bytes, magics[0], 8) == 0 || memcmp(bytes, magics[1], 8) == 0);
}

enum tetlod_status stream_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                            struct tetlod_error *error)
{
    struct block *block;
    TETLOD_TRY(blocks_add(out, &block, error));
    struct tetmesh *mesh = &block->mesh;
    struct tetlod_file *file = NULL;
    struct tetlod_cursor *cursor = NULL;
    enum tetlod_status status;
    const struct tetlod_options options = {.struct_size = sizeof options, .threads = parallel_cores()};
    (void)report;
    TETLOD_TRY_DONE(tetlod_open_memory(&file, input->bytes, input->size, &options, error));
    TETLOD_TRY_DONE(tetlod_cursor_new(&cursor, file, NULL, 0, error));
    TETLOD_TRY_DONE(tetlod_cursor_seek(cursor, tetlod_info(file)->level_count - 1, error));
    TETLOD_TRY_DONE(level_mesh_take(tetlod_info(file), &cursor, mesh, error));
    status = level_mesh_cells(file, TETLOD_NONE, NULL, mesh, error);
    block->cells = (struct cells){.count = mesh->tet_count, .connectivity = mesh->corners,
                                  .connectivity_count = 4 * (uint64_t)mesh->tet_count};
    mesh->corners = NULL; // they are the cells', until these are split
    mesh->tet_count = 0;
done:
    tetlod_cursor_free(cursor);
    tetlod_close(file);
    return status;
}
