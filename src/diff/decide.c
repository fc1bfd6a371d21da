/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Coarse levels come first: they are decoded and laid over each other in no time, and decide where the results are far
 * apart. What they leave open says how fine the next ones must be.
 */
#include "src/diff/decide.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/diff/open_parts.h"
#include "src/measure/same.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

/* Levels that are tried before the finest ones are taken. */
enum { MAX_TRIES = 4 };

/* The first ones, where a great difference would be seen at once: their error, of the range. */
static const double FIRST_ERROR = 0.04;

/* Builds whose limit knows nothing of partners keep the boundary to 1e-6 of the diagonal (PROOF.md 8), and a little
 * that its stored digits add. */
static const double KEPT_OF_EXACT = 1.01e-6;

static const struct form whole_mesh = {.level = TETLOD_NONE, .band = TETLOD_NONE};

enum tetlod_status diff_side_mesh(struct diff_side *side, const char *field, struct tetlod_error *error)
{
    side->field = tetmesh_find_field(&side->mesh, field);
    if (side->field == TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_FIELD, "there is no field '%.100s' at its points", field);
    side->components = side->mesh.fields[side->field].components;
    point_field_range(&side->mesh.fields[side->field], side->mesh.vertex_count, side->range);
    return TETLOD_OK;
}

enum tetlod_status diff_side_stream(struct diff_side *side, struct tetlod_error *error)
{
    side->of_stream = true;
    side->components = side->forms.info->fields[side->forms.field].components;
    memcpy(side->range, side->forms.range, sizeof side->range);
    return side->forms.count ? TETLOD_OK : forms_none(&side->forms, error);
}

void diff_side_fini(struct diff_side *side)
{
    tetmesh_fini(&side->mesh);
    forms_fini(&side->forms);
}

bool diff_parse_limit(const char *text, const double range[2], double *out)
{
    char *end;
    *out = strtod(text, &end);
    bool relative = end != text && strcmp(end, "%") == 0;
    if (relative)
        *out *= 0.01 * (range[1] - range[0]);
    return end != text && (relative || !*end) && isfinite(*out) && *out >= 0;
}

/* ---- a form as a mesh */

static enum tetlod_status add_values(struct tetmesh *mesh, const char *name, uint32_t components, const double *values,
                                     struct tetlod_error *error)
{
    TETLOD_TRY(tetmesh_add_field(mesh, name, components, TETLOD_FLOAT64, error));
    memcpy(mesh->fields[mesh->field_count - 1].values, values,
           (size_t)mesh->vertex_count * components * sizeof *values);
    return TETLOD_OK;
}

static enum tetlod_status take(struct diff_side *side, uint32_t number, struct difference_side *out,
                               struct tetlod_error *error)
{
    struct forms *forms = &side->forms;
    struct tetmesh *mesh = &side->mesh;
    struct form_mesh form;
    *out = (struct difference_side){.mesh = mesh, .field = side->field, .bound = TETLOD_NONE};
    memcpy(out->range, side->range, sizeof out->range);
    if (!side->of_stream)
        return TETLOD_OK;
    tetmesh_fini(mesh);
    TETLOD_TRY(forms_take(forms, number, &form, error));
    *mesh = (struct tetmesh){.vertex_count = form.vertices, .tet_count = form.tets,
                             .position_type = forms->info->position_type,
                             .positions = array_new(form.vertices, 3 * sizeof(double)),
                             .corners = array_new(form.tets, 4 * sizeof(uint32_t))};
    if (!mesh->positions || !mesh->corners)
        return tetlodi_fail_nomem(error, "a level", form.vertices * (uint64_t)24 + form.tets * (uint64_t)16);
    memcpy(mesh->positions, form.positions, form.vertices * 3 * sizeof(double));
    memcpy(mesh->corners, form.corners, form.tets * 4 * sizeof(uint32_t));
    TETLOD_TRY(add_values(mesh, forms->info->fields[forms->field].name, side->components, form.values, error));
    if (form.bounds)
        TETLOD_TRY(add_values(mesh, "bound", 1, form.bounds, error));
    out->bound = form.bounds ? 1 : TETLOD_NONE;
    out->error = forms->forms[number].error;
    out->moved = forms->forms[number].moved;
    out->swept = forms->forms[number].swept;
    out->has_partners = forms->info->fields[forms->field].controlled &&
        forms->info->levels[forms->forms[number].level].domain_error > KEPT_OF_EXACT;
    return TETLOD_OK;
}

