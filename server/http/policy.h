/* SPDX-License-Identifier: BSD-3-Clause */
/* Who may read, as the operator said it. It may be replaced while requests are answered: each holds the one it began
 * with. */
#ifndef TETLOD_SERVER_POLICY_H
#define TETLOD_SERVER_POLICY_H

#include <stddef.h>

struct access_policy {
    const char *const *origins; /* that may read answers, or "*"; none given: all, on local addresses none */
    size_t origin_count;
    const char *const *hosts; /* names that Host may have on loopback beside localhost, or "*" */
    size_t host_count;
    const char *token; /* NULL: none is asked for */
};

/* The policy that is valid now. Any thread may call. */
struct access;

/* NULL if memory is out. Starts with no policy: everybody may read. */
struct access *access_new(void);
void access_free(struct access *access);

/* Replaces the policy by a copy of this one; 0 if memory is out. */
int access_set(struct access *access, const struct access_policy *policy);

/* The current policy until it is let go. Of NULL: that everybody may read. */
const struct access_policy *access_hold(struct access *access);
void access_let_go(struct access *access, const struct access_policy *policy);

#endif
