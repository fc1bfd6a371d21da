/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Reading an OpenFOAM case by the (usually empty) file NAME.foam in its folder: constant/polyMesh (foam_cells.c), and
 * the fields of a time, a folder whose name is a number. Boundary conditions are not read.
 */
#include <dirent.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/io/readers/foam_cells.h"
#include "src/io/readers/readers.h"
#include "src/io/services/pieces.h"
#include "src/io/services/time_steps.h"
#include "src/util/array.h"

struct foam {
    const struct io_input *input;
    struct io_report *report;
    struct tetlod_error *error;
    struct block *block;
    uint64_t cells, points;
};

static enum tetlod_status read_points(struct foam *f)
{
    struct foam_file file;
    double *positions = NULL;
    enum tetlod_status status = foam_open(&file, f->input, "constant/polyMesh/points", f->error);
    enum tetlod_type type = file.binary && file.scalar == VALUE_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
    if (status == TETLOD_OK)
        status = foam_scalars(&file, 3, &positions, &f->points);
    if (status == TETLOD_OK)
        status = foam_end(&file);
    if (status == TETLOD_OK)
        status = assemble_points_of(&f->block->mesh, f->points, &positions, type, f->error);
    free(positions);
    foam_close(&file);
    return status;
}

static uint32_t components_of(const char *class_name, bool *cell)
{
    static const struct {
        const char *name;
        uint32_t components;
    } kinds[] = {{"ScalarField", 1}, {"VectorField", 3}, {"SymmTensorField", 6}, {"TensorField", 9},
                 {"SphericalTensorField", 1}};
    *cell = strncmp(class_name, "vol", 3) == 0;
    const char *rest = *cell ? class_name + 3 : strncmp(class_name, "point", 5) == 0 ? class_name + 5 : "";
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++)
        if (strcmp(rest, kinds[k].name) == 0)
            return kinds[k].components;
    return 0;
}

/* The unit of dimensions [kg m s K mol A cd]; fewer numbers are followed by zeros. */
static void read_dimensions(struct foam_file *file, char unit[UNIT_SIZE])
{
    enum { COUNT = 7 };
    static const char *const names[COUNT] = {"kg", "m", "s", "K", "mol", "A", "cd"};
    double exponents[COUNT] = {0};
    size_t count = 0;
    struct text bracket = foam_token(file), token;
    if (text_is(bracket, "["))
        while (token = foam_token(file), count < COUNT && text_double(&token, false, &exponents[count]))
            count++;
    unit_of_powers(unit, names, exponents, count);
}

/* The values of internalField, one for all or one for each, and their unit. */
static enum tetlod_status internal_values(struct foam_file *file, uint32_t width, uint64_t rows, double **out,
                                          char unit[UNIT_SIZE])
{
    uint64_t count = rows;
    struct text token;
    unit[0] = 0;
    do {
        token = foam_token(file);
        if (token.at == token.end)
            return foam_fail(file, "there is no internalField");
        if (text_is(token, "dimensions"))
            read_dimensions(file, unit);
    } while (!text_is(token, "internalField"));
    if (text_is(foam_token(file), "nonuniform")) {
        foam_token(file); // List<scalar>
        TETLOD_TRY(foam_scalars(file, width, out, &count));
        return count == rows ? TETLOD_OK : foam_fail(file,
                                                     "its internalField has another number of values than there are "
                                                     "cells");
    }
    double row[9];
    if (width > 1 && !text_is(foam_token(file), "("))
        return foam_fail(file, "there should be a ( here");
    for (uint32_t c = 0; c < width; c++) {
        token = foam_token(file);
        if (!text_double(&token, false, &row[c]))
            return foam_fail(file, "there should be a number here");
    }
    *out = array_new((size_t)rows, width * sizeof **out);
    for (uint64_t i = 0; *out && i < rows; i++)
        memcpy(*out + i * width, row, width * sizeof *row);
    return *out ? TETLOD_OK : tetlodi_fail_nomem(file->error, file->name, rows * width * 8);
}

