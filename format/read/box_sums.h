/* SPDX-License-Identifier: BSD-3-Clause */
/* The section KSUM (SPEC 3.9): sums over the original by boxes of a k-d tree and by regions. Not installed. */
#ifndef TETLOD_BOX_SUMS_H
#define TETLOD_BOX_SUMS_H

#include "format/coding/section.h"

/* Nodes of the tree are numbered from 1: node n has the children 2n and 2n + 1, and is split along the axis of its
 * depth, x, y, z, x ... */
struct tetlodi_box_sums {
    uint32_t component_count; /* of all fields; 0: there is no such section */
    unsigned depth;           /* of the leaves */
    uint32_t region_count;
    double box[2][3], volume; /* of the original */
    uint8_t *splits;          /* [node] of inner nodes: where the box is split, of 256 */
    uint16_t *parts;          /* [node] of inner nodes: the volume's part in the first child, of 65535 */
    uint8_t *depths;          /* [component] of the nodes whose values are known */
    uint32_t *firsts;         /* [component] of its nodes in the three arrays below */
    uint8_t *least, *greatest; /* values in the node's box, of 255 parts of the component's range; least > greatest: the
                                * box holds nothing */
    uint16_t *means;          /* of 65535 parts from the least to the greatest */
    double (*ranges)[2];      /* [component] */
    double (*regions)[2];     /* [region] number, rising; volume */
    double (*region_rows)[3]; /* [component * region_count] least and greatest value, integral */
};

enum { MAX_BOX_DEPTH = 12, BOX_SUMS_HEAD = 64, BOX_PARTS = 255, BOX_SPLITS = 256, VOLUME_PARTS = 65535 };

/* Room for what depth, depths and counts ask for, zero. 0: out of memory. */
int tetlodi_box_sums_allocate(struct tetlodi_box_sums *sums, uint32_t components, unsigned depth,
                              const uint8_t *depths, uint32_t regions);
void tetlodi_box_sums_fini(struct tetlodi_box_sums *sums);

/* The number that is `part` of `parts` from range[0] to range[1]. */
double tetlodi_part_of_range(const double range[2], unsigned part, unsigned parts);

/* Where a node's box is split: its box is low .. high along the axis. */
double tetlodi_box_split(const struct tetlodi_box_sums *sums, uint32_t node, double low, double high);

/* As the section's bytes, and back. Decoding checks what the section can be checked for by itself. ERR_STREAM,
 * ERR_NOMEM. */
void tetlodi_box_sums_encode(const struct tetlodi_box_sums *sums, struct tetlodi_buffer *out);
TETLOD_CHECKED enum tetlod_status tetlodi_box_sums_decode(struct tetlodi_box_sums *sums, const uint8_t *bytes,
                                                          size_t size, struct tetlod_error *error);

/* That of a stream, held against its fields; empty (0 components) if it has none. Or as tetlod_section_read. */
TETLOD_CHECKED enum tetlod_status tetlodi_box_sums_read(const struct tetlod_file *file, struct tetlodi_box_sums *out,
                                                        struct tetlod_error *error);

#endif
