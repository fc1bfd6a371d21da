/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Reading CGNS: every zone of every volume base is a block. Sections of elements of lower dimension are passed over;
 * solutions at vertices and in cell centres are fields; where there are several steps in time, FlowSolutionPointers
 * name those of each.
 */
#include <cgnslib.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/services/contain.h"
#include "src/io/readers/readers.h"
#include "src/io/services/time_steps.h"
#include "src/util/array.h"

struct zone {
    int file, base, zone;
    char passed_over[160]; /* names of zones that are not asked for, as far as they fit */
    uint64_t size; /* of the file */
    struct block *block;
    struct io_report *report;
    struct tetlod_error *error;
    bool is_structured;
    cgsize_t points, cells, range[3]; /* range: points along i, j, k */
    bool has_steps;
    uint64_t step;
    /* faces of polyhedra, in the order of their numbers from first_face on */
    cgsize_t first_face, face_count;
    cgsize_t *face_points, *face_offsets; /* owned */
};

enum { SAID = 151 };

/* What the library says is wrong, as one line. */
static const char *library_says(char out[SAID])
{
    size_t length = 0;
    for (const char *c = cg_get_error(); *c && length < SAID - 1; c++)
        if ((unsigned char)*c > ' ')
            out[length++] = *c;
        else if (length && out[length - 1] != ' ')
            out[length++] = ' ';
    out[length] = 0;
    return out;
}

static enum tetlod_status fail(const struct zone *z, const char *what)
{
    char said[SAID];
    return tetlodi_fail(z->error, TETLOD_ERR_MESH, "base %d, zone %d: %s: %.100s", z->base, z->zone, what,
                        library_says(said));
}

static bool plausible(const struct zone *z, int64_t count)
{
    return count >= 0 && (uint64_t)count / 1100 <= z->size;
}

/* ---- points */

static enum tetlod_status read_points(struct zone *z)
{
    static const char *const names[3] = {"CoordinateX", "CoordinateY", "CoordinateZ"};
    cgsize_t first[3] = {1, 1, 1}, last[3] = {z->points, 1, 1};
    int count;
    bool is_double = false;
    if (z->is_structured)
        memcpy(last, z->range, sizeof last);
    if (cg_ncoords(z->file, z->base, z->zone, &count) != CG_OK || count < 3)
        return fail(z, "has not three coordinates");
    for (int c = 1; c <= count; c++) {
        CGNS_ENUMT(DataType_t) type;
        char name[33];
        if (cg_coord_info(z->file, z->base, z->zone, c, &type, name) == CG_OK)
            is_double |= type != CGNS_ENUMV(RealSingle);
    }
    TETLOD_TRY(assemble_points(&z->block->mesh, (uint64_t)z->points, is_double ? TETLOD_FLOAT64 : TETLOD_FLOAT32,
                               z->error));
    double *axis = array_new((size_t)z->points, sizeof *axis);
    enum tetlod_status status = axis ? TETLOD_OK : tetlodi_fail_nomem(z->error, "the points", (uint64_t)z->points * 8);
    for (size_t d = 0; d < 3 && status == TETLOD_OK; d++) {
        if (cg_coord_read(z->file, z->base, z->zone, names[d], CGNS_ENUMV(RealDouble), first, last, axis) != CG_OK)
            status = fail(z, "its coordinates cannot be read");
        for (cgsize_t p = 0; p < z->points && status == TETLOD_OK; p++)
            z->block->mesh.positions[3 * (size_t)p + d] = axis[p];
    }
    free(axis);
    return status;
}

/* ---- cells */

struct element {
    CGNS_ENUMT(ElementType_t) type;
    uint8_t points, vtk_type, kept; /* kept: of its points, those that VTK's type has */
};

