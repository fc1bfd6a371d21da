/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/measured.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/sample_points.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
#include "src/util/array.h"

/* The limit is held by this much more, so that a measurement in another order of operations finds it held. */
static const double SPARE = 1e-9;

/* A sample whose weight at the new vertex is less does not ask anything of its value. */
static const double WEIGHTLESS = 1e-9;

/* A new tetrahedron, seen from the new vertex: a point at `r` from it has the weights rows . r at the link's
 * vertices. */
struct cone {
    double rows[3][3];
    uint32_t link[3], tet;
};

/* What the samples ask of a component's value: an interval, the weights and the best values of those that bound it,
 * least squares. */
struct demand {
    double least, greatest, weights[2], centres[2], squares, products;
};

struct sampler {
    struct cone *cones;
    uint32_t *held;         /* samples of the star, and the cones that they are in */
    double *parts;          /* [sample][component] w, and K less the original value */
    struct demand *demands; /* [component] */
    size_t count, cone_room, held_room, part_room;
};

struct samples {
    uint32_t count, stride;
    double *rows;    /* [stride * sample] position, the components' original values */
    uint32_t *first; /* [tet] a sample in it, or TETLOD_NONE */
    uint32_t *next;  /* [sample] another one in the same tetrahedron, or TETLOD_NONE */
    struct sampler *threads;
    unsigned thread_count;
};

uint64_t measured_bytes(const struct tetmesh *mesh, uint32_t components)
{
    uint64_t samples = mesh->vertex_count + (uint64_t)SAMPLES_PER_TET * mesh->tet_count;
    return samples * (8 * (3 + (uint64_t)components) + 4) + 4 * (uint64_t)mesh->tet_count;
}

static void release(void *state)
{
    struct samples *samples = state;
    for (unsigned t = 0; t < samples->thread_count && samples->threads; t++) {
        void *const owned[] = {samples->threads[t].cones, samples->threads[t].held, samples->threads[t].parts,
                               samples->threads[t].demands};
        for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
            free(owned[i]);
    }
    free(samples->threads);
    free(samples->rows);
    free(samples->first);
    free(samples->next);
    free(samples);
}

/* ---- set-up */

/* Adds the point with these weights in a tetrahedron. U is the original's value, which need not be on the grid. */
static void add_sample(struct samples *samples, const struct working *working, uint32_t tet, const double weights[4])
{
    double *row = samples->rows + (size_t)samples->count * samples->stride;
    memset(row, 0, samples->stride * sizeof *row);
    for (int c = 0; c < 4; c++) {
        const double *at = working_row(working, working->corners[tet][c]);
        for (uint32_t k = 0; k < samples->stride; k++)
            row[k] += weights[c] * at[k < 3 ? k : ROW_FIELDS + 2 * (k - 3)];
    }
    samples->next[samples->count] = samples->first[tet];
    samples->first[tet] = samples->count++;
}

static void add_samples(struct samples *samples, const struct working *working, const struct tetmesh *mesh,
                        uint8_t *seen)
{
    for (uint32_t t = 0; t < working->tet_count; t++) {
        const uint32_t *corners = working->corners[t];
        uint32_t nodes[4];
        double weights[4];
        samples->first[t] = TETLOD_NONE;
        for (int c = 0; c < 4; c++)
            nodes[c] = working->node[corners[c]];
        for (unsigned i = 0; i < SAMPLES_PER_TET && working_orientation(working, t) != 0; i++) {
            sample_weights(mesh, nodes, i, weights);
            add_sample(samples, working, t, weights);
        }
        for (int c = 0; c < 4 && working_orientation(working, t) != 0; c++) { // last, which is first in the list
            double corner[4] = {c == 0, c == 1, c == 2, c == 3};
            if (!seen[corners[c]])
                add_sample(samples, working, t, corner);
            seen[corners[c]] = 1;
        }
    }
}

/* ---- asking */

/* The re-attached tetrahedra with the new vertex at p, where all are well oriented. */
static uint32_t make_cones(struct cone *cones, const struct question *question, const double p[3])
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < question->star->tet_count; i++) {
        const uint32_t *corners = question->working->corners[question->star->tets[i]],
                       moving = question->star->moving[i];
        double e[3][3];
        if (moving == STAR_REMOVED)
            continue;
        struct cone *cone = &cones[count++];
        cone->tet = question->star->tets[i];
        for (uint32_t c = 0, k = 0; c < 4; c++)
            if (c != moving) {
                subtract(working_row(question->working, cone->link[k] = corners[c]), p, e[k]);
                k++;
            }
        for (int k = 0; k < 3; k++)
            cross(e[(k + 1) % 3], e[(k + 2) % 3], cone->rows[k]);
        double volume = dot(e[0], cone->rows[0]);
        for (int k = 0; k < 9; k++)
            cone->rows[k / 3][k % 3] /= volume;
    }
    return count;
}

