/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * usage: proof FIRST COUNT
 *
 * The certificate itself under attack, before anything is measured: seeds FIRST .. FIRST + COUNT - 1 make a mesh
 * (shapes.h) and options, simplify() contracts it, and at marks of the log the oracle says what is true. A line for
 * each finding; exit status 1 if there is one. What must hold at every mark:
 *   max         the difference at every point of the domain, or at a partner within the distance that the boundary
 * moved, is within what is certified partner     so it is for the original's vertices that are outside the level
 *   distance    the boundary has moved by no more than that
 *   mesh        no tetrahedron flips, the topology stays
 * This is what mutants of the proof are held against (tests/mutants): files, streams and measuring would only hide
 * them.
 */
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "src/log/coarsening.h"
#include "src/measure/measure.h"
#include "src/simplify/simplify.h"
#include "tests/attack/oracle.h"
#include "tests/attack/shapes.h"

enum { MAX_MARKS = 3, MAX_TETS = 500 };

struct proof {
    uint64_t seed;
    struct dice dice;
    struct shape shape;
    struct tetmesh mesh;
    struct simplify_options options;
    uint32_t controlled[SHAPE_MAX_FIELDS], controlled_count;
    struct contraction_log log;
    struct coarsening coarsening;
    struct oracle_mesh original;
    struct oracle_counts counts;
    uint32_t *part, *corners;
    unsigned findings;
};

__attribute__((format(printf, 3, 4))) static void found(struct proof *p, const char *what, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    shape_print_finding(&p->shape, p->seed, what, format, list);
    va_end(list);
    printf(" | metric %d, certify %d, contract %u, domain %g, angle %g\n", p->options.metric, p->options.certify,
           p->options.contract,
           p->options.boundary_limit / mesh_diagonal(&p->mesh), p->options.boundary_angle);
    fflush(stdout);
    p->findings++;
}

static bool make_mesh(struct proof *p)
{
    const struct shape *s = &p->shape;
    p->mesh = (struct tetmesh){.vertex_count = s->vertices, .tet_count = s->tets,
                               .position_type = s->wide ? TETLOD_FLOAT64 : TETLOD_FLOAT32};
    p->mesh.positions = oracle_memory(3 * (size_t)s->vertices, sizeof(double));
    p->mesh.corners = oracle_memory(4 * (size_t)s->tets, sizeof(uint32_t));
    memcpy(p->mesh.positions, s->positions, 3 * (size_t)s->vertices * sizeof(double));
    memcpy(p->mesh.corners, s->corners, 4 * (size_t)s->tets * sizeof(uint32_t));
    for (uint32_t f = 0; f < s->field_count; f++) {
        const struct shape_field *field = &s->fields[f];
        double range[2];
        if (tetmesh_add_field(&p->mesh, field->name, field->components, field->wide ? TETLOD_FLOAT64 : TETLOD_FLOAT32,
                              NULL) != TETLOD_OK)
            exit(2);
        memcpy(p->mesh.fields[f].values, field->values, (size_t)s->vertices * field->components * sizeof(double));
        point_field_range(&p->mesh.fields[f], s->vertices, range);
        if (range[1] > range[0] && isfinite(1 / (range[1] - range[0])) &&
            (p->controlled_count == 0 || dice_once_in(&p->dice, 2)))
            p->controlled[p->controlled_count++] = f;
    }
    return p->controlled_count > 0;
}

static void choose_options(struct proof *p)
{
    static const double domains[] = {1e-12, 1e-3, 1e-3, 1e-2, 0.03, 0.1, 0.3}, angles[] = {30, 30, 30, 0, 10, 60, 90},
                        growths[] = {1.05, 1.3, 2, 5};
    struct dice *dice = &p->dice;
    double diagonal = mesh_diagonal(&p->mesh);
    bool exact = dice_once_in(dice, 5), rounds = !exact && !dice_once_in(dice, 3);
    p->options = (struct simplify_options){.metric = exact ? METRIC_FIELD_QUADRIC : METRIC_ENVELOPE,
                                           .certify = exact ? CERTIFY_EXACT : CERTIFY_FAST,
                                           .contract = CONTRACT_EDGES,
                                           .max_error = 1,
                                           .local_bound = !exact,
                                           .boundary_angle = angles[dice_below(dice, 7)],
                                           .boundary_least = 1e-12 * diagonal,
                                           .growth = growths[dice_below(dice, 4)],
                                           .threads = 1};
    p->options.boundary_limit = fmin(domains[dice_below(dice, 7)], exact ? 1e-6 : 1) * diagonal;
    if (!rounds && !exact)
        (void)dice_below(dice, 4); // what this chose is no option any more; seeds keep the others
    if (!rounds && dice_once_in(dice, 3))
        p->options.contract = (1 + dice_below(dice, 7)) & 7;
}

