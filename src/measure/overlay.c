/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/measure/overlay.h"

#include <float.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/measure/clusters.h"
#include "src/measure/exact_cell.h"
#include "src/measure/weights_map.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

/* A pair whose weights may be wrong by more than this is not looked at in doubles at all. */
static const double HOPELESS = 1e-4;

enum { MAX_ENDS = 24, CHUNK = 16, MAX_SHEET = 256, MAX_POLYGON = 8 };

/* A component of a field, in both meshes. */
struct compared {
    const double *values[2]; /* of the component at vertex 0 */
    uint32_t stride, field;
};

/* One thread's. */
struct worker {
    double *own;  /* [field_count] */
    /* [field_count] what was found already: `own`, or that of the tetrahedron which is being compared (`each`) */
    double *most;
    uint64_t cells;
};

struct overlay {
    const struct tetmesh *meshes[2]; /* borrowed */
    int finer;                       /* which has more tetrahedra; a where each tetrahedron of b is asked for its own */
    const struct clusters *clusters; /* of those */
    struct clusters own_clusters;    /* if none were given */
    bool one_body;                   /* as far as is known */
    uint8_t *asked;                  /* [cluster] some of it are looked at */
    double *boxes;                   /* [6 * tet of b] */
    uint8_t *usable[2];              /* [tet] it has an interpolant, and may be looked at */
    const uint32_t *neighbours;      /* of b (adjacency.h), where it may overlap itself */
    uint32_t *own_neighbours;        /* if none were given */
    _Atomic uint8_t *covered;        /* [tet of a] a COVER */
    const struct overlay_options *options;
    uint32_t field_count, compared_count;
    struct compared *compared;
    struct worker *workers;
};

/* The intersection of a tetrahedron of a and one of b: the ends of the clipped edges, by weights in both. */
struct cell {
    uint32_t tets[2];
    int count;
    double ends[MAX_ENDS][2][4];
    double slack; /* of a weight */
};

/* Are the tetrahedra parts of the same body, as far as that is known? */
static bool same_body(const struct overlay *overlay, uint32_t tet_a, uint32_t tet_b)
{
    const uint32_t *const *bodies = overlay->options->bodies;
    return overlay->one_body || bodies[0][overlay->meshes[0]->corners[4 * (size_t)tet_a]] ==
                             bodies[1][overlay->meshes[1]->corners[4 * (size_t)tet_b]];
}

static double value_of(const struct overlay *overlay, const struct compared *compared, int m, uint32_t tet, int k)
{
    return compared->values[m][(size_t)overlay->meshes[m]->corners[4 * (size_t)tet + (size_t)k] * compared->stride];
}

/* Clips the edges of the cell's tetrahedron of mesh m to the other one, in which its corners have the weights `in`, and
 * to what is so near to it that rounding may have put it there: the ends that there are lie between those. */
static void clip_edges(struct cell *cell, int m, double in[4][4])
{
    double room = 2 * cell->slack;
    for (int e = 0; e < 6; e++) {
        int i = tet_edges[e][0], j = tet_edges[e][1];
        double t[2] = {0, 1};
        for (int k = 0; k < 4; k++) {
            double from = in[i][k] + room, to = in[j][k] + room;
            if (from < 0 && to < 0)
                t[0] = 2; // behind a face as a whole
            else if (from < 0)
                t[0] = larger(t[0], from / (from - to));
            else if (to < 0)
                t[1] = smaller(t[1], from / (from - to));
        }
        for (int end = 0; end < 2 && t[0] <= t[1]; end++, cell->count++) {
            double(*weights)[4] = cell->ends[cell->count];
            for (int k = 0; k < 4; k++) {
                weights[m][k] = k == i ? 1 - t[end] : k == j ? t[end] : 0;
                weights[!m][k] = (1 - t[end]) * in[i][k] + t[end] * in[j][k];
            }
        }
    }
}

/* The values of a component at the corners of the cell's tetrahedra, less one of them: so that rounding is about what
 * varies, not about how far from zero it does. The largest of them is returned. */
