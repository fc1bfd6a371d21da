/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/build_warnings.h"

#include <inttypes.h>
#include <stdio.h>

void build_warnings(const struct build_report *report, void (*say)(void *opaque, const char *line), void *opaque)
{
    const struct {
        uint64_t count;
        const char *what;
    } warnings[] = {
        {report->turned_tets, "tetrahedra are numbered the other way round than their neighbours: they are contracted "
                              "as if turned, and "
                              "stored as they are numbered"},
        {report->loose_tets, "tetrahedra share so few points that hardly any can be contracted; where points at one "
                             "place are meant to be one: tetlod build --weld 0"},
        {report->degenerate_tets, "degenerate tetrahedra, carried along; no promise is made inside them"},
        {report->inverted_tets, "inverted tetrahedra, carried along; no promise is made inside them"},
        {report->folded_tets, "folded tetrahedra, on the same side of a face as their neighbour, carried along; no "
                              "promise is made "
                              "inside them"},
    };
    for (size_t i = 0; i < sizeof warnings / sizeof *warnings; i++) {
        char line[200];
        if (!warnings[i].count)
            continue;
        snprintf(line, sizeof line, "%" PRIu64 " %s", warnings[i].count, warnings[i].what);
        say(opaque, line);
    }
}
