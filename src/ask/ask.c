/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/ask/ask.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/read/summary.h"
#include "src/util/array.h"

/* A question about one stream. */
struct asking {
    struct tetlod_file *file;
    const struct tetlod_info *info;
    const struct ask_question *question;
    uint32_t fields[2], field_count; /* the quantity's field, and its local bound */
    uint32_t region_field;           /* a cell field */
    double *regions;
    uint32_t finest;                 /* that is there */
    struct tetlodi_summary summary;  /* empty: the stream has none */
};

bool ask_parse_within(const char *text, struct ask_options *out)
{
    char *end;
    double width = strtod(text, &end);
    bool relative = end != text && strcmp(end, "%") == 0;
    if (end == text || (*end && !relative) || !isfinite(width) || width < 0)
        return false;
    out->width = width * (relative ? 0.01 : 1);
    out->relative = relative;
    return true;
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

static enum tetlod_status find_field(struct asking *asking, struct tetlod_error *error)
{
    const struct tetlod_info *info = asking->info;
    TETLOD_TRY(ask_check(info, asking->question, error));
    if (!asking->question->quantity.name[0])
        return TETLOD_OK;
    uint32_t field = tetlod_field_index(info, asking->question->quantity.name);
    asking->fields[asking->field_count++] = field;
    for (uint32_t f = 0; f < info->field_count; f++)
        if (info->fields[f].bounds == field && asking->field_count < 2)
            asking->fields[asking->field_count++] = f;
    return TETLOD_OK;
}

/* What rounding moves of a boundary that keeps its place: of the diagonal (PROOF.md 5). */
static const double KEPT = 1e-12;

/* The volume that the boundary has swept at a level: 0 where it kept its place, infinite if it is not known. */
static double swept_at(const struct asking *asking, uint32_t level)
{
    const struct tetlod_info *info = asking->info;
    if (info->levels[level].domain_error <= KEPT || (level + 1 == info->level_count && info->lossless))
        return 0;
    return level < asking->summary.level_count ? asking->summary.swept[level] : INFINITY;
}

/* Is the question one that a level with another domain can answer? */
static bool allows_sweep(const struct ask_question *question)
{
    return question->function != ASK_AT && question->function != ASK_ALONG && question->function != ASK_MIN &&
           question->function != ASK_MAX;
}

/* A bound of the field's error at any point, in its units; infinite if there is none, or the level's domain does not
 * do. */
static double error_of_level(const struct asking *asking, uint32_t level)
{
    const struct tetlod_info *info = asking->info;
    double swept = swept_at(asking, level);
    if (isinf(swept) || (swept > 0 && !allows_sweep(asking->question)))
        return INFINITY;
    if (!asking->field_count || (level + 1 == info->level_count && info->lossless))
        return 0;
    const struct tetlod_field *field = &info->fields[asking->fields[0]];
    double error = info->levels[level].errors[asking->fields[0] * TETLOD_MEASURES + TETLOD_MAX];
    if (isnan(error))
        return INFINITY;
    return error * (field->range[1] > field->range[0] ? field->range[1] - field->range[0] : 1) * (1 + 1e-12);
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
    return tetlod_cells(asking->file, asking->region_field, asking->regions, error);
}

/* Bytes before the levels, of the levels' frames, and of the regions. */
static enum tetlod_status count_bytes(const struct asking *asking, uint32_t level, uint64_t *out,
                                      struct tetlod_error *error)
{
    size_t count = tetlod_spans(asking->file, TETLOD_NONE, level, asking->fields, asking->field_count, NULL, 0);
    struct tetlod_span *spans = array_new(count, sizeof *spans);
    if (!spans)
        return tetlodi_fail_nomem(error, "the places of the levels", count * sizeof *spans);
    tetlod_spans(asking->file, TETLOD_NONE, level, asking->fields, asking->field_count, spans, count);
    *out = 0;
    for (size_t s = 0; s < count; s++)
        *out += spans[s].size;
    free(spans);
    uint32_t section = asking->regions ? tetlod_cell_section(asking->info, asking->region_field) : TETLOD_NONE;
    uint32_t map = asking->regions && asking->info->cell_rows ? tetlod_section_index(asking->info, "PMAP") : TETLOD_NONE;
    *out += section == TETLOD_NONE ? 0 : asking->info->sections[section].stored;
    *out += map == TETLOD_NONE ? 0 : asking->info->sections[map].stored;
    return TETLOD_OK;
}

/* The quantity's range in the original; of a length, what its components allow. */
static void set_range(const struct asking *asking, double out[2])
{
    const struct tetlod_field *field = &asking->info->fields[asking->fields[0]];
    out[0] = field->range[0];
    out[1] = field->range[1];
    if (asking->question->quantity.component != ASK_LENGTH)
        return;
    out[1] = sqrt((double)field->components) * fmax(fabs(out[0]), fabs(out[1]));
    out[0] = 0;
}

static enum tetlod_status answer(const struct asking *asking, const struct tetlod_cursor *cursor, double error_bound,
                                 struct ask_interval *out, struct tetlod_error *error)
{
    struct tetlod_mesh mesh;
    tetlod_cursor_mesh(cursor, &mesh);
    struct ask_level level = {.positions = mesh.positions, .corners = mesh.corners, .tets = mesh.tets, .components = 1,
                              .error = error_bound, .regions = asking->regions, .swept = swept_at(asking, mesh.level),
                              .volume = asking->summary.level_count ? asking->summary.volume : NAN};
    if (asking->field_count) {
        level.values = mesh.fields[asking->fields[0]];
        level.components = asking->info->fields[asking->fields[0]].components;
        set_range(asking, level.range);
    }
    if (asking->field_count > 1 && error_bound > 0)
        level.bounds = mesh.fields[asking->fields[1]];
    return ask_answer(asking->question, &level, out, error);
}

/* What an answer can be at most, from the least to the greatest. */
static double scale_of(const struct asking *asking, double volume)
{
    double range = 1;
    if (asking->field_count) {
        const struct tetlod_field *field = &asking->info->fields[asking->fields[0]];
        range = field->range[1] - field->range[0];
    }
    switch (asking->question->function) {
    case ASK_VOLUME:
        return volume;
    case ASK_INTEGRAL:
        return volume * range;
    default:
        return range;
    }
}

static bool is_enough(const struct asking *asking, const struct ask_options *options, double volume,
                      const struct ask_interval *interval)
{
    if (asking->question->compare != ASK_NO_LIMIT)
        return ask_decide(asking->question, interval) >= 0;
    return interval->upper - interval->lower <= options->width * (options->relative ? scale_of(asking, volume) : 1);
}

/* The volume of what is asked about, at a level whose domain is the original's. */
static enum tetlod_status measure_volume(const struct asking *asking, const struct tetlod_cursor *cursor, double *out,
                                         struct tetlod_error *error)
{
    struct ask_question question = *asking->question;
    struct asking volume = *asking;
    struct ask_interval interval;
    *out = 0;
    if (question.function != ASK_VOLUME && question.function != ASK_INTEGRAL)
        return TETLOD_OK; // their scale is the range
    question.function = ASK_VOLUME;
    question.side = ASK_NO_LIMIT;
    volume.question = &question;
    volume.field_count = 0;
    TETLOD_TRY(answer(&volume, cursor, 0, &interval, error));
    *out = interval.upper;
    return TETLOD_OK;
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
    bool shifts = question->function != ASK_VOLUME && question->function != ASK_INTEGRAL && question->function != ASK_ALONG;
    if (question->compare != ASK_NO_LIMIT || !shifts || asking->field_count > 1 ||
        question->quantity.component == ASK_LENGTH)
        return true;
    return 2 * bound * (1 - 1e-9) <= options->width * (options->relative ? scale_of(asking, 0) : 1);
}

static enum tetlod_status ask_levels(const struct asking *asking, struct tetlod_cursor *cursor,
                                     const struct ask_options *options,
                                     struct ask_result *out, struct tetlod_error *error)
{
    double volume = -1;
    for (uint32_t level = 0; level <= asking->finest; level++) {
        double bound = error_of_level(asking, level);
        if (isinf(bound) || (level < asking->finest && !may_be_enough(asking, options, bound)))
            continue;
        if (options->wanted && !options->wanted(options->opaque))
            return tetlodi_fail(error, TETLOD_ERR_CANCELLED, "cancelled");
        TETLOD_TRY(tetlod_cursor_seek(cursor, level, error));
        if (volume < 0)
            TETLOD_TRY(measure_volume(asking, cursor, &volume, error));
        TETLOD_TRY(answer(asking, cursor, bound, &out->interval, error));
        out->level = level;
        out->exact = bound == 0 && swept_at(asking, level) == 0 && is_linear(asking->question);
        if (is_enough(asking, options, volume, &out->interval))
            break;
    }
    return TETLOD_OK;
}

static enum tetlod_status check_levels(const struct asking *asking, struct tetlod_error *error)
{
    const struct tetlod_info *info = asking->info;
    if (info->inverted_tets && asking->question->function > ASK_ALONG)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "%llu of its tetrahedra are inverted: the mesh folds over itself, so that "
                            "volumes and means of it mean nothing", (unsigned long long)info->inverted_tets);
    for (uint32_t level = 0; level <= asking->finest && asking->finest != TETLOD_NONE; level++)
        if (!isinf(error_of_level(asking, level)))
            return TETLOD_OK;
    if (asking->finest == TETLOD_NONE || asking->finest + 1 < info->level_count)
        return tetlodi_fail(error, TETLOD_ERR_TRUNCATED,
                            "it is cut off, and no level that is here certifies an answer");
    return tetlodi_fail(error, TETLOD_ERR_FIELD, "no level certifies an answer: build it with --field %.100s or "
                        "--certify-all, and without --position-bits", asking->question->quantity.name);
}

