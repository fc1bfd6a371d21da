/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/diff/boundary_shell.h"

#include <math.h>
#include <string.h>

#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
#include "src/measure/weights_map.h"
#include "src/util/parallel.h"

enum { CHUNK = 64, MAX_CORNERS = 3 + 4 };

struct comparing {
    const struct boundary_shell_side *faces, *tets; /* whose boundary, and whose tetrahedra */
    uint32_t stride, components;
    double reach;                          /* how far partners may be apart */
    double most[PARALLEL_MAX_THREADS];
};

/* A tetrahedron of one side. */
struct solid {
    uint32_t number;
    struct weights_map map;
    double slopes[4]; /* lengths of the gradients of its four weights */
};

/* The part of a face that is near a tetrahedron: its corners' weights, of the face's corners and of the solid's. */
struct polygon {
    int count;
    double face[MAX_CORNERS][3], solid[MAX_CORNERS][4];
};

static void make_solid(struct solid *out, const struct tetmesh *mesh, uint32_t tet)
{
    double sum[3] = {0};
    out->number = tet;
    make_map(mesh, tet, &out->map);
    for (int k = 1; k < 4; k++) {
        const double *row = out->map.rows[k - 1];
        out->slopes[k] = sqrt(dot(row, row));
        for (int i = 0; i < 3; i++)
            sum[i] += row[i];
    }
    out->slopes[0] = sqrt(dot(sum, sum));
}

static void add_corner(struct polygon *out, const struct polygon *from, int a, int b, double t)
{
    for (int i = 0; i < 3; i++)
        out->face[out->count][i] = from->face[a][i] + t * (from->face[b][i] - from->face[a][i]);
    for (int i = 0; i < 4; i++)
        out->solid[out->count][i] = from->solid[a][i] + t * (from->solid[b][i] - from->solid[a][i]);
    out->count++;
}

/* Where weight k of the solid is at least `least`. */
static void clip(struct polygon *polygon, int k, double least)
{
    struct polygon old = *polygon;
    int crossings = 0;
    for (int a = 0; a < old.count; a++)
        crossings += (old.solid[a][k] >= least) != (old.solid[(a + 1) % old.count][k] >= least);
    if (crossings > 2) // rounding: the whole polygon holds the part, too
        return;
    polygon->count = 0;
    for (int a = 0; a < old.count; a++) {
        int b = (a + 1) % old.count;
        double at_a = old.solid[a][k], at_b = old.solid[b][k];
        if (at_a >= least)
            add_corner(polygon, &old, a, a, 0);
        if ((at_a >= least) != (at_b >= least))
            add_corner(polygon, &old, a, b, (at_a - least) / (at_a - at_b));
    }
}

static const double *values_of(const struct comparing *comparing, const struct boundary_shell_side *side,
                               uint32_t vertex)
{
    return side->values + (size_t)vertex * comparing->stride;
}

/* The values of one component: at the face's corners, and at the solid's. */
static void gather(const struct comparing *comparing, uint32_t face, uint32_t tet, uint32_t component,
                   double at_face[3], double at_solid[4])
{
    const uint32_t *corners = comparing->faces->boundary->surface.triangles + 3 * (size_t)face;
    const uint32_t *others = comparing->tets->mesh->corners + 4 * (size_t)tet;
    for (int c = 0; c < 3; c++)
        at_face[c] = values_of(comparing, comparing->faces, corners[c])[component];
    for (int c = 0; c < 4; c++)
        at_solid[c] = values_of(comparing, comparing->tets, others[c])[component];
}

/* The largest difference of any corner of the face from any of the solid. */
static double difference_of_ranges(const struct comparing *comparing, uint32_t face, uint32_t tet)
{
    double most = 0, a[3], b[4];
    for (uint32_t i = 0; i < comparing->components; i++) {
        gather(comparing, face, tet, i, a, b);
        most = larger(most, larger(larger(a[0], a[1]), a[2]) - smaller(smaller(b[0], b[1]), smaller(b[2], b[3])));
        most = larger(most, larger(larger(b[0], b[1]), larger(b[2], b[3])) - smaller(smaller(a[0], a[1]), a[2]));
    }
    return most;
}

