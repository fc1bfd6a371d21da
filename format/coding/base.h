/* SPDX-License-Identifier: BSD-3-Clause */
/* The coding of the base mesh (SPEC 9), both ways. Not installed. */
#ifndef TETLOD_BASE_H
#define TETLOD_BASE_H

#include "format/coding/recorder.h"

/* The encoder's base mesh in any numbering, and the order that the coding gives it. All arrays are the caller's. */
struct tetlodi_base_guide {
    uint32_t vertices, tets;
    const uint32_t *corners; /* [4 * tets] */
    uint32_t *vertex_order;  /* [vertices] out: which vertex arrives as which */
    uint32_t *tet_order;     /* [tets] out */
    uint32_t *arrival;       /* [vertices] out: the inverse of vertex_order */
};

/* Codes `vertices` and `tets` of connectivity into the replay's corners. `guide` is NULL in a decoder. */
TETLOD_CHECKED enum tetlod_status tetlodi_base_connectivity(struct tetlodi_recorder *recorder, uint32_t vertices,
                                                            uint32_t tets, const struct tetlodi_base_guide *guide,
                                                            struct tetlod_error *error);

/* Codes a column for the base mesh's vertices: its codes are read, or written together with its values. Of a field,
 * component c has the codes of component copied[c]; NULL: positions. */
TETLOD_CHECKED enum tetlod_status tetlodi_base_column(struct tetlodi_replay *replay, struct tetlodi_column *column,
                                                      struct tetlodi_coder *coder, struct tetlodi_number *models,
                                                      const uint8_t *copied, struct tetlod_error *error);

#endif
