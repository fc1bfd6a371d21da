/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/ask/ask.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/ask/box_answer.h"
#include "src/util/array.h"
#include "src/util/number_text.h"

/* A question about one stream. */
struct asking {
    struct forms *forms;
    const struct tetlod_info *info; /* the forms' */
    const struct ask_question *question;
    uint32_t region_field; /* a cell field */
    double *regions;
    struct blocked blocked; /* the form that was taken last */
    struct ask_interval early; /* what the bytes before the levels say; infinite if nothing */
};

bool ask_parse_within(const char *text, struct ask_options *out)
{
    out->relative = strchr(text, '%') != NULL;
    return text_number(text, true, &out->width) && out->width >= 0;
}

enum tetlod_status ask_check(const struct tetlod_info *info, const struct ask_question *question,
                             struct tetlod_error *error)
{
    const struct ask_quantity *quantity = &question->quantity;
    if (!quantity->name[0])
        return TETLOD_OK;
    uint32_t field = tetlod_field_index(info, quantity->name);
    if (field == TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_FIELD, "there is no field '%.100s'; 'tetlod info' lists the fields",
                            quantity->name);
    uint32_t components = info->fields[field].components;
    if (quantity->component == ASK_SCALAR && components > 1)
        return tetlodi_fail(error, TETLOD_ERR_FIELD,
                            "%.100s has %u components: ask for its length |%.60s| or a component %.60s:0",
                            quantity->name, components, quantity->name, quantity->name);
    if (quantity->component >= (int)components)
        return tetlodi_fail(error, TETLOD_ERR_FIELD, "%.100s has the components 0 to %u, not %d", quantity->name,
                            components - 1, quantity->component);
    return TETLOD_OK;
}

/* Is the question one that a level with another domain can answer? */
static bool allows_sweep(const struct ask_question *question)
{
    return question->function != ASK_AT && question->function != ASK_ALONG && question->function != ASK_MIN &&
           question->function != ASK_MAX;
}

/* Can a form answer it? */
static bool answers(const struct asking *asking, const struct form *form)
{
    return form->swept == 0 || (allows_sweep(asking->question) && isfinite(form->swept));
}

static enum tetlod_status load_regions(struct asking *asking, struct tetlod_error *error)
{
    const struct tetlod_info *info = asking->info;
    if (!asking->question->over_region)
        return TETLOD_OK;
    while (asking->region_field < info->cell_field_count && !info->cell_fields[asking->region_field].region)
        asking->region_field++;
    if (asking->region_field == info->cell_field_count)
        return tetlodi_fail(error, TETLOD_ERR_FIELD, "it has no regions that levels keep; build it with --region");
    size_t count = (size_t)info->cell_fields[asking->region_field].components * info->tets;
    asking->regions = array_new(count, sizeof *asking->regions);
    if (!asking->regions)
        return tetlodi_fail_nomem(error, "the regions of the tetrahedra", count * sizeof *asking->regions);
    return tetlod_cells(asking->forms->file, asking->region_field, asking->regions, error);
}

/* With those of the regions. */
static enum tetlod_status count_bytes(const struct asking *asking, uint32_t number, uint64_t *out,
                                      struct tetlod_error *error)
{
    TETLOD_TRY(forms_bytes(asking->forms, number, out, error));
    uint32_t section = asking->regions ? tetlod_cell_section(asking->info, asking->region_field) : TETLOD_NONE;
    bool mapped = asking->regions && asking->info->cell_rows;
    uint32_t map = mapped ? tetlod_section_index(asking->info, "PMAP") : TETLOD_NONE;
    *out += section == TETLOD_NONE ? 0 : asking->info->sections[section].stored;
    *out += map == TETLOD_NONE ? 0 : asking->info->sections[map].stored;
    return TETLOD_OK;
}

/* The quantity's range in the original; of a length, what its components allow. */
static void set_range(const struct asking *asking, double out[2])
{
    memcpy(out, asking->forms->range, sizeof asking->forms->range);
    if (asking->question->quantity.component != ASK_LENGTH)
        return;
    out[1] = sqrt((double)asking->info->fields[asking->forms->field].components) * fmax(fabs(out[0]), fabs(out[1]));
    out[0] = 0;
}

