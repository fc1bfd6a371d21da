/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: the original. Out: the section KSUM.
 *
 * 1. The tree: each node's box is halved by volume along one axis. Tetrahedra count at their centres, in 256 bins.
 * 2. Each tetrahedron is cut by the boxes of the leaves; volumes, integrals, least and greatest values are added up.
 * 3. Leaves are joined upwards, and become parts of their node's volume and of the component's range. Bounds are
 *    rounded outwards.
 */
#include "src/pipeline/make_box_sums.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/ask/clip.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

struct sum {
    double least, greatest, integral;
};

struct filling {
    const struct tetmesh *mesh;
    struct tetlodi_box_sums *sums;
    struct sum *leaves;   /* [component << depth | leaf] */
    double *volumes;      /* [leaf] */
    /* The tetrahedron that is being cut, and the leaf that it is cut for. */
    const double *corners[4];
    uint32_t tet, leaf;
    double volume;
};

static uint32_t count_components(const struct tetmesh *mesh)
{
    uint32_t count = 0;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        count += mesh->fields[f].components;
    return count;
}

static void set_tet(struct filling *filling, uint32_t tet)
{
    const struct tetmesh *mesh = filling->mesh;
    filling->tet = tet;
    for (size_t c = 0; c < 4; c++)
        filling->corners[c] = mesh->positions + 3 * (size_t)mesh->corners[4 * (size_t)tet + c];
    filling->volume = fabs(tet_volume6(filling->corners[0], filling->corners[1], filling->corners[2],
                                       filling->corners[3])) / 6;
}

/* ---- the tree */

static void find_box(const struct tetmesh *mesh, double box[2][3])
{
    for (int i = 0; i < 3; i++)
        box[0][i] = box[1][i] = mesh->positions[i];
    for (size_t v = 0; v < mesh->vertex_count; v++)
        for (int i = 0; i < 3; i++) {
            box[0][i] = smaller(box[0][i], mesh->positions[3 * v + i]);
            box[1][i] = larger(box[1][i], mesh->positions[3 * v + i]);
        }
}

/* The boxes of all nodes of a depth, from those of the depth before. */
static void set_boxes(const struct tetlodi_box_sums *sums, double (*boxes)[2][3], unsigned depth)
{
    memcpy(boxes[1], sums->box, sizeof boxes[1]);
    for (uint32_t n = 2; n < (uint32_t)2 << depth; n++) {
        unsigned axis = (unsigned)(ilogb(n) - 1) % 3;
        memcpy(boxes[n], boxes[n / 2], sizeof boxes[n]);
        boxes[n][n % 2 ? 0 : 1][axis] = tetlodi_box_split(sums, n / 2, boxes[n / 2][0][axis], boxes[n / 2][1][axis]);
    }
}

/* Adds each tetrahedron's volume to the bin of its centre, along the axis of the depth, of the node that holds it. */
static void fill_bins(struct filling *filling, uint32_t *nodes, unsigned depth, const double (*boxes)[2][3],
                      double (*bins)[BOX_SPLITS])
{
    const unsigned axis = depth % 3, before = (depth + 2) % 3;
    for (uint32_t t = 0; t < filling->mesh->tet_count; t++) {
        double centre[3];
        set_tet(filling, t);
        for (int i = 0; i < 3; i++)
            centre[i] = (filling->corners[0][i] + filling->corners[1][i] + filling->corners[2][i] +
                         filling->corners[3][i]) / 4;
        if (depth)
            nodes[t] = 2 * nodes[t] + (centre[before] >= boxes[2 * nodes[t] + 1][0][before]);
        const double (*box)[3] = boxes[nodes[t]];
        double at = (centre[axis] - box[0][axis]) / (box[1][axis] - box[0][axis]) * BOX_SPLITS;
        int bin = at > 0 ? at < BOX_SPLITS - 1 ? (int)at : BOX_SPLITS - 1 : 0;
        bins[nodes[t]][bin] += filling->volume;
    }
}

