/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/util/memory_limit.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { PATH_CAPACITY = 4096 };

/* The number in a file; UINT64_MAX where there is none ("max"). */
static uint64_t read_limit(const char *path)
{
    char text[32] = "";
    FILE *file = fopen(path, "re");
    size_t size = file ? fread(text, 1, sizeof text - 1, file) : 0;
    if (file)
        fclose(file);
    text[size] = 0;
    return text[0] >= '0' && text[0] <= '9' ? strtoull(text, NULL, 10) : UINT64_MAX;
}

/* The least limit of a group and of those that it is in. In a container the group's own path may not be there, but the
 * top is. */
static uint64_t group_limit(const char *root, const char *mount, const char *group, const char *name)
{
    char path[PATH_CAPACITY], at[PATH_CAPACITY];
    uint64_t least = UINT64_MAX;
    snprintf(at, sizeof at, "%s", group);
    for (;;) {
        int size = snprintf(path, sizeof path, "%s%s%s/%s", root, mount, at, name);
        uint64_t limit = size > 0 && (size_t)size < sizeof path ? read_limit(path) : UINT64_MAX;
        least = limit < least ? limit : least;
        char *slash = strrchr(at, '/');
        if (!slash)
            return least;
        *slash = 0;
    }
}

uint64_t memory_limit(const char *root)
{
    uint64_t limit = (uint64_t)sysconf(_SC_PHYS_PAGES) * (uint64_t)sysconf(_SC_PAGESIZE);
    char path[PATH_CAPACITY], line[PATH_CAPACITY];
    snprintf(path, sizeof path, "%s/proc/self/cgroup", root);
    FILE *file = fopen(path, "re");
    while (file && fgets(line, sizeof line, file)) { // NUMBER:CONTROLLERS:PATH
        line[strcspn(line, "\n")] = 0;
        char *controllers = strchr(line, ':'), *group = controllers ? strchr(controllers + 1, ':') : NULL;
        if (!group)
            continue;
        *group++ = 0;
        controllers++;
        uint64_t found = UINT64_MAX;
        if (!*controllers)
            found = group_limit(root, "/sys/fs/cgroup", group, "memory.max");
        else if (strstr(controllers, "memory"))
            found = group_limit(root, "/sys/fs/cgroup/memory", group, "memory.limit_in_bytes");
        limit = found < limit ? found : limit;
    }
    if (file)
        fclose(file);
    return limit;
}
