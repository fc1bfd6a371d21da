/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/make_summary.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/ask/clip.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

static double volume_of(const struct tetmesh *mesh, uint32_t tet)
{
    const double *p[4];
    for (int c = 0; c < 4; c++)
        p[c] = mesh->positions + 3 * (size_t)mesh->corners[4 * (size_t)tet + (size_t)c];
    return fabs(tet_volume6(p[0], p[1], p[2], p[3])) / 6;
}

/* The integral of a linear function is the volume times the mean of its corners; of its square, (sum of squares +
 * square of the sum) / 20. */
static void add_sums(const struct tetmesh *mesh, const struct point_field *field, uint32_t component, double out[2])
{
    long double sums[2] = {0};
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        double volume = volume_of(mesh, t), sum = 0, squares = 0;
        for (int c = 0; c < 4; c++) {
            double value = field->values[(size_t)field->components * mesh->corners[4 * (size_t)t + (size_t)c] +
                                         component];
            sum += value;
            squares += value * value;
        }
        sums[0] += volume * sum / 4;
        sums[1] += volume * (squares + sum * sum) / 20;
    }
    out[0] = (double)sums[0];
    out[1] = (double)sums[1];
}

/* The boundary while it is contracted: faces by the slots of their corners. A slot is an original vertex, or the node
 * that was made of it. */
struct boundary {
    double *positions;  /* [3 * slot] */
    uint32_t *into;     /* [slot] that it merged into, itself if it is there */
    uint32_t *heads;    /* [slot] first entry of its list, 3 * face + corner, or TETLOD_NONE */
    uint32_t *ends;     /* [slot] the last one */
    uint32_t *next;     /* [3 * face + corner] */
    uint32_t *faces;    /* [3 * face] slots */
    uint32_t *counted;  /* [face] 1 + the last contraction that counted it */
    uint32_t face_count;
};

static void boundary_fini(struct boundary *boundary)
{
    free(boundary->positions);
    free(boundary->into);
    free(boundary->heads);
    free(boundary->ends);
    free(boundary->next);
    free(boundary->faces);
    free(boundary->counted);
}

static void add_face(struct boundary *boundary, const uint32_t corners[4], unsigned opposite)
{
    uint32_t face = boundary->face_count++;
    for (unsigned c = 0, i = 0; c < 4; c++) {
        if (c == opposite)
            continue;
        uint32_t entry = 3 * face + i++, slot = corners[c];
        boundary->faces[entry] = slot;
        boundary->next[entry] = boundary->heads[slot];
        if (boundary->heads[slot] == TETLOD_NONE)
            boundary->ends[slot] = entry;
        boundary->heads[slot] = entry;
    }
}

static enum tetlod_status boundary_init(struct boundary *boundary, const struct tetmesh *mesh,
                                        struct tetlod_error *error)
{
    size_t vertices = mesh->vertex_count, tets = mesh->tet_count, faces = 0;
    uint32_t *neighbours = array_new(4 * tets, sizeof *neighbours);
    if (!neighbours)
        return tetlodi_fail_nomem(error, "the boundary", 4 * tets * sizeof *neighbours);
    enum tetlod_status status = adjacency_build(mesh->corners, mesh->tet_count, mesh->vertex_count, neighbours, NULL,
                                                error);
    for (size_t i = 0; i < 4 * tets && status == TETLOD_OK; i++)
        faces += neighbours[i] == TETLOD_NONE;
    *boundary = (struct boundary){array_new(3 * vertices, sizeof(double)),     array_new(vertices, sizeof(uint32_t)),
                                  array_new(vertices, sizeof(uint32_t)),       array_new(vertices, sizeof(uint32_t)),
                                  array_new(3 * faces, sizeof(uint32_t)),      array_new(3 * faces, sizeof(uint32_t)),
                                  array_zero(faces, sizeof(uint32_t)),         0};
    if (status == TETLOD_OK && !(boundary->positions && boundary->into && boundary->heads && boundary->ends &&
                                 boundary->next && boundary->faces && boundary->counted))
        status = tetlodi_fail_nomem(error, "the boundary", 40 * vertices + 28 * faces);
    if (status == TETLOD_OK) {
        memcpy(boundary->positions, mesh->positions, 3 * vertices * sizeof *boundary->positions);
        for (uint32_t v = 0; v < vertices; v++) {
            boundary->into[v] = v;
            boundary->heads[v] = boundary->ends[v] = TETLOD_NONE;
        }
        for (size_t i = 0; i < 4 * tets; i++)
            if (neighbours[i] == TETLOD_NONE)
                add_face(boundary, mesh->corners + i / 4 * 4, i % 4);
    }
    free(neighbours);
    return status;
}

