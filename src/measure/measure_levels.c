/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A level comes as a step of the coarsening. For each sample, in the order of their numbers:
 *   its tetrahedron did not change: its error is what it was;
 *   else a walk from there, or from where a tetrahedron that died has gone, finds the one that holds it now;
 *   where the walk leaves the mesh, the closest point of the boundary decides: the sample is inside if the straight
 * line from there leads to it through the mesh, else its error is the difference from the value at the closest point.
 * Errors are kept per sample; sums are exact (tally.h). The domain error is the largest distance of a boundary vertex
 * of either mesh from the other's boundary; only vertices that are new, or whose nearest face changed, are looked at.
 */
#include "src/measure/measure_levels.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/measure/tally.h"
#include "src/measure/walk.h"
#include "src/mesh/sample_points.h"
#include "src/mesh/sheets.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/triangle.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

/* A sample's tetrahedron, if none of these. */
#define HOST_NONE UINT32_C(0xffffffff)    /* it does not count */
#define HOST_VERTEX UINT32_C(0xfffffffe)  /* a vertex that is still where it was, with its value: no error */
#define HOST_OUTSIDE UINT32_C(0xfffffffd) /* the level does not hold it */
#define HOST_SPECIAL HOST_OUTSIDE

/* A sample that walks have not found. While it is outside: the face of the level's boundary that is closest, and how
 * far that is. */
struct stray {
    size_t sample;
    uint32_t face; /* 4 * tet + face, or TETLOD_NONE: not known */
    double distance;
};

/* A tetrahedron of the original whose samples are looked for. */
struct source {
    size_t tet;             /* or NO_TET */
    bool has_values, has_random;
    uint64_t hashes[4];     /* of the corners' positions */
    uint32_t corners[4];    /* sorted (sample_points.h) */
    double positions[4][3];
    double random[4];       /* weights of its second sample */
    double *values;         /* as walk_gather makes them */
};

#define NO_TET ((size_t)-1)

enum { BATCH = 128 };

/* Samples that are looked for together: what they need from all over memory is on its way before the first is looked
 * for, and what is computed of each does not wait for the walk of the one before. */
struct batch {
    size_t count;
    size_t samples[BATCH];
    uint32_t begins[BATCH]; /* where their walks begin */
    double points[BATCH][3];
    double *own;            /* [BATCH][2 * width] as find_own makes it */
};

/* What one thread has found out. */
struct worker {
    struct walker walker;
    struct source source;
    struct batch batch;
    double *values;  /* of the level, as walk_gather makes them */
    struct stray *strays; /* that its walks have not found */
    size_t stray_count, stray_capacity;
    bool failed; /* out of memory */
};

struct measure_levels {
    const struct tetmesh *original;
    struct coarsening *mesh;
    unsigned threads;
    uint32_t field_count;
    size_t width;           /* components of all fields */
    struct walk_component *components; /* [width] the original's */
    size_t counted;         /* samples that count */
    uint32_t *bodies;       /* [slot] each body is compared with itself; NULL until it is asked for */
    uint32_t *hosts;        /* [sample] */
    float *errors;          /* [field][sample], as tally_keep makes them */
    uint64_t *hashes;       /* [vertex] of positions */
    size_t samples, chunks;
    struct tally *tallies;  /* [field][chunk] */
    double *scales;         /* [field] of the tallies */
    uint8_t *dirty;         /* [chunk] a stray in it has another error */
    struct worker *workers; /* [threads] */
    struct stray *strays;   /* outside at the current level, or to be looked for */
    size_t stray_count, stray_capacity;
    struct mesh_surface boundary; /* of the original */
    struct mesh_surface surface;  /* of the level; empty until it is asked for */
    struct mesh_surface changed;  /* what of it the last step changed */
    uint32_t bound_count;
    uint32_t *bound;         /* [bound_count] vertices of the original's boundary */
    uint32_t *nearest;       /* [bound_count] 4 * tet + face of the level's boundary that is near, or TETLOD_NONE */
    double *distances;       /* [bound_count, or as many as slots were touched] */
    size_t distance_capacity;
    uint8_t *made;           /* [slot] scratch */
    uint32_t *list;          /* slots of the level's boundary that the last step made */
    size_t list_count, list_capacity;
    double domain, enough;   /* largest so far; smaller distances do not matter */
    double rounding;         /* of a distance */
    bool displaced, rounded; /* the finest level is not the original itself: other positions; or other values only */
    bool started;
    uint8_t *mine;           /* [chunk] it is measured here */
    bool bounds_are_mine;
};

/* ---- a sample's error */

static void load_source(const struct measure_levels *m, struct source *source, size_t tet)
{
    if (source->tet == tet)
        return;
    source->tet = tet;
    source->has_values = source->has_random = false;
    memcpy(source->corners, m->original->corners + 4 * tet, sizeof source->corners);
    for (int i = 0; i < 4; i++)
        source->hashes[i] = m->hashes[source->corners[i]];
    sample_sort(source->hashes, source->corners);
    for (int i = 0; i < 4; i++)
        memcpy(source->positions[i], m->original->positions + 3 * (size_t)source->corners[i],
               sizeof source->positions[i]);
}

