/* SPDX-License-Identifier: BSD-3-Clause */
#include <jansson.h>
#include <stdio.h>

#include "format/fail.h"
#include "src/measure/measure.h"
#include "src/measure/overlay.h"
#include "src/pipeline/build.h"
#include "src/cli/cli.h"
#include "src/cli/print_json.h"
#include "src/io/io.h"
#include "src/mesh/ids.h"
#include "src/util/parallel.h"

static const char help[] =
    "usage: tetlod compare A B --field NAME [--json]\n"
    "\n"
    "Measures a field of mesh B against mesh A. 'max' is the true largest difference, over the overlay of\n"
    "both meshes; 'sampled' and 'rms' are of all vertices of A and two points inside each of its\n"
    "tetrahedra. A point of A outside B is compared with the closest point of B's boundary. Degenerate\n"
    "tetrahedra have no interpolant: they are left out.\n"
    "\n"
    "      --field NAME  the field; both meshes have it (default: A's first). NAME:mag is a vector's\n"
    "                    magnitude, NAME:0 a component\n"
    "      --threads N   up to 64; 0 (default): all cores\n"
    "      --json        as JSON\n"
    "\n"
    "Errors are fractions of the field's range in A; the domain error, the largest distance of a boundary\n"
    "vertex of one from the other's boundary, is a fraction of the diagonal of A's bounding box.\n";

/* What was found, in the field's units and units of length. */
struct findings {
    double max, domain;
    struct measured measured;
    struct overlay_report overlay;
};

static int print(const struct tetmesh *a, const struct tetmesh *b, uint32_t field, const struct findings *found,
                 bool json)
{
    const struct measured *measured = &found->measured;
    double range[2], diagonal = mesh_diagonal(a);
    point_field_range(&a->fields[field], a->vertex_count, range);
    double fractions[3] = {range_fraction(range, found->max), range_fraction(range, measured->sampled),
                           range_fraction(range, measured->rms)};
    double domain = diagonal > 0 ? found->domain / diagonal : 0;
    if (!json) {
        printf("field         %s, range %.9g .. %.9g\n", a->fields[field].name, range[0], range[1]);
        printf("vertices      %u against %u\n", b->vertex_count, a->vertex_count);
        printf("tetrahedra    %u against %u (%.3f %%)\n", b->tet_count, a->tet_count,
               100.0 * b->tet_count / a->tet_count);
        printf("degenerate    %llu against %llu tetrahedra, left out\n",
               (unsigned long long)found->overlay.degenerate[1],
               (unsigned long long)found->overlay.degenerate[0]);
        printf("max           %.6g %% of the range (%.9g)\n", 100 * fractions[0], found->max);
        printf("sampled       %.6g %% of the range (%.9g)\n", 100 * fractions[1], measured->sampled);
        printf("rms           %.6g %% of the range (%.9g)\n", 100 * fractions[2], measured->rms);
        printf("domain error  %.6g of the diagonal\n", domain);
        return EXIT_DONE;
    }
    json_t *object = json_pack("{s:s, s:[f,f], s:[i,i], s:[i,i], s:[I,I], s:{s:f, s:f, s:f}, s:f}", "field",
                               a->fields[field].name,
                               "range", range[0], range[1], "vertices", (int)a->vertex_count, (int)b->vertex_count,
                               "tets", (int)a->tet_count, (int)b->tet_count, "degenerate_tets",
                               (json_int_t)found->overlay.degenerate[0], (json_int_t)found->overlay.degenerate[1],
                               "errors", "max", fractions[0], "sampled", fractions[1], "rms",
                               fractions[2], "domain_error", domain);
    return cli_print_json(object);
}

/* Field `name` of a mesh, which may be NAME:mag or NAME:0 as in tetlod build. */
static enum tetlod_status find_field(struct tetmesh *mesh, const char *which, const char *name, uint32_t *out,
                                     struct tetlod_error *error)
{
    struct tetlod_error inner = {0};
    struct build_control control;
    enum tetlod_status status = build_control_parse(mesh, name, &control, &inner);
    *out = control.field;
    return status == TETLOD_OK ? status : tetlodi_fail(error, status, "the %s mesh: %s", which, inner.message);
}

