/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: a stream's input, whose last levels are in pages. 1. The root: the nodes that are there at its finest level as
 * vertices. 2. For levels with one tree: the mesh before them, which is known in order of arrival, and the one behind
 * them, in the input's order; of each page both, and the contractions between them, are a stack that others code.
 * 3. What they have come to, page by page: frames, and the order of arrival for the levels that follow.
 */
#include "format/write/stack_write.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/write/stack_nodes.h"
#include "format/write/write_check.h"

static enum tetlod_status no_memory(const struct tetlodi_stacks *s)
{
    return tetlodi_fail_nomem(s->error, "the stream", (uint64_t)s->whole.in->tets * 64);
}

static enum tetlod_status wrong_page(struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                        "the sequence cannot be written: a contraction is in the wrong page");
}

static enum tetlod_status wrong_result(struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_IO, "pages that another program has coded are not those that it was given");
}

/* ---- the root */

/* heirs[node]: the node of the mesh after so many contractions that it is in. */
static void find_heirs(struct tetlodi_stacks *s, uint32_t contractions)
{
    const uint32_t end = s->whole.in->vertices + contractions;
    for (uint32_t node = end; node-- > 0;)
        s->heirs[node] = s->parent[node] < end ? s->heirs[s->parent[node]] : node; // TETLOD_NONE is not below
}

/* Where a tetrahedron's corners are then. False: it is not there. */
static bool heirs_of(const struct tetlodi_stacks *s, uint32_t tet, uint32_t out[4])
{
    bool there = true;
    for (int c = 0; c < 4; c++) {
        out[c] = s->heirs[s->whole.in->corners[4 * (size_t)tet + (size_t)c]];
        for (int d = 0; d < c; d++)
            there &= out[c] != out[d];
    }
    return there;
}

static uint32_t root_level_count(const struct tetlodi_write_input *in)
{
    return in->level_count - (uint32_t)tetlodi_has_tail(in) - in->group_count;
}

/* Its vertices, in the order of the first of the originals that each holds, and its tetrahedra. */
static enum tetlod_status list_root(struct tetlodi_stacks *s)
{
    const struct tetlodi_write_input *in = s->whole.in;
    struct tetlodi_write_input *root = &s->root.in;
    uint32_t corners[4];
    for (uint32_t node = 0; node < s->nodes; node++)
        s->place[node] = TETLOD_NONE;
    for (uint32_t v = 0; v < in->vertices; v++)
        if (s->place[s->heirs[v]] == TETLOD_NONE)
            s->place[s->heirs[v]] = root->vertices++;
    for (uint32_t t = 0; t < in->tets; t++)
        root->tets += heirs_of(s, t, corners);
    s->root_nodes = malloc(root->vertices * sizeof *s->root_nodes);
    s->root_tets = malloc((root->tets + (size_t)1) * sizeof *s->root_tets);
    if (!s->root_nodes || !s->root_tets)
        return no_memory(s);
    for (uint32_t v = 0; v < in->vertices; v++)
        s->root_nodes[s->place[s->heirs[v]]] = s->heirs[v];
    for (uint32_t t = 0, count = 0; t < in->tets; t++)
        if (heirs_of(s, t, corners))
            s->root_tets[count++] = t;
    return TETLOD_OK;
}

static enum tetlod_status fill_root(struct tetlodi_stacks *s, uint32_t contractions)
{
    const struct tetlodi_write_input *in = s->whole.in;
    struct tetlodi_write_input *root = &s->root.in;
    const uint32_t first = in->vertices + contractions;
    uint32_t *corners, *children, *contracted = malloc((root->contractions + (size_t)1) * sizeof *contracted);
    for (uint32_t c = 0; c < root->contractions && contracted; c++) {
        s->place[first + c] = root->vertices + c;
        contracted[c] = first + c;
    }
    bool good = contracted && tetlodi_stack_copy_nodes(&s->whole, &s->root, s->root_nodes, contracted, &corners,
                                                       &children);
    free(contracted);
    if (!good)
        return no_memory(s);
    for (size_t i = 0; i < 4 * (size_t)root->contractions; i++) {
        uint32_t child = in->children[4 * (size_t)contractions + i];
        children[i] = child == TETLOD_NONE ? TETLOD_NONE : s->place[child];
    }
    for (uint32_t t = 0; t < root->tets; t++)
        for (size_t c = 0; c < 4; c++)
            corners[4 * (size_t)t + c] = s->place[s->heirs[in->corners[4 * (size_t)s->root_tets[t] + c]]];
    return TETLOD_OK;
}

