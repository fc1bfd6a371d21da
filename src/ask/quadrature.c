/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: a mesh, a box, a number of points. Out: points and weights.
 *
 * 1. Every tetrahedron is clipped to the box: pieces that do not overlap, with their volumes.
 * 2. Point i lies in the piece that has the volume (i + a random part of 1) / count of all, at random in it: so each
 *    part of the mesh has as many points as it should, up to one.
 * 3. All weights begin alike. The change of least squares is added that makes the sums of weights, and of weights and
 *    values, right for every component (calibration: Deville and Sarndal, 1992). Components are made orthogonal one
 *    after the other; one that is a combination of those before is right with them.
 */
#include "src/ask/quadrature.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/ask/clip.h"
#include "src/util/array.h"

static const double DEPENDENT = 1e-10; /* what is left of a component's length, where it is a combination of others */

/* ---- pieces */

struct piece {
    double rows[4][4]; /* as clip.h has them */
    double volume;
    uint32_t tet;
};

struct pieces {
    const struct tetmesh *mesh;
    struct piece *items;
    size_t count, capacity;
    double total, of_tet;
    uint32_t tet;
    bool nomem;
};

static void add_piece(struct pieces *pieces, const struct clipped *clipped, unsigned number)
{
    const double volume = clipped->shares[number] * pieces->of_tet;
    if (!(volume > 0) || pieces->nomem)
        return;
    if (!ARRAY_RESERVE(pieces->items, pieces->capacity, pieces->count + 1)) {
        pieces->nomem = true;
        return;
    }
    struct piece *piece = &pieces->items[pieces->count++];
    for (int i = 0; i < 4; i++)
        memcpy(piece->rows[i], clipped->weights[clipped->pieces[number][i]], sizeof piece->rows[i]);
    piece->volume = volume;
    piece->tet = pieces->tet;
    pieces->total += volume;
}

static double volume_of(const struct tetmesh *mesh, uint32_t tet)
{
    const double *p[4];
    double d[3][3];
    for (int c = 0; c < 4; c++)
        p[c] = mesh->positions + 3 * (size_t)mesh->corners[4 * (size_t)tet + (size_t)c];
    for (int i = 0; i < 3; i++)
        for (int axis = 0; axis < 3; axis++)
            d[i][axis] = p[i + 1][axis] - p[0][axis];
    return fabs(d[0][0] * (d[1][1] * d[2][2] - d[1][2] * d[2][1]) - d[0][1] * (d[1][0] * d[2][2] - d[1][2] * d[2][0]) +
                d[0][2] * (d[1][0] * d[2][1] - d[1][1] * d[2][0])) / 6;
}

static enum tetlod_status make_pieces(struct pieces *pieces, const double *box, struct tetlod_error *error)
{
    const struct tetmesh *mesh = pieces->mesh;
    struct clipped clipped;
    for (pieces->tet = 0; pieces->tet < mesh->tet_count; pieces->tet++) {
        double functions[6][4];
        const uint32_t *corners = mesh->corners + 4 * (size_t)pieces->tet;
        for (int axis = 0; axis < 3 && box; axis++)
            for (int c = 0; c < 4; c++) {
                const double x = mesh->positions[3 * (size_t)corners[c] + (size_t)axis];
                functions[2 * axis][c] = x - box[axis];
                functions[2 * axis + 1][c] = box[3 + axis] - x;
            }
        pieces->of_tet = volume_of(mesh, pieces->tet);
        clip_tet((const double(*)[4])functions, box ? 6 : 0, &clipped);
        for (unsigned i = 0; i < clipped.piece_count; i++)
            add_piece(pieces, &clipped, i);
    }
    if (pieces->nomem)
        return tetlodi_fail_nomem(error, "the parts of the mesh", pieces->capacity * (uint64_t)sizeof *pieces->items);
    return pieces->total > 0 ? TETLOD_OK : tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "the box has nothing of the mesh");
}

/* ---- points */

