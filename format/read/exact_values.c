/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/read/exact_values.h"

#include <stdlib.h>

#include "format/coding/record.h"
#include "format/coding/tail.h"
#include "format/fail.h"
#include "format/read/cursor_state.h"

int tetlodi_is_exact_later(const struct tetlod_file *file, uint32_t field)
{
    return file->index.info.exact_last && file->index.exact_later[field];
}

const int64_t *tetlodi_cursor_codes(const struct tetlod_cursor *cursor, uint32_t field)
{
    uint32_t c = 1;
    while (cursor->parts[c] != field + 1)
        c++;
    return cursor->columns[c].codes;
}

enum tetlod_status tetlodi_exact_values(const struct tetlod_file *file, uint32_t field, const int64_t *codes,
                                        double *out, struct tetlod_error *error)
{
    const struct tetlod_info *info = &file->index.info;
    const uint32_t level = info->level_count - 1;
    // borrowed: it is only read
    const struct tetlodi_column column = {.scale = file->index.scales[field + 1],
                                          .components = info->fields[field].components,
                                          .codes = (int64_t *)(uintptr_t)codes};
    struct tetlodi_replay replay = {.column_count = 1};
    struct tetlodi_coder coder;
    const struct tetlodi_recorder recorder = {.replay = &replay, .coders = &coder};
    uint8_t *frame;
    size_t size;
    TETLOD_TRY(tetlodi_read_frame(file, level, field + 1, &frame, &size, error));
    tetlodi_decode_start(&coder, file->index.slowest, frame, size);
    enum tetlod_status status = tetlodi_tail_code(&coder, &column, (uint32_t)info->levels[level].vertices, out, error);
    if (status == TETLOD_OK)
        status = tetlodi_check_ends(&recorder, error);
    free(frame);
    return status;
}
