/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/readers/xdmf_item.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "format/fail.h"
#include "src/io/services/contain.h"
#include "src/io/readers/readers.h"
#include "src/io/services/h5.h"
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
    return item->numbers || item->doubles ? TETLOD_OK : tetlodi_fail_nomem(error, "the numbers of a DataItem",
                                                                           count * 8);
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
        if (as_numbers ? !text_int(&text, &number) : !text_double(&text, item->type == TETLOD_FLOAT32,
                                                                  &item->doubles[i]))
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

/* Of the first dimension: `count` from `first` on, of `all`. */
struct rows {
    uint64_t first, count, all;
};

enum { PART = 1 << 16 }; // numbers that are converted at a time

static enum tetlod_status load_raw(const struct xml_node *node, const char *path, uint64_t count, bool as_numbers,
                                   struct xdmf_item *item, struct tetlod_error *error)
{
    enum value_type type = value_type_of(node);
    const char *endian = xml_attribute(node, "Endian"), *seek = xml_attribute(node, "Seek");
    bool big_endian = endian && strcasecmp(endian, "Big") == 0;
    struct text text = {seek, seek ? seek + strlen(seek) : NULL};
    struct file_view view;
    struct stat about;
    int64_t from = 0;
    if (stat(path, &about) == 0)
        contain_expect((uint64_t)about.st_size);
    TETLOD_TRY(file_view_path(&view, path, error));
    enum tetlod_status status = TETLOD_OK;
    if ((seek && !text_int(&text, &from)) || from < 0 || (uint64_t)from > view.size ||
        count > (view.size - (uint64_t)from) / value_size(type))
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

/* Of a data set that is larger than what is asked for, only some rows of the first dimension. */
static enum tetlod_status load_set(const struct xml_node *node, const char *path, const char *set_name, uint64_t count,
                                   const struct rows *rows, bool as_numbers, struct xdmf_item *item,
                                   struct tetlod_error *error)
{
    hid_t file;
    struct h5_set set;
    struct stat about;
    if (stat(path, &about) != 0)
        return tetlodi_fail(error, TETLOD_ERR_IO, "line %llu: the file %.100s is not there",
                            (unsigned long long)node->line, path);
    contain_expect((uint64_t)about.st_size);
    TETLOD_TRY(h5_open_file(path, &file, error));
    enum tetlod_status status = h5_open_set(file, set_name, (uint64_t)about.st_size, &set, error);
    if (status == TETLOD_OK) {
        if ((count && count != set.count) || (rows && (set.rank == 0 || set.dims[0] != rows->all)))
            status = fail_at(node, error, "has other Dimensions than its data set");
        const uint64_t first = rows ? rows->first : 0, row_count = rows ? rows->count : set.rank ? set.dims[0] : 1;
        if (status == TETLOD_OK)
            status = make_room(item, set.rank ? row_count * h5_row_size(&set) : 1, as_numbers, error);
        if (status == TETLOD_OK)
            status = as_numbers ? h5_read_numbers(&set, first, row_count, item->numbers, error)
                                : h5_read_doubles(&set, first, row_count, item->doubles, error);
        item->type = set.type;
        item->is_integer = set.is_integer;
        H5Dclose(set.id);
    }
    H5Fclose(file);
    return status;
}

static enum tetlod_status load_file(const struct xdmf_source *source, const struct xml_node *node, bool is_hdf,
                                    uint64_t count, const struct rows *rows, bool as_numbers, struct xdmf_item *item,
                                    struct tetlod_error *error)
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
        status = is_hdf ? load_set(node, path, colon + 1, count, rows, as_numbers, item, error)
                        : load_raw(node, path, count, as_numbers, item, error);
    free(name);
    free(path);
    return status;
}

static bool is_hdf(const struct xml_node *node)
{
    const char *format = xml_attribute(node, "Format");
    return format && strcasecmp(format, "HDF") == 0;
}