static const struct element elements[] = {
    {CGNS_ENUMV(TETRA_4), 4, VTK_TYPE_TET, 4},          {CGNS_ENUMV(TETRA_10), 10, VTK_TYPE_TET10, 10},
    {CGNS_ENUMV(PYRA_5), 5, VTK_TYPE_PYRAMID, 5},       {CGNS_ENUMV(PYRA_13), 13, VTK_TYPE_PYRAMID13, 13},
    {CGNS_ENUMV(PYRA_14), 14, VTK_TYPE_PYRAMID13, 13},  {CGNS_ENUMV(PENTA_6), 6, VTK_TYPE_WEDGE, 6},
    {CGNS_ENUMV(PENTA_15), 15, VTK_TYPE_WEDGE15, 15},   {CGNS_ENUMV(PENTA_18), 18, VTK_TYPE_WEDGE15, 15},
    {CGNS_ENUMV(HEXA_8), 8, VTK_TYPE_HEXAHEDRON, 8},    {CGNS_ENUMV(HEXA_20), 20, VTK_TYPE_HEXAHEDRON20, 20},
    {CGNS_ENUMV(HEXA_27), 27, VTK_TYPE_HEXAHEDRON20, 20},
};

static const struct element *find_element(CGNS_ENUMT(ElementType_t) type)
{
    for (size_t i = 0; i < sizeof elements / sizeof *elements; i++)
        if (elements[i].type == type)
            return &elements[i];
    return NULL;
}

static enum tetlod_status add_element(struct zone *z, const struct element *element, const cgsize_t *numbers)
{
    int64_t corners[27];
    for (int i = 0; i < element->points; i++)
        corners[i] = point_from_one(numbers[i]);
    cells_middles_to_vtk(element->vtk_type, corners);
    return cells_add(&z->block->cells, element->vtk_type, corners, element->kept, z->error);
}

/* Elements of different types: the type in front of each. */
static enum tetlod_status add_mixed(struct zone *z, const cgsize_t *numbers, cgsize_t size, cgsize_t count)
{
    cgsize_t at = 0;
    for (cgsize_t c = 0; c < count; c++) {
        int points = 0;
        if (at >= size || cg_npe((CGNS_ENUMT(ElementType_t))numbers[at], &points) != CG_OK || points <= 0 ||
            points > size - at - 1)
            return tetlodi_fail(z->error, TETLOD_ERR_MESH,
                                "base %d, zone %d: a section of mixed elements does not fit", z->base, z->zone);
        const struct element *element = find_element((CGNS_ENUMT(ElementType_t))numbers[at]);
        if (element)
            TETLOD_TRY(add_element(z, element, numbers + at + 1));
        else
            z->report->skipped_cells++;
        at += points + 1;
    }
    return TETLOD_OK;
}

/* A face by its number, a negative one if it is turned: its index, negative or too large if there is none. */
static cgsize_t face_index(const struct zone *z, cgsize_t number)
{
    return (number < 0 ? ~number : number - 1) - (z->first_face - 1); // the least number has no positive one
}

/* A polyhedron of faces by number. */
static enum tetlod_status add_polyhedron(struct zone *z, const cgsize_t *faces, cgsize_t count)
{
    int64_t *stream;
    size_t size = 1, at = 1;
    for (cgsize_t f = 0; f < count; f++) {
        cgsize_t number = face_index(z, faces[f]);
        if (number < 0 || number >= z->face_count)
            return tetlodi_fail(z->error, TETLOD_ERR_MESH,
                                "base %d, zone %d: a polyhedron has a face that is not there", z->base, z->zone);
        size += 1 + (size_t)(z->face_offsets[number + 1] - z->face_offsets[number]);
    }
    stream = array_new(size, sizeof *stream);
    if (!stream)
        return tetlodi_fail_nomem(z->error, "a polyhedron", size * 8);
    stream[0] = count;
    for (cgsize_t f = 0; f < count; f++) {
        cgsize_t number = face_index(z, faces[f]);
        cgsize_t begin = z->face_offsets[number], end = z->face_offsets[number + 1];
        stream[at++] = end - begin;
        for (cgsize_t i = begin; i < end; i++)
            stream[at++] = point_from_one(z->face_points[i]);
    }
    enum tetlod_status status = cells_add(&z->block->cells, VTK_TYPE_POLYHEDRON, stream, size, z->error);
    free(stream);
    return status;
}