static double gather_values(const struct overlay *overlay, const struct compared *compared, const struct cell *cell,
                            double out[2][4])
{
    double base = value_of(overlay, compared, 0, cell->tets[0], 0), most = 0;
    for (int m = 0; m < 2; m++)
        for (int k = 0; k < 4; k++) {
            out[m][k] = value_of(overlay, compared, m, cell->tets[m], k) - base;
            most = larger(most, fabs(out[m][k]));
        }
    return most;
}

static double weigh(const double weights[4], const double values[4])
{
    return weights[0] * values[0] + weights[1] * values[1] + weights[2] * values[2] + weights[3] * values[3];
}

/* Is a linear function above a bound somewhere in the part of a tetrahedron that is before face k of the other? `at`:
 * the function at the corners; `in`: their weights, which decide with `room`. */
static bool exceeds_before(double in[4][4], int k, const double at[4], double room, double bound)
{
    for (int i = 0; i < 4; i++)
        if (in[i][k] + room >= 0 && fabs(at[i]) > bound)
            return true;
    for (int e = 0; e < 6; e++) {
        int i = tet_edges[e][0], j = tet_edges[e][1];
        double from = in[i][k] + room, to = in[j][k] + room;
        if ((from < 0) != (to < 0) && fabs(at[i] + from / (from - to) * (at[j] - at[i])) > bound)
            return true;
    }
    return false;
}

/* May the pair have a difference above what was found? In the intersection it is at most what it is in the part of
 * either tetrahedron that is before one face of the other: of the finer mesh's, or of both. */
static bool may_be_worse(const struct overlay *overlay, const struct worker *worker, const struct cell *cell,
                         double in[2][4][4], bool both)
{
    for (uint32_t c = 0; c < overlay->compared_count; c++) {
        const struct compared *compared = &overlay->compared[c];
        double values[2][4], size = gather_values(overlay, compared, cell, values);
        double enough = worker->most[compared->field] - 8 * size * cell->slack;
        bool worse = true;
        for (int m = 0; m < 2 && worse; m++) { // the corners of tetrahedron m
            double at[4], most = 0;
            if (m != overlay->finer && !both)
                continue;
            for (int k = 0; k < 4; k++) {
                at[k] = values[m][k] - weigh(in[m][k], values[!m]);
                most = larger(most, fabs(at[k]));
            }
            worse = most > enough;
            for (int k = 0; k < 4 && worse; k++)
                worse = exceeds_before(in[m], k, at, 2 * cell->slack, enough);
        }
        if (worse)
            return true;
    }
    return false;
}

/* Clips in doubles. False: they do not overlap, at most touch. */
static bool make_cell(struct cell *cell, double in[2][4][4])
{
    for (int m = 0; m < 2; m++)
        clip_edges(cell, m, in[m]);
    for (int m = 0; m < 2; m++)
        for (int k = 0; k < 4; k++) {
            double most = 0;
            for (int i = 0; i < cell->count; i++)
                most = larger(most, cell->ends[i][m][k]);
            if (most <= THIN - cell->slack)
                return false;
        }
    return cell->count > 0;
}

/* The largest difference of a component at the cell's ends, with what rounding may hide. */
static double bound_in(const struct overlay *overlay, const struct compared *compared, const struct cell *cell)
{
    double values[2][4], size = gather_values(overlay, compared, cell, values), most = 0;
    for (int i = 0; i < cell->count; i++)
        most = larger(most, fabs(weigh(cell->ends[i][0], values[0]) - weigh(cell->ends[i][1], values[1])));
    return most + 8 * size * cell->slack;
}

/* Is one of the differences at the cell's ends above what was found, but for rounding? */
static bool is_worse(const struct overlay *overlay, const struct worker *worker, const struct cell *cell)
{
    for (uint32_t c = 0; c < overlay->compared_count; c++)
        if (bound_in(overlay, &overlay->compared[c], cell) > worker->most[overlay->compared[c].field])
            return true;
    return false;
}

