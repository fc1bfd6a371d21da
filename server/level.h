/* SPDX-License-Identifier: BSD-3-Clause */
/* What the handlers of levels share: formats, headers, the stream in memory. */
#ifndef TETLOD_SERVER_LEVEL_H
#define TETLOD_SERVER_LEVEL_H

#include <jansson.h>

#include "server/site.h"

/* A file format of an answer. `write` is NULL for the stream's own prefix. */
struct mesh_format {
    const char *name, *media_type;
    enum tetlod_status (*write)(const struct tetmesh *mesh, const struct tetlodi_sink *sink, struct tetlod_error *error);
};

extern const struct mesh_format mesh_formats[]; /* ends with a NULL name */

const struct mesh_format *mesh_format_find(const char *name);

/* 400 with the list of names. */
void respond_bad_format(struct exchange *exchange, const struct mesh_format *formats, const char *name);

/* False after a 400 if the query has a parameter that is not one of `names` (NULL-terminated). */
bool check_parameters(struct exchange *exchange, const char *const *names);

json_t *field_names(const struct tetlod_info *info);

/* Tetlod-Level, -Vertices, -Tets, -Error. */
void level_headers(struct response *response, const struct dataset *dataset, uint32_t level);

/* The stream that the first two captures (id, cid) name, held; NULL after a 404. */
struct dataset *captured_dataset(struct exchange *exchange);

/* The stream's bytes up to a level; of the fields' frames those that the query's `fields` names, if it is there. */
enum outcome respond_prefix(struct exchange *exchange, struct dataset *dataset, uint32_t level);

/* A level's number; false after a 400. */
bool parse_level(struct exchange *exchange, const struct tetlod_info *info, const char *text, uint32_t *out);

/* Something that is made from the mesh of a level. */
struct level_answer {
    uint32_t level;
    const char *name; /* tells it from all others that are made from the level; visible ASCII without '"' and '/' */
    const char *media_type;
    uint64_t file_bytes; /* an upper bound of what `write` writes */
    enum tetlod_status (*write)(const void *choice, const struct tetmesh *mesh, struct buffer *out, struct tetlod_error *error);
    const void *choice; /* copied */
    size_t choice_size;
};

enum outcome answer_from_level(struct exchange *exchange, struct dataset *dataset, const struct level_answer *answer);

/* The stream in memory, decoded up to a level if it is not yet. It is the dataset's. */
enum outcome obtain_forest(struct exchange *exchange, struct dataset *dataset, uint32_t level, const struct forest **out);

#endif