/* ---- which forms */

static const struct form *form_of(const struct diff_side *side, uint32_t number)
{
    return side->of_stream ? &side->forms.forms[number] : &whole_mesh;
}

/* The coarsest form within an error, else the finest, of those whose boundary has swept no more than `most`, where
 * there are any. */
static uint32_t pick(const struct diff_side *side, double error, double most)
{
    uint32_t found = 0, count = side->of_stream ? side->forms.count : 1;
    bool any = false;
    for (uint32_t i = 0; i < count; i++)
        any = any || form_of(side, i)->swept <= most;
    for (uint32_t i = 0; i < count; i++) {
        if (any && form_of(side, i)->swept > most)
            continue;
        found = i;
        if (form_of(side, i)->error <= error)
            break;
    }
    return found;
}

/* A difference that is no less than any: what the ranges allow. */
static double furthest_of(const struct diff_side sides[2])
{
    return larger(sides[0].range[1] - sides[1].range[0], sides[1].range[1] - sides[0].range[0]);
}

/* What a boundary may have swept: for a largest difference that is no matter until it is what leaves it open. It makes
 * a mean square uncertain: by a quarter of the scale. */
static double most_swept(const struct diff_side sides[2], int m, const struct diff_options *options, bool kept)
{
    double scale = (options->limited ? options->limit : options->width) / 4, furthest = furthest_of(sides);
    if (options->norm == DIFF_MAX)
        return kept ? 0 : INFINITY;
    bool known = sides[m].of_stream && sides[m].forms.summary.level_count && furthest > 0;
    return known ? sides[m].forms.summary.volume * scale * scale / (furthest * furthest) : 0;
}

/* Are both the same stream, at the same step? Then their originals do not differ. */
static bool are_one(const struct diff_side sides[2])
{
    const struct forms *a = &sides[0].forms, *b = &sides[1].forms;
    return sides[0].of_stream && sides[1].of_stream && strcmp(a->info->cid, b->info->cid) == 0 &&
        a->field == b->field && !a->series == !b->series && a->step == b->step;
}

/* ---- what the forms say */

/* The interval of the whole's root mean square, and of the square's integral. What was swept may differ by as much as
 * the ranges allow, or not at all. */
static void set_squares(const struct diff_side sides[2], uint32_t components, struct diff_result *out)
{
    const struct difference *found = &out->difference;
    double furthest = furthest_of(sides), swept = out->swept = found->swept;
    double least = found->squares[0] - swept * components * found->max[1] * found->max[1];
    double most = found->squares[1] + swept * components * furthest * furthest;
    double volumes[2] = {larger(found->overlap - swept, 0), found->overlap + swept};
    out->l2[0] = sqrt(larger(least, 0));
    out->l2[1] = sqrt(most);
    out->bounds[DIFF_RMS][0] = out->l2[0] / sqrt(volumes[1]);
    out->bounds[DIFF_RMS][1] = smaller(out->l2[1] / sqrt(volumes[0]), furthest * sqrt(components));
}

/* No mean is above the largest, which is of one component. */
static void set_max(const struct diff_side sides[2], uint32_t components, struct diff_result *out)
{
    const struct difference *found = &out->difference;
    double furthest = furthest_of(sides);
    double *bounds = out->bounds[DIFF_MAX], *rms = out->bounds[DIFF_RMS];
    bounds[0] = found->max[0];
    bounds[1] = smaller(found->max[1], larger(furthest, bounds[0]));
    double most = sqrt(components) * bounds[1];
    rms[1] = larger(smaller(rms[1], most), rms[0]);
    out->l2[1] = larger(smaller(out->l2[1], most * sqrt(found->overlap + out->swept)), out->l2[0]);
}

static enum diff_verdict judge(const struct diff_options *options, const double bounds[2])
{
    if (!options->limited)
        return bounds[1] - bounds[0] <= options->width ? DIFF_MEASURED : DIFF_UNDECIDED;
    return bounds[1] <= options->limit ? DIFF_WITHIN : bounds[0] > options->limit ? DIFF_BEYOND : DIFF_UNDECIDED;
}

