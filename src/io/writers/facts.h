/* SPDX-License-Identifier: BSD-3-Clause */
/* Facts of a mesh as a whole in a file: the stream and the level that it was taken from, its time, its errors. Formats
 * of VTK have them as field data. client-examples/ERRORS.md lists the names. */
#ifndef TETLOD_FACTS_H
#define TETLOD_FACTS_H

#include "src/mesh/tetmesh.h"

struct fact {
    const char *name;
    const char *field; /* whose name stands behind, after a blank; NULL: none */
    const char *codes; /* the characters of a text, one number each; NULL: `value` is the fact */
    double value;
};

/* False: there are not so many. A mesh that was taken from no stream has none. */
bool fact_of(const struct tetmesh *mesh, uint32_t number, struct fact *out);

#endif
