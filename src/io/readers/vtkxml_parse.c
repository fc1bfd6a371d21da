/* SPDX-License-Identifier: BSD-3-Clause */
/* The text of an array is remembered by its place in the file: numbers and base64 need no decoding by the XML parser.
 * Raw appended data is not XML; parsing stops in front of it. */
#include <expat.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/readers/vtkxml_document.h"
#include "src/util/array.h"

struct parse {
    struct vtkxml_document *document;
    XML_Parser parser;
    struct io_report *report;
    enum vtkxml_section section;
    bool in_array, is_known, has_array; /* has_array: the array whose element is open is the last of the document's */
    char unit[2 * UNIT_SIZE]; /* text of a key */
    size_t unit_length;
    char *path; /* owned: of the blocks that are open, "/BLOCK/.../" */
    size_t *path_ends; /* owned: its length before each of them */
    size_t path_capacity, end_capacity, open_blocks;
    enum tetlod_status status;
    struct tetlod_error *error;
};

static unsigned long line_of(const struct parse *parse)
{
    return (unsigned long)XML_GetCurrentLineNumber(parse->parser);
}

static void fail(struct parse *parse, const char *what, const char *value)
{
    parse->status = tetlodi_fail(parse->error, TETLOD_ERR_MESH, "line %lu: %s '%.60s'", line_of(parse), what, value);
    XML_StopParser(parse->parser, XML_FALSE);
}

static void fail_nomem(struct parse *parse)
{
    parse->status = tetlodi_fail_nomem(parse->error, "the list of arrays", sizeof(struct vtkxml_array));
    XML_StopParser(parse->parser, XML_FALSE);
}

static const char *attribute(const char **attributes, const char *name)
{
    for (; *attributes; attributes += 2)
        if (strcmp(attributes[0], name) == 0)
            return attributes[1];
    return NULL;
}

/* An attribute that is a whole number; `missing` if it is not there. False after a failure. */
static bool number(struct parse *parse, const char **attributes, const char *name, int64_t missing, uint64_t *out)
{
    const char *value = attribute(attributes, name);
    struct text text = {value, value ? value + strlen(value) : NULL};
    int64_t parsed = missing;
    if (value && !text_int(&text, &parsed))
        parsed = -1;
    if (parsed < 0) {
        fail(parse, value ? "this should be a count:" : "this element lacks the attribute", value ? value : name);
        return false;
    }
    *out = (uint64_t)parsed;
    return true;
}

static const struct {
    const char *name;
    enum vtkxml_kind kind;
} kinds[] = {
    {"UnstructuredGrid", VTKXML_UNSTRUCTURED},   {"PUnstructuredGrid", VTKXML_UNSTRUCTURED},
    {"StructuredGrid", VTKXML_STRUCTURED},       {"PStructuredGrid", VTKXML_STRUCTURED},
    {"RectilinearGrid", VTKXML_RECTILINEAR},     {"PRectilinearGrid", VTKXML_RECTILINEAR},
    {"ImageData", VTKXML_IMAGE},                 {"PImageData", VTKXML_IMAGE},
    {"PolyData", VTKXML_POLYGONS},               {"PPolyData", VTKXML_POLYGONS},
    {"vtkMultiBlockDataSet", VTKXML_MULTIBLOCK}, {"vtkPartitionedDataSet", VTKXML_MULTIBLOCK},
    {"vtkPartitionedDataSetCollection", VTKXML_MULTIBLOCK}, {"Collection", VTKXML_COLLECTION},
};

static bool find_kind(const char *type, enum vtkxml_kind *out)
{
    for (size_t k = 0; type && k < sizeof kinds / sizeof *kinds; k++)
        if (strcmp(type, kinds[k].name) == 0) {
            *out = kinds[k].kind;
            return true;
        }
    return false;
}

