/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * All is read off the links. The link of vertex v has a triangle for each tetrahedron of its star; a link edge (a, b)
 * stands for the face (v, a, b), a link vertex for the edge from v to it. Faces are counted where v is their least
 * vertex, edges at both ends.
 *
 * A link whose edges have at most two triangles, that is connected across edges, and that is closed with Euler
 * characteristic 2 or has a boundary and characteristic 1, is a sphere or a disc: a vertex at which such a surface
 * pinches would lower the characteristic of the surface that it was before below what these are at most.
 */
#include "src/mesh/mesh_check.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/orient.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"
#include "src/util/union_find.h"

enum { SMALL_SORT = 12 };

struct link_edge {
    uint32_t low, high, triangle;
    bool forward; /* the triangle runs from low to high */
};

/* How often a vertex is an end of the edges that are counted. */
struct seen {
    uint32_t in; /* which link */
    uint32_t edges, boundary_edges;
};

struct check {
    const double *positions;
    const uint32_t *corners;
    uint32_t vertex_count, tet_count;
    struct mesh_report *report;
    size_t *offsets;          /* stars */
    uint32_t *star_tets;
    uint32_t *part, *surface; /* union-find over vertices: of the mesh, of the boundary (NONE: not on it) */
    struct link_edge *edges;  /* of the current link */
    struct link_edge *spare;  /* as many, for sorting */
    uint32_t *triangle_part;  /* union-find over its triangles */
    uint32_t (*triangles)[3]; /* ascending */
    struct seen *seen;        /* [vertex] */
};

static const double *point(const struct check *c, uint32_t v)
{
    return c->positions + 3 * (size_t)v;
}

static void check_volumes(struct check *c)
{
    struct mesh_report *report = c->report;
    double volume6 = 0;
    uint32_t signs[3] = {0};
    for (uint32_t t = 0; t < c->tet_count; t++) {
        const uint32_t *v = c->corners + 4 * (size_t)t;
        volume6 += tet_volume6(point(c, v[0]), point(c, v[1]), point(c, v[2]), point(c, v[3]));
        signs[1 + tet_orientation(point(c, v[0]), point(c, v[1]), point(c, v[2]), point(c, v[3]))]++;
    }
    report->orientation = (volume6 > 0) - (volume6 < 0);
    report->volume = fabs(volume6) / 6;
    report->degenerate_tets = signs[1];
    report->inverted_tets = report->orientation >= 0 ? signs[0] : signs[2];
}

static double face_area(const struct check *c, uint32_t v0, uint32_t v1, uint32_t v2)
{
    const double *p = point(c, v0), *q = point(c, v1), *r = point(c, v2);
    double a[3], b[3];
    for (int d = 0; d < 3; d++) {
        a[d] = q[d] - p[d];
        b[d] = r[d] - p[d];
    }
    double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
    return sqrt(x * x + y * y + z * z) / 2;
}

static bool is_before(const struct link_edge *a, const struct link_edge *b)
{
    return a->low != b->low ? a->low < b->low : a->high < b->high;
}

/* Sorts edges by their ends; those of the same ends stay in order. Links are small and there are many: qsort's calls
 * would take most of the time. */
static void sort_edges(struct link_edge *edges, size_t count, struct link_edge *spare)
{
    if (count <= SMALL_SORT) {
        for (size_t i = 1; i < count; i++) {
            struct link_edge edge = edges[i];
            size_t k = i;
            for (; k > 0 && is_before(&edge, &edges[k - 1]); k--)
                edges[k] = edges[k - 1];
            edges[k] = edge;
        }
        return;
    }
    size_t half = count / 2;
    sort_edges(edges, half, spare);
    sort_edges(edges + half, count - half, spare);
    memcpy(spare, edges, half * sizeof *edges);
    for (size_t i = 0, j = half, out = 0; i < half; out++)
        edges[out] = j < count && is_before(&edges[j], &spare[i]) ? edges[j++] : spare[i++];
}

static int compare_triangles(const void *left, const void *right)
{
    const uint32_t *a = left, *b = right;
    for (int i = 0; i < 3; i++)
        if (a[i] != b[i])
            return a[i] < b[i] ? -1 : 1;
    return 0;
}