/* The weights of its second sample. */
static const double *random_weights(struct source *source)
{
    if (!source->has_random)
        sample_weights_of_hashes(source->hashes, source->random);
    source->has_random = true;
    return source->random;
}

/* Where a sample is. Returns its weights at the corners of its source. */
static const double *find_point(const struct measure_levels *m, struct worker *worker, size_t sample, double p[3])
{
    static const double vertex[4] = {1, 0, 0, 0}, middle[4] = {0.25, 0.25, 0.25, 0.25};
    struct source *source = &worker->source;
    size_t n = m->original->vertex_count;
    if (sample < n) {
        memcpy(p, m->original->positions + 3 * sample, 3 * sizeof(double));
        return vertex;
    }
    load_source(m, source, (sample - n) / SAMPLES_PER_TET);
    const double *u = (sample - n) % SAMPLES_PER_TET ? random_weights(source) : middle;
    for (int d = 0; d < 3; d++)
        p[d] = u[0] * source->positions[0][d] + u[1] * source->positions[1][d] + u[2] * source->positions[2][d] +
               u[3] * source->positions[3][d];
    return u;
}

/* The original's values at a sample: own[i] at the first corner of its tetrahedron, own[width + i] what it is above
 * that. */
static void find_own(const struct measure_levels *m, struct worker *worker, size_t sample, const double u[4],
                     double *own)
{
    struct source *source = &worker->source;
    const double *values = source->values;
    const size_t n = m->width;
    if (sample < m->original->vertex_count) {
        for (size_t i = 0; i < n; i++) {
            own[i] = m->components[i].values[sample * m->components[i].stride];
            own[n + i] = 0;
        }
        return;
    }
    if (!source->has_values)
        walk_gather(m->components, n, source->corners, source->values);
    source->has_values = true;
    for (size_t i = 0; i < n; i++) {
        own[i] = values[i];
        own[n + i] = u[1] * values[n + i] + u[2] * values[2 * n + i] + u[3] * values[3 * n + i];
    }
}

/* The difference from the original, largest over components, for each field: `level` as walk_gather makes it. What is
 * above the first corner's values is combined: rounding is then about what varies, not about how far from zero it
 * does. */
static void file_error(struct measure_levels *m, size_t sample, const double *own, const double *level,
                       const double w[4])
{
    size_t n = m->width, i = 0;
    for (uint32_t f = 0; f < m->field_count; f++) {
        double worst = 0;
        for (size_t end = i + m->original->fields[f].components; i < end; i++) {
            double there = w[1] * level[n + i] + w[2] * level[2 * n + i] + w[3] * level[3 * n + i];
            worst = larger(worst, fabs((level[i] - own[i]) + (there - own[n + i])));
        }
        m->errors[f * m->samples + sample] = tally_keep(worst, m->scales[f]);
    }
}

static void stray(struct measure_levels *m, struct worker *worker, size_t sample)
{
    if (!ARRAY_RESERVE(worker->strays, worker->stray_capacity, worker->stray_count + 1))
        worker->failed = true;
    else
        worker->strays[worker->stray_count++] = (struct stray){sample, TETLOD_NONE, INFINITY};
    m->hosts[sample] = HOST_OUTSIDE;
}

/* Looks for a sample from a tetrahedron near by, and returns the one that holds it or, for want of that, that one. */
static uint32_t find_sample(struct measure_levels *m, struct worker *worker, size_t sample, const double p[3],
                            const double *own, uint32_t from)
{
    double weights[4];
    const struct walk_cell *cell = walk_to(&worker->walker, from, p, weights);
    if (!cell) {
        stray(m, worker, sample);
        return from;
    }
    m->hosts[sample] = cell->tet;
    file_error(m, sample, own, cell->values, weights);
    return cell->tet;
}

/* Where to begin to look for a sample whose error may have changed, or TETLOD_NONE: it is what it was. A vertex that
 * merged is looked for from where it merged into. */
static uint32_t begin_at(const struct measure_levels *m, size_t sample)
{
    const struct coarsening *mesh = m->mesh;
    uint32_t host = m->hosts[sample];
    if (host < HOST_SPECIAL)
        return coarsening_state_of(mesh, host) == COARSE_SAME ? TETLOD_NONE : coarsening_heir(mesh, host);
    if (host != HOST_VERTEX || mesh->slots[sample] == SLOT_ORIGINAL)
        return TETLOD_NONE;
    return mesh->tet_of[mesh->slots[sample] & SLOT_MERGED ? mesh->into[sample] : sample];
}