static bool find_compressor(const char *name, enum vtkxml_compressor *out)
{
    static const char *const names[] = {"", "vtkZLibDataCompressor", "vtkLZ4DataCompressor", "vtkLZMADataCompressor"};
    *out = VTKXML_UNCOMPRESSED;
    for (int c = VTKXML_UNCOMPRESSED; name && c <= VTKXML_LZMA; c++)
        if (strcmp(name, names[c]) == 0) {
            *out = (enum vtkxml_compressor)c;
            return true;
        }
    return !name;
}

/* As many numbers as the attribute should have; false, and nothing is changed, if it has not. */
static bool numbers(const char **attributes, const char *name, int count, double *out)
{
    const char *value = attribute(attributes, name);
    struct text text = {value, value ? value + strlen(value) : NULL};
    double parsed[9];
    for (int i = 0; i < count; i++)
        if (!value || !text_double(&text, false, &parsed[i]))
            return false;
    memcpy(out, parsed, (size_t)count * sizeof *out);
    return true;
}

static void start_file(struct parse *parse, const char **attributes)
{
    struct vtkxml_document *document = parse->document;
    const char *type = attribute(attributes, "type"), *order = attribute(attributes, "byte_order");
    const char *header = attribute(attributes, "header_type"), *compressor = attribute(attributes, "compressor");
    double version;
    if (!find_kind(type, &document->kind)) {
        fail(parse, "VTK files of this type hold no volume that can be read:", type ? type : "");
        return;
    }
    parse->is_known = true;
    document->is_old_lagrange = !numbers(attributes, "version", 1, &version) || version < 2.1;
    document->big_endian = order && strcmp(order, "BigEndian") == 0;
    document->header_size = header && strcmp(header, "UInt64") == 0 ? 8 : 4;
    if (!find_compressor(compressor, &document->compressor))
        fail(parse, "write the file with zlib, lz4 or lzma; there is no reader for the compressor", compressor);
}

/* Six whole numbers: the first and last point along three axes. */
static bool extent_of(struct parse *parse, const char **attributes, const char *name, int64_t out[6])
{
    enum { MOST = 1 << 30 };
    double parsed[6];
    bool good = numbers(attributes, name, 6, parsed);
    for (int i = 0; good && i < 6; i++) {
        good = parsed[i] >= -MOST && parsed[i] <= MOST && (i % 2 == 0 || parsed[i] >= parsed[i - 1]);
        out[i] = good ? (int64_t)parsed[i] : 0;
    }
    if (!good)
        fail(parse, "this element lacks an attribute of six numbers:", name);
    return good;
}

/* The element that is named like the kind of file: what is common to all pieces. */
static void start_whole(struct parse *parse, const char **attributes)
{
    struct vtkxml_document *document = parse->document;
    bool is_structured = document->kind >= VTKXML_STRUCTURED && document->kind <= VTKXML_IMAGE;
    if (is_structured && !extent_of(parse, attributes, "WholeExtent", document->extent))
        return;
    numbers(attributes, "Origin", 3, document->origin);
    numbers(attributes, "Spacing", 3, document->spacing);
    numbers(attributes, "Direction", 9, document->direction);
}

static char *copy_attribute(const char **attributes, const char *name)
{
    const char *value = attribute(attributes, name);
    return strdup(value ? value : "");
}

static void start_piece(struct parse *parse, const char **attributes)
{
    struct vtkxml_document *document = parse->document;
    struct vtkxml_piece piece = {.first_array = document->array_count, .array_end = document->array_count};
    bool is_structured = document->kind >= VTKXML_STRUCTURED && document->kind <= VTKXML_IMAGE;
    bool is_elsewhere = attribute(attributes, "Source") != NULL;
    if (is_structured && !extent_of(parse, attributes, "Extent", piece.extent))
        return;
    if (!is_structured && !is_elsewhere && document->kind == VTKXML_UNSTRUCTURED &&
        (!number(parse, attributes, "NumberOfPoints", -1, &piece.points) ||
         !number(parse, attributes, "NumberOfCells", -1, &piece.cells)))
        return;
    if (is_elsewhere)
        piece.source = copy_attribute(attributes, "Source");
    if ((is_elsewhere && !piece.source) ||
        !ARRAY_RESERVE(document->pieces, document->piece_capacity, document->piece_count + 1)) {
        free(piece.source);
        fail_nomem(parse);
        return;
    }
    document->pieces[document->piece_count++] = piece;
}