/* The first split that has half of the volume before it. */
static uint8_t find_half(const double bins[BOX_SPLITS])
{
    double whole = 0, sum = 0;
    int at = 0;
    for (int i = 0; i < BOX_SPLITS; i++)
        whole += bins[i];
    while (at < BOX_SPLITS - 1 && (sum += bins[at]) < whole / 2)
        at++;
    // the half lies in this bin: the nearer of its two ends
    bool before = sum - whole / 2 > whole / 2 - (sum - bins[at]);
    int split = before ? at : at + 1;
    return (uint8_t)(split < 1 ? 1 : split > BOX_SPLITS - 1 ? BOX_SPLITS - 1 : split);
}

static enum tetlod_status make_tree(struct filling *filling, struct tetlod_error *error)
{
    struct tetlodi_box_sums *sums = filling->sums;
    const uint32_t tets = filling->mesh->tet_count;
    const size_t count = (size_t)2 << sums->depth;
    uint32_t *nodes = array_new(tets, sizeof *nodes);
    double (*boxes)[2][3] = array_new(count, sizeof *boxes), (*bins)[BOX_SPLITS] = array_new(count, sizeof *bins);
    enum tetlod_status status = TETLOD_OK;
    if (!nodes || !boxes || !bins)
        status = tetlodi_fail_nomem(error, "the tree of boxes", tets * sizeof *nodes + count * sizeof *bins);
    for (uint32_t t = 0; t < tets && status == TETLOD_OK; t++)
        nodes[t] = 1;
    for (unsigned depth = 0; depth < sums->depth && status == TETLOD_OK; depth++) {
        memset(bins, 0, count * sizeof *bins);
        set_boxes(sums, boxes, depth);
        fill_bins(filling, nodes, depth, (const double(*)[2][3])boxes, bins);
        for (uint32_t n = (uint32_t)1 << depth; n < (uint32_t)2 << depth; n++)
            sums->splits[n] = find_half(bins[n]);
    }
    free(nodes);
    free(boxes);
    free(bins);
    return status;
}

/* ---- sums of leaves */

static double value_at(const struct filling *filling, const struct point_field *field, uint32_t component, int corner)
{
    const uint32_t vertex = filling->mesh->corners[4 * (size_t)filling->tet + (size_t)corner];
    return field->values[(size_t)field->components * vertex + component];
}

/* Adds what lies in a part of the tetrahedron to the leaf. */
static void add_part(struct filling *filling, const struct clipped *part)
{
    const struct tetmesh *mesh = filling->mesh;
    uint32_t at = 0;
    filling->volumes[filling->leaf] += filling->volume * part->share;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        for (uint32_t c = 0; c < mesh->fields[f].components; c++, at++) {
            struct sum *sum = &filling->leaves[((size_t)at << filling->sums->depth) + filling->leaf];
            double corners[4], values[MAX_CLIP_CORNERS];
            for (int i = 0; i < 4; i++)
                corners[i] = value_at(filling, &mesh->fields[f], c, i);
            for (unsigned v = 0; v < part->count; v++) {
                values[v] = clip_value(corners, part->weights[v]);
                sum->least = smaller(sum->least, values[v]);
                sum->greatest = larger(sum->greatest, values[v]);
            }
            sum->integral += filling->volume * clip_integral(part, values);
        }
}

/* Cuts the tetrahedron by the sides of the leaf's box that pass through it. */
static void add_to_leaf(struct filling *filling, const double box[2][3])
{
    double planes[6][4];
    struct clipped part;
    unsigned count = 0;
    for (int i = 0; i < 6; i++) {
        double *plane = planes[count], least = INFINITY;
        for (int c = 0; c < 4; c++) {
            const double at = filling->corners[c][i / 2];
            plane[c] = i % 2 ? box[1][i / 2] - at : at - box[0][i / 2];
            least = smaller(least, plane[c]);
        }
        count += least < 0;
    }
    clip_tet((const double(*)[4])planes, count, &part);
    add_part(filling, &part);
}