/* An item of numbers. `rows` (NULL: all) is for those in HDF5 files. */
static enum tetlod_status load_uniform(const struct xdmf_source *source, const struct xml_node *node,
                                       const struct rows *rows, bool as_numbers,
                                       struct xdmf_item *out, struct tetlod_error *error)
{
    const char *format = xml_attribute(node, "Format");
    uint64_t count = wanted_count(node);
    enum value_type type = value_type_of(node);
    out->type = type == VALUE_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
    out->is_integer = !value_is_float(type);
    if (is_hdf(node) || (format && strcasecmp(format, "Binary") == 0))
        return load_file(source, node, is_hdf(node), count, rows, as_numbers, out, error);
    return load_text(source, node, count, as_numbers, out, error);
}

/* ---- parts of items, and several as one ---- */

enum { MAX_RANK = 8 };

/* Values start, start + stride, ... along each dimension of an item. */
struct slab {
    size_t rank;
    uint64_t dims[MAX_RANK], start[MAX_RANK], stride[MAX_RANK], count[MAX_RANK];
};

static enum tetlod_status take_slab(const struct xml_node *node, const struct xml_node *from, const double *numbers,
                                    uint64_t number_count,
                                    struct slab *out, struct tetlod_error *error)
{
    const char *value = xml_attribute(from, "Dimensions");
    struct text text = {value, value ? value + strlen(value) : NULL};
    int64_t n;
    for (out->rank = 0; value && out->rank < MAX_RANK && text_int(&text, &n) && n > 0; out->rank++)
        out->dims[out->rank] = (uint64_t)n;
    if (out->rank == 0 || number_count != 3 * out->rank)
        return fail_at(node, error,
                       "should have start, stride and count along each of the Dimensions of the DataItem that it is "
                       "of");
    for (size_t d = 0; d < out->rank; d++) {
        const double start = numbers[d], stride = numbers[out->rank + d], count = numbers[2 * out->rank + d];
        if (!(start >= 0 && stride >= 1 && count >= 1 && start + (count - 1) * stride < (double)out->dims[d]))
            return fail_at(node, error, "goes beyond the DataItem that it is of");
        out->start[d] = (uint64_t)start;
        out->stride[d] = (uint64_t)stride;
        out->count[d] = (uint64_t)count;
    }
    return TETLOD_OK;
}

/* Moves what the slab keeps to the front. */
static void keep_slab(const struct slab *slab, struct xdmf_item *item)
{
    uint64_t at[MAX_RANK] = {0}, kept = 0;
    for (bool more = true; more; kept++) {
        uint64_t from = 0;
        for (size_t d = 0; d < slab->rank; d++)
            from = from * slab->dims[d] + slab->start[d] + at[d] * slab->stride[d];
        if (item->numbers)
            item->numbers[kept] = item->numbers[from];
        else
            item->doubles[kept] = item->doubles[from];
        more = false;
        for (size_t d = slab->rank; d > 0 && !more; d--) {
            more = ++at[d - 1] < slab->count[d - 1];
            at[d - 1] = more ? at[d - 1] : 0;
        }
    }
    item->count = kept;
}

