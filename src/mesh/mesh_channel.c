/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/mesh_channel.h"

#include "src/util/array.h"

/* Is an array that of the other mesh? */
static bool pass_same(struct channel *channel, const void *array, const void *other)
{
    uint8_t same = other && array == other;
    CHANNEL_VALUE(channel, same);
    return same;
}

/* Doubles that may be those of the other mesh. */
static double *pass_doubles(struct channel *channel, double *array, double *other, size_t count, size_t lag)
{
    return pass_same(channel, array, other) ? other : channel_words(channel, array, count, sizeof *array, lag);
}

static void pass_field(struct channel *channel, struct point_field *field, const struct point_field *like,
                       uint32_t vertices)
{
    struct point_field about = *field; // also where there is no room for it
    about.name = NULL;
    about.values = NULL;
    CHANNEL_VALUE(channel, about);
    char *name = channel_text(channel, field->name);
    double *values = pass_doubles(channel, field->values, like ? like->values : NULL,
                                  (size_t)vertices * about.components, about.components);
    about.name = name;
    about.values = values;
    if (!channel->share->leads)
        *field = about;
}

void mesh_pass(struct channel *channel, struct tetmesh *mesh, const struct tetmesh *like)
{
    struct tetmesh about = {.vertex_count = mesh->vertex_count,
                            .tet_count = mesh->tet_count,
                            .field_count = mesh->field_count,
                            .position_type = mesh->position_type};
    for (int axis = 0; axis < 3; axis++)
        about.position_grid[axis] = mesh->position_grid[axis];
    CHANNEL_VALUE(channel, about);
    bool leads = channel->share->leads;
    if (!leads)
        *mesh = about;
    mesh->positions = pass_doubles(channel, mesh->positions, like ? like->positions : NULL,
                                   3 * (size_t)about.vertex_count, 3);
    if (pass_same(channel, mesh->corners, like ? like->corners : NULL))
        mesh->corners = like->corners;
    else
        CHANNEL_WORDS(channel, mesh->corners, 4 * (size_t)about.tet_count, 4);
    if (!leads) {
        mesh->fields = array_zero(about.field_count, sizeof *mesh->fields);
        mesh->field_count = mesh->fields ? about.field_count : 0;
        channel->status = mesh->fields ? channel->status : TETLOD_ERR_NOMEM;
    }
    for (uint32_t f = 0; f < about.field_count; f++) {
        struct point_field none = {0};
        bool twin = like && f < like->field_count;
        pass_field(channel, mesh->fields ? &mesh->fields[f] : &none, twin ? &like->fields[f] : NULL,
                   about.vertex_count);
    }
}

void mesh_return_borrowed(struct tetmesh *mesh, const struct tetmesh *like)
{
    if (mesh->positions == like->positions)
        mesh->positions = NULL;
    if (mesh->corners == like->corners)
        mesh->corners = NULL;
    for (uint32_t f = 0; f < mesh->field_count && f < like->field_count; f++)
        if (mesh->fields[f].values == like->fields[f].values)
            mesh->fields[f].values = NULL;
}

void kept_mesh_fini(struct kept_mesh *kept)
{
    tetmesh_fini(&kept->mesh);
    *kept = (struct kept_mesh){0};
}
