/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/mail.h"

#include "format/write/prefix.h"
#include "format/fail.h"

static const double FIELD_SHARE = 0.1;

void mail_round(struct quantise_options *quantise, double error)
{
    if (!quantise->field_bits && !(quantise->field_error > 0))
        quantise->field_error = FIELD_SHARE * error;
}

enum tetlod_status mail_write(const struct buffer *whole, double limit, const struct tetlodi_sink *sink,
                              struct tetlod_error *error)
{
    struct tetlod_file *file;
    TETLOD_TRY(tetlod_open_memory(&file, whole->bytes, whole->size, NULL, error));
    uint32_t level = tetlod_level_for_error(tetlod_info(file), limit, TETLOD_NONE, TETLOD_MAX);
    if (level == TETLOD_NONE) // --metric sva and measured do not certify
        level = tetlod_level_for_error(tetlod_info(file), limit, TETLOD_NONE, TETLOD_SAMPLED);
    enum tetlod_status status = level == TETLOD_NONE
                                    ? tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                                                   "no level is within an error of %g: rounding is in it; keep more "
                                                   "bits", limit)
                                    : tetlodi_write_prefix(file, level, sink, error);
    tetlod_close(file);
    return status;
}