/* Where the finest level is not the original itself every sample is looked for once. */
static uint32_t begin_first(const struct measure_levels *m, size_t sample)
{
    size_t n = m->original->vertex_count;
    if (m->hosts[sample] == HOST_NONE || !m->displaced)
        return TETLOD_NONE;
    return sample < n ? m->mesh->tet_of[sample] : (uint32_t)((sample - n) / SAMPLES_PER_TET);
}

static void add_up(struct measure_levels *m, size_t chunk)
{
    size_t begin = chunk * TALLY_CHUNK, count = m->samples - begin < TALLY_CHUNK ? m->samples - begin : TALLY_CHUNK;
    for (uint32_t f = 0; f < m->field_count; f++)
        tally_add_up_kept(m->errors + f * m->samples + begin, count, m->scales[f], &m->tallies[f * m->chunks + chunk]);
}

/* Where only values are rounded the sample is where it was, whatever else lies at the same point. */
static void file_rounding(struct measure_levels *m, struct worker *worker, size_t sample)
{
    double p[3];
    const uint32_t vertex = (uint32_t)sample, alone[4] = {vertex, vertex, vertex, vertex};
    const double *own_weights = find_point(m, worker, sample, p);
    find_own(m, worker, sample, own_weights, worker->batch.own);
    walk_gather(worker->walker.components, m->width,
                sample < m->original->vertex_count ? alone : worker->source.corners, worker->values);
    file_error(m, sample, worker->batch.own, worker->values, own_weights);
}

/* Lists samples to be looked for, from `sample` on, until the batch is full; those that are where they were may have
 * another number there. Returns the first that it has not seen. */
static size_t list_batch(struct measure_levels *m, struct worker *worker, size_t sample, size_t end)
{
    struct batch *batch = &worker->batch;
    for (batch->count = 0; sample < end && batch->count < BATCH; sample++) {
        uint32_t begin = m->started ? begin_at(m, sample) : begin_first(m, sample);
        batch->samples[batch->count] = sample;
        batch->begins[batch->count] = begin;
        batch->count += begin != TETLOD_NONE;
        if (begin != TETLOD_NONE)
            walk_expect(&worker->walker, begin);
        else if (m->started && m->hosts[sample] < HOST_SPECIAL)
            m->hosts[sample] = coarsening_number(m->mesh, m->hosts[sample]);
    }
    return sample;
}

static void find_points(const struct measure_levels *m, struct worker *worker)
{
    struct batch *batch = &worker->batch;
    for (size_t i = 0; i < batch->count; i++) {
        walk_expect_corners(&worker->walker, batch->begins[i]);
        const double *own_weights = find_point(m, worker, batch->samples[i], batch->points[i]);
        find_own(m, worker, batch->samples[i], own_weights, batch->own + 2 * m->width * i);
    }
}

/* What held a sample and its predecessor holds them close together: the second is looked for where the first was
 * found. */
static void update_chunk(struct measure_levels *m, struct worker *worker, size_t chunk)
{
    struct batch *batch = &worker->batch;
    size_t end = (chunk + 1) * TALLY_CHUNK < m->samples ? (chunk + 1) * TALLY_CHUNK : m->samples;
    uint32_t last_begun = TETLOD_NONE, last_found = TETLOD_NONE;
    bool first_rounded = !m->started && m->rounded, any = first_rounded;
    for (size_t sample = chunk * TALLY_CHUNK; sample < end && first_rounded; sample++)
        if (m->hosts[sample] != HOST_NONE)
            file_rounding(m, worker, sample);
    for (size_t next = chunk * TALLY_CHUNK; next < end;) {
        next = list_batch(m, worker, next, end);
        find_points(m, worker);
        for (size_t i = 0; i < batch->count; i++) {
            uint32_t begin = batch->begins[i];
            last_found = find_sample(m, worker, batch->samples[i], batch->points[i], batch->own + 2 * m->width * i,
                                     begin == last_begun ? last_found : begin);
            last_begun = begin;
        }
        any |= batch->count > 0;
    }
    if (any)
        add_up(m, chunk);
}

static void update_samples(void *context, unsigned number, size_t begin, size_t end)
{
    struct measure_levels *m = context;
    for (size_t chunk = begin; chunk < end; chunk++)
        if (m->mine[chunk])
            update_chunk(m, &m->workers[number], chunk);
}

/* ---- samples that no walk found */

static enum tetlod_status need_surface(struct measure_levels *m, struct tetlod_error *error)
{
    const struct coarsening *mesh = m->mesh;
    if (m->surface.triangles)
        return TETLOD_OK;
    TETLOD_TRY(mesh_surface_init(&m->surface, mesh->positions, mesh->corners, mesh->neighbours, mesh->stored,
                                 mesh->states, COARSE_SAME, COARSE_CHANGED, error));
    m->surface.bodies = m->bodies;
    return TETLOD_OK;
}