/* The sums of the original have the whole domain's integrals, but not of lengths. */
static bool find_in_sums(const struct asking *asking, struct ask_interval *out)
{
    const struct ask_question *question = asking->question;
    uint32_t at = 0;
    if (!asking->summary.level_count || (question->function == ASK_VOLUME && question->side != ASK_NO_LIMIT))
        return false;
    double value = asking->summary.volume, volume = value;
    if (question->function != ASK_VOLUME) {
        for (uint32_t f = 0; f < asking->fields[0]; f++)
            at += asking->info->fields[f].components;
        at += question->quantity.component > 0 ? (uint32_t)question->quantity.component : 0;
        value = asking->summary.sums[at][0] / (question->function == ASK_MEAN ? volume : 1);
    }
    *out = (struct ask_interval){value - 1e-12 * fabs(value), value + 1e-12 * fabs(value)};
    return volume > 0 && (question->function == ASK_MEAN || question->function == ASK_INTEGRAL ||
                          question->function == ASK_VOLUME);
}

/* What the bytes before the levels say: the index has the extremes of a field of one component. */
static bool find_before_levels(const struct asking *asking, struct ask_result *out)
{
    const struct ask_question *question = asking->question;
    bool extreme = question->function == ASK_MIN || question->function == ASK_MAX;
    if (question->in_box || question->over_region || question->quantity.component == ASK_LENGTH)
        return false;
    out->exact = true;
    out->bytes = asking->info->levels[0].offset;
    if (!extreme)
        return find_in_sums(asking, &out->interval);
    const struct tetlod_field *field = &asking->info->fields[asking->fields[0]];
    double value = field->range[question->function == ASK_MAX];
    out->interval = (struct ask_interval){value, value};
    return field->components == 1;
}

