/* SPDX-License-Identifier: BSD-3-Clause */
/* A function of components of fields that colours pictures: what a calculator says, von Mises, principal values. The
 * components are linear on each tetrahedron, the function is taken of components that were interpolated. */
#include <math.h>
#include <string.h>

#include "format/fail.h"
#include "server/web/wasm/view.h"
#include "src/util/array.h"

/* What a step does with the numbers on top of the stack; formula.js writes these. A tensor is xx yy zz xy yz xz. */
enum operation {
    PUSH_NUMBER,
    PUSH_INPUT,
    ADD,
    SUBTRACT,
    MULTIPLY,
    DIVIDE,
    SQUARE_ROOT,
    ABSOLUTE,
    NEGATE,
    LEAST,
    GREATEST,
    NORM,
    MISES,
    PRINCIPAL,
    OPERATIONS
};

/* Eigenvalues of a symmetric tensor, the largest first: rotations that take the largest element beside the diagonal. */
static void find_principal(const double *tensor, double out[3])
{
    double a[3][3] = {{tensor[0], tensor[3], tensor[5]}, {tensor[3], tensor[1], tensor[4]},
                      {tensor[5], tensor[4], tensor[2]}};
    for (int round = 0; round < 24; round++) {
        int p = 0, q = fabs(a[0][1]) >= fabs(a[0][2]) ? 1 : 2;
        if (fabs(a[1][2]) > fabs(a[p][q]))
            p = 1, q = 2;
        if (!(fabs(a[p][q]) > 1e-16 * (fabs(a[0][0]) + fabs(a[1][1]) + fabs(a[2][2]))))
            break;
        double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
        double t = (theta < 0 ? -1 : 1) / (fabs(theta) + sqrt(theta * theta + 1)), c = 1 / sqrt(t * t + 1), s = t * c;
        double pq = a[p][q];
        int r = 3 - p - q;
        double rp = a[r][p], rq = a[r][q];
        a[p][p] -= t * pq;
        a[q][q] += t * pq;
        a[p][q] = a[q][p] = 0;
        a[r][p] = a[p][r] = c * rp - s * rq;
        a[r][q] = a[q][r] = s * rp + c * rq;
    }
    double high = fmax(a[0][0], fmax(a[1][1], a[2][2])), low = fmin(a[0][0], fmin(a[1][1], a[2][2]));
    out[0] = high;
    out[1] = a[0][0] + a[1][1] + a[2][2] - high - low;
    out[2] = low;
}

static double norm_of(const double *x, uint32_t count)
{
    double squares = 0;
    for (uint32_t i = 0; i < count; i++)
        squares += x[i] * x[i];
    return sqrt(squares);
}

static double mises_of(const double *t)
{
    double a = t[0] - t[1], b = t[1] - t[2], c = t[2] - t[0];
    return sqrt((a * a + b * b + c * c) / 2 + 3 * (t[3] * t[3] + t[4] * t[4] + t[5] * t[5]));
}

static double join(enum operation operation, double a, double b)
{
    switch (operation) {
    case ADD: return a + b;
    case SUBTRACT: return a - b;
    case MULTIPLY: return a * b;
    case DIVIDE: return a / b;
    case LEAST: return fmin(a, b);
    default: return fmax(a, b);
    }
}

static double change(enum operation operation, double a)
{
    return operation == SQUARE_ROOT ? sqrt(fmax(a, 0)) : operation == ABSOLUTE ? fabs(a) : -a;
}

/* How many numbers a step takes from the stack; it leaves one. */
static uint32_t taken(const struct view_step *step)
{
    switch (step->operation) {
    case PUSH_NUMBER: case PUSH_INPUT: return 0;
    case SQUARE_ROOT: case ABSOLUTE: case NEGATE: return 1;
    case NORM: return (uint32_t)step->number;
    case MISES: case PRINCIPAL: return 6;
    default: return 2;
    }
}

static double result_of(const struct view_step *step, const double *top, const double *inputs)
{
    double principal[3];
    switch (step->operation) {
    case PUSH_NUMBER: return step->number;
    case PUSH_INPUT: return inputs[(size_t)step->number];
    case SQUARE_ROOT: case ABSOLUTE: case NEGATE: return change(step->operation, top[0]);
    case NORM: return norm_of(top, (uint32_t)step->number);
    case MISES: return mises_of(top);
    case PRINCIPAL:
        find_principal(top, principal);
        return principal[(size_t)step->number];
    default: return join(step->operation, top[0], top[1]);
    }
}

