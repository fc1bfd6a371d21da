/* SPDX-License-Identifier: BSD-3-Clause */
/* Pages that several programs code: parts of a stage are the stacks of some levels (format/write/page_stack.h). */
#ifndef TETLOD_SHARE_PAGES_H
#define TETLOD_SHARE_PAGES_H

#include "format/write/page_stack.h"
#include "src/util/work_share.h"

struct page_sharing {
    const struct work_share *share;
    unsigned threads; /* 0: all cores */
};

/* As `share` of an input that is written: `opaque` is a page_sharing. ERR_NOMEM, ERR_IO, or what the share fails
 * with. */
TETLOD_CHECKED enum tetlod_status pages_share(void *opaque, const struct tetlodi_stack_work *work,
                                              struct tetlod_error *error);

/* Of a helper, once it is called (work_share.h): its share of the stacks. */
TETLOD_CHECKED enum tetlod_status pages_help(const struct work_share *share, unsigned threads,
                                             struct tetlod_error *error);

#endif