static enum tetlod_status load_slab(const struct xdmf_source *source, const struct xml_node *node, bool as_numbers,
                                    struct xdmf_item *out,
                                    struct tetlod_error *error)
{
    const struct xml_node *chosen = xml_child(source->tree, node, "DataItem", NULL);
    const struct xml_node *from = chosen ? xdmf_referred(source,
                                                         xml_child(source->tree, node, "DataItem", chosen)) : NULL;
    struct xdmf_item numbers = {0};
    struct slab slab;
    if (!from || xml_attribute(chosen, "ItemType") ||
        (xml_attribute(from, "ItemType") && strcasecmp(xml_attribute(from, "ItemType"), "Uniform") != 0))
        return fail_at(node, error, "should have two DataItems of numbers: what to take, and what from");
    enum tetlod_status status = load_uniform(source, chosen, NULL, false, &numbers, error);
    if (status == TETLOD_OK)
        status = take_slab(node, from, numbers.doubles, numbers.count, &slab, error);
    xdmf_item_fini(&numbers);
    TETLOD_TRY(status);
    const struct rows rows = {slab.start[0], (slab.count[0] - 1) * slab.stride[0] + 1, slab.dims[0]};
    TETLOD_TRY(load_uniform(source, from, &rows, as_numbers, out, error));
    if (is_hdf(from)) { // it begins with the first row of the slab
        slab.dims[0] = rows.count;
        slab.start[0] = 0;
    }
    uint64_t all = 1;
    for (size_t d = 0; d < slab.rank; d++)
        all = all > out->count / slab.dims[d] ? UINT64_MAX / slab.dims[d] : all * slab.dims[d];
    if (all != out->count)
        return fail_at(from, error, "has other Dimensions than numbers");
    keep_slab(&slab, out);
    return TETLOD_OK;
}

/* JOIN($0, $1, ...): the components of a vector that are items of their own. */
static enum tetlod_status load_join(const struct xdmf_source *source, const struct xml_node *node,
                                    struct xdmf_item *out,
                                    struct tetlod_error *error)
{
    const char *function = xml_attribute(node, "Function");
    size_t width = 0, c = 0;
    for (const struct xml_node *child = NULL; (child = xml_child(source->tree, node, "DataItem", child)) != NULL;)
        width++;
    function += function ? strspn(function, " ") : 0;
    if (!function || strncasecmp(function, "JOIN", 4) != 0 || width == 0)
        return fail_at(node, error, "is of a function that cannot be read: only JOIN of all its DataItems is");
    for (const struct xml_node *child = NULL; (child = xml_child(source->tree, node, "DataItem", child)) != NULL; c++) {
        struct xdmf_item part = {0};
        const struct xml_node *referred = xdmf_referred(source, child);
        enum tetlod_status status = xml_attribute(referred, "ItemType") ? fail_at(child, error,
                                                                                  "in a function should be of numbers")
                                                                        : load_uniform(source, referred, NULL, false,
                                                                                       &part, error);
        if (status == TETLOD_OK && c == 0) {
            out->type = TETLOD_FLOAT32;
            out->is_integer = true;
            status = part.count > SIZE_MAX / 8 / width ? fail_at(node, error, "is too large")
                                                       : make_room(out, part.count * width, false, error);
        }
        if (status == TETLOD_OK && part.count * width != out->count)
            status = fail_at(child, error, "has another number of values than the first");
        out->type = part.type == TETLOD_FLOAT64 ? TETLOD_FLOAT64 : out->type;
        out->is_integer &= part.is_integer;
        for (uint64_t i = 0; i < part.count && status == TETLOD_OK; i++)
            out->doubles[i * width + c] = part.doubles[i];
        xdmf_item_fini(&part);
        TETLOD_TRY(status);
    }
    return TETLOD_OK;
}

enum tetlod_status xdmf_load(const struct xdmf_source *source, const struct xml_node *node, bool as_numbers,
                             struct xdmf_item *out, struct tetlod_error *error)
{
    *out = (struct xdmf_item){0};
    node = xdmf_referred(source, node);
    const char *kind = xml_attribute(node, "ItemType");
    enum tetlod_status status;
    if (!kind || strcasecmp(kind, "Uniform") == 0)
        status = load_uniform(source, node, NULL, as_numbers, out, error);
    else if (strcasecmp(kind, "HyperSlab") == 0)
        status = load_slab(source, node, as_numbers, out, error);
    else if (strcasecmp(kind, "Function") == 0 && !as_numbers)
        status = load_join(source, node, out, error);
    else
        status = fail_at(node, error, "is of a kind that cannot be read: Uniform, HyperSlab and JOIN are");
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
    char name[64], attribute[64], value[160]; /* of [@Name="..."], or "" */
    long number;                              /* of [2] */
};

