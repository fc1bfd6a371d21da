/* SPDX-License-Identifier: BSD-3-Clause */
/* The text of an array is remembered by its place in the file: numbers and base64 need no decoding by the XML parser.
 * Raw appended data is not XML; parsing stops in front of it. */
#include <expat.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/vtu_document.h"
#include "src/util/array.h"

struct parse {
    struct vtu_document *document;
    XML_Parser parser;
    struct io_report *report;
    enum vtu_section section;
    bool in_array, is_grid;
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
    parse->status = tetlodi_fail_nomem(parse->error, "the list of arrays", sizeof(struct vtu_array));
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

static void start_file(struct parse *parse, const char **attributes)
{
    struct vtu_document *document = parse->document;
    const char *type = attribute(attributes, "type"), *order = attribute(attributes, "byte_order");
    const char *header = attribute(attributes, "header_type"), *compressor = attribute(attributes, "compressor");
    if (!type || strcmp(type, "UnstructuredGrid") != 0) {
        fail(parse, "only VTK files of type UnstructuredGrid hold tetrahedra; this one is of type", type ? type : "");
        return;
    }
    parse->is_grid = true;
    document->big_endian = order && strcmp(order, "BigEndian") == 0;
    document->header_size = header && strcmp(header, "UInt64") == 0 ? 8 : 4;
    if (!compressor || !*compressor)
        document->compressor = VTU_UNCOMPRESSED;
    else if (strcmp(compressor, "vtkZLibDataCompressor") == 0)
        document->compressor = VTU_ZLIB;
    else if (strcmp(compressor, "vtkLZ4DataCompressor") == 0)
        document->compressor = VTU_LZ4;
    else
        fail(parse, "write the file with zlib or lz4; there is no reader for the compressor", compressor);
}

static void start_piece(struct parse *parse, const char **attributes)
{
    struct vtu_document *document = parse->document;
    struct vtu_piece piece = {.first_array = document->array_count, .array_end = document->array_count};
    if (!number(parse, attributes, "NumberOfPoints", -1, &piece.points) ||
        !number(parse, attributes, "NumberOfCells", -1, &piece.cells))
        return;
    if (!array_reserve((void **)&document->pieces, &document->piece_capacity, document->piece_count + 1, sizeof piece)) {
        fail_nomem(parse);
        return;
    }
    document->pieces[document->piece_count++] = piece;
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
    struct vtu_document *document = parse->document;
    const char *name = attribute(attributes, "Name"), *format = attribute(attributes, "format");
    struct vtu_array array = {.section = parse->section, .line = line_of(parse)};
    bool is_appended = format && strcmp(format, "appended") == 0;
    bool known = find_type(attribute(attributes, "type"), &array.type);
    parse->report->skipped_arrays += parse->section == VTU_CELL_DATA || (parse->section == VTU_POINT_DATA && !known);
    if (parse->section == VTU_ELSEWHERE || parse->section == VTU_CELL_DATA || document->piece_count == 0 ||
        (parse->section == VTU_POINT_DATA && !known))
        return;
    if (!known) {
        const char *type = attribute(attributes, "type");
        fail(parse, "this array is not of numbers, its type is", type ? type : "");
        return;
    }
    array.format = is_appended ? VTU_APPENDED : format && strcmp(format, "binary") == 0 ? VTU_INLINE : VTU_ASCII;
    if (!number(parse, attributes, "NumberOfComponents", 1, &array.components) ||
        !number(parse, attributes, "offset", is_appended ? -1 : 0, &array.offset))
        return;
    array.begin = (size_t)XML_GetCurrentByteIndex(parse->parser) + (size_t)XML_GetCurrentByteCount(parse->parser);
    array.end = array.begin;
    array.name = strdup(name ? name : "");
    if (!array.name || !array_reserve((void **)&document->arrays, &document->array_capacity, document->array_count + 1,
                                      sizeof array)) {
        free(array.name);
        fail_nomem(parse);
        return;
    }
    document->arrays[document->array_count++] = array;
    document->pieces[document->piece_count - 1].array_end = document->array_count;
    parse->in_array = true;
}

static void start_appended(struct parse *parse, const char **attributes)
{
    struct vtu_document *document = parse->document;
    const char *encoding = attribute(attributes, "encoding");
    size_t at = (size_t)XML_GetCurrentByteIndex(parse->parser) + (size_t)XML_GetCurrentByteCount(parse->parser);
    while (at < document->size && document->bytes[at] != '_')
        at++;
    document->appended = at < document->size ? at + 1 : at;
    document->appended_raw = encoding && strcmp(encoding, "raw") == 0;
    XML_StopParser(parse->parser, XML_FALSE);
}

static enum vtu_section find_section(const char *name)
{
    static const char *const names[] = {"", "PointData", "CellData", "Points", "Cells"};
    for (int s = VTU_POINT_DATA; s <= VTU_CELLS; s++)
        if (strcmp(name, names[s]) == 0)
            return (enum vtu_section)s;
    return VTU_ELSEWHERE;
}

/* An array's text ends where it does, or where elements about it begin (VTK writes InformationKeys after the values). */
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
    else if (!parse->is_grid)
        fail(parse, "this is XML, but not a VTK file; its first element is", name);
    else if (strcmp(name, "Piece") == 0)
        start_piece(parse, attributes);
    else if (strcmp(name, "DataArray") == 0 || strcmp(name, "Array") == 0)
        start_array(parse, attributes);
    else if (strcmp(name, "AppendedData") == 0)
        start_appended(parse, attributes);
    else if (find_section(name) != VTU_ELSEWHERE)
        parse->section = find_section(name);
}

