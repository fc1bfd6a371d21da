/* SPDX-License-Identifier: BSD-3-Clause */
/* The DataItems of an XDMF file: numbers in its text, in raw files, or in HDF5 files. */
#ifndef TETLOD_XDMF_ITEM_H
#define TETLOD_XDMF_ITEM_H

#include "src/io/services/assemble.h"
#include "src/io/services/file_values.h"
#include "src/io/services/xml_tree.h"

struct xdmf_source {
    const struct xml_tree *tree;
    const struct io_input *input;
};

struct xdmf_item {
    uint64_t count;
    double *doubles; /* owned, one of the two */
    uint32_t *numbers; /* what does not fit is TETLOD_NONE */
    enum tetlod_type type;
    bool is_integer;
};

/* All numbers of an item, as numbers of points and the like, or as doubles. */
TETLOD_CHECKED enum tetlod_status xdmf_load(const struct xdmf_source *source, const struct xml_node *node,
                                            bool as_numbers,
                                            struct xdmf_item *out, struct tetlod_error *error);
void xdmf_item_fini(struct xdmf_item *item);

/* The part of a grid of that name, wherever it stands: in the grid, where its Reference says, or in a grid that
 * xi:include points to; or NULL. */
const struct xml_node *xdmf_part(const struct xdmf_source *source, const struct xml_node *grid, const char *name);

/* The node itself, or the one that its Reference attribute or an xpointer names; NULL stays NULL. */
const struct xml_node *xdmf_referred(const struct xdmf_source *source, const struct xml_node *node);

#endif