/* The bound of a tetrahedron of its own need not be the least one. */
static void raise_bounds(const struct overlay *overlay, struct worker *worker, const struct cell *cell)
{
    for (uint32_t c = 0; c < overlay->compared_count; c++) {
        double *most = &worker->most[overlay->compared[c].field];
        *most = larger(*most, bound_in(overlay, &overlay->compared[c], cell));
    }
}

static void exact_corners(const struct overlay *overlay, int m, uint32_t tet, const double *out[4])
{
    for (int c = 0; c < 4; c++)
        out[c] = mesh_corner(overlay->meshes[m], tet, c);
}

/* With room for last digits: beside 0 they are no digits of what the box ends at. */
static bool in_box(const double box[6], const double x[3])
{
    for (int i = 0; i < 3; i++) {
        double room = 1e-9 * (box[i + 3] - box[i]);
        if (x[i] < box[i] - room || x[i] > box[i + 3] + room)
            return false;
    }
    return true;
}

/* The difference at an end that is above what was found: it counts only if, on one side of the end, no other
 * tetrahedron of b that is there, too, is nearer to a's value. All are asked, which is rare. */
static quad best_difference(const struct overlay *overlay, const struct compared *compared,
                            const struct exact_cell *exact,
                            const struct cell *cell, int end, double values[2][4], quad found)
{
    const quad *x = exact->ends[end];
    const double at[3] = {(double)x[0], (double)x[1], (double)x[2]};
    quad best[EXACT_MAX_ENDS], most = 0;
    for (int side = 0; side < exact->count; side++)
        best[side] = found;
    for (uint32_t tet = 0; tet < overlay->meshes[1]->tet_count; tet++) {
        const double *corners[4];
        quad other;
        if (!overlay->usable[1][tet] || tet == cell->tets[1] || !in_box(overlay->boxes + 6 * (size_t)tet, at) ||
            !same_body(overlay, cell->tets[0], tet))
            continue;
        exact_corners(overlay, 1, tet, corners);
        for (int k = 0; k < 4; k++)
            values[1][k] = value_of(overlay, compared, 1, tet, k);
        uint32_t held = exact_cell_other(exact, end, corners, (const double(*)[4])values, &other);
        for (int side = 0; side < exact->count; side++)
            if (held >> side & 1 && other < best[side])
                best[side] = other;
    }
    for (int side = 0; side < exact->count; side++)
        most = best[side] > most ? best[side] : most;
    return most;
}

/* ---- one sheet of b
 *
 * Where b overlaps itself, a tetrahedron of a meets other sheets of b, whose values are of other places: each end of
 * each intersection would have to be asked for a better value. But where the tetrahedra of b that cover it are found
 * one from another, across faces that it reaches through, and all differ from it by little, no other one matters. */

enum cover { COVER_UNKNOWN, COVERED, NOT_COVERED };

/* Does a face of the cell's tetrahedron of b, the one opposite `corner`, reach inside that of a? in: weights there of
 * b's corners. */
static bool reaches_through(double in[4][4], int corner, double slack)
{
    double polygon[2][MAX_POLYGON][4], least = THIN - 2 * slack;
    int count = 0;
    for (int c = 0; c < 4; c++)
        if (c != corner)
            memcpy(polygon[0][count++], in[c], sizeof *in);
    for (int k = 0; k < 4 && count; k++) {
        double(*from)[4] = polygon[k % 2], (*to)[4] = polygon[(k + 1) % 2];
        int kept = 0;
        for (int i = 0; i < count; i++) {
            const double *p = from[i], *q = from[(i + 1) % count];
            double t = (least - p[k]) / (q[k] - p[k]);
            if (p[k] >= least)
                memcpy(to[kept++], p, 4 * sizeof *p);
            for (int j = 0; (p[k] >= least) != (q[k] >= least) && j < 4; j++)
                to[kept][j] = p[j] + t * (q[j] - p[j]);
            kept += (p[k] >= least) != (q[k] >= least);
        }
        count = kept;
    }
    return count > 0;
}