static enum tetlod_status need_bodies(struct measure_levels *m, struct tetlod_error *error)
{
    const struct tetmesh *mesh = m->original;
    if (m->bodies)
        return TETLOD_OK;
    m->bodies = array_new(mesh->vertex_count, sizeof *m->bodies);
    if (!m->bodies)
        return tetlodi_fail_nomem(error, "the samples", mesh->vertex_count * sizeof *m->bodies);
    sheets_bodies(mesh->corners, mesh->tet_count, mesh->vertex_count, m->bodies);
    return TETLOD_OK;
}

static uint32_t body_of(const struct measure_levels *m, size_t sample)
{
    size_t n = m->original->vertex_count;
    return m->bodies[sample < n ? sample : m->original->corners[4 * ((sample - n) / SAMPLES_PER_TET)]];
}

static void find_stray(struct measure_levels *m, struct worker *worker, struct stray *stray)
{
    struct place closest;
    double p[3], start[3], weights[4];
    bool room;
    const double *own_weights = find_point(m, worker, stray->sample, p);
    stray->distance = mesh_surface_closest(&m->surface, body_of(m, stray->sample), p, &closest, &stray->face);
    if (stray->face == TETLOD_NONE) // it has no boundary at all: nothing is outside
        return;
    for (uint32_t d = 0; d < 3; d++)
        start[d] = place_value(m->mesh->positions, 3, d, &closest);
    const struct walk_cell *cell = walk_along(&worker->walker, stray->face / 4, start, p, weights, &room);
    worker->failed |= !room;
    find_own(m, worker, stray->sample, own_weights, worker->batch.own);
    if (cell) {
        m->hosts[stray->sample] = cell->tet;
        file_error(m, stray->sample, worker->batch.own, cell->values, weights);
        return;
    }
    walk_gather(worker->walker.components, m->width, closest.vertices, worker->values);
    file_error(m, stray->sample, worker->batch.own, worker->values, closest.weights);
}

static void find_strays(void *context, unsigned number, size_t begin, size_t end)
{
    struct measure_levels *m = context;
    for (size_t i = begin; i < end; i++)
        if (m->strays[i].face == TETLOD_NONE)
            find_stray(m, &m->workers[number], &m->strays[i]);
}

/* A sample stays outside, with its error, while the face that was closest is as it was and no face that changed is as
 * close: to come inside, the boundary would have to pass between. Of the others the face is forgotten. */
static void check_strays(void *context, unsigned number, size_t begin, size_t end)
{
    struct measure_levels *m = context;
    for (size_t i = begin; i < end; i++) {
        struct stray *stray = &m->strays[i];
        double p[3];
        uint32_t face;
        bool same = stray->face != TETLOD_NONE && coarsening_state_of(m->mesh, stray->face / 4) == COARSE_SAME;
        stray->face = same ? coarsening_heir_face(m->mesh, stray->face) : TETLOD_NONE;
        if (!same)
            continue;
        find_point(m, &m->workers[number], stray->sample, p);
        if (mesh_surface_distance(&m->changed, body_of(m, stray->sample), p, stray->distance,
                                  &face) <= stray->distance)
            stray->face = TETLOD_NONE;
    }
}

static enum tetlod_status need_changed(struct measure_levels *m, struct tetlod_error *error)
{
    const struct coarsening *mesh = m->mesh;
    TETLOD_TRY(mesh_surface_init(&m->changed, mesh->positions, mesh->corners, mesh->neighbours, mesh->stored,
                                 mesh->states, COARSE_CHANGED, COARSE_CHANGED, error));
    m->changed.bodies = m->bodies;
    return TETLOD_OK;
}

/* Keeps those that are outside, and adds up the chunks that strays are in. */
static void file_strays(struct measure_levels *m)
{
    size_t kept = 0;
    for (size_t i = 0; i < m->stray_count; i++) {
        size_t sample = m->strays[i].sample;
        m->dirty[sample / TALLY_CHUNK] = 1;
        if (m->hosts[sample] == HOST_OUTSIDE)
            m->strays[kept++] = m->strays[i];
    }
    m->stray_count = kept;
    for (size_t chunk = 0; chunk < m->chunks; chunk++)
        if (m->dirty[chunk])
            add_up(m, chunk);
}

/* Those that were outside before, and those that walks have lost. */
static enum tetlod_status update_strays(struct measure_levels *m, struct tetlod_error *error)
{
    bool any = false;
    for (unsigned i = 0; i < m->threads; i++) {
        struct worker *worker = &m->workers[i];
        if (worker->failed || !ARRAY_RESERVE(m->strays, m->stray_capacity, m->stray_count + worker->stray_count))
            return tetlodi_fail_nomem(error, "samples outside", m->stray_count * sizeof *m->strays);
        for (size_t k = 0; k < worker->stray_count; k++)
            m->strays[m->stray_count++] = worker->strays[k];
        worker->stray_count = 0;
    }
    if (!m->stray_count)
        return TETLOD_OK;
    TETLOD_TRY(need_bodies(m, error));
    TETLOD_TRY(need_changed(m, error));
    parallel_for(m->threads, m->stray_count, 64, check_strays, m);
    for (size_t i = 0; i < m->stray_count; i++)
        any |= m->strays[i].face == TETLOD_NONE;
    if (any)
        TETLOD_TRY(need_surface(m, error));
    parallel_for(m->threads, m->stray_count, 64, find_strays, m);
    file_strays(m);
    for (unsigned i = 0; i < m->threads; i++)
        if (m->workers[i].failed)
            return tetlodi_fail_nomem(error, "a line", 1024);
    return TETLOD_OK;
}

