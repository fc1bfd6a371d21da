/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/xdmf_item.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "format/fail.h"
#include "src/io/formats.h"
#include "src/io/h5.h"
#include "src/util/array.h"
#include "src/util/file.h"

static enum tetlod_status fail_at(const struct xml_node *node, struct tetlod_error *error, const char *what)
{
    return tetlodi_fail(error, TETLOD_ERR_MESH, "line %llu: DataItem %s", (unsigned long long)node->line, what);
}

/* The product of its Dimensions, 0 if there are none. */
static uint64_t wanted_count(const struct xml_node *node)
{
    const char *value = xml_attribute(node, "Dimensions");
    struct text text = {value, value ? value + strlen(value) : NULL};
    uint64_t count = value ? 1 : 0;
    int64_t n;
    while (value && text_int(&text, &n)) {
        if (n < 0 || (n && count > INT64_MAX / (uint64_t)n))
            return UINT64_MAX;
        count *= (uint64_t)n;
    }
    return count;
}

static enum value_type value_type_of(const struct xml_node *node)
{
    const char *type = xml_attribute(node, "NumberType"), *precision = xml_attribute(node, "Precision");
    int bytes = precision && *precision >= '1' && *precision <= '8' ? *precision - '0' : 4;
    type = type ? type : xml_attribute(node, "DataType");
    if (!type || strcasecmp(type, "Float") == 0)
        return bytes == 8 ? VALUE_FLOAT64 : VALUE_FLOAT32;
    if (strcasecmp(type, "Char") == 0)
        return VALUE_INT8;
    if (strcasecmp(type, "UChar") == 0)
        return VALUE_UINT8;
    bool is_unsigned = strcasecmp(type, "UInt") == 0;
    if (bytes == 2)
        return is_unsigned ? VALUE_UINT16 : VALUE_INT16;
    return bytes == 8 ? (is_unsigned ? VALUE_UINT64 : VALUE_INT64) : is_unsigned ? VALUE_UINT32 : VALUE_INT32;
}

static enum tetlod_status make_room(struct xdmf_item *item, uint64_t count, bool as_numbers, struct tetlod_error *error)
{
    item->count = count;
    if (as_numbers)
        item->numbers = array_new((size_t)count, sizeof *item->numbers);
    else
        item->doubles = array_new((size_t)count, sizeof *item->doubles);
    return item->numbers || item->doubles ? TETLOD_OK : tetlodi_fail_nomem(error, "the numbers of a DataItem", count * 8);
}

static enum tetlod_status load_text(const struct xdmf_source *source, const struct xml_node *node, uint64_t count,
                                    bool as_numbers, struct xdmf_item *item, struct tetlod_error *error)
{
    const char *bytes = (const char *)source->tree->bytes;
    struct text text = {bytes + node->begin, bytes + node->end};
    if (count > (node->end - node->begin + 1) / 2)
        return fail_at(node, error, "has fewer numbers than its Dimensions say");
    TETLOD_TRY(make_room(item, count, as_numbers, error));
    for (uint64_t i = 0; i < count; i++) {
        int64_t number;
        if (as_numbers ? !text_int(&text, &number) : !text_double(&text, item->type == TETLOD_FLOAT32, &item->doubles[i]))
            return fail_at(node, error, "has fewer numbers than its Dimensions say, or something else among them");
        if (as_numbers)
            item->numbers[i] = cells_point(number);
        file_view_pass(source->input->view, text.at);
    }
    return TETLOD_OK;
}

/* The text of the item without white space about it. */
static char *copy_text(const struct xdmf_source *source, const struct xml_node *node)
{
    const char *bytes = (const char *)source->tree->bytes;
    struct text text = {bytes + node->begin, bytes + node->end};
    struct text word = text_word(&text);
    return strndup(word.at, (size_t)(word.end - word.at));
}

enum { PART = 1 << 16 }; // numbers that are converted at a time

static enum tetlod_status load_raw(const struct xml_node *node, const char *path, uint64_t count, bool as_numbers,
                                   struct xdmf_item *item, struct tetlod_error *error)
{
    enum value_type type = value_type_of(node);
    const char *endian = xml_attribute(node, "Endian"), *seek = xml_attribute(node, "Seek");
    bool big_endian = endian && strcasecmp(endian, "Big") == 0;
    struct text text = {seek, seek ? seek + strlen(seek) : NULL};
    struct file_view view;
    int64_t from = 0;
    TETLOD_TRY(file_view_path(&view, path, error));
    enum tetlod_status status = TETLOD_OK;
    if ((seek && !text_int(&text, &from)) || from < 0 || (uint64_t)from > view.size || count > (view.size - (uint64_t)from) / value_size(type))
        status = fail_at(node, error, "has more numbers than its file");
    if (status == TETLOD_OK && as_numbers && value_is_float(type))
        status = fail_at(node, error, "should be of integers");
    if (status == TETLOD_OK)
        status = make_room(item, count, as_numbers, error);
    for (uint64_t i = 0; status == TETLOD_OK && i < count; i += PART) {
        const unsigned char *bytes = view.bytes + from + i * value_size(type);
        size_t part = count - i < PART ? (size_t)(count - i) : PART;
        if (as_numbers)
            values_to_points(bytes, type, big_endian, part, item->numbers + i);
        else
            values_to_doubles(bytes, type, big_endian, part, item->doubles + i);
        file_view_pass(&view, bytes);
    }
    file_view_close(&view);
    return status;
}

