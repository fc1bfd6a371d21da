/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/diff/overlap.h"

#include <string.h>

/* A cell of less than this of the smaller tetrahedron is a sliver. */
static const double SLIVER = 0.01;

/* A pair whose weights may be wrong by more than this is not clipped. */
static const double HOPELESS = 1e-4;

/* Is a place of the cell, by its weights, one of both originals? */
static bool is_in_both(const struct overlap *cell, const double weights[4])
{
    const struct measuring *measuring = cell->measuring;
    double place[3] = {0};
    if (!cell->near)
        return true;
    for (int c = 0; c < 4; c++) {
        const double *p = mesh_corner(measuring->sides[cell->clipped].mesh, cell->tets[cell->clipped], c);
        for (int i = 0; i < 3; i++)
            place[i] += weights[c] * p[i];
    }
    const struct moved_boundary *boundaries = measuring->out->boundaries;
    return moved_boundary_leaves(&boundaries[0], place) && moved_boundary_leaves(&boundaries[1], place);
}

/* What the difference is at least: at a corner, or further inside where a corner is not in both. `most`: at any. */
static void raise_lower(struct overlap *cell, double most)
{
    enum { STEPS = 4 };
    const struct overlap_worker *worker = cell->worker;
    const struct clipped *part = &worker->part;
    double middle[4] = {0}, mean = 0, error = 0;
    for (unsigned v = 0; v < part->count; v++) {
        mean += worker->values[v] / part->count;
        error += worker->errors[v] / part->count;
        for (int c = 0; c < 4; c++)
            middle[c] += part->weights[v][c] / part->count;
    }
    for (unsigned v = 0; v < part->count && most > cell->lower; v++)
        for (int step = 0; step <= (cell->near ? STEPS : 0); step++) {
            double t = step / (double)STEPS, weights[4], d = worker->values[v], own = worker->errors[v];
            double lower = fabs(d + t * (mean - d)) - (own + t * (error - own));
            if (!(lower > cell->lower))
                break;
            for (int c = 0; c < 4; c++)
                weights[c] = part->weights[v][c] + t * (middle[c] - part->weights[v][c]);
            if (!is_in_both(cell, weights))
                continue;
            cell->lower = lower;
            memcpy(cell->weights, weights, sizeof weights);
            break;
        }
}

/* The integral of the square of what has these values at the corners, of a volume of 1. */
static double square_of(const struct clipped *part, const double *values)
{
    double square = 0;
    for (unsigned i = 0; i < part->piece_count; i++) {
        const uint16_t *v = part->pieces[i];
        double a = values[v[0]], b = values[v[1]], c = values[v[2]], d = values[v[3]], sum = a + b + c + d;
        square += part->shares[i] * (a * a + b * b + c * c + d * d + sum * sum) / 20;
    }
    return square;
}

static void add_component(struct overlap *cell, uint32_t c)
{
    struct overlap_worker *worker = cell->worker;
    const struct clipped *part = &worker->part;
    const double *at = worker->differences + 4 * (size_t)c;
    double most = -INFINITY;
    for (unsigned v = 0; v < part->count; v++) {
        double d = worker->values[v] = clip_value(at, part->weights[v]);
        cell->upper = larger(cell->upper, fabs(d) + worker->errors[v]);
        most = larger(most, fabs(d) - worker->errors[v]);
    }
    if (most > cell->lower)
        raise_lower(cell, most);
    cell->square += square_of(part, worker->values);
    cell->integral += c == 0 ? clip_integral(part, worker->values) : 0;
}

static void add_part(struct overlap *cell)
{
    const struct measuring *measuring = cell->measuring;
    struct overlap_worker *worker = cell->worker;
    const bool varies = measuring->bounds[0] || measuring->bounds[1];
    cell->integral = cell->square = cell->upper = 0;
    for (unsigned v = 0; v < worker->part.count; v++)
        worker->errors[v] = varies ? larger(clip_value(cell->errors, worker->part.weights[v]), 0) : cell->errors[0];
    cell->error_square = measuring->components * square_of(&worker->part, worker->errors);
    for (uint32_t c = 0; c < measuring->components; c++)
        add_component(cell, c);
}

