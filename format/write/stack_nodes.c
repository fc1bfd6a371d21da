/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/write/stack_nodes.h"

#include <stdlib.h>
#include <string.h>

/* A column of so many nodes; NULL: out of memory. */
static double *numbers_of(const struct tetlodi_record_writer *whole, uint32_t column, const uint32_t *nodes,
                          uint32_t count)
{
    const struct tetlodi_column *about = &whole->replay->columns[column];
    size_t n = about->components;
    double *out = malloc((count * n + 1) * sizeof *out);
    for (size_t i = 0; i < count && out; i++)
        for (size_t k = 0; k < n; k++)
            out[i * n + k] = tetlodi_node_is_rounded(whole, column, nodes[i])
                                 ? scale_value(&about->scale, 0, tetlodi_node_code(whole, column, nodes[i], k))
                                 : tetlodi_node_value(whole, column, nodes[i], k);
    return out;
}

static bool copy_fields(const struct tetlodi_record_writer *whole, struct tetlodi_page_stack *out,
                        const uint32_t *leaves, const uint32_t *contracted)
{
    const struct tetlodi_write_input *in = whole->in;
    out->in.fields = out->fields = calloc(in->field_count + (size_t)1, sizeof *out->fields);
    bool good = out->fields;
    for (uint32_t f = 0; f < in->field_count && good; f++) {
        const struct tetlodi_write_field *from = &in->fields[f];
        out->fields[f] = (struct tetlodi_write_field){.components = from->components,
                                                      .type = from->type,
                                                      .was_float64 = from->was_float64,
                                                      .values = numbers_of(whole, 1 + f, leaves, out->in.vertices),
                                                      .node_values = numbers_of(whole, 1 + f, contracted,
                                                                                out->in.contractions),
                                                      .bits = from->bits,
                                                      .origin = from->origin,
                                                      .step = from->step,
                                                      .most = from->most};
        good = out->fields[f].values && out->fields[f].node_values;
    }
    return good;
}

bool tetlodi_stack_copy_nodes(const struct tetlodi_record_writer *whole, struct tetlodi_page_stack *out,
                              const uint32_t *leaves, const uint32_t *contracted, uint32_t **out_corners,
                              uint32_t **out_children)
{
    const struct tetlodi_write_input *in = whole->in;
    uint8_t *later = malloc(out->in.vertices + (size_t)1);
    *out_corners = malloc((4 * (size_t)out->in.tets + 1) * sizeof **out_corners);
    *out_children = malloc((4 * (size_t)out->in.contractions + 1) * sizeof **out_children);
    for (uint32_t v = 0; v < out->in.vertices && later; v++)
        later[v] = leaves[v] >= in->vertices;
    out->in.position_type = in->position_type;
    out->in.positions_were_float64 = in->positions_were_float64;
    out->in.position_bits = in->position_bits;
    memcpy(out->in.position_origin, in->position_origin, sizeof in->position_origin);
    memcpy(out->in.position_step, in->position_step, sizeof in->position_step);
    out->in.positions = numbers_of(whole, 0, leaves, out->in.vertices);
    out->in.node_positions = numbers_of(whole, 0, contracted, out->in.contractions);
    out->in.corners = *out_corners;
    out->in.children = *out_children;
    out->in.later = later;
    out->in.field_count = in->field_count;
    return copy_fields(whole, out, leaves, contracted) && later && *out_corners && *out_children &&
           out->in.positions && out->in.node_positions;
}
