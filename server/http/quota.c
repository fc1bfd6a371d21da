/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/http/quota.h"

#include "src/util/hash.h"

size_t quota_place(const char *client)
{
    return hash_folded(hash_text(HASH_START, client)) % QUOTA_CLIENTS;
}
