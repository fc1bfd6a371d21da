/* SPDX-License-Identifier: BSD-3-Clause */
/* One function lists what a block is, in both directions, so that what is sent and what is taken cannot differ. */
#include "src/io/services/block_carrier.h"

#include <stdlib.h>
#include <string.h>

#include "src/util/array.h"

struct field_head {
    uint32_t name_size, components;
    uint8_t type, is_integer;
    char unit[UNIT_SIZE];
};

struct block_head {
    uint64_t cell_count, connectivity_count;
    uint32_t vertex_count, field_count, cell_field_count, dims[3];
    uint8_t position_type, has_types, has_connectivity, has_point_numbers, has_cell_numbers, has_hidden, goes_on;
};

static bool carry_bytes(struct block_carrier *carrier, void *bytes, size_t size)
{
    return carrier->carry(carrier->opaque, bytes, size, 1, 1);
}

/* An array that is sent and freed, or made and taken: its address, NULL after either or a failure, which is noted. */
static void *carry_array(struct block_carrier *carrier, void *array, size_t count, size_t width, unsigned lag)
{
    array = carrier->takes ? array_new(count, width) : array;
    carrier->failed |= !array || !carrier->carry(carrier->opaque, array, count, (unsigned)width, lag);
    if (!carrier->failed && carrier->takes)
        return array;
    free(array);
    return NULL;
}

#define CARRY(carrier, array, count, lag)                                                                              \
    ((array) = carry_array((carrier), (array), (count), sizeof *(array), (lag)), !(carrier)->failed)

/* Fields at points are taken as fields of cells and then moved: both lists are the same. The rows come by themselves:
 * room for none. */
static struct point_field *new_field(struct tetmesh *mesh, const struct field_head *head, const char *name)
{
    enum tetlod_type type = head->type == TETLOD_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
    if (assemble_cell_field(mesh, name, head->components, type, 0, NULL) != TETLOD_OK)
        return NULL;
    struct point_field *field = &mesh->cell_fields[mesh->cell_field_count - 1];
    field->is_integer = head->is_integer;
    unit_set(field->unit, head->unit, strnlen(head->unit, sizeof head->unit));
    free(field->values);
    field->values = NULL;
    return field;
}

/* `field` is one to be sent; NULL: it is taken. */
static bool carry_field(struct block_carrier *carrier, struct tetmesh *mesh, struct point_field *field,
                        uint64_t rows)
{
    enum { LONGEST = 4096 };
    struct field_head head = {0};
    char name[LONGEST + 1] = "";
    if (field) {
        head = (struct field_head){(uint32_t)strnlen(field->name, LONGEST), field->components, (uint8_t)field->type,
                                   field->is_integer, ""};
        memcpy(head.unit, field->unit, sizeof head.unit);
        memcpy(name, field->name, head.name_size);
    }
    if (!carry_bytes(carrier, &head, sizeof head) || head.name_size > LONGEST ||
        !carry_bytes(carrier, name, head.name_size))
        return false;
    field = field ? field : new_field(mesh, &head, name);
    return field && rows <= SIZE_MAX / 8 / (head.components | 1) &&
           CARRY(carrier, field->values, rows * head.components, head.components);
}

static bool carry_fields(struct block_carrier *carrier, struct tetmesh *mesh, const struct block_head *head,
                         uint64_t rows)
{
    const bool takes = carrier->takes;
    for (uint32_t f = 0; f < head->field_count; f++)
        if (!carry_field(carrier, mesh, takes ? NULL : &mesh->fields[f], head->vertex_count))
            return false;
    if (takes) {
        mesh->fields = mesh->cell_fields;
        mesh->field_count = mesh->cell_field_count;
        mesh->cell_fields = NULL;
        mesh->cell_field_count = 0;
    }
    for (uint32_t f = 0; f < head->cell_field_count; f++)
        if (!carry_field(carrier, mesh, takes ? NULL : &mesh->cell_fields[f], rows))
            return false;
    return true;
}

static bool carry_cells(struct block_carrier *carrier, struct cells *cells, const struct block_head *head)
{
    if (head->has_types && !(CARRY(carrier, cells->types, cells->count, 1) &&
                             CARRY(carrier, cells->offsets, cells->count + 1, 1)))
        return false;
    return !head->has_connectivity || CARRY(carrier, cells->connectivity, cells->connectivity_count, 4);
}

static struct block_head head_of(const struct block *block)
{
    const struct tetmesh *mesh = &block->mesh;
    const struct cells *cells = &block->cells;
    struct block_head head = {cells->count, cells->connectivity_count, mesh->vertex_count, mesh->field_count,
                              mesh->cell_field_count, {0}, (uint8_t)mesh->position_type, cells->types != NULL,
                              cells->connectivity != NULL, block->point_numbers != NULL, block->cell_numbers != NULL,
                              block->hidden != NULL, block->goes_on};
    memcpy(head.dims, block->dims, sizeof head.dims);
    return head;
}

/* False: no block has such counts. */
static bool begin_block(struct block *block, const struct block_head *head)
{
    memcpy(block->dims, head->dims, sizeof block->dims);
    block->mesh.vertex_count = head->vertex_count;
    block->mesh.position_type = head->position_type == TETLOD_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
    block->goes_on = head->goes_on;
    block->cells.count = head->cell_count;
    block->cells.connectivity_count = head->connectivity_count;
    return head->cell_count <= UINT64_MAX / 16 &&
           (head->has_types || head->dims[0] || head->connectivity_count == 4 * head->cell_count);
}

bool block_carry(struct block_carrier *carrier, struct block *block)
{
    struct block_head head = {0};
    if (!carrier->takes)
        head = head_of(block);
    if (!carry_bytes(carrier, &head, sizeof head) || (carrier->takes && !begin_block(block, &head)))
        return false;
    const uint64_t rows = block_cell_count(block);
    return (!head.vertex_count || CARRY(carrier, block->mesh.positions, 3 * (size_t)head.vertex_count, 3)) &&
           carry_fields(carrier, &block->mesh, &head, rows) && carry_cells(carrier, &block->cells, &head) &&
           (!head.has_point_numbers || CARRY(carrier, block->point_numbers, head.vertex_count, 1)) &&
           (!head.has_cell_numbers || CARRY(carrier, block->cell_numbers, rows, 1)) &&
           (!head.has_hidden || CARRY(carrier, block->hidden, rows, 1));
}
