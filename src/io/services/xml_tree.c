/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/services/xml_tree.h"

#include <expat.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

struct parse {
    struct xml_tree *tree;
    XML_Parser parser;
    uint32_t at; /* the open element */
    unsigned depth;
    bool nomem, too_deep;
};

static char **copy_attributes(const char **attributes)
{
    size_t count = 0;
    while (attributes[count])
        count++;
    char **copy = array_zero(count + 1, sizeof *copy);
    bool good = copy != NULL;
    for (size_t i = 0; i < count && good; i++) {
        copy[i] = strdup(attributes[i]);
        good = copy[i] != NULL;
    }
    return copy; // one that is cut short ends early
}

static void XMLCALL on_start(void *opaque, const char *name, const char **attributes)
{
    enum { DEEPEST = 200 };
    struct parse *p = opaque;
    struct xml_tree *tree = p->tree;
    p->too_deep = ++p->depth > DEEPEST;
    if (p->too_deep || !ARRAY_RESERVE(tree->nodes, tree->capacity, tree->count + 1)) {
        p->nomem = !p->too_deep;
        XML_StopParser(p->parser, XML_FALSE);
        return;
    }
    size_t begin = (size_t)XML_GetCurrentByteIndex(p->parser) + (size_t)XML_GetCurrentByteCount(p->parser);
    uint32_t number = (uint32_t)tree->count++;
    tree->nodes[number] = (struct xml_node){strdup(name),
                                            copy_attributes(attributes),
                                            begin,
                                            begin,
                                            (uint64_t)XML_GetCurrentLineNumber(p->parser),
                                            p->at,
                                            TETLOD_NONE,
                                            TETLOD_NONE,
                                            TETLOD_NONE};
    if (!tree->nodes[number].name || !tree->nodes[number].attributes) {
        p->nomem = true;
        XML_StopParser(p->parser, XML_FALSE);
        return;
    }
    if (p->at != TETLOD_NONE) {
        struct xml_node *parent = &tree->nodes[p->at];
        if (parent->last_child == TETLOD_NONE)
            parent->first_child = number;
        else
            tree->nodes[parent->last_child].next = number;
        parent->last_child = number;
    }
    p->at = number;
}

static void XMLCALL on_end(void *opaque, const char *name)
{
    struct parse *p = opaque;
    (void)name;
    struct xml_node *node = &p->tree->nodes[p->at];
    size_t end = (size_t)XML_GetCurrentByteIndex(p->parser);
    node->end = end > node->begin ? end : node->begin;
    p->at = node->parent;
    p->depth--;
}

enum tetlod_status xml_tree_parse(struct xml_tree *tree, const unsigned char *bytes, size_t size,
                                  struct file_view *view,
                                  struct tetlod_error *error)
{
    enum { CHUNK = 1 << 20 }; // which is copied
    *tree = (struct xml_tree){.bytes = bytes};
    struct parse p = {.tree = tree, .parser = XML_ParserCreate(NULL), .at = TETLOD_NONE};
    if (!p.parser)
        return tetlodi_fail_nomem(error, "the XML parser", 0);
    XML_SetUserData(p.parser, &p);
    XML_SetElementHandler(p.parser, on_start, on_end);
    bool good = true;
    for (size_t at = 0; good && at < size;) {
        size_t part = size - at < CHUNK ? size - at : CHUNK;
        good = XML_Parse(p.parser, (const char *)bytes + at, (int)part, at + part == size) == XML_STATUS_OK;
        at += part;
        file_view_pass(view, bytes + at);
    }
    enum XML_Error why = XML_GetErrorCode(p.parser);
    unsigned long line = (unsigned long)XML_GetCurrentLineNumber(p.parser);
    XML_ParserFree(p.parser);
    if (p.nomem || why == XML_ERROR_NO_MEMORY)
        return tetlodi_fail_nomem(error, "the XML tree", size);
    if (p.too_deep)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "line %lu: the elements are nested too deep", line);
    if (!good)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "line %lu: not well-formed XML: %s", line,
                            why == XML_ERROR_NO_ELEMENTS ? "the file ends too early" : XML_ErrorString(why));
    return tree->count ? TETLOD_OK : tetlodi_fail(error, TETLOD_ERR_MESH, "holds no XML element");
}

void xml_tree_fini(struct xml_tree *tree)
{
    for (size_t n = 0; n < tree->count; n++) {
        for (char **a = tree->nodes[n].attributes; a && *a; a++)
            free(*a);
        free(tree->nodes[n].attributes);
        free(tree->nodes[n].name);
    }
    free(tree->nodes);
    *tree = (struct xml_tree){0};
}

const char *xml_attribute(const struct xml_node *node, const char *name)
{
    for (char **a = node->attributes; a[0] && a[1]; a += 2)
        if (strcmp(a[0], name) == 0)
            return a[1];
    return NULL;
}

const struct xml_node *xml_child(const struct xml_tree *tree, const struct xml_node *node, const char *name,
                                 const struct xml_node *after)
{
    uint32_t at = after ? after->next : node->first_child;
    while (at != TETLOD_NONE && strcmp(tree->nodes[at].name, name) != 0)
        at = tree->nodes[at].next;
    return at == TETLOD_NONE ? NULL : &tree->nodes[at];
}