static uint32_t slot_of(const struct boundary *boundary, uint32_t slot)
{
    while (boundary->into[slot] != slot)
        slot = boundary->into[slot] = boundary->into[boundary->into[slot]];
    return slot;
}

/* The cones from `apex` over the faces at a vertex that moves there: what lies between the old patch of the boundary
 * and the new one is in them (PROOF.md, 12). Faces that have collapsed leave the list. */
static double swept_at(struct boundary *boundary, uint32_t slot, const double apex[3], uint32_t contraction)
{
    double swept = 0;
    uint32_t last = TETLOD_NONE;
    for (uint32_t entry = boundary->heads[slot], next; entry != TETLOD_NONE; entry = next) {
        uint32_t *corners = boundary->faces + entry / 3 * 3;
        next = boundary->next[entry];
        for (int c = 0; c < 3; c++)
            corners[c] = slot_of(boundary, corners[c]);
        if (corners[0] == corners[1] || corners[1] == corners[2] || corners[0] == corners[2]) {
            *(last == TETLOD_NONE ? &boundary->heads[slot] : &boundary->next[last]) = next;
            continue;
        }
        last = entry;
        if (boundary->counted[entry / 3] == contraction + 1)
            continue;
        boundary->counted[entry / 3] = contraction + 1;
        swept += fabs(tet_volume6(apex, boundary->positions + 3 * (size_t)corners[0],
                                  boundary->positions + 3 * (size_t)corners[1],
                                  boundary->positions + 3 * (size_t)corners[2])) / 6;
    }
    boundary->ends[slot] = last;
    return swept;
}

static void merge(struct boundary *boundary, uint32_t slot, uint32_t into)
{
    boundary->into[slot] = into;
    if (boundary->heads[slot] == TETLOD_NONE)
        return;
    if (boundary->heads[into] == TETLOD_NONE)
        boundary->heads[into] = boundary->heads[slot];
    else
        boundary->next[boundary->ends[into]] = boundary->heads[slot];
    boundary->ends[into] = boundary->ends[slot];
}

/* `nodes` has the slot of each node that a contraction made. */
static double contract(struct boundary *boundary, const struct contraction_log *log, uint32_t contraction,
                       uint32_t *nodes)
{
    const double *apex = log->positions + 3 * (size_t)contraction;
    uint32_t slots[4];
    double swept = 0;
    unsigned count = 0;
    for (; count < 4 && log->children[4 * (size_t)contraction + count] != TETLOD_NONE; count++) {
        uint32_t child = log->children[4 * (size_t)contraction + count];
        slots[count] = child < log->vertex_count ? child : nodes[child - log->vertex_count];
        if (memcmp(boundary->positions + 3 * (size_t)slots[count], apex, 3 * sizeof *apex) != 0)
            swept += swept_at(boundary, slots[count], apex, contraction);
    }
    for (unsigned i = 1; i < count; i++)
        merge(boundary, slots[i], slots[0]);
    memcpy(boundary->positions + 3 * (size_t)slots[0], apex, 3 * sizeof *apex);
    nodes[contraction] = slots[0];
    return swept;
}

/* A float that is not less. */
static float rounded_up(double value)
{
    float out = (float)value;
    return out < value ? nextafterf(out, INFINITY) : out;
}

static enum tetlod_status add_swept(struct tetlodi_summary *out, const struct tetmesh *mesh,
                                    const struct contraction_log *log,
                                    struct tetlod_error *error)
{
    struct boundary boundary = {0};
    uint32_t *nodes = array_new(log->count, sizeof *nodes), done = 0;
    enum tetlod_status status = nodes ? TETLOD_OK : tetlodi_fail_nomem(error, "the nodes", log->count * sizeof *nodes);
    if (status == TETLOD_OK)
        status = boundary_init(&boundary, mesh, error);
    double swept = 0;
    for (uint32_t m = 0; m < log->mark_count && status == TETLOD_OK; m++) {
        for (; done < log->marks[m].contractions; done++)
            swept += contract(&boundary, log, done, nodes);
        out->swept[log->mark_count - 1 - m] = rounded_up(swept * (1 + 1e-9));
    }
    boundary_fini(&boundary);
    free(nodes);
    return status;
}