enum tetlod_status tetlodi_stacks_init(struct tetlodi_stacks *s)
{
    const struct tetlodi_write_input *in = s->whole.in;
    const uint32_t levels = root_level_count(in), contractions = in->levels[levels - 1].contractions;
    struct tetlodi_write_level *own = calloc(levels, sizeof *own);
    s->memory.most = UINT64_MAX;
    s->nodes = in->vertices + in->contractions;
    s->parent = malloc(s->nodes * sizeof *s->parent);
    s->heirs = malloc(s->nodes * sizeof *s->heirs);
    s->place = malloc(s->nodes * sizeof *s->place);
    s->root.in.levels = own;
    s->root.in.level_count = levels;
    s->root.in.contractions = in->contractions - contractions;
    if (!s->parent || !s->heirs || !s->place || !own)
        return no_memory(s);
    for (uint32_t level = 0; level < levels; level++) {
        own[level] = in->levels[level];
        own[level].contractions -= contractions;
    }
    TETLOD_TRY(tetlodi_lineage_parents(in, s->parent, s->error));
    find_heirs(s, contractions);
    TETLOD_TRY(list_root(s));
    return fill_root(s, contractions);
}

static void free_mesh(struct tetlodi_stacks *s, int which)
{
    struct tetlodi_replay *mesh = which ? &s->end : &s->begin;
    struct tetlodi_column *positions = &s->positions[which];
    if (positions->values_capacity) // else they are the input's
        TETLODI_FREE(&s->memory, positions->values, positions->values_capacity);
    if (mesh->corners_capacity)
        TETLODI_FREE(&s->memory, mesh->corners, mesh->corners_capacity);
    mesh->corners = NULL;
    positions->values = NULL;
}

static void end_levels(struct tetlodi_stacks *s)
{
    tetlodi_page_shares_fini(&s->shares);
    free_mesh(s, 1);
    free(s->at_end);
    free(s->original_at_end);
    s->at_end = NULL;
    s->original_at_end = NULL;
    for (uint32_t page = 0; page < s->page_count && s->results; page++)
        tetlodi_stack_result_fini(&s->results[page]);
    for (uint32_t i = 0; i < 2 * s->page_count && s->seams; i++)
        free(s->seams[i / 2][i % 2].vertices);
    free(s->results);
    free(s->seams);
    s->results = NULL;
    s->seams = NULL;
    s->level_count = 0;
}

void tetlodi_stacks_fini(struct tetlodi_stacks *s)
{
    end_levels(s);
    free_mesh(s, 0);
    tetlodi_stack_fini(&s->root);
    void *const owned[] = {s->root_nodes, s->root_tets, s->parent, s->heirs, s->place, s->node_at, s->original_of,
                           s->leaves, s->places};
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
    *s = (struct tetlodi_stacks){0};
}

enum tetlod_status tetlodi_stacks_begin(struct tetlodi_stacks *s, const struct tetlodi_record_writer *root)
{
    const struct tetlodi_write_input *in = s->whole.in;
    s->vertices = root->replay->vertices;
    s->tets = root->replay->tets;
    s->node_at = malloc(in->vertices * sizeof *s->node_at);
    s->original_of = malloc(in->tets * sizeof *s->original_of);
    s->leaves = malloc(in->vertices);
    s->places = malloc(in->tets);
    if (!s->node_at || !s->original_of || !s->leaves || !s->places)
        return no_memory(s);
    for (uint32_t v = 0; v < s->vertices; v++) {
        s->node_at[v] = s->root_nodes[root->node_at[v]];
        s->leaves[v] = (uint8_t)root->replay->stars[v].leaf;
    }
    for (uint32_t t = 0; t < s->tets; t++) {
        s->original_of[t] = s->root_tets[root->original_of[t]];
        s->places[t] = root->places[t];
    }
    return TETLOD_OK;
}

/* ---- what a page has */

struct page_lists {
    uint32_t page;
    struct tetlodi_page_part begin, end;
    uint32_t *leaves, leaf_count;             /* nodes: the vertices at the end; behind them those without tetrahedra */
    uint32_t *contracted, contracted_count;   /* nodes that its contractions make */
    uint32_t *ends;                           /* as a stack's */
};

static void free_lists(struct page_lists *lists)
{
    tetlodi_page_part_fini(&lists->begin);
    tetlodi_page_part_fini(&lists->end);
    free(lists->leaves);
    free(lists->contracted);
    free(lists->ends);
}