double view_evaluate(const struct view_function *function, const double *inputs)
{
    double stack[MAX_FUNCTION_DEPTH];
    uint32_t depth = 0;
    for (uint32_t s = 0; s < function->step_count; s++) {
        const struct view_step *step = &function->steps[s];
        depth -= taken(step);
        stack[depth] = result_of(step, stack + depth, inputs);
        depth++;
    }
    return stack[0];
}

/* Each step finds what it takes, and one number is left. */
static bool is_whole(const struct view *view, const struct view_function *function)
{
    uint32_t depth = 0;
    for (uint32_t i = 0; i < function->field.components; i++)
        if (function->inputs[i].field >= view->shown.field_count ||
            function->inputs[i].component >= view->shown.fields[function->inputs[i].field].components)
            return false;
    for (uint32_t s = 0; s < function->step_count; s++) {
        const struct view_step *step = &function->steps[s];
        if (step->operation >= OPERATIONS || !(step->number >= 0 || step->operation == PUSH_NUMBER) ||
            (step->operation == PUSH_INPUT && step->number >= function->field.components) ||
            (step->operation == PRINCIPAL && step->number >= 3) ||
            (step->operation == NORM && (step->number < 1 || step->number > MAX_FUNCTION_DEPTH)) ||
            taken(step) > depth)
            return false;
        depth += 1 - taken(step);
        if (depth > MAX_FUNCTION_DEPTH)
            return false;
    }
    return depth == 1;
}

static bool same_steps(const struct view_function *a, const struct view_function *b)
{
    bool same = true;
    for (uint32_t s = 0; s < a->step_count && same; s++)
        same = a->steps[s].operation == b->steps[s].operation &&
               memcmp(&a->steps[s].number, &b->steps[s].number, sizeof a->steps[s].number) == 0;
    return same;
}

uint32_t view_define(struct view *view, const double *words, uint32_t inputs, uint32_t steps)
{
    struct view_function *function = &view->defined, before = *function;
    if (inputs > MAX_FUNCTION_INPUTS || steps > MAX_FUNCTION_STEPS)
        return tetlodi_fail(&view->error, TETLOD_ERR_ARGUMENT, "a formula has at most %d components and %d steps",
                            MAX_FUNCTION_INPUTS, MAX_FUNCTION_STEPS);
    function->field.components = inputs;
    function->step_count = steps;
    for (uint32_t i = 0; i < inputs; i++)
        function->inputs[i] = (struct view_input){(uint32_t)words[2 * i], (uint32_t)words[2 * i + 1]};
    for (uint32_t s = 0; s < steps; s++)
        function->steps[s] = (struct view_step){(uint32_t)words[2 * (inputs + s)], words[2 * (inputs + s) + 1]};
    if (inputs == before.field.components && steps == before.step_count &&
        memcmp(before.inputs, function->inputs, inputs * sizeof *before.inputs) == 0 && same_steps(&before, function))
        return TETLOD_OK;
    view->grid_size = 0;
    if (view->has_range && view->range.field == view->shown.field_count) // other tetrahedra are in it
        view->has_kept = view->has_boundary = view->has_lines = view->has_rays = false;
    if (is_whole(view, function))
        return TETLOD_OK;
    function->step_count = 0;
    return tetlodi_fail(&view->error, TETLOD_ERR_ARGUMENT, "the formula's steps do not leave one number");
}

static void take_row(const struct view_function *function, const struct tetmesh *mesh, size_t vertex, double *out)
{
    for (uint32_t i = 0; i < function->field.components; i++) {
        const struct point_field *of = &mesh->fields[function->inputs[i].field];
        out[i] = of->values ? of->values[vertex * of->components + function->inputs[i].component] : 0;
    }
}

bool view_take_rows(struct view *view)
{
    struct view_function *function = &view->defined;
    const struct tetmesh *drawn = view_drawn(view);
    size_t count = drawn->vertex_count, width = function->field.components;
    if (!ARRAY_RESERVE(function->field.values, function->row_cap, count * width + 1))
        return false;
    for (size_t v = 0; v < count; v++)
        take_row(function, drawn, v, function->field.values + v * width);
    return true;
}

void view_take_function(const struct view *view, const struct tetmesh *mesh, uint32_t vertices, double *out)
{
    double row[MAX_FUNCTION_INPUTS];
    for (uint32_t v = 0; v < vertices; v++) {
        take_row(&view->defined, mesh, v, row);
        out[v] = view->defined.step_count ? view_evaluate(&view->defined, row) : 0;
    }
}

double view_value_of(const struct view *view, const struct point_field *field, const double *row)
{
    return field == &view->defined.field ? view_evaluate(&view->defined, row) : norm_of(row, field->components);
}