/* The answer of a form, and the volume of what is asked about. */
static enum tetlod_status answer(const struct asking *asking, const struct form_mesh *mesh, const struct form *form,
                                 struct ask_interval *out, double *volume, struct tetlod_error *error)
{
    const struct ask_question *question = asking->question;
    const struct forms *forms = asking->forms;
    struct ask_level level = {.positions = mesh->positions, .corners = mesh->corners, .tets = mesh->tets,
                              .components = 1, .error = form->error, .regions = asking->regions,
                              .numbers = mesh->numbers, .blocks = mesh->blocks,
                              .swept = form->swept, .volume = forms->summary.level_count ? forms->summary.volume : NAN};
    if (forms->field != TETLOD_NONE && question->quantity.name[0]) {
        level.values = mesh->values;
        level.bounds = mesh->bounds;
        level.components = asking->info->fields[forms->field].components;
        set_range(asking, level.range);
    }
    return ask_answer(question, &level, out, volume, error);
}

/* What an answer can be at most, from the least to the greatest. */
static double scale_of(const struct asking *asking, double volume)
{
    double range = asking->forms->field == TETLOD_NONE ? 1 : asking->forms->range[1] - asking->forms->range[0];
    switch (asking->question->function) {
    case ASK_VOLUME:
        return volume;
    case ASK_INTEGRAL:
        return volume * range;
    default:
        return range;
    }
}

/* How wide the answer may be, in its units. */
static double width_of(const struct asking *asking, const struct ask_options *options, double volume)
{
    return options->width * (options->relative ? scale_of(asking, volume) : 1);
}

/* Values along a line span what they span: there the ends' own uncertainty counts. */
static double uncertainty(const struct asking *asking, const struct form *form, const struct ask_interval *interval)
{
    return asking->question->function == ASK_ALONG ? 2 * form->error : interval->upper - interval->lower;
}

static bool is_enough(const struct asking *asking, const struct ask_options *options, double volume,
                      const struct form *form, const struct ask_interval *interval)
{
    if (asking->question->compare != ASK_NO_LIMIT)
        return ask_decide(asking->question, interval) >= 0;
    return uncertainty(asking, form, interval) <= width_of(asking, options, volume);
}

/* The error below which a level is worth a try, after one whose answer was not enough: an answer is about as uncertain
 * as its level. A predicate says nothing of how near it is: the next level is to have half the error. */
static double worthwhile(const struct asking *asking, const struct ask_options *options, double volume,
                         const struct form *form, const struct ask_interval *interval)
{
    double wide = uncertainty(asking, form, interval), share = width_of(asking, options, volume) / wide;
    return form->error * (asking->question->compare != ASK_NO_LIMIT ? 0.5 : fmin(1.25 * share, 1));
}

/* A length is enclosed between linear functions, but where its greatest value or one at a point is asked for. */
static bool is_linear(const struct ask_question *question)
{
    return question->quantity.component != ASK_LENGTH || question->function == ASK_MAX || question->function == ASK_AT;
}

/* Can a level whose error is bounded by `bound` do? The answers for the level minus and plus a constant are twice that
 * apart, but for volumes and integrals, whose scale is another. */
static bool may_be_enough(const struct asking *asking, const struct ask_options *options, double bound)
{
    const struct ask_question *question = asking->question;
    bool shifts = question->function != ASK_VOLUME && question->function != ASK_INTEGRAL &&
        question->function != ASK_ALONG;
    if (question->compare != ASK_NO_LIMIT || !shifts || asking->forms->bound != TETLOD_NONE ||
        question->quantity.component == ASK_LENGTH)
        return true;
    return 2 * bound * (1 - 3e-9) <= options->width * (options->relative ? scale_of(asking, 0) : 1);
}

/* A form as a mesh in blocks: a level may be on the shelf, and is put there if it is not. */
static enum tetlod_status take_form(struct asking *asking, const struct ask_options *options, uint32_t number,
                                    struct form_mesh *out, struct tetlod_error *error)
{
    const struct ask_shelf *shelf = asking->forms->series ? NULL : options->shelf;
    const uint32_t level = asking->forms->forms[number].level, field = asking->forms->field;
    const char *name = asking->question->quantity.name;
    const uint32_t components = field == TETLOD_NONE ? 0 : asking->info->fields[field].components;
    struct blocked *blocked = &asking->blocked;
    if (shelf && shelf->take(shelf->opaque, level, name, out))
        return TETLOD_OK;
    TETLOD_TRY(forms_take(asking->forms, number, out, error));
    blocked_fini(blocked);
    TETLOD_TRY(blocked_make(blocked, out->positions, out->corners, out->tets, out->values, components, error));
    out->corners = blocked->corners;
    out->numbers = blocked->order;
    out->blocks = &blocked->blocks;
    if (shelf)
        shelf->put(shelf->opaque, level, name, out, components);
    return TETLOD_OK;
}

/* Both hold the answer, so what they share does. */
static void narrow(const struct ask_interval *by, struct ask_interval *interval)
{
    struct ask_interval both = {fmax(by->lower, interval->lower), fmin(by->upper, interval->upper)};
    if (both.lower <= both.upper)
        *interval = both;
}