/* Goes down to all leaves that hold a part of the tetrahedron. */
static void add_tet(struct filling *filling, const double (*boxes)[2][3])
{
    const uint32_t leaves = (uint32_t)1 << filling->sums->depth;
    uint32_t open[2 * MAX_BOX_DEPTH + 2] = {1}, count = 1;
    while (count) {
        const uint32_t node = open[--count];
        if (node >= leaves) {
            filling->leaf = node - leaves;
            add_to_leaf(filling, boxes[node]);
            continue;
        }
        const unsigned axis = (unsigned)ilogb(node) % 3;
        const double split = boxes[2 * node][1][axis];
        bool low = false, high = false;
        for (int c = 0; c < 4; c++) {
            low |= filling->corners[c][axis] < split;
            high |= filling->corners[c][axis] > split;
        }
        if (low || !high)
            open[count++] = 2 * node;
        if (high)
            open[count++] = 2 * node + 1;
    }
}

/* ---- figures */

/* The inner nodes' parts of volumes; `volumes` of leaves become those of nodes of every depth on the way. */
static void set_parts(struct tetlodi_box_sums *sums, double *volumes)
{
    for (unsigned depth = sums->depth; depth-- > 0;)
        for (uint32_t i = 0; i < (uint32_t)1 << depth; i++) {
            const double first = volumes[2 * i], whole = first + volumes[2 * i + 1];
            sums->parts[((uint32_t)1 << depth) + i] =
                (uint16_t)(whole > 0 ? lround(first / whole * VOLUME_PARTS) : VOLUME_PARTS / 2);
            volumes[i] = whole;
        }
}

/* The part of the range that is at most (at least) a value: the rounding of a cut is within what is added. */
static uint8_t part_below(const double range[2], double value)
{
    const double slack = 1e-9 * (range[1] / 2 - range[0] / 2);
    int part = BOX_PARTS;
    while (part > 0 && tetlodi_part_of_range(range, (unsigned)part, BOX_PARTS) > value - slack)
        part--;
    return (uint8_t)part;
}

static uint8_t part_above(const double range[2], double value)
{
    const double slack = 1e-9 * (range[1] / 2 - range[0] / 2);
    int part = 0;
    while (part < BOX_PARTS && tetlodi_part_of_range(range, (unsigned)part, BOX_PARTS) < value + slack)
        part++;
    return (uint8_t)part;
}

static void set_row(struct tetlodi_box_sums *sums, uint32_t c, uint32_t i, const struct sum *sum, double volume)
{
    const uint32_t row = sums->firsts[c] + i;
    if (!(sum->least <= sum->greatest)) {
        sums->least[row] = BOX_PARTS;
        sums->greatest[row] = 0;
        return;
    }
    sums->least[row] = part_below(sums->ranges[c], sum->least);
    sums->greatest[row] = part_above(sums->ranges[c], sum->greatest);
    const double low = tetlodi_part_of_range(sums->ranges[c], sums->least[row], BOX_PARTS);
    const double high = tetlodi_part_of_range(sums->ranges[c], sums->greatest[row], BOX_PARTS);
    const double mean = volume > 0 ? sum->integral / volume : sum->least, half = high / 2 - low / 2;
    const double share = half > 0 ? (mean / 2 - low / 2) / half : 0;
    sums->means[row] = (uint16_t)lround(fmin(fmax(share, 0), 1) * VOLUME_PARTS);
}

/* Joins a component's leaves until there are as many as its depth has. */
static void set_component(struct filling *filling, uint32_t c, double *volumes)
{
    struct tetlodi_box_sums *sums = filling->sums;
    struct sum *rows = filling->leaves + ((size_t)c << sums->depth);
    memcpy(volumes, filling->volumes, sizeof *volumes << sums->depth);
    for (unsigned depth = sums->depth; depth-- > sums->depths[c];)
        for (uint32_t i = 0; i < (uint32_t)1 << depth; i++) {
            const struct sum a = rows[2 * i], b = rows[2 * i + 1];
            rows[i] = (struct sum){smaller(a.least, b.least), larger(a.greatest, b.greatest), a.integral + b.integral};
            volumes[i] = volumes[2 * i] + volumes[2 * i + 1];
        }
    for (uint32_t i = 0; i < (uint32_t)1 << sums->depths[c]; i++)
        set_row(sums, c, i, &rows[i], volumes[i]);
}

