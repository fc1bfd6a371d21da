/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Each slot is at a level of its own. A slot lives if its parent lives and is at the level at which the slot arrived,
 * or a finer one; so any levels of slots give a set of living vertices that is closed under ancestors. Splitting a
 * vertex moves its slot to the level at which its next child arrives. Levels only rise, so that repair ends, at the
 * latest with the fine level itself.
 *
 * Slots have places: those of the coarse level one after the other, each followed by its descendants, children that
 * arrive later first. So what stands for a living slot lies in one piece, whatever the levels are: the slot, then the
 * children that have not been split from it. A split only ends the piece sooner. A round of repair looks at what was
 * split and at nothing else.
 */
#include "src/stream/region.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/stream/forest_data.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* Numbers by another number: those of i are numbers[first[i]] .. numbers[first[i + 1] - 1], in ascending order. */
struct lists {
    uint32_t *first, *numbers;
};

/* Of the table of faces. */
struct face {
    uint32_t corners[3], tets;
};

/* A tetrahedron with four different corners. */
struct cell {
    uint32_t tet, slots[4];
};

/* What is too little to be counted one by one: names, descriptions. */
enum { SMALL_BYTES = 1 << 14 };

struct cut {
    const struct forest *forest;
    const struct region *region;
    struct room *room;
    const struct stage *stage;
    uint32_t slots, coarse_slots, fine_tets;
    uint32_t *fine_of;     /* [slots of the stage] the slot of the fine level that it stands for; NULL: itself */
    uint32_t *arrival;     /* [slots] level */
    struct lists children; /* of a slot, that are not in the coarse level: in order of arrival */
    uint32_t *place, *order; /* [slots] of a slot; the slot at a place */
    uint32_t *family;      /* [slots] how many it and its descendants are */
    /* of the fine level, one for each of their corners, by the corners' places; NULL while nothing is split */
    uint32_t *tets;
    uint32_t *tets_end;    /* [slots] where in `tets` those of a slot end */
    uint32_t *round_of;    /* [fine_tets] the round in which a tetrahedron became a cell; 0 the start */
    uint32_t *level;       /* [slots] */
    uint32_t *standing;    /* [slots] the living slot that it stands for */
    double *positions;     /* [3 * slots] of living slots, at their levels */
    unsigned char *done;   /* [slots] split in this round */
    uint32_t *split, *born; /* [slots] those slots; those that came to live by that */
    size_t split_count, born_count;
    uint32_t *renewed;     /* tetrahedra that have a corner that was split */
    size_t renewed_count, renewed_capacity;
    struct cell *cells;
    size_t count, capacity, fresh; /* from `fresh` on they are of this round */
    uint32_t rounds;
};

/* More than the faces of so many tetrahedra. */
static size_t face_places(size_t tets)
{
    return 6 * tets + 64;
}

static void lists_fini(struct lists *lists)
{
    free(lists->first);
    free(lists->numbers);
}

static void cut_fini(struct cut *cut)
{
    lists_fini(&cut->children);
    free(cut->tets);
    free(cut->tets_end);
    free(cut->place);
    free(cut->order);
    free(cut->family);
    free(cut->round_of);
    free(cut->fine_of);
    free(cut->arrival);
    free(cut->level);
    free(cut->standing);
    free(cut->positions);
    free(cut->done);
    free(cut->split);
    free(cut->born);
    free(cut->renewed);
    free(cut->cells);
}

/* What is there from the start to the end: the arrays of allocate(), and the children. */
static uint64_t fixed_bytes(uint64_t slots, uint64_t coarse_slots, uint64_t stage_slots, uint64_t tets)
{
    uint64_t of_slot = 10 * sizeof(uint32_t) + 3 * sizeof(double) + 1;
    return slots * of_slot + (slots - coarse_slots + (stage_slots > slots ? stage_slots : 0) + tets) * sizeof(uint32_t);
}

/* A mesh and the numbers of its tetrahedra. */
static uint64_t mesh_bytes(const struct tetlod_info *info, uint64_t vertices, uint64_t tets)
{
    uint64_t components = 3;
    for (uint32_t f = 0; f < info->field_count; f++)
        components += info->fields[f].components;
    return vertices * components * sizeof(double) + tets * (5 * sizeof(uint32_t) + sizeof(double));
}

