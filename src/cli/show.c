/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/show.h"

#include <string.h>
#include <strings.h>

#include "format/fail.h"
#include "format/write/prefix.h"
#include "src/cli/extract_step.h"
#include "src/io/io.h"
#include "src/stream/level_mesh.h"
#include "src/stream/series_time.h"

enum { SHOWN_TETS = 200000 };

bool show_is_output(const char *path)
{
    const char *dot = strrchr(path, '.');
    return dot && (strcasecmp(dot, ".vtkhdf") == 0 || strcasecmp(dot, ".hdf") == 0);
}

struct shown {
    struct tetlod_file *file;
    uint32_t level;                  /* of a stream without steps */
    struct step_selection selection; /* of one with steps */
};

static enum tetlod_status show_level(const struct shown *shown, struct tetmesh *out, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(shown->file);
    struct tetlod_cursor *cursor;
    TETLOD_TRY(tetlod_cursor_new(&cursor, shown->file, NULL, 0, error));
    enum tetlod_status status = tetlod_cursor_seek(cursor, shown->level, error);
    if (status == TETLOD_OK)
        status = level_mesh_take(info, &cursor, out, error);
    if (status == TETLOD_OK)
        status = level_mesh_cells_here(shown->file, NULL, NULL, out, error);
    tetlod_cursor_free(cursor);
    return status;
}

static enum tetlod_status show_step(const struct shown *shown, uint32_t step, struct tetmesh *out,
                                    struct tetlod_error *error)
{
    char about[1024];
    struct step_selection selection = shown->selection;
    selection.step = step;
    return extract_step(shown->file, &selection, FORM_STREAM, out, about, sizeof about, error);
}

static enum tetlod_status show_mesh(void *opaque, uint32_t step, struct tetmesh *out, struct tetlod_error *error)
{
    const struct shown *shown = opaque;
    *out = (struct tetmesh){0};
    enum tetlod_status status = shown->level == TETLOD_NONE ? show_step(shown, step, out, error)
                                                            : show_level(shown, out, error);
    if (status == TETLOD_OK)
        status = level_mesh_units(tetlod_info(shown->file), out, error);
    if (status != TETLOD_OK)
        tetmesh_fini(out);
    return status;
}

static enum tetlod_status fail_limit(double limit, struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "none of its levels is within an error of %g: give --show a larger "
                                                    "one", limit);
}

/* The error of the finest band whose level has few enough tetrahedra; of the coarsest where none has. */
static double error_of_few(const struct tetlod_info *info, const struct tetlod_series_info *steps)
{
    uint32_t band = 0;
    while (band + 1 < steps->band_count && info->levels[steps->bands[band + 1].level].tets <= SHOWN_TETS)
        band++;
    return steps->bands[band].error;
}

/* Which steps are shown, and how exactly; *count 0: there are none. */
static enum tetlod_status choose_steps(struct shown *shown, double limit, uint32_t *count, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(shown->file);
    struct tetlod_series *series;
    *count = 0;
    if (tetlod_section_index(info, "TIME") == TETLOD_NONE)
        return TETLOD_OK;
    TETLOD_TRY(tetlod_series_new(&series, shown->file, error));
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    *count = series_step_count(info, steps);
    shown->level = TETLOD_NONE;
    shown->selection.error = limit < 0 ? error_of_few(info, steps) : limit;
    tetlod_series_free(series);
    return TETLOD_OK;
}

static enum tetlod_status choose_level(struct shown *shown, double limit, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(shown->file);
    shown->level = limit < 0 ? tetlod_level_for_tets(info, SHOWN_TETS)
                             : tetlod_level_for_error(info, limit, TETLOD_NONE, TETLOD_MAX);
    if (shown->level == TETLOD_NONE) // --metric sva and measured do not certify
        shown->level = tetlod_level_for_error(info, limit, TETLOD_NONE, TETLOD_SAMPLED);
    return shown->level == TETLOD_NONE ? fail_limit(limit, error) : TETLOD_OK;
}

static enum tetlod_status write_whole(void *opaque, const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    const struct tetlod_file *file = opaque;
    return tetlodi_write_prefix(file, tetlod_info(file)->level_count - 1, sink, error);
}

enum tetlod_status show_write(struct tetlod_file *file, double limit, const struct tetlodi_sink *sink,
                              struct tetlod_error *error)
{
    struct shown shown = {.file = file};
    uint32_t steps;
    TETLOD_TRY(choose_steps(&shown, limit, &steps, error));
    if (!steps)
        TETLOD_TRY(choose_level(&shown, limit, error));
    const struct shown_stream stream = {tetlod_info(file)->bytes, write_whole, file};
    return io_write_stream(&stream, &(struct shown_meshes){steps, show_mesh, &shown}, sink, error);
}
