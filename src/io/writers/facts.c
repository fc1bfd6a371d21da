/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/writers/facts.h"

/* The errors of fields, behind the others. */
static bool fact_of_error(const struct tetmesh *mesh, uint32_t number, struct fact *out)
{
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = &mesh->fields[f];
        if (!field->has_error || number--)
            continue;
        *out = (struct fact){.name = "tetlod_max_error", .field = field->name, .value = field->error};
        return true;
    }
    return false;
}

bool fact_of(const struct tetmesh *mesh, uint32_t number, struct fact *out)
{
    const struct mesh_origin *origin = &mesh->origin;
    const struct fact first[] = {
        {.name = "tetlod_id", .codes = origin->id}, // numbers, as meshio takes no text in field data
        {.name = "tetlod_level", .value = origin->level},
        {.name = "tetlod_domain_error", .value = origin->domain_error},
        {.name = "TimeValue", .value = origin->time}, // VTK's own name
    };
    uint32_t count = !origin->id[0] ? 0 : origin->has_time ? 4 : 3;
    if (number < count)
        *out = first[number];
    return number < count || (count && fact_of_error(mesh, number - count, out));
}