/* Every list of tetrahedra at its longest, beside the larger of what is there for a while. */
uint64_t region_most_bytes(const struct tetlod_info *info, const struct region *region)
{
    const struct tetlod_level *fine = &info->levels[region->fine];
    uint64_t cell = sizeof(struct cell), for_a_while = face_places(fine->tets) * sizeof(struct face);
    uint64_t mesh = mesh_bytes(info, fine->vertices, fine->tets);
    return SMALL_BYTES + fixed_bytes(fine->vertices, 0, info->vertices, fine->tets) +
           fine->tets * (5 * sizeof(uint32_t) + 2 * cell) + (for_a_while > mesh ? for_a_while : mesh) +
           fine->vertices * (uint64_t)(region->box_count + 1);
}

/* ---- slots ---- */

/* The counts in first[i + 1] become places, and the numbers get room. */
static bool make_lists(struct lists *lists, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        lists->first[i + 1] += lists->first[i];
    lists->numbers = array_new(lists->first[count], sizeof *lists->numbers);
    return lists->numbers != NULL;
}

/* After each list was filled by first[i]++. */
static void end_lists(struct lists *lists, uint32_t count)
{
    for (uint32_t i = count; i > 0; i--)
        lists->first[i] = lists->first[i - 1];
    lists->first[0] = 0;
}

static enum tetlod_status allocate(struct cut *cut, struct tetlod_error *error)
{
    size_t slots = cut->slots;
    bool finest = cut->slots == cut->stage->vertices;
    const uint64_t fixed = fixed_bytes(slots, cut->coarse_slots, cut->stage->vertices, cut->fine_tets);
    TETLOD_TRY(room_take(cut->room, SMALL_BYTES + fixed, error));
    cut->fine_of = finest ? NULL : array_new(cut->stage->vertices, sizeof *cut->fine_of);
    cut->arrival = array_new(slots, sizeof *cut->arrival);
    cut->place = array_new(slots, sizeof *cut->place);
    cut->order = array_new(slots, sizeof *cut->order);
    cut->family = array_new(slots, sizeof *cut->family);
    cut->level = array_new(slots, sizeof *cut->level);
    cut->standing = array_new(slots, sizeof *cut->standing);
    cut->positions = array_new(slots, 3 * sizeof *cut->positions);
    cut->done = array_zero(slots, 1);
    cut->split = array_new(slots, sizeof *cut->split);
    cut->born = array_new(slots, sizeof *cut->born);
    cut->round_of = array_zero(cut->fine_tets, sizeof *cut->round_of);
    cut->children.first = array_zero(slots + 1, sizeof *cut->children.first);
    cut->tets_end = array_zero(slots, sizeof *cut->tets_end);
    if ((finest || cut->fine_of) && cut->arrival && cut->place && cut->order && cut->family && cut->level &&
        cut->standing && cut->positions &&
        cut->done && cut->split && cut->born && cut->round_of && cut->children.first && cut->tets_end)
        return TETLOD_OK;
    return tetlodi_fail_nomem(error, "a region", slots * (uint64_t)70);
}

static uint32_t fine_slot(const struct cut *cut, uint32_t slot)
{
    return cut->fine_of ? cut->fine_of[slot] : slot;
}

/* Children, families, and what every slot stands for at first: its root. */
static bool list_slots(struct cut *cut)
{
    const uint32_t *parents = cut->forest->parents;
    for (uint32_t v = 0; cut->fine_of && v < cut->stage->vertices; v++)
        cut->fine_of[v] = v < cut->slots ? v : cut->fine_of[parents[v]];
    for (uint32_t v = 0; v < cut->slots; v++) {
        cut->standing[v] = v < cut->coarse_slots ? v : cut->standing[parents[v]];
        cut->family[v] = 1;
        if (v >= cut->coarse_slots)
            cut->children.first[parents[v] + 1]++;
    }
    if (!make_lists(&cut->children, cut->slots))
        return false;
    for (uint32_t v = cut->coarse_slots; v < cut->slots; v++)
        cut->children.numbers[cut->children.first[parents[v]]++] = v;
    end_lists(&cut->children, cut->slots);
    for (uint32_t v = cut->slots; v-- > cut->coarse_slots;)
        cut->family[parents[v]] += cut->family[v];
    return true;
}

/* Parents come before their children by number, too. */
static void place_slots(struct cut *cut)
{
    uint32_t next = 0;
    for (uint32_t v = 0; v < cut->slots; v++) {
        if (v < cut->coarse_slots) {
            cut->place[v] = next;
            next += cut->family[v];
        }
        cut->order[cut->place[v]] = v;
        uint32_t at = cut->place[v] + 1;
        for (uint32_t i = cut->children.first[v + 1]; i-- > cut->children.first[v];) {
            cut->place[cut->children.numbers[i]] = at;
            at += cut->family[cut->children.numbers[i]];
        }
    }
}