static enum tetlod_status ask_of_levels(struct asking *asking, const struct ask_options *options,
                                        struct ask_result *out,
                                        struct tetlod_error *error)
{
    struct tetlod_cursor *cursor;
    TETLOD_TRY(check_levels(asking, error));
    TETLOD_TRY(load_regions(asking, error));
    TETLOD_TRY(tetlod_cursor_new(&cursor, asking->file, asking->fields, asking->field_count, error));
    enum tetlod_status status = ask_levels(asking, cursor, options, out, error);
    tetlod_cursor_free(cursor);
    return status == TETLOD_OK ? count_bytes(asking, out->level, &out->bytes, error) : status;
}

enum tetlod_status ask_stream(struct tetlod_file *file, uint32_t finest, const struct ask_question *question,
                              const struct ask_options *options, struct ask_result *out, struct tetlod_error *error)
{
    struct asking asking = {.file = file, .info = tetlod_info(file), .question = question, .finest = finest};
    *out = (struct ask_result){.level = TETLOD_NONE};
    enum tetlod_status status = find_field(&asking, error);
    if (status == TETLOD_OK)
        status = tetlodi_summary_read(file, &asking.summary, error);
    if (status == TETLOD_OK && !find_before_levels(&asking, out))
        status = ask_of_levels(&asking, options, out, error);
    tetlodi_summary_fini(&asking.summary);
    free(asking.regions);
    return status;
}
