/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/write/lineage.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"

static enum tetlod_status out_of_memory(const struct lineage *l, struct tetlod_error *error)
{
    return tetlodi_fail_nomem(error, "the contractions", (uint64_t)l->nodes * 24 + (uint64_t)l->in->tets * 7);
}

static enum tetlod_status link_parents(struct lineage *l, struct tetlod_error *error)
{
    for (uint32_t node = 0; node < l->nodes; node++)
        l->parent[node] = TETLOD_NONE;
    for (uint32_t node = l->in->vertices; node < l->nodes; node++) {
        const uint32_t *children = lineage_children(l, node);
        uint32_t count = lineage_child_count(l, node);
        if (count < 2)
            return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "contraction %u has fewer than two vertices",
                                node - l->in->vertices);
        for (uint32_t c = 0; c < count; c++) {
            if (children[c] >= node || l->parent[children[c]] != TETLOD_NONE)
                return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "contraction %u takes a vertex that is not there",
                                    node - l->in->vertices);
            l->parent[children[c]] = node;
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

static enum tetlod_status list_meetings(struct lineage *l, struct tetlod_error *error)
{
    uint32_t out[3], contractions = l->in->contractions;
    uint64_t total = 0;
    for (uint32_t t = 0; t < l->in->tets; t++) {
        l->waiting[t] = (uint8_t)meetings(l, t, out);
        for (uint32_t i = 0; i < l->waiting[t]; i++)
            l->meeting_begin[out[i] - l->in->vertices + 1]++;
        total += l->waiting[t];
    }
    if (total > UINT32_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "the mesh is too large");
    l->meeting = malloc((total ? total : 1) * sizeof *l->meeting);
    uint32_t *next = malloc((contractions + (size_t)1) * sizeof *next);
    if (!l->meeting || !next) {
        free(next);
        return out_of_memory(l, error);
    }
    for (uint32_t c = 0; c < contractions; c++)
        l->meeting_begin[c + 1] += l->meeting_begin[c];
    memcpy(next, l->meeting_begin, contractions * sizeof *next);
    for (uint32_t t = 0; t < l->in->tets; t++) {
        uint32_t count = meetings(l, t, out);
        for (uint32_t i = 0; i < count; i++)
            l->meeting[next[out[i] - l->in->vertices]++] = t;
    }
    free(next);
    return TETLOD_OK;
}

enum tetlod_status tetlodi_lineage_init(struct lineage *out, const struct tetlodi_write_input *in,
                                        struct tetlod_error *error)
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
    TETLOD_TRY(link_parents(out, error));
    number_leaves(out);
    return list_meetings(out, error);
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
