/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The coding of records (SPEC 7 and 8), both ways: a record of the encoder is coded and applied, a decoder's is read
 * and applied. Not installed.
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
bool tetlodi_labels_hold(const struct tetlodi_recorder *recorder, uint32_t column, uint64_t bytes);

/* An encoder says whether the vertex at the walk splits; a decoder goes to the next that does, or to the walk's end. A
 * vertex that does not split is passed. 1 if there is one: it is at the walk. */
int tetlodi_level_says(struct tetlodi_recorder *recorder, int split);
int tetlodi_level_next(struct tetlodi_recorder *recorder);

/* Frames hold what an encoder writes, and end where that ends, but for zero bytes. */
TETLOD_CHECKED enum tetlod_status tetlodi_check_ends(const struct tetlodi_recorder *recorder,
                                                     struct tetlod_error *error);

/* Says what is wrong with a field's frame: its coder's `bad`. */
enum tetlod_status tetlodi_fail_field(int bad, struct tetlod_error *error);

/* Codes one record, logs it and applies it. A decoder decodes fields later, from the log. On failure the mesh is as it
 * was. */
TETLOD_CHECKED enum tetlod_status tetlodi_record_code(struct tetlodi_recorder *recorder, struct tetlodi_record *record,
                                                      struct tetlod_error *error);

/* Decodes the record of the next vertex that splits. Of one that fails the fields' log has nothing. */
TETLOD_CHECKED enum tetlod_status tetlodi_record_decode(struct tetlodi_recorder *recorder, struct tetlod_error *error);

#endif