static const struct tetlodi_write_group *group_of(const struct tetlodi_stacks *s, uint32_t level)
{
    return &s->whole.in->groups[s->first_level + level - root_level_count(s->whole.in)];
}

/* The page's contractions of a level begin there, and end. */
static void range_of(const struct tetlodi_stacks *s, uint32_t level, uint32_t page, uint32_t out[2])
{
    const struct tetlodi_write_group *group = group_of(s, level);
    out[0] = page ? group->ends[page - 1] : s->whole.in->levels[s->first_level + level].contractions;
    out[1] = group->ends[page];
}

/* Its contractions, of the finest level first; 0 if out of memory. */
static int list_contractions(const struct tetlodi_stacks *s, struct page_lists *lists)
{
    uint32_t range[2], count = 0;
    for (uint32_t level = 0; level < s->level_count; level++) {
        range_of(s, level, lists->page, range);
        count += range[1] - range[0];
    }
    lists->contracted = malloc((count + (size_t)1) * sizeof *lists->contracted);
    lists->ends = malloc(s->level_count * sizeof *lists->ends);
    lists->leaves = malloc((lists->end.listed_count + 4 * (size_t)count + 1) * sizeof *lists->leaves);
    if (!lists->contracted || !lists->ends || !lists->leaves)
        return 0;
    for (uint32_t level = s->level_count; level-- > 0;) {
        range_of(s, level, lists->page, range);
        for (uint32_t c = range[0]; c < range[1]; c++) {
            s->place[s->whole.in->vertices + c] = lists->contracted_count;
            lists->contracted[lists->contracted_count++] = s->whole.in->vertices + c;
        }
        lists->ends[level] = lists->contracted_count;
    }
    return 1;
}

/* Children without a tetrahedron are vertices as well. */
static void list_leaves(const struct tetlodi_stacks *s, struct page_lists *lists)
{
    memcpy(lists->leaves, lists->end.listed, lists->end.listed_count * sizeof *lists->leaves);
    lists->leaf_count = lists->end.listed_count;
    for (uint32_t k = 0; k < lists->contracted_count; k++) {
        const uint32_t *children =
            s->whole.in->children + 4 * (size_t)(lists->contracted[k] - s->whole.in->vertices);
        for (int c = 0; c < 4; c++)
            if (children[c] < s->end.vertices && s->shares.owner[children[c]] == PAGE_NOBODY) {
                s->shares.local[children[c]] = lists->leaf_count;
                lists->leaves[lists->leaf_count++] = children[c];
            }
    }
}

/* A page is listed twice, for its stack and for what that has come to: which vertices are at seams, for which all of
 * its corners are looked at, is kept in between. Takes them, or gives them back. */
static void swap_seams(struct tetlodi_stacks *s, struct page_lists *lists)
{
    for (int i = 0; i < 2; i++) {
        struct tetlodi_page_part *part = i ? &lists->end : &lists->begin;
        struct tetlodi_page_seams *kept = &s->seams[lists->page][i], own = {part->at_seams, part->at_seams_count};
        part->at_seams = kept->vertices;
        part->at_seams_count = kept->count;
        *kept = own;
    }
}

static int list_page(struct tetlodi_stacks *s, uint32_t page, struct page_lists *lists)
{
    *lists = (struct page_lists){.page = page};
    tetlodi_page_part_set(&lists->begin, &s->pages->shares, page);
    tetlodi_page_part_set(&lists->end, &s->shares, page);
    swap_seams(s, lists);
    if (!tetlodi_page_part_list(&lists->begin, &s->pages->shares, 0) ||
        !tetlodi_page_part_list(&lists->end, &s->shares, 0) || !list_contractions(s, lists))
        return 0;
    list_leaves(s, lists);
    return 1;
}

/* A node of the whole in the stack; TETLOD_NONE: it is of another one. */
static uint32_t number_of(const struct tetlodi_stacks *s, const struct page_lists *lists, uint32_t node)
{
    if (node >= s->end.vertices) {
        uint32_t number = s->place[node];
        return number < lists->contracted_count && lists->contracted[number] == node ? lists->leaf_count + number
                                                                                     : TETLOD_NONE;
    }
    uint32_t owner = s->shares.owner[node], number = s->shares.local[node];
    if (owner != lists->page && owner != PAGE_SEAM && owner != PAGE_NOBODY)
        return TETLOD_NONE;
    number = owner == PAGE_SEAM ? tetlodi_page_part_number(&lists->end, &s->shares, node) : number;
    return number < lists->leaf_count && lists->leaves[number] == node ? number : TETLOD_NONE;
}