/* The triangles and sorted edges of v's link, turned as seen from outside a positive tetrahedron. */
static uint32_t collect_link(struct check *c, uint32_t v)
{
    uint32_t count = 0;
    for (size_t s = c->offsets[v]; s < c->offsets[v + 1]; s++, count++) {
        const uint32_t *tet = c->corners + 4 * (size_t)c->star_tets[s];
        int face = 0;
        while (tet[face] != v)
            face++;
        for (int i = 0; i < 3; i++) {
            uint32_t a = tet[tet_faces[face][i]], b = tet[tet_faces[face][(i + 1) % 3]];
            c->edges[3 * (size_t)count + (size_t)i] =
                a < b ? (struct link_edge){a, b, count, true} : (struct link_edge){b, a, count, false};
            c->triangles[count][i] = a;
        }
        c->triangle_part[count] = count;
    }
    sort_edges(c->edges, 3 * (size_t)count, c->spare);
    return count;
}

static void count_duplicates(struct check *c, uint32_t v, uint32_t count)
{
    uint32_t kept = 0;
    for (uint32_t t = 0; t < count; t++) {
        sort_three(c->triangles[t]);
        if (c->triangles[t][0] > v) // v is the least: every tetrahedron once
            memmove(c->triangles[kept++], c->triangles[t], sizeof *c->triangles);
    }
    qsort(c->triangles, kept, sizeof *c->triangles, compare_triangles);
    for (uint32_t t = 1; t < kept; t++)
        c->report->duplicate_tets += compare_triangles(c->triangles[t - 1], c->triangles[t]) == 0;
}

/* Counts an edge of v's link at one of its ends. The first one adds a vertex to the link. */
static void count_end(struct check *c, uint32_t v, uint32_t end, bool boundary, uint32_t *vertices)
{
    struct seen *seen = &c->seen[end];
    if (seen->in != v)
        *seen = (struct seen){.in = v};
    *vertices += seen->edges++ == 0;
    seen->boundary_edges += boundary;
}

/* The boundary's edges at v, each once; they belong to two faces of it where it is a surface. */
static bool count_boundary_end(struct check *c, uint32_t end)
{
    struct seen *seen = &c->seen[end];
    const uint32_t faces = seen->boundary_edges;
    seen->boundary_edges = 0;
    c->report->boundary_edges += faces > 0;
    c->report->boundary_singular_edges += faces > 0 && faces != 2;
    return faces > 0;
}

static void add_face(struct check *c, uint32_t v, const struct link_edge *first, size_t uses)
{
    struct mesh_report *report = c->report;
    report->faces++;
    report->overfull_faces += uses > 2;
    report->same_side_faces += uses == 2 && first[0].forward == first[1].forward;
    if (uses == 1) {
        report->boundary_faces++;
        report->boundary_area += face_area(c, v, first->low, first->high);
    }
}

static void touch_boundary(struct check *c, uint32_t a, uint32_t b)
{
    if (c->surface[a] == TETLOD_NONE)
        c->surface[a] = a;
    if (c->surface[b] == TETLOD_NONE)
        c->surface[b] = b;
    join_sets(c->surface, a, b);
}

static void check_link(struct check *c, uint32_t v)
{
    struct mesh_report *report = c->report;
    uint32_t triangles = collect_link(c, v), parts = triangles, edges = 0, vertices = 0;
    size_t sides = 3 * (size_t)triangles;
    bool overfull = false, on_boundary = false;
    for (size_t i = 0, end; i < sides; i = end) {
        const struct link_edge *first = &c->edges[i];
        for (end = i + 1; end < sides && c->edges[end].low == first->low && c->edges[end].high == first->high; end++)
            parts -= join_sets(c->triangle_part, first->triangle, c->edges[end].triangle);
        edges++;
        overfull |= end - i > 2;
        if (v < first->low)
            add_face(c, v, first, end - i);
        if (end - i == 1)
            touch_boundary(c, v, first->low);
        count_end(c, v, first->low, end - i == 1, &vertices);
        count_end(c, v, first->high, end - i == 1, &vertices);
    }
    for (size_t i = 0; i < sides; i++) {
        on_boundary |= count_boundary_end(c, c->edges[i].low);
        on_boundary |= count_boundary_end(c, c->edges[i].high);
    }
    report->boundary_vertices += on_boundary;
    report->edges += vertices;
    int64_t euler = (int64_t)vertices - edges + triangles;
    report->singular_vertices += overfull || parts != 1 || euler != (on_boundary ? 1 : 2);
    count_duplicates(c, v, triangles);
}

