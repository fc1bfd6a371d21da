/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/read/series_cells.h"

#include <stdlib.h>
#include <string.h>

#include "format/coding/cells.h"
#include "format/common/allowance.h"
#include "format/fail.h"
#include "format/read/cell_values.h"

void tetlodi_series_cells_fini(struct tetlodi_series_cells *cells)
{
    for (uint32_t row = 0; row < cells->time.field_count && cells->tracks; row++) {
        tetlodi_steps_fini(&cells->tracks[row].steps);
        free(cells->tracks[row].bytes);
    }
    free(cells->tracks);
    free(cells->parents);
    free(cells->sections);
    tetlodi_cell_time_fini(&cells->time);
    *cells = (struct tetlodi_series_cells){0};
}

/* ---- the table */

static enum tetlod_status read_table(struct tetlodi_series_cells *cells, const struct tetlodi_section *section,
                                     struct tetlod_error *error)
{
    uint8_t *bytes;
    TETLOD_TRY(tetlodi_read_section(cells->file, section, &bytes, error));
    enum tetlod_status status = tetlodi_cell_time_decode(&cells->time, bytes, (size_t)section->plain, error);
    free(bytes);
    return status;
}

/* Decoding all steps takes no longer than goes with their bytes. */
static bool has_bytes_for_steps(const struct tetlodi_series_cells *cells)
{
    const struct tetlodi_index *index = &cells->file->index;
    const struct tetlodi_cell_time *time = &cells->time;
    uint64_t numbers = 0, bytes = 0;
    for (uint32_t row = 0; row < time->field_count; row++)
        for (uint32_t step = 0; step < time->step_count; step++) {
            uint64_t size = time->sizes[(size_t)row * time->step_count + step];
            numbers +=
                size ? (uint64_t)tetlodi_cell_rows(index) * index->info.cell_fields[time->fields[row]].components : 0;
            bytes += size;
        }
    return is_within(numbers, STEP_ROWS_FREE, STEP_ROWS_PER_BYTE, bytes);
}

static const char *time_tag(const struct tetlodi_index *index)
{
    return tetlodi_has_parents(index) ? TAG_PARENT_TIME : TAG_CELL_TIME;
}

/* The table's fields are the stream's, and its rows fill their sections. */
static bool goes_with_stream(struct tetlodi_series_cells *cells, uint32_t step_count)
{
    const struct tetlodi_index *index = &cells->file->index;
    const struct tetlodi_cell_time *time = &cells->time;
    uint32_t row = 0;
    const struct tetlodi_section *table =
        tetlodi_section_find(index->sections, index->info.section_count, time_tag(index));
    if (table == index->sections || strcmp(table[-1].tag, TAG_TIME) != 0 || time->step_count != step_count ||
        time->fields[time->field_count - 1] >= index->info.cell_field_count)
        return false;
    for (uint32_t i = 0; i < index->info.section_count; i++) {
        const struct tetlodi_section *section = &index->sections[i];
        if (strcmp(section->tag, tetlodi_has_parents(index) ? TAG_PARENT_STEPS : TAG_CELL_STEPS) != 0)
            continue;
        if (row == time->field_count || section->flags & SECTION_PACKED ||
            section->frame.size != tetlodi_cell_time_before(time, row, step_count))
            return false;
        cells->sections[row++] = section;
    }
    return row == time->field_count;
}

enum tetlod_status tetlodi_series_cells_open(struct tetlodi_series_cells *cells, const struct tetlod_file *file,
                                             uint32_t step_count, struct tetlod_error *error)
{
    *cells = (struct tetlodi_series_cells){.file = file};
    const struct tetlodi_section *section =
        tetlodi_section_find(file->index.sections, file->index.info.section_count, time_tag(&file->index));
    if (!section)
        return TETLOD_OK;
    TETLOD_TRY(read_table(cells, section, error));
    cells->sections = calloc(cells->time.field_count, sizeof *cells->sections);
    cells->tracks = calloc(cells->time.field_count, sizeof *cells->tracks);
    if (!cells->sections || !cells->tracks)
        return tetlodi_fail_nomem(error, "the steps", cells->time.field_count * sizeof *cells->tracks);
    for (uint32_t row = 0; row < cells->time.field_count; row++)
        cells->tracks[row].group = TETLOD_NONE;
    if (!goes_with_stream(cells, step_count))
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "the table of steps does not go with the stream");
    if (!has_bytes_for_steps(cells))
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "it has more steps than their bytes can hold");
    return TETLOD_OK;
}