static void take_original(struct proof *p)
{
    struct oracle_mesh *o = &p->original;
    p->part = oracle_memory(p->mesh.vertex_count, sizeof(uint32_t));
    p->corners = oracle_memory(4 * (size_t)p->mesh.tet_count, sizeof(uint32_t));
    *o = (struct oracle_mesh){p->mesh.vertex_count, p->mesh.tet_count, 0, p->mesh.positions, p->mesh.corners,
                              .part = p->part};
    for (uint32_t c = 0; c < p->log.component_count && o->value_count < ORACLE_MAX_VALUES; c++) {
        const struct log_component *component = &p->log.components[c];
        o->strides[o->value_count] = p->mesh.fields[component->field].components;
        o->values[o->value_count++] = p->mesh.fields[component->field].values + component->component;
    }
    oracle_parts(o->vertices, o->corners, o->tets, p->part);
    o->turn = oracle_turn(o->positions, o->corners, o->tets);
    oracle_prepare(o);
    oracle_leave_out_folds(o);
    oracle_count(o, &p->counts);
}

/* ---- a mark */

static void check_mesh(struct proof *p, uint32_t mark, const struct oracle_mesh *level)
{
    struct oracle_counts now, *then = &p->counts;
    oracle_count(level, &now);
    if (now.euler != then->euler || now.parts != then->parts || now.boundary_parts != then->boundary_parts ||
        now.overfull_faces > then->overfull_faces || now.duplicates > then->duplicates)
        found(p, "mesh", "mark %u: its topology is another one", mark);
    if (now.inverted > then->inverted || now.flat > then->flat)
        found(p, "mesh", "mark %u: %ld inverted, %ld flat; was %ld, %ld", mark, now.inverted, now.flat, then->inverted,
              then->flat);
}

static double within(const struct proof *p, uint32_t mark, uint32_t c, double slack)
{
    double scale = p->log.components[c].scale;
    return p->log.certified[(size_t)mark * p->log.component_count + c] * (1 + 1e-9) / scale + slack / scale;
}

static double radius(const struct proof *p, uint32_t mark)
{
    return p->log.marks[mark].moved * (1 + 1e-9) + 4e-12 * mesh_diagonal(&p->mesh);
}

static void check_max(struct proof *p, uint32_t mark, const struct oracle_mesh *level)
{
    struct oracle_place worst[ORACLE_MAX_VALUES];
    oracle_overlay(&p->original, level, radius(p, mark), worst);
    for (uint32_t c = 0; c < p->original.value_count; c++) {
        double scale = p->log.components[c].scale, certified = p->log.certified[(size_t)mark * p->log.component_count +
                                                                                c];
        bool moved = p->log.marks[mark].moved > 1e-9 * mesh_diagonal(&p->mesh);
        if (!(scale > 0) || certified >= 1 || worst[c].difference <= within(p, mark, c, 1e-16))
            continue;
        if (p->options.certify == CERTIFY_EXACT && worst[c].difference <= within(p, mark, c, 1e-6))
            continue; // what a boundary that moves by 1e-6 lets in: the overlay is added to it (build.c)
        if (!moved || !oracle_partner(level, p->part[p->mesh.corners[4 * (size_t)worst[c].tet]], worst[c].position,
                                      radius(p, mark), c, worst[c].value,
                                      within(p, mark, c, 1e-9)))
            found(p, "max", "mark %u of %u: certified %.17g, true %.17g", mark, p->log.mark_count, certified,
                  worst[c].difference * scale);
    }
}

static void check_partners(struct proof *p, uint32_t mark, const struct oracle_mesh *level)
{
    for (size_t i = 0; i < 4 * (size_t)p->mesh.tet_count; i++) {
        uint32_t v = p->mesh.corners[i];
        const double *at = p->mesh.positions + 3 * (size_t)v;
        for (uint32_t c = 0; c < p->original.value_count && p->original.details[i / 4].usable; c++) {
            double here, value = p->original.values[c][(size_t)v * p->original.strides[c]];
            if (!(p->log.components[c].scale > 0) || p->options.certify == CERTIFY_EXACT ||
                oracle_difference_at(level, p->part[v], at, c, value, &here) ||
                oracle_partner(level, p->part[v], at, radius(p, mark), c, value, within(p, mark, c, 1e-9)))
                continue;
            found(p, "partner", "mark %u of %u: certified %.9g, vertex %u has none", mark, p->log.mark_count,
                  within(p, mark, c, 0), v);
            return;
        }
    }
}

/* What component c is off by at most at the vertex in each slot; returned is the largest. */
static double slot_bounds(const struct proof *p, uint32_t mark, uint32_t c, double *out)
{
    double most = 0;
    memset(out, 0, p->mesh.vertex_count * sizeof *out);
    for (uint32_t r = 0; r < p->log.marks[mark].contractions; r++)
        out[p->coarsening.slot_of[r]] = p->log.components[c].bounds[r];
    for (uint32_t v = 0; v < p->mesh.vertex_count; v++)
        most = fmax(most, out[v]);
    return most;
}

/* Is the difference nowhere above the bounds of the vertices around it? With b these, interpolated, and M the largest,
 * |s - psi| <= b is the same as that neither s + (M - b) nor s - (M - b) is further than M from psi. */