/* Lists the tetrahedra at each slot, by the places of slots. */
static enum tetlod_status list_tets(struct cut *cut, struct tetlod_error *error)
{
    const uint32_t *corners = cut->stage->corners;
    const size_t count = 4 * (size_t)cut->fine_tets;
    uint32_t next = 0;
    TETLOD_TRY(room_take(cut->room, count * sizeof *cut->tets, error));
    cut->tets = array_new(count, sizeof *cut->tets);
    if (!cut->tets)
        return tetlodi_fail_nomem(error, "a region", count * sizeof *cut->tets);
    for (size_t c = 0; c < count; c++)
        cut->tets_end[fine_slot(cut, corners[c])]++;
    for (uint32_t place = 0; place < cut->slots; place++) {
        uint32_t *end = &cut->tets_end[cut->order[place]], here = *end;
        *end = next;
        next += here;
    }
    for (size_t c = 0; c < count; c++)
        cut->tets[cut->tets_end[fine_slot(cut, corners[c])]++] = (uint32_t)(c / 4);
    return TETLOD_OK;
}

static void corners_of(const struct cut *cut, size_t tet, uint32_t out[4])
{
    const uint32_t *corners = cut->stage->corners + 4 * tet;
    for (int c = 0; c < 4; c++)
        out[c] = fine_slot(cut, corners[c]);
}

/* The level at which a slot at some level splits next; above the fine level if it does not. */
static uint32_t next_split(const struct cut *cut, uint32_t v)
{
    for (uint32_t i = cut->children.first[v]; i < cut->children.first[v + 1]; i++)
        if (cut->arrival[cut->children.numbers[i]] > cut->level[v])
            return cut->arrival[cut->children.numbers[i]];
    return cut->region->fine + 1;
}

/* A slot that does not split any more is at the fine level: its values may be others there. */
static void settle(struct cut *cut, uint32_t v)
{
    if (next_split(cut, v) > cut->region->fine)
        cut->level[v] = cut->region->fine;
}

/* What a slot holds at a level. */
static uint32_t version_at(const struct cut *cut, uint32_t v, uint32_t level)
{
    uint32_t version = cut->stage->newest[v];
    while (cut->forest->versions[version].level > level)
        version = cut->forest->versions[version].previous;
    return version;
}

static void start_levels(struct cut *cut)
{
    const struct tetlod_level *levels = tetlod_info(cut->forest->file)->levels;
    for (uint32_t v = 0, k = 0; v < cut->slots; v++) {
        while (v >= levels[k].vertices)
            k++;
        cut->arrival[v] = k;
        cut->level[v] = k > cut->region->coarse ? k : cut->region->coarse;
    }
    for (uint32_t v = cut->coarse_slots; v < cut->slots; v++)
        settle(cut, v);
}

/* Is it as it is in the fine level? */
static bool is_fine(const struct cut *cut, uint32_t v)
{
    uint32_t fine = cut->region->fine, level = cut->level[v];
    return level == fine || (next_split(cut, v) > fine && version_at(cut, v, level) == version_at(cut, v, fine));
}

/* Is it as it is in the coarse level? */
static bool is_coarse(const struct cut *cut, uint32_t v)
{
    uint32_t coarse = cut->region->coarse, first = cut->children.first[v];
    if (v >= cut->coarse_slots || cut->level[v] == coarse)
        return v < cut->coarse_slots;
    bool split = first < cut->children.first[v + 1] && cut->arrival[cut->children.numbers[first]] <= cut->level[v];
    return !split && version_at(cut, v, cut->level[v]) == version_at(cut, v, coarse);
}

static void raise(struct cut *cut, uint32_t v, uint32_t level)
{
    cut->level[v] = level;
    settle(cut, v);
    if (!cut->done[v])
        cut->split[cut->split_count++] = v;
    cut->done[v] = 1;
}

static const unsigned char *row_at(const struct cut *cut, uint32_t v, uint32_t level)
{
    return cut->forest->rows + version_at(cut, v, level) * cut->forest->row_size;
}

static void unpack(const struct column *column, const unsigned char *row, double *out)
{
    row += column->offset;
    if (column->type == TETLOD_FLOAT64)
        memcpy(out, row, 8 * column->components);
    else
        for (size_t i = 0; i < column->components; i++) {
            float value;
            memcpy(&value, row + 4 * i, 4);
            out[i] = value;
        }
}