/* ---- a stack */

/* Of a tetrahedron of the input; TETLOD_NONE: it is not there at the end. */
static uint32_t number_at_end(const struct tetlodi_stacks *s, uint32_t original)
{
    if (!s->at_end)
        return original;
    const struct tetlodi_at_end *word = &s->at_end[original / 64];
    uint64_t below = ((uint64_t)1 << original % 64) - 1;
    return word->there >> original % 64 & 1 ? word->before + (uint32_t)__builtin_popcountll(word->there & below)
                                            : TETLOD_NONE;
}

/* The mesh at the begin in numbers of the stack. False: it is not all of this page. */
static bool fill_begin(const struct tetlodi_stacks *s, const struct page_lists *lists, struct tetlodi_page_stack *out)
{
    bool good = true;
    for (uint32_t v = 0; v < out->vertices; v++) {
        uint32_t vertex = lists->begin.listed[v];
        out->nodes[v] = number_of(s, lists, s->node_at[vertex]);
        out->seams[v] = lists->begin.seams[v];
        out->leaves[v] = s->leaves[vertex];
        good &= out->nodes[v] != TETLOD_NONE;
    }
    uint32_t *places = s->shares.page_of; // of tetrahedra in their pages, from now on
    for (uint32_t t = 0; t < lists->end.tet_count; t++)
        places[lists->end.tets[t]] = t;
    for (uint32_t t = 0; t < out->tets; t++) {
        uint32_t tet = lists->begin.tets[t], at_end = number_at_end(s, s->original_of[tet]);
        out->numbers[t] = at_end == TETLOD_NONE ? TETLOD_NONE : places[at_end];
        out->places[t] = s->places[tet];
        good &= out->numbers[t] < lists->end.tet_count && lists->end.tets[out->numbers[t]] == at_end;
    }
    return good;
}

/* The mesh at the end, and the contractions. */
static bool fill_end(const struct tetlodi_stacks *s, const struct page_lists *lists, uint32_t *corners,
                     uint32_t *children)
{
    const struct tetlodi_write_input *in = s->whole.in;
    bool good = true;
    for (uint32_t t = 0; t < lists->end.tet_count; t++)
        for (size_t c = 0; c < 4; c++)
            corners[4 * (size_t)t + c] =
                tetlodi_page_part_number(&lists->end, &s->shares, s->end.corners[4 * (size_t)lists->end.tets[t] + c]);
    for (uint32_t k = 0; k < lists->contracted_count; k++)
        for (size_t c = 0; c < 4; c++) {
            uint32_t child = in->children[4 * (size_t)(lists->contracted[k] - in->vertices) + c];
            children[4 * (size_t)k + c] = child == TETLOD_NONE ? TETLOD_NONE : number_of(s, lists, child);
            good &= child == TETLOD_NONE || children[4 * (size_t)k + c] != TETLOD_NONE;
        }
    return good;
}

static bool allocate_begin(struct tetlodi_page_stack *out)
{
    out->nodes = malloc((out->vertices + (size_t)1) * sizeof *out->nodes);
    out->numbers = malloc((out->tets + (size_t)1) * sizeof *out->numbers);
    out->seams = malloc(out->vertices + (size_t)1);
    out->leaves = malloc(out->vertices + (size_t)1);
    out->places = malloc(out->tets + (size_t)1);
    out->copied = malloc((out->in.field_count + (size_t)1) * MAX_COMPONENTS);
    return out->nodes && out->numbers && out->seams && out->leaves && out->places && out->copied;
}

bool tetlodi_stacks_keep_order(const struct tetlodi_stacks *s)
{
    const struct tetlodi_write_input *in = s->whole.in;
    return in->levels[s->first_level + s->level_count - 1].contractions || tetlodi_has_tail(in) || in->keep_order ||
           in->cell_field_count || in->late;
}

void tetlodi_stacks_order(struct tetlodi_stacks *s, struct tetlodi_record_writer *out)
{
    TETLODI_FREE(out->memory, out->node_at, out->node_capacity);
    TETLODI_FREE(out->memory, out->original_of, out->original_capacity);
    TETLODI_FREE(out->memory, out->places, out->places_capacity);
    out->node_at = s->node_at;
    out->original_of = s->original_of;
    out->places = s->places;
    s->node_at = s->original_of = NULL;
    s->places = NULL;
    end_levels(s);
    free_mesh(s, 0);
}