static const double *values_at(const struct measuring *measuring, int m, uint32_t tet, int k)
{
    size_t vertex = measuring->sides[m].mesh->corners[4 * (size_t)tet + (size_t)k];
    return measuring->values[m] + vertex * measuring->stride;
}

static double bound_at(const struct measuring *measuring, int m, uint32_t tet, int k)
{
    size_t vertex = measuring->sides[m].mesh->corners[4 * (size_t)tet + (size_t)k];
    return measuring->bounds[m] ? measuring->bounds[m][vertex] : measuring->sides[m].error;
}

/* Differences and bounds at the corners of the clipped tetrahedron: the other one's functions are continued to there.
 * Values are taken less one of them, so that rounding is about what varies. */
static void gather(struct overlap *cell)
{
    const struct measuring *measuring = cell->measuring;
    int own = cell->clipped, other = !own;
    double size = 0;
    for (int k = 0; k < 4; k++) {
        cell->errors[k] = bound_at(measuring, own, cell->tets[own], k);
        for (int j = 0; j < 4; j++)
            cell->errors[k] += cell->in[own][k][j] * bound_at(measuring, other, cell->tets[other], j);
        size = larger(size, bound_at(measuring, 0, cell->tets[0], k) + bound_at(measuring, 1, cell->tets[1], k));
    }
    for (uint32_t c = 0; c < measuring->components; c++) {
        double base = measuring->same ? 0 : values_at(measuring, 0, cell->tets[0], 0)[c], v[2][4];
        for (int m = 0; m < 2; m++)
            for (int k = 0; k < 4; k++) {
                v[m][k] = values_at(measuring, m, cell->tets[m], k)[c] - base;
                size = larger(size, fabs(v[m][k]));
            }
        for (int k = 0; k < 4; k++) {
            const double *in = cell->in[own][k];
            double sum = in[0] * v[other][0] + in[1] * v[other][1] + in[2] * v[other][2] + in[3] * v[other][3];
            sum = measuring->same ? v[other][k] : sum; // without rounding
            cell->worker->differences[4 * c + (unsigned)k] = own ? sum - v[own][k] : v[own][k] - sum;
        }
    }
    cell->noise = 32 * size * cell->slack;
}

/* Where weights mean nothing: the difference is no more than that of any two corners. */
static void add_hopeless(struct overlap *cell)
{
    const struct measuring *measuring = cell->measuring;
    struct difference_cell *out = &measuring->out->cells[cell->tets[0]];
    double most = 0, error = 0;
    for (uint32_t c = 0; c < measuring->components; c++)
        for (int i = 0; i < 16; i++)
            most = larger(most, fabs(values_at(measuring, 0, cell->tets[0], i / 4)[c] -
                                     values_at(measuring, 1, cell->tets[1], i % 4)[c]));
    for (int m = 0; m < 2; m++)
        for (int k = 0; k < 4; k++)
            error = larger(error, bound_at(measuring, m, cell->tets[m], k));
    most += 2 * error;
    out->upper = larger(out->upper, most);
    out->squares[1] += smaller(cell->volumes[0], cell->volumes[1]) * measuring->components * most * most;
}

static void keep_place(const struct overlap *cell, double lower)
{
    struct overlap_worker *worker = cell->worker;
    if (!(lower > worker->lower || (lower == worker->lower && cell->tets[0] < worker->tet)))
        return;
    worker->lower = lower;
    worker->tet = cell->tets[0];
    memset(worker->place, 0, sizeof worker->place);
    for (int c = 0; c < 4; c++) {
        const double *p = mesh_corner(cell->measuring->sides[cell->clipped].mesh, cell->tets[cell->clipped], c);
        for (int i = 0; i < 3; i++)
            worker->place[i] += cell->weights[c] * p[i];
    }
}

