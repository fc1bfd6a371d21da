/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Colour refinement. A vertex's colour is a hash of its position and values; in each round it becomes one of itself and
 * of the colours of its tetrahedra, which are those of their corners and values, in no order. When no round tells more
 * vertices apart, one of those that are alike is given a colour of its own, in both meshes: with that the rounds go on.
 * In the end each colour is one vertex of either mesh. Whether that is right is checked: the tetrahedra of both must
 * then be the same.
 */
#include "src/measure/match.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

enum { MAX_ROUNDS = 400 };

/* Vertices that are looked at in all rounds together. */
static const double MAX_WORK = 4e8;

struct coloured {
    uint64_t colour;
    uint32_t vertex;
};

struct side {
    const struct tetmesh *mesh;
    uint64_t *colours, *sums; /* [vertex] */
    uint64_t *cells;          /* [tet] of its values */
    struct coloured *sorted;  /* [vertex] */
};

static uint64_t mix(uint64_t x) // splitmix64's finaliser
{
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9u;
    x = (x ^ x >> 27) * 0x94d049bb133111ebu;
    return x ^ x >> 31;
}

static uint64_t hash_row(uint64_t hash, const double *row, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        uint64_t bits;
        memcpy(&bits, row + i, sizeof bits);
        hash = mix(hash ^ bits);
    }
    return hash;
}

static void hash_values(const struct side *side, const struct tetmesh *names)
{
    const struct tetmesh *mesh = side->mesh;
    for (size_t v = 0; v < mesh->vertex_count; v++)
        side->colours[v] = hash_row(1, mesh->positions + 3 * v, 3);
    for (uint32_t f = 0; f < names->field_count; f++) {
        const struct point_field *field = &mesh->fields[tetmesh_find_field(mesh, names->fields[f].name)];
        for (size_t v = 0; v < mesh->vertex_count; v++)
            side->colours[v] = hash_row(side->colours[v], field->values + v * field->components, field->components);
    }
    for (size_t t = 0; t < mesh->tet_count; t++)
        side->cells[t] = 1;
    for (uint32_t f = 0; f < names->cell_field_count; f++) {
        const struct point_field *field = &mesh->cell_fields[tetmesh_find_cell_field(mesh, names->cell_fields[f].name)];
        for (size_t t = 0; t < mesh->tet_count; t++)
            side->cells[t] = hash_row(side->cells[t], field->values + t * field->components, field->components);
    }
}

/* Of what is not ordered the sum of the hashes is the hash. */
static uint64_t tet_colour(const struct side *side, const uint64_t *colours, size_t t)
{
    const uint32_t *corners = side->mesh->corners + 4 * t;
    uint64_t sum = side->cells[t];
    for (int c = 0; c < 4; c++)
        sum += mix(colours[corners[c]]);
    return mix(sum);
}

static void spread(const struct side *side)
{
    const struct tetmesh *mesh = side->mesh;
    memset(side->sums, 0, mesh->vertex_count * sizeof *side->sums);
    for (size_t t = 0; t < mesh->tet_count; t++) {
        uint64_t colour = tet_colour(side, side->colours, t);
        for (int c = 0; c < 4; c++)
            side->sums[mesh->corners[4 * t + (size_t)c]] += colour;
    }
    for (size_t v = 0; v < mesh->vertex_count; v++)
        side->colours[v] = mix(side->colours[v] ^ mix(side->sums[v]));
}

static int compare_coloured(const void *left, const void *right)
{
    const struct coloured *a = left, *b = right;
    if (a->colour != b->colour)
        return a->colour < b->colour ? -1 : 1;
    return a->vertex < b->vertex ? -1 : a->vertex > b->vertex;
}

/* Sorts the vertices by their colours; gives how many colours there are, and the place of the first that several
 * vertices have. */
static uint32_t sort_colours(const struct side *side, uint32_t *out_alike)
{
    uint32_t count = side->mesh->vertex_count, different = 0;
    *out_alike = TETLOD_NONE;
    for (uint32_t v = 0; v < count; v++)
        side->sorted[v] = (struct coloured){side->colours[v], v};
    qsort(side->sorted, count, sizeof *side->sorted, compare_coloured);
    for (uint32_t i = 0; i < count; i++) {
        bool again = i && side->sorted[i].colour == side->sorted[i - 1].colour;
        different += !again;
        *out_alike = again && *out_alike == TETLOD_NONE ? i - 1 : *out_alike;
    }
    return different;
}

