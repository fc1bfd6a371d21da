/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/readers/ensight_words.h"

static const struct ensight_element elements[] = {
    {"tetra4", VTK_TYPE_TET, 4, false},
    {"tetra10", VTK_TYPE_TET10, 10, false},
    {"pyramid5", VTK_TYPE_PYRAMID, 5, false},
    {"pyramid13", VTK_TYPE_PYRAMID13, 13, false},
    {"penta6", VTK_TYPE_WEDGE, 6, false},
    {"penta15", VTK_TYPE_WEDGE15, 15, false},
    {"hexa8", VTK_TYPE_HEXAHEDRON, 8, false},
    {"hexa20", VTK_TYPE_HEXAHEDRON20, 20, false},
    {"point", VTK_TYPE_FLAT, 1, false},
    {"bar2", VTK_TYPE_FLAT, 2, false},
    {"bar3", VTK_TYPE_FLAT, 3, false},
    {"tria3", VTK_TYPE_FLAT, 3, false},
    {"tria6", VTK_TYPE_FLAT, 6, false},
    {"quad4", VTK_TYPE_FLAT, 4, false},
    {"quad8", VTK_TYPE_FLAT, 8, false},
    {"nsided", VTK_TYPE_FLAT, ENSIGHT_NSIDED, true},
    {"nfaced", VTK_TYPE_POLYHEDRON, ENSIGHT_NFACED, true},
};

const struct ensight_element *ensight_find_element(const char *line, bool *is_ghost)
{
    *is_ghost = ensight_starts(line, "g_");
    line += *is_ghost ? 2 : 0;
    size_t length = strcspn(line, " \t");
    for (size_t i = 0; i < sizeof elements / sizeof *elements; i++)
        if (strlen(elements[i].name) == length && strncmp(elements[i].name, line, length) == 0)
            return &elements[i];
    return NULL;
}

bool ensight_find_variable(const struct ensight_entry *entry, struct ensight_variable *out)
{
    static const struct {
        const char *name;
        uint32_t components;
    } kinds[] = {{"scalar per ", 1}, {"vector per ", 3}, {"tensor symm per ", 6}, {"tensor asym per ", 9}};
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        const char *where = entry->kind + strlen(kinds[k].name);
        if (!ensight_starts(entry->kind, kinds[k].name) ||
            (strcmp(where, "node") != 0 && strcmp(where, "element") != 0))
            continue;
        *out = (struct ensight_variable){entry->name, kinds[k].components, strcmp(where, "element") == 0};
        return true;
    }
    return false;
}

uint32_t ensight_place(uint32_t component, uint32_t components)
{
    return components != 6 || component < 4 ? component : 9 - component;
}
