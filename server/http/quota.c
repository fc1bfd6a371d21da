/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/http/quota.h"

#include <stdint.h>

size_t quota_place(const char *client)
{
    uint32_t hash = 2166136261u; // FNV-1a
    for (; *client; client++)
        hash = (hash ^ (unsigned char)*client) * 16777619u;
    return (hash ^ hash >> 16) % QUOTA_CLIENTS;
}