/* ---- domain error */

static double face_distance(const struct measure_levels *m, const double p[3], uint32_t face)
{
    const uint32_t *corners = m->mesh->corners + (face & ~(size_t)3);
    const double *q[3];
    double weights[3];
    for (int i = 0; i < 3; i++)
        q[i] = m->mesh->positions + 3 * (size_t)corners[tet_faces[face & 3][i]];
    return sqrt(triangle_distance2(p, q[0], q[1], q[2], weights));
}

/* The original's boundary vertex by the face that was near; INFINITY if that does not do. */
static void guess_distances(void *context, unsigned worker, size_t begin, size_t end)
{
    struct measure_levels *m = context;
    (void)worker;
    for (size_t i = begin; i < end; i++) {
        uint32_t v = m->bound[i], face = m->nearest[i];
        m->distances[i] = 0;
        if (!m->displaced && m->mesh->slots[v] == SLOT_ORIGINAL)
            continue;
        bool same = face != TETLOD_NONE && coarsening_state_of(m->mesh, face / 4) == COARSE_SAME;
        m->nearest[i] = face = face == TETLOD_NONE ? face : coarsening_heir_face(m->mesh, face);
        if (same)
            continue; // or what it was at the last level
        const double *p = m->original->positions + 3 * (size_t)v;
        m->distances[i] = face == TETLOD_NONE ? INFINITY : face_distance(m, p, face);
    }
}

static void search_distances(void *context, unsigned worker, size_t begin, size_t end)
{
    struct measure_levels *m = context;
    (void)worker;
    for (size_t i = begin; i < end; i++)
        if (!(m->distances[i] <= m->enough))
            m->distances[i] =
                mesh_surface_distance(&m->surface, m->bodies[m->bound[i]],
                                      m->original->positions + 3 * (size_t)m->bound[i], m->enough, &m->nearest[i]);
}

static void made_distances(void *context, unsigned worker, size_t begin, size_t end)
{
    struct measure_levels *m = context;
    uint32_t face;
    (void)worker;
    for (size_t i = begin; i < end; i++)
        m->distances[i] = mesh_surface_distance(&m->boundary, m->bodies[m->list[i]],
                                                m->mesh->positions + 3 * (size_t)m->list[i], m->enough, &face);
}

/* While the mesh is at its finest. */
static enum tetlod_status list_boundary(struct measure_levels *m, struct tetlod_error *error)
{
    const struct mesh_surface *boundary = &m->boundary;
    TETLOD_TRY(coarsening_need_neighbours(m->mesh, error));
    TETLOD_TRY(mesh_surface_init(&m->boundary, m->original->positions, m->original->corners, m->mesh->neighbours,
                            m->original->tet_count, NULL, 0, 0, error));
    m->boundary.bodies = m->bodies;
    for (size_t i = 0; i < 3 * (size_t)boundary->count; i++)
        m->made[boundary->triangles[i]] = 1;
    for (uint32_t v = 0; v < m->original->vertex_count; v++)
        m->bound_count += m->made[v];
    m->bound = array_new(m->bound_count, sizeof *m->bound);
    m->nearest = array_new(m->bound_count, sizeof *m->nearest);
    if (!m->bound || !m->nearest)
        return tetlodi_fail_nomem(error, "the boundary", 8 * (uint64_t)m->bound_count);
    m->bound_count = 0;
    for (uint32_t v = 0; v < m->original->vertex_count; v++)
        if (m->made[v]) {
            m->nearest[m->bound_count] = TETLOD_NONE;
            m->bound[m->bound_count++] = v;
        }
    return TETLOD_OK;
}

/* The vertices of the level's boundary that the last step made or moved; at first all where it is displaced, else
 * none. */
