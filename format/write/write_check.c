/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/write/write_check.h"

#include <stdbool.h>
#include <string.h>

#include "format/coding/index.h"
#include "format/common/allowance.h"
#include "format/write/cells_write.h"

int tetlodi_has_tail(const struct tetlodi_write_input *in)
{
    bool wanted = false;
    for (uint32_t f = 0; f < in->field_count; f++)
        wanted |= in->fields[f].exact != NULL;
    return wanted && in->level_count > 1 && in->levels[in->level_count - 2].contractions == 0;
}

/* Does an earlier field have this one's name? */
static bool names_before(const struct tetlodi_write_input *in, uint32_t field)
{
    for (uint32_t f = 0; f < field; f++)
        if (strcmp(in->fields[f].name, in->fields[field].name) == 0)
            return true;
    return false;
}

/* Why the groups of pages are none, or NULL. */
static const char *groups_wrong(const struct tetlodi_write_input *in)
{
    uint32_t levels = in->level_count - tetlodi_has_tail(in);
    if (in->group_count >= levels && in->group_count)
        return "its coarsest level is in pages";
    for (uint32_t g = 0; g < in->group_count; g++) {
        const struct tetlodi_write_group *group = &in->groups[g];
        uint32_t level = levels - in->group_count + g, end = in->levels[level].contractions;
        for (uint32_t page = 0; page < group->pages; page++) {
            if (group->ends[page] < end)
                return "its pages are not in order";
            end = group->ends[page];
        }
        if (group->nodes != 2 * group->pages - 1 || end != in->levels[level - 1].contractions)
            return "its pages are not a level";
    }
    return NULL;
}

const char *tetlodi_input_wrong(const struct tetlodi_write_input *in)
{
    const char *wrong = NULL;
    if (!in->vertices || !in->tets || !in->level_count || in->field_count > MAX_FIELDS ||
        in->level_count > MAX_LEVELS || in->vertices == UINT32_MAX || in->tets > MAX_HELD_TETS)
        wrong = "there is nothing in it, or too much";
    else if (in->levels[in->level_count - 1].contractions != 0 || in->levels[0].contractions != in->contractions)
        wrong = "its levels do not lead from the base mesh to the original";
    else if (in->section_count > MAX_SECTIONS - MAX_OWN_SECTIONS - MAX_FIELDS)
        wrong = "it has too many sections";
    else if (tetlodi_metadata_wrong(in->metadata))
        wrong = "its metadata is too large";
    wrong = wrong ? wrong : groups_wrong(in);
    wrong = wrong ? wrong : tetlodi_cells_wrong(in->cells, in->cell_field_count, in->tets);
    for (uint32_t k = 1; k < in->level_count && !wrong; k++)
        if (in->levels[k].contractions >= in->levels[k - 1].contractions &&
            !(k + 1 == in->level_count && tetlodi_has_tail(in)))
            wrong = "its levels are not in order";
    for (uint32_t f = 0; f < in->field_count && !wrong; f++)
        if (in->fields[f].exact && (!in->fields[f].bits || !tetlodi_has_tail(in)))
            wrong = "a field is to be exact later without a grid or a level for it";
        else if (names_before(in, f))
            wrong = "two fields have one name";
        else
            wrong = tetlodi_field_wrong(in->fields[f].name, in->fields[f].components);
    for (size_t t = 0; t < in->tets && !wrong; t++)
        for (int c = 0; c < 4 && !wrong; c++) {
            if (in->corners[4 * t + (size_t)c] >= in->vertices)
                wrong = "a tetrahedron's corner is out of range";
            for (int d = 0; d < c && !wrong; d++)
                if (in->corners[4 * t + (size_t)c] == in->corners[4 * t + (size_t)d])
                    wrong = "a tetrahedron lists a vertex twice";
        }
    return wrong;
}
