/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/measure/overlay.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/bvh.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

/* The middle of an intersection is at least this far inside both tetrahedra, by barycentric weights; less is a contact. What is less far
 * outside is in a tetrahedron, but for rounding. */
static const double THIN = 1e-9;

/* Which tetrahedra are at a corner of the overlay is looked up this much towards the middle of its cell. */
static const double INWARDS = 1e-6;

enum { MOST_ENDS = 24, CHUNK = 64 };

/* lambda_j(p) = rows[j-1] . (p - origin), j = 1..3. */
struct weights_map {
    double origin[3], rows[3][3];
};

/* A component of a field, in both meshes. */
struct compared {
    const double *values[2]; /* of the component at vertex 0 */
    uint32_t stride, field;
};

/* One thread's. */
struct worker {
    double *most;         /* [field_count] */
    uint32_t *candidates; /* of b, near the tetrahedron of a at hand */
    size_t capacity;
    uint32_t candidate_count;
    uint64_t cells;
    bool failed;
};

struct overlay {
    const struct tetmesh *meshes[2]; /* borrowed */
    struct bvh bvh;                  /* of b's tetrahedra */
    double *boxes;                   /* [6 * tet of b] */
    struct weights_map *maps[2];     /* [tet] */
    uint8_t *degenerate[2];          /* [tet] */
    uint32_t field_count, compared_count;
    struct compared *compared;
    struct worker *workers;
};

/* The intersection of a tetrahedron of a and one of b: the ends of the clipped edges, by weights in both. */
struct cell {
    uint32_t tets[2];
    int count;
    double ends[MOST_ENDS][2][4];
    double middle[2][4];
};

static const double *corner(const struct tetmesh *mesh, uint32_t tet, int c)
{
    return mesh->positions + 3 * (size_t)mesh->corners[4 * (size_t)tet + (size_t)c];
}

static void make_map(const struct tetmesh *mesh, uint32_t tet, struct weights_map *out)
{
    double edges[3][3], volume6;
    memcpy(out->origin, corner(mesh, tet, 0), sizeof out->origin);
    for (int j = 0; j < 3; j++)
        for (int i = 0; i < 3; i++)
            edges[j][i] = corner(mesh, tet, j + 1)[i] - out->origin[i];
    volume6 = tet_volume6(corner(mesh, tet, 0), corner(mesh, tet, 1), corner(mesh, tet, 2), corner(mesh, tet, 3));
    for (int j = 0; j < 3; j++) {
        const double *u = edges[(j + 1) % 3], *v = edges[(j + 2) % 3];
        for (int i = 0; i < 3; i++)
            out->rows[j][i] = (u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]) / volume6;
    }
}

static void weights_of(const struct weights_map *map, const double p[3], double out[4])
{
    double r[3] = {p[0] - map->origin[0], p[1] - map->origin[1], p[2] - map->origin[2]};
    for (int j = 0; j < 3; j++)
        out[j + 1] = map->rows[j][0] * r[0] + map->rows[j][1] * r[1] + map->rows[j][2] * r[2];
    out[0] = 1 - out[1] - out[2] - out[3];
}

/* Weights in tetrahedron `in` of mesh `m` of the other's corners. False if they all lie on or behind one of its faces: most
 * pairs, so that is asked face by face. */
static bool weigh_corners(const struct overlay *overlay, int m, uint32_t in, uint32_t other, double out[4][4])
{
    const struct weights_map *map = &overlay->maps[m][in];
    double r[4][3], most;
    for (int c = 0; c < 4; c++)
        for (int i = 0; i < 3; i++)
            r[c][i] = corner(overlay->meshes[!m], other, c)[i] - map->origin[i];
    for (int k = 1; k < 4; k++) {
        const double *row = map->rows[k - 1];
        for (int c = 0; c < 4; c++)
            out[c][k] = row[0] * r[c][0] + row[1] * r[c][1] + row[2] * r[c][2];
        most = larger(larger(out[0][k], out[1][k]), larger(out[2][k], out[3][k]));
        if (!(most > THIN))
            return false;
    }
    for (int c = 0; c < 4; c++)
        out[c][0] = 1 - out[c][1] - out[c][2] - out[c][3];
    most = larger(larger(out[0][0], out[1][0]), larger(out[2][0], out[3][0]));
    return most > THIN;
}

