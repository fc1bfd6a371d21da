/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/util/work_share.h"

#include "format/fail.h"

enum tetlod_status work_share_run(const struct work_share *share, uint32_t parts, const uint32_t *order,
                                  const struct work_input *input, enum tetlod_status (*work)(void *opaque),
                                  void *opaque, struct tetlod_error *error)
{
    bool again = true;
    TETLOD_TRY(share->begin(share->opaque, parts, order, input, error));
    while (again)
        TETLOD_TRY(share->settle(share->opaque, work(opaque), &again, error));
    return TETLOD_OK;
}
