/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/series_topologies.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/displacement.h"
#include "src/mesh/tet_geom.h"
#include "src/pipeline/build.h"
#include "src/util/array.h"

struct scan {
    struct series_topologies *out;
    struct series_input *input;
    const char *const *names;
    uint32_t name_count;
    struct tetmesh first; /* of the current group */
    uint32_t *components; /* [name] */
    struct tetlod_error *error;
};

static void find_box(const struct tetmesh *mesh, double box[2][3])
{
    for (int i = 0; i < 3; i++) {
        box[0][i] = INFINITY;
        box[1][i] = -INFINITY;
        for (size_t v = 0; v < mesh->vertex_count; v++) {
            box[0][i] = smaller(box[0][i], mesh->positions[3 * v + (size_t)i]);
            box[1][i] = larger(box[1][i], mesh->positions[3 * v + (size_t)i]);
        }
    }
}

/* Meshes that are nowhere near each other are not of one series. */
static bool boxes_meet(const struct tetmesh *a, const struct tetmesh *b)
{
    double of_a[2][3], of_b[2][3];
    find_box(a, of_a);
    find_box(b, of_b);
    for (int i = 0; i < 3; i++)
        if (of_a[0][i] > of_b[1][i] || of_b[0][i] > of_a[1][i])
            return false;
    return true;
}

static enum tetlod_status add_values(struct scan *scan, struct tetmesh *mesh, bool first)
{
    for (uint32_t n = 0; n < scan->name_count; n++) {
        struct build_control control;
        double range[2], *all = scan->out->ranges[n];
        TETLOD_TRY(build_control_parse(mesh, scan->names[n], &control, scan->error));
        const struct point_field *field = &mesh->fields[control.field];
        if (!first && field->components != scan->components[n])
            return tetlodi_fail(scan->error, TETLOD_ERR_FIELD, "field '%.60s' has %u components, in the first step %u",
                                scan->names[n],
                                field->components, scan->components[n]);
        point_field_range(field, mesh->vertex_count, range);
        all[0] = first ? range[0] : smaller(all[0], range[0]);
        all[1] = first ? range[1] : larger(all[1], range[1]);
        scan->components[n] = field->components;
    }
    return TETLOD_OK;
}

/* The step's mesh, which it takes over, begins another group. */
static enum tetlod_status begin_group(struct scan *scan, struct tetmesh *mesh, uint32_t step)
{
    struct series_topologies *out = scan->out;
    if (step && !boxes_meet(mesh, &scan->first))
        return tetlodi_fail(scan->error, TETLOD_ERR_MESH,
                            "its mesh lies elsewhere than that of the step before: they are not steps of one series; "
                            "build them as streams of their own");
    if (!ARRAY_RESERVE(out->groups, out->room, out->count + (size_t)1))
        return tetlodi_fail_nomem(scan->error, "the topology groups", out->count * sizeof *out->groups);
    out->groups[out->count++] = (struct series_topology){.from = step, .tets = mesh->tet_count};
    tetmesh_fini(&scan->first);
    scan->first = *mesh;
    *mesh = (struct tetmesh){0};
    return TETLOD_OK;
}

static enum tetlod_status scan_step(struct scan *scan, struct tetmesh *mesh, uint32_t step, double time)
{
    TETLOD_TRY(add_values(scan, mesh, step == 0));
    if (step == 0 || displacement_obstacle(mesh, &scan->first))
        TETLOD_TRY(begin_group(scan, mesh, step));
    scan->out->groups[scan->out->count - 1].count++;
    scan->out->times[step] = time;
    scan->input->numbered |= step && !(time > scan->out->times[step - 1]);
    return TETLOD_OK;
}

static enum tetlod_status scan_steps(struct scan *scan, const struct reading *reading, struct progress *progress)
{
    struct tetlod_error *error = scan->error, inner = {0};
    const struct series_input *input = scan->input;
    for (uint32_t s = 0; s < input->wanted; s++) {
        struct tetmesh mesh = {0};
        struct io_report report;
        uint64_t number = input->begin + s * input->stride;
        TETLOD_TRY(series_input_read(input, number, reading, &mesh, &report, error));
        scan->error = &inner;
        enum tetlod_status status = scan_step(scan, &mesh, s, report.steps ? report.time : (double)number);
        scan->error = error;
        tetmesh_fini(&mesh);
        if (status != TETLOD_OK)
            return series_input_blame(input, number, status, &inner, error);
        progress_update(progress, "look", (s + 1.0) / input->wanted);
    }
    return TETLOD_OK;
}

enum tetlod_status series_topologies_find(struct series_topologies *out, struct series_input *input,
                                          const struct reading *reading, const char *const *names, uint32_t count,
                                          struct progress *progress, struct tetlod_error *error)
{
    struct scan scan = {.out = out, .input = input, .names = names, .name_count = count, .error = error};
    *out = (struct series_topologies){.ranges = array_new(count, sizeof *out->ranges),
                                      .times = array_new(input->wanted, sizeof *out->times)};
    scan.components = array_zero(count, sizeof *scan.components);
    enum tetlod_status status = out->ranges && out->times && scan.components
                                    ? TETLOD_OK
                                    : tetlodi_fail_nomem(error, "the fields", count * sizeof *out->ranges);
    if (status == TETLOD_OK)
        status = scan_steps(&scan, reading, progress);
    for (uint32_t s = 0; s < input->wanted && input->numbered && status == TETLOD_OK; s++)
        out->times[s] = (double)(input->begin + s * input->stride); // times that do not rise tell nothing
    tetmesh_fini(&scan.first);
    free(scan.components);
    if (status != TETLOD_OK)
        series_topologies_fini(out);
    return status;
}

void series_topologies_fini(struct series_topologies *topologies)
{
    free(topologies->groups);
    free(topologies->times);
    free(topologies->ranges);
    *topologies = (struct series_topologies){0};
}
