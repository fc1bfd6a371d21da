/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A level that is finer in boxes, made in the browser of the bytes that the page's decoder has: a module of its own,
 * which is loaded when it is first wanted, and whose memory goes with it. server/web/client/refine.js calls the
 * exports; the mesh is copied to the view, which adopts it (server/web/wasm/view_adopt.c).
 */
#ifndef TETLOD_FINER_H
#define TETLOD_FINER_H

#include "src/stream/region.h"

#ifdef __wasm__
#define REFINE_EXPORT(name) __attribute__((export_name(#name)))
#else
#define REFINE_EXPORT(name)
#endif

/* The last mesh that was made. refine.js knows this layout. */
struct refine_mesh {
    uint32_t vertices, tets;
    const double *positions;   /* [3 * vertices] */
    const uint32_t *corners;   /* [4 * tets] */
    const uint32_t *numbers;   /* [tets] in the original */
    const double *parts;       /* [tets] enum region_part */
    uint32_t counts[REGION_PARTS];
};

struct refine;

/* Those that can fail return an enum tetlod_status, which refine_message explains. */
REFINE_EXPORT(refine_allocate) void *refine_allocate(uint32_t size);
REFINE_EXPORT(refine_release) void refine_release(void *block);
REFINE_EXPORT(refine_new) struct refine *refine_new(void);
REFINE_EXPORT(refine_message) const char *refine_message(const struct refine *refine);

/* As of a view: which fields the bytes are of, and the bytes. */
REFINE_EXPORT(refine_select) uint32_t refine_select(struct refine *refine, const char *names, uint32_t count);
REFINE_EXPORT(refine_add) uint32_t refine_add(struct refine *refine, const void *bytes, uint32_t size);

/* For boxes at levels up to `level`, with these fields (count TETLOD_NONE: all). */
REFINE_EXPORT(refine_begin)
uint32_t refine_begin(struct refine *refine, uint32_t level, const uint32_t *fields, uint32_t count);
/* Decodes one level more; TETLOD_MORE until all are there. */
REFINE_EXPORT(refine_grow) uint32_t refine_grow(struct refine *refine);
/* Makes the mesh: of level `coarse`, and of `fine` in boxes, six numbers each. */
REFINE_EXPORT(refine_make)
uint32_t refine_make(struct refine *refine, uint32_t coarse, uint32_t fine, const double *boxes, uint32_t count);
REFINE_EXPORT(refine_mesh) const struct refine_mesh *refine_mesh(const struct refine *refine);
REFINE_EXPORT(refine_field_count) uint32_t refine_field_count(const struct refine *refine);
/* The values of one of its fields; their number for each vertex. */
REFINE_EXPORT(refine_values) const double *refine_values(const struct refine *refine, uint32_t field);
REFINE_EXPORT(refine_components) uint32_t refine_components(const struct refine *refine, uint32_t field);

/* ---- within the module */

/* A feed with room for as much as wasm32 addresses, less what else there is. */
enum tetlod_status refine_feed_new(struct tetlod_feed **out, struct tetlod_error *error);

/* tetlod_feed_select with `count` names that each end with NUL. */
enum tetlod_status refine_select_names(struct tetlod_feed *feed, const char *names, uint32_t count,
                                       struct tetlod_error *error);

#endif