static enum tetlod_status ask_levels(struct asking *asking, const struct ask_options *options,
                                     struct ask_result *out, struct tetlod_error *error)
{
    struct forms *forms = asking->forms;
    uint32_t finest = forms->count - 1, used = TETLOD_NONE;
    double volume, most = INFINITY;
    while (!answers(asking, &forms->forms[finest])) // check_levels found one
        finest--;
    for (uint32_t i = 0; i <= finest; i++) {
        const struct form *form = &forms->forms[i];
        struct form_mesh mesh;
        if (!answers(asking, form) ||
            (i < finest && (form->error > most || !may_be_enough(asking, options, form->error))))
            continue;
        if (options->wanted && !options->wanted(options->opaque))
            return tetlodi_fail(error, TETLOD_ERR_CANCELLED, "cancelled");
        TETLOD_TRY(take_form(asking, options, i, &mesh, error));
        TETLOD_TRY(answer(asking, &mesh, form, &out->interval, &volume, error));
        narrow(&asking->early, &out->interval);
        used = i;
        if ((form->error == 0 && form->swept == 0) || is_enough(asking, options, volume, form, &out->interval))
            break; // of the original only rounding is left
        most = worthwhile(asking, options, volume, form, &out->interval);
    }
    const struct form *form = &forms->forms[used];
    out->level = form->level;
    out->tets = asking->info->levels[form->level].tets;
    out->exact = form->error == 0 && form->swept == 0 && is_linear(asking->question);
    return count_bytes(asking, used, &out->bytes, error);
}

static enum tetlod_status check_levels(const struct asking *asking, struct tetlod_error *error)
{
    const struct tetlod_info *info = asking->info;
    if (info->inverted_tets && asking->question->function > ASK_ALONG)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "%llu of its tetrahedra are inverted: the mesh folds over itself, so that "
                            "volumes and means of it mean nothing", (unsigned long long)info->inverted_tets);
    for (uint32_t i = 0; i < asking->forms->count; i++)
        if (answers(asking, &asking->forms->forms[i]))
            return TETLOD_OK;
    return forms_none(asking->forms, error);
}

/* The number of the component that is asked about, through all fields. */
static uint32_t component_of(const struct asking *asking)
{
    uint32_t at = 0;
    for (uint32_t f = 0; f < asking->forms->field; f++)
        at += asking->info->fields[f].components;
    return at + (asking->question->quantity.component > 0 ? (uint32_t)asking->question->quantity.component : 0);
}

/* The volume where the component is at most the question's number, or below it: between two of the thresholds. */
static struct ask_interval volume_below(const struct asking *asking, const double (*below)[2], bool equal)
{
    struct ask_interval out = {0, asking->forms->summary.volume};
    double number = asking->question->number;
    for (uint32_t k = 0; k < asking->forms->summary.threshold_count; k++)
        if (below[k][0] < number || (equal && below[k][0] == number))
            out.lower = below[k][1];
    for (uint32_t k = asking->forms->summary.threshold_count; k-- > 0;)
        if (below[k][0] >= number)
            out.upper = below[k][1];
    return out;
}

/* Answers about volumes and quantiles of the whole domain, from the distribution; false: there is none. */
static bool find_in_distribution(const struct asking *asking, struct ask_interval *out)
{
    static const double ROUNDING = 4e-12; // of the volume
    const struct ask_question *question = asking->question;
    const struct tetlodi_summary *summary = &asking->forms->summary;
    double volume = summary->volume, slack = ROUNDING * volume;
    bool is_quantile = question->function == ASK_QUANTILE;
    if (!summary->threshold_count || asking->info->inverted_tets || !(volume > 0) || !question->quantity.name[0] ||
        !(is_quantile || (question->function == ASK_VOLUME && question->side != ASK_NO_LIMIT)))
        return false;
    const double (*below)[2] =
        (const double(*)[2])summary->below + (size_t)component_of(asking) * summary->threshold_count;
    if (is_quantile) {
        double wanted = question->number * volume;
        *out = (struct ask_interval){asking->forms->range[0], asking->forms->range[1]};
        for (uint32_t k = 0; k < summary->threshold_count; k++)
            out->lower = below[k][1] + slack < wanted ? below[k][0] : out->lower;
        for (uint32_t k = summary->threshold_count; k-- > 0;)
            out->upper = below[k][1] - slack >= wanted ? below[k][0] : out->upper;
        return true;
    }
    bool above = question->side == ASK_GREATER || question->side == ASK_AT_LEAST;
    *out = volume_below(asking, below, question->side == ASK_GREATER || question->side == ASK_AT_MOST);
    if (above)
        *out = (struct ask_interval){volume - out->upper, volume - out->lower};
    *out = (struct ask_interval){fmax(out->lower - slack, 0), out->upper + slack};
    return true;
}