static void set_ranges(const struct tetmesh *mesh, struct tetlodi_box_sums *sums)
{
    uint32_t at = 0;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        for (uint32_t c = 0; c < mesh->fields[f].components; c++, at++) {
            const double *values = mesh->fields[f].values + c;
            double *range = sums->ranges[at];
            range[0] = range[1] = values[0];
            for (size_t v = 0; v < mesh->vertex_count; v++) {
                range[0] = smaller(range[0], values[mesh->fields[f].components * v]);
                range[1] = larger(range[1], values[mesh->fields[f].components * v]);
            }
        }
}

static enum tetlod_status fill_boxes(struct filling *filling, struct tetlod_error *error)
{
    struct tetlodi_box_sums *sums = filling->sums;
    const size_t leaves = (size_t)1 << sums->depth, rows = leaves * sums->component_count;
    double (*boxes)[2][3] = array_new(2 * leaves, sizeof *boxes), *volumes = array_new(leaves, sizeof *volumes);
    filling->leaves = array_new(rows, sizeof *filling->leaves);
    filling->volumes = array_zero(leaves, sizeof *filling->volumes);
    enum tetlod_status status = TETLOD_OK;
    if (!boxes || !volumes || !filling->leaves || !filling->volumes)
        status = tetlodi_fail_nomem(error, "the sums of boxes", rows * sizeof *filling->leaves);
    for (size_t i = 0; i < rows && status == TETLOD_OK; i++)
        filling->leaves[i] = (struct sum){INFINITY, -INFINITY, 0};
    if (status == TETLOD_OK) {
        set_boxes(sums, boxes, sums->depth);
        for (uint32_t t = 0; t < filling->mesh->tet_count; t++) {
            set_tet(filling, t);
            add_tet(filling, (const double(*)[2][3])boxes);
        }
        for (uint32_t c = 0; c < sums->component_count; c++)
            set_component(filling, c, volumes);
        set_parts(sums, filling->volumes);
        sums->volume = filling->volumes[0];
    }
    free(boxes);
    free(volumes);
    free(filling->leaves);
    free(filling->volumes);
    return status;
}

/* ---- regions */

static int compare_numbers(const void *a, const void *b)
{
    const double one = *(const double *)a, other = *(const double *)b;
    return (one > other) - (one < other);
}

/* The numbers of the regions, rising; more than MAX_REGIONS: *count is 0, and none has sums. */
enum { MAX_REGIONS = 32 };

static void list_regions(const double *regions, uint32_t tets, double out[MAX_REGIONS], uint32_t *count)
{
    *count = 0;
    for (uint32_t t = 0; t < tets && regions; t++) {
        if (bsearch(&regions[t], out, *count, sizeof *out, compare_numbers))
            continue;
        if (*count == MAX_REGIONS || !isfinite(regions[t])) {
            *count = 0;
            return;
        }
        out[(*count)++] = regions[t];
        qsort(out, *count, sizeof *out, compare_numbers);
    }
}

static void add_to_region(const struct filling *filling, uint32_t region)
{
    const struct tetmesh *mesh = filling->mesh;
    struct tetlodi_box_sums *sums = filling->sums;
    uint32_t at = 0;
    sums->regions[region][1] += filling->volume;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        for (uint32_t c = 0; c < mesh->fields[f].components; c++, at++) {
            double *row = sums->region_rows[(size_t)at * sums->region_count + region], sum = 0;
            for (int i = 0; i < 4; i++) {
                const double value = value_at(filling, &mesh->fields[f], c, i);
                row[0] = smaller(row[0], value);
                row[1] = larger(row[1], value);
                sum += value;
            }
            row[2] += filling->volume * sum / 4;
        }
}

static void fill_regions(struct filling *filling, const double *regions, const double *numbers)
{
    struct tetlodi_box_sums *sums = filling->sums;
    for (uint32_t r = 0; r < sums->region_count; r++)
        sums->regions[r][0] = numbers[r];
    for (size_t r = 0; r < (size_t)sums->region_count * sums->component_count; r++) {
        sums->region_rows[r][0] = INFINITY;
        sums->region_rows[r][1] = -INFINITY;
    }
    for (uint32_t t = 0; t < filling->mesh->tet_count && sums->region_count; t++) {
        const double *found = bsearch(&regions[t], numbers, sums->region_count, sizeof *numbers, compare_numbers);
        set_tet(filling, t);
        add_to_region(filling, (uint32_t)(found - numbers));
    }
}