struct section {
    CGNS_ENUMT(ElementType_t) type;
    int number;
    cgsize_t first, count, size;
    cgsize_t *numbers, *offsets; /* owned: of elements that differ in size */
};

static void section_fini(struct section *s)
{
    free(s->numbers);
    free(s->offsets);
    *s = (struct section){0};
}

static bool good_offsets(const struct section *s)
{
    for (cgsize_t c = 0; c < s->count; c++)
        if (s->offsets[c] < 0 || s->offsets[c] > s->offsets[c + 1] || s->offsets[c + 1] > s->size)
            return false;
    return true;
}

static bool is_poly(CGNS_ENUMT(ElementType_t) type)
{
    return type == CGNS_ENUMV(MIXED) || type == CGNS_ENUMV(NGON_n) || type == CGNS_ENUMV(NFACE_n);
}

static enum tetlod_status load_section(struct zone *z, int number, struct section *s)
{
    char name[33];
    cgsize_t last;
    int boundary, parent;
    *s = (struct section){0};
    if (cg_section_read(z->file, z->base, z->zone, number, name, &s->type, &s->first, &last, &boundary,
                        &parent) != CG_OK ||
        cg_ElementDataSize(z->file, z->base, z->zone, number, &s->size) != CG_OK)
        return fail(z, "a section of elements cannot be read");
    s->count = last - s->first + 1;
    if (!plausible(z, s->size) || !plausible(z, s->count) ||
        (find_element(s->type) && s->size / find_element(s->type)->points != s->count))
        return fail(z, "a section has more elements than the file can hold");
    if (!find_element(s->type) && !is_poly(s->type)) {
        s->size = 0; // of lower dimension
        return TETLOD_OK;
    }
    s->number = number;
    if (!is_poly(s->type))
        return TETLOD_OK; // read part by part
    s->numbers = array_new((size_t)s->size, sizeof *s->numbers);
    s->offsets = array_new((size_t)s->count + 1, sizeof *s->offsets);
    if (!s->numbers || !s->offsets)
        return tetlodi_fail_nomem(z->error, "the cells", (uint64_t)s->size * 8);
    int result = cg_poly_elements_read(z->file, z->base, z->zone, number, s->numbers, s->offsets, NULL);
    return result == CG_OK && good_offsets(s) ? TETLOD_OK : fail(z, "a section of elements cannot be read");
}

/* Elements of one size, part by part. */
static enum tetlod_status add_uniform(struct zone *z, const struct section *s, const struct element *element)
{
    enum { PART = 1 << 16 };
    size_t most = s->count < PART ? (size_t)s->count : PART;
    cgsize_t *part = array_new(most * element->points, sizeof *part);
    enum tetlod_status status = part ? TETLOD_OK : tetlodi_fail_nomem(z->error, "the cells",
                                                                      (uint64_t)most * element->points * sizeof *part);
    for (cgsize_t at = 0; at < s->count && status == TETLOD_OK; at += PART) {
        cgsize_t some = s->count - at < PART ? s->count - at : PART;
        if (cg_elements_partial_read(z->file, z->base, z->zone, s->number, s->first + at, s->first + at + some - 1,
                                     part, NULL) != CG_OK)
            status = fail(z, "a section of elements cannot be read");
        for (cgsize_t c = 0; c < some && status == TETLOD_OK; c++)
            status = add_element(z, element, part + c * element->points);
    }
    free(part);
    return status;
}

static enum tetlod_status add_section(struct zone *z, const struct section *s)
{
    const struct element *element = find_element(s->type);
    if (s->type == CGNS_ENUMV(MIXED))
        return add_mixed(z, s->numbers, s->size, s->count);
    if (!element && s->type != CGNS_ENUMV(NFACE_n)) {
        z->report->skipped_cells += s->type == CGNS_ENUMV(NGON_n) ? 0 : (uint64_t)s->count;
        return TETLOD_OK;
    }
    if (element)
        return add_uniform(z, s, element);
    for (cgsize_t c = 0; c < s->count; c++)
        TETLOD_TRY(add_polyhedron(z, s->numbers + s->offsets[c], s->offsets[c + 1] - s->offsets[c]));
    return TETLOD_OK;
}