static void take_position(struct cut *cut, uint32_t v, uint32_t level)
{
    unpack(&cut->forest->columns[0], row_at(cut, v, level), cut->positions + 3 * (size_t)v);
}

/* ---- boxes ---- */

/* The corners' least and greatest along an axis. */
static void span_along(const double axis[3], const double *const corners[4], const double middle[3], double *low,
                       double *high)
{
    *low = INFINITY;
    *high = -INFINITY;
    for (int c = 0; c < 4; c++) {
        double at = 0;
        for (int i = 0; i < 3; i++)
            at += axis[i] * (corners[c][i] - middle[i]);
        *low = smaller(*low, at);
        *high = larger(*high, at);
    }
}

/* Does a plane across the axis separate them, and not only just? */
static bool separates(const double axis[3], const double *const corners[4], const double middle[3],
                      const double half[3])
{
    double low, high, reach = 0;
    span_along(axis, corners, middle, &low, &high);
    for (int i = 0; i < 3; i++)
        reach += fabs(axis[i]) * half[i];
    double slack = 1e-9 * (reach + fabs(low) + fabs(high));
    return low > reach + slack || high < -reach - slack;
}

bool region_meets(const double *const corners[4], const struct region_box *box)
{
    double middle[3], half[3], edges[6][3];
    for (int i = 0; i < 3; i++) {
        middle[i] = box->low[i] / 2 + box->high[i] / 2;
        half[i] = box->high[i] / 2 - box->low[i] / 2;
    }
    for (int i = 0; i < 3; i++)
        if (separates((const double[3]){i == 0, i == 1, i == 2}, corners, middle, half))
            return false;
    for (int e = 0; e < 6; e++)
        for (int i = 0; i < 3; i++)
            edges[e][i] = corners[tet_edges[e][1]][i] - corners[tet_edges[e][0]][i];
    for (int e = 0; e < 6; e++)
        for (int i = 0; i < 3; i++) { // across the edge and an edge of the box
            int j = (i + 1) % 3, k = (i + 2) % 3;
            double axis[3] = {0, 0, 0};
            axis[j] = -edges[e][k];
            axis[k] = edges[e][j];
            if (separates(axis, corners, middle, half))
                return false;
        }
    for (int f = 0; f < 4; f++) { // across a face
        const double *a = corners[tet_faces[f][0]], *b = corners[tet_faces[f][1]], *c = corners[tet_faces[f][2]];
        double axis[3];
        for (int i = 0; i < 3; i++) {
            int j = (i + 1) % 3, k = (i + 2) % 3;
            axis[i] = (b[j] - a[j]) * (c[k] - a[k]) - (b[k] - a[k]) * (c[j] - a[j]);
        }
        if (separates(axis, corners, middle, half))
            return false;
    }
    return true;
}

/* On which sides of a box's planes a point is outside: six bits. */
static unsigned outside(const double *p, const struct region_box *box)
{
    unsigned sides = 0;
    for (int i = 0; i < 3; i++)
        sides |= (unsigned)(p[i] < box->low[i]) << 2 * i | (unsigned)(p[i] > box->high[i]) << (2 * i + 1);
    return sides;
}

static bool meets_any(const struct cut *cut, const uint32_t *slots)
{
    const double *corners[4];
    for (int c = 0; c < 4; c++)
        corners[c] = cut->positions + 3 * (size_t)slots[c];
    for (size_t b = 0; b < cut->region->box_count; b++) {
        const struct region_box *box = &cut->region->boxes[b];
        unsigned all = outside(corners[0], box) & outside(corners[1], box) & outside(corners[2],
                                                                                     box) & outside(corners[3], box);
        if (!all && region_meets(corners, box))
            return true;
    }
    return false;
}

/* ---- the first cut: the fine tetrahedra that meet a box ---- */

/* Marks the corners of tetrahedra that meet a box. Most do not: their corners are all outside on one side of each
 * box. */
