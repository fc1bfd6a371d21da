/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Some of a stream's pages (SPEC 7.6), decoded in the browser: server/web/client/paging.js says which, and brings their
 * bytes; the mesh is copied to the view, which adopts it (server/web/wasm/view_adopt.c).
 */
#ifndef TETLOD_PAGING_H
#define TETLOD_PAGING_H

#include "format/tetlod.h"
#include "server/web/refine/finer.h"

/* Frames of a page: its geometry, and the fields that are decoded. */
enum { MAX_PAGE_FRAMES = 257 };

/* A page, by its number among those of all levels. paging.js knows this layout. */
struct paging_page {
    double low[3], high[3];
    double frames[MAX_PAGE_FRAMES][2]; /* offset and size */
    uint32_t frame_count;
    uint32_t level, vertices, tets;    /* the two: that it adds */
    uint32_t needed_count;
    const uint32_t *needed;            /* of the level before, by their numbers there */
};

struct paging;

/* Those that can fail return an enum tetlod_status, which paging_message explains. */
REFINE_EXPORT(paging_new) struct paging *paging_new(void);
REFINE_EXPORT(paging_message) const char *paging_message(const struct paging *paging);

/* As of a view: which fields the bytes are of, and the bytes up to the last level before those in pages. */
REFINE_EXPORT(paging_select) uint32_t paging_select(struct paging *paging, const char *names, uint32_t count);
REFINE_EXPORT(paging_add) uint32_t paging_add(struct paging *paging, const void *bytes, uint32_t size);
/* Decodes that level, with these fields (count TETLOD_NONE: all). */
REFINE_EXPORT(paging_open)
uint32_t paging_open(struct paging *paging, const uint32_t *fields, uint32_t count);

REFINE_EXPORT(paging_count) uint32_t paging_count(const struct paging *paging);
/* Valid until the next one; NULL: there is none of this number. */
REFINE_EXPORT(paging_page) const struct paging_page *paging_page(struct paging *paging, uint32_t page);

/* The boundary's triangles of the mesh as it is. */
struct paging_walls {
    uint32_t count;
    const uint32_t *corners; /* [4 * triangle]: a triangle's, and the one of its tetrahedron that is opposite */
};
/* Valid until the next one; NULL: no memory. */
REFINE_EXPORT(paging_walls) const struct paging_walls *paging_walls(struct paging *paging);

/* Bytes of pages, until they are forgotten. */
REFINE_EXPORT(paging_put) uint32_t paging_put(struct paging *paging, double offset, const void *bytes, uint32_t size);
REFINE_EXPORT(paging_forget) void paging_forget(struct paging *paging);

/* From now on the mesh is to have the pages with these numbers, and what they need. */
REFINE_EXPORT(paging_choose)
uint32_t paging_choose(struct paging *paging, const uint32_t *pages, uint32_t count);
/* Decodes pages of so many vertices, at least one; TETLOD_MORE until the mesh has them. */
REFINE_EXPORT(paging_step) uint32_t paging_step(struct paging *paging, uint32_t vertices);
/* The mesh as it is; its `parts` are the levels that its tetrahedra are of. NULL: no memory. */
REFINE_EXPORT(paging_mesh) const struct refine_mesh *paging_mesh(struct paging *paging);
/* [vertices] of it: the vertex that each was split from, one before it, or itself. */
REFINE_EXPORT(paging_parents) const uint32_t *paging_parents(const struct paging *paging);
/* The values of one of its fields, their number for each vertex; NULL: it is not decoded. */
REFINE_EXPORT(paging_values) const double *paging_values(const struct paging *paging, uint32_t field);

#endif
