/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The coding of records (SPEC 7 and 8), both ways. A decoder's record is read and applied; an encoder applies some
 * first and keeps the stars as they were, of which all that is said of them is coded later, on another thread. Not
 * installed.
 */
#ifndef TETLOD_RECORD_H
#define TETLOD_RECORD_H

#include <stdbool.h>

#include "format/coding/page_table.h"
#include "format/coding/recorder.h"

/* The coders are started by the caller, each level. */
TETLOD_CHECKED enum tetlod_status tetlodi_recorder_init(struct tetlodi_recorder *recorder,
                                                        struct tetlodi_replay *replay,
                                                        struct tetlod_error *error);
/* Models as they are before the base mesh. A page has its own: tetlodi_page_begin. */
void tetlodi_models_start(struct tetlodi_recorder *recorder);

void tetlodi_recorder_fini(struct tetlodi_recorder *recorder);

/* What its models take. */
uint64_t tetlodi_recorder_bytes(const struct tetlodi_recorder *recorder);

/* The walk of a level that is to have so many vertices and tetrahedra (SPEC 7.1). It ends when they are there. A
 * decoder's columns have the bytes of their frames. */
void tetlodi_level_begin(struct tetlodi_recorder *recorder, uint32_t vertices, uint32_t tets);

/* The walk of a page of the level (SPEC 7.6), to which the page adds so many vertices and tetrahedra. Models are as at
 * the beginning. The coders are started by the caller. */
void tetlodi_page_begin(struct tetlodi_recorder *recorder, const struct tetlodi_page_lists *lists, uint32_t page,
                        uint32_t vertices, uint32_t tets);

/* Is the walk at its end? */
int tetlodi_walk_ended(const struct tetlodi_recorder *recorder);

/* May a column's frames have so many labels, times a field's components, in so many bytes (SPEC 2.3)? */
bool tetlodi_labels_hold(const struct tetlodi_recorder *recorder, uint64_t labels, uint32_t column, uint64_t bytes);

/* A decoder goes to the next vertex of the walk that splits, or to the walk's end. 1 if there is one. */
int tetlodi_level_next(struct tetlodi_recorder *recorder);

/* An encoder asks under which model it is said whether the vertex at the walk splits; TETLOD_NONE: nothing is said of
 * it. Unless it splits the walk goes on. */
uint32_t tetlodi_level_asks(struct tetlodi_recorder *recorder, int split);

/* The place in the walk of a vertex that is there. */
uint32_t tetlodi_place_of(const struct tetlodi_recorder *recorder, uint32_t vertex);

/* Frames hold what an encoder writes, and end where that ends, but for zero bytes. */
TETLOD_CHECKED enum tetlod_status tetlodi_check_ends(const struct tetlodi_recorder *recorder,
                                                     struct tetlod_error *error);

/* Says what is wrong with a field's frame: its coder's `bad`. */
enum tetlod_status tetlodi_fail_field(int bad, struct tetlod_error *error);

/* Puts the positions of a record's children in place, and whether they are the original's. ERR_STREAM: one is not
 * finite. */
TETLOD_CHECKED enum tetlod_status tetlodi_record_place(struct tetlodi_replay *replay, struct tetlodi_record *record,
                                                       struct tetlod_error *error);

/* What an encoder has asked, one byte each, up to the first vertex that splits: a model, and ASKED_SPLITS if it does.
 * How many that are. */
enum { ASKED_SPLITS = 0x80 };
size_t tetlodi_splits_encode(struct tetlodi_recorder *recorder, const uint8_t *asked, size_t count);

/* Encodes a record: stars[child - 1] as it was before that child parted from it, with labels, edges at which tetrahedra
 * come back, and the places of extras. It goes into the log of fields, whose memory is given. 0 if that is out. */
int tetlodi_record_encode(struct tetlodi_recorder *recorder, struct tetlodi_memory *memory,
                          struct tetlodi_record *record, struct tetlodi_star_view *stars);

/* Decodes the record of the next vertex that splits. Of one that fails the fields' log has nothing. */
TETLOD_CHECKED enum tetlod_status tetlodi_record_decode(struct tetlodi_recorder *recorder, struct tetlod_error *error);

#endif