static void check_links(struct check *c)
{
    struct mesh_report *report = c->report;
    for (uint32_t v = 0; v < c->vertex_count; v++)
        if (c->offsets[v] == c->offsets[v + 1])
            report->unused_vertices++;
        else
            check_link(c, v);
    report->edges /= 2;
    report->boundary_edges /= 2;
    report->boundary_singular_edges /= 2;
    report->euler = (int64_t)(report->vertices - report->unused_vertices) - (int64_t)report->edges +
                    (int64_t)report->faces - (int64_t)report->tets;
}

static void count_components(struct check *c)
{
    struct mesh_report *report = c->report;
    for (uint32_t t = 0; t < c->tet_count; t++)
        for (int i = 1; i < 4; i++)
            join_sets(c->part, c->corners[4 * (size_t)t], c->corners[4 * (size_t)t + (size_t)i]);
    for (uint32_t v = 0; v < c->vertex_count; v++) {
        report->components += c->part[v] == v && c->offsets[v] != c->offsets[v + 1];
        report->boundary_components += c->surface[v] == v;
    }
}

static bool allocate(struct check *c)
{
    size_t largest = 0;
    c->offsets = array_new((size_t)c->vertex_count + 1, sizeof *c->offsets);
    c->star_tets = array_new(4 * (size_t)c->tet_count, sizeof *c->star_tets);
    c->part = array_new(c->vertex_count, sizeof *c->part);
    c->surface = array_new(c->vertex_count, sizeof *c->surface);
    c->seen = array_new(c->vertex_count, sizeof *c->seen);
    if (!c->offsets || !c->star_tets || !c->part || !c->surface || !c->seen)
        return false;
    stars_build(c->corners, c->tet_count, c->vertex_count, c->offsets, c->star_tets);
    for (uint32_t v = 0; v < c->vertex_count; v++) {
        c->part[v] = v;
        c->surface[v] = TETLOD_NONE;
        c->seen[v] = (struct seen){.in = TETLOD_NONE};
        largest = c->offsets[v + 1] - c->offsets[v] > largest ? c->offsets[v + 1] - c->offsets[v] : largest;
    }
    c->edges = array_new(3 * largest, sizeof *c->edges);
    c->triangle_part = array_new(largest, sizeof *c->triangle_part);
    c->triangles = array_new(largest, sizeof *c->triangles);
    c->spare = array_new(3 * largest, sizeof *c->spare);
    return c->edges && c->triangle_part && c->triangles && c->spare;
}

static void release(struct check *c)
{
    free(c->offsets);
    free(c->star_tets);
    free(c->part);
    free(c->surface);
    free(c->seen);
    free(c->edges);
    free(c->triangle_part);
    free(c->triangles);
    free(c->spare);
}

enum tetlod_status mesh_check(const double *positions, const uint32_t *corners, uint32_t vertex_count,
                              uint32_t tet_count, struct mesh_report *out, struct tetlod_error *error)
{
    struct oriented oriented;
    *out = (struct mesh_report){.vertices = vertex_count, .tets = tet_count};
    TETLOD_TRY(orient(&oriented, positions, corners, vertex_count, tet_count, NULL, error));
    struct check c = {.positions = positions,
                      .corners = oriented.corners ? oriented.corners : corners,
                      .vertex_count = vertex_count,
                      .tet_count = tet_count,
                      .report = out};
    out->turned_tets = oriented.turned_count;
    bool ready = allocate(&c);
    if (ready) {
        check_volumes(&c);
        check_links(&c);
        count_components(&c);
    }
    release(&c);
    oriented_fini(&oriented);
    return ready ? TETLOD_OK : tetlodi_fail_nomem(error, "checking the mesh", (uint64_t)tet_count * 16);
}