static enum tetlod_status list_made(struct measure_levels *m, struct tetlod_error *error)
{
    const struct coarsening *mesh = m->mesh;
    enum { MADE = 1, LISTED = 2 };
    if (!m->started)
        memset(m->made, m->displaced ? MADE : 0, mesh->slot_count);
    for (uint32_t i = 0; i < mesh->touched_count && m->started; i++)
        m->made[mesh->touched[i]] = MADE;
    m->list_count = 0;
    for (size_t s = 0; s < 4 * (size_t)mesh->stored && (m->started || m->displaced); s++) {
        if (mesh->states[s / 4] != (m->started ? COARSE_CHANGED : COARSE_SAME) || mesh->neighbours[s] != TETLOD_NONE)
            continue;
        if (!ARRAY_RESERVE(m->list, m->list_capacity, m->list_count + 3))
            return tetlodi_fail_nomem(error, "the boundary", m->list_count * sizeof *m->list);
        for (int i = 0; i < 3; i++) {
            uint32_t v = mesh->corners[(s & ~(size_t)3) + tet_faces[s & 3][i]];
            if (m->made[v] == MADE)
                m->list[m->list_count++] = v;
            m->made[v] = m->made[v] == MADE ? LISTED : m->made[v];
        }
    }
    for (uint32_t i = 0; i < mesh->touched_count; i++)
        m->made[mesh->touched[i]] = 0;
    return TETLOD_OK;
}

static double largest(const double *distances, size_t count, double most)
{
    for (size_t i = 0; i < count; i++)
        most = larger(most, distances[i]);
    return most;
}

static enum tetlod_status update_domain(struct measure_levels *m, double *io_domain, struct tetlod_error *error)
{
    double most = larger(*io_domain, m->domain);
    bool any = false;
    if (!m->bounds_are_mine)
        return TETLOD_OK;
    TETLOD_TRY(need_bodies(m, error));
    if (!m->started)
        TETLOD_TRY(list_boundary(m, error));
    TETLOD_TRY(list_made(m, error));
    size_t needed = m->list_count > m->bound_count ? m->list_count : m->bound_count;
    if (!ARRAY_RESERVE(m->distances, m->distance_capacity, needed))
        return tetlodi_fail_nomem(error, "distances", needed * sizeof *m->distances);
    m->enough = larger(most, m->rounding);
    parallel_for(m->threads, m->bound_count, 1024, guess_distances, m);
    for (size_t i = 0; i < m->bound_count; i++)
        any |= !(m->distances[i] <= m->enough);
    if (any) {
        TETLOD_TRY(need_surface(m, error));
        parallel_for(m->threads, m->bound_count, 256, search_distances, m);
    }
    most = largest(m->distances, m->bound_count, most);
    m->enough = larger(most, m->rounding);
    parallel_for(m->threads, m->list_count, 256, made_distances, m);
    *io_domain = m->domain = largest(m->distances, m->list_count, most);
    return TETLOD_OK;
}

/* ---- the beginning */

/* A tetrahedron's samples, and its corners, which are samples as well, as far as they are measured here. */
static void place_tet(struct measure_levels *m, size_t tet, size_t vertices)
{
    const size_t first = m->original->vertex_count + SAMPLES_PER_TET * tet;
    bool counts = !sample_tet_is_degenerate(m->original, tet);
    for (size_t sample = first; sample < first + SAMPLES_PER_TET; sample++)
        if (m->mine[sample / TALLY_CHUNK])
            m->hosts[sample] = counts ? (uint32_t)tet : HOST_NONE;
    for (size_t i = 4 * tet; i < 4 * tet + 4 && counts && vertices; i++)
        m->hosts[m->original->corners[i]] = HOST_VERTEX;
    m->counted += counts ? SAMPLES_PER_TET : 0;
}

/* Which samples count, and where they are at first. How many that are is known who looks at all of them. */
static void place_samples(struct measure_levels *m)
{
    const struct tetmesh *mesh = m->original;
    const size_t n = mesh->vertex_count;
    size_t vertices = m->bounds_are_mine ? n : 0;
    for (size_t v = 0; v < n; v += TALLY_CHUNK)
        vertices = m->mine[v / TALLY_CHUNK] ? n : vertices;
    for (size_t v = 0; v < n; v++)
        m->hashes[v] = sample_hash(mesh->positions + 3 * v);
    for (size_t v = 0; v < vertices; v++)
        m->hosts[v] = HOST_NONE;
    for (size_t t = 0; t < mesh->tet_count; t++) {
        const size_t first = n + SAMPLES_PER_TET * t, last = first + SAMPLES_PER_TET - 1;
        if (vertices || m->mine[first / TALLY_CHUNK] || m->mine[last / TALLY_CHUNK])
            place_tet(m, t, vertices);
    }
    for (size_t v = 0; v < vertices; v++)
        m->counted += m->hosts[v] == HOST_VERTEX;
}

/* ---- the whole */

enum tetlod_status measure_levels_next(struct measure_levels *m, struct measured *out, double *io_domain,
                                       struct tetlod_error *error)
{
    enum tetlod_status status = TETLOD_OK;
    if (!m->started)
        place_samples(m);
    if (m->displaced)
        TETLOD_TRY(coarsening_need_neighbours(m->mesh, error));
    for (unsigned i = 0; i < m->threads; i++)
        walker_reset(&m->workers[i].walker);
    parallel_for(m->threads, m->chunks, 1, update_samples, m);
    TETLOD_TRY_DONE(update_strays(m, error));
    measure_levels_result(m, out);
    TETLOD_TRY_DONE(update_domain(m, io_domain, error));
    m->started = true;
done:
    mesh_surface_fini(&m->surface);
    mesh_surface_fini(&m->changed);
    return status;
}