/* Sections by the numbers of their elements: in that order are the values of cells. */
static int compare_sections(const void *left, const void *right)
{
    const struct section *a = left, *b = right;
    return a->first < b->first ? -1 : a->first > b->first;
}

static enum tetlod_status read_cells(struct zone *z)
{
    int count;
    if (cg_nsections(z->file, z->base, z->zone, &count) != CG_OK || count < 0 || count > 1000000)
        return fail(z, "its sections cannot be read");
    struct section *sections = array_zero((size_t)count, sizeof *sections);
    if (!sections)
        return tetlodi_fail_nomem(z->error, "the sections", (uint64_t)count * sizeof *sections);
    enum tetlod_status status = TETLOD_OK;
    for (int s = 0; s < count && status == TETLOD_OK; s++)
        status = load_section(z, s + 1, &sections[s]);
    qsort(sections, (size_t)count, sizeof *sections, compare_sections);
    for (int s = 0; s < count; s++)
        if (sections[s].type == CGNS_ENUMV(NGON_n) && !z->face_points) { // one section of faces is the rule
            z->first_face = sections[s].first;
            z->face_count = sections[s].count;
            z->face_points = sections[s].numbers;
            z->face_offsets = sections[s].offsets;
            sections[s].numbers = sections[s].offsets = NULL;
        }
    for (int s = 0; s < count && status == TETLOD_OK; s++)
        status = add_section(z, &sections[s]);
    for (int s = 0; s < count; s++)
        section_fini(&sections[s]);
    free(sections);
    return status;
}

/* ---- values */

struct solution {
    int number;
    bool cell;
    int fields;
};

/* The unit of a field that has exponents; the units that they are of may be those of all the base. */
static void read_unit(const struct zone *z, const struct solution *s, int number, char unit[UNIT_SIZE])
{
    enum { COUNT = 5 };
    static const char *const masses[] = {"kg", "g", "slug", "lb"}, *const lengths[] = {"m", "cm", "mm", "ft", "in"},
                             *const temperatures[] = {"K", "degC", "degR", "degF"}, *const angles[] = {"deg", "rad"};
    float singles[COUNT];
    double exponents[COUNT];
    CGNS_ENUMT(DataType_t) type;
    CGNS_ENUMT(MassUnits_t) mass;
    CGNS_ENUMT(LengthUnits_t) length;
    CGNS_ENUMT(TimeUnits_t) time;
    CGNS_ENUMT(TemperatureUnits_t) temperature;
    CGNS_ENUMT(AngleUnits_t) angle;
    if (cg_goto(z->file, z->base, "Zone_t", z->zone, "FlowSolution_t", s->number, "DataArray_t", number,
                "end") != CG_OK ||
        cg_exponents_info(&type) != CG_OK || cg_exponents_read(type == CGNS_ENUMV(RealSingle) ? (void *)singles
                                                               : exponents) != CG_OK)
        return;
    for (int i = 0; i < COUNT && type == CGNS_ENUMV(RealSingle); i++)
        exponents[i] = (double)singles[i];
    for (int depth = 0; cg_units_read(&mass, &length, &time, &temperature, &angle) != CG_OK; depth++)
        if (depth == 3 || cg_gopath(z->file, "..") != CG_OK)
            return;
    const int indices[COUNT] = {(int)mass - 2, (int)length - 2, (int)time - 2, (int)temperature - 2, (int)angle - 2};
    const int counts[COUNT] = {4, 5, 1, 4, 2};
    const char *const seconds[] = {"s"}, *const *const lists[COUNT] = {masses, lengths, seconds, temperatures, angles};
    const char *names[COUNT];
    for (int i = 0; i < COUNT; i++) {
        bool known = indices[i] >= 0 && indices[i] < counts[i];
        if (!known && exponents[i] != 0)
            return;
        names[i] = known ? lists[i][indices[i]] : "";
    }
    unit_of_powers(unit, names, exponents, COUNT);
}