/* What the cell's pieces have come to counts for the tetrahedron of the first mesh. */
static void add_cell(const struct overlap *cell)
{
    const struct measuring *measuring = cell->measuring;
    struct difference_cell *out = &measuring->out->cells[cell->tets[0]];
    double volume = cell->volumes[cell->clipped] * cell->worker->part.share;
    double root = sqrt(cell->volumes[cell->clipped]), more = cell->noise * sqrt(volume * measuring->components);
    double own = root * sqrt(cell->square), by = root * sqrt(cell->error_square) + more;
    double low = larger(own - by, 0), high = own + by;
    out->volume += volume;
    out->integral += cell->volumes[cell->clipped] * cell->integral;
    out->squares[0] += low * low;
    out->squares[1] += high * high;
    out->upper = larger(out->upper, cell->upper + cell->noise);
    out->left |= cell->near;
    if (volume < SLIVER * smaller(cell->volumes[0], cell->volumes[1]))
        return;
    double lower = cell->lower - cell->noise;
    out->lower = larger(out->lower, lower);
    keep_place(cell, lower);
}

/* Is the cell more than a contact? In both tetrahedra it reaches inside from every face. That is asked only if it has
 * little of their volume. */
static bool is_overlap(const struct overlap *cell, double volume)
{
    const struct clipped *part = &cell->worker->part;
    const int own = cell->clipped;
    double least = 1, reach[2][4] = {{0}};
    if (volume > (1e-7 + 16 * cell->slack) * larger(cell->volumes[0], cell->volumes[1]))
        return true;
    for (unsigned v = 0; v < part->count; v++)
        for (int k = 0; k < 4; k++) {
            double other = 0;
            for (int c = 0; c < 4; c++)
                other += part->weights[v][c] * cell->in[own][c][k];
            reach[own][k] = larger(reach[own][k], part->weights[v][k]);
            reach[!own][k] = larger(reach[!own][k], other);
        }
    for (int i = 0; i < 8; i++)
        least = smaller(least, reach[i / 4][i % 4]);
    return least > THIN + (cell->slack < THIN ? 3 * cell->slack : 0);
}

/* Of bodies that are not each other's nothing is compared. False: so it is. */
static bool compares(const struct overlap *cell, double volume)
{
    const struct measuring *measuring = cell->measuring;
    struct overlap_worker *worker = cell->worker;
    if (!measuring->bodies[0])
        return true;
    uint32_t a = measuring->bodies[0][cell->tets[0]], b = measuring->bodies[1][cell->tets[1]];
    uint64_t units = (uint64_t)(volume / measuring->unit);
    if (measuring->pairing) {
        worker->no_memory |= !body_pairs_add(&worker->pairs, a, b, units);
        return false;
    }
    bool kept = body_pairs_kept(&measuring->pairs, a, b);
    worker->apart += kept ? 0 : units;
    return kept;
}

static bool is_near(const struct measuring *measuring, int m, uint32_t tet)
{
    return measuring->near[m] && measuring->near[m][tet];
}

/* Is only asked whether a difference is above the limit? */
static bool asks_limit(const struct measuring *measuring)
{
    return measuring->open->asked && !measuring->bodies[0];
}

/* Is the difference certainly within the limit, by its values at these corners of the cell, or of what holds it? */
static bool is_within(struct overlap *cell, const double (*corners)[4], unsigned count)
{
    const struct measuring *measuring = cell->measuring;
    const struct overlap_worker *worker = cell->worker;
    struct difference_cell *out = &measuring->out->cells[cell->tets[0]];
    double most = 0;
    for (unsigned v = 0; v < count; v++) {
        double largest = 0;
        for (uint32_t c = 0; c < measuring->components; c++)
            largest = larger(largest, fabs(clip_value(worker->differences + 4 * (size_t)c, corners[v])));
        most = larger(most, largest + larger(clip_value(cell->errors, corners[v]), 0));
    }
    most += cell->noise;
    if (most > measuring->open->limit)
        return false;
    out->upper = larger(out->upper, most);
    out->left |= cell->near;
    return true;
}