static enum tetlod_status cut(void *opaque, uint32_t page, struct tetlodi_page_stack *out, struct tetlod_error *error)
{
    struct tetlodi_stacks *s = opaque;
    struct page_lists lists;
    uint32_t *corners, *children;
    enum tetlod_status status = TETLOD_OK;
    *out = (struct tetlodi_page_stack){
        .level_count = s->level_count, .slowest = s->slowest, .keeps_mesh = tetlodi_stacks_keep_order(s)};
    bool room = list_page(s, page, &lists);
    out->in.vertices = lists.leaf_count;
    out->in.tets = lists.end.tet_count;
    out->in.contractions = lists.contracted_count;
    out->vertices = lists.begin.listed_count;
    out->tets = lists.begin.tet_count;
    room = room && tetlodi_stack_copy_nodes(&s->whole, out, lists.leaves, lists.contracted, &corners, &children) &&
           allocate_begin(out);
    if (!room)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "a page", (uint64_t)lists.end.tet_count * 64));
    for (uint32_t f = 0; f < out->in.field_count; f++)
        memcpy(out->copied + (size_t)f * MAX_COMPONENTS, s->recorder->field_models[f].copied, MAX_COMPONENTS);
    out->ends = lists.ends;
    lists.ends = NULL;
    bool begins = fill_begin(s, &lists, out), ends = fill_end(s, &lists, corners, children);
    if (!begins || !ends)
        TETLOD_TRY_DONE(wrong_page(error));
    swap_seams(s, &lists);
done:
    free_lists(&lists);
    return status;
}

/* ---- levels with one tree */

/* A mesh of vertices that are nodes. */
static int mesh_room(struct tetlodi_stacks *s, struct tetlodi_replay *mesh, struct tetlodi_column *positions)
{
    const size_t vertices = mesh->vertices, tets = mesh->tets;
    return TETLODI_ROOM(&s->memory, mesh->corners, mesh->corners_capacity, 4 * tets) &&
           TETLODI_ROOM(&s->memory, positions->values, positions->values_capacity, 3 * vertices);
}

static void place_node(const struct tetlodi_stacks *s, struct tetlodi_replay *mesh, uint32_t vertex, uint32_t node)
{
    for (size_t axis = 0; axis < 3; axis++)
        mesh->columns[0].values[3 * (size_t)vertex + axis] = tetlodi_node_value(&s->whole, 0, node, axis);
}

static void set_counts(struct tetlodi_stacks *s, int which, uint32_t vertices, uint32_t tets)
{
    struct tetlodi_replay *mesh = which ? &s->end : &s->begin;
    tetlodi_replay_init(mesh, &s->memory, &s->positions[which], 1);
    s->positions[which].components = 3;
    mesh->vertices = vertices;
    mesh->tets = tets;
}

/* The mesh behind the root, in order of arrival; what later levels begin with is made page by page (keep_page). */
static enum tetlod_status set_begin(struct tetlodi_stacks *s)
{
    const uint32_t *originals = s->whole.in->corners;
    set_counts(s, 0, s->vertices, s->tets);
    if (!mesh_room(s, &s->begin, &s->positions[0]))
        return no_memory(s);
    for (uint32_t v = 0; v < s->vertices; v++) {
        s->place[s->node_at[v]] = v;
        place_node(s, &s->begin, v, s->node_at[v]);
    }
    for (uint32_t v = 0; v < s->whole.in->vertices; v++) // nobody asks for heirs of the begin any more
        s->heirs[v] = s->place[s->heirs[v]];
    for (size_t t = 0; t < s->tets; t++)
        for (size_t c = 0; c < 4; c++)
            s->begin.corners[4 * t + c] =
                s->heirs[originals[4 * (size_t)s->original_of[t] + (s->places[t] >> 2 * c & 3)]];
    return TETLOD_OK;
}

static int find_there(void *opaque, uint32_t task)
{
    const struct tetlodi_stacks *s = opaque;
    uint32_t corners[4], end = tetlodi_task_end(task, s->whole.in->tets);
    for (uint32_t t = tetlodi_task_begin(task); t < end; t++)
        s->at_end[t / 64].there |= (uint64_t)heirs_of(s, t, corners) << t % 64;
    return 1;
}