static void want_tets(struct cut *cut, unsigned char *sides, unsigned char *wanted)
{
    size_t boxes = cut->region->box_count;
    for (uint32_t v = 0; v < cut->slots; v++) {
        take_position(cut, v, cut->region->fine);
        for (size_t b = 0; b < boxes; b++)
            sides[v * boxes + b] = (unsigned char)outside(cut->positions + 3 * (size_t)v, &cut->region->boxes[b]);
    }
    for (size_t t = 0; t < cut->fine_tets; t++) {
        uint32_t slots[4];
        bool near = false;
        corners_of(cut, t, slots);
        for (size_t b = 0; b < boxes && !near; b++)
            near = !(sides[slots[0] * boxes + b] & sides[slots[1] * boxes + b] & sides[slots[2] * boxes + b] &
                     sides[slots[3] * boxes + b]);
        for (int c = 0; c < 4 && near && (c || meets_any(cut, slots)); c++)
            wanted[slots[c]] = 2;
    }
}

/* Makes what is wanted live, at the fine level: from the finest up, because it needs its ancestors split. */
static void raise_wanted(struct cut *cut, unsigned char *wanted)
{
    for (uint32_t v = cut->slots; v-- > 0;) {
        if (wanted[v])
            raise(cut, v, wanted[v] == 2 ? cut->region->fine : cut->level[v]);
        if (!wanted[v] || v < cut->coarse_slots)
            continue;
        uint32_t parent = cut->forest->parents[v];
        wanted[parent] = wanted[parent] ? wanted[parent] : 1;
        if (cut->level[parent] < cut->arrival[v])
            cut->level[parent] = cut->arrival[v];
    }
}

static enum tetlod_status raise_boxes(struct cut *cut, struct tetlod_error *error)
{
    const uint64_t held = room_held(cut->room);
    TETLOD_TRY(room_take(cut->room, (uint64_t)cut->slots * (cut->region->box_count + 1), error));
    unsigned char *sides = array_new(cut->slots, cut->region->box_count);
    unsigned char *wanted = array_zero(cut->slots, 1);
    bool there = sides && wanted;
    if (there) {
        want_tets(cut, sides, wanted);
        raise_wanted(cut, wanted);
        for (uint32_t v = 0; v < cut->coarse_slots; v++)
            take_position(cut, v, cut->level[v]);
    }
    free(sides);
    free(wanted);
    room_back_to(cut->room, held);
    return there ? TETLOD_OK : tetlodi_fail_nomem(error, "a region",
                                                  (uint64_t)cut->slots * (cut->region->box_count + 1));
}

/* ---- the mesh of a cut ---- */

/* Adds a tetrahedron if its corners stand for four different slots, once in a round. */
static enum tetlod_status add_cell(struct cut *cut, uint32_t tet, struct tetlod_error *error)
{
    uint32_t slots[4];
    corners_of(cut, tet, slots);
    for (int c = 0; c < 4; c++)
        slots[c] = cut->standing[slots[c]];
    if (slots[0] == slots[1] || slots[0] == slots[2] || slots[0] == slots[3] || slots[1] == slots[2] ||
        slots[1] == slots[3] ||
        slots[2] == slots[3] || (cut->rounds && cut->round_of[tet] == cut->rounds))
        return TETLOD_OK;
    TETLOD_TRY(room_reserve(cut->room, (void **)&cut->cells, &cut->capacity, cut->count + 1, cut->fine_tets,
                            sizeof *cut->cells, error));
    cut->round_of[tet] = cut->rounds;
    cut->cells[cut->count++] = (struct cell){tet, {slots[0], slots[1], slots[2], slots[3]}};
    return TETLOD_OK;
}

static bool lives(const struct cut *cut, uint32_t v)
{
    return cut->standing[v] == v;
}

/* Where the piece of places ends that stands for a living slot. */
static uint32_t piece_end(const struct cut *cut, uint32_t v)
{
    for (uint32_t i = cut->children.first[v + 1]; i-- > cut->children.first[v];)
        if (cut->arrival[cut->children.numbers[i]] <= cut->level[v])
            return cut->place[cut->children.numbers[i]];
    return cut->place[v] + cut->family[v];
}

/* A living slot takes its position; the children that were split from it come to live. */
static void bear_children(struct cut *cut, uint32_t v)
{
    take_position(cut, v, cut->level[v]);
    for (uint32_t i = cut->children.first[v]; i < cut->children.first[v + 1]; i++) {
        uint32_t child = cut->children.numbers[i];
        if (cut->arrival[child] > cut->level[v])
            break;
        if (lives(cut, child))
            continue;
        for (uint32_t place = cut->place[child], end = piece_end(cut, child); place < end; place++)
            cut->standing[cut->order[place]] = child;
        cut->born[cut->born_count++] = child;
    }
}