/* The same by the corners of each of the two tetrahedra. */
static bool is_decided(struct overlap *cell, const double slacks[2])
{
    static const double whole[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
    const int own = cell->clipped;
    for (int m = 1; m >= 0; m--) {
        cell->clipped = m == 0 ? own : !own;
        cell->slack = slacks[cell->clipped];
        gather(cell);
        if (is_within(cell, whole, 4))
            return true;
    }
    return false;
}

/* Returns the cell's volume; 0 for a contact. */
static double compare_cell(struct overlap *cell)
{
    clip_pieces(&cell->worker->part);
    const double volume = cell->volumes[cell->clipped] * cell->worker->part.share;
    if (!is_overlap(cell, volume))
        return 0;
    if (!compares(cell, volume))
        return volume;
    cell->lower = cell->near ? cell->measuring->out->cells[cell->tets[0]].lower // to be asked of few places
                             : -INFINITY;
    memset(cell->weights, 0, sizeof cell->weights);
    add_part(cell);
    add_cell(cell);
    return volume;
}

/* Clips the cell, and compares there, but for what is certainly within the limit that is open. False: a contact. */
static bool clip_cell(struct overlap *cell)
{
    double planes[4][4];
    unsigned count = 0;
    int own = cell->clipped;
    for (int k = 0; k < 4; k++) {
        double least = 1;
        for (int c = 0; c < 4; c++) {
            planes[count][c] = cell->in[own][c][k] + 2 * cell->slack;
            least = smaller(least, planes[count][c]);
        }
        count += least < 0;
    }
    clip_corners((const double(*)[4])planes, count, &cell->worker->part);
    if (cell->measuring->same || (!asks_limit(cell->measuring) && !cell->measuring->pairing))
        gather(cell); // else that is done
    if (asks_limit(cell->measuring) && is_within(cell, cell->worker->part.weights, cell->worker->part.count))
        return cell->worker->part.count > 0;
    const double volume = compare_cell(cell);
    cell->covered += volume;
    return volume > 0;
}

bool overlap_compare(struct overlap *cell, const struct weights_map *map)
{
    struct measuring *measuring = cell->measuring;
    const struct tetmesh *a = measuring->sides[0].mesh, *b = measuring->sides[1].mesh;
    double slacks[2];
    cell->worker->seen[cell->tets[1]] = cell->tets[0] + 1;
    if (!measuring->usable[1][cell->tets[1]] || !weigh_corners(map, b, cell->tets[1], cell->in[1], &slacks[1]) ||
        !weigh_corners(&measuring->maps[cell->tets[1]], a, cell->tets[0], cell->in[0], &slacks[0]))
        return false;
    cell->volumes[1] = measuring->volumes[cell->tets[1]];
    cell->clipped = slacks[1] < slacks[0];
    cell->slack = slacks[cell->clipped];
    cell->near = is_near(measuring, 0, cell->tets[0]) || is_near(measuring, 1, cell->tets[1]);
    if (cell->slack <= HOPELESS)
        return (asks_limit(measuring) && is_decided(cell, slacks)) || clip_cell(cell);
    cell->ends = true;
    if (compares(cell, 0))
        add_hopeless(cell);
    return false;
}

void overlap_compare_self(struct overlap *cell)
{
    static const double whole[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
    memcpy(cell->in[0], whole, sizeof whole);
    cell->tets[1] = cell->tets[0];
    cell->volumes[1] = cell->volumes[0];
    cell->near = is_near(cell->measuring, 0, cell->tets[0]) || is_near(cell->measuring, 1, cell->tets[0]);
    cell->clipped = 0;
    cell->slack = 0;
    clip_cell(cell);
}
