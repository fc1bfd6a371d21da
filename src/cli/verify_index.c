/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Exact numbers have exact bounds. Where they are rounded to a grid, the original's bounds are within one step of those
 * of the grid's numbers.
 *
 * Which tetrahedra are degenerate may depend on the order of their corners, in the last bits of a volume. Those for
 * which it may are counted: the figures may differ by them, and by their neighbours, which may lie on one side of a
 * face with them. */
#include "src/cli/verify_index.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/read/grids.h"
#include "src/stream/metadata.h"
#include "src/mesh/sheets.h"
#include "src/mesh/tet_geom.h"
#include "src/cli/verify_boxes.h"
#include "src/pipeline/make_summary.h"
#include "src/util/array.h"

/* Rounding changes a volume, as a part of the cube of the longest edge, by less. */
static const double VOLUME_NOISE = 1e-14;

/* Is a stored range that of the values: exactly, or to one step of the grid that they were rounded to? */
static bool is_range(const double declared[2], const double found[2], const struct tetlodi_grid *grid)
{
    double room = grid->bits ? grid->step * (1 + 1e-9) : 0;
    return fabs(declared[0] - found[0]) <= room && fabs(declared[1] - found[1]) <= room;
}

static enum tetlod_status check_bounds(const struct tetlod_file *file, const struct tetmesh *finest,
                                       struct tetlod_error *error)
{
    static const char *const axes[] = {"x", "y", "z"};
    const struct tetlod_info *info = tetlod_info(file);
    for (unsigned i = 0; i < 3; i++) {
        const struct tetlodi_grid grid = tetlodi_position_grid(file, i);
        const double declared[2] = {info->bounds[0][i], info->bounds[1][i]};
        double found[2] = {INFINITY, -INFINITY};
        for (size_t v = 0; v < finest->vertex_count; v++) {
            found[0] = smaller(found[0], finest->positions[3 * v + i]);
            found[1] = larger(found[1], finest->positions[3 * v + i]);
        }
        if (!is_range(declared, found, &grid))
            return tetlodi_fail(error, TETLOD_ERR_STREAM,
                                "the index says that %s is in %.9g .. %.9g, the finest level has %.9g .. %.9g",
                                axes[i], declared[0], declared[1], found[0], found[1]);
    }
    return TETLOD_OK;
}

static enum tetlod_status check_ranges(const struct tetlod_file *file, const struct tetmesh *finest,
                                       struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    for (uint32_t f = 0; f < info->field_count; f++) {
        const struct tetlod_field *field = &info->fields[f];
        const struct tetlodi_grid grid = tetlodi_field_grid(file, f);
        double found[2];
        point_field_range(&finest->fields[f], finest->vertex_count, found);
        if (field->bounds == TETLOD_NONE && !is_range(field->range, found, &grid))
            return tetlodi_fail(error, TETLOD_ERR_STREAM,
                                "the index says that %.60s is in %.9g .. %.9g, the finest level has %.9g .. %.9g",
                                field->name, field->range[0], field->range[1], found[0], found[1]);
    }
    return TETLOD_OK;
}

struct counts {
    uint64_t degenerate, inverted; /* the latter or folded */
    uint64_t doubtful;
    bool oriented; /* most of the volume has an orientation */
};

static enum tetlod_status count_tets(const struct tetmesh *mesh, struct counts *out, struct tetlod_error *error)
{
    struct sheets sheets;
    double volume = 0, size = 0;
    *out = (struct counts){0};
    TETLOD_TRY(sheets_find(&sheets, mesh, NULL, error));
    const uint32_t *corners = sheets.oriented.corners ? sheets.oriented.corners : mesh->corners;
    for (size_t t = 0; t < mesh->tet_count; t++) {
        const double *p[4];
        for (size_t c = 0; c < 4; c++)
            p[c] = mesh->positions + 3 * (size_t)corners[4 * t + c];
        double volume6 = tet_volume6(p[0], p[1], p[2], p[3]), size2 = tet_size_squared(p[0], p[1], p[2], p[3]),
               cube = size2 * sqrt(size2);
        bool degenerate = tet_orientation(p[0], p[1], p[2], p[3]) == 0;
        out->degenerate += degenerate;
        out->inverted += !sheets.promised[t] && !degenerate;
        out->doubtful += fabs(fabs(volume6) - TET_DEGENERATE * cube) <= VOLUME_NOISE * cube;
        volume += volume6;
        size += fabs(volume6);
    }
    out->oriented = fabs(volume) > 1e-9 * size;
    sheets_fini(&sheets);
    return TETLOD_OK;
}