static void find_places(const struct tetmesh *mesh, const struct point_field *field, uint32_t component,
                        double out[2][3])
{
    uint32_t at[2] = {0, 0};
    for (uint32_t v = 1; v < mesh->vertex_count; v++) {
        double value = field->values[(size_t)field->components * v + component];
        at[0] = value < field->values[(size_t)field->components * at[0] + component] ? v : at[0];
        at[1] = value > field->values[(size_t)field->components * at[1] + component] ? v : at[1];
    }
    for (int i = 0; i < 2; i++)
        memcpy(out[i], mesh->positions + 3 * (size_t)at[i], sizeof out[i]);
}

enum tetlod_status summary_of_mesh(struct tetlodi_summary *out, const struct tetmesh *mesh, uint32_t levels,
                                   uint32_t thresholds, struct tetlod_error *error)
{
    uint32_t components = 0, at = 0;
    long double volume = 0;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        components += mesh->fields[f].components;
    if (!tetlodi_summary_allocate(out, levels, components, thresholds)) {
        tetlodi_summary_fini(out);
        return tetlodi_fail_nomem(error, "the sums of the fields", 16 * (uint64_t)components + 4 * (uint64_t)levels);
    }
    for (uint32_t t = 0; t < mesh->tet_count; t++)
        volume += volume_of(mesh, t);
    out->volume = (double)volume;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        for (uint32_t c = 0; c < mesh->fields[f].components; c++, at++) {
            add_sums(mesh, &mesh->fields[f], c, out->sums[at]);
            find_places(mesh, &mesh->fields[f], c, out->places[at]);
        }
    return TETLOD_OK;
}

/* ---- distributions */

/* Values in rising order. `sums` has, of each threshold, the volume that is above the threshold before and not above
 * this one, of whole tetrahedra, and then the volume of parts. */
static void add_volumes(const double (*below)[2], uint32_t count, const double values[4], double volume,
                        long double (*sums)[2])
{
    uint32_t first = 0, end = count;
    while (first < end) { // the first threshold that is not below the least value
        uint32_t middle = first + (end - first) / 2;
        if (below[middle][0] < values[0])
            first = middle + 1;
        else
            end = middle;
    }
    for (; first < count && below[first][0] < values[3]; first++)
        sums[first][1] += volume * clip_share_below(values, below[first][0]);
    if (first < count)
        sums[first][0] += volume;
}

static void fill_component(const struct tetmesh *mesh, const struct point_field *field, uint32_t component,
                           double (*below)[2], uint32_t count, long double (*sums)[2])
{
    long double whole = 0;
    memset(sums, 0, count * sizeof *sums);
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        double values[4];
        for (int c = 0; c < 4; c++)
            values[c] = field->values[(size_t)field->components * mesh->corners[4 * (size_t)t + (size_t)c] + component];
        clip_sort(values);
        add_volumes((const double(*)[2])below, count, values, volume_of(mesh, t), sums);
    }
    for (uint32_t k = 0; k < count; k++) {
        whole += sums[k][0];
        below[k][1] = fmax((double)(whole + sums[k][1]), k ? below[k - 1][1] : 0);
    }
}

enum tetlod_status summary_fill_volumes(struct tetlodi_summary *out, const struct tetmesh *mesh,
                                        struct tetlod_error *error)
{
    uint32_t count = out->threshold_count, at = 0;
    long double (*sums)[2] = array_new(count, sizeof *sums);
    if (!sums)
        return tetlodi_fail_nomem(error, "the distributions", count * sizeof *sums);
    for (uint32_t f = 0; f < mesh->field_count; f++)
        for (uint32_t c = 0; c < mesh->fields[f].components; c++, at++)
            fill_component(mesh, &mesh->fields[f], c, out->below + (size_t)at * count, count, sums);
    free(sums);
    return TETLOD_OK;
}

struct weighed {
    double value, volume;
};

static int compare_weighed(const void *a, const void *b)
{
    double one = ((const struct weighed *)a)->value, other = ((const struct weighed *)b)->value;
    return (one > other) - (one < other);
}