/* Both sides, each by a thread. */
struct taking {
    struct diff_side *sides;
    const uint32_t *forms;
    struct difference_side given[2];
    enum tetlod_status status[2];
    struct tetlod_error errors[2];
};

static void take_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct taking *taking = context;
    (void)worker;
    for (size_t m = begin; m < end; m++)
        taking->status[m] = take(&taking->sides[m], taking->forms[m], &taking->given[m], &taking->errors[m]);
}

static enum tetlod_status note_used(const struct diff_side *side, int m, uint32_t number,
                                    const struct difference_side *given, struct diff_result *out,
                                    struct tetlod_error *error)
{
    out->used[m].level = form_of(side, number)->level;
    out->used[m].tets = side->mesh.tet_count;
    out->used[m].error = given->error;
    return side->of_stream ? forms_bytes(&side->forms, number, &out->used[m].bytes, error) : TETLOD_OK;
}

/* Compares the forms that were taken: all of them, or what the last ones have left open. */
static enum tetlod_status compare(struct diff_side sides[2], const struct difference_side given[2],
                                  const struct diff_options *options, const struct tetmesh *last,
                                  const struct difference *found, struct diff_result *out, struct tetlod_error *error)
{
    uint32_t components = options->component < 0 ? sides[0].components : 1;
    struct tetmesh *mesh = &sides[0].mesh;
    struct difference_open open = {.limit = options->limit};
    double most;
    enum tetlod_status status = TETLOD_OK;
    if (found->cells && found->one_body && options->limited && options->norm == DIFF_MAX && !options->all_cells)
        TETLOD_TRY_DONE(open_parts_find(found, sides[0].of_stream ? last : mesh, mesh, &open, &most, error));
    TETLOD_TRY_DONE(difference_measure(&out->difference, given, options->component, &open, options->threads, error));
    if (open.asked)
        open_parts_complete(&out->difference, open.asked, mesh->tet_count, most, found);
    else if (!(out->difference.overlap > 0))
        status = tetlodi_fail(error, TETLOD_ERR_MISMATCH, "the meshes do not overlap: are their units the same?");
    else
        set_squares(sides, components, out);
    if (status == TETLOD_OK)
        set_max(sides, components, out);
done:
    free(open.asked);
    return status;
}

static enum tetlod_status measure(struct diff_side sides[2], const uint32_t forms[2],
                                  const struct diff_options *options, struct diff_result *out,
                                  struct tetlod_error *error)
{
    struct taking taking = {.sides = sides, .forms = forms};
    struct difference found = out->difference;
    struct tetmesh last[2] = {{0}, {0}}; // the difference looks at both
    bool one = are_one(sides);
    enum tetlod_status status = TETLOD_OK;
    out->difference = (struct difference){0};
    for (int m = 0; m < 2; m++)
        if (sides[m].of_stream) {
            last[m] = sides[m].mesh;
            sides[m].mesh = (struct tetmesh){0};
        }
    parallel_for(options->threads, 2, 1, take_range, &taking);
    for (int m = 0; m < 2; m++) {
        if (taking.status[m] != TETLOD_OK)
            *error = taking.errors[m];
        TETLOD_TRY_DONE(taking.status[m]);
        if (one)
            taking.given[m] = (struct difference_side){.mesh = &sides[m].mesh, .bound = TETLOD_NONE};
        TETLOD_TRY_DONE(note_used(&sides[m], m, forms[m], &taking.given[m], out, error));
    }
    TETLOD_TRY_DONE(mesh_take_order(&sides[0].mesh, &sides[1].mesh, error));
    TETLOD_TRY_DONE(compare(sides, taking.given, options, &last[0], &found, out, error));
    out->verdict = judge(options, out->bounds[options->norm]);
done:
    tetmesh_fini(&last[0]);
    tetmesh_fini(&last[1]);
    difference_fini(&found);
    return status;
}

static double usual_error(const struct diff_options *options)
{
    return options->limited ? options->limit / 3 : options->width / 4;
}