/* Weights of the link's vertices in the cone in which `r` lies, from *io_cone on. By rounding, or outside a boundary
 * that has moved, it may lie in none: then in the one that misses it least, and no weight is negative. */
static void find_cone(const struct cone *cones, uint32_t count, const double r[3], uint32_t *io_cone, double weights[3])
{
    double best = -INFINITY;
    for (uint32_t i = 0, c = *io_cone; i < count && best < 0; i++, c = c + 1 < count ? c + 1 : 0) {
        double l[3] = {dot(cones[c].rows[0], r), dot(cones[c].rows[1], r), dot(cones[c].rows[2], r)};
        double least = smaller(l[0], smaller(l[1], l[2]));
        if (least <= best)
            continue;
        best = least;
        *io_cone = c;
        for (int k = 0; k < 3; k++)
            weights[k] = larger(l[k], 0);
    }
}

/* Takes a sample in: w s' + rest is its error. Returns a lower bound of the error that some s' can reach: 0 as long as
 * the limit holds. */
static double take_in(struct demand *demand, double w, double rest, double limit)
{
    demand->squares += w * w;
    demand->products -= w * rest;
    if (w < WEIGHTLESS)
        return fabs(rest) > limit ? fabs(rest) : 0;
    double centre = -rest / w, reach = limit / w;
    for (int side = 0; side < 2; side++) {
        double end = side ? centre + reach : centre - reach;
        if (side ? end < demand->greatest : end > demand->least) {
            *(side ? &demand->greatest : &demand->least) = end;
            demand->weights[side] = w;
            demand->centres[side] = centre;
        }
    }
    if (demand->least <= demand->greatest)
        return 0;
    return (demand->centres[0] - demand->centres[1]) / (1 / demand->weights[0] + 1 / demand->weights[1]);
}

/* All samples of the star, with the vertex at p: the error that is needed at least, 0 where the limit can be held. */
static double take_all(const struct samples *samples, struct sampler *sampler, const struct question *question,
                       const double p[3])
{
    const struct working *working = question->working;
    uint32_t cones = make_cones(sampler->cones, question, p), at = 0;
    double worst = 0;
    for (uint32_t c = 0; c < working->component_count; c++)
        sampler->demands[c] = (struct demand){-INFINITY, INFINITY, {1, 1}, {0, 0}, 0, 0};
    sampler->count = 0;
    for (uint32_t i = 0; i < question->star->tet_count && worst == 0; i++)
        for (uint32_t s = samples->first[question->star->tets[i]]; s != TETLOD_NONE && worst == 0;
             s = samples->next[s]) {
            const double *row = samples->rows + (size_t)s * samples->stride;
            double *part = sampler->parts + 2 * sampler->count * working->component_count, r[3], l[3] = {0};
            subtract(row, p, r);
            find_cone(sampler->cones, cones, r, &at, l);
            sampler->held[2 * sampler->count] = s;
            sampler->held[2 * sampler->count++ + 1] = sampler->cones[at].tet;
            for (uint32_t c = 0; c < working->component_count; c++, part += 2) {
                const struct component *component = &working->components[c];
                part[0] = larger(1 - l[0] - l[1] - l[2], 0);
                part[1] = -row[3 + c];
                for (int k = 0; k < 3; k++)
                    part[1] += l[k] * working_values(working, sampler->cones[at].link[k],
                                                     component->field)[component->component];
                if (component->factor > 0)
                    worst = larger(worst, component->factor * take_in(&sampler->demands[c], part[0], part[1],
                                                                      question->limit * (1 -
                                                                                         SPARE) / component->factor));
            }
        }
    return cones ? worst : INFINITY; // a body of its own does not vanish
}

/* The values by least squares within the limit. Returns the error with them. */
static double settle(const struct sampler *sampler, const struct working *working, double *values)
{
    double worst = 0;
    for (uint32_t c = 0; c < working->component_count; c++) {
        const struct component *component = &working->components[c];
        const struct demand *demand = &sampler->demands[c];
        double best = demand->squares > WEIGHTLESS * WEIGHTLESS ? demand->products / demand->squares : 0;
        best = smaller(larger(best, demand->least), demand->greatest);
        values[c] = field_round(&working->fields[component->field], component->component, best);
        for (size_t i = 0; i < sampler->count; i++) {
            const double *part = sampler->parts + 2 * (i * working->component_count + c);
            worst = larger(worst, fabs(part[0] * values[c] + part[1]) * component->factor);
        }
    }
    return worst;
}