static bool is_near(uint64_t declared, uint64_t found, uint64_t room)
{
    return (declared > found ? declared - found : found - declared) <= room;
}

static enum tetlod_status check_counts(const struct tetlod_info *info, const struct tetmesh *finest,
                                       struct tetlod_error *error)
{
    struct counts found;
    TETLOD_TRY(count_tets(finest, &found, error));
    if (!is_near(info->degenerate_tets, found.degenerate, found.doubtful))
        return tetlodi_fail(error, TETLOD_ERR_STREAM,
                            "the index says that %llu tetrahedra are degenerate, the finest level has %llu",
                            (unsigned long long)info->degenerate_tets, (unsigned long long)found.degenerate);
    if (found.oriented && !is_near(info->inverted_tets, found.inverted, 5 * found.doubtful))
        return tetlodi_fail(error, TETLOD_ERR_STREAM,
                            "the index says that %llu tetrahedra are inverted or folded, the finest level has %llu",
                            (unsigned long long)info->inverted_tets, (unsigned long long)found.inverted);
    return TETLOD_OK;
}

/* Of numbers of the size of `scale`. */
static bool is_sum(double declared, double found, double scale)
{
    return fabs(declared - found) <= 1e-9 * scale;
}

/* Is there a vertex at a place with the component's least (greatest) value? */
static bool is_extreme_at(const struct tetmesh *mesh, uint32_t field, uint32_t component, const double place[3],
                          bool greatest)
{
    const struct point_field *of = &mesh->fields[field];
    double extreme = of->values[component];
    bool found = false;
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        double value = of->values[of->components * v + component];
        if (greatest ? value > extreme : value < extreme)
            found = false;
        extreme = greatest ? fmax(extreme, value) : fmin(extreme, value);
        found |= value == extreme && memcmp(mesh->positions + 3 * v, place, 3 * sizeof *place) == 0;
    }
    return found;
}

/* The volumes below the thresholds, and the places of extremes. */
static enum tetlod_status compare_distributions(const struct tetmesh *finest, const struct tetlodi_summary *declared,
                                                struct tetlodi_summary *found, struct tetlod_error *error)
{
    size_t rows = (size_t)declared->threshold_count * declared->component_count;
    for (size_t i = 0; i < rows; i++)
        found->below[i][0] = declared->below[i][0];
    TETLOD_TRY(summary_fill_volumes(found, finest, error));
    for (size_t i = 0; i < rows; i++)
        if (!is_sum(declared->below[i][1], found->below[i][1], found->volume))
            return tetlodi_fail(error, TETLOD_ERR_STREAM,
                                "section SUMS says that component %zu is at most %.9g in a volume of %.9g, the finest "
                                "level in %.9g", i / declared->threshold_count, declared->below[i][0],
                                declared->below[i][1], found->below[i][1]);
    uint32_t at = 0;
    for (uint32_t f = 0; f < finest->field_count; f++)
        for (uint32_t c = 0; c < finest->fields[f].components; c++, at++)
            for (int i = 0; i < 2 && rows; i++)
                if (!is_extreme_at(finest, f, c, declared->places[at][i], i))
                    return tetlodi_fail(error, TETLOD_ERR_STREAM,
                                        "section SUMS says that %.60s is %s where it is not", finest->fields[f].name,
                                        i ? "greatest" : "least");
    return TETLOD_OK;
}

static enum tetlod_status compare_sums(const struct tetlod_info *info, const struct tetlodi_summary *declared,
                                       const struct tetlodi_summary *found, struct tetlod_error *error)
{
    uint32_t at = 0;
    if (!is_sum(declared->volume, found->volume, found->volume))
        return tetlodi_fail(error, TETLOD_ERR_STREAM,
                            "section SUMS says that the volume is %.9g, the finest level has %.9g",
                            declared->volume, found->volume);
    for (uint32_t f = 0; f < info->field_count; f++)
        for (uint32_t c = 0; c < info->fields[f].components; c++, at++) {
            const double *a = declared->sums[at], *b = found->sums[at];
            // no integral is more than that of the absolute value, whose square is at most the volume times that of the
            // square
            if (!is_sum(a[0], b[0], sqrt(b[1] * found->volume)) || !is_sum(a[1], b[1], b[1]))
                return tetlodi_fail(error, TETLOD_ERR_STREAM,
                                    "section SUMS says that component %u of %.60s has the integrals %.9g "
                                    "and %.9g, the finest level has %.9g and %.9g",
                                    c, info->fields[f].name, a[0], a[1], b[0], b[1]);
        }
    return TETLOD_OK;
}

