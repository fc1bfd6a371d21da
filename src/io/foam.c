/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Reading an OpenFOAM case by the (usually empty) file NAME.foam in its folder: constant/polyMesh, and the volume fields of a time,
 * a folder whose name is a number. Cells are recognised by their faces: tetrahedra, hexahedra, wedges and pyramids become these, all
 * others polyhedra. Values are those of cells; boundary conditions are not read.
 */
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/foam_text.h"
#include "src/io/formats.h"
#include "src/io/time_steps.h"
#include "src/util/array.h"

struct foam {
    const struct io_input *input;
    struct io_report *report;
    struct tetlod_error *error;
    struct block *block;
    uint64_t faces, cells, points;
    uint32_t *offsets, *corners;     /* owned: of faces */
    uint32_t *owner, *neighbour;     /* owned: cells of faces */
    uint64_t *cell_offsets;          /* owned, cells + 1 */
    uint32_t *cell_faces;            /* owned */
};

/* ---- faces */

/* Text: each face with its own count. */
static enum tetlod_status text_faces(struct foam *f, struct foam_file *file)
{
    size_t capacity = 0, used = 0;
    bool uniform;
    TETLOD_TRY(foam_list(file, file->label, 2, &f->faces, &uniform));
    f->offsets = array_zero((size_t)f->faces + 1, sizeof *f->offsets);
    if (!f->offsets || uniform)
        return uniform ? foam_fail(file, "faces are not uniform") : tetlodi_fail_nomem(f->error, "the faces", f->faces * 8);
    for (uint64_t face = 0; face < f->faces; face++) {
        uint32_t *corners;
        uint64_t count;
        enum tetlod_status status = foam_labels(file, &corners, &count);
        bool good = status == TETLOD_OK && array_reserve((void **)&f->corners, &capacity, used + (size_t)count, sizeof *f->corners);
        if (good && count)
            memcpy(f->corners + used, corners, (size_t)count * sizeof *corners);
        free(corners);
        TETLOD_TRY(status);
        if (!good)
            return tetlodi_fail_nomem(f->error, "the faces", used * 8);
        used += (size_t)count;
        if (used >= TETLOD_NONE)
            return foam_fail(file, "its faces have more points than can be numbered");
        f->offsets[face + 1] = (uint32_t)used;
    }
    return TETLOD_OK;
}

/* Binary: where each face begins, then the points of all. */
static enum tetlod_status compact_faces(struct foam *f, struct foam_file *file)
{
    uint64_t ends, corners;
    TETLOD_TRY(foam_labels(file, &f->offsets, &ends));
    TETLOD_TRY(foam_labels(file, &f->corners, &corners));
    f->faces = ends ? ends - 1 : 0;
    bool good = ends > 0 && f->offsets[0] == 0;
    for (uint64_t i = 0; good && i < f->faces; i++)
        good = f->offsets[i] <= f->offsets[i + 1];
    return good && f->offsets[f->faces] <= corners ? TETLOD_OK : foam_fail(file, "its faces do not fit");
}

static enum tetlod_status read_faces(struct foam *f)
{
    struct foam_file file;
    enum tetlod_status status = foam_open(&file, f->input, "constant/polyMesh/faces", f->error);
    if (status == TETLOD_OK)
        status = strcmp(file.class_name, "faceCompactList") == 0 ? compact_faces(f, &file) : text_faces(f, &file);
    foam_close(&file);
    return status;
}

static enum tetlod_status read_points(struct foam *f)
{
    struct foam_file file;
    double *positions = NULL;
    enum tetlod_status status = foam_open(&file, f->input, "constant/polyMesh/points", f->error);
    enum tetlod_type type = file.binary && file.scalar == VALUE_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
    if (status == TETLOD_OK)
        status = foam_scalars(&file, 3, &positions, &f->points);
    if (status == TETLOD_OK)
        status = assemble_points_of(&f->block->mesh, f->points, &positions, type, f->error);
    free(positions);
    foam_close(&file);
    return status;
}

static enum tetlod_status read_cells_of(struct foam *f, const char *name, uint32_t **out, uint64_t *count)
{
    struct foam_file file;
    *out = NULL;
    enum tetlod_status status = foam_open(&file, f->input, name, f->error);
    if (status == TETLOD_OK)
        status = foam_labels(&file, out, count);
    for (uint64_t i = 0; status == TETLOD_OK && i < *count; i++)
        if ((*out)[i] == TETLOD_NONE || (*out)[i] >= 2 * f->faces + 1)
            status = foam_fail(&file, "a face belongs to a cell that cannot be there");
    for (uint64_t i = 0; status == TETLOD_OK && i < *count; i++)
        f->cells = (uint64_t)(*out)[i] + 1 > f->cells ? (uint64_t)(*out)[i] + 1 : f->cells;
    foam_close(&file);
    return status;
}

