/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/series_spool.h"

#include "format/fail.h"
#include "src/pipeline/cell_types.h"
#include "src/pipeline/build.h"
#include "src/pipeline/precision.h"

static enum tetlod_status put_values(struct spool *spool, const struct point_field *field, uint32_t vertices,
                                     enum tetlod_type type, struct tetlod_error *error)
{
    enum { CHUNK = 512 };
    size_t count = (size_t)field->components * vertices;
    float single[CHUNK];
    if (type == TETLOD_FLOAT64)
        return spool_write(spool, field->values, count * sizeof *field->values, error);
    for (size_t i = 0; i < count; i += CHUNK) {
        size_t some = count - i < CHUNK ? count - i : CHUNK;
        for (size_t k = 0; k < some; k++)
            single[k] = (float)field->values[i + k];
        TETLOD_TRY(spool_write(spool, single, some * sizeof *single, error));
    }
    return TETLOD_OK;
}

enum tetlod_status series_spool_put(struct spool *spool, struct tetmesh *mesh, const struct tetmesh *first,
                                    const struct build_control *controls, uint32_t count, enum tetlod_type *types,
                                    struct tetlod_error *error)
{
    for (uint32_t c = 0; c < count; c++) {
        const struct point_field *like = &first->fields[controls[c].field];
        struct build_control found = controls[c];
        if (mesh != first)
            TETLOD_TRY(build_control_parse(mesh, like->name, &found, error));
        const struct point_field *field = &mesh->fields[found.field];
        if (field->components != like->components)
            return tetlodi_fail(error, TETLOD_ERR_FIELD, "field '%.60s' has %u components, in the first step %u",
                                like->name, field->components, like->components);
        if (types[c] == TETLOD_FLOAT32 && field->type == TETLOD_FLOAT64 &&
            !precision_is_narrow(field->values, (size_t)field->components * mesh->vertex_count)) {
            types[c] = TETLOD_FLOAT64;
            return TETLOD_MORE;
        }
        TETLOD_TRY(put_values(spool, field, mesh->vertex_count, types[c], error));
    }
    return TETLOD_OK;
}

void series_spool_cells(const struct tetmesh *first, struct build_series_cells *cells)
{
    for (uint32_t c = 0; c < first->cell_field_count; c++)
        cells[c] = (struct build_series_cells){.field = c, .components = first->cell_fields[c].components,
                                               .type = cell_type_of(&first->cell_fields[c], first->tet_count)};
}

enum tetlod_status series_spool_put_cells(struct spool *spool, const struct tetmesh *mesh, const struct tetmesh *first,
                                          struct build_series_cells *cells, struct tetlod_error *error)
{
    for (uint32_t c = 0; c < first->cell_field_count; c++) {
        const struct point_field *field = &first->cell_fields[c];
        uint32_t found = tetmesh_find_cell_field(mesh, field->name);
        if (found != TETLOD_NONE && mesh->cell_fields[found].components == field->components)
            field = &mesh->cell_fields[found];
        else
            cells[c].missing = true;
        cells[c].type = cell_type_of_both(cells[c].type, cell_type_of(field, mesh->tet_count));
        TETLOD_TRY(spool_write(spool, field->values,
                               (size_t)field->components * mesh->tet_count * sizeof *field->values, error));
    }
    return TETLOD_OK;
}