/* Elements of a multi-block file that parts are in. */
static bool is_block(const struct parse *parse, const char *name)
{
    return parse->document->kind == VTKXML_MULTIBLOCK &&
           (strcmp(name, "Block") == 0 || strcmp(name, "Piece") == 0 || strcmp(name, "Partitions") == 0);
}

static void start_block(struct parse *parse, const char *name)
{
    size_t end = parse->path ? strlen(parse->path) : 0, length = name ? strlen(name) : 0;
    if (!ARRAY_RESERVE(parse->path, parse->path_capacity, end + length + 3) ||
        !ARRAY_RESERVE(parse->path_ends, parse->end_capacity, parse->open_blocks + 1)) {
        fail_nomem(parse);
        return;
    }
    parse->path_ends[parse->open_blocks++] = end;
    snprintf(parse->path + end, length + 3, "%s%s%s", end ? "" : "/", name ? name : "", length ? "/" : "");
}

static void end_block(struct parse *parse)
{
    if (parse->open_blocks)
        parse->path[parse->path_ends[--parse->open_blocks]] = 0;
}

/* <DataSet file= name= timestep=>: a block, too, though its own file may hold others. Empty ones have no file. */
static void start_part(struct parse *parse, const char **attributes)
{
    struct vtkxml_document *document = parse->document;
    struct vtkxml_part part = {0};
    if (!attribute(attributes, "file"))
        return;
    part.has_time = numbers(attributes, "timestep", 1, &part.time);
    part.file = copy_attribute(attributes, "file");
    start_block(parse, attribute(attributes, attribute(attributes, "name") ? "name" : "part"));
    part.path = parse->status == TETLOD_OK ? strdup(parse->path) : NULL;
    end_block(parse);
    if (!part.file || !part.path ||
        !ARRAY_RESERVE(document->parts, document->part_capacity, document->part_count + 1)) {
        free(part.file);
        free(part.path);
        fail_nomem(parse);
        return;
    }
    document->parts[document->part_count++] = part;
}

static bool find_type(const char *name, enum value_type *out)
{
    static const char *const names[VALUE_TYPES] = {"Int8",   "UInt8", "Int16",  "UInt16",  "Int32",
                                                   "UInt32", "Int64", "UInt64", "Float32", "Float64"};
    for (int t = 0; t < VALUE_TYPES; t++)
        if (name && strcmp(name, names[t]) == 0) {
            *out = (enum value_type)t;
            return true;
        }
    return false;
}

static void start_array(struct parse *parse, const char **attributes)
{
    struct vtkxml_document *document = parse->document;
    const char *name = attribute(attributes, "Name"), *format = attribute(attributes, "format");
    struct vtkxml_array array = {.section = parse->section, .line = line_of(parse)};
    bool is_appended = format && strcmp(format, "appended") == 0;
    bool known = find_type(attribute(attributes, "type"), &array.type);
    parse->has_array = false;
    bool is_data = parse->section == VTKXML_CELL_DATA || parse->section == VTKXML_POINT_DATA;
    if (parse->section == VTKXML_ELSEWHERE || document->piece_count == 0 || document->kind == VTKXML_POLYGONS)
        return;
    if (is_data && !known) {
        io_leave_out(parse->report, &parse->report->skipped_arrays, name ? name : "", name ? strlen(name) : 0);
        return;
    }
    if (!known) {
        const char *type = attribute(attributes, "type");
        fail(parse, "this array is not of numbers, its type is", type ? type : "");
        return;
    }
    array.format = is_appended ? VTKXML_APPENDED : format && strcmp(format,
                                                                    "binary") == 0 ? VTKXML_INLINE : VTKXML_ASCII;
    if (!number(parse, attributes, "NumberOfComponents", 1, &array.components) ||
        !number(parse, attributes, "offset", is_appended ? -1 : 0, &array.offset))
        return;
    array.begin = (size_t)XML_GetCurrentByteIndex(parse->parser) + (size_t)XML_GetCurrentByteCount(parse->parser);
    array.end = array.begin;
    array.name = strdup(name ? name : "");
    if (!array.name || !ARRAY_RESERVE(document->arrays, document->array_capacity, document->array_count + 1)) {
        free(array.name);
        fail_nomem(parse);
        return;
    }
    document->arrays[document->array_count++] = array;
    document->pieces[document->piece_count - 1].array_end = document->array_count;
    parse->in_array = parse->has_array = true;
}