/* The faces of each cell. */
static enum tetlod_status gather_faces(struct foam *f)
{
    uint64_t owners, neighbours;
    TETLOD_TRY(read_cells_of(f, "constant/polyMesh/owner", &f->owner, &owners));
    TETLOD_TRY(read_cells_of(f, "constant/polyMesh/neighbour", &f->neighbour, &neighbours));
    if (owners != f->faces || neighbours > f->faces)
        return tetlodi_fail(f->error, TETLOD_ERR_MESH, "constant/polyMesh: there are %llu faces, but %llu owners",
                            (unsigned long long)f->faces, (unsigned long long)owners);
    f->cell_offsets = array_zero((size_t)f->cells + 2, sizeof *f->cell_offsets);
    f->cell_faces = array_new((size_t)(owners + neighbours), sizeof *f->cell_faces);
    if (!f->cell_offsets || !f->cell_faces)
        return tetlodi_fail_nomem(f->error, "the cells", f->cells * 8);
    for (uint64_t i = 0; i < owners; i++)
        f->cell_offsets[f->owner[i] + 2]++;
    for (uint64_t i = 0; i < neighbours; i++)
        f->cell_offsets[f->neighbour[i] + 2]++;
    for (uint64_t c = 0; c + 2 < f->cells + 2; c++)
        f->cell_offsets[c + 2] += f->cell_offsets[c + 1];
    for (uint64_t i = 0; i < owners; i++)
        f->cell_faces[f->cell_offsets[f->owner[i] + 1]++] = (uint32_t)i;
    for (uint64_t i = 0; i < neighbours; i++)
        f->cell_faces[f->cell_offsets[f->neighbour[i] + 1]++] = (uint32_t)i;
    free(f->neighbour);
    f->neighbour = NULL;
    return TETLOD_OK;
}

/* ---- cells */

static uint64_t sides_of(const struct foam *f, uint32_t face)
{
    return f->offsets[face + 1] - f->offsets[face];
}

static bool has_corner(const uint32_t *corners, uint64_t count, int64_t point)
{
    for (uint64_t i = 0; i < count; i++)
        if (corners[i] == point)
            return true;
    return false;
}

/* The point that an edge of the cell joins to `point` outside the base face; -1 if there is none or several. */
static int64_t point_above(const struct foam *f, const uint32_t *faces, uint64_t count, uint32_t base, int64_t point)
{
    const uint32_t *bottom = f->corners + f->offsets[base];
    int64_t above = -1;
    for (uint64_t i = 0; i < count; i++) {
        const uint32_t *corners = f->corners + f->offsets[faces[i]];
        uint64_t sides = sides_of(f, faces[i]);
        for (uint64_t s = 0; s < sides && faces[i] != base; s++) {
            if (corners[s] != point)
                continue;
            const int64_t ends[2] = {corners[(s + 1) % sides], corners[(s + sides - 1) % sides]};
            for (int e = 0; e < 2; e++) {
                if (has_corner(bottom, sides_of(f, base), ends[e]))
                    continue;
                if (above >= 0 && above != ends[e])
                    return -1;
                above = ends[e];
            }
        }
    }
    return above;
}

/* Cell c of these faces by shape: its corners in VTK's order; 0 if it is none of the four. A face's points are counter-clockwise
 * seen from outside its owner; the base's should be so from inside. */
static unsigned char find_shape(const struct foam *f, uint64_t c, const uint32_t *faces, uint64_t count, int64_t corners[8], size_t *corner_count)
{
    unsigned triangles = 0, quads = 0;
    uint32_t base = faces[0];
    for (uint64_t i = 0; i < count; i++) {
        uint64_t sides = sides_of(f, faces[i]);
        triangles += sides == 3;
        quads += sides == 4;
        if (sides != 3 && sides != 4)
            return 0;
    }
    unsigned char type = triangles == 4 && quads == 0   ? VTK_TYPE_TET
                         : triangles == 0 && quads == 6 ? VTK_TYPE_HEXAHEDRON
                         : triangles == 2 && quads == 3 ? VTK_TYPE_WEDGE
                         : triangles == 4 && quads == 1 ? VTK_TYPE_PYRAMID
                                                        : 0;
    uint64_t sides = type == VTK_TYPE_TET || type == VTK_TYPE_WEDGE ? 3 : 4;
    for (uint64_t i = 0; i < count && sides_of(f, base) != sides; i++)
        base = faces[i];
    bool is_cone = type == VTK_TYPE_TET || type == VTK_TYPE_PYRAMID;
    for (uint64_t s = 0; s < sides && type; s++) {
        uint64_t side = f->owner[base] == c ? sides - 1 - s : s;
        corners[s] = f->corners[f->offsets[base] + side];
        int64_t above = point_above(f, faces, count, base, corners[s]);
        if (above < 0 || (is_cone && s && above != corners[sides]))
            return 0;
        corners[sides + (is_cone ? 0 : s)] = above;
    }
    *corner_count = (size_t)(is_cone ? sides + 1 : 2 * sides);
    for (size_t i = 0; i < *corner_count && type; i++)
        for (size_t j = 0; j < i; j++)
            if (corners[i] == corners[j])
                return 0;
    return type;
}