/* Thresholds with about as much volume between any two: a vertex stands for a quarter of its tetrahedra. */
static void choose_thresholds(const struct tetmesh *mesh, const struct point_field *field, uint32_t component,
                              struct weighed *weighed, double (*below)[2], uint32_t count)
{
    double sum = 0, whole = 0;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        weighed[v] = (struct weighed){field->values[(size_t)field->components * v + component], 0};
    for (size_t i = 0; i < 4 * (size_t)mesh->tet_count; i++)
        weighed[mesh->corners[i]].volume += volume_of(mesh, (uint32_t)(i / 4)) / 4;
    qsort(weighed, mesh->vertex_count, sizeof *weighed, compare_weighed);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        whole += weighed[v].volume;
    for (uint32_t v = 0, k = 0; v < mesh->vertex_count && k < count; v++) {
        sum += weighed[v].volume;
        while (k < count && (v + 1 == mesh->vertex_count || sum * (count + 1) >= whole * (k + 1)))
            below[k++][0] = weighed[v].value;
    }
}

/* Moves thresholds to where the distribution, taken as straight between them, has as much volume between any two. */
static void space_evenly(double (*below)[2], uint32_t count, double volume, struct weighed *old)
{
    for (uint32_t k = 0; k < count; k++)
        old[k] = (struct weighed){below[k][0], below[k][1]};
    for (uint32_t k = 0, at = 0; k < count; k++) {
        double wanted = volume * (k + 1) / (count + 1);
        while (at + 1 < count && old[at].volume < wanted)
            at++;
        double rise = at ? old[at].volume - old[at - 1].volume : 0;
        if (rise > 0 && old[at].volume > wanted)
            below[k][0] = old[at].value - (old[at].value - old[at - 1].value) * ((old[at].volume - wanted) / rise);
        else
            below[k][0] = old[at].value;
        below[k][0] = fmax(below[k][0], k ? below[k - 1][0] : old[0].value);
    }
}

static enum tetlod_status add_distributions(struct tetlodi_summary *out, const struct tetmesh *mesh,
                                            struct tetlod_error *error)
{
    enum { PASSES = 3 };
    uint32_t count = out->threshold_count, at = 0;
    struct weighed *weighed = array_new(mesh->vertex_count + (size_t)count, sizeof *weighed);
    enum tetlod_status status = TETLOD_OK;
    if (!weighed)
        return tetlodi_fail_nomem(error, "the distributions", mesh->vertex_count * sizeof *weighed);
    for (uint32_t f = 0; f < mesh->field_count; f++)
        for (uint32_t c = 0; c < mesh->fields[f].components; c++, at++)
            choose_thresholds(mesh, &mesh->fields[f], c, weighed, out->below + (size_t)at * count, count);
    for (int pass = 0; pass < PASSES && status == TETLOD_OK; pass++) {
        for (uint32_t c = 0; c < at && pass; c++)
            space_evenly(out->below + (size_t)c * count, count, out->volume, weighed);
        status = summary_fill_volumes(out, mesh, error);
    }
    free(weighed);
    return status;
}

/* As many as keep a field within 5 kB, and all fields together within what a small stream may carry. */
static uint32_t thresholds_for(const struct tetmesh *mesh)
{
    enum { MIN_COUNT = 8, MAX_COUNT = 48, FIELD_BYTES = 5000, COMPONENT_BYTES = 64, ROW = 16 };
    uint32_t most = 1;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        most = mesh->fields[f].components > most ? mesh->fields[f].components : most;
    int count = (FIELD_BYTES / (int)most - COMPONENT_BYTES) / ROW;
    return (uint32_t)(count > MAX_COUNT ? MAX_COUNT : count < MIN_COUNT ? MIN_COUNT : count);
}

enum tetlod_status summary_make(struct tetlodi_summary *out, const struct tetmesh *original,
                                const struct tetmesh *contracted,
                                const struct contraction_log *log, uint32_t levels, struct tetlod_error *error)
{
    TETLOD_TRY(summary_of_mesh(out, original, levels, thresholds_for(original), error));
    size_t size = 3 * (size_t)original->vertex_count * sizeof *original->positions;
    enum tetlod_status status = add_distributions(out, original, error);
    if (status == TETLOD_OK && memcmp(original->positions, contracted->positions, size) == 0)
        status = add_swept(out, contracted, log, error);
    else
        for (uint32_t l = 0; l < levels; l++)
            out->swept[l] = INFINITY;
    if (status != TETLOD_OK)
        tetlodi_summary_fini(out);
    return status;
}