/* ---- the section */

/* 9, 8^3 boxes, or fewer: so that a leaf has some tetrahedra, and a field at most 5 kB here and in SUMS. */
static unsigned depth_for(const struct tetmesh *mesh, uint32_t beside, uint32_t regions, uint8_t *depths)
{
    enum { DEPTH = 9, MIN_TETS = 16, FIELD_BYTES = 5000, ALL_BYTES = 6000 };
    unsigned depth = DEPTH, size;
    while (depth && mesh->tet_count >> depth < MIN_TETS)
        depth--;
    for (;; depth--) {
        uint32_t at = 0;
        size = BOX_SUMS_HEAD + 3 * ((1u << depth) - 1);
        for (uint32_t f = 0; f < mesh->field_count; f++) {
            const uint32_t components = mesh->fields[f].components;
            unsigned own = depth;
            while (own && (uint64_t)components * (beside + 16 + (4u << own) + 24 * regions) > FIELD_BYTES)
                own--;
            memset(depths + at, (int)own, components);
            at += components;
            size += components * (16 + (4u << own));
        }
        if (!depth || size <= ALL_BYTES)
            return depth;
    }
}

static enum tetlod_status fill(struct filling *filling, const double *regions, const double *numbers,
                               struct tetlod_error *error)
{
    set_ranges(filling->mesh, filling->sums);
    enum tetlod_status status = fill_boxes(filling, error);
    if (status == TETLOD_OK)
        fill_regions(filling, regions, numbers);
    else
        tetlodi_box_sums_fini(filling->sums);
    return status;
}

static enum tetlod_status allocate(struct tetlodi_box_sums *out, uint32_t components, unsigned depth,
                                   const uint8_t *depths, uint32_t regions, struct tetlod_error *error)
{
    if (tetlodi_box_sums_allocate(out, components, depth, depths, regions))
        return TETLOD_OK;
    tetlodi_box_sums_fini(out);
    return tetlodi_fail_nomem(error, "the sums of boxes", (uint64_t)components << depth);
}

enum tetlod_status box_sums_make(struct tetlodi_box_sums *out, const struct tetmesh *mesh, const double *regions,
                                 uint32_t beside, struct tetlod_error *error)
{
    const uint32_t components = count_components(mesh);
    struct filling filling = {.mesh = mesh, .sums = out};
    double numbers[MAX_REGIONS];
    uint32_t region_count;
    uint8_t *depths = array_new(components, sizeof *depths);
    *out = (struct tetlodi_box_sums){0};
    if (!depths)
        return tetlodi_fail_nomem(error, "the sums of boxes", components);
    list_regions(regions, mesh->tet_count, numbers, &region_count);
    const unsigned depth = depth_for(mesh, beside, region_count, depths);
    enum tetlod_status status = allocate(out, components, depth, depths, region_count, error);
    free(depths);
    TETLOD_TRY(status);
    find_box(mesh, out->box);
    status = make_tree(&filling, error);
    if (status == TETLOD_OK)
        return fill(&filling, regions, numbers, error);
    tetlodi_box_sums_fini(out);
    return status;
}

enum tetlod_status box_sums_like(struct tetlodi_box_sums *out, const struct tetlodi_box_sums *like,
                                 const struct tetmesh *mesh, const double *regions, struct tetlod_error *error)
{
    struct filling filling = {.mesh = mesh, .sums = out};
    double numbers[MAX_REGIONS];
    uint32_t region_count;
    list_regions(regions, mesh->tet_count, numbers, &region_count);
    TETLOD_TRY(allocate(out, like->component_count, like->depth, like->depths, region_count, error));
    memcpy(out->box, like->box, sizeof out->box);
    memcpy(out->splits, like->splits, sizeof *out->splits << like->depth);
    return fill(&filling, regions, numbers, error);
}