static enum tetlod_status read_field(struct foam *f, const char *path, const char *name)
{
    struct foam_file file;
    struct tetmesh *mesh = &f->block->mesh;
    struct tetlod_error ignored;
    double *values = NULL;
    char unit[UNIT_SIZE];
    bool cell;
    enum tetlod_status status = foam_open(&file, f->input, path, &ignored);
    file.error = f->error;
    if (status != TETLOD_OK) {
        status = foam_end(&file);
        foam_close(&file);
        return status; // OK: it is not a file of OpenFOAM
    }
    uint32_t width = components_of(file.class_name, &cell);
    uint64_t rows = cell ? f->cells : f->points;
    enum tetlod_type type = file.binary && file.scalar == VALUE_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
    if (!width) {
        if (strstr(file.class_name, "Field"))
            io_leave_out(f->report, &f->report->skipped_arrays, name, strlen(name));
        goto done;
    }
    TETLOD_TRY_DONE(internal_values(&file, width, rows, &values, unit));
    TETLOD_TRY_DONE(foam_end(&file));
    TETLOD_TRY_DONE(cell ? assemble_cell_field(mesh, name, width, type, rows, f->error)
                         : assemble_field(mesh, name, width, type, f->error));
    struct point_field *field = cell ? &mesh->cell_fields[mesh->cell_field_count -
                                                          1] : &mesh->fields[mesh->field_count - 1];
    free(field->values);
    field->values = values;
    values = NULL;
    memcpy(field->unit, unit, sizeof field->unit);
done:
    free(values);
    foam_close(&file);
    return status;
}

/* Names are sorted, so that fields are in the same order everywhere. */
static enum tetlod_status read_fields(struct foam *f, const char *folder_path, const char *time)
{
    struct dirent **entries;
    int count = scandir(folder_path, &entries, NULL, alphasort);
    enum tetlod_status status = TETLOD_OK;
    for (int i = 0; i < count; i++) {
        char path[600], name[256];
        size_t length = strlen(entries[i]->d_name);
        snprintf(name, sizeof name, "%s", entries[i]->d_name);
        if (length > 3 && strcmp(name + length - 3, ".gz") == 0)
            name[length - 3] = 0;
        snprintf(path, sizeof path, "%s/%s", time, name);
        if (status == TETLOD_OK && name[0] != '.')
            status = read_field(f, path, name);
        free(entries[i]);
    }
    if (count >= 0)
        free(entries);
    return status;
}

/* The folders whose names are numbers are times. */
static enum tetlod_status read_time(struct foam *f)
{
    struct time_steps steps = {0};
    struct dirent **entries;
    char *folder, chosen[256] = "", path[4400];
    const char *slash = strrchr(f->input->path, '/');
    folder = slash ? strndup(f->input->path, (size_t)(slash - f->input->path) + 1) : strdup("./");
    if (!folder)
        return tetlodi_fail_nomem(f->error, "a file's name", 0);
    int count = scandir(folder, &entries, NULL, alphasort);
    enum tetlod_status status = TETLOD_OK;
    for (int i = 0; i < count && status == TETLOD_OK; i++) {
        struct text text = {entries[i]->d_name, entries[i]->d_name + strlen(entries[i]->d_name)};
        double time;
        if (text_double(&text, false, &time))
            status = time_steps_add(&steps, time, f->error);
    }
    if (status == TETLOD_OK && steps.count)
        status = time_steps_choose(&steps, f->input->options, f->report, f->error);
    for (int i = 0; i < count; i++) {
        struct text text = {entries[i]->d_name, entries[i]->d_name + strlen(entries[i]->d_name)};
        double time;
        if (steps.count && text_double(&text, false, &time) && time == f->report->time)
            snprintf(chosen, sizeof chosen, "%s", entries[i]->d_name);
        free(entries[i]);
    }
    if (count >= 0)
        free(entries);
    snprintf(path, sizeof path, "%.4000s%s", folder, chosen);
    if (status == TETLOD_OK && *chosen)
        status = read_fields(f, path, chosen);
    free(folder);
    time_steps_fini(&steps);
    return status;
}

/* The numbers in the whole mesh, of points or of cells, which decomposePar leaves with a piece; NULL: there are
 * none. */
