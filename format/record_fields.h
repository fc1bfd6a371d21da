/* SPDX-License-Identifier: BSD-3-Clause */
/* The values of fields in a record (SPEC 8). Not installed. */
#ifndef TETLOD_RECORD_FIELDS_H
#define TETLOD_RECORD_FIELDS_H

#include "format/record.h"

/* Which components of a field repeat others, at the begin of its first frame: models->copied, which an encoder has set. */
void tetlodi_copies_code(struct tetlodi_coder *coder, struct tetlodi_field_models *models, unsigned components);

/* Codes the children's values of all fields, after their positions. What a frame holds wrongly is said by the first coder. */
void tetlodi_record_fields(struct tetlodi_recorder *recorder, const struct tetlodi_record *record);

#endif