/* Have the originals as many vertices and tetrahedra? Then they are probably one mesh in two orders. */
static bool are_alike(const struct diff_side sides[2])
{
    uint64_t counts[2][2];
    for (int m = 0; m < 2; m++) {
        const struct tetlod_info *info = sides[m].forms.info;
        counts[m][0] = sides[m].of_stream ? info->vertices : sides[m].mesh.vertex_count;
        counts[m][1] = sides[m].of_stream ? info->tets : sides[m].mesh.tet_count;
    }
    return memcmp(counts[0], counts[1], sizeof *counts) == 0;
}

static double first_error(const struct diff_side sides[2], const struct diff_options *options)
{
    double error = usual_error(options), range = sides[0].range[1] - sides[0].range[0];
    bool by_parts = options->limited && options->norm == DIFF_MAX && !options->all_cells;
    if (by_parts && !(options->limit > 0) && are_alike(sides))
        return 0; // only the finest can be the same, and no overlay is needed
    return by_parts && error < FIRST_ERROR / 4 * range ? FIRST_ERROR * range : error;
}

/* How small the errors of the next forms are to be: so small that what is open now is decided, if the difference is
 * about in the middle of what is known of it, but not much smaller: that is known badly. */
static double next_error(const struct diff_options *options, const struct diff_result *found, double last)
{
    const double *bounds = found->bounds[options->norm];
    double most = options->norm == DIFF_MAX ? found->difference.inner : bounds[1];
    double gap = options->limited ? fabs((bounds[0] + most) / 2 - options->limit) : options->width;
    double wanted = last > usual_error(options) ? usual_error(options) : 0.4 * gap;
    return larger(smaller(last / 4, wanted), last / 16);
}

/* Are only places open that boundaries have left? Then levels help that have kept theirs; or a smaller error, if what
 * else is known of these places is within the goal. */
static void aim(const struct diff_options *options, const struct diff_result *found, double *target, bool *kept)
{
    double goal = options->limited ? options->limit : found->bounds[DIFF_MAX][0] + options->width;
    double last = larger(found->used[0].error, found->used[1].error);
    double spare = goal - (found->difference.shell - found->used[0].error - found->used[1].error);
    *target = options->limited ? last : *target;
    if (options->norm != DIFF_MAX || found->difference.inner > goal)
        *target = next_error(options, found, *target);
    else if (spare > 0)
        *target = smaller(*target, 0.4 * spare);
    else
        *kept = true;
}

/* What boundaries have left of a tetrahedron differs by what is known of such places. */
static void complete_cells(const struct diff_side *first, struct difference *found)
{
    for (uint32_t t = 0; t < first->mesh.tet_count; t++)
        if (found->cells[t].left)
            found->cells[t].upper = larger(found->cells[t].upper, found->shell);
}

enum tetlod_status diff_decide(struct diff_side sides[2], const struct diff_options *options, struct diff_result *out,
                               struct tetlod_error *error)
{
    bool one = are_one(sides), kept = false;
    double target = first_error(sides, options);
    uint32_t used[2] = {TETLOD_NONE, TETLOD_NONE};
    *out = (struct diff_result){0};
    if (sides[0].components != sides[1].components)
        return tetlodi_fail(error, TETLOD_ERR_MISMATCH, "the field has %u components in the first, %u in the second",
                            sides[0].components, sides[1].components);
    for (int tries = 0;; tries++) {
        uint32_t finest[2], next[2];
        for (int m = 0; m < 2; m++) {
            finest[m] = pick(&sides[m], -1, 0);
            next[m] = one ? 0 : tries == MAX_TRIES ? finest[m] : pick(&sides[m], target,
                                                                      most_swept(sides, m, options, kept));
        }
        if (next[0] != used[0] || next[1] != used[1]) {
            memcpy(used, next, sizeof used);
            TETLOD_TRY(measure(sides, used, options, out, error));
        }
        if (out->verdict != DIFF_UNDECIDED || one || (used[0] == finest[0] && used[1] == finest[1]))
            break;
        aim(options, out, &target, &kept);
    }
    complete_cells(&sides[0], &out->difference);
    if (!options->limited)
        out->verdict = DIFF_MEASURED;
    return TETLOD_OK;
}
