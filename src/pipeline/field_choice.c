/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/field_choice.h"

#include <fnmatch.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/ids.h"
#include "src/util/array.h"

struct chosen {
    const struct field_choice *choice;
    struct tetmesh *mesh;
    uint32_t field_count; /* of the mesh as it was: without magnitudes and components */
    bool *ids;            /* [field_count] */
    struct build_control *controls;
    bool named[MAX_CONTROLS]; /* not by a pattern */
    uint32_t count;
    struct tetlod_error *error;
};

/* Whole numbers at one step of a series may be something else at another. */
static void find_ids(struct chosen *chosen)
{
    const struct tetmesh *mesh = chosen->mesh, *later = chosen->choice->later;
    ids_find(mesh->fields, mesh->field_count, mesh->vertex_count, chosen->ids);
    for (uint32_t f = 0; f < mesh->field_count && chosen->choice->has_steps && !later; f++)
        chosen->ids[f] = ids_by_kind(&mesh->fields[f]);
    for (uint32_t f = 0; f < mesh->field_count && later; f++) {
        uint32_t same = tetmesh_find_field(later, mesh->fields[f].name);
        if (chosen->ids[f] && same != TETLOD_NONE && !ids_by_kind(&mesh->fields[f]))
            chosen->ids[f] =
                ids_by_values(&later->fields[same], (size_t)later->fields[same].components * later->vertex_count);
    }
}

/* What is named replaces what a pattern chose. */
static enum tetlod_status add(struct chosen *chosen, struct build_control control, bool named)
{
    for (uint32_t i = 0; i < chosen->count; i++) {
        if (chosen->controls[i].field != control.field)
            continue;
        if (named && chosen->named[i])
            return tetlodi_fail(chosen->error, TETLOD_ERR_ARGUMENT, "the field %.60s is given twice",
                                chosen->mesh->fields[control.field].name);
        if (named)
            chosen->controls[i] = control;
        chosen->named[i] |= named;
        return TETLOD_OK;
    }
    if (chosen->count == MAX_CONTROLS)
        return tetlodi_fail(chosen->error, TETLOD_ERR_FIELD,
                            "more than %d fields would be controlled; --carry A,B or --field A,B chooses some",
                            MAX_CONTROLS);
    chosen->named[chosen->count] = named;
    chosen->controls[chosen->count++] = control;
    return TETLOD_OK;
}

/* A text's control with the limit that its units give it. */
static enum tetlod_status add_units(struct chosen *chosen, const char *text, double units, struct build_control control)
{
    double range[2];
    if (units > 0 && control.limit > 0)
        return tetlodi_fail(chosen->error, TETLOD_ERR_ARGUMENT,
                            "--field %.60s has a limit already; leave out --abs-error", text);
    point_field_range(&chosen->mesh->fields[control.field], chosen->mesh->vertex_count, range);
    if (units > 0 && units < range[1] - range[0])
        control.limit = units / (range[1] - range[0]);
    return add(chosen, control, true);
}

/* ---- patterns */

static bool is_pattern(const char *text)
{
    return strpbrk(text, "*?[") || strcmp(text, "all") == 0;
}

static bool matches(const char *pattern, const char *name)
{
    return strcmp(pattern, "all") == 0 || fnmatch(pattern, name, 0) == 0;
}

/* Takes the limit off its end. */
static double split_limit(char *pattern)
{
    char *colon = strrchr(pattern, ':');
    double limit = 0;
    if (!colon || !build_control_limit(colon + 1, &limit))
        return 0;
    *colon = 0;
    return limit;
}

static enum tetlod_status add_pattern(struct chosen *chosen, char *pattern)
{
    uint32_t found = 0;
    double limit = split_limit(pattern);
    for (uint32_t f = 0; f < chosen->field_count; f++)
        if (!chosen->ids[f] && matches(pattern, chosen->mesh->fields[f].name)) {
            TETLOD_TRY(add(chosen, (struct build_control){f, limit, 0}, false));
            found++;
        }
    return found ? TETLOD_OK
                 : tetlodi_fail(chosen->error, TETLOD_ERR_FIELD,
                                "--field %.60s: no field that is not ids has such a name", pattern);
}

/* ---- texts */

static enum tetlod_status add_part(struct chosen *chosen, char *part, double units)
{
    struct build_control control;
    struct tetlod_error unknown = {0};
    enum tetlod_status status = build_control_parse(chosen->mesh, part, &control, &unknown);
    if (status == TETLOD_OK)
        return add_units(chosen, part, units, control);
    char *pattern = strdup(part);
    if (!pattern)
        return tetlodi_fail_nomem(chosen->error, "a field's name", strlen(part));
    split_limit(pattern);
    bool several = status == TETLOD_ERR_FIELD && is_pattern(pattern);
    free(pattern);
    if (several && units > 0)
        return tetlodi_fail(chosen->error, TETLOD_ERR_ARGUMENT,
                            "--abs-error belongs to one field, not to all of --field %.60s", part);
    if (several)
        return add_pattern(chosen, part);
    *chosen->error = unknown;
    return status;
}