static enum tetlod_status read_addressing(const struct foam *f, const char *name, uint64_t count, uint64_t **out)
{
    struct foam_file file;
    struct tetlod_error ignored;
    uint32_t *labels = NULL;
    uint64_t labels_count = 0;
    enum tetlod_status status = foam_open(&file, f->input, name, &ignored);
    file.error = f->error;
    if (status != TETLOD_OK) {
        foam_close(&file);
        return TETLOD_OK;
    }
    status = foam_labels(&file, &labels, &labels_count);
    if (status == TETLOD_OK)
        status = foam_end(&file);
    if (status == TETLOD_OK && labels_count != count)
        status = foam_fail(&file, "it has another number of labels than there are points or cells");
    if (status == TETLOD_OK && !(*out = array_new((size_t)count, sizeof **out)))
        status = tetlodi_fail_nomem(f->error, name, count * sizeof **out);
    for (uint64_t i = 0; i < count && status == TETLOD_OK; i++)
        (*out)[i] = labels[i];
    free(labels);
    foam_close(&file);
    return status;
}

static enum tetlod_status read_mesh(struct blocks *out, const struct io_input *input, bool is_piece,
                                    struct io_report *report, struct tetlod_error *error)
{
    struct foam f = {.input = input, .report = report, .error = error};
    TETLOD_TRY(blocks_add(out, &f.block, error));
    TETLOD_TRY(read_points(&f));
    TETLOD_TRY(foam_cells(&f.block->cells, input, error));
    f.cells = f.block->cells.count;
    if (is_piece) {
        TETLOD_TRY(read_addressing(&f, "constant/polyMesh/pointProcAddressing", f.points, &f.block->point_numbers));
        TETLOD_TRY(read_addressing(&f, "constant/polyMesh/cellProcAddressing", f.cells, &f.block->cell_numbers));
    }
    return read_time(&f);
}

/* ---- decomposed cases: a mesh in each folder processor0, processor1, ..., or N meshes in each file of a folder
 * processorsN, or those of pieces A to B in a folder processorsN_A-B (collated) */

/* A folder of files that hold several pieces. */
struct collated {
    char name[48];
    uint32_t count, first, last; /* pieces of the case; those that are here */
};

/* What is in a folder: how many processors, the last time (-1: none), and whether there is a mesh. */
struct contents {
    uint32_t processors;
    struct collated collated; /* that has a piece; count 0: none has */
    double last;
    bool has_mesh;
};

static bool is_processor(const char *name)
{
    static const char start[] = "processor";
    const char *number = name + strlen(start);
    return strncmp(name, start, strlen(start)) == 0 && *number && number[strspn(number, "0123456789")] == 0;
}

/* The number of pieces behind a text that begins there; false: another text, or no such number. */
static bool number_behind(const char **io_name, const char *before, uint32_t *out)
{
    enum { MAX_PIECES = 1 << 20 };
    size_t size = strlen(before), digits = 0;
    uint64_t number = 0;
    if (strncmp(*io_name, before, size) != 0)
        return false;
    for (*io_name += size; **io_name >= '0' && **io_name <= '9' && digits < 8; digits++)
        number = 10 * number + (uint64_t)(*(*io_name)++ - '0');
    *out = (uint32_t)number;
    return digits && number <= MAX_PIECES;
}

/* False: the name is that of something else. */
static bool parse_collated(const char *name, struct collated *out)
{
    const char *at = name;
    if (!number_behind(&at, "processors", &out->count) || !out->count)
        return false;
    out->first = 0;
    out->last = out->count - 1;
    if (*at && (!number_behind(&at, "_", &out->first) || !number_behind(&at, "-", &out->last) || *at))
        return false;
    snprintf(out->name, sizeof out->name, "%.47s", name);
    return out->first <= out->last && out->last < out->count;
}

