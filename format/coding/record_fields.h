/* SPDX-License-Identifier: BSD-3-Clause */
/* The values of fields in a record (SPEC 8). Not installed. */
#ifndef TETLOD_RECORD_FIELDS_H
#define TETLOD_RECORD_FIELDS_H

#include "format/coding/recorder.h"

/* The code of the first child if the vertex is in the middle of all. */
int64_t tetlodi_middle(const struct tetlodi_scale *scale, unsigned axis, int64_t vertex_code, const int64_t codes[4],
                       uint32_t children);

/* Which components of a field repeat others, at the begin of its first frame: models->copied, which an encoder has
 * set. */
void tetlodi_copies_code(struct tetlodi_coder *coder, struct tetlodi_field_models *models, unsigned components);

/* Adds a record with its star as it was before it. 0 if out of memory. */
int tetlodi_field_log_add(const struct tetlodi_recorder *recorder, struct tetlodi_field_log *log,
                          struct tetlodi_memory *memory, const struct tetlodi_star_view *star,
                          const struct tetlodi_record *record);

static inline void tetlodi_field_log_clear(struct tetlodi_field_log *log)
{
    log->count = 0;
    log->link_count = log->location_count = 0;
}

void tetlodi_field_log_fini(struct tetlodi_field_log *log, struct tetlodi_memory *memory);

/* Makes room for the values of all records so far. 0 if out of memory. */
int tetlodi_fields_room(struct tetlodi_recorder *recorder);

/* Decodes a column's values for all records of a log and puts them in place. There is room. Columns may be decoded in
 * several threads. The column's coder is `bad` if its frame is damaged: BAD_VALUE if it holds a value that is not
 * finite. */
void tetlodi_field_decode(struct tetlodi_recorder *recorder, const struct tetlodi_field_log *log, uint32_t field);

/* Sets a field's codes [component][child] of a record that is encoded. */
typedef void tetlodi_codes_of(void *opaque, uint32_t field, const struct tetlodi_field_record *record,
                              int64_t (*codes)[4]);

/* The same for an encoder. */
void tetlodi_field_encode(struct tetlodi_recorder *recorder, const struct tetlodi_field_log *log, uint32_t field,
                          tetlodi_codes_of *codes_of, void *opaque);

/* Puts the codes of a record's children into a column: the first in the vertex's place, whose own go into `before`.
 * There is room. The caller counts the column's records. 0, with the vertex unchanged, if a value is not finite. */
int tetlodi_column_place(struct tetlodi_column *column, int position, uint32_t vertex, uint32_t first_child,
                         uint32_t children,
                         uint32_t record, int64_t (*codes)[4]);

#endif