/* The tetrahedra of b that were reached from the first one. */
struct sheet {
    uint32_t tets[MAX_SHEET], count;
};

static bool sheet_add(struct sheet *sheet, uint32_t tet)
{
    for (uint32_t i = 0; i < sheet->count; i++)
        if (sheet->tets[i] == tet)
            return true;
    if (sheet->count == MAX_SHEET)
        return false;
    sheet->tets[sheet->count++] = tet;
    return true;
}

/* Goes on across a face of b, if there is another tetrahedron, on the other side of it. */
static bool cross_face(const struct overlay *overlay, const struct weights_map *map, uint32_t tet, uint32_t face,
                       struct sheet *sheet)
{
    uint32_t across = overlay->neighbours[4 * (size_t)tet + face];
    if (across == TETLOD_NONE || !overlay->usable[1][across / 4])
        return false;
    const double *p = mesh_corner(overlay->meshes[1], across / 4, (int)(across % 4));
    const double *const four_places[4] = {p, p, p, p};
    four r[3], weights[4];
    offsets_of(map, four_places, r);
    for (int k = 1; k < 5; k++)
        weigh_at(map, r, k % 4, weights);
    return weights[face][0] < 0 && sheet_add(sheet, across / 4);
}

/* Is the difference small where tetrahedron `tet` of a is in one of b, and can the sheet go on wherever a's reaches
 * through a face of it? */
static bool extend_sheet(const struct overlay *overlay, const struct worker *worker, uint32_t tet, uint32_t other,
                         struct sheet *sheet)
{
    struct cell cell = {.tets = {tet, other}};
    struct weights_map maps[2];
    double in[2][4][4], slacks[2];
    for (int m = 0; m < 2; m++)
        make_map(overlay->meshes[m], cell.tets[m], &maps[m]);
    for (int m = 0; m < 2; m++)
        if (!weigh_corners(&maps[!m], overlay->meshes[m], cell.tets[m], in[m], &slacks[m]))
            return false; // they touch at most: what is beyond is not known
    cell.slack = larger(slacks[0], slacks[1]);
    if (2 * cell.slack > THIN ||
        (may_be_worse(overlay, worker, &cell, in, true) && make_cell(&cell, in) && is_worse(overlay, worker, &cell)))
        return false;
    for (int f = 0; f < 4; f++)
        if (reaches_through(in[1], f, cell.slack) && !cross_face(overlay, &maps[1], other, (uint32_t)f, sheet))
            return false;
    return true;
}

/* Is there a sheet of b that covers a tetrahedron of a with values that differ by no more than what was found? It has a
 * place near the middle of it, which is on no face of b but by accident. */
static bool find_cover(const struct overlay *overlay, const struct worker *worker, uint32_t tet)
{
    static const double weights_there[4] = {0.31, 0.27, 0.23, 0.19};
    double middle[3] = {0, 0, 0};
    for (int i = 0; i < 3; i++)
        for (int c = 0; c < 4; c++)
            middle[i] += weights_there[c] * mesh_corner(overlay->meshes[0], tet, c)[i];
    for (uint32_t first = 0; first < overlay->meshes[1]->tet_count; first++) {
        struct sheet sheet = {.tets = {first}, .count = 1};
        struct weights_map map;
        bool good = overlay->usable[1][first] && in_box(overlay->boxes + 6 * (size_t)first,
                                                        middle) && same_body(overlay, tet, first);
        if (!good)
            continue;
        const double *const places[4] = {middle, middle, middle, middle};
        four r[3], weights[4];
        make_map(overlay->meshes[1], first, &map);
        offsets_of(&map, places, r);
        for (int k = 1; k < 5; k++)
            weigh_at(&map, r, k % 4, weights);
        for (int k = 0; k < 4; k++)
            good = good && weights[k][0] > -THIN;
        for (uint32_t i = 0; i < sheet.count && good; i++)
            good = extend_sheet(overlay, worker, tet, sheet.tets[i], &sheet);
        if (good)
            return true;
    }
    return false;
}

