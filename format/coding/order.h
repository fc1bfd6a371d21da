/* SPDX-License-Identifier: BSD-3-Clause */
/* The coding of the original's numbering (SPEC 10), both ways. Not installed. */
#ifndef TETLOD_ORDER_H
#define TETLOD_ORDER_H

#include "format/common/coder.h"

/* For each vertex and tetrahedron of the finest level, in order of arrival: its number in the original; and for each
 * tetrahedron which of its corners are the original's first, second, third and fourth. An encoder's are read. */
struct tetlodi_order {
    uint32_t vertex_count, tet_count;
    uint32_t *vertices, *tets;
    uint8_t *corners; /* [4 * tet_count] */
};

/* 0: a decoder has found what no encoder writes. */
int tetlodi_order_code(struct tetlodi_coder *coder, struct tetlodi_order *order);

#endif