/* Those that are there. */
static int fill_corners(void *opaque, uint32_t task)
{
    const struct tetlodi_stacks *s = opaque;
    const uint32_t begin = tetlodi_task_begin(task), end = tetlodi_task_end(task, s->whole.in->tets);
    uint32_t number = s->at_end[begin / 64].before;
    for (uint32_t t = begin; t < end; t++) {
        if (!(s->at_end[t / 64].there >> t % 64 & 1))
            continue;
        heirs_of(s, t, s->end.corners + 4 * (size_t)number);
        s->original_at_end[number++] = t;
    }
    return 1;
}

/* Of a coarser level than the finest. */
static enum tetlod_status make_end(struct tetlodi_stacks *s, uint32_t contractions)
{
    const uint32_t tets = s->whole.in->tets;
    const size_t words = tets / 64 + (size_t)1;
    uint32_t count = 0;
    s->at_end = calloc(words, sizeof *s->at_end);
    if (!s->at_end)
        return no_memory(s);
    find_heirs(s, contractions);
    tetlodi_helpers_share(s->helpers, find_there, s, tets);
    for (size_t w = 0; w < words; w++) {
        s->at_end[w].before = count;
        count += (uint32_t)__builtin_popcountll(s->at_end[w].there);
    }
    s->end.tets = count;
    s->original_at_end = malloc((count + (size_t)1) * sizeof *s->original_at_end);
    if (!s->original_at_end || !mesh_room(s, &s->end, &s->positions[1]))
        return no_memory(s);
    tetlodi_helpers_share(s->helpers, fill_corners, s, tets);
    for (uint32_t node = 0; node < s->end.vertices; node++)
        place_node(s, &s->end, node, node);
    return TETLOD_OK;
}

/* The mesh at the end: vertices are nodes, and tetrahedra are in the input's order. */
static enum tetlod_status set_end(struct tetlodi_stacks *s)
{
    const struct tetlodi_write_input *in = s->whole.in;
    const uint32_t contractions = in->levels[s->first_level + s->level_count - 1].contractions;
    set_counts(s, 1, in->vertices + contractions, in->tets);
    if (contractions) {
        TETLOD_TRY(make_end(s, contractions));
    } else {
        s->end.corners = (uint32_t *)(uintptr_t)in->corners; // read only, where they are not made here
        s->positions[1].values = (double *)(uintptr_t)in->positions;
    }
    if (!tetlodi_page_shares_init(&s->shares, &s->end, s->page_count))
        return no_memory(s);
    tetlodi_find_pages(&s->shares, group_of(s, 0)->tree, s->helpers);
    tetlodi_page_shares_sort(&s->shares, s->helpers);
    return TETLOD_OK;
}

/* Another program may have coded the pages: are there as many levels, parts, vertices and tetrahedra as can be? */
static bool sizes_fit(const struct tetlodi_stacks *s)
{
    const struct tetlodi_write_input *in = s->whole.in;
    uint64_t vertices = s->vertices, tets = s->tets;
    for (uint32_t page = 0; page < s->page_count; page++) {
        const struct tetlodi_stack_result *result = &s->results[page];
        if (result->level_count != s->level_count || result->parts != 1 + in->field_count)
            return false;
        for (uint32_t level = 0; level < s->level_count; level++) {
            vertices += result->levels[level].vertices;
            tets += result->levels[level].tets;
        }
    }
    return vertices <= in->vertices && tets <= in->tets;
}

/* Has the stacks of the levels coded that begin with this one. */
static enum tetlod_status code_levels(struct tetlodi_stacks *s, uint32_t level)
{
    const struct tetlodi_write_input *in = s->whole.in;
    end_levels(s);
    s->first_level = level;
    s->page_count = group_of(s, 0)->pages;
    s->taken = 0;
    do
        s->level_count++;
    while (level + s->level_count < root_level_count(in) + in->group_count &&
           tetlodi_same_tree(group_of(s, s->level_count), group_of(s, 0)));
    s->results = calloc(s->page_count, sizeof *s->results);
    s->seams = calloc(s->page_count, sizeof *s->seams);
    if (!s->results || !s->seams)
        return no_memory(s);
    if (!s->begin.corners)
        TETLOD_TRY(set_begin(s));
    if (!tetlodi_page_writer_begin(s->pages, s->helpers, &s->begin, group_of(s, 0), level))
        return no_memory(s);
    TETLOD_TRY(set_end(s));
    const struct tetlodi_stack_work work = {s->page_count, cut, s, s->results};
    TETLOD_TRY(in->share(in->share_opaque, &work, s->error));
    return sizes_fit(s) ? TETLOD_OK : wrong_result(s->error);
}

/* ---- what they have come to */