/* The answer is kept: what was found only grows. */
static bool is_covered(const struct overlay *overlay, const struct worker *worker, uint32_t tet)
{
    if (!overlay->covered)
        return false;
    uint8_t known = atomic_load_explicit(&overlay->covered[tet], memory_order_relaxed);
    if (known == COVER_UNKNOWN) {
        known = find_cover(overlay, worker, tet) ? COVERED : NOT_COVERED;
        atomic_store_explicit(&overlay->covered[tet], known, memory_order_relaxed);
    }
    return known == COVERED;
}

/* The verdict, in 113 bits. */
static void compare_exactly(const struct overlay *overlay, struct worker *worker, const struct cell *cell)
{
    struct exact_cell exact;
    exact_corners(overlay, 0, cell->tets[0], exact.corners[0]);
    exact_corners(overlay, 1, cell->tets[1], exact.corners[1]);
    if (!exact_cell_clip(&exact))
        return;
    for (uint32_t c = 0; c < overlay->compared_count; c++) {
        const struct compared *compared = &overlay->compared[c];
        double *most = &worker->most[compared->field], values[2][4];
        for (int end = 0; end < exact.count; end++) {
            for (int m = 0; m < 2; m++)
                for (int k = 0; k < 4; k++)
                    values[m][k] = value_of(overlay, compared, m, cell->tets[m], k);
            quad found = exact_cell_difference(&exact, end, (const double(*)[4])values);
            if (found > *most && !overlay->options->each)
                found = best_difference(overlay, compared, &exact, cell, end, values, found);
            *most = larger(*most, (double)found);
        }
    }
}

static bool looked_at(const struct overlay *overlay, int m, uint32_t tet)
{
    const uint8_t *wanted = overlay->options->wanted;
    return overlay->usable[m][tet] && (!m || !wanted || wanted[tet]);
}

/* The vertices of a cluster of the finer mesh, in a tetrahedron of the coarser one. */
struct weighed {
    double weights[4][CLUSTER_VERTICES];
    int64_t behind[CLUSTER_VERTICES]; /* bit k: on or behind the tetrahedron's face k */
};

/* Four vertices at a time; the last ones may be the same. */
static void weigh_cluster(const struct overlay *overlay, const struct reach *reach, uint32_t cluster,
                          struct weighed *out)
{
    const struct clusters *clusters = overlay->clusters;
    const struct weights_map *map = &reach->map;
    const double *positions = overlay->meshes[overlay->finer]->positions;
    const uint32_t *vertices = clusters->vertices + clusters->begin[cluster],
                   last = clusters->begin[cluster + 1] - clusters->begin[cluster] - 1;
    double most[4],
        least =
            THIN - weights_in(reach, clusters->tree.boxes + 6 * ((size_t)clusters->tree.leaf_first + cluster), most);
    for (uint32_t v = 0; v <= last; v += 4) {
        four r[3], w[4];
        four_bits behind = {0, 0, 0, 0};
        const double *p[4];
        for (uint32_t l = 0; l < 4; l++)
            p[l] = positions + 3 * (size_t)vertices[v + l < last ? v + l : last];
        offsets_of(map, p, r);
        for (int k = 1; k < 5; k++)
            weigh_at(map, r, k % 4, w);
        for (int k = 0; k < 4; k++) {
            behind |= (four_bits)(w[k] <= least) & ((int64_t)1 << k);
            memcpy(out->weights[k] + v, &w[k], sizeof w[k]);
        }
        memcpy(out->behind + v, &behind, sizeof behind);
    }
}

/* Where a level is compared with the original, most tetrahedra of the finer mesh near one of the other are outside it,
 * or differ by less than what was found. Both are known from their corners alone, and the map of the coarser mesh's. */
