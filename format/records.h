/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The coding of refinement records against the mesh that both sides hold (SPEC.md, records). One pass of code serves the
 * writer and the cursor: in a coder that encodes, a record's members are what is written; in one that decodes, they are filled.
 */
#ifndef TETLOD_RECORDS_H
#define TETLOD_RECORDS_H

#include "format/coder.h"
#include "format/state.h"

enum { SPLIT_CONTEXTS = 16, LABEL_CONTEXTS = 160, POSITION_CONTEXTS = 18 };

/* What has been learned so far. It carries on from level to level. */
struct tetlodi_geometry_model {
    struct tetlodi_bit split[SPLIT_CONTEXTS], children[2], placement[2], label[LABEL_CONTEXTS], label_of_many[3];
    struct tetlodi_bit pair, boundary[2];
    struct tetlodi_number position[POSITION_CONTEXTS], exceptions, exception_vertex;
};

struct tetlodi_field_model {
    struct tetlodi_number residual[2]; /* of the child that stays where the vertex was, of the others */
};

struct tetlodi_codec {
    struct tetlodi_state *state; /* borrowed */
    bool wide_positions;
    const uint8_t *wide_fields;  /* [field_count], borrowed */
    struct tetlodi_coder geometry, *fields; /* [field_count] */
    struct tetlodi_geometry_model geometry_model;
    struct tetlodi_field_model *field_models; /* [field_count] */
    uint32_t walk, level_vertices; /* where the level's walk is; vertices when it began */
    struct tetlodi_scratch *scratch;
};

TETLOD_CHECKED enum tetlod_status tetlodi_codec_init(struct tetlodi_codec *codec, struct tetlodi_state *state,
                                                     bool wide_positions, const uint8_t *wide_fields,
                                                     struct tetlod_error *error);
void tetlodi_codec_fini(struct tetlodi_codec *codec);

/* Starts a level's walk; its coders have been set. */
void tetlodi_level_begin(struct tetlodi_codec *codec);

/* The walk's next step: does the vertex at it split? `split` says so in an encoder. Returns that, with the vertex in *out_slot;
 * a vertex that does not is passed. Not at the walk's end (walk == state->vertices). */
bool tetlodi_walk_step(struct tetlodi_codec *codec, bool split, uint32_t *out_slot);

/* Codes a record at its slot, without bringing it in. Its labels are the codec's scratch; in a decoder, its values and
 * tetrahedra are too. In an encoder record->tets is put into the order of arrival. ERR_STREAM, ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status tetlodi_record_code(struct tetlodi_codec *codec, struct tetlodi_record *record,
                                                      struct tetlod_error *error);

/* Are they the same up to an even permutation? */
bool tetlodi_same_tet(const uint32_t a[4], const uint32_t b[4]);

/* The labels' array, room for the star of `slot`. NULL: out of memory. */
uint8_t *tetlodi_record_labels(struct tetlodi_codec *codec, uint32_t slot);

#endif