static bool is_displaced(const struct tetmesh *original, const struct coarsening *mesh)
{
    return memcmp(original->positions, mesh->positions, original->vertex_count * 3 * sizeof(double)) != 0;
}

static bool is_rounded(const struct tetmesh *original, const struct coarsening *mesh)
{
    bool same = true;
    for (uint32_t f = 0; f < original->field_count && same; f++)
        same = memcmp(original->fields[f].values, mesh->fields[f].values,
                      (size_t)original->vertex_count * original->fields[f].components * sizeof(double)) == 0;
    return !same;
}

static enum tetlod_status make_workers(struct measure_levels *m, struct tetlod_error *error)
{
    for (uint32_t f = 0; f < m->field_count; f++)
        m->width += m->original->fields[f].components;
    size_t values = 4 * m->width, at = 0;
    m->components = array_new(m->width, sizeof *m->components);
    for (uint32_t f = 0; f < m->field_count && m->components; f++)
        for (uint32_t k = 0; k < m->original->fields[f].components; k++)
            m->components[at++] = (struct walk_component){m->original->fields[f].values + k,
                                                          m->original->fields[f].components};
    m->workers = array_zero(m->threads, sizeof *m->workers);
    for (unsigned i = 0; i < m->threads && m->workers; i++) {
        struct worker *worker = &m->workers[i];
        worker->values = array_new(values, sizeof(double));
        worker->source = (struct source){.tet = NO_TET, .values = array_new(values, sizeof(double))};
        worker->batch.own = array_new(BATCH, 2 * m->width * sizeof(double));
        if (!m->components || !worker->values || !worker->source.values || !worker->batch.own)
            return tetlodi_fail_nomem(error, "the values", values * sizeof(double));
        TETLOD_TRY(walker_init(&worker->walker, m->mesh, error));
    }
    return m->workers ? TETLOD_OK : tetlodi_fail_nomem(error, "the threads", m->threads * sizeof *m->workers);
}

/* A local bound may be 0 at the finest level, and then be as large as the range of the field that it bounds. */
static void set_scales(struct measure_levels *m)
{
    const uint32_t vertices = m->original->vertex_count;
    double least = INFINITY;
    for (uint32_t f = 0; f < m->field_count; f++) {
        struct point_field level = {.components = m->mesh->fields[f].components, .values = m->mesh->fields[f].values};
        double ranges[2][2];
        point_field_range(&m->original->fields[f], vertices, ranges[0]);
        point_field_range(&level, vertices, ranges[1]);
        bool zero = ranges[0][0] == 0 && ranges[0][1] == 0 && ranges[1][0] == 0 && ranges[1][1] == 0;
        m->scales[f] = zero ? INFINITY : tally_scale(ranges[0], ranges[1]);
        least = smaller(least, m->scales[f]);
    }
    for (uint32_t f = 0; f < m->field_count; f++)
        m->scales[f] = m->scales[f] < INFINITY ? m->scales[f] : least < INFINITY ? least : 1;
}

enum tetlod_status measure_levels_new(struct measure_levels **out, const struct tetmesh *original,
                                      struct coarsening *coarsening, unsigned threads, struct tetlod_error *error)
{
    size_t samples = sample_count(original), chunks = tally_chunks(samples), fields = original->field_count;
    struct measure_levels *m = array_zero(1, sizeof *m);
    enum tetlod_status status = TETLOD_OK;
    *out = NULL;
    if (!m)
        return tetlodi_fail_nomem(error, "the samples", sizeof *m);
    threads = threads < 1 ? 1 : threads > PARALLEL_MAX_THREADS ? PARALLEL_MAX_THREADS : threads;
    *m = (struct measure_levels){.original = original,
                                 .mesh = coarsening,
                                 .threads = threads,
                                 .field_count = original->field_count,
                                 .hosts = array_new(samples, sizeof(uint32_t)),
                                 .errors = array_zero(samples * fields, sizeof(float)),
                                 .hashes = array_new(original->vertex_count, sizeof(uint64_t)),
                                 .scales = array_new(fields, sizeof(double)),
                                 .samples = samples,
                                 .chunks = chunks,
                                 .tallies = array_zero(chunks * fields, sizeof(struct tally)),
                                 .dirty = array_new(chunks, 1),
                                 .mine = array_new(chunks, 1),
                                 .made = array_zero(original->vertex_count, 1),
                                 .rounding = 1e-14 * mesh_diagonal(original),
                                 .displaced = is_displaced(original, coarsening)};
    m->bounds_are_mine = true;
    m->rounded = !m->displaced && is_rounded(original, coarsening);
    if (!m->hosts || !m->errors || !m->hashes || !m->scales || !m->tallies || !m->dirty || !m->mine || !m->made)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the samples", measure_levels_bytes(original)));
    set_scales(m);
    memset(m->mine, true, chunks);
    TETLOD_TRY_DONE(make_workers(m, error));
    *out = m;
done:
    if (status != TETLOD_OK)
        measure_levels_free(m);
    return status;
}