/* The sums of the original have the whole domain's integrals, but not of lengths. */
static bool find_in_sums(const struct asking *asking, struct ask_interval *out)
{
    const struct ask_question *question = asking->question;
    const struct tetlodi_summary *summary = &asking->forms->summary;
    if (!summary->level_count || (question->function == ASK_VOLUME && question->side != ASK_NO_LIMIT))
        return false;
    double value = summary->volume, volume = value;
    if (question->function != ASK_VOLUME)
        value = summary->sums[component_of(asking)][0] / (question->function == ASK_MEAN ? volume : 1);
    *out = (struct ask_interval){value - 1e-12 * fabs(value), value + 1e-12 * fabs(value)};
    return volume > 0 && (question->function == ASK_MEAN || question->function == ASK_INTEGRAL ||
                          question->function == ASK_VOLUME);
}

/* Is what the bytes before the levels say narrow enough, or does it decide? */
static bool is_enough_early(const struct asking *asking, const struct ask_options *options, double volume,
                            const struct ask_interval *interval)
{
    if (asking->question->compare != ASK_NO_LIMIT)
        return ask_decide(asking->question, interval) >= 0;
    return interval->upper - interval->lower <= width_of(asking, options, volume);
}

/* The sums of a region are exact, those of a box as far as the boxes of the stream fill it. */
static bool find_in_boxes(struct asking *asking, const struct ask_options *options, struct ask_result *out)
{
    const struct ask_question *question = asking->question;
    double volume;
    uint32_t component = question->quantity.name[0] ? component_of(asking) : TETLOD_NONE;
    if (asking->info->inverted_tets ||
        !box_answer(&asking->forms->boxes, question, component, &out->interval, &volume))
        return false;
    asking->early = out->interval;
    out->exact = question->over_region;
    return out->exact || is_enough_early(asking, options, volume, &out->interval);
}

/* What the bytes before the levels say: the index has the extremes of a field of one component. */
static bool find_before_levels(struct asking *asking, const struct ask_options *options,
                               struct ask_result *out)
{
    const struct ask_question *question = asking->question;
    bool extreme = question->function == ASK_MIN || question->function == ASK_MAX;
    if (question->quantity.component == ASK_LENGTH)
        return false;
    out->bytes = asking->info->levels[0].offset;
    if (question->in_box || question->over_region)
        return find_in_boxes(asking, options, out);
    if (find_in_distribution(asking, &out->interval)) {
        asking->early = out->interval;
        return is_enough_early(asking, options, asking->forms->summary.volume, &out->interval);
    }
    out->exact = true;
    if (!extreme)
        return find_in_sums(asking, &out->interval);
    double value = asking->forms->range[question->function == ASK_MAX];
    out->interval = (struct ask_interval){value, value};
    return asking->info->fields[asking->forms->field].components == 1;
}

static enum tetlod_status ask_forms(struct asking *asking, const struct ask_options *options, struct ask_result *out,
                                    struct tetlod_error *error)
{
    if (!asking->forms->series && find_before_levels(asking, options, out))
        return TETLOD_OK;
    TETLOD_TRY(check_levels(asking, error));
    TETLOD_TRY(load_regions(asking, error));
    return ask_levels(asking, options, out, error);
}

enum tetlod_status ask_stream(struct tetlod_file *file, uint32_t finest, const struct ask_question *question,
                              const struct step_selection *step, const struct ask_options *options,
                              struct ask_result *out, struct tetlod_error *error)
{
    struct forms forms;
    struct asking asking = {.forms = &forms, .question = question, .early = {-INFINITY, INFINITY}};
    *out = (struct ask_result){.level = TETLOD_NONE};
    TETLOD_TRY(ask_check(tetlod_info(file), question, error));
    enum tetlod_status status = forms_init(&forms, file, finest, question->quantity.name, step, error);
    asking.info = forms.info;
    out->of_tets = forms.info->tets;
    out->level_count = forms.info->level_count;
    out->of_step = forms.series != NULL;
    out->time = out->of_step && status == TETLOD_OK ? tetlod_series_info(forms.series)->times[forms.step] : 0;
    if (status == TETLOD_OK)
        status = ask_forms(&asking, options, out, error);
    forms_fini(&forms);
    blocked_fini(&asking.blocked);
    free(asking.regions);
    return status;
}
