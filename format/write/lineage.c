/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/write/lineage.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "format/common/ascending.h"
#include "format/fail.h"

static enum tetlod_status out_of_memory(const struct lineage *l, struct tetlod_error *error)
{
    return tetlodi_fail_nomem(error, "the contractions", (uint64_t)l->nodes * 24 + (uint64_t)l->in->tets * 7);
}

enum tetlod_status tetlodi_lineage_parents(const struct tetlodi_write_input *in, uint32_t *parent,
                                           struct tetlod_error *error)
{
    const struct lineage l = {.in = in};
    const uint32_t nodes = in->vertices + in->contractions;
    for (uint32_t node = 0; node < nodes; node++)
        parent[node] = TETLOD_NONE;
    for (uint32_t node = in->vertices; node < nodes; node++) {
        const uint32_t *children = lineage_children(&l, node);
        uint32_t count = lineage_child_count(&l, node);
        if (count < 2)
            return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "contraction %u has fewer than two vertices",
                                node - in->vertices);
        for (uint32_t c = 0; c < count; c++) {
            if (children[c] >= node || parent[children[c]] != TETLOD_NONE)
                return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "contraction %u takes a vertex that is not there",
                                    node - in->vertices);
            parent[children[c]] = node;
        }
    }
    return TETLOD_OK;
}

/* Sizes from the leaves up, then begins from the roots down: children follow each other inside their parent. */
static void number_leaves(struct lineage *l)
{
    uint32_t next = 0;
    for (uint32_t node = 0; node < l->nodes; node++)
        l->range[node] = (struct leaf_range){0, node < l->in->vertices};
    for (uint32_t node = 0; node < l->nodes; node++)
        if (l->parent[node] != TETLOD_NONE)
            l->range[l->parent[node]].end += l->range[node].end;
    for (uint32_t node = l->nodes; node-- > 0;) {
        uint32_t size = l->range[node].end;
        if (l->parent[node] == TETLOD_NONE) {
            l->range[node] = (struct leaf_range){next, next + size};
            next += size;
        }
        if (node < l->in->vertices) {
            l->position[node] = l->range[node].begin;
            continue;
        }
        const uint32_t *children = lineage_children(l, node);
        uint32_t begin = l->range[node].begin;
        for (uint32_t c = 0; c < lineage_child_count(l, node); c++) {
            struct leaf_range *range = &l->range[children[c]];
            *range = (struct leaf_range){begin, begin + range->end};
            begin = range->end;
        }
    }
}

/* The different nodes in which a tetrahedron's corners meet, three at most: those of neighbours in depth first
 * order. */
static uint32_t meetings(const struct lineage *l, uint32_t tet, uint32_t out[3])
{
    uint32_t leaves[4], count = 0;
    memcpy(leaves, l->in->corners + 4 * (size_t)tet, sizeof leaves);
    for (int i = 1; i < 4; i++)
        for (int j = i; j > 0 && l->position[leaves[j - 1]] > l->position[leaves[j]]; j--) {
            uint32_t swap = leaves[j];
            leaves[j] = leaves[j - 1];
            leaves[j - 1] = swap;
        }
    for (int i = 0; i < 3; i++) {
        uint32_t node = leaves[i];
        bool seen = false;
        while (node != TETLOD_NONE && !lineage_below(l, leaves[i + 1], node))
            node = l->parent[node];
        for (uint32_t k = 0; k < count; k++)
            seen |= out[k] == node;
        if (node != TETLOD_NONE && !seen)
            out[count++] = node;
    }
    return count;
}

static int count_meetings(void *opaque, uint32_t task)
{
    const struct lineage *l = opaque;
    uint32_t out[3];
    for (uint32_t t = tetlodi_task_begin(task), end = tetlodi_task_end(task, l->in->tets); t < end; t++) {
        l->waiting[t] = (uint8_t)meetings(l, t, out);
        for (uint32_t i = 0; i < l->waiting[t]; i++)
            atomic_fetch_add_explicit((_Atomic uint32_t *)&l->meeting_begin[out[i] - l->in->vertices + 1], 1,
                                      memory_order_relaxed);
    }
    return 1;
}