static void compare_pair(const struct overlay *overlay, struct worker *worker, const struct weights_map *coarse,
                         const uint32_t tets[2],
                         const struct weighed *weighed, const uint8_t corners[4])
{
    struct cell cell; // its ends are not to be cleared, which would cost more than most pairs do
    struct weights_map fine;
    int finer = overlay->finer;
    double in[2][4][4], largest = 1, slack; // in[m]: of the corners of tetrahedron m, in the other one
    for (int c = 0; c < 4; c++)
        for (int k = 0; k < 4; k++) {
            in[finer][c][k] = weighed->weights[k][corners[c]];
            largest = larger(largest, fabs(in[finer][c][k]));
        }
    cell.tets[0] = tets[0];
    cell.tets[1] = tets[1];
    cell.count = 0;
    cell.slack = coarse->noise * largest;
    if (cell.slack <= HOPELESS && !may_be_worse(overlay, worker, &cell, in, false))
        return;
    make_map(overlay->meshes[finer], tets[finer], &fine);
    if (!weigh_corners(&fine, overlay->meshes[!finer], tets[!finer], in[!finer], &slack))
        return;
    cell.slack = larger(cell.slack, slack);
    worker->cells++;
    bool hopeless = cell.slack > HOPELESS;
    if (!hopeless && !(may_be_worse(overlay, worker, &cell, in, true) && make_cell(&cell, in) &&
                       is_worse(overlay, worker, &cell)))
        return;
    if (is_covered(overlay, worker, tets[0]))
        return;
    if (hopeless)
        compare_exactly(overlay, worker, &cell);
    else
        (overlay->options->each ? raise_bounds : compare_exactly)(overlay, worker, &cell);
}

/* The tetrahedra of a cluster with one of the coarser mesh. */
static void compare_cluster(const struct overlay *overlay, struct worker *worker, const struct reach *reach,
                            uint32_t tet,
                            uint32_t first, uint32_t end)
{
    const struct clusters *clusters = overlay->clusters;
    int finer = overlay->finer;
    uint32_t tets[2];
    struct weighed weighed;
    weigh_cluster(overlay, reach, first / CLUSTER_TETS, &weighed);
    tets[!finer] = tet;
    for (uint32_t i = first; i < end; i++) {
        const uint8_t *corners = clusters->corners[i];
        if (weighed.behind[corners[0]] & weighed.behind[corners[1]] & weighed.behind[corners[2]] &
            weighed.behind[corners[3]])
            continue; // most
        tets[finer] = clusters->tree.order[i];
        if (looked_at(overlay, finer, tets[finer]) && same_body(overlay, tets[0], tets[1]))
            compare_pair(overlay, worker, &reach->map, tets, &weighed, corners);
    }
}

static void compare_range(void *context, unsigned number, size_t begin, size_t end)
{
    const struct overlay *overlay = context;
    struct worker *worker = &overlay->workers[number];
    double *each = overlay->options->each;
    int coarser = !overlay->finer;
    for (size_t tet = begin; tet < end; tet++) {
        if (!looked_at(overlay, coarser, (uint32_t)tet))
            continue;
        struct reach reach;
        uint32_t first, last;
        worker->most = each ? each + tet * overlay->field_count : worker->own;
        reach_set(&reach, overlay->meshes[coarser], (uint32_t)tet);
        struct bvh_walk walk = bvh_walk_begin(&overlay->clusters->tree);
        while (bvh_next_leaf_where(&walk, reaches, &reach, &first, &last))
            if (overlay->asked[first / CLUSTER_TETS])
                compare_cluster(overlay, worker, &reach, (uint32_t)tet, first, last);
    }
}

static enum tetlod_status prepare_mesh(struct overlay *overlay, int m, struct overlay_report *report,
                                       struct tetlod_error *error)
{
    const struct tetmesh *mesh = overlay->meshes[m];
    overlay->usable[m] = array_new(mesh->tet_count, 1);
    if (!overlay->usable[m])
        return tetlodi_fail_nomem(error, "the overlay", mesh->tet_count);
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        bool degenerate =
            tet_orientation(mesh_corner(mesh, t, 0), mesh_corner(mesh, t, 1), mesh_corner(mesh, t, 2),
                            mesh_corner(mesh, t, 3)) == 0;
        const uint8_t *usable = overlay->options->usable[m];
        overlay->usable[m][t] = !degenerate && (!usable || usable[t]);
        report->degenerate[m] += degenerate;
    }
    return TETLOD_OK;
}