/* Takes out the tetrahedra that have a corner that was split. */
static enum tetlod_status take_renewed(struct cut *cut, struct tetlod_error *error)
{
    size_t kept = 0;
    cut->renewed_count = 0;
    TETLOD_TRY(room_reserve(cut->room, (void **)&cut->renewed, &cut->renewed_capacity, cut->count, cut->fine_tets,
                            sizeof *cut->renewed, error));
    for (size_t i = 0; i < cut->count; i++) {
        const uint32_t *slots = cut->cells[i].slots;
        if (cut->done[slots[0]] | cut->done[slots[1]] | cut->done[slots[2]] | cut->done[slots[3]])
            cut->renewed[cut->renewed_count++] = cut->cells[i].tet;
        else
            cut->cells[kept++] = cut->cells[i];
    }
    cut->count = cut->fresh = kept;
    return TETLOD_OK;
}

/* A tetrahedron that was not there has a corner that stands for a slot that was not living. */
static enum tetlod_status add_born(struct cut *cut, uint32_t v, struct tetlod_error *error)
{
    const uint32_t place = cut->place[v], last = cut->tets_end[cut->order[piece_end(cut, v) - 1]];
    for (uint32_t i = place ? cut->tets_end[cut->order[place - 1]] : 0; i < last; i++)
        TETLOD_TRY(add_cell(cut, cut->tets[i], error));
    return TETLOD_OK;
}

/* Takes up what was split. */
static enum tetlod_status renew(struct cut *cut, struct tetlod_error *error)
{
    if (!cut->split_count)
        return TETLOD_OK;
    if (!cut->tets)
        TETLOD_TRY(list_tets(cut, error));
    TETLOD_TRY(take_renewed(cut, error));
    for (size_t i = 0; i < cut->split_count; i++)
        if (lives(cut, cut->split[i]))
            bear_children(cut, cut->split[i]);
    for (size_t i = 0; i < cut->born_count; i++)
        bear_children(cut, cut->born[i]);
    for (size_t i = 0; i < cut->renewed_count; i++)
        TETLOD_TRY(add_cell(cut, cut->renewed[i], error));
    for (size_t i = 0; i < cut->born_count; i++)
        TETLOD_TRY(add_born(cut, cut->born[i], error));
    for (size_t i = 0; i < cut->split_count; i++)
        cut->done[cut->split[i]] = 0;
    cut->split_count = cut->born_count = 0;
    return TETLOD_OK;
}

static enum region_part part_of(const struct cut *cut, const uint32_t *slots)
{
    bool fine = true, coarse = true;
    for (int c = 0; c < 4; c++) {
        fine &= is_fine(cut, slots[c]);
        coarse &= is_coarse(cut, slots[c]);
    }
    return fine ? REGION_FINE : coarse ? REGION_COARSE : REGION_TRANSITION;
}

/* ---- repair ---- */

/* Splits the corner that was contracted last, which is the one that splits first, if it was not split in this round
 * already. False if none splits. */
static bool split_one(struct cut *cut, const uint32_t *slots)
{
    uint32_t best = TETLOD_NONE, least = cut->region->fine + 1;
    for (int c = 0; c < 4; c++) {
        uint32_t next = cut->done[slots[c]] ? cut->level[slots[c]] : next_split(cut, slots[c]);
        if (next < least || (next == least && best != TETLOD_NONE && slots[c] < best)) {
            least = next;
            best = slots[c];
        }
    }
    if (best != TETLOD_NONE && !cut->done[best])
        raise(cut, best, least);
    return best != TETLOD_NONE;
}

static bool split_all(struct cut *cut, const uint32_t *slots)
{
    bool any = false;
    for (int c = 0; c < 4; c++)
        if (!is_fine(cut, slots[c])) {
            raise(cut, slots[c], cut->region->fine);
            any = true;
        }
    return any;
}

/* Whether a tetrahedron is degenerate, or turned otherwise than in the fine level. */
static bool is_flipped(const struct cut *cut, const struct cell *cell)
{
    uint32_t fine[4];
    double corners[4][3];
    const double *p[4];
    for (int c = 0; c < 4; c++)
        p[c] = cut->positions + 3 * (size_t)cell->slots[c];
    int orientation = tet_orientation(p[0], p[1], p[2], p[3]);
    corners_of(cut, cell->tet, fine);
    for (int c = 0; c < 4; c++)
        unpack(&cut->forest->columns[0], row_at(cut, fine[c], cut->region->fine), corners[c]);
    return orientation == 0 || orientation == -tet_orientation(corners[0], corners[1], corners[2], corners[3]);
}

