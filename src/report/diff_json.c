/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/report/diff_json.h"

#include <math.h>

void diff_where(const struct diff_side *first, const struct diff_result *result, struct diff_where *out)
{
    const struct tetmesh *mesh = &first->mesh;
    *out = (struct diff_where){0, {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}}};
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        const struct difference_cell *cell = &result->difference.cells[t];
        if (!(cell->upper > 0) || cell->upper < result->bounds[DIFF_MAX][0])
            continue;
        out->tets++;
        for (int c = 0; c < 12; c++) {
            double x = mesh->positions[3 * (size_t)mesh->corners[4 * (size_t)t + (size_t)(c / 3)] + (size_t)(c % 3)];
            out->box[0][c % 3] = fmin(out->box[0][c % 3], x);
            out->box[1][c % 3] = fmax(out->box[1][c % 3], x);
        }
    }
}

const char *diff_verdict_name(enum diff_verdict verdict)
{
    static const char *const names[] = {"measured", "within", "undecided", "beyond"};
    return names[verdict];
}

static json_t *interval(const double bounds[2])
{
    return json_pack("{s:f, s:f}", "lower", bounds[0], "upper", bounds[1]);
}

static json_t *used_json(const struct diff_side *side, const struct diff_result *result, int m)
{
    json_t *object = json_pack("{s:I, s:f}", "tets", (json_int_t)result->used[m].tets, "error",
                               result->used[m].error);
    if (object && side->of_stream) {
        json_object_set_new(object, "level", json_integer(result->used[m].level));
        json_object_set_new(object, "bytes", json_integer((json_int_t)result->used[m].bytes));
        json_object_set_new(object, "of_bytes", json_integer((json_int_t)side->forms.info->bytes));
    }
    return object;
}

static json_t *place_json(const struct diff_side *first, const struct diff_result *result)
{
    struct diff_where where;
    const double *p = result->difference.place, *low = where.box[0], *high = where.box[1];
    diff_where(first, result, &where);
    json_t *object = json_pack("{s:I}", "tets", (json_int_t)where.tets);
    if (object && where.tets)
        json_object_set_new(object, "box", json_pack("[[f,f,f],[f,f,f]]", low[0], low[1], low[2], high[0], high[1],
                                                     high[2]));
    if (object && result->difference.max[0] > 0)
        json_object_set_new(object, "place", json_pack("[f,f,f]", p[0], p[1], p[2]));
    return object;
}

json_t *diff_json(const char *field, const struct diff_side sides[2], const struct diff_options *options,
                  const struct diff_result *result)
{
    const struct difference *found = &result->difference;
    json_t *object = json_pack("{s:s, s:s, s:[f,f], s:o, s:o, s:o, s:o, s:[f,f], s:f, s:f, s:f, s:[I,I], s:o, s:o}",
                               "field", field, "verdict", diff_verdict_name(result->verdict),
                               "range", sides[0].range[0], sides[0].range[1],
                               "max", interval(result->bounds[DIFF_MAX]), "rms", interval(result->bounds[DIFF_RMS]),
                               "l2", interval(result->l2), "where", place_json(&sides[0], result),
                               "volumes", found->volumes[0], found->volumes[1], "overlap", found->overlap,
                               "apart", found->apart, "swept", result->swept, "left_out",
                               (json_int_t)found->left_out[0], (json_int_t)found->left_out[1],
                               "first", used_json(&sides[0], result, 0), "second", used_json(&sides[1], result, 1));
    if (object && options->limited) {
        json_object_set_new(object, "limit", json_real(options->limit));
        json_object_set_new(object, "norm", json_string(options->norm == DIFF_MAX ? "max" : "rms"));
    }
    return object;
}
