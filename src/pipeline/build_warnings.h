/* SPDX-License-Identifier: BSD-3-Clause */
/* What a build found in its input that whoever built should know. */
#ifndef TETLOD_BUILD_WARNINGS_H
#define TETLOD_BUILD_WARNINGS_H

#include "src/pipeline/build.h"

/* Calls `say` once for each warning, with a line without its end. */
void build_warnings(const struct build_report *report, void (*say)(void *opaque, const char *line), void *opaque);

#endif
