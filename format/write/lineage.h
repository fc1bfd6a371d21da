/* SPDX-License-Identifier: BSD-3-Clause */
/* The contractions of a stream that is written, as a forest: its leaves are the vertices of the original, its roots
 * those of the base mesh. Leaves are numbered depth first, so that "below a node" is a range. Internal. */
#ifndef TETLOD_LINEAGE_H
#define TETLOD_LINEAGE_H

#include <stdbool.h>

#include "format/common/threads.h"
#include "format/write/write_input.h"

enum { MAX_CHILDREN = 4 };

struct leaf_range {
    uint32_t begin, end;
};

struct lineage {
    const struct tetlodi_write_input *in;
    uint32_t nodes;
    uint32_t *parent;         /* [node] TETLOD_NONE: a root */
    struct leaf_range *range; /* [node] of positions of its leaves */
    uint32_t *position;       /* [leaf] depth first */
    uint32_t *meeting_begin, *meeting; /* [contraction + 1], tetrahedra whose corners meet in its node */
    uint8_t *waiting;         /* [tet] nodes in which its corners meet */
};

/* The input is borrowed; helpers may be NULL. ERR_ARGUMENT: it is no forest; ERR_LIMIT; ERR_NOMEM. *out can be freed in
 * any case. */
enum tetlod_status tetlodi_lineage_init(struct lineage *out, const struct tetlodi_write_input *in,
                                        struct tetlodi_helpers *helpers, struct tetlod_error *error);
/* [vertices + contractions] the node that each was contracted to, or TETLOD_NONE. ERR_ARGUMENT: it is no forest. */
enum tetlod_status tetlodi_lineage_parents(const struct tetlodi_write_input *in, uint32_t *parent,
                                           struct tetlod_error *error);

void tetlodi_lineage_fini(struct lineage *lineage);

/* Gives back the parents, which only the base mesh needs, and the meetings of all but the first contractions. */
void tetlodi_lineage_trim(struct lineage *lineage, uint32_t contractions);

/* The nodes that a contraction made one of. */
static inline const uint32_t *lineage_children(const struct lineage *lineage, uint32_t node)
{
    return lineage->in->children + 4 * (size_t)(node - lineage->in->vertices);
}

static inline uint32_t lineage_child_count(const struct lineage *lineage, uint32_t node)
{
    const uint32_t *children = lineage_children(lineage, node);
    uint32_t count = 0;
    while (count < MAX_CHILDREN && children[count] != TETLOD_NONE)
        count++;
    return count;
}

static inline uint32_t lineage_root(const struct lineage *lineage, uint32_t leaf)
{
    while (lineage->parent[leaf] != TETLOD_NONE)
        leaf = lineage->parent[leaf];
    return leaf;
}

static inline bool lineage_below(const struct lineage *lineage, uint32_t leaf, uint32_t node)
{
    return lineage->position[leaf] >= lineage->range[node].begin && lineage->position[leaf] < lineage->range[node].end;
}

#endif