/* Splits where a tetrahedron of the transition is flipped, or one that is not fine meets a box. */
static bool repair_tets(struct cut *cut)
{
    bool any = false;
    for (size_t i = cut->fresh; i < cut->count; i++) {
        const uint32_t *slots = cut->cells[i].slots;
        enum region_part part = part_of(cut, slots);
        if (part == REGION_TRANSITION && is_flipped(cut, &cut->cells[i]))
            any |= split_one(cut, slots);
        else if (part != REGION_FINE && meets_any(cut, slots))
            any |= split_all(cut, slots);
    }
    return any;
}

static struct face *find_face(struct face *table, size_t places, const uint32_t corners[3])
{
    uint64_t hash =
        corners[0] * 0x9e3779b97f4a7c15u ^ corners[1] * 0xc2b2ae3d27d4eb4fu ^ corners[2] * 0x165667b19e3779f9u;
    size_t place = (size_t)((hash ^ hash >> 29) % places);
    while (table[place].tets && memcmp(table[place].corners, corners, sizeof table[place].corners) != 0)
        place = place + 1 < places ? place + 1 : 0;
    return &table[place];
}

static void face_of(const uint32_t *slots, int f, uint32_t out[3])
{
    for (int c = 0; c < 3; c++)
        out[c] = slots[tet_faces[f][c]];
    sort_three(out);
}

/* Splits where three or more tetrahedra share a face: two of them, at least, are in one place. */
static enum tetlod_status repair_faces(struct cut *cut, bool *any, struct tetlod_error *error)
{
    const size_t places = face_places(cut->count);
    const uint64_t held = room_held(cut->room);
    uint32_t corners[3];
    TETLOD_TRY(room_take(cut->room, places * sizeof(struct face), error));
    struct face *table = array_zero(places, sizeof *table);
    if (!table)
        return tetlodi_fail_nomem(error, "a region", places * sizeof *table);
    for (size_t i = 0; i < 4 * cut->count; i++) {
        face_of(cut->cells[i / 4].slots, (int)(i % 4), corners);
        struct face *face = find_face(table, places, corners);
        memcpy(face->corners, corners, sizeof corners);
        face->tets++;
    }
    for (size_t i = 0; i < 4 * cut->count; i++) {
        face_of(cut->cells[i / 4].slots, (int)(i % 4), corners);
        if (find_face(table, places, corners)->tets > 2 && part_of(cut, cut->cells[i / 4].slots) == REGION_TRANSITION)
            *any |= split_one(cut, cut->cells[i / 4].slots);
    }
    free(table);
    room_back_to(cut->room, held);
    return TETLOD_OK;
}

static enum tetlod_status repair(struct cut *cut, struct tetlod_error *error)
{
    for (bool any = true; any;) {
        cut->rounds++;
        TETLOD_TRY(renew(cut, error));
        any = repair_tets(cut);
        if (!any)
            TETLOD_TRY(repair_faces(cut, &any, error));
    }
    return TETLOD_OK;
}

/* ---- the answer ---- */

static int by_tet(const void *a, const void *b)
{
    uint32_t x = ((const struct cell *)a)->tet, y = ((const struct cell *)b)->tet;
    return (x > y) - (x < y);
}

/* Numbers the slots that tetrahedra use, in order; `standing` becomes their numbers. */
static uint32_t number_vertices(struct cut *cut)
{
    uint32_t count = 0;
    for (uint32_t v = 0; v < cut->slots; v++)
        cut->standing[v] = 0;
    for (size_t i = 0; i < 4 * cut->count; i++)
        cut->standing[cut->cells[i / 4].slots[i % 4]] = 1;
    for (uint32_t v = 0; v < cut->slots; v++)
        cut->standing[v] = cut->standing[v] ? count++ : TETLOD_NONE;
    return count;
}

static enum tetlod_status allocate_mesh(const struct cut *cut, uint32_t vertices, struct tetmesh *out,
                                        struct tetlod_error *error)
{
    const struct forest *forest = cut->forest;
    *out = (struct tetmesh){.vertex_count = vertices, .tet_count = (uint32_t)cut->count,
                            .position_type = forest->columns[0].type};
    TETLOD_TRY(room_take(cut->room, mesh_bytes(forest_info(forest), vertices, cut->count), error));
    out->positions = array_new(vertices, 3 * sizeof *out->positions);
    out->corners = array_new(cut->count, 4 * sizeof *out->corners);
    if (!out->positions || !out->corners)
        return tetlodi_fail_nomem(error, "a region", cut->count * 16);
    for (uint32_t c = 1; c < forest->column_count; c++)
        TETLOD_TRY(tetmesh_add_field(out, forest->columns[c].name, forest->columns[c].components,
                                     forest->columns[c].type, error));
    TETLOD_TRY(tetmesh_add_cell_field(out, REGION_FIELD, 1, TETLOD_FLOAT32, cut->count, error));
    out->cell_fields[0].is_integer = true;
    return TETLOD_OK;
}