static enum tetlod_status read_field(struct zone *z, const struct solution *s, int first, uint32_t width,
                                     const char *said)
{
    struct tetmesh *mesh = &z->block->mesh;
    cgsize_t from[3] = {1, 1, 1}, to[3] = {s->cell ? z->cells : z->points, 1, 1};
    uint64_t rows = s->cell ? block_cell_count(z->block) : mesh->vertex_count;
    enum tetlod_type kind = TETLOD_FLOAT32;
    bool is_integer = true;
    for (int d = 0; d < 3 && z->is_structured; d++)
        to[d] = z->range[d] - s->cell;
    double *buffer = array_new((size_t)rows, sizeof *buffer);
    enum tetlod_status status = buffer ? TETLOD_OK : tetlodi_fail_nomem(z->error, said, rows * 8);
    if (status == TETLOD_OK)
        status = s->cell ? assemble_cell_field(mesh, said, width, TETLOD_FLOAT64, rows, z->error)
                         : assemble_field(mesh, said, width, TETLOD_FLOAT64, z->error);
    struct point_field *field =
        s->cell ? mesh->cell_fields + mesh->cell_field_count - 1 : mesh->fields + mesh->field_count - 1;
    for (uint32_t d = 0; d < width && status == TETLOD_OK; d++) {
        CGNS_ENUMT(DataType_t) type = CGNS_ENUMV(RealDouble);
        char name[33];
        cg_field_info(z->file, z->base, z->zone, s->number, first + (int)d, &type, name);
        kind = type == CGNS_ENUMV(RealSingle) ? kind : TETLOD_FLOAT64;
        is_integer &= type == CGNS_ENUMV(Integer) || type == CGNS_ENUMV(LongInteger);
        if (cg_field_read(z->file, z->base, z->zone, s->number, name, CGNS_ENUMV(RealDouble), from, to,
                          buffer) != CG_OK)
            status = fail(z, "a field cannot be read");
        for (uint64_t r = 0; r < rows && status == TETLOD_OK; r++)
            field->values[r * width + d] = buffer[r];
    }
    if (status == TETLOD_OK) {
        field->type = kind;
        field->is_integer = is_integer;
        read_unit(z, s, first, field->unit);
    }
    free(buffer);
    return status;
}

static enum tetlod_status read_solution(struct zone *z, const struct solution *s)
{
    for (int f = 1; f <= s->fields;) {
        char names[3][33] = {"", "", ""}, vector[33];
        CGNS_ENUMT(DataType_t) type;
        for (int d = 0; d < 3 && f + d <= s->fields; d++)
            if (cg_field_info(z->file, z->base, z->zone, s->number, f + d, &type, names[d]) != CG_OK)
                return fail(z, "a field cannot be read");
        const char *list[3] = {names[0], names[1], names[2]};
        bool is_vector = assemble_vector_name(list, vector, sizeof vector);
        TETLOD_TRY(read_field(z, s, f, is_vector ? 3 : 1, is_vector ? vector : names[0]));
        f += is_vector ? 3 : 1;
    }
    return TETLOD_OK;
}

/* Counts the fields of a solution that is not read, by their names. */
static void leave_out(const struct zone *z, const struct solution *s)
{
    for (int f = 1; f <= s->fields; f++) {
        char name[33] = "";
        CGNS_ENUMT(DataType_t) type;
        if (cg_field_info(z->file, z->base, z->zone, s->number, f, &type, name) == CG_OK)
            io_leave_out(z->report, &z->report->skipped_arrays, name, strlen(name));
    }
}