/* The length of the gradient of the solid's values. */
static double slope_of(const struct solid *solid, const double at_solid[4])
{
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        double slope = 0;
        for (int k = 1; k < 4; k++)
            slope += (at_solid[k] - at_solid[0]) * solid->map.rows[k - 1][i];
        sum += slope * slope;
    }
    return sqrt(sum);
}

/* The largest difference of a place of the polygon from one of the solid that is within reach of it. */
static double difference_near(const struct comparing *comparing, const struct solid *solid, uint32_t face,
                              const struct polygon *polygon, double noise)
{
    double most = 0, a[3], b[4];
    for (uint32_t i = 0; i < comparing->components && polygon->count; i++) {
        double size = 0, here = 0;
        gather(comparing, face, solid->number, i, a, b);
        const double base = b[0]; // values less one of them: rounding is about what varies
        for (int c = 0; c < 3; c++)
            size = larger(size, fabs(a[c] -= base));
        for (int c = 0; c < 4; c++)
            size = larger(size, fabs(b[c] -= base));
        for (int p = 0; p < polygon->count; p++) {
            const double *w = polygon->face[p], *x = polygon->solid[p];
            here = larger(here, fabs(w[0] * a[0] + w[1] * a[1] + w[2] * a[2] -
                                     (x[0] * b[0] + x[1] * b[1] + x[2] * b[2] + x[3] * b[3])));
        }
        most = larger(most, here + comparing->reach * slope_of(solid, b) + 32 * size * noise);
    }
    return most;
}

static double compare(const struct comparing *comparing, const struct solid *solid, uint32_t face)
{
    const struct mesh_surface *surface = &comparing->faces->boundary->surface;
    struct polygon polygon = {.count = 3, .face = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    double largest = 1;
    for (int c = 0; c < 3; c++) {
        const uint32_t vertex = surface->triangles[3 * (size_t)face + (size_t)c];
        weigh_place(&solid->map, surface->positions + 3 * (size_t)vertex, polygon.solid[c]);
        for (int k = 0; k < 4; k++)
            largest = larger(largest, fabs(polygon.solid[c][k]));
    }
    double noise = solid->map.noise * largest;
    for (int k = 0; k < 4; k++)
        clip(&polygon, k, -comparing->reach * solid->slopes[k] - 4 * noise);
    return difference_near(comparing, solid, face, &polygon, noise);
}

static void compare_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct comparing *comparing = context;
    const struct bvh *tree = &comparing->faces->boundary->surface.boxes;
    double *most = &comparing->most[worker];
    for (size_t tet = begin; tet < end; tet++) {
        struct solid solid;
        double box[6];
        uint32_t first, last;
        bool made = false;
        if (!comparing->tets->usable[tet])
            continue;
        tet_box(comparing->tets->mesh, (uint32_t)tet, box);
        for (int i = 0; i < 6; i++)
            box[i] += i < 3 ? -comparing->reach : comparing->reach;
        struct bvh_walk walk = bvh_walk_begin(tree);
        while (bvh_next_leaf(&walk, box, &first, &last))
            for (uint32_t i = first; i < last; i++) {
                double bound = difference_of_ranges(comparing, tree->order[i], (uint32_t)tet);
                if (bound <= *most)
                    continue;
                if (!made)
                    make_solid(&solid, comparing->tets->mesh, (uint32_t)tet);
                made = true;
                *most = larger(*most, smaller(bound, compare(comparing, &solid, tree->order[i])));
            }
    }
}

double boundary_shell_difference(const struct boundary_shell_side sides[2], uint32_t stride, uint32_t components,
                                 double most, unsigned threads)
{
    for (int m = 0; m < 2; m++) {
        struct comparing comparing = {.faces = &sides[m], .tets = &sides[!m], .stride = stride,
                                      .components = components};
        comparing.reach = sides[0].boundary->moved + sides[1].boundary->moved;
        if (!sides[m].boundary->surface.count)
            continue;
        for (unsigned w = 0; w < PARALLEL_MAX_THREADS; w++)
            comparing.most[w] = most;
        parallel_for(threads, sides[!m].mesh->tet_count, CHUNK, compare_range, &comparing);
        for (unsigned w = 0; w < PARALLEL_MAX_THREADS; w++)
            most = larger(most, comparing.most[w]);
    }
    return most;
}
