/* SPDX-License-Identifier: BSD-3-Clause */
/* The directory of sections at the index's end (SPEC 3.5): parts of a stream that are not frames of its levels. Not
 * installed. */
#ifndef TETLOD_SECTION_H
#define TETLOD_SECTION_H

#include "format/common/bytes.h"
#include "format/common/checksum.h"
#include "format/common/pack.h"
#include "format/tetlod.h"

enum { TAG_SIZE = 4, SECTION_ENTRY = 48, SECTION_CRITICAL = 1, SECTION_EARLY = 2, SECTION_PACKED = 4,
      SECTION_FLAGS = 7 };
enum { MAX_METADATA = 1 << 20 };

#define TAG_METADATA "META"
#define TAG_ORDER "ORDR"
#define TAG_CELLS "CELL"
#define TAG_CELL_VALUES "CVAL"
#define TAG_PARENTS "PCEL" /* of cells that were split: cells.h */
#define TAG_PARENT_MAP "PMAP"
#define TAG_PARENT_VALUES "PVAL"
#define TAG_TIME "TIME"
#define TAG_STEP_VALUES "TVAL"
#define TAG_CELL_TIME "CTIM" /* of values of cells: cell_steps.h */
#define TAG_CELL_STEPS "CSTP"
#define TAG_PARENT_TIME "PTIM" /* the same where there is PCEL */
#define TAG_PARENT_STEPS "PSTP"
#define TAG_TOPOLOGIES "TOPO"
#define TAG_PAGES "PAGE" /* page_table.h */
#define TAG_NEXT "NEXT"
#define TAG_SUMMARY "SUMS"
#define TAG_BOX_SUMS "KSUM"

/* What one coder has written for one level, or a section. */
struct tetlodi_frame {
    uint64_t offset, size;
    uint8_t digest[DIGEST_SIZE];
};

struct tetlodi_section {
    char tag[TAG_SIZE + 1];
    uint32_t flags;
    /* as stored; in the index its offset counts from the index's end, or that of the levels */
    struct tetlodi_frame frame;
    uint64_t plain;             /* bytes unpacked */
};

/* How a section of a tag is packed, if it is. */
enum tetlodi_packing tetlodi_section_packing(const char *tag);

/* The frame of some bytes, not placed yet. */
struct tetlodi_frame tetlodi_frame_of(const void *bytes, size_t size);

void tetlodi_put_section(struct tetlodi_buffer *out, const struct tetlodi_section *section);
void tetlodi_get_section(struct tetlodi_bytes *in, struct tetlodi_section *section);

/* How many bytes the early sections have, and the others. False: a section does not begin where those before it end. */
bool tetlodi_sections_measure(const struct tetlodi_section *sections, uint32_t count, uint64_t *early, uint64_t *late);

/* Refuses malformed sections, known ones that are not as they should be, and unknown critical ones. ERR_STREAM,
 * ERR_VERSION. */
TETLOD_CHECKED enum tetlod_status tetlodi_sections_check(const struct tetlodi_section *sections, uint32_t count,
                                                         struct tetlod_error *error);

/* The first section with a tag, or NULL. */
const struct tetlodi_section *tetlodi_section_find(const struct tetlodi_section *sections, uint32_t count,
                                                   const char *tag);

#endif