/* ---- parts */

enum tetlod_status measure_levels_pack_sums(const struct measure_levels *m, struct buffer *out)
{
    TETLOD_TRY(buffer_append(out, &m->counted, sizeof m->counted));
    return buffer_append(out, m->scales, m->field_count * sizeof *m->scales);
}

enum tetlod_status measure_levels_of_sums(struct measure_levels **out, const struct tetmesh *original,
                                          const unsigned char *bytes, struct tetlod_error *error)
{
    const size_t samples = sample_count(original), chunks = tally_chunks(samples), fields = original->field_count;
    struct measure_levels *m = *out = array_zero(1, sizeof *m);
    if (m)
        *m = (struct measure_levels){.field_count = original->field_count, .samples = samples, .chunks = chunks,
                                     .scales = array_new(fields, sizeof(double)),
                                     .tallies = array_zero(chunks * fields, sizeof(struct tally))};
    if (!m || !m->scales || !m->tallies)
        return tetlodi_fail_nomem(error, "the samples", chunks * fields * sizeof(struct tally));
    memcpy(&m->counted, bytes, sizeof m->counted);
    memcpy(m->scales, bytes + sizeof m->counted, fields * sizeof *m->scales);
    return TETLOD_OK;
}

void measure_levels_restrict(struct measure_levels *m, const bool mine[MEASURE_PARTS], bool bounds)
{
    for (size_t chunk = 0; chunk < m->chunks; chunk++)
        m->mine[chunk] = mine[chunk * MEASURE_PARTS / m->chunks];
    m->bounds_are_mine = bounds;
}

/* The first chunk of a part. */
static size_t part_begin(const struct measure_levels *m, uint32_t part)
{
    return (part * m->chunks + MEASURE_PARTS - 1) / MEASURE_PARTS;
}

size_t measure_levels_part_size(const struct measure_levels *m, uint32_t part)
{
    return (part_begin(m, part + 1) - part_begin(m, part)) * m->field_count * sizeof *m->tallies;
}

enum tetlod_status measure_levels_pack(const struct measure_levels *m, uint32_t part, struct buffer *out)
{
    size_t begin = part_begin(m, part), size = (part_begin(m, part + 1) - begin) * sizeof *m->tallies;
    enum tetlod_status status = TETLOD_OK;
    for (uint32_t f = 0; f < m->field_count && size && status == TETLOD_OK; f++)
        status = buffer_append(out, m->tallies + f * m->chunks + begin, size);
    return status;
}

void measure_levels_unpack(struct measure_levels *m, uint32_t part, const unsigned char *bytes)
{
    size_t begin = part_begin(m, part), size = (part_begin(m, part + 1) - begin) * sizeof *m->tallies;
    for (uint32_t f = 0; f < m->field_count && size; f++, bytes += size)
        memcpy(m->tallies + f * m->chunks + begin, bytes, size);
}

void measure_levels_result(const struct measure_levels *m, struct measured *out)
{
    for (uint32_t f = 0; f < m->field_count; f++)
        tally_result(m->tallies + f * m->chunks, m->chunks, m->scales[f], m->counted, &out[f].sampled, &out[f].rms);
}

bool measure_levels_sample(const struct measure_levels *m, size_t sample, double *out)
{
    for (uint32_t f = 0; f < m->field_count; f++)
        out[f] = (double)m->errors[f * m->samples + sample] / m->scales[f];
    return m->hosts[sample] != HOST_OUTSIDE;
}

void measure_levels_free(struct measure_levels *m)
{
    if (!m)
        return;
    for (unsigned i = 0; i < m->threads && m->workers; i++) {
        walker_fini(&m->workers[i].walker);
        free(m->workers[i].values);
        free(m->workers[i].source.values);
        free(m->workers[i].batch.own);
        free(m->workers[i].strays);
    }
    mesh_surface_fini(&m->boundary);
    mesh_surface_fini(&m->surface);
    void *const owned[] = {m->components, m->bodies, m->hosts, m->errors, m->hashes, m->scales, m->tallies, m->workers,
                           m->strays, m->dirty, m->mine, m->bound, m->nearest, m->distances, m->made, m->list, m};
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
}

uint64_t measure_levels_bytes(const struct tetmesh *original)
{
    return sample_count(original) * (uint64_t)(4 + 4 * original->field_count) + original->vertex_count * UINT64_C(13);
}