/* A corner that both have is where it is, whatever rounding says. */
static void match_corners(const struct overlay *overlay, const uint32_t tets[2], double in_b[4][4], double in_a[4][4])
{
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            const double *p = corner(overlay->meshes[0], tets[0], i), *q = corner(overlay->meshes[1], tets[1], j);
            if (p[0] != q[0] || p[1] != q[1] || p[2] != q[2])
                continue;
            for (int k = 0; k < 4; k++) {
                in_b[i][k] = k == j;
                in_a[j][k] = k == i;
            }
        }
}

/* Clips the edges of the cell's tetrahedron of mesh m to the other one, in which its corners have the weights `in`. */
static void clip_edges(struct cell *cell, int m, double in[4][4])
{
    for (int e = 0; e < 6; e++) {
        int i = tet_edges[e][0], j = tet_edges[e][1];
        double t[2] = {0, 1};
        for (int k = 0; k < 4; k++) {
            double from = in[i][k], to = in[j][k];
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

/* False: they do not overlap, at most touch. */
static bool make_cell(const struct overlay *overlay, uint32_t tet_a, uint32_t tet_b, struct cell *cell)
{
    double in_b[4][4], in_a[4][4];
    *cell = (struct cell){.tets = {tet_a, tet_b}};
    if (!weigh_corners(overlay, 1, tet_b, tet_a, in_b) || !weigh_corners(overlay, 0, tet_a, tet_b, in_a))
        return false;
    match_corners(overlay, cell->tets, in_b, in_a);
    clip_edges(cell, 0, in_b);
    clip_edges(cell, 1, in_a);
    for (int m = 0; m < 2; m++)
        for (int k = 0; k < 4; k++) {
            for (int i = 0; i < cell->count; i++)
                cell->middle[m][k] += cell->ends[i][m][k] / cell->count;
            if (cell->middle[m][k] <= THIN)
                return false;
        }
    return cell->count > 0;
}

/* A value of the field in tetrahedron `tet` of mesh m, at its first corner. */
static double base_of(const struct overlay *overlay, const struct compared *compared, int m, uint32_t tet)
{
    return compared->values[m][(size_t)overlay->meshes[m]->corners[4 * (size_t)tet] * compared->stride];
}

/* The field less a base: so that rounding is about what varies, not about how far from zero it does. */
static double value_at(const struct overlay *overlay, const struct compared *compared, int m, uint32_t tet,
                       const double weights[4], double base)
{
    const uint32_t *corners = overlay->meshes[m]->corners + 4 * (size_t)tet;
    double sum = 0;
    for (int k = 0; k < 4; k++)
        sum += weights[k] * (compared->values[m][(size_t)corners[k] * compared->stride] - base);
    return sum;
}

/* The difference at one end of the cell. It is above `most`: so it counts only if no other tetrahedron of b that is there,
 * too, is nearer to a's value. */
static double difference(const struct overlay *overlay, const struct worker *worker, const struct compared *compared,
                         const struct cell *cell, const double end[2][4], double found)
{
    double p[3] = {0, 0, 0}, inside[3] = {0, 0, 0}, weights[4];
    double base = base_of(overlay, compared, 0, cell->tets[0]);
    double value = value_at(overlay, compared, 0, cell->tets[0], end[0], base);
    for (int c = 0; c < 4; c++)
        for (int i = 0; i < 3; i++) {
            double x = corner(overlay->meshes[0], cell->tets[0], c)[i];
            p[i] += end[0][c] * x;
            inside[i] += (end[0][c] + INWARDS * (cell->middle[0][c] - end[0][c])) * x;
        }
    for (uint32_t i = 0; i < worker->candidate_count; i++) {
        uint32_t tet = worker->candidates[i];
        if (overlay->degenerate[1][tet] || tet == cell->tets[1])
            continue;
        weights_of(&overlay->maps[1][tet], inside, weights);
        if (weights[0] < -THIN || weights[1] < -THIN || weights[2] < -THIN || weights[3] < -THIN)
            continue;
        weights_of(&overlay->maps[1][tet], p, weights);
        found = smaller(found, fabs(value - value_at(overlay, compared, 1, tet, weights, base)));
    }
    return found;
}

static void compare_cell(const struct overlay *overlay, struct worker *worker, const struct cell *cell)
{
    worker->cells++;
    for (uint32_t c = 0; c < overlay->compared_count; c++) {
        const struct compared *compared = &overlay->compared[c];
        double *most = &worker->most[compared->field], base = base_of(overlay, compared, 0, cell->tets[0]);
        for (int i = 0; i < cell->count; i++) {
            double found = fabs(value_at(overlay, compared, 0, cell->tets[0], cell->ends[i][0], base) -
                                value_at(overlay, compared, 1, cell->tets[1], cell->ends[i][1], base));
            if (found > *most)
                *most = larger(*most, difference(overlay, worker, compared, cell, (const double(*)[4])cell->ends[i], found));
        }
    }
}

static void tet_box(const struct tetmesh *mesh, uint32_t tet, double box[6])
{
    for (int i = 0; i < 3; i++) {
        double x[4];
        for (int c = 0; c < 4; c++)
            x[c] = corner(mesh, tet, c)[i];
        box[i] = smaller(smaller(x[0], x[1]), smaller(x[2], x[3]));
        box[i + 3] = larger(larger(x[0], x[1]), larger(x[2], x[3]));
    }
}

/* Of the candidates, which come by the leaf, those whose own box meets the box. */
static void cull_candidates(const struct overlay *overlay, struct worker *worker, const double box[6])
{
    uint32_t kept = 0;
    for (uint32_t k = 0; k < worker->candidate_count; k++) {
        const double *other = overlay->boxes + 6 * (size_t)worker->candidates[k];
        bool meets = true;
        for (int i = 0; i < 3; i++)
            meets &= other[i] <= box[i + 3] && other[i + 3] >= box[i];
        worker->candidates[kept] = worker->candidates[k];
        kept += meets;
    }
    worker->candidate_count = kept;
}

/* The tetrahedra of b near one of a. False: out of memory. */
static bool find_candidates(const struct overlay *overlay, struct worker *worker, uint32_t tet)
{
    double box[6];
    tet_box(overlay->meshes[0], tet, box);
    uint32_t count = bvh_find_box(&overlay->bvh, box, worker->candidates, (uint32_t)worker->capacity);
    if (count > worker->capacity) {
        void *grown = worker->candidates;
        if (!array_reserve(&grown, &worker->capacity, count, sizeof(uint32_t)))
            return false;
        worker->candidates = grown;
        count = bvh_find_box(&overlay->bvh, box, worker->candidates, (uint32_t)worker->capacity);
    }
    worker->candidate_count = count;
    cull_candidates(overlay, worker, box);
    return true;
}

static void compare_range(void *context, unsigned number, size_t begin, size_t end)
{
    const struct overlay *overlay = context;
    struct worker *worker = &overlay->workers[number];
    struct cell cell;
    for (size_t tet = begin; tet < end && !worker->failed; tet++) {
        if (overlay->degenerate[0][tet])
            continue;
        if (!find_candidates(overlay, worker, (uint32_t)tet)) {
            worker->failed = true;
            return;
        }
        for (uint32_t i = 0; i < worker->candidate_count; i++)
            if (!overlay->degenerate[1][worker->candidates[i]] &&
                make_cell(overlay, (uint32_t)tet, worker->candidates[i], &cell))
                compare_cell(overlay, worker, &cell);
    }
}

static enum tetlod_status prepare_mesh(struct overlay *overlay, int m, struct overlay_report *report,
                                       struct tetlod_error *error)
{
    const struct tetmesh *mesh = overlay->meshes[m];
    overlay->maps[m] = array_new(mesh->tet_count, sizeof(struct weights_map));
    overlay->degenerate[m] = array_new(mesh->tet_count, 1);
    if (!overlay->maps[m] || !overlay->degenerate[m])
        return tetlodi_fail_nomem(error, "the overlay", mesh->tet_count * (uint64_t)sizeof(struct weights_map));
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        bool degenerate =
            tet_orientation(corner(mesh, t, 0), corner(mesh, t, 1), corner(mesh, t, 2), corner(mesh, t, 3)) == 0;
        overlay->degenerate[m][t] = degenerate;
        report->degenerate[m] += degenerate;
        if (!degenerate)
            make_map(mesh, t, &overlay->maps[m][t]);
    }
    return TETLOD_OK;
}

static enum tetlod_status prepare_boxes(struct overlay *overlay, struct tetlod_error *error)
{
    const struct tetmesh *b = overlay->meshes[1];
    overlay->boxes = array_new(b->tet_count, 6 * sizeof *overlay->boxes);
    if (!overlay->boxes)
        return tetlodi_fail_nomem(error, "the overlay", b->tet_count * (uint64_t)48);
    for (uint32_t t = 0; t < b->tet_count; t++)
        tet_box(b, t, overlay->boxes + 6 * (size_t)t);
    return bvh_build(&overlay->bvh, b->positions, b->corners, b->tet_count, 4, error);
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
        const struct point_field *a = &overlay->meshes[0]->fields[a_fields[f]], *b = &overlay->meshes[1]->fields[b_fields[f]];
        for (uint32_t k = 0; k < a->components; k++)
            overlay->compared[overlay->compared_count++] = (struct compared){{a->values + k, b->values + k}, a->components, f};
    }
    return TETLOD_OK;
}

static enum tetlod_status prepare_workers(struct overlay *overlay, unsigned threads, struct tetlod_error *error)
{
    overlay->workers = array_zero(threads, sizeof *overlay->workers);
    bool done = overlay->workers;
    for (unsigned w = 0; w < threads && done; w++)
        done = (overlay->workers[w].most = array_zero(overlay->field_count, sizeof(double))) != NULL;
    return done ? TETLOD_OK : tetlodi_fail_nomem(error, "the overlay", threads * (uint64_t)sizeof *overlay->workers);
}

static void overlay_fini(struct overlay *overlay, unsigned threads)
{
    for (int m = 0; m < 2; m++) {
        free(overlay->maps[m]);
        free(overlay->degenerate[m]);
    }
    for (unsigned w = 0; w < threads && overlay->workers; w++) {
        free(overlay->workers[w].most);
        free(overlay->workers[w].candidates);
    }
    free(overlay->workers);
    free(overlay->compared);
    free(overlay->boxes);
    bvh_fini(&overlay->bvh);
}

static enum tetlod_status gather(const struct overlay *overlay, unsigned threads, double *out,
                                 struct overlay_report *report, struct tetlod_error *error)
{
    memset(out, 0, overlay->field_count * sizeof *out);
    for (unsigned w = 0; w < threads; w++) {
        const struct worker *worker = &overlay->workers[w];
        if (worker->failed)
            return tetlodi_fail_nomem(error, "the overlay", worker->capacity * 8);
        report->cells += worker->cells;
        for (uint32_t f = 0; f < overlay->field_count; f++)
            out[f] = larger(out[f], worker->most[f]);
    }
    return TETLOD_OK;
}

enum tetlod_status overlay_max(const struct tetmesh *a, const uint32_t *a_fields, const struct tetmesh *b,
                               const uint32_t *b_fields, uint32_t count, unsigned threads, double *out,
                               struct overlay_report *report, struct tetlod_error *error)
{
    struct overlay overlay = {.meshes = {a, b}, .field_count = count};
    enum tetlod_status status;
    threads = threads < 1 ? 1 : threads > PARALLEL_MOST_THREADS ? PARALLEL_MOST_THREADS : threads;
    *report = (struct overlay_report){0};
    TETLOD_TRY_DONE(prepare_mesh(&overlay, 0, report, error));
    TETLOD_TRY_DONE(prepare_mesh(&overlay, 1, report, error));
    TETLOD_TRY_DONE(prepare_fields(&overlay, a_fields, b_fields, error));
    TETLOD_TRY_DONE(prepare_workers(&overlay, threads, error));
    TETLOD_TRY_DONE(prepare_boxes(&overlay, error));
    parallel_for(threads, a->tet_count, CHUNK, compare_range, &overlay);
    status = gather(&overlay, threads, out, report, error);
done:
    overlay_fini(&overlay, threads);
    return status;
}
