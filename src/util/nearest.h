/* SPDX-License-Identifier: BSD-3-Clause */
/* The name that somebody may have meant. */
#ifndef TETLOD_NEAREST_H
#define TETLOD_NEAREST_H

/* Letters to change, add or leave out to make one name of the other, where capitals do not count. */
unsigned nearest_distance(const char *a, const char *b);

/* Takes `name` as *io_best if it is like `text` and more so than *io_best, which begins as NULL. */
void nearest_offer(const char *text, const char *name, const char **io_best);

#endif