static enum tetlod_status load_set(const struct xml_node *node, const char *path, const char *set_name, uint64_t count,
                                   bool as_numbers, struct xdmf_item *item, struct tetlod_error *error)
{
    hid_t file;
    struct h5_set set;
    struct stat about;
    if (stat(path, &about) != 0)
        return tetlodi_fail(error, TETLOD_ERR_IO, "line %llu: the file %.100s is not there", (unsigned long long)node->line, path);
    TETLOD_TRY(h5_open_file(path, &file, error));
    enum tetlod_status status = h5_open_set(file, set_name, (uint64_t)about.st_size, &set, error);
    if (status == TETLOD_OK) {
        if (count && count != set.count)
            status = fail_at(node, error, "has other Dimensions than its data set");
        if (status == TETLOD_OK)
            status = make_room(item, set.count, as_numbers, error);
        uint64_t rows = set.rank ? set.dims[0] : 1;
        if (status == TETLOD_OK)
            status = as_numbers ? h5_read_numbers(&set, 0, rows, item->numbers, error) : h5_read_doubles(&set, 0, rows, item->doubles, error);
        item->type = set.type;
        item->is_integer = set.is_integer;
        H5Dclose(set.id);
    }
    H5Fclose(file);
    return status;
}

static enum tetlod_status load_file(const struct xdmf_source *source, const struct xml_node *node, bool is_hdf, uint64_t count,
                                    bool as_numbers, struct xdmf_item *item, struct tetlod_error *error)
{
    char *name = copy_text(source, node), *path = NULL, *colon = name ? strrchr(name, ':') : NULL;
    enum tetlod_status status = name ? TETLOD_OK : tetlodi_fail_nomem(error, "a file's name", 0);
    if (status == TETLOD_OK && is_hdf && !colon)
        status = fail_at(node, error, "should be FILE:PATH");
    if (is_hdf && colon)
        *colon = 0;
    if (status == TETLOD_OK)
        status = io_resolve(source->input, name, &path, error);
    if (status == TETLOD_OK)
        status = is_hdf ? load_set(node, path, colon + 1, count, as_numbers, item, error)
                        : load_raw(node, path, count, as_numbers, item, error);
    free(name);
    free(path);
    return status;
}

enum tetlod_status xdmf_load(const struct xdmf_source *source, const struct xml_node *node, bool as_numbers,
                             struct xdmf_item *out, struct tetlod_error *error)
{
    *out = (struct xdmf_item){0};
    node = xdmf_referred(source, node);
    const char *kind = xml_attribute(node, "ItemType"), *format = xml_attribute(node, "Format");
    uint64_t count = wanted_count(node);
    enum value_type type = value_type_of(node);
    out->type = type == VALUE_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
    out->is_integer = !value_is_float(type);
    if (kind && strcasecmp(kind, "Uniform") != 0)
        return fail_at(node, error, "is of a kind that cannot be read: only Uniform is");
    enum tetlod_status status;
    if (format && strcasecmp(format, "HDF") == 0)
        status = load_file(source, node, true, count, as_numbers, out, error);
    else if (format && strcasecmp(format, "Binary") == 0)
        status = load_file(source, node, false, count, as_numbers, out, error);
    else
        status = load_text(source, node, count, as_numbers, out, error);
    if (status != TETLOD_OK)
        xdmf_item_fini(out);
    return status;
}

void xdmf_item_fini(struct xdmf_item *item)
{
    free(item->doubles);
    free(item->numbers);
    *item = (struct xdmf_item){0};
}

/* One step of a path: its name, and what is in brackets after it. */
struct step {
    char name[64], wanted_name[160]; /* wanted_name: of [@Name="..."], or "" */
    long number;                     /* of [2] */
};

/* Reads the step after a '/'; the rest of the path, or NULL if it is none. */
static const char *take_step(const char *path, struct step *out)
{
    size_t length = strcspn(path, "/["), skip;
    *out = (struct step){.number = 1};
    if (length == 0 || length >= sizeof out->name)
        return NULL;
    memcpy(out->name, path, length);
    path += length;
    if (*path != '[')
        return path;
    skip = strcspn(path, "]");
    if (path[1] == '@') {
        const char *quote = strpbrk(path, "'\""), *end = quote ? strchr(quote + 1, *quote) : NULL;
        if (!end || end > path + skip || (size_t)(end - quote) > sizeof out->wanted_name)
            return NULL;
        memcpy(out->wanted_name, quote + 1, (size_t)(end - quote - 1));
    } else
        out->number = strtol(path + 1, NULL, 10);
    return path + skip + (path[skip] == ']');
}

/* /Xdmf/Domain/Grid[2]/Geometry: children by name and number from 1; a predicate [@Name="..."] by attribute. */
static const struct xml_node *follow_path(const struct xml_tree *tree, const char *path)
{
    const struct xml_node *at = NULL;
    struct step step;
    while (path && *path == '/') {
        path = take_step(path + 1, &step);
        if (!path || (!at && strcmp(tree->nodes[0].name, step.name) != 0))
            return NULL;
        const struct xml_node *child = at ? NULL : &tree->nodes[0];
        while (at && (child = xml_child(tree, at, step.name, child)) != NULL) {
            const char *value = xml_attribute(child, "Name");
            if (step.wanted_name[0] ? value && strcmp(value, step.wanted_name) == 0 : --step.number == 0)
                break;
        }
        if (!child)
            return NULL;
        at = child;
    }
    return at;
}

const struct xml_node *xdmf_referred(const struct xdmf_source *source, const struct xml_node *node)
{
    const char *reference = node ? xml_attribute(node, "Reference") : NULL;
    if (reference && strcmp(reference, "XML") == 0) { // the path is the text
        char *path = copy_text(source, node);
        const struct xml_node *found = path ? follow_path(source->tree, path) : NULL;
        free(path);
        return found ? found : node;
    }
    const struct xml_node *found = reference && *reference == '/' ? follow_path(source->tree, reference) : NULL;
    return found ? found : node;
}