/* Of several folders that have the piece, the first by name is taken: the one that has all. */
static struct contents look(const char *folder, uint32_t piece)
{
    struct contents out = {.last = -1};
    struct dirent **entries;
    char path[4500];
    int count = scandir(folder, &entries, NULL, alphasort);
    for (int i = 0; i < count; i++) {
        const char *name = entries[i]->d_name;
        struct text text = {name, name + strlen(name)};
        struct collated collated;
        double time;
        if (text_double(&text, false, &time) && time > out.last)
            out.last = time;
        out.processors += is_processor(name);
        if (!out.collated.count && parse_collated(name, &collated) && collated.first <= piece &&
            piece <= collated.last)
            out.collated = collated;
        free(entries[i]);
    }
    if (count >= 0)
        free(entries);
    snprintf(path, sizeof path, "%.4096s/constant/polyMesh", folder);
    out.has_mesh = access(path, F_OK) == 0;
    return out;
}

/* The folder of a piece; *out_part: its place there from 1, or 0: it has a folder for itself. */
static enum tetlod_status find_piece(const char *folder, const struct contents *whole, uint32_t piece,
                                     struct collated *io_collated, char out[48], uint32_t *out_part,
                                     struct tetlod_error *error)
{
    *out_part = 0;
    if (whole->processors) {
        snprintf(out, 48, "processor%" PRIu32, piece);
        return TETLOD_OK;
    }
    if (piece > io_collated->last)
        *io_collated = look(folder, piece).collated;
    if (io_collated->count != whole->collated.count)
        return tetlodi_fail(error, TETLOD_ERR_MESH,
                            "there is no folder processors%" PRIu32 "_A-B that has processor %" PRIu32
                            "; is the case complete?",
                            whole->collated.count, piece);
    memcpy(out, io_collated->name, sizeof io_collated->name);
    *out_part = piece - io_collated->first + 1;
    return TETLOD_OK;
}

/* A case that is decomposed. */
struct decomposed {
    const char *folder;
    const struct contents *whole;
};

static enum tetlod_status read_processor(void *opaque, uint32_t p, struct blocks *out, const struct io_input *input,
                                         struct io_report *report, struct tetlod_error *error)
{
    const struct decomposed *of = opaque;
    struct collated collated = of->whole->collated;
    char path[4500], name[48], *there = NULL;
    struct io_input piece = *input;
    struct tetlod_error inner = {0};
    TETLOD_TRY(find_piece(of->folder, of->whole, p, &collated, name, &piece.part, error));
    snprintf(path, sizeof path, "%s/constant/polyMesh", name);
    TETLOD_TRY(io_resolve(input, path, &there, error)); // is it below the case's folder?
    free(there);
    snprintf(path, sizeof path, "%.4096s/%s/case.foam", of->folder, name);
    piece.path = path;
    enum tetlod_status status = read_mesh(out, &piece, true, report, &inner);
    return status == TETLOD_OK ? status : tetlodi_fail(error, status, "processor%u: %.400s", p, inner.message);
}

/* The pieces meet in points of the same number or, where these are not there, in points that are the same bit for
 * bit. */
static enum tetlod_status read_processors(struct blocks *out, const struct io_input *input, const char *folder,
                                          const struct contents *whole, struct io_report *report,
                                          struct tetlod_error *error)
{
    struct decomposed of = {folder, whole};
    const struct piece_list list = {whole->processors ? whole->processors : whole->collated.count, read_processor, &of};
    return pieces_read(&list, out, input, report, error);
}

/* A case that has been decomposed may still have its mesh as a whole: what has the later results is read. */
enum tetlod_status foam_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                             struct tetlod_error *error)
{
    char folder[4097], first[4200];
    if (!input->path)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "is an OpenFOAM case, which cannot be read from memory");
    const char *slash = strrchr(input->path, '/');
    snprintf(folder, sizeof folder, "%.*s", slash ? (int)(slash - input->path) : 1, slash ? input->path : ".");
    const struct contents whole = look(folder, 0);
    snprintf(first, sizeof first, "%s/%s", folder, whole.processors ? "processor0" : whole.collated.name);
    const struct contents piece = look(first, 0);
    bool decomposed = (whole.processors || whole.collated.count) && piece.has_mesh &&
                      (!whole.has_mesh || piece.last > whole.last);
    return decomposed ? read_processors(out, input, folder, &whole, report, error)
                      : read_mesh(out, input, false, report, error);
}
