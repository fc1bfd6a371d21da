/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/report/features_json.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

#include "format/fail.h"

static json_t *feature_json(const struct feature *feature)
{
    const double *at = feature->at;
    json_t *object = json_pack("{s:s, s:b, s:[f,f,f], s:f, s:f, s:f}", "kind", feature_name(feature->kind), "proven",
                               feature->proven, "at", at[0], at[1], at[2], "lower", feature->range[0], "upper",
                               feature->range[1], "persistence", feature->persistence);
    const double *low = feature->box[0], *high = feature->box[1];
    if (object && feature->proven)
        json_object_set_new(object, "box", json_pack("[f,f,f,f,f,f]", low[0], low[1], low[2], high[0], high[1],
                                                     high[2]));
    return object;
}

static json_t *counts_json(const struct features *features)
{
    json_t *counts = json_object();
    for (int k = 0; k < FEATURE_KINDS && counts; k++) {
        uint32_t proven = features->proven[k];
        json_t *count = features->asked[k] ? json_pack("{s:I}", "proven", (json_int_t)proven) : NULL;
        if (count && features->bounded[k])
            json_object_set_new(count, "at_most", json_integer((json_int_t)proven + features->possible[k]));
        if (count)
            json_object_set_new(counts, feature_name((enum feature_kind)k), count);
    }
    return counts;
}

json_t *features_json(const struct tetlod_info *info, const char *field, const struct feature_answer *answer)
{
    json_t *list = json_array();
    for (size_t i = 0; i < answer->features.count && list; i++)
        json_array_append_new(list, feature_json(&answer->features.list[i]));
    json_t *object = json_pack("{s:s, s:f, s:I, s:o, s:o}", "field", field, "persistence", answer->persistence, "tets",
                               (json_int_t)answer->tets, "counts", counts_json(&answer->features), "features", list);
    if (object && info) {
        json_object_set_new(object, "level", json_integer((json_int_t)answer->level));
        json_object_set_new(object, "error", json_real(answer->error));
        json_object_set_new(object, "bytes", json_integer((json_int_t)answer->bytes));
        json_object_set_new(object, "of_bytes", json_integer((json_int_t)info->bytes));
    }
    return object;
}

struct text {
    const struct tetlodi_sink *sink;
    enum tetlod_status status;
};

static void __attribute__((format(printf, 2, 3))) print(struct text *text, const char *format, ...)
{
    char line[512];
    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    if (text->status == TETLOD_OK)
        text->status = text->sink->write(text->sink->opaque, line, (size_t)length);
}

/* What the file itself refuses is said by the file. */
static enum tetlod_status finish(const struct text *text, struct tetlod_error *error)
{
    return text->status == TETLOD_OK ? TETLOD_OK : tetlodi_fail(error, text->status, "the features cannot be written");
}

enum tetlod_status features_write_csv(const struct features *features, const struct tetlodi_sink *sink,
                                      struct tetlod_error *error)
{
    struct text text = {.sink = sink};
    print(&text, "kind,proven,x,y,z,lower,upper,persistence,x0,y0,z0,x1,y1,z1\n");
    for (size_t i = 0; i < features->count; i++) {
        const struct feature *f = &features->list[i];
        print(&text, "%s,%d,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g", feature_name(f->kind), f->proven, f->at[0], f->at[1],
              f->at[2], f->range[0], f->range[1], f->persistence);
        for (int c = 0; c < 6; c++)
            f->proven ? print(&text, ",%.17g", f->box[c / 3][c % 3]) : print(&text, ",");
        print(&text, "\n");
    }
    return finish(&text, error);
}

struct column {
    const char *name;
    double (*value)(const struct feature *feature);
};

static double kind_of(const struct feature *feature)
{
    return feature->kind;
}

static double proven_of(const struct feature *feature)
{
    return feature->proven;
}

static double lower_of(const struct feature *feature)
{
    return feature->range[0];
}

static double upper_of(const struct feature *feature)
{
    return feature->range[1];
}

static double persistence_of(const struct feature *feature)
{
    return feature->persistence;
}

enum tetlod_status features_write_vtu(const struct features *features, const struct tetlodi_sink *sink,
                                      struct tetlod_error *error)
{
    static const struct column columns[] = {
        {"kind", kind_of}, {"proven", proven_of}, {"lower", lower_of}, {"upper", upper_of},
        {"persistence", persistence_of}};
    struct text text = {.sink = sink};
    size_t count = features->count;
    print(&text, "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\">\n<UnstructuredGrid>\n"
                 "<Piece NumberOfPoints=\"%zu\" NumberOfCells=\"%zu\">\n<PointData>\n", count, count);
    for (size_t c = 0; c < sizeof columns / sizeof *columns; c++) {
        print(&text, "<DataArray type=\"Float64\" Name=\"%s\" format=\"ascii\">\n", columns[c].name);
        for (size_t i = 0; i < count; i++)
            print(&text, "%.17g\n", columns[c].value(&features->list[i]));
        print(&text, "</DataArray>\n");
    }
    print(&text, "</PointData>\n<Points>\n<DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">\n");
    for (size_t i = 0; i < count; i++)
        print(&text, "%.17g %.17g %.17g\n", features->list[i].at[0], features->list[i].at[1], features->list[i].at[2]);
    print(&text, "</DataArray>\n</Points>\n<Cells>\n");
    static const char *const cells[] = {"Int64\" Name=\"connectivity", "Int64\" Name=\"offsets",
                                        "UInt8\" Name=\"types"};
    for (size_t a = 0; a < 3; a++) {
        print(&text, "<DataArray type=\"%s\" format=\"ascii\">\n", cells[a]);
        for (size_t i = 0; i < count; i++)
            print(&text, "%zu\n", a == 2 ? 1 : i + a);
        print(&text, "</DataArray>\n");
    }
    print(&text, "</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n");
    return finish(&text, error);
}