uint32_t tetlodi_series_cells_find(const struct tetlodi_series_cells *cells, uint32_t field)
{
    for (uint32_t row = 0; row < cells->time.field_count; row++)
        if (cells->time.fields[row] == field)
            return row;
    return TETLOD_NONE;
}

struct tetlod_span tetlodi_series_cells_span(const struct tetlodi_series_cells *cells, uint32_t row, uint32_t group)
{
    const struct tetlodi_section *section = cells->sections[row];
    uint64_t begin = tetlodi_cell_time_before(&cells->time, row, group * STEP_GROUP);
    uint64_t end = tetlodi_cell_time_before(&cells->time, row, (group + 1) * STEP_GROUP);
    return (struct tetlod_span){section->frame.offset + begin, end - begin};
}

size_t tetlodi_series_cells_parts(const struct tetlodi_series_cells *cells, struct tetlodi_frame *out)
{
    const struct tetlodi_cell_time *time = &cells->time;
    size_t count = 0;
    for (size_t i = 0; i < (size_t)time->field_count * time->group_count; i++) {
        struct tetlod_span span =
            tetlodi_series_cells_span(cells, (uint32_t)(i / time->group_count), (uint32_t)(i % time->group_count));
        if (!span.size)
            continue;
        if (out) {
            out[count] = (struct tetlodi_frame){span.offset, span.size, {0}};
            memcpy(out[count].digest, time->digests[i], DIGEST_SIZE);
        }
        count++;
    }
    return count;
}

/* ---- values */

/* All steps of a group without bytes are the first one; nothing is there to be checked. */
static enum tetlod_status read_group(const struct tetlodi_series_cells *cells, uint32_t row, uint32_t group,
                                     struct tetlod_error *error)
{
    struct tetlodi_cell_track *track = &cells->tracks[row];
    struct tetlod_span span = tetlodi_series_cells_span(cells, row, group);
    struct tetlodi_frame frame = {span.offset, span.size, {0}};
    memcpy(frame.digest, cells->time.digests[(size_t)row * cells->time.group_count + group], DIGEST_SIZE);
    free(track->bytes);
    track->bytes = NULL;
    track->at = 0;
    return span.size ? tetlodi_read_part(cells->file, &frame, GROUP_OF_STEPS, &track->bytes, error) : TETLOD_OK;
}

/* Begins at the first step, from which every group goes on. `values` is scratch. */
static enum tetlod_status open_group(const struct tetlodi_series_cells *cells, uint32_t row, uint32_t group,
                                     double *values, struct tetlod_error *error)
{
    struct tetlodi_cell_track *track = &cells->tracks[row];
    uint32_t number = cells->time.fields[row];
    const struct tetlod_cell_field *field = &cells->file->index.info.cell_fields[number];
    track->group = TETLOD_NONE;
    TETLOD_TRY(tetlodi_read_cell_rows(cells->file, number, values, error));
    TETLOD_TRY(read_group(cells, row, group, error));
    uint32_t rows = (uint32_t)tetlodi_cell_rows(&cells->file->index);
    if (!tetlodi_cell_steps_start(&track->steps, field->type, field->components, rows, values))
        return tetlodi_fail_nomem(error, field->name, (uint64_t)rows * field->components * 8);
    track->group = group;
    track->next = group * STEP_GROUP;
    return TETLOD_OK;
}

enum tetlod_status tetlodi_series_cells_decode(struct tetlodi_series_cells *cells, uint32_t row, uint32_t step,
                                               double *out, struct tetlod_error *error)
{
    struct tetlodi_cell_track *track = &cells->tracks[row];
    uint32_t group = step / STEP_GROUP;
    const struct tetlod_info *info = &cells->file->index.info;
    const struct tetlod_cell_field *field = &info->cell_fields[cells->time.fields[row]];
    TETLOD_TRY(tetlodi_finest_held(&cells->file->index, error));
    if (!cells->parents)
        TETLOD_TRY(tetlodi_read_parents(cells->file, &cells->parents, error));
    if (track->group != group || step + 1 < track->next)
        TETLOD_TRY(open_group(cells, row, group, out, error));
    for (; track->next <= step; track->next++) {
        size_t size = (size_t)cells->time.sizes[(size_t)row * cells->time.step_count + track->next];
        if (size && !tetlodi_steps_decode(&track->steps, track->bytes + track->at, size)) {
            track->group = TETLOD_NONE;
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "step %u is damaged", track->next);
        }
        track->at += size;
    }
    tetlodi_cell_steps_values(&track->steps, field->type, out);
    tetlodi_spread_rows(out, field->components, cells->parents, (uint32_t)info->tets);
    return TETLOD_OK;
}