static enum tetlod_status prepare_boxes(struct overlay *overlay, struct tetlod_error *error)
{
    const struct tetmesh *b = overlay->meshes[1], *fine = overlay->meshes[overlay->finer];
    overlay->boxes = array_new(b->tet_count, 6 * sizeof *overlay->boxes);
    if (!overlay->boxes)
        return tetlodi_fail_nomem(error, "the overlay", b->tet_count * 6 * (uint64_t)sizeof *overlay->boxes);
    for (uint32_t t = 0; t < b->tet_count; t++)
        tet_box(b, t, overlay->boxes + 6 * (size_t)t);
    overlay->clusters = overlay->finer ? NULL : overlay->options->clusters;
    if (overlay->clusters)
        return TETLOD_OK;
    overlay->clusters = &overlay->own_clusters;
    return clusters_build(&overlay->own_clusters, fine, error);
}

/* Most meshes are one body, of which nothing has to be asked. */
static bool is_one_body(const struct overlay *overlay)
{
    const uint32_t *const *bodies = overlay->options->bodies;
    bool one = true;
    for (int m = 0; m < 2 && bodies[0]; m++)
        for (size_t i = 0; i < 4 * (size_t)overlay->meshes[m]->tet_count && one; i++)
            one = bodies[m][overlay->meshes[m]->corners[i]] == bodies[0][overlay->meshes[0]->corners[0]];
    return one;
}

/* Near the boundary alone most clusters are not asked about. */
static enum tetlod_status prepare_asked(struct overlay *overlay, struct tetlod_error *error)
{
    uint32_t count = overlay->meshes[overlay->finer]->tet_count;
    overlay->asked = array_zero(count / CLUSTER_TETS + 1, 1);
    if (!overlay->asked)
        return tetlodi_fail_nomem(error, "the overlay", count / CLUSTER_TETS + 1);
    for (uint32_t i = 0; i < count; i++)
        overlay->asked[i / CLUSTER_TETS] |= looked_at(overlay, overlay->finer, overlay->clusters->tree.order[i]);
    return TETLOD_OK;
}

static enum tetlod_status prepare_cover(struct overlay *overlay, struct tetlod_error *error)
{
    const struct tetmesh *b = overlay->meshes[1];
    if (!overlay->options->overlaps)
        return TETLOD_OK;
    overlay->covered = array_zero(overlay->meshes[0]->tet_count, sizeof *overlay->covered);
    overlay->neighbours = overlay->options->neighbours;
    if (overlay->covered && overlay->neighbours)
        return TETLOD_OK;
    overlay->neighbours = overlay->own_neighbours = array_new(b->tet_count, 4 * sizeof *overlay->neighbours);
    if (!overlay->covered || !overlay->neighbours)
        return tetlodi_fail_nomem(error, "the overlay", b->tet_count * 4 * (uint64_t)sizeof *overlay->neighbours);
    return adjacency_build(b->corners, b->tet_count, b->vertex_count, overlay->own_neighbours, NULL, error);
}

static enum tetlod_status prepare_fields(struct overlay *overlay, const uint32_t *a_fields, const uint32_t *b_fields,
                                         struct tetlod_error *error)
{
    size_t components = 0;
    for (uint32_t f = 0; f < overlay->field_count; f++)
        components += overlay->meshes[0]->fields[a_fields[f]].components;
    overlay->compared = array_new(components, sizeof *overlay->compared);
    if (!overlay->compared)
        return tetlodi_fail_nomem(error, "the overlay", components * sizeof *overlay->compared);
    for (uint32_t f = 0; f < overlay->field_count; f++) {
        const struct point_field *a = &overlay->meshes[0]->fields[a_fields[f]],
                                 *b = &overlay->meshes[1]->fields[b_fields[f]];
        if (overlay->options->floors && overlay->options->floors[f] == INFINITY)
            continue; // nothing is above that
        for (uint32_t k = 0; k < a->components; k++)
            overlay->compared[overlay->compared_count++] = (struct compared){{a->values + k, b->values + k},
                                                                             a->components, f};
    }
    return TETLOD_OK;
}