static enum tetlod_status find_fields(struct tetmesh *a, struct tetmesh *b, const char *name, uint32_t fields[2],
                                      struct tetlod_error *error)
{
    if (!a->field_count)
        return tetlodi_fail(error, TETLOD_ERR_FIELD, "the first mesh has no field");
    bool ids[MAX_CONTROLS] = {false};
    uint32_t first = 0, count = a->field_count < MAX_CONTROLS ? a->field_count : MAX_CONTROLS;
    ids_find(a->fields, count, a->vertex_count, ids);
    while (first < count && ids[first])
        first++;
    TETLOD_TRY(find_field(a, "first", name ? name : a->fields[first < count ? first : 0].name, &fields[0], error));
    TETLOD_TRY(find_field(b, "second", a->fields[fields[0]].name, &fields[1], error));
    if (b->fields[fields[1]].components != a->fields[fields[0]].components)
        return tetlodi_fail(error, TETLOD_ERR_FIELD, "the second mesh has no field '%.100s' of %u components",
                            a->fields[fields[0]].name, a->fields[fields[0]].components);
    return TETLOD_OK;
}

static enum tetlod_status find(const struct tetmesh *a, const struct tetmesh *b, const uint32_t fields[2],
                               unsigned threads, struct findings *out, struct tetlod_error *error)
{
    struct measure *measure;
    TETLOD_TRY(measure_new(&measure, a, &fields[0], 1, threads, error));
    enum tetlod_status status = measure_mesh(measure, b, &fields[1], threads, &out->measured, &out->domain, error);
    measure_free(measure);
    if (status == TETLOD_OK)
        status = overlay_max(a, &fields[0], b, &fields[1], 1, &(struct overlay_options){.threads = threads}, &out->max,
                             &out->overlay, error);
    if (status == TETLOD_OK && out->measured.sampled > out->max)
        out->max = out->measured.sampled; // at points outside b, and by rounding
    return status;
}

static int compare(const char *path_a, const char *path_b, const char *field, unsigned threads, bool json)
{
    struct tetmesh a = {0}, b = {0};
    struct tetlod_error error = {0};
    struct findings found;
    uint32_t fields[2];
    int result = EXIT_FAILED;
    enum tetlod_status status = io_read(&a, path_a, NULL, NULL, &error);
    if (status == TETLOD_OK)
        status = io_read(&b, path_b, NULL, NULL, &error);
    if (status == TETLOD_OK)
        status = find_fields(&a, &b, field, fields, &error);
    if (status == TETLOD_OK)
        status = find(&a, &b, fields, threads, &found, &error);
    result = status == TETLOD_OK ? print(&a, &b, fields[0], &found, json) : cli_fail(&error);
    tetmesh_fini(&a);
    tetmesh_fini(&b);
    return result;
}

static int run(int argc, char **argv)
{
    static const struct option options[] = {{"field", required_argument, NULL, 'f'},
                                            {"threads", required_argument, NULL, 't'},
                                            {"json", no_argument, NULL, 'j'},
                                            {0}};
    const char *field = NULL;
    uint64_t threads = 0;
    bool json = false;
    for (int option; (option = cli_option(&command_compare, argc, argv, "", options)) != -1;) {
        if (option == 'f')
            field = optarg;
        else if (option == 'j')
            json = true;
        else if (option != 't' ||
                 !cli_parse_count(&command_compare, "threads", optarg, 0, PARALLEL_MAX_THREADS, &threads))
            return EXIT_USAGE;
    }
    if (!cli_operands(&command_compare, argc, 2, "the meshes A and B"))
        return EXIT_USAGE;
    return compare(argv[optind], argv[optind + 1], field, threads ? (unsigned)threads : parallel_cores(), json);
}

const struct command command_compare = {"compare", "measure the error of one mesh against another", help, run};