/* Calls `each` with every part of a list, or with the whole text if a field has that name. */
static enum tetlod_status split(struct chosen *chosen, const char *text, double units,
                                enum tetlod_status (*each)(struct chosen *chosen, char *part, double units))
{
    char *copy = strdup(text), *rest = copy;
    enum tetlod_status status = copy ? TETLOD_OK : tetlodi_fail_nomem(chosen->error, "a list of fields", strlen(text));
    bool whole = tetmesh_find_field(chosen->mesh, text) != TETLOD_NONE || !strchr(text, ',');
    if (status == TETLOD_OK && !whole && units > 0)
        status = tetlodi_fail(chosen->error, TETLOD_ERR_ARGUMENT,
                              "--abs-error belongs to one field, not to all of --field %.60s", text);
    while (status == TETLOD_OK && rest) {
        char *part = rest, *comma = whole ? NULL : strchr(rest, ',');
        rest = comma ? comma + 1 : NULL;
        if (comma)
            *comma = 0;
        status = each(chosen, part, units);
    }
    free(copy);
    return status;
}

/* Those of the usual fields that the list has (NULL: all). */
static enum tetlod_status add_usual(struct chosen *chosen, const char *among)
{
    for (uint32_t f = 0; f < chosen->field_count; f++) {
        if (chosen->choice->first_only && chosen->count)
            break;
        if (!chosen->ids[f] && (!among || field_choice_lists(among, chosen->mesh->fields[f].name)))
            TETLOD_TRY(add(chosen, (struct build_control){.field = f}, false));
    }
    return TETLOD_OK;
}

static enum tetlod_status leave_out(struct chosen *chosen, char *part, double units)
{
    (void)units;
    uint32_t kept = 0, found = tetmesh_find_field(chosen->mesh, part) != TETLOD_NONE;
    for (uint32_t i = 0; i < chosen->count; i++) {
        const char *name = chosen->mesh->fields[chosen->controls[i].field].name;
        bool out = strcmp(part, name) == 0 || (is_pattern(part) && matches(part, name));
        found += out;
        chosen->named[kept] = chosen->named[i];
        chosen->controls[kept] = chosen->controls[i];
        kept += !out;
    }
    chosen->count = kept;
    if (found)
        return TETLOD_OK;
    struct build_control none;
    return build_control_parse(chosen->mesh, part, &none, chosen->error); // says what there is
}

bool field_choice_lists(const char *list, const char *name)
{
    size_t length = strlen(name);
    for (const char *at = list; at; at = strchr(at, ',')) {
        at += *at == ',';
        if (strncmp(at, name, length) == 0 && (at[length] == ',' || !at[length]))
            return true;
    }
    return false;
}

static void mark_ids(const struct chosen *chosen)
{
    for (uint32_t f = 0; f < chosen->field_count; f++)
        chosen->mesh->fields[f].is_ids = chosen->ids[f];
    for (uint32_t i = 0; i < chosen->count; i++)
        chosen->mesh->fields[chosen->controls[i].field].is_ids = false;
}

static enum tetlod_status choose(struct chosen *chosen)
{
    const struct field_choice *choice = chosen->choice;
    for (uint32_t i = 0; i < choice->count; i++)
        TETLOD_TRY(split(chosen, choice->texts[i], choice->units ? choice->units[i] : 0, add_part));
    if (!choice->count && choice->among)
        TETLOD_TRY(add_usual(chosen, choice->among));
    if (!choice->count && !chosen->count)
        TETLOD_TRY(add_usual(chosen, NULL));
    for (uint32_t i = 0; i < choice->without_count; i++)
        TETLOD_TRY(split(chosen, choice->without[i], 0, leave_out));
    return chosen->count ? TETLOD_OK
                         : build_control_coordinate(chosen->mesh, &chosen->controls[chosen->count++], chosen->error);
}

enum tetlod_status field_choice_make(const struct field_choice *choice, struct tetmesh *mesh,
                                     struct build_control *controls, uint32_t *out_count, struct tetlod_error *error)
{
    struct chosen chosen = {
        .choice = choice, .mesh = mesh, .field_count = mesh->field_count, .controls = controls, .error = error};
    chosen.ids = array_new(mesh->field_count, sizeof *chosen.ids);
    if (!chosen.ids)
        return tetlodi_fail_nomem(error, "the fields", mesh->field_count);
    find_ids(&chosen);
    enum tetlod_status status = choose(&chosen);
    *out_count = chosen.count;
    if (status == TETLOD_OK) {
        build_controls_add_vectors(mesh, controls, out_count);
        chosen.count = *out_count;
        mark_ids(&chosen);
    }
    free(chosen.ids);
    return status;
}
