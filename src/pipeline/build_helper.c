/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/build_helper.h"

#include "format/fail.h"
#include "src/cells/border_help.h"
#include "src/cells/cell_help.h"
#include "src/measure/measure_shared.h"
#include "src/pipeline/share_pages.h"
#include "src/util/parallel.h"

static enum tetlod_status answer(const struct work_share *share, unsigned threads, const struct helper_hooks *hooks,
                                 struct kept_mesh *kept, struct tetlod_error *error)
{
    enum work_call call = CALL_OVER;
    const struct work_share *crew;
    for (;;) {
        TETLOD_TRY(share->call(share, &call, &crew, error));
        if (call == CALL_OVER)
            return TETLOD_OK;
        if (call == CALL_BORDER)
            TETLOD_TRY(border_help(crew, threads, kept, error));
        else if (call == CALL_CELLS || call == CALL_ROOT)
            TETLOD_TRY(cells_help(crew, threads, error));
        else if (call == CALL_SAMPLES)
            TETLOD_TRY(measure_help(crew, threads, kept, hooks->settle, error));
        else if (call == CALL_PAGES)
            TETLOD_TRY(pages_help(crew, threads, error));
        else
            TETLOD_TRY(hooks->other(hooks->opaque, call, error));
    }
}

enum tetlod_status build_helper(const struct work_share *share, unsigned threads, const struct helper_hooks *hooks,
                                struct tetlod_error *error)
{
    struct kept_mesh kept = {0};
    enum tetlod_status status = answer(share, threads ? threads : parallel_cores(), hooks, &kept, error);
    kept_mesh_fini(&kept);
    return status;
}