/* An array's unit is the text of one of the keys in it. */
static void XMLCALL on_unit(void *opaque, const char *text, int length)
{
    struct parse *parse = opaque;
    size_t room = sizeof parse->unit - parse->unit_length;
    size_t some = (size_t)length < room ? (size_t)length : room;
    memcpy(parse->unit + parse->unit_length, text, some);
    parse->unit_length += some;
}

static void start_key(struct parse *parse, const char **attributes)
{
    const char *name = attribute(attributes, "name");
    parse->unit_length = 0;
    if (parse->has_array && name && strcmp(name, "UNITS_LABEL") == 0)
        XML_SetCharacterDataHandler(parse->parser, on_unit);
}

static void end_key(struct parse *parse)
{
    XML_SetCharacterDataHandler(parse->parser, NULL);
    if (parse->unit_length)
        unit_set(parse->document->arrays[parse->document->array_count - 1].unit, parse->unit, parse->unit_length);
    parse->unit_length = 0;
}

static void start_appended(struct parse *parse, const char **attributes)
{
    struct vtkxml_document *document = parse->document;
    const char *encoding = attribute(attributes, "encoding");
    document->appended =
        (size_t)XML_GetCurrentByteIndex(parse->parser) + (size_t)XML_GetCurrentByteCount(parse->parser);
    document->appended_raw = encoding && strcmp(encoding, "raw") == 0;
    XML_StopParser(parse->parser, XML_FALSE);
}

static enum vtkxml_section find_section(const char *name)
{
    static const char *const names[] = {"", "PointData", "CellData", "Points", "Cells", "Coordinates"};
    for (int s = VTKXML_POINT_DATA; s <= VTKXML_COORDINATES; s++)
        if (strcmp(name, names[s]) == 0)
            return (enum vtkxml_section)s;
    return VTKXML_ELSEWHERE;
}

/* An array's text ends where it does, or where elements about it begin (VTK writes InformationKeys after the
 * values). */
static void end_array(struct parse *parse)
{
    if (parse->in_array)
        parse->document->arrays[parse->document->array_count - 1].end = (size_t)XML_GetCurrentByteIndex(parse->parser);
    parse->in_array = false;
}

static void XMLCALL on_start(void *opaque, const char *name, const char **attributes)
{
    struct parse *parse = opaque;
    end_array(parse);
    if (strcmp(name, "VTKFile") == 0)
        start_file(parse, attributes);
    else if (!parse->is_known)
        fail(parse, "this is XML, but not a VTK file; its first element is", name);
    else if (is_block(parse, name))
        start_block(parse, attribute(attributes, "name"));
    else if (strcmp(name, "Piece") == 0)
        start_piece(parse, attributes);
    else if (strcmp(name, "DataSet") == 0)
        start_part(parse, attributes);
    else if (strcmp(name, "DataArray") == 0 || strcmp(name, "Array") == 0)
        start_array(parse, attributes);
    else if (strcmp(name, "InformationKey") == 0)
        start_key(parse, attributes);
    else if (strcmp(name, "AppendedData") == 0)
        start_appended(parse, attributes);
    else if (find_section(name) != VTKXML_ELSEWHERE)
        parse->section = find_section(name);
    else if (find_kind(name, &(enum vtkxml_kind){0}))
        start_whole(parse, attributes);
}

