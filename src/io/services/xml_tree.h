/* SPDX-License-Identifier: BSD-3-Clause */
/* An XML document as a tree, for formats whose parts refer to one another. Entities beyond XML's own are not expanded,
 * and nothing is fetched. */
#ifndef TETLOD_XML_TREE_H
#define TETLOD_XML_TREE_H

#include <stddef.h>
#include <stdint.h>

#include "format/tetlod.h"
#include "src/util/file.h"

struct xml_node {
    char *name;        /* owned */
    char **attributes; /* owned: name, value, ..., NULL */
    size_t begin, end; /* of the bytes between its tags */
    uint64_t line;
    uint32_t parent, first_child, last_child, next; /* TETLOD_NONE: there is none */
};

struct xml_tree {
    struct xml_node *nodes; /* owned, in the order of their beginnings; 0 is the root */
    size_t count, capacity;
    const unsigned char *bytes; /* borrowed */
};

/* To be freed also after a failure. The view is that of the bytes, or NULL. */
TETLOD_CHECKED enum tetlod_status xml_tree_parse(struct xml_tree *tree, const unsigned char *bytes, size_t size,
                                                 struct file_view *view, struct tetlod_error *error);
void xml_tree_fini(struct xml_tree *tree);

/* NULL if there is none; names and their case as they are. */
const char *xml_attribute(const struct xml_node *node, const char *name);

/* The first child of that name after the child `after` (NULL: from the first on), or NULL. */
const struct xml_node *xml_child(const struct xml_tree *tree, const struct xml_node *node, const char *name,
                                 const struct xml_node *after);

#endif