static enum tetlod_status add_polyhedron(struct foam *f, const uint32_t *faces, uint64_t count)
{
    size_t size = 1, at = 1;
    for (uint64_t i = 0; i < count; i++)
        size += 1 + (size_t)sides_of(f, faces[i]);
    int64_t *stream = array_new(size, sizeof *stream);
    if (!stream)
        return tetlodi_fail_nomem(f->error, "a polyhedron", size * 8);
    stream[0] = (int64_t)count;
    for (uint64_t i = 0; i < count; i++) {
        stream[at++] = (int64_t)sides_of(f, faces[i]);
        for (uint32_t c = f->offsets[faces[i]]; c < f->offsets[faces[i] + 1]; c++)
            stream[at++] = f->corners[c];
    }
    enum tetlod_status status = cells_add(&f->block->cells, VTK_TYPE_POLYHEDRON, stream, size, f->error);
    free(stream);
    return status;
}

static enum tetlod_status add_cells(struct foam *f)
{
    for (uint64_t c = 0; c < f->cells; c++) {
        const uint32_t *faces = f->cell_faces + f->cell_offsets[c];
        uint64_t count = f->cell_offsets[c + 1] - f->cell_offsets[c];
        int64_t corners[8];
        size_t corner_count;
        unsigned char type = count ? find_shape(f, c, faces, count, corners, &corner_count) : 0;
        TETLOD_TRY(type ? cells_add(&f->block->cells, type, corners, corner_count, f->error) : add_polyhedron(f, faces, count));
    }
    return TETLOD_OK;
}

/* ---- fields */

static uint32_t components_of(const char *class_name, bool *cell)
{
    static const struct {
        const char *name;
        uint32_t components;
    } kinds[] = {{"ScalarField", 1}, {"VectorField", 3}, {"SymmTensorField", 6}, {"TensorField", 9}, {"SphericalTensorField", 1}};
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
static enum tetlod_status internal_values(struct foam_file *file, uint32_t width, uint64_t rows, double **out, char unit[UNIT_SIZE])
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
        return count == rows ? TETLOD_OK : foam_fail(file, "its internalField has another number of values than there are cells");
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
    if (foam_open(&file, f->input, path, &ignored) != TETLOD_OK) {
        foam_close(&file);
        return TETLOD_OK; // it is not a file of OpenFOAM
    }
    file.error = f->error;
    uint32_t width = components_of(file.class_name, &cell);
    uint64_t rows = cell ? f->cells : f->points;
    enum tetlod_status status = TETLOD_OK;
    enum tetlod_type type = file.binary && file.scalar == VALUE_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
    if (!width) {
        if (strstr(file.class_name, "Field"))
            io_leave_out(f->report, &f->report->skipped_arrays, name, strlen(name));
        goto done;
    }
    TETLOD_TRY_DONE(internal_values(&file, width, rows, &values, unit));
    TETLOD_TRY_DONE(cell ? assemble_cell_field(mesh, name, width, type, rows, f->error) : assemble_field(mesh, name, width, type, f->error));
    struct point_field *field = cell ? &mesh->cell_fields[mesh->cell_field_count - 1] : &mesh->fields[mesh->field_count - 1];
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

static void free_faces(struct foam *f)
{
    free(f->offsets);
    free(f->corners);
    free(f->owner);
    free(f->neighbour);
    free(f->cell_offsets);
    free(f->cell_faces);
    f->offsets = f->corners = f->owner = f->neighbour = NULL;
    f->cell_offsets = NULL;
    f->cell_faces = NULL;
}

enum tetlod_status foam_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                             struct tetlod_error *error)
{
    struct foam f = {.input = input, .report = report, .error = error};
    enum tetlod_status status;
    if (!input->path)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "is an OpenFOAM case, which cannot be read from memory");
    TETLOD_TRY(blocks_add(out, &f.block, error));
    TETLOD_TRY_DONE(read_points(&f));
    TETLOD_TRY_DONE(read_faces(&f));
    TETLOD_TRY_DONE(gather_faces(&f));
    TETLOD_TRY_DONE(add_cells(&f));
    free_faces(&f);
    status = read_time(&f);
done:
    free_faces(&f);
    return status;
}