static bool reserve(const struct samples *samples, struct sampler *sampler, const struct question *question)
{
    size_t held = 0;
    for (uint32_t i = 0; i < question->star->tet_count; i++)
        for (uint32_t s = samples->first[question->star->tets[i]]; s != TETLOD_NONE; s = samples->next[s])
            held++;
    return ARRAY_RESERVE(sampler->cones, sampler->cone_room, question->star->tet_count) &&
           ARRAY_RESERVE(sampler->held, sampler->held_room, 2 * held) &&
           ARRAY_RESERVE(sampler->parts, sampler->part_room, 2 * held * question->working->component_count);
}

static enum tetlod_status ask(void *state, unsigned worker, const struct question *question, struct answer *answer,
                              struct tetlod_error *error)
{
    const struct samples *samples = state;
    struct sampler *sampler = &samples->threads[worker];
    answer->allowed = false;
    answer->error = INFINITY;
    answer->too_large = 0;
    if (!reserve(samples, sampler, question))
        return tetlodi_fail_nomem(error, "the samples of a star", 0);
    for (uint32_t i = 0; i < question->count && !answer->allowed; i++) {
        double needed = take_all(samples, sampler, question, question->positions[i]), settled = INFINITY;
        if (needed == 0)
            settled = settle(sampler, question->working, answer->values);
        answer->allowed = settled <= question->limit;
        answer->error = answer->allowed ? settled : smaller(answer->error,
                                                            larger(needed, nextafter(question->limit, INFINITY)));
        memcpy(answer->position, question->positions[i], sizeof answer->position);
    }
    if (answer->allowed) {
        answer->passed.numbers = sampler->held; // handed over
        answer->passed.count = 2 * sampler->count;
        sampler->held = NULL;
        sampler->held_room = 0;
    }
    return TETLOD_OK;
}

static enum tetlod_status take(void *state, const struct star *star, const struct answer *answer,
                               struct tetlod_error *error)
{
    struct samples *samples = state;
    (void)error;
    for (uint32_t i = 0; i < star->tet_count && answer->allowed; i++)
        samples->first[star->tets[i]] = TETLOD_NONE;
    for (size_t i = 0; i < answer->passed.count && answer->allowed; i += 2) {
        uint32_t sample = answer->passed.numbers[i], tet = answer->passed.numbers[i + 1];
        samples->next[sample] = samples->first[tet];
        samples->first[tet] = sample;
    }
    return TETLOD_OK;
}

static void renumber(void *state, const struct renumbering *numbers)
{
    struct samples *samples = state;
    samples->first = renumber_tets(numbers, samples->first, sizeof *samples->first);
}

enum tetlod_status measured_new(struct limit *limit, const struct tetmesh *mesh, const struct working *working,
                                unsigned threads,
                                struct tetlod_error *error)
{
    uint64_t most = mesh->vertex_count + (uint64_t)SAMPLES_PER_TET * mesh->tet_count;
    if (most >= TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "the mesh is too large for --metric measured; use another one");
    struct samples *samples = array_zero(1, sizeof *samples);
    uint8_t *seen = array_zero(mesh->vertex_count, 1);
    bool done = samples && seen;
    if (done) {
        *samples = (struct samples){.stride = 3 + working->component_count, .thread_count = threads};
        samples->rows = array_new(most, samples->stride * sizeof *samples->rows);
        samples->next = array_new(most, sizeof *samples->next);
        samples->first = array_new(mesh->tet_count, sizeof *samples->first);
        samples->threads = array_zero(threads, sizeof *samples->threads);
        done = samples->rows && samples->next && samples->first && samples->threads;
    }
    for (unsigned t = 0; t < threads && done; t++)
        done = (samples->threads[t].demands = array_new(working->component_count, sizeof(struct demand))) != NULL;
    if (done) {
        add_samples(samples, working, mesh, seen);
        *limit = (struct limit){samples, release, ask, take, renumber, false};
    } else if (samples)
        release(samples);
    free(seen);
    return done ? TETLOD_OK : tetlodi_fail_nomem(error, "the samples", measured_bytes(mesh, working->component_count));
}