/* The sums are the original's: the finest level has them where it is the original. */
static enum tetlod_status check_sums(const struct tetlod_file *file, const struct tetmesh *finest,
                                     struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    struct tetlodi_summary declared, found = {0};
    TETLOD_TRY(tetlodi_summary_read(file, &declared, error));
    enum tetlod_status status = TETLOD_OK;
    if (declared.level_count && info->lossless) {
        status = summary_of_mesh(&found, finest, 0, declared.threshold_count, error);
        if (status == TETLOD_OK)
            status = compare_sums(info, &declared, &found, error);
        if (status == TETLOD_OK)
            status = compare_distributions(finest, &declared, &found, error);
    }
    tetlodi_summary_fini(&declared);
    tetlodi_summary_fini(&found);
    return status;
}

static void widen(double range[2], const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (isfinite(values[i])) {
            range[0] = smaller(range[0], values[i]);
            range[1] = larger(range[1], values[i]);
        }
}

/* Is the range that a table says that of the finite values? */
static enum tetlod_status check_cell_range(const char *table, const char *name, const double declared[2],
                                           const double found[2], struct tetlod_error *error)
{
    static const double none[2] = {0, 0};
    const double *range = found[0] > found[1] ? none : found;
    if (range[0] == declared[0] && range[1] == declared[1])
        return TETLOD_OK;
    return tetlodi_fail(error, TETLOD_ERR_STREAM,
                        "%s says that %.60s is in %.17g .. %.17g, its values are in %.17g .. %.17g", table, name,
                        declared[0], declared[1], range[0], range[1]);
}

/* The values of a field of cells are decoded, and have the range that the table says. */
static enum tetlod_status check_cells(const struct tetlod_file *file, uint32_t f, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    const struct tetlod_cell_field *field = &info->cell_fields[f];
    size_t count = (size_t)info->tets * field->components;
    double *values = array_new(count, sizeof *values), found[2] = {INFINITY, -INFINITY};
    enum tetlod_status status =
        values ? tetlod_cells(file, f, values, error) : tetlodi_fail_nomem(error, field->name, count * sizeof *values);
    if (status == TETLOD_OK)
        widen(found, values, count);
    free(values);
    return status == TETLOD_OK ? check_cell_range("the table of cell data", field->name, field->range, found, error)
                               : status;
}

static enum tetlod_status check_cell_steps(const struct tetlod_file *file, struct tetlod_series *series, uint32_t row,
                                           struct tetlod_error *error)
{
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    const struct tetlod_cell_field *field = &tetlod_info(file)->cell_fields[steps->cell_fields[row]];
    size_t count = (size_t)tetlod_info(file)->tets * field->components;
    double *values = array_new(count, sizeof *values), found[2] = {INFINITY, -INFINITY};
    enum tetlod_status status = values ? TETLOD_OK : tetlodi_fail_nomem(error, field->name, count * sizeof *values);
    for (uint32_t s = 0; s < steps->step_count && status == TETLOD_OK; s++) {
        status = tetlod_step_cells(series, steps->cell_fields[row], s, values, error);
        if (status == TETLOD_OK)
            widen(found, values, count);
    }
    free(values);
    return status == TETLOD_OK
               ? check_cell_range("the table of cells' steps", field->name, steps->cell_ranges[row], found, error)
               : status;
}

enum tetlod_status verify_cell_steps(const struct tetlod_file *file, struct tetlod_error *error)
{
    struct tetlod_series *series;
    TETLOD_TRY(tetlod_series_new(&series, file, error));
    enum tetlod_status status = TETLOD_OK;
    for (uint32_t row = 0; row < tetlod_series_info(series)->cell_field_count && status == TETLOD_OK; row++)
        status = check_cell_steps(file, series, row, error);
    tetlod_series_free(series);
    return status;
}

enum tetlod_status verify_index(const struct tetlod_file *file, const struct tetmesh *finest,
                                struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    for (uint32_t f = 0; f < info->cell_field_count; f++)
        TETLOD_TRY(check_cells(file, f, error));
    if (metadata_is_part(info))
        return TETLOD_OK;
    TETLOD_TRY(check_bounds(file, finest, error));
    TETLOD_TRY(check_ranges(file, finest, error));
    TETLOD_TRY(check_sums(file, finest, error));
    TETLOD_TRY(verify_boxes(file, finest, error));
    return check_counts(info, finest, error);
}