static void fill_mesh(const struct cut *cut, struct tetmesh *out, uint32_t *tets, struct region_counts *counts)
{
    const struct forest *forest = cut->forest;
    for (uint32_t v = 0; v < cut->slots; v++) {
        uint32_t to = cut->standing[v];
        if (to == TETLOD_NONE)
            continue;
        const unsigned char *row = row_at(cut, v, cut->level[v]);
        for (uint32_t c = 0; c < forest->column_count; c++)
            unpack(&forest->columns[c], row,
                   (c ? out->fields[c - 1].values : out->positions) + (size_t)to * forest->columns[c].components);
    }
    for (size_t t = 0; t < cut->count; t++) {
        const uint32_t *slots = cut->cells[t].slots;
        enum region_part part = part_of(cut, slots);
        out->cell_fields[0].values[t] = (double)part;
        tets[t] = cut->cells[t].tet;
        counts->tets[part]++;
        for (size_t c = 0; c < 4; c++)
            out->corners[4 * t + c] = cut->standing[slots[c]];
    }
}

/* The coarse level, whose tetrahedra are the first ones. */
static enum tetlod_status start(struct cut *cut, struct tetlod_error *error)
{
    TETLOD_TRY(allocate(cut, error));
    if (!list_slots(cut))
        return tetlodi_fail_nomem(error, "a region", cut->fine_tets * (uint64_t)16);
    start_levels(cut);
    place_slots(cut);
    for (uint32_t v = 0; v < cut->coarse_slots; v++)
        take_position(cut, v, cut->region->coarse);
    const uint32_t tets = tetlod_info(cut->forest->file)->levels[cut->region->coarse].tets;
    TETLOD_TRY(room_reserve(cut->room, (void **)&cut->cells, &cut->capacity, tets, tets, sizeof *cut->cells, error));
    for (uint32_t t = 0; t < tets; t++)
        TETLOD_TRY(add_cell(cut, t, error));
    return TETLOD_OK;
}

enum tetlod_status region_mesh(const struct forest *forest, const struct region *region, struct room *room,
                               struct tetmesh *out, uint32_t **tets, struct region_counts *counts,
                               struct tetlod_error *error)
{
    const struct tetlod_level *levels = tetlod_info(forest->file)->levels;
    const uint64_t held = room_held(room);
    struct cut cut = {.forest = forest, .region = region, .room = room, .stage = forest->stages,
                      .slots = levels[region->fine].vertices,
                      .coarse_slots = levels[region->coarse].vertices, .fine_tets = levels[region->fine].tets};
    assert(region->coarse < region->fine && region->fine < forest_levels(forest));
    while (cut.stage->level < region->fine)
        cut.stage++;
    *out = (struct tetmesh){0};
    *tets = NULL;
    *counts = (struct region_counts){{0}, 0};
    enum tetlod_status status = start(&cut, error);
    if (status == TETLOD_OK)
        status = raise_boxes(&cut, error);
    if (status == TETLOD_OK)
        status = repair(&cut, error);
    if (status == TETLOD_OK && cut.count)
        qsort(cut.cells, cut.count, sizeof *cut.cells, by_tet);
    if (status == TETLOD_OK)
        status = allocate_mesh(&cut, number_vertices(&cut), out, error);
    if (status == TETLOD_OK && !(*tets = array_new(cut.count, sizeof **tets)))
        status = tetlodi_fail_nomem(error, "a region", cut.count * sizeof **tets);
    if (status == TETLOD_OK)
        fill_mesh(&cut, out, *tets, counts);
    if (status == TETLOD_OK)
        tetmesh_set_origin(out, forest_info(forest), region->coarse);
    else
        tetmesh_fini(out);
    counts->rounds = cut.rounds;
    room_back_to(room, held + SMALL_BYTES + mesh_bytes(forest_info(forest), out->vertex_count, out->tet_count));
    cut_fini(&cut);
    return status;
}