/* The name of the step's solution, or "" if the zone does not say. */
static void solution_of_step(const struct zone *z, uint64_t steps, char out[33])
{
    int arrays = 0;
    out[0] = 0;
    if (!z->has_steps || cg_goto(z->file, z->base, "Zone_t", z->zone, "ZoneIterativeData_t", 1, "end") != CG_OK ||
        cg_narrays(&arrays) != CG_OK)
        return;
    for (int a = 1; a <= arrays; a++) {
        char name[33];
        CGNS_ENUMT(DataType_t) type;
        int rank;
        cgsize_t dims[12];
        if (cg_array_info(a, name, &type, &rank, dims) != CG_OK || strcmp(name, "FlowSolutionPointers") != 0 ||
            type != CGNS_ENUMV(Character) || rank != 2 || dims[0] != 32 || (uint64_t)dims[1] != steps)
            continue;
        char *names = array_new((size_t)steps, 32);
        if (names && cg_array_read(a, names) == CG_OK) {
            memcpy(out, names + 32 * z->step, 32);
            out[32] = 0;
            for (size_t length = strlen(out); length && out[length - 1] == ' '; length--)
                out[length - 1] = 0;
        }
        free(names);
    }
}

static enum tetlod_status read_solutions(struct zone *z)
{
    int count;
    char wanted[33];
    if (cg_nsols(z->file, z->base, z->zone, &count) != CG_OK)
        return TETLOD_OK;
    solution_of_step(z, z->report->steps, wanted);
    for (int n = 1; n <= count; n++) {
        char name[33];
        CGNS_ENUMT(GridLocation_t) where;
        struct solution s = {.number = n};
        if (cg_sol_info(z->file, z->base, z->zone, n, name, &where) != CG_OK ||
            cg_nfields(z->file, z->base, z->zone, n, &s.fields) != CG_OK)
            return fail(z, "a solution cannot be read");
        if (wanted[0] && strcmp(name, wanted) != 0 && where == CGNS_ENUMV(Vertex))
            continue;
        s.cell = where == CGNS_ENUMV(CellCenter);
        if ((where != CGNS_ENUMV(Vertex) && !s.cell) || (s.cell && (uint64_t)z->cells != block_cell_count(z->block)))
            leave_out(z, &s);
        else
            TETLOD_TRY(read_solution(z, &s));
    }
    return TETLOD_OK;
}

/* ---- the whole */

static enum tetlod_status read_zone(struct zone *z)
{
    cgsize_t size[9] = {0};
    char name[33];
    CGNS_ENUMT(ZoneType_t) type;
    if (cg_zone_type(z->file, z->base, z->zone, &type) != CG_OK ||
        cg_zone_read(z->file, z->base, z->zone, name, size) != CG_OK)
        return fail(z, "cannot be read");
    z->is_structured = type == CGNS_ENUMV(Structured);
    z->points = size[0];
    z->cells = size[1];
    memcpy(z->range, size, sizeof z->range);
    for (int d = 0; d < 3 && z->is_structured; d++) {
        if (size[d] < 1 || size[d] > INT32_MAX || (d && z->points > INT64_MAX / size[d]))
            return fail(z, "its size does not fit");
        z->points = d ? z->points * size[d] : size[0];
        z->block->dims[d] = (uint32_t)size[d];
    }
    if (!plausible(z, z->points) || !plausible(z, z->is_structured ? 0 : z->cells))
        return fail(z, "has more points than the file can hold");
    TETLOD_TRY(read_points(z));
    if (z->is_structured)
        z->cells = (cgsize_t)block_cell_count(z->block);
    else
        TETLOD_TRY(read_cells(z));
    return read_solutions(z);
}

static enum tetlod_status choose_step(struct zone *z, const struct io_read_options *options)
{
    char name[33];
    int steps = 0, arrays = 0;
    if (cg_biter_read(z->file, z->base, name, &steps) != CG_OK || steps < 1 || !plausible(z, steps))
        return TETLOD_OK;
    double *times = NULL;
    if (cg_goto(z->file, z->base, "BaseIterativeData_t", 1, "end") == CG_OK && cg_narrays(&arrays) == CG_OK)
        for (int a = 1; a <= arrays && !times; a++) {
            CGNS_ENUMT(DataType_t) type;
            int rank;
            cgsize_t dims[12];
            if (cg_array_info(a, name, &type, &rank, dims) == CG_OK && strcmp(name, "TimeValues") == 0 && rank == 1 &&
                dims[0] == steps)
                times = array_zero((size_t)steps, sizeof *times);
            if (times && cg_array_read_as(a, CGNS_ENUMV(RealDouble), times) != CG_OK)
                memset(times, 0, (size_t)steps * sizeof *times);
        }
    enum tetlod_status status = time_steps_pick((uint64_t)steps, times, options, z->report, z->error);
    z->has_steps = true;
    z->step = z->report->step;
    free(times);
    return status;
}