/* Numbers of splitmix64, from 0 up to below 1. */
static double next_random(uint64_t *state)
{
    uint64_t x = *state += 0x9e3779b97f4a7c15ull;
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9ull;
    x = (x ^ x >> 27) * 0x94d049bb133111ebull;
    return (double)((x ^ x >> 31) >> 11) * 0x1p-53;
}

/* Weights of a uniform point for the corners of a tetrahedron: the gaps between three sorted numbers. */
static void random_weights(uint64_t *state, double out[4])
{
    double u[3] = {next_random(state), next_random(state), next_random(state)};
    for (int i = 1; i < 3; i++)
        for (int k = i; k > 0 && u[k] < u[k - 1]; k--) {
            const double one = u[k];
            u[k] = u[k - 1];
            u[k - 1] = one;
        }
    out[0] = u[0];
    out[1] = u[1] - u[0];
    out[2] = u[2] - u[1];
    out[3] = 1 - u[2];
}

static void place_point(struct quadrature *out, const struct tetmesh *mesh, const struct piece *piece, size_t i,
                        uint64_t *state)
{
    double weights[4];
    random_weights(state, weights);
    out->tets[i] = piece->tet;
    for (int c = 0; c < 4; c++) {
        out->shares[i][c] = 0;
        for (int k = 0; k < 4; k++)
            out->shares[i][c] += weights[k] * piece->rows[k][c];
    }
    for (size_t axis = 0; axis < 3; axis++) {
        double x = 0;
        for (size_t c = 0; c < 4; c++)
            x += out->shares[i][c] * mesh->positions[3 * (size_t)mesh->corners[4 * (size_t)piece->tet + c] + axis];
        out->points[3 * i + axis] = x;
    }
}

static void place_points(struct quadrature *out, const struct pieces *pieces, uint64_t seed)
{
    double before = 0; /* volume of the pieces before this one */
    size_t piece = 0;
    for (size_t i = 0; i < out->count; i++) {
        const double at = ((double)i + next_random(&seed)) / (double)out->count * pieces->total;
        while (piece + 1 < pieces->count && before + pieces->items[piece].volume <= at)
            before += pieces->items[piece++].volume;
        place_point(out, pieces->mesh, &pieces->items[piece], i, &seed);
    }
}

double quadrature_value(const struct quadrature *quadrature, const struct tetmesh *mesh,
                        const struct point_field *field, uint32_t component, size_t i)
{
    const uint32_t *corners = mesh->corners + 4 * (size_t)quadrature->tets[i];
    double sum = 0;
    for (int c = 0; c < 4; c++)
        sum += quadrature->shares[i][c] * field->values[(size_t)corners[c] * field->components + component];
    return sum;
}

/* ---- weights */

struct rows {
    double *values, *wanted; /* [count * points]: orthogonal ones of length 1; [count]: the sums that they must have */
    size_t count;
};

static double integral(const struct pieces *pieces, const struct point_field *field, uint32_t component)
{
    double sum = 0;
    for (size_t i = 0; i < pieces->count; i++) {
        const struct piece *piece = &pieces->items[i];
        const uint32_t *corners = pieces->mesh->corners + 4 * (size_t)piece->tet;
        double mean = 0;
        for (int k = 0; k < 4; k++)
            for (int c = 0; c < 4; c++)
                mean += piece->rows[k][c] * field->values[(size_t)corners[c] * field->components + component] / 4;
        sum += piece->volume * mean;
    }
    return sum;
}

static double dot(const double *a, const double *b, size_t count)
{
    double sum = 0;
    for (size_t i = 0; i < count; i++)
        sum += a[i] * b[i];
    return sum;
}