static void check_local(struct proof *p, uint32_t mark, const struct oracle_mesh *level)
{
    size_t n = level->vertices;
    double *bounds = oracle_memory(n, sizeof *bounds), *shifted[2] = {oracle_memory(n, sizeof(double)),
                                                                      oracle_memory(n, sizeof(double))};
    for (uint32_t c = 0; c < p->original.value_count && p->options.local_bound; c++) {
        struct oracle_mesh original = p->original, both = *level;
        struct oracle_place worst[ORACLE_MAX_VALUES];
        double most = slot_bounds(p, mark, c, bounds), scale = p->log.components[c].scale, far = 0;
        original.value_count = both.value_count = 2;
        for (size_t i = 0; i < 2 * n; i++)
            shifted[i / n][i % n] =
                level->values[c][i % n * level->strides[c]] + (i < n ? 1 : -1) * (most - bounds[i % n]);
        for (size_t i = 0; i < 2 * n; i++)
            far = fmax(far, fabs(shifted[i / n][i % n]));
        for (int side = 0; side < 2; side++) {
            original.values[side] = p->original.values[c];
            original.strides[side] = p->original.strides[c];
            both.values[side] = shifted[side];
            both.strides[side] = 1;
        }
        oracle_overlay(&original, &both, radius(p, mark), worst);
        double allowed = most * (1 + 1e-9) + 1e-12 / scale + 4 * DBL_EPSILON * far; // shifted values are rounded
        for (uint32_t side = 0; side < 2 && scale > 0; side++)
            if (worst[side].difference > allowed &&
                !oracle_partner(&both, p->part[p->mesh.corners[4 * (size_t)worst[side].tet]], worst[side].position,
                                radius(p, mark), side,
                                worst[side].value, allowed))
                found(p, "local bound", "mark %u of %u: component %u is off by %.3g of its range more, of %.3g", mark,
                      p->log.mark_count, c, (worst[side].difference - most) * scale, most * scale);
    }
    free(bounds);
    free(shifted[0]);
    free(shifted[1]);
}

static void check_mark(struct proof *p, uint32_t mark)
{
    const struct coarsening *mesh = &p->coarsening;
    struct oracle_mesh level = {mesh->slot_count, 0, p->original.value_count, mesh->positions, p->corners,
                                .part = p->part,
                                .turn = p->original.turn};
    for (size_t t = 0; t < mesh->stored; t++)
        if (mesh->states[t] < COARSE_DIED)
            memcpy(p->corners + 4 * (size_t)level.tets++, mesh->corners + 4 * t, 4 * sizeof(uint32_t));
    for (uint32_t c = 0; c < level.value_count; c++) {
        level.strides[c] = p->original.strides[c];
        level.values[c] = mesh->fields[p->log.components[c].field].values + p->log.components[c].component;
    }
    oracle_prepare(&level);
    check_mesh(p, mark, &level);
    check_max(p, mark, &level);
    check_partners(p, mark, &level);
    check_local(p, mark, &level);
    double distance = fmax(oracle_boundary_distance(&p->original, &level),
                           oracle_boundary_distance(&level, &p->original));
    if (distance > radius(p, mark))
        found(p, "distance", "mark %u of %u: %.9g, it is %.9g", mark, p->log.mark_count, p->log.marks[mark].moved,
              distance);
    oracle_finish(&level);
}

static void check_marks(struct proof *p)
{
    uint32_t marks = p->log.mark_count, stride = marks > MAX_MARKS ? (marks - 1) / MAX_MARKS : 1;
    if (coarsening_init(&p->coarsening, &p->mesh, &p->log, NULL) != TETLOD_OK)
        exit(2);
    take_original(p);
    for (uint32_t mark = (marks - 1) % stride; mark < marks; mark += stride) {
        if (coarsening_advance(&p->coarsening, &p->log, p->log.marks[mark].contractions, 1, NULL) != TETLOD_OK)
            exit(2);
        check_mark(p, mark);
    }
    oracle_finish(&p->original);
    coarsening_fini(&p->coarsening);
    free(p->part);
    free(p->corners);
}

static unsigned attack(uint64_t seed)
{
    struct proof p = {.seed = seed, .dice = {seed * UINT64_C(0xd1342543de82ef95)}};
    struct tetlod_error error = {0};
    shape_of_seed(&p.shape, &p.dice, seed);
    if (p.shape.tets <= MAX_TETS && make_mesh(&p)) {
        choose_options(&p);
        if (simplify(&p.log, &p.mesh, p.controlled, p.controlled_count, NULL, &p.options, &error) == TETLOD_OK)
            check_marks(&p);
        else
            found(&p, "simplify", "%s", error.message);
        log_fini(&p.log);
    }
    tetmesh_fini(&p.mesh);
    shape_free(&p.shape);
    return p.findings;
}

int main(int argc, char **argv)
{
    unsigned findings = 0;
    if (argc != 3) {
        fprintf(stderr, "usage: proof FIRST COUNT\n");
        return 2;
    }
    uint64_t first = strtoull(argv[1], NULL, 10), count = strtoull(argv[2], NULL, 10);
    for (uint64_t seed = first; seed < first + count; seed++)
        findings += attack(seed);
    return findings != 0;
}