/* Whether the zone is asked for, by its name, its base's, or BASE/ZONE; if not, the message says its name. */
static bool is_wanted(struct zone *z, const char *base, const char *wanted)
{
    char name[33], path[72];
    cgsize_t size[9];
    size_t used = strlen(z->passed_over);
    if (!wanted || cg_zone_read(z->file, z->base, z->zone, name, size) != CG_OK)
        return true; // reading it says why it cannot be read
    snprintf(path, sizeof path, "/%s/%s/", base, name);
    if (block_path_has(path, wanted))
        return true;
    snprintf(z->passed_over + used, sizeof z->passed_over - used, " %s/%s", base, name);
    return false;
}

static enum tetlod_status read_base(struct zone *z, struct blocks *out, const struct io_read_options *options)
{
    char name[33];
    int cell_dimension, dimension, zones;
    if (cg_base_read(z->file, z->base, name, &cell_dimension, &dimension) != CG_OK ||
        cg_nzones(z->file, z->base, &zones) != CG_OK)
        return fail(z, "the base cannot be read");
    if (cell_dimension != 3 || dimension != 3) {
        z->report->flat_blocks++;
        return TETLOD_OK;
    }
    z->has_steps = false;
    TETLOD_TRY(choose_step(z, options));
    z->report->names_blocks = true;
    for (z->zone = 1; z->zone <= zones; z->zone++) {
        if (!is_wanted(z, name, options ? options->block : NULL))
            continue;
        TETLOD_TRY(blocks_add(out, &z->block, z->error));
        enum tetlod_status status = read_zone(z);
        free(z->face_points);
        free(z->face_offsets);
        z->face_points = z->face_offsets = NULL;
        TETLOD_TRY(status);
    }
    return TETLOD_OK;
}

static enum tetlod_status read_file(struct blocks *out, const struct io_input *input, struct io_report *report,
                                    struct tetlod_error *error)
{
    struct zone z = {.size = input->size, .report = report, .error = error};
    char said[SAID];
    int bases;
    if (cg_open(input->path, CG_MODE_READ, &z.file) != CG_OK || cg_nbases(z.file, &bases) != CG_OK)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "is damaged or truncated: %s", library_says(said));
    enum tetlod_status status = TETLOD_OK;
    for (z.base = 1; z.base <= bases && status == TETLOD_OK; z.base++)
        status = read_base(&z, out, input->options);
    if (status == TETLOD_OK && out->count == 0 && !*z.passed_over)
        status = tetlodi_fail(error, TETLOD_ERR_MESH, "has no zone in three dimensions");
    else if (status == TETLOD_OK && out->count == 0)
        status = tetlodi_fail(error, TETLOD_ERR_MESH, "has no base or zone '%.60s'; there are:%s",
                              input->options->block, z.passed_over);
    cg_close(z.file);
    return status;
}

bool cgns_sniff(const unsigned char *bytes, size_t size)
{
    static const char adf[] = "ADF Database Version";
    if (size >= 64)
        for (const unsigned char *at = bytes; at < bytes + 32; at++)
            if (memcmp(at, adf, sizeof adf - 1) == 0)
                return true;
    return size >= 8 && memcmp(bytes, "\x89HDF\r\n\x1a\n", 8) == 0 && sniff_holds(bytes, size < 65536 ? size : 65536,
                                                                                  "CGNSLibraryVersion");
}

enum tetlod_status cgns_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                             struct tetlod_error *error)
{
    if (!input->path)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "is a CGNS file, which cannot be read from memory");
    return contain_read(read_file, out, input, report, error);
}