/* What is in brackets; the path behind them, or NULL if it is nothing known. */
static const char *take_predicate(const char *path, struct step *out)
{
    size_t skip = strcspn(path, "]");
    if (path[1] == '@') {
        const char *name = path + 2, *equals = strchr(name, '='), *quote = equals ? equals + 1 : "",
                   *end = *quote ? strchr(quote + 1, *quote) : NULL;
        if (!end || end > path + skip || (size_t)(end - quote) > sizeof out->value ||
            (size_t)(equals - name) >= sizeof out->attribute)
            return NULL;
        memcpy(out->attribute, name, (size_t)(equals - name));
        memcpy(out->value, quote + 1, (size_t)(end - quote - 1));
    } else
        out->number = strtol(path + 1, NULL, 10);
    return path + skip + (path[skip] == ']');
}

/* Reads the step after a '/'; the rest of the path, or NULL if it is none. */
static const char *take_step(const char *path, struct step *out)
{
    size_t length = strcspn(path, "/[");
    *out = (struct step){.number = 1};
    if (length == 0 || length >= sizeof out->name)
        return NULL;
    memcpy(out->name, path, length);
    for (path += length; path && *path == '[';)
        path = take_predicate(path, out);
    return path;
}

/* The child, or any node, that a step names. */
static const struct xml_node *find_step(const struct xml_tree *tree, const struct xml_node *in, bool anywhere,
                                        const struct step *step)
{
    uint32_t parent = in ? (uint32_t)(in - tree->nodes) : TETLOD_NONE;
    long number = step->number;
    for (size_t n = 0; n < tree->count; n++) {
        const struct xml_node *node = &tree->nodes[n];
        const char *value = step->attribute[0] ? xml_attribute(node, step->attribute) : "";
        if ((anywhere || node->parent == parent) && strcmp(node->name, step->name) == 0 && value &&
            strcmp(value, step->value) == 0 && --number == 0)
            return node;
    }
    return NULL;
}

/* /Xdmf/Domain/Grid[2]/Geometry: children by name and number from 1, predicates [@Name="..."] by attribute; "//" for
 * any depth at the beginning. A last step "*" is not taken. */
static const struct xml_node *follow_path(const struct xml_tree *tree, const char *path)
{
    const struct xml_node *at = NULL;
    while (*path == '/' && (!at || path[1] != '*')) {
        struct step step;
        bool anywhere = !at && path[1] == '/';
        path = take_step(path + 1 + anywhere, &step);
        at = path ? find_step(tree, at, anywhere, &step) : NULL;
        if (!at)
            return NULL;
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

/* The node that an xi:include points to in this document; NULL: none. */
static const struct xml_node *included(const struct xdmf_source *source, const struct xml_node *node)
{
    static const char begin[] = "xpointer(";
    const char *colon = strchr(node->name, ':'), *pointer = xml_attribute(node, "xpointer"),
               *path = pointer ? strstr(pointer, begin) : NULL;
    bool is_include = strcmp(colon ? colon + 1 : node->name, "include") == 0;
    return is_include && path ? follow_path(source->tree, path + sizeof begin - 1) : NULL;
}

const struct xml_node *xdmf_part(const struct xdmf_source *source, const struct xml_node *grid, const char *name)
{
    const struct xml_tree *tree = source->tree;
    const struct xml_node *found = xml_child(tree, grid, name, NULL);
    for (uint32_t n = grid->first_child; !found && n != TETLOD_NONE; n = tree->nodes[n].next) {
        const struct xml_node *from = included(source, &tree->nodes[n]);
        found = from && strcmp(from->name, name) != 0 ? xml_child(tree, from, name, NULL) : from;
    }
    return xdmf_referred(source, found);
}