static enum tetlod_status prepare_workers(struct overlay *overlay, unsigned threads, struct tetlod_error *error)
{
    overlay->workers = array_zero(threads, sizeof *overlay->workers);
    bool done = overlay->workers;
    for (unsigned w = 0; w < threads && done; w++)
        done = (overlay->workers[w].own = array_zero(overlay->field_count, sizeof(double))) != NULL;
    for (unsigned w = 0; w < threads && done && overlay->options->floors; w++)
        memcpy(overlay->workers[w].own, overlay->options->floors, overlay->field_count * sizeof(double));
    return done ? TETLOD_OK : tetlodi_fail_nomem(error, "the overlay", threads * (uint64_t)sizeof *overlay->workers);
}

static void overlay_fini(struct overlay *overlay, unsigned threads)
{
    for (int m = 0; m < 2; m++)
        free(overlay->usable[m]);
    for (unsigned w = 0; w < threads && overlay->workers; w++)
        free(overlay->workers[w].own);
    free(overlay->workers);
    free(overlay->compared);
    free(overlay->boxes);
    free(overlay->asked);
    free(overlay->covered);
    free(overlay->own_neighbours);
    clusters_fini(&overlay->own_clusters);
}

static void gather(const struct overlay *overlay, unsigned threads, double *out, struct overlay_report *report)
{
    memset(out, 0, overlay->field_count * sizeof *out);
    for (unsigned w = 0; w < threads; w++) {
        const struct worker *worker = &overlay->workers[w];
        report->cells += worker->cells;
        for (uint32_t f = 0; f < overlay->field_count; f++)
            out[f] = larger(out[f], worker->own[f]);
    }
}

uint64_t overlay_bytes(uint32_t a_tets, uint32_t b_tets)
{
    enum { SMALL = 4096 }; // the fields and the worker
    return (uint64_t)a_tets + b_tets * (uint64_t)(1 + 6 * sizeof(double)) +
        clusters_building_bytes(a_tets > b_tets ? a_tets : b_tets) + SMALL;
}

enum tetlod_status overlay_max(const struct tetmesh *a, const uint32_t *a_fields, const struct tetmesh *b,
                               const uint32_t *b_fields, uint32_t count, const struct overlay_options *options,
                               double *out, struct overlay_report *report, struct tetlod_error *error)
{
    struct overlay overlay = {.meshes = {a, b}, .finer = !options->each && b->tet_count > a->tet_count,
                              .field_count = count, .options = options};
    enum tetlod_status status;
    unsigned threads = options->threads;
    threads = threads < 1 ? 1 : threads > PARALLEL_MAX_THREADS ? PARALLEL_MAX_THREADS : threads;
    *report = (struct overlay_report){0};
    TETLOD_TRY_DONE(prepare_mesh(&overlay, 0, report, error));
    TETLOD_TRY_DONE(prepare_mesh(&overlay, 1, report, error));
    TETLOD_TRY_DONE(prepare_fields(&overlay, a_fields, b_fields, error));
    TETLOD_TRY_DONE(prepare_workers(&overlay, threads, error));
    TETLOD_TRY_DONE(prepare_boxes(&overlay, error));
    overlay.one_body = is_one_body(&overlay);
    TETLOD_TRY_DONE(prepare_asked(&overlay, error));
    TETLOD_TRY_DONE(prepare_cover(&overlay, error));
    parallel_for(threads, overlay.meshes[!overlay.finer]->tet_count, CHUNK, compare_range, &overlay);
    gather(&overlay, threads, out, report);
done:
    overlay_fini(&overlay, threads);
    return status;
}