static void XMLCALL on_end(void *opaque, const char *name)
{
    struct parse *parse = opaque;
    end_array(parse);
    if (find_section(name) != VTU_ELSEWHERE)
        parse->section = VTU_ELSEWHERE;
}

static enum tetlod_status feed(struct parse *parse)
{
    enum { CHUNK = 1 << 24 }; // XML_Parse takes an int
    const struct vtu_document *document = parse->document;
    for (size_t at = 0;;) {
        size_t left = document->size - at, size = left < CHUNK ? left : CHUNK;
        if (XML_Parse(parse->parser, (const char *)document->bytes + at, (int)size, size == left) != XML_STATUS_OK)
            break;
        at += size;
        if (at == document->size)
            return TETLOD_OK;
    }
    enum XML_Error why = XML_GetErrorCode(parse->parser);
    if (why == XML_ERROR_ABORTED)
        return parse->status;
    if (why == XML_ERROR_NO_MEMORY)
        return tetlodi_fail_nomem(parse->error, "the XML parser", document->size);
    return tetlodi_fail(parse->error, TETLOD_ERR_MESH, "line %lu: not well-formed XML: %s", line_of(parse),
                        why == XML_ERROR_NO_ELEMENTS ? "the file ends too early" : XML_ErrorString(why));
}

enum tetlod_status vtu_parse(struct vtu_document *document, const unsigned char *bytes, size_t size,
                             struct io_report *report, struct tetlod_error *error)
{
    *document = (struct vtu_document){.bytes = bytes, .size = size, .header_size = 4, .appended = size};
    struct parse parse = {.document = document, .report = report, .status = TETLOD_OK, .error = error};
    parse.parser = XML_ParserCreate(NULL);
    if (!parse.parser)
        return tetlodi_fail_nomem(error, "the XML parser", 0);
    XML_SetUserData(parse.parser, &parse);
    XML_SetElementHandler(parse.parser, on_start, on_end);
    enum tetlod_status status = feed(&parse);
    XML_ParserFree(parse.parser);
    return status;
}

void vtu_document_fini(struct vtu_document *document)
{
    for (size_t a = 0; a < document->array_count; a++)
        free(document->arrays[a].name);
    free(document->arrays);
    free(document->pieces);
    *document = (struct vtu_document){0};
}

const struct vtu_array *vtu_find(const struct vtu_document *document, const struct vtu_piece *piece,
                                 enum vtu_section section, const char *name)
{
    for (size_t a = piece->first_array; a < piece->array_end; a++) {
        const struct vtu_array *array = &document->arrays[a];
        if (array->section == section && (!name || strcmp(array->name, name) == 0))
            return array;
    }
    return NULL;
}