/* Makes the last row orthogonal to those before and of length 1, and its sum with it. Drops it if nothing is left. */
static void settle_row(struct rows *rows, size_t points)
{
    double *row = rows->values + rows->count * points, wanted = rows->wanted[rows->count];
    const double length = sqrt(dot(row, row, points));
    for (int again = 0; again < 2; again++) // twice is enough (Kahan, Parlett)
        for (size_t k = 0; k < rows->count; k++) {
            const double *other = rows->values + k * points, part = dot(row, other, points);
            for (size_t i = 0; i < points; i++)
                row[i] -= part * other[i];
            wanted -= part * rows->wanted[k];
        }
    const double left = sqrt(dot(row, row, points));
    if (!(left > DEPENDENT * length))
        return;
    for (size_t i = 0; i < points; i++)
        row[i] /= left;
    rows->wanted[rows->count++] = wanted / left;
}

static void add_rows(struct rows *rows, const struct quadrature *points, const struct pieces *pieces)
{
    const struct tetmesh *mesh = pieces->mesh;
    for (size_t i = 0; i < points->count; i++)
        rows->values[i] = 1;
    rows->wanted[0] = pieces->total;
    settle_row(rows, points->count);
    for (uint32_t f = 0; f < mesh->field_count; f++)
        for (uint32_t c = 0; c < mesh->fields[f].components; c++) {
            double *row = rows->values + rows->count * points->count;
            for (size_t i = 0; i < points->count; i++)
                row[i] = quadrature_value(points, mesh, &mesh->fields[f], c, i);
            rows->wanted[rows->count] = integral(pieces, &mesh->fields[f], c);
            settle_row(rows, points->count);
        }
}

static enum tetlod_status weigh(struct quadrature *out, const struct pieces *pieces, struct tetlod_error *error)
{
    const struct tetmesh *mesh = pieces->mesh;
    size_t components = 1;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        components += mesh->fields[f].components;
    if (out->count <= components)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "%zu points are too few for its %zu components: take more than "
                                                        "%zu", out->count, components - 1, components);
    struct rows rows = {array_new((components + 1) * out->count, sizeof(double)),
                        array_new(components + 1, sizeof(double)), 0};
    enum tetlod_status status = rows.values && rows.wanted
                                    ? TETLOD_OK
                                    : tetlodi_fail_nomem(error, "the weights", components * out->count * (uint64_t)8);
    if (status == TETLOD_OK) {
        add_rows(&rows, out, pieces);
        for (size_t i = 0; i < out->count; i++)
            out->weights[i] = pieces->total / (double)out->count;
        for (int again = 0; again < 2; again++) // the second time takes away what rounding left
            for (size_t k = 0; k < rows.count; k++) {
                const double *row = rows.values + k * out->count;
                const double missing = rows.wanted[k] - dot(row, out->weights, out->count);
                for (size_t i = 0; i < out->count; i++)
                    out->weights[i] += missing * row[i];
            }
        for (size_t i = 0; i < out->count; i++)
            out->has_negative |= out->weights[i] < 0;
    }
    free(rows.values);
    free(rows.wanted);
    return status;
}

enum tetlod_status quadrature_make(struct quadrature *out, const struct tetmesh *mesh, const double *box, size_t count,
                                   uint64_t seed, struct tetlod_error *error)
{
    struct pieces pieces = {.mesh = mesh};
    *out = (struct quadrature){.count = count};
    out->points = array_new(count, 3 * sizeof *out->points);
    out->weights = array_new(count, sizeof *out->weights);
    out->tets = array_new(count, sizeof *out->tets);
    out->shares = array_new(count, sizeof *out->shares);
    enum tetlod_status status = out->points && out->weights && out->tets && out->shares
                                    ? make_pieces(&pieces, box, error)
                                    : tetlodi_fail_nomem(error, "the points", count * (uint64_t)68);
    if (status == TETLOD_OK) {
        out->volume = pieces.total;
        place_points(out, &pieces, seed);
        status = weigh(out, &pieces, error);
    }
    free(pieces.items);
    return status;
}

void quadrature_fini(struct quadrature *quadrature)
{
    free(quadrature->points);
    free(quadrature->weights);
    free(quadrature->tets);
    free(quadrature->shares);
}
