/* SPDX-License-Identifier: BSD-3-Clause */
#define _GNU_SOURCE // realpath
#include "src/cli/plan.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/file.h"

static const char plan_name[] = "plan.json", program[] = "tetlod " TETLOD_VERSION_STRING;

static enum tetlod_status fail_at(struct tetlod_error *error, const char *path, const char *what)
{
    return tetlodi_fail(error, TETLOD_ERR_IO, "%s: cannot %s: %s", path, what, strerror(errno));
}

/* ---- writing */

/* What tells that a file is still the one that was planned. */
static json_t *describe(const char *path)
{
    struct stat about;
    return stat(path, &about) != 0 ? NULL
                                   : json_pack("[I, I]", (json_int_t)about.st_size, (json_int_t)about.st_mtime);
}

static enum tetlod_status add_input(json_t *inputs, const char *path, struct tetlod_error *error)
{
    json_t *about = path ? describe(path) : NULL;
    if (path && !about)
        return fail_at(error, path, "look at it");
    if (path)
        json_object_set_new(inputs, path, about);
    return TETLOD_OK;
}

static enum tetlod_status make_json(const struct build_request *request, int argc, char **argv, json_t **out,
                                    struct tetlod_error *error)
{
    char here[4096];
    json_t *inputs = json_object(), *arguments = json_array();
    *out = json_pack("{s:s, s:o, s:o}", "program", program, "arguments", arguments, "inputs", inputs);
    if (!*out)
        return tetlodi_fail_nomem(error, "the plan", 4096);
    if (!getcwd(here, sizeof here))
        return fail_at(error, ".", "find the folder");
    json_object_set_new(*out, "folder", json_string(here));
    for (int i = 1; i < argc; i++)
        if (json_array_append_new(arguments, json_string(argv[i])) != 0)
            return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "'%.100s' is not UTF-8, which a plan holds", argv[i]);
    for (uint32_t i = 0; i < request->series.path_count; i++)
        TETLOD_TRY(add_input(inputs, request->series.paths[i], error));
    return add_input(inputs, request->reading.options.solution, error);
}

static enum tetlod_status write_text(const char *path, json_t *json, struct tetlod_error *error)
{
    char *text = json_dumps(json, JSON_INDENT(2) | JSON_PRESERVE_ORDER);
    if (!text)
        return tetlodi_fail_nomem(error, "the plan", 4096);
    enum tetlod_status status = file_write(path, text, strlen(text), error);
    free(text);
    return status;
}

enum tetlod_status plan_write(const char *folder, const struct build_request *request, int argc, char **argv,
                              struct tetlod_error *error)
{
    char path[4096];
    json_t *json = NULL;
    if (mkdir(folder, 0777) != 0 && errno != EEXIST)
        return fail_at(error, folder, "make the folder");
    snprintf(path, sizeof path, "%s/%s", folder, plan_name);
    if (access(path, F_OK) == 0)
        return tetlodi_fail(error, TETLOD_ERR_IO, "%s: is there already; name another folder, or remove this one",
                            path);
    enum tetlod_status status = make_json(request, argc, argv, &json, error);
    if (status == TETLOD_OK)
        status = write_text(path, json, error);
    json_decref(json);
    return status;
}

/* ---- reading */

static enum tetlod_status check_inputs(const json_t *json, struct tetlod_error *error)
{
    const char *path;
    json_t *about;
    json_object_foreach (json_object_get(json, "inputs"), path, about) {
        json_t *now = describe(path);
        bool same = now && json_equal(now, about);
        json_decref(now);
        if (!now)
            return fail_at(error, path, "look at it");
        if (!same)
            return tetlodi_fail(error, TETLOD_ERR_IO,
                                "%s: has changed since the plan was made; tetlod plan begins anew in another folder",
                                path);
    }
    return TETLOD_OK;
}

static enum tetlod_status take_arguments(struct plan *plan, struct tetlod_error *error)
{
    const json_t *arguments = json_object_get(plan->json, "arguments");
    size_t index;
    json_t *argument;
    plan->arguments = array_zero(json_array_size(arguments) + 2 + PLAN_MORE, sizeof *plan->arguments);
    if (!plan->arguments)
        return tetlodi_fail_nomem(error, "the plan", 4096);
    plan_add(plan, "build");
    json_array_foreach (arguments, index, argument)
        if (json_is_string(argument))
            plan_add(plan, json_string_value(argument));
    return TETLOD_OK;
}

enum tetlod_status plan_open(struct plan *out, const char *folder, struct tetlod_error *error)
{
    char path[4096 + 16];
    json_error_t why;
    *out = (struct plan){0};
    if (!realpath(folder, out->folder))
        return fail_at(error, folder, "find the folder");
    snprintf(path, sizeof path, "%s/%s", out->folder, plan_name);
    if (access(path, R_OK) != 0)
        return tetlodi_fail(error, TETLOD_ERR_IO, "%s: there is no plan; make one: tetlod plan %s INPUT", path, folder);
    out->json = json_load_file(path, 0, &why);
    const char *made_by = json_string_value(json_object_get(out->json, "program")),
               *home = json_string_value(json_object_get(out->json, "folder"));
    if (!made_by || !home)
        return tetlodi_fail(error, TETLOD_ERR_IO, "%s: is not a plan: %s", path,
                            out->json ? "members are missing" : why.text);
    if (strcmp(made_by, program) != 0)
        return tetlodi_fail(error, TETLOD_ERR_IO, "%s: is of %.40s, this is %s; all tasks are run by one version", path,
                            made_by, program);
    if (chdir(home) != 0)
        return fail_at(error, home, "go to the folder of the plan");
    TETLOD_TRY(check_inputs(out->json, error));
    return take_arguments(out, error);
}

void plan_add(struct plan *plan, const char *argument)
{
    plan->arguments[plan->count++] = (char *)(uintptr_t)argument; // getopt only moves them
}

void plan_add_option(struct plan *plan, const char *option, const char *value)
{
    if (value) {
        plan_add(plan, option);
        plan_add(plan, value);
    }
}

void plan_close(struct plan *plan)
{
    json_decref(plan->json);
    free(plan->arguments);
    *plan = (struct plan){0};
}