/* Where what a page adds goes, level by level: its vertices or its tetrahedra. */
struct arrivals {
    uint32_t *vertices, *tets; /* [level * pages + page] */
};

static int count_arrivals(const struct tetlodi_stacks *s, struct arrivals *arrivals)
{
    size_t pages = s->page_count, count = s->level_count * pages;
    uint32_t vertex = s->begin.vertices, tet = s->begin.tets;
    arrivals->vertices = malloc(count * sizeof *arrivals->vertices);
    arrivals->tets = malloc(count * sizeof *arrivals->tets);
    for (size_t i = 0; i < count && arrivals->vertices && arrivals->tets; i++) {
        const struct tetlodi_stack_level *level = &s->results[i % pages].levels[i / pages];
        arrivals->vertices[i] = vertex;
        arrivals->tets[i] = tet;
        vertex += level->vertices;
        tet += level->tets;
    }
    return arrivals->vertices && arrivals->tets;
}

/* A page's vertices and tetrahedra as the levels that follow ask for them; what does not fit is refused. */
struct keeper {
    struct tetlodi_stacks *s;
    const struct tetlodi_stack_result *result;
    struct page_lists lists;
    uint32_t *vertices; /* [vertex of the stack] in order of arrival; TETLOD_NONE: it has not come */
    bool more;          /* levels in pages follow */
};

static bool page_fits(const struct keeper *keeper)
{
    const struct tetlodi_stack_result *result = keeper->result;
    const struct page_lists *lists = &keeper->lists;
    uint64_t vertices = lists->begin.listed_count, tets = lists->begin.tet_count;
    for (uint32_t level = 0; level < keeper->s->level_count; level++) {
        vertices += result->levels[level].vertices;
        tets += result->levels[level].tets;
    }
    return vertices == lists->leaf_count && vertices == result->vertices && tets == lists->end.tet_count &&
           result->tets == tets - lists->begin.tet_count;
}

static bool keep_vertex(const struct keeper *keeper, uint32_t vertex, uint32_t number)
{
    struct tetlodi_stacks *s = keeper->s;
    uint32_t leaf = keeper->result->nodes[number];
    if (leaf >= keeper->lists.leaf_count || keeper->vertices[leaf] != TETLOD_NONE)
        return false;
    keeper->vertices[leaf] = vertex;
    s->node_at[vertex] = keeper->lists.leaves[leaf];
    s->leaves[vertex] = keeper->result->leaves[number];
    if (keeper->more)
        place_node(s, &s->begin, vertex, s->node_at[vertex]);
    return true;
}

static void keep_corners(const struct keeper *keeper, uint32_t tet, uint32_t at_end)
{
    const struct tetlodi_stacks *s = keeper->s;
    const struct page_lists *lists = &keeper->lists;
    const uint32_t *nodes = s->end.corners + 4 * (size_t)at_end;
    uint32_t *to = s->begin.corners + 4 * (size_t)tet;
    for (int c = 0; c < 4; c++)
        to[c] = keeper->vertices[tetlodi_page_part_number(&lists->end, &s->shares, nodes[s->places[tet] >> 2 * c & 3])];
}

static bool keep_tet(const struct keeper *keeper, uint32_t tet, uint32_t number)
{
    struct tetlodi_stacks *s = keeper->s;
    uint32_t at_end = keeper->result->numbers[number];
    if (at_end >= keeper->lists.end.tet_count)
        return false;
    at_end = keeper->lists.end.tets[at_end];
    s->original_of[tet] = s->original_at_end ? s->original_at_end[at_end] : at_end;
    s->places[tet] = keeper->result->places[number];
    if (keeper->more)
        keep_corners(keeper, tet, at_end);
    return true;
}

/* The page's mesh at the end becomes part of the whole. False: it is not what the page has come to. */
static bool keep_all(const struct keeper *keeper, const struct arrivals *arrivals)
{
    const struct tetlodi_stacks *s = keeper->s;
    const struct tetlodi_page_part *begin = &keeper->lists.begin;
    const size_t pages = s->page_count;
    bool good = page_fits(keeper);
    uint32_t v = 0, t = 0;
    for (; good && v < begin->listed_count; v++)
        good = keep_vertex(keeper, begin->listed[v], v);
    for (uint32_t level = 0; level < s->level_count; level++)
        for (uint32_t i = 0; good && i < keeper->result->levels[level].vertices; i++, v++)
            good = keep_vertex(keeper, arrivals->vertices[level * pages + keeper->lists.page] + i, v);
    for (uint32_t i = 0; good && keeper->more && i < begin->tet_count; i++)
        keep_corners(keeper, begin->tets[i], number_at_end(s, s->original_of[begin->tets[i]]));
    for (uint32_t level = 0; level < s->level_count; level++)
        for (uint32_t i = 0; good && i < keeper->result->levels[level].tets; i++, t++)
            good = keep_tet(keeper, arrivals->tets[level * pages + keeper->lists.page] + i, t);
    return good;
}

