/* SPDX-License-Identifier: BSD-3-Clause */
/* A working mesh with all that one contraction needs, for tests that contract by hand. */
#ifndef TETLOD_WORLD_H
#define TETLOD_WORLD_H

#include <stdlib.h>
#include <string.h>

#include "src/simplify/rounds/evaluate.h"
#include "src/simplify/rounds/outcome.h"

struct world {
    struct contraction_log log;
    struct working working;
    struct run run;
    struct worker worker;
    struct star star;
    uint32_t contracted;
};

struct world_options {
    const uint32_t *controlled;
    uint32_t controlled_count;
    const double *limits;
    double angle, boundary_limit; /* of the border */
    enum metric metric;
};

static inline void world_close(struct world *world)
{
    border_fini(&world->run.border);
    quadrics_fini(&world->run.quadrics);
    worker_fini(&world->worker);
    star_fini(&world->star);
    free(world->run.proposals);
    free(world->run.factors);
    pool_free(world->run.pool);
    working_fini(&world->working);
    log_fini(&world->log);
}

/* Of a mesh that outlives it. False: no memory. */
static inline bool world_open(struct world *world, const struct tetmesh *mesh, const struct world_options *options)
{
    *world = (struct world){.run = {.metric = options->metric, .kernels = kernels_choose(), .pool = pool_new(1)}};
    struct run *run = &world->run;
    run->working = &world->working;
    if (!run->pool || log_init(&world->log, mesh, NULL) != TETLOD_OK ||
        working_init(&world->working, mesh, NULL, options->controlled, options->controlled_count, options->limits,
                     &world->log, NULL) != TETLOD_OK ||
        border_find(&world->working, run->pool, NULL) != TETLOD_OK ||
        border_init(&run->border, &world->working, mesh, options->angle, options->boundary_limit, 0, 1, NULL) !=
            TETLOD_OK ||
        !worker_init(&world->worker, &world->working))
        return false;
    run->proposals = proposals_new(world->working.slot_count);
    run->factors = calloc(world->working.component_count + 1, sizeof *run->factors);
    for (uint32_t c = 0; c < world->working.component_count && run->factors; c++)
        run->factors[c] = world->working.components[c].factor;
    return run->proposals && run->factors;
}

/* A mesh without fields that drive. */
static inline bool world_open_plain(struct world *world, const struct tetmesh *mesh)
{
    return world_open(world, mesh, &(struct world_options){.angle = 30});
}

/* The slot of a vertex of the mesh that is alive. */
static inline uint32_t world_slot(const struct world *world, uint32_t vertex)
{
    uint32_t slot = 0;
    while (slot < world->working.slot_count &&
           !(world->working.node[slot] == vertex && working_alive(&world->working, slot)))
        slot++;
    return slot;
}

/* Prunes all stars, as the rounds do before they evaluate. */
static inline void world_prune(struct world *world)
{
    for (uint32_t v = 0; v < world->working.slot_count; v++)
        working_prune(&world->working, v);
}

/* Contracts the gathered star's simplex, into its last vertex, to p. False: no memory. */
static inline bool world_contract(struct world *world, const double p[3])
{
    struct working *working = &world->working;
    const struct star *star = &world->star;
    uint32_t kept = star->simplex[star->simplex_count - 1], *list = malloc((star->tet_count + 1) * sizeof *list);
    if (!list || working_reserve(working, 2 * (size_t)star->tet_count, NULL) != TETLOD_OK) {
        free(list);
        return false;
    }
    memcpy(working_row(working, kept), p, 3 * sizeof *p);
    working->tets_alive -= working_contract(working, star->simplex, star->simplex_count, list);
    working->node[kept] = world->log.vertex_count + world->contracted++;
    working->vertices_alive -= star->simplex_count - 1;
    world_prune(world);
    for (uint32_t v = 0; v < working->slot_count; v++)
        if (working_alive(working, v) && working->flags[v] & VERTEX_BOUNDARY)
            border_classify(&world->run.border, working, v);
    free(list);
    return true;
}

/* A random simplex of `count` vertices of a random tetrahedron that may be contracted. False: not this time. */
static inline bool world_pick(const struct world *world, uint32_t tet, uint32_t first, uint32_t count,
                              uint32_t simplex[4])
{
    const struct working *working = &world->working;
    uint8_t flags = 0;
    if (tet_gone(working, tet))
        return false;
    for (uint32_t s = 0; s < count; s++) {
        simplex[s] = working->corners[tet][(first + s) % 4];
        flags |= working->flags[simplex[s]];
    }
    return !(flags & (VERTEX_FROZEN | VERTEX_SINGULAR));
}

#endif