static bool same_colours(const struct side sides[2])
{
    for (uint32_t i = 0; i < sides[0].mesh->vertex_count; i++)
        if (sides[0].sorted[i].colour != sides[1].sorted[i].colour)
            return false;
    return true;
}

/* Gives every vertex a colour of its own, the same in both meshes. */
static bool tell_apart(struct side sides[2])
{
    uint32_t vertices = sides[0].mesh->vertex_count, before = 0;
    for (uint32_t round = 0; round < MAX_ROUNDS && (double)round * vertices <= MAX_WORK; round++) {
        uint32_t alike, other, different = sort_colours(&sides[0], &alike);
        if (sort_colours(&sides[1], &other) != different || other != alike || !same_colours(sides))
            return false;
        if (different == vertices)
            return true;
        for (int m = 0; m < 2 && different == before; m++) {
            uint64_t *colour = &sides[m].colours[sides[m].sorted[alike].vertex];
            *colour = mix(*colour + round);
        }
        before = different;
        spread(&sides[0]);
        spread(&sides[1]);
    }
    return false;
}

static int compare_numbers(const void *left, const void *right)
{
    uint64_t a = *(const uint64_t *)left, b = *(const uint64_t *)right;
    return a < b ? -1 : a > b;
}

/* Have both meshes the same tetrahedra, by their corners' colours? */
static enum tetlod_status compare_tets(struct side sides[2], bool *found, struct tetlod_error *error)
{
    size_t tets = sides[0].mesh->tet_count;
    uint64_t *colours[2] = {array_new(tets, sizeof(uint64_t)), array_new(tets, sizeof(uint64_t))};
    bool room = colours[0] && colours[1];
    for (int m = 0; m < 2 && room; m++) {
        for (size_t t = 0; t < tets; t++)
            colours[m][t] = tet_colour(&sides[m], sides[m].colours, t);
        qsort(colours[m], tets, sizeof(uint64_t), compare_numbers);
    }
    *found = room && memcmp(colours[0], colours[1], tets * sizeof(uint64_t)) == 0;
    free(colours[0]);
    free(colours[1]);
    return room ? TETLOD_OK : tetlodi_fail_nomem(error, "the comparison", 16 * (uint64_t)tets);
}

enum tetlod_status mesh_match(const struct tetmesh *a, const struct tetmesh *b, uint32_t *out, bool *found,
                              struct tetlod_error *error)
{
    struct side sides[2] = {{.mesh = a}, {.mesh = b}};
    enum tetlod_status status = TETLOD_OK;
    *found = a->vertex_count == b->vertex_count && a->tet_count == b->tet_count;
    for (int m = 0; m < 2 && *found; m++) {
        const struct tetmesh *mesh = sides[m].mesh;
        sides[m] = (struct side){mesh, array_new(mesh->vertex_count, sizeof(uint64_t)),
                                 array_new(mesh->vertex_count, sizeof(uint64_t)),
                                 array_new(mesh->tet_count, sizeof(uint64_t)), array_new(mesh->vertex_count,
                                                                                         sizeof(struct coloured))};
        if (!sides[m].colours || !sides[m].sums || !sides[m].cells || !sides[m].sorted)
            TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the comparison", 40 * (uint64_t)mesh->vertex_count));
        hash_values(&sides[m], b);
    }
    *found = *found && tell_apart(sides);
    if (*found)
        TETLOD_TRY_DONE(compare_tets(sides, found, error));
    for (uint32_t i = 0; i < b->vertex_count && *found; i++)
        out[sides[1].sorted[i].vertex] = sides[0].sorted[i].vertex;
done:
    for (int m = 0; m < 2; m++) {
        free(sides[m].colours);
        free(sides[m].sums);
        free(sides[m].cells);
        free(sides[m].sorted);
    }
    return status;
}