static void XMLCALL on_end(void *opaque, const char *name)
{
    struct parse *parse = opaque;
    end_array(parse);
    if (strcmp(name, "InformationKey") == 0)
        end_key(parse);
    if (is_block(parse, name))
        end_block(parse);
    if (find_section(name) != VTKXML_ELSEWHERE)
        parse->section = VTKXML_ELSEWHERE;
}

static enum tetlod_status fail_parser(const struct parse *parse)
{
    return tetlodi_fail_nomem(parse->error, "the XML parser", parse->document->size);
}

static enum tetlod_status feed(struct parse *parse)
{
    enum { CHUNK = 1 << 18 };
    struct vtkxml_document *document = parse->document;
    for (size_t at = 0;;) {
        size_t left = document->size - at, size = left < CHUNK ? left : CHUNK;
        if (XML_Parse(parse->parser, (const char *)document->bytes + at, (int)size, size == left) != XML_STATUS_OK)
            break;
        at += size;
        file_view_pass(document->view, document->bytes + at);
        if (at == document->size)
            return TETLOD_OK;
    }
    enum XML_Error why = XML_GetErrorCode(parse->parser);
    if (why == XML_ERROR_ABORTED)
        return parse->status;
    if (why == XML_ERROR_NO_MEMORY)
        return fail_parser(parse);
    return tetlodi_fail(parse->error, TETLOD_ERR_MESH, "line %lu: not well-formed XML: %s", line_of(parse),
                        why == XML_ERROR_NO_ELEMENTS ? "the file ends too early" : XML_ErrorString(why));
}

/* Appended data begins behind the underscore after its tag. */
static void find_appended(struct vtkxml_document *document)
{
    size_t at = document->appended;
    const unsigned char *found = at < document->size ? memchr(document->bytes + at, '_', document->size - at) : NULL;
    document->appended = found ? (size_t)(found - document->bytes) + 1 : document->size;
    document->text = document->appended_raw && document->file ? document->appended : document->size;
}

enum tetlod_status vtkxml_parse(struct vtkxml_document *document, const struct io_input *input,
                                struct io_report *report,
                                struct tetlod_error *error)
{
    size_t size = input->file ? input->file->size : input->size;
    *document = (struct vtkxml_document){.file = input->file, .size = size, .header_size = 4, .appended = size,
                                          .spacing = {1, 1, 1}, .direction = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    document->bytes = input->bytes;
    document->view = input->view;
    struct parse parse = {.document = document, .report = report, .status = TETLOD_OK, .error = error};
    parse.parser = XML_ParserCreate(NULL);
    if (!parse.parser)
        return fail_parser(&parse);
    XML_SetUserData(parse.parser, &parse);
    XML_SetElementHandler(parse.parser, on_start, on_end);
    enum tetlod_status status = feed(&parse);
    XML_ParserFree(parse.parser);
    free(parse.path);
    free(parse.path_ends);
    find_appended(document);
    return status;
}

void vtkxml_document_fini(struct vtkxml_document *document)
{
    for (size_t a = 0; a < document->array_count; a++)
        free(document->arrays[a].name);
    for (size_t p = 0; p < document->piece_count; p++)
        free(document->pieces[p].source);
    for (size_t p = 0; p < document->part_count; p++) {
        free(document->parts[p].file);
        free(document->parts[p].path);
    }
    free(document->arrays);
    free(document->pieces);
    free(document->parts);
    *document = (struct vtkxml_document){0};
}

const struct vtkxml_array *vtkxml_find(const struct vtkxml_document *document, const struct vtkxml_piece *piece,
                                 enum vtkxml_section section, const char *name)
{
    for (size_t a = piece->first_array; a < piece->array_end; a++) {
        const struct vtkxml_array *array = &document->arrays[a];
        if (array->section == section && (!name || strcmp(array->name, name) == 0))
            return array;
    }
    return NULL;
}