/* meeting_begin[c + 1] is where the next of contraction c goes, and in the end where they end. */
static int fill_meetings(void *opaque, uint32_t task)
{
    const struct lineage *l = opaque;
    uint32_t out[3];
    for (uint32_t t = tetlodi_task_begin(task), end = tetlodi_task_end(task, l->in->tets); t < end; t++)
        for (uint32_t i = 0, count = meetings(l, t, out); i < count; i++)
            l->meeting[atomic_fetch_add_explicit((_Atomic uint32_t *)&l->meeting_begin[out[i] - l->in->vertices + 1],
                                                 1, memory_order_relaxed)] = t;
    return 1;
}

/* Threads have filled them in any order. */
static int sort_meetings(void *opaque, uint32_t task)
{
    const struct lineage *l = opaque;
    for (uint32_t c = tetlodi_task_begin(task), end = tetlodi_task_end(task, l->in->contractions); c < end; c++) {
        uint32_t *first = l->meeting + l->meeting_begin[c], count = l->meeting_begin[c + 1] - l->meeting_begin[c];
        bool sorted = true;
        for (uint32_t i = 1; i < count && sorted; i++)
            sorted = first[i - 1] < first[i];
        if (!sorted)
            ascending_sort(first, count);
    }
    return 1;
}

static enum tetlod_status list_meetings(struct lineage *l, struct tetlodi_helpers *helpers, struct tetlod_error *error)
{
    uint32_t contractions = l->in->contractions, *begin = l->meeting_begin;
    uint64_t total = 0;
    tetlodi_helpers_share(helpers, count_meetings, l, l->in->tets);
    for (uint32_t c = 0; c < contractions; c++) { // from counts, one place on, to where they begin
        uint32_t count = begin[c + 1];
        begin[c + 1] = (uint32_t)total;
        total += count;
    }
    if (total > UINT32_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "the mesh is too large");
    l->meeting = malloc((total ? total : 1) * sizeof *l->meeting);
    if (!l->meeting)
        return out_of_memory(l, error);
    tetlodi_helpers_share(helpers, fill_meetings, l, l->in->tets);
    tetlodi_helpers_share(helpers, sort_meetings, l, contractions);
    return TETLOD_OK;
}

enum tetlod_status tetlodi_lineage_init(struct lineage *out, const struct tetlodi_write_input *in,
                                        struct tetlodi_helpers *helpers, struct tetlod_error *error)
{
    uint32_t nodes = in->vertices + in->contractions;
    *out = (struct lineage){.in = in,
                            .nodes = nodes,
                            .parent = malloc(nodes * sizeof *out->parent),
                            .range = malloc(nodes * sizeof *out->range),
                            .position = malloc(in->vertices * sizeof *out->position),
                            .meeting_begin = calloc(in->contractions + (size_t)1, sizeof *out->meeting_begin),
                            .waiting = malloc(in->tets)};
    if (!out->parent || !out->range || !out->position || !out->meeting_begin || !out->waiting)
        return out_of_memory(out, error);
    TETLOD_TRY(tetlodi_lineage_parents(in, out->parent, error));
    number_leaves(out);
    return list_meetings(out, helpers, error);
}

void tetlodi_lineage_trim(struct lineage *lineage, uint32_t contractions)
{
    size_t left = lineage->meeting_begin[contractions] ? lineage->meeting_begin[contractions] : 1;
    uint32_t *shrunk = realloc(lineage->meeting, left * sizeof *shrunk);
    lineage->meeting = shrunk ? shrunk : lineage->meeting;
    free(lineage->parent);
    lineage->parent = NULL;
}

void tetlodi_lineage_fini(struct lineage *lineage)
{
    void *const owned[] = {lineage->parent, lineage->range, lineage->position, lineage->meeting_begin,
                           lineage->meeting, lineage->waiting};
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
    *lineage = (struct lineage){0};
}