static enum tetlod_status keep_page(struct tetlodi_stacks *s, uint32_t page, bool more,
                                    const struct arrivals *arrivals)
{
    struct keeper keeper = {.s = s, .result = &s->results[page], .more = more};
    enum tetlod_status status = no_memory(s);
    if (list_page(s, page, &keeper.lists)) {
        size_t size = (keeper.lists.leaf_count + (size_t)1) * sizeof *keeper.vertices;
        keeper.vertices = malloc(size);
        if (keeper.vertices) {
            memset(keeper.vertices, 0xff, size); // TETLOD_NONE
            status = keep_all(&keeper, arrivals) ? TETLOD_OK : wrong_result(s->error);
        }
    }
    free(keeper.vertices);
    free_lists(&keeper.lists);
    return status;
}

/* Room for the mesh that the levels which follow begin with. Page by page it takes the place of the one before. */
static int grow_begin(struct tetlodi_stacks *s)
{
    s->begin.vertices = s->vertices;
    s->begin.tets = s->tets;
    return mesh_room(s, &s->begin, &s->positions[0]);
}

/* The mesh at the end, in order of arrival, is what the levels that follow begin with. */
static enum tetlod_status keep_mesh(struct tetlodi_stacks *s)
{
    struct arrivals arrivals;
    const struct tetlodi_write_input *in = s->whole.in;
    const bool more = s->first_level + s->level_count < root_level_count(in) + in->group_count;
    enum tetlod_status status = TETLOD_OK;
    if (!count_arrivals(s, &arrivals) || (more && !grow_begin(s)))
        status = no_memory(s);
    for (uint32_t page = 0; page < s->page_count && status == TETLOD_OK; page++)
        status = keep_page(s, page, more, &arrivals);
    free(arrivals.vertices);
    free(arrivals.tets);
    return status;
}

/* Tetrahedra of all pages before the level. */
static int follow(const struct tetlodi_stacks *s)
{
    uint32_t *tets = malloc(s->page_count * sizeof *tets);
    for (uint32_t page = 0; page < s->page_count && tets; page++) {
        tets[page] = s->pages->shares.tet_begins[page + 1] - s->pages->shares.tet_begins[page];
        for (uint32_t level = 0; level < s->taken; level++)
            tets[page] += s->results[page].levels[level].tets;
    }
    int done = tets && tetlodi_page_writer_follow(s->pages, tets);
    free(tets);
    return done;
}

static enum tetlod_status take_page(struct tetlodi_stacks *s, uint32_t page, struct tetlodi_buffer *frames,
                                    uint64_t *io_labels)
{
    const struct tetlodi_stack_result *result = &s->results[page];
    const struct tetlodi_stack_level *level = &result->levels[s->taken];
    const struct tetlodi_page_table *table = &s->pages->table;
    for (uint32_t part = 0; part < result->parts; part++) {
        const struct tetlodi_buffer *frame = &result->frames[(size_t)s->taken * result->parts + part];
        tetlodi_put_block(&frames[part], frame->bytes, frame->size);
        if (frames[part].failed)
            return no_memory(s);
    }
    memcpy(s->pages->boxes[table->page_count], level->box, sizeof level->box);
    s->vertices += level->vertices;
    s->tets += level->tets;
    *io_labels += level->labels;
    return tetlodi_page_writer_page(s->pages, s->vertices, s->tets, frames) ? TETLOD_OK : no_memory(s);
}

enum tetlod_status tetlodi_stacks_level(struct tetlodi_stacks *s, uint32_t level, struct tetlodi_buffer *frames,
                                        uint64_t *io_labels)
{
    if (s->taken == s->level_count)
        TETLOD_TRY(code_levels(s, level));
    else if (!follow(s))
        return no_memory(s);
    for (uint32_t page = 0; page < s->page_count; page++)
        TETLOD_TRY(take_page(s, page, frames, io_labels));
    s->taken++;
    return s->taken < s->level_count || !tetlodi_stacks_keep_order(s) ? TETLOD_OK : keep_mesh(s);
}
