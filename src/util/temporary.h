/* SPDX-License-Identifier: BSD-3-Clause */
/* A file of a temporary name that a signal which ends the process removes. */
#ifndef TETLOD_TEMPORARY_H
#define TETLOD_TEMPORARY_H

struct temporary;

/* Creates it by mkostemp: `name` ends in XXXXXX, is changed, and borrowed. Until it is ended, SIGINT, SIGTERM and
 * SIGHUP, where nobody ignores or handles them (but for once, SA_RESETHAND), are blocked in the calling thread and in
 * those that it starts: a thread of its own waits for them, removes the file and lets the signal end the process.
 * Returns the file's descriptor, or -1 and errno. *out may be NULL: memory is short, or there is no thread; the file is
 * there all the same. */
int temporary_open(struct temporary **out, char *name);

/* The file is the caller's, whether renamed or removed. Takes NULL. */
void temporary_end(struct temporary *temporary);

#endif
